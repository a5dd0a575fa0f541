//! Information of a motion about the base parameters, and its reverse sweep to the motion.

use crate::column_products::{add_gram, times_matrix};
use crate::motion::{Motion, MotionAdjoint};
use dynident_dynamics::{
    BatchWorkspace, MotionGradient, PanelLayout, Panels, regressor_panels, regressor_panels_adjoint,
};
use dynident_lanes::Level;
use dynident_model::Model;
use nalgebra::DMatrix;

/// Information matrix `D = D₀ + Σ_j W_jᵀ W_j / σ_j²` over all samples of a motion, about the columns of a layout, and
/// its adjoint. D₀ is prior information, W_j the regressor of joint j and σ_j the standard deviation of its torque.
pub struct Information<'a> {
    model: &'a Model,
    layout: &'a PanelLayout,
    /// `1 / σ_j²` of each joint's torque.
    weights: Vec<f64>,
    /// Prior information, row-major; empty without prior.
    prior: Vec<f64>,
    level: Level,
    workspace: BatchWorkspace,
    panels: Panels,
    adjoint: Panels,
    packed: Vec<f64>,
}

impl<'a> Information<'a> {
    /// Creates the information for the columns of `layout`, with the standard deviation of each joint's torque (Nm, N)
    /// and optional prior information (shape columns × columns).
    ///
    /// # Panics
    /// If the number of standard deviations differs from that of the joints, one is not positive, or the prior has
    /// another shape.
    pub fn new(model: &'a Model, layout: &'a PanelLayout, torque_std_nm: &[f64], prior: Option<&DMatrix<f64>>) -> Self {
        assert_eq!(torque_std_nm.len(), model.dof(), "one standard deviation per joint");
        assert!(torque_std_nm.iter().all(|std| *std > 0.0), "standard deviations are positive");
        let count = layout.columns().len();
        let prior = prior.map_or_else(Vec::new, |prior| {
            assert_eq!(prior.shape(), (count, count), "the prior has one row and column per column of the layout");
            prior.transpose().as_slice().to_vec()
        });
        Self {
            model,
            layout,
            weights: torque_std_nm.iter().map(|std| 1.0 / (std * std)).collect(),
            prior,
            level: Level::detect(),
            workspace: BatchWorkspace::new(model),
            panels: Panels::default(),
            adjoint: Panels::default(),
            packed: Vec::new(),
        }
    }

    /// Computes `D` of the motion with `weight` on every sample, and keeps the regressor for
    /// [`apply_adjoint`](Information::apply_adjoint).
    pub fn of(&mut self, motion: &Motion, weight: f64) -> DMatrix<f64> {
        let count = self.layout.columns().len();
        regressor_panels(self.model, &mut self.workspace, self.layout, &motion.view(), &mut self.panels);
        let mut gram = if self.prior.is_empty() { vec![0.0; count * count] } else { self.prior.clone() };
        for joint in 0..self.model.dof() {
            let columns = self.layout.joint_columns(joint);
            let panel = &self.panels.joint(joint)[..columns.len() * motion.samples];
            add_gram(self.level, panel, motion.samples, columns, weight * self.weights[joint], &mut gram, count);
        }
        DMatrix::from_vec(count, count, gram)
    }

    /// Adds the derivatives of a cost f with respect to the motion of the last [`of`](Information::of), given the
    /// symmetric derivative `by_information = G = ∂f/∂D`. The adjoint of the regressor is `2 W_j G / σ_j²`, and one
    /// reverse sweep propagates it to the motion.
    pub fn apply_adjoint(
        &mut self,
        motion: &Motion,
        weight: f64,
        by_information: &DMatrix<f64>,
        out: &mut MotionAdjoint,
    ) {
        let count = self.layout.columns().len();
        self.adjoint.resize(self.layout, motion.samples);
        for joint in 0..self.model.dof() {
            let columns = self.layout.joint_columns(joint);
            let length = columns.len() * motion.samples;
            times_matrix(
                self.level,
                &self.panels.joint(joint)[..length],
                motion.samples,
                columns,
                by_information.as_slice(),
                count,
                2.0 * weight * self.weights[joint],
                &mut self.packed,
                &mut self.adjoint.joint_mut(joint)[..length],
            );
        }
        let mut gradient = MotionGradient { by_q: &mut out.q, by_dq: &mut out.dq, by_ddq: &mut out.ddq };
        regressor_panels_adjoint(
            self.model,
            &mut self.workspace,
            self.layout,
            &motion.view(),
            &self.adjoint,
            &mut gradient,
        );
    }
}
