//! Torque of a robot and its derivatives by the motion and by the parameters, for the spline fit.

use dynident_dynamics::{
    BatchWorkspace, MotionGradient, Panels, TermHistory, regressor_panels, regressor_panels_adjoint,
    regressor_panels_following,
};
use dynident_estimation::{EstimationError, TorqueModel, TorqueSlopes};
use dynident_model::terms::{JointMotion, TorqueTerm};
use dynident_rows::RegressorModel;
use rayon::prelude::*;

const BLOCK_SAMPLES: usize = 128;

/// Torque and its derivatives by motion and parameters, for several blocks of samples in parallel.
///
/// Friction with hysteresis, load dependence or temperature dependence is treated as independent of the motion: its
/// derivatives are set to zero, so that the fit does not distort the motion because of it.
#[derive(Debug)]
pub struct SplineTorque<'a> {
    model: &'a RegressorModel,
    /// Temperatures of every record, joint after joint; empty if not measured.
    temperatures_c: Vec<Vec<f64>>,
    following: Option<(BatchWorkspace, TermHistory)>,
}

struct Part {
    first: usize,
    samples: usize,
    motion: [Vec<f64>; 3],
}

impl<'a> SplineTorque<'a> {
    /// Torque of this model; its parameters are the columns of the model's layout. `temperatures_c` contains the
    /// temperatures of every record, joint after joint, if friction needs them.
    pub fn new(model: &'a RegressorModel, temperatures_c: Vec<Vec<f64>>) -> Self {
        let follows = |term: &TorqueTerm| term.has_memory() || term.needs_load() || term.needs_temperature();
        let following = model
            .terms()
            .iter()
            .any(follows)
            .then(|| (BatchWorkspace::new(model.model()), TermHistory::new(model.load_parameters.clone())));
        Self { model, temperatures_c, following }
    }

    /// Regressor panels of all parts in order, if the model has friction with hysteresis.
    fn following(&mut self, record: usize, first: usize, parts: &[Part]) -> Option<Vec<Panels>> {
        let (workspace, history) = self.following.as_mut()?;
        if first == 0 {
            history.restart();
        }
        let joints = self.model.dof();
        let temperatures = self.temperatures_c.get(record).filter(|own| !own.is_empty());
        let of = |part: &Part| {
            if let Some(all) = temperatures {
                let own = all.chunks_exact(all.len() / joints);
                let from = first + part.first;
                let cut: Vec<f64> = own.flat_map(|own| own[from..from + part.samples].iter().copied()).collect();
                history.set_temperature(&cut);
            }
            let (model, layout, motion) = (self.model.model(), self.model.layout(), part.view());
            let mut panels = Panels::default();
            regressor_panels_following(model, workspace, layout, &motion, history, &mut panels);
            panels
        };
        Some(parts.iter().map(of).collect())
    }
}

/// Torque without hysteresis, which several threads can compute for different samples.
#[derive(Clone, Copy)]
struct Instants<'a>(&'a RegressorModel);

impl Instants<'_> {
    fn parts(motion: &JointMotion<'_>) -> Vec<Part> {
        let of = |first: usize| {
            let samples = BLOCK_SAMPLES.min(motion.samples - first);
            let cut = |values: &[f64]| -> Vec<f64> {
                let joints = values.chunks_exact(motion.samples);
                joints.flat_map(|own| own[first..first + samples].iter().copied()).collect()
            };
            Part { first, samples, motion: [motion.q, motion.dq, motion.ddq].map(cut) }
        };
        (0..motion.samples).step_by(BLOCK_SAMPLES).map(of).collect()
    }

    fn panels(self, workspace: &mut BatchWorkspace, part: &Part) -> Panels {
        let mut panels = Panels::default();
        let motion = part.view();
        regressor_panels(self.0.model(), workspace, self.0.layout(), &motion, &mut panels);
        panels
    }

    fn torque_of(self, joint: usize, panels: &Panels, samples: usize, parameters: &[f64]) -> Vec<f64> {
        let mut torque = vec![0.0; samples];
        let columns = self.0.layout().joint_columns(joint);
        for (&column, w) in columns.iter().zip(panels.joint(joint).chunks_exact(samples)) {
            let theta = parameters[column];
            torque.iter_mut().zip(w).for_each(|(torque, w)| *torque += theta * w);
        }
        torque
    }

    /// Derivatives of the torque of joint `joint` by positions, velocities and accelerations.
    fn slopes_of(
        self,
        joint: usize,
        workspace: &mut BatchWorkspace,
        part: &Part,
        adjoint: &mut Panels,
        parameters: &[f64],
    ) -> Vec<f64> {
        let (model, layout, samples) = (self.0.model(), self.0.layout(), part.samples);
        let joints = self.0.dof();
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
        place: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<Vec<f64>, EstimationError> {
        let (joints, samples) = (self.model.dof(), motion.samples);
        let instants = Instants(self.model);
        let parts = Instants::parts(motion);
        let known = self.following(place.0, place.1, &parts);
        let of = |workspace: &mut BatchWorkspace, (number, part): (usize, &Part)| -> Vec<Vec<f64>> {
            let torques = |panels: &Panels| {
                (0..joints).map(|joint| instants.torque_of(joint, panels, part.samples, parameters)).collect()
            };
            match &known {
                Some(known) => torques(&known[number]),
                None => torques(&instants.panels(workspace, part)),
            }
        };
        let workspace = || BatchWorkspace::new(instants.0.model());
        let found: Vec<Vec<Vec<f64>>> = parts.par_iter().enumerate().map_init(workspace, of).collect();
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
        place: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<TorqueSlopes, EstimationError> {
        let (joints, samples, layout) = (self.model.dof(), motion.samples, self.model.layout());
        let instants = Instants(self.model);
        let parts = Instants::parts(motion);
        let known = self.following(place.0, place.1, &parts);
        let of = |workspace: &mut BatchWorkspace, part: &Part| {
            let panels = if known.is_none() { Some(instants.panels(workspace, part)) } else { None };
            let mut adjoint = Panels::default();
            adjoint.resize(layout, part.samples);
            (0..joints).for_each(|joint| adjoint.joint_mut(joint).fill(0.0));
            let slopes = (0..joints)
                .map(|joint| instants.slopes_of(joint, workspace, part, &mut adjoint, parameters))
                .collect::<Vec<_>>();
            (panels, slopes)
        };
        let workspace = || BatchWorkspace::new(instants.0.model());
        let found: Vec<(Option<Panels>, Vec<Vec<f64>>)> = parts.par_iter().map_init(workspace, of).collect();
        let columns: Vec<Vec<usize>> = (0..joints).map(|joint| layout.joint_columns(joint).to_vec()).collect();
        let mut out = TorqueSlopes {
            torque: vec![0.0; joints * samples],
            by_motion: vec![0.0; 3 * joints * joints * samples],
            by_parameters: columns.iter().map(|own| vec![0.0; own.len() * samples]).collect(),
            columns,
        };
        for (number, (part, (own, slopes))) in parts.iter().zip(&found).enumerate() {
            let Some(panels) = own.as_ref().or_else(|| known.as_ref()?.get(number)) else { continue };
            for (joint, slopes) in slopes.iter().enumerate() {
                let torque = instants.torque_of(joint, panels, part.samples, parameters);
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
