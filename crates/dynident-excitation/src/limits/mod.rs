//! **Limits of the motion**: the user's description, values and derivatives for optimisers, and a diagnosis of
//! infeasible motions.
//!
//! [`Limits`] is the user's description. [`LimitSet`] prepares it for a robot: normalised values `c <= 0` over a block
//! of samples, and the adjoint from multipliers to the motion. [`peaks()`] finds the extremes between samples, and
//! [`diagnose_until()`] reports violated limits and sufficient changes. The independent [`check`](crate::check) shares
//! none of this code.

mod assumed;
mod combined;
mod convex;
mod description;
mod diagnose;
mod error;
mod feasibility;
mod floor_shapes;
mod followers;
mod hull;
mod joint_motion;
mod kind;
mod known_torque;
mod link_points;
mod numbers;
mod pair_distances;
mod pairs;
mod peaks;
mod pieces;
mod place;
mod power;
mod relaxation;
mod scale;
mod segments;
mod self_collision;
mod self_collision_shapes;
mod set;
mod solids;
mod surface;
mod term;
mod torque;
mod torque_range;
mod validate;
mod wrench;

pub use assumed::{
    AssumedLimits, AssumptionThresholds, CAPSULE_RADIUS_SHARE, LimitsInForce, ShapesOfLinks, StartPositions,
};
pub use description::{BoxLimit, ColumnLimit, FloorLimit, JointLimit, Limits};
pub use diagnose::{Diagnosis, diagnose_until};
pub(crate) use diagnose::{Widened, relaxation};
pub use error::LimitError;
pub use kind::{Constraint, LimitKind};
pub use known_torque::KnownTorque;
pub use link_points::LinkPoint;
pub use pair_distances::PairDistance;
pub use pairs::{arm_length_m, neutral_posture};
pub use peaks::{Peak, PeakSettings, peaks};
pub use relaxation::{BrokenLimit, LimitChange, Relaxation};
pub use scale::LimitScale;
pub use self_collision_shapes::{LinkCapsule, LinkShape, SelfCollision, body_capsules};
pub use set::{LimitSet, LimitWorkspace};
