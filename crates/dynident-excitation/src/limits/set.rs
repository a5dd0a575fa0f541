//! All limits of an experiment as rows of constraint values over a motion, and their adjoint to the motion.

use super::description::Limits;
use super::error::LimitError;
use super::floor_shapes::FloorShapes;
use super::followers::FollowerLimits;
use super::joint_motion::{JointBand, JointMotionLimits};
use super::kind::Constraint;
use super::place::PlaceLimits;
use super::power::PowerLimits;
use super::self_collision::SelfCollisionLimits;
use super::term::{Adjoint, Inputs, Term};
use super::torque::{TorqueLimits, torque_adjoint};
use super::torque_range::{SmoothTorque, TorqueRange};
use super::wrench::{Wrench, apply_wrenches};
use crate::motion::{Motion, MotionAdjoint};
use dynident_dynamics::{BatchWorkspace, Workspace, body_placements, inverse_dynamics_batch};
use dynident_model::{Model, Transform};

/// Limits prepared for an optimiser. The constraint value of row `r` at sample `s` has index `r * samples + s`; the
/// limit is kept if the value is at most 0 (see [`Constraint`]).
#[derive(Debug)]
pub struct LimitSet {
    model: Model,
    terms: Vec<Box<dyn Term>>,
    rows_of: Vec<usize>,
    constraints: Vec<Constraint>,
    bands: Vec<JointBand>,
    known: SmoothTorque,
    torque: bool,
    placements: bool,
}

/// Scratch memory of one thread for one [`LimitSet`]. It stores torques and placements of the last motion, so that
/// [`apply_adjoint`](LimitSet::apply_adjoint) after [`values`](LimitSet::values) does not compute them again.
#[derive(Debug)]
pub struct LimitWorkspace {
    batch: BatchWorkspace,
    single: Workspace,
    motion: Motion,
    /// Torque of the rigid bodies.
    tau: Vec<f64>,
    torque: TorqueRange,
    placements: Vec<Transform>,
    by_torque: Vec<f64>,
    by_range: TorqueRange,
    wrenches: Vec<Wrench>,
    q: Vec<f64>,
    by_position: Vec<f64>,
    is_continuous: bool,
}

impl LimitWorkspace {
    /// Declares that the samples are consecutive times of one motion. Distances to columns in the workspace are then
    /// also tested on the straight path in joint space from one sample to the next, so that an arm cannot pass
    /// through a thin column between two samples.
    pub fn test_between_samples(&mut self) {
        self.is_continuous = true;
    }
}

impl LimitSet {
    /// Prepares the limits for this robot.
    ///
    /// # Errors
    /// Errors of [`Limits::validate`].
    pub fn new(limits: &Limits, model: &Model) -> Result<Self, LimitError> {
        limits.validate(model)?;
        let joint_motion = JointMotionLimits::new(model, &limits.joints);
        let bands = joint_motion.bands();
        let mut terms: Vec<Box<dyn Term>> = vec![
            // This is the first term, so that the row numbers of its bands are those of the set.
            Box::new(joint_motion),
            Box::new(TorqueLimits::new(model, &limits.joints)),
            Box::new(PowerLimits::new(model, &limits.joints)),
            Box::new(FollowerLimits::new(model)),
        ];
        for limit in &limits.boxes {
            terms.push(Box::new(PlaceLimits::boxed(model, limit)?));
        }
        if let Some(limit) = &limits.floor {
            terms.push(Box::new(PlaceLimits::floor(model, limit)?));
            terms.push(Box::new(FloorShapes::new(model, limit)?));
        }
        if let Some(limit) = &limits.column {
            terms.push(Box::new(PlaceLimits::column(model, limit)?));
        }
        if let Some(limit) = &limits.self_collision {
            terms.push(Box::new(SelfCollisionLimits::new(model, limit)?));
        }
        terms.retain(|term| !term.constraints().is_empty());
        let rows_of = terms.iter().map(|term| term.constraints().len()).collect();
        let constraints: Vec<Constraint> = terms.iter().flat_map(|term| term.constraints()).collect();
        Ok(Self {
            model: model.clone(),
            known: SmoothTorque::new(&limits.known_torque, model),
            torque: terms.iter().any(|term| term.needs_torque()),
            placements: terms.iter().any(|term| term.needs_placements()),
            bands,
            terms,
            rows_of,
            constraints,
        })
    }

