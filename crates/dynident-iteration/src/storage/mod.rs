//! Files of an iteration, and how a run is resumed.

pub(crate) mod cut_short;
pub(crate) mod fingerprint;
pub(crate) mod runs_folder;
pub(crate) mod sealed;
pub(crate) mod store;
