//! **How should it move?** Trajectory families, criteria, limits, optimisers and the forecast of every parameter's error bar.

#![forbid(unsafe_code)]

mod column_products;
pub mod criteria;
pub mod families;
mod family;
mod information;
pub mod check;
pub mod families;
mod family;
pub mod limits;
mod motion;
pub mod optimisers;
pub mod paper_problem;

pub use family::Family;
pub use information::Information;
pub use motion::{Motion, MotionCotangent};