    /// Descriptions of the rows.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    pub(crate) fn bands(&self) -> &[JointBand] {
        &self.bands
    }

    /// Whether any limit concerns places of points of the arm: boxes, floor, column, self-collision.
    pub(crate) fn has_places(&self) -> bool {
        self.placements
    }

    /// The robot.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Creates scratch memory for this set.
    pub fn workspace(&self) -> LimitWorkspace {
        LimitWorkspace {
            batch: BatchWorkspace::new(&self.model),
            single: Workspace::new(&self.model),
            motion: Motion::default(),
            tau: Vec::new(),
            torque: TorqueRange::default(),
            placements: Vec::new(),
            by_torque: Vec::new(),
            by_range: TorqueRange::default(),
            wrenches: Vec::new(),
            q: vec![0.0; self.model.dof()],
            by_position: Vec::new(),
            is_continuous: false,
        }
    }

    /// Computes the constraint values of all rows at all samples.
    ///
    /// # Panics
    /// If the motion has another number of joints.
    pub fn values(&self, workspace: &mut LimitWorkspace, motion: &Motion, out: &mut Vec<f64>) {
        let samples = motion.samples;
        self.prepare(workspace, motion);
        out.clear();
        out.resize(self.constraints.len() * samples, 0.0);
        if samples == 0 {
            return;
        }
        let LimitWorkspace { torque, placements, is_continuous, .. } = workspace;
        let inputs =
            Inputs { motion, torque, placements, bodies: self.model.body_count(), is_continuous: *is_continuous };
        let mut rest = out.as_mut_slice();
        for (term, rows) in self.terms.iter().zip(&self.rows_of) {
            let (own, others) = rest.split_at_mut(rows * samples);
            term.values(&inputs, own);
            rest = others;
        }
    }

    /// Adds to `adjoint` the derivatives of a cost with respect to the motion, given its derivatives `weights` with
    /// respect to the [`values`](LimitSet::values). Exact, except where the constraint is not differentiable: `|x|`
    /// at zero, and distances between parallel segments. There it is one of the one-sided derivatives.
    ///
    /// # Panics
    /// If sizes differ.
    pub fn apply_adjoint(
        &self,
        workspace: &mut LimitWorkspace,
        motion: &Motion,
        weights: &[f64],
        adjoint: &mut MotionAdjoint,
    ) {
        let (samples, dof) = (motion.samples, self.model.dof());
        assert_eq!(weights.len(), self.constraints.len() * samples, "one weight per value");
        assert_eq!((adjoint.joints, adjoint.samples), (dof, samples), "the cotangent has the motion's shape");
        if samples == 0 {
            return;
        }
        self.prepare(workspace, motion);
        let LimitWorkspace {
            single,
            tau,
            torque,
            placements,
            by_torque,
            by_range,
            wrenches,
            by_position,
            is_continuous,
            ..
        } = workspace;
        by_range.reset(if self.torque { dof * samples } else { 0 });
        wrenches.clear();
        let bodies = self.model.body_count();
        wrenches.resize(if self.placements { bodies * samples } else { 0 }, Wrench::ZERO);
        let inputs = Inputs { motion, torque, placements, bodies, is_continuous: *is_continuous };
        let mut rest = weights;
        for (term, rows) in self.terms.iter().zip(&self.rows_of) {
            let (own, others) = rest.split_at(rows * samples);
            let mut adjoint = Adjoint { motion: &mut *adjoint, torque: &mut *by_range, wrenches };
            term.apply_adjoint(&inputs, own, &mut adjoint);
            rest = others;
        }
        if self.torque {
            by_torque.clear();
            by_torque.extend(by_range.low.iter().zip(&by_range.high).map(|(low, high)| low + high));
            self.known.apply_adjoint(motion, tau, by_range, by_torque, adjoint);
            torque_adjoint(&self.model, single, motion, by_torque, adjoint);
        }
        if self.placements {
            by_position.resize(dof, 0.0);
            for sample in 0..samples {
                let of = sample * bodies..(sample + 1) * bodies;
                if wrenches[of.clone()].iter().all(|wrench| *wrench == Wrench::ZERO) {
                    continue;
                }
                by_position.fill(0.0);
                apply_wrenches(&self.model, &placements[of.clone()], &mut wrenches[of], by_position);
                for (joint, pulled) in by_position.iter().enumerate() {
                    adjoint.q[joint * samples + sample] += pulled;
                }
            }
        }
    }

    /// Computes torques and placements of the motion, unless the workspace contains them.
    fn prepare(&self, workspace: &mut LimitWorkspace, motion: &Motion) {
        let (dof, samples) = (self.model.dof(), motion.samples);
        assert_eq!(motion.joints, dof, "the motion has another number of joints than the robot");
        if !(self.torque || self.placements) || workspace.motion == *motion {
            return;
        }
        workspace.motion.clone_from(motion);
        if self.torque {
            workspace.tau.resize(dof * samples, 0.0);
            inverse_dynamics_batch(&self.model, &mut workspace.batch, &motion.view(), &mut workspace.tau);
            workspace.torque.of_bodies(&workspace.tau);
            if !self.known.is_empty() {
                self.known.add(motion, &workspace.tau, &mut workspace.torque);
            }
        }
        if self.placements {
            let bodies = self.model.body_count();
            workspace.placements.resize(bodies * samples, Transform::IDENTITY);
            let LimitWorkspace { single, placements, q, .. } = workspace;
            for (sample, placements) in placements.chunks_exact_mut(bodies.max(1)).enumerate() {
                for (joint, q) in q.iter_mut().enumerate() {
                    *q = motion.q[joint * samples + sample];
                }
                placements.copy_from_slice(body_placements(&self.model, single, q));
            }
        }
    }
}
