//! **How should it move?** Trajectory families, criteria, limits, optimisers and the forecast of every parameter's
//! error bar.

#![forbid(unsafe_code)]

pub mod check;
mod column_products;
pub mod criteria;
mod definite_inverse;
mod derivative_free;
mod design;
pub mod export;
pub mod families;
mod family;
mod forecast;
mod information;
pub mod limits;
mod motion;
pub mod optimisers;
pub mod step_wise;

pub use derivative_free::{DerivativeFree, design_without_gradients};
pub use design::{Design, DesignProgress, DesignSettings, DesignTask, design, grid};
pub use family::Family;
pub use forecast::{Direction, Forecast, forecast};
pub use information::Information;
pub use motion::{Motion, MotionCotangent};
