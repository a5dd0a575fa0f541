//! The live page of `iterate` in the browser: the current run, its measured and desired motion, and a stop button.
//! The page is served on one address of this computer, under a path with a random token.

mod access;
mod http;
mod server;
mod state;
#[cfg(test)]
mod tests;

pub(crate) use server::LiveServer;
pub(crate) use state::LiveState;
