//! Decisions that are made from the training logs before the last fit: drive inertia, cut-off, friction and lag.
//!
//! A [`Decision`] is made from the rows that result from the choices so far. A decision that revises a choice reopens
//! the choices that depend on it. Then the decisions start again at the beginning of the list, until no decision
//! revises a choice.

mod choices;
mod cutoff;
mod cutoff_of_friction;
mod decision;
mod drive_inertia;
mod friction;
mod grid_friction;
mod lag;
mod lag_before_friction;
mod workspace;

pub(crate) use choices::Choices;
pub(crate) use decision::decide_all;
pub(crate) use workspace::{Job, Workspace};

use cutoff::Cutoff;
use cutoff_of_friction::CutoffOfFriction;
use decision::Decision;
use drive_inertia::{DriveInertia, DriveInertiaWithFriction};
use friction::Friction;
use lag::Lag;
use lag_before_friction::LagBeforeFriction;

pub(crate) const DECISIONS: [&dyn Decision; 7] =
    [&DriveInertia, &Cutoff, &LagBeforeFriction, &Friction, &Lag, &DriveInertiaWithFriction, &CutoffOfFriction];
