//! The torque of a robot and its derivatives by motion and parameters: what the spline fit asks of a robot.

use crate::regressor_model::RegressorModel;
use dynident_dynamics::{BatchWorkspace, MotionGradient, Panels, regressor_panels, regressor_panels_adjoint};
use dynident_estimation::{EstimationError, TorqueModel, TorqueSlopes};
use dynident_model::terms::JointMotion;
use rayon::prelude::*;

/// Samples that one thread takes at a time.
const BLOCK: usize = 128;

/// Torque and its derivatives, blocks of samples side by side. Torque terms must depend on the motion of one instant
/// alone.
#[derive(Clone, Copy, Debug)]
pub struct SplineTorque<'a> {
    model: &'a RegressorModel,
}

/// Some samples of a motion, joint-major.
struct Part {
    first: usize,
    samples: usize,
    motion: [Vec<f64>; 3],
}

impl<'a> SplineTorque<'a> {
    /// Of this model; parameters are the columns of its layout.
    pub fn new(model: &'a RegressorModel) -> Self {
        Self { model }
    }

    fn parts(&self, motion: &JointMotion<'_>) -> Vec<Part> {
        let of = |first: usize| {
            let samples = BLOCK.min(motion.samples - first);
            let cut = |values: &[f64]| -> Vec<f64> {
                let joints = values.chunks_exact(motion.samples);
                joints.flat_map(|own| own[first..first + samples].iter().copied()).collect()
            };
            Part { first, samples, motion: [motion.q, motion.dq, motion.ddq].map(cut) }
        };
        (0..motion.samples).step_by(BLOCK).map(of).collect()
    }

    /// Panels of a part.
    fn panels(&self, workspace: &mut BatchWorkspace, part: &Part) -> Panels {
        let mut panels = Panels::default();
        let motion = part.view();
        regressor_panels(self.model.model(), workspace, self.model.layout(), &motion, &mut panels);
        panels
    }

    /// Torque of joint `joint` from its panel.
    fn torque_of(&self, joint: usize, panels: &Panels, samples: usize, parameters: &[f64]) -> Vec<f64> {
        let mut torque = vec![0.0; samples];
        let columns = self.model.layout().joint_columns(joint);
        for (&column, w) in columns.iter().zip(panels.joint(joint).chunks_exact(samples)) {
            let theta = parameters[column];
            torque.iter_mut().zip(w).for_each(|(torque, w)| *torque += theta * w);
        }
        torque
    }

    /// Derivatives of joint `joint`'s torque by the motion: positions, velocities, accelerations.
    fn slopes_of(
        &self,
        joint: usize,
        workspace: &mut BatchWorkspace,
        (part, adjoint): (&Part, &mut Panels),
        parameters: &[f64],
    ) -> Vec<f64> {
        let (model, layout, samples) = (self.model.model(), self.model.layout(), part.samples);
        let joints = self.model.dof();
        let columns = layout.joint_columns(joint);
        for (&column, to) in columns.iter().zip(adjoint.joint_mut(joint).chunks_exact_mut(samples)) {
            to.fill(parameters[column]);
        }
        let mut gradient = vec![0.0; 3 * joints * samples];
        let (by_q, rest) = gradient.split_at_mut(joints * samples);
        let (by_dq, by_ddq) = rest.split_at_mut(joints * samples);
        let mut all = MotionGradient { by_q, by_dq, by_ddq };
        regressor_panels_adjoint(model, workspace, layout, &part.view(), adjoint, &mut all);
        adjoint.joint_mut(joint).fill(0.0);
        gradient
    }
}

impl Part {
    fn view(&self) -> JointMotion<'_> {
        let [q, dq, ddq] = &self.motion;
        JointMotion { samples: self.samples, q, dq, ddq }
    }
}

impl TorqueModel for SplineTorque<'_> {
    type Error = EstimationError;

    fn torque(
        &mut self,
        _: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<Vec<f64>, EstimationError> {
        let (joints, samples) = (self.model.dof(), motion.samples);
        let parts = self.parts(motion);
        let of = |workspace: &mut BatchWorkspace, part: &Part| -> Vec<Vec<f64>> {
            let panels = self.panels(workspace, part);
            (0..joints).map(|joint| self.torque_of(joint, &panels, part.samples, parameters)).collect()
        };
        let workspace = || BatchWorkspace::new(self.model.model());
        let found: Vec<Vec<Vec<f64>>> = parts.par_iter().map_init(workspace, of).collect();
        let mut torque = vec![0.0; joints * samples];
        for (part, own) in parts.iter().zip(&found) {
            for (joint, own) in own.iter().enumerate() {
                torque[joint * samples + part.first..][..part.samples].copy_from_slice(own);
            }
        }
        Ok(torque)
    }

    fn slopes(
        &mut self,
        _: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<TorqueSlopes, EstimationError> {
        let (joints, samples, layout) = (self.model.dof(), motion.samples, self.model.layout());
        let parts = self.parts(motion);
        let of = |workspace: &mut BatchWorkspace, part: &Part| {
            let panels = self.panels(workspace, part);
            let mut adjoint = Panels::default();
            adjoint.resize(layout, part.samples);
            (0..joints).for_each(|joint| adjoint.joint_mut(joint).fill(0.0));
            let slopes = (0..joints)
                .map(|joint| self.slopes_of(joint, workspace, (part, &mut adjoint), parameters))
                .collect::<Vec<_>>();
            (panels, slopes)
        };
        let workspace = || BatchWorkspace::new(self.model.model());
        let found: Vec<(Panels, Vec<Vec<f64>>)> = parts.par_iter().map_init(workspace, of).collect();
        let columns: Vec<Vec<usize>> = (0..joints).map(|joint| layout.joint_columns(joint).to_vec()).collect();
        let mut out = TorqueSlopes {
            torque: vec![0.0; joints * samples],
            by_motion: vec![0.0; 3 * joints * joints * samples],
            by_parameters: columns.iter().map(|own| vec![0.0; own.len() * samples]).collect(),
            columns,
        };
        for (part, (panels, slopes)) in parts.iter().zip(&found) {
            for (joint, slopes) in slopes.iter().enumerate() {
                let torque = self.torque_of(joint, panels, part.samples, parameters);
                out.torque[joint * samples + part.first..][..part.samples].copy_from_slice(&torque);
                for (variable, own) in slopes.chunks_exact(part.samples).enumerate() {
                    let to = (joint * 3 * joints + variable) * samples + part.first;
                    out.by_motion[to..to + part.samples].copy_from_slice(own);
                }
                let own = panels.joint(joint).chunks_exact(part.samples).take(out.columns[joint].len());
                for (column, own) in own.enumerate() {
                    let to = column * samples + part.first;
                    out.by_parameters[joint][to..to + part.samples].copy_from_slice(own);
                }
            }
        }
        Ok(out)
    }
}
