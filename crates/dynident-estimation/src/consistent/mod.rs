//! **Physically consistent parameters**: every pseudo-inertia positive definite, friction and drive inertia not
//! negative.
//!
//! Data determine base parameters. A [`PhysicalProblem`] defines them as combinations of the bodies' standard
//! parameters and adds known limits (mass, a box for the centre of mass, an ellipsoid around the body).
//! [`physical_fit`] finds the best consistent set, a convex problem (linear matrix inequalities) with a certified
//! solution. [`ConsistentIntervals`] computes how far each parameter can move before the fit becomes significantly
//! worse. Two independent solvers share only the certificate.

mod assembly;
mod cone;
mod conic;
mod constraints;
mod coordinates;
mod description;
mod difference;
mod error;
mod expected_error;
mod fit;
mod interior_point;
mod intervals;
mod log_cholesky;
mod precise;
mod priors;
mod products;
mod settings;
mod stacked;

pub use description::{
    BaseMap, BodyPrior, Ellipsoid, Limits, PhysicalBody, PhysicalProblem, PhysicalScalar, rough_body,
};
pub use difference::ConsistencyTest;
pub use error::PhysicalError;
pub use expected_error::{MassPrior, expected_error};
pub use fit::{PhysicalBodyFit, PhysicalFit, PhysicalStatus, physical_fit};
pub use intervals::{ConsistentInterval, ConsistentIntervals, IntervalEnd, IntervalSettings};
pub use priors::PhysicalPrior;
pub use settings::{PhysicalRoute, PhysicalSettings};
