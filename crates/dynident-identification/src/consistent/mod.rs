//! Physically consistent parameters: the best fit that has positive masses, positive definite pseudo-inertias and
//! dissipative friction.
//!
//! [`consistent_parameters`] computes all parameters from the triangular factors of the rows;
//! [`nearest_consistent_parameters`] computes them for an estimate by another method than least squares.
//! [`ConsistencySettings`] contains prior knowledge of the bodies.

mod error;
mod intervals;
mod nearest_to_nominal;
mod nominal_spread;
mod of_estimate;
mod parameter_std;
mod problem;
mod settings;

pub use error::ConsistencyError;
pub use intervals::{ParameterInterval, consistent_intervals};
pub use nearest_to_nominal::{inertials, nearest_to_nominal};
pub(crate) use nominal_spread::body_spread;
pub use nominal_spread::{nominal_covariance, usual_errors_of_bodies};
pub use of_estimate::consistent_with_estimate;
pub use parameter_std::parameter_std;
pub(crate) use problem::consistent_body;
pub use problem::{
    consistency_problem, consistent_parameters, inconsistent_nominal_bodies, nearest_consistent_parameters,
    typical_length_m,
};
pub use settings::{BodyKnowledge, ConsistencySettings, EllipsoidSettings};
