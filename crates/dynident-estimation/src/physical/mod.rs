//! Estimates that a machine could have: every body's pseudo-inertia positive definite, friction and drive inertia not negative.
//!
//! Data fix base parameters; a [`PhysicalProblem`] says which sums of the bodies' own parameters those are. [`physical_fit`] finds the possible set that fits best
//! (a convex problem with a certificate), [`base_feasibility`] says whether a given base vector is one of a possible machine, with a proof if not, and
//! [`nearest_feasible`] which possible one is nearest to it. Two solvers that share nothing but the certificate agree on the optimum.

mod assembly;
mod cone;
mod conic;
mod constraints;
mod coordinates;
mod description;
mod error;
mod feasibility;
mod fit;
mod interior_point;
mod intervals;
mod log_cholesky;
mod precise;
mod priors;
mod settings;
mod stacked;

pub use description::{BaseMap, Ellipsoid, Limits, PhysicalBody, PhysicalProblem, PhysicalScalar, rough_body};
pub use error::PhysicalError;
pub use feasibility::{BaseFeasibility, BaseVerdict, SeparatingSum, base_feasibility, nearest_feasible};
pub use fit::{PhysicalBodyFit, PhysicalFit, PhysicalStatus, physical_fit};
pub use intervals::{IntervalEnd, IntervalSettings, PossibleInterval, PossibleIntervals};
pub use priors::PhysicalPrior;
pub use settings::{PhysicalRoute, PhysicalSettings};
