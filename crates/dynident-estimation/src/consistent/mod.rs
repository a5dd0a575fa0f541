//! **Which bodies fit the data?** Inertial parameters that real bodies could have: every pseudo-inertia positive
//! definite, friction and drive inertia not negative.
//!
//! Data determine base parameters; a [`PhysicalProblem`] says which sums of the bodies' own parameters those are, and
//! what is known of the bodies beside (mass, a box for the centre of mass, an ellipsoid around it). [`physical_fit`]
//! finds the consistent set that fits best, a convex problem (linear matrix inequalities) whose solution comes with a
//! certificate; [`ConsistentIntervals`] how far each parameter can move before the fit becomes significantly worse. Two
//! solvers that share nothing but the certificate agree on the optimum.

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

pub use description::{BaseMap, Ellipsoid, Limits, PhysicalBody, PhysicalProblem, PhysicalScalar, rough_body};
pub use difference::ConsistencyTest;
pub use error::PhysicalError;
pub use expected_error::{Belief, expected_error};
pub use fit::{PhysicalBodyFit, PhysicalFit, PhysicalStatus, physical_fit};
pub use intervals::{ConsistentInterval, ConsistentIntervals, IntervalEnd, IntervalSettings};
pub use priors::PhysicalPrior;
pub use settings::{PhysicalRoute, PhysicalSettings};
