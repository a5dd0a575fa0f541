//! Criterion and limits of a trajectory as a constrained problem for an optimiser.

use super::DesignTask;
use super::column_units::ColumnUnits;
use super::metric::Metric;
use crate::criteria::Criterion;
use crate::information::Information;
use crate::limits::LimitWorkspace;
use crate::motion::Motion;
use crate::optimisers::{ConstrainedProblem, CurvatureFacts};
use nalgebra::DMatrix;

/// Weight of a violated place limit relative to other limits. During a search a motion may exceed a joint's limits
/// and return, but it must not cross an obstacle.
const PLACE_WEIGHT: f64 = 5.0;

/// Maximum violation of a place limit, as a share of the limit (in arm lengths for a floor). Penalties alone do not
/// prevent a long step to the other side of an obstacle. Chosen on the UR10 of the examples, whose wrist crosses its
/// column with a violation of 0.18. This limit does not prevent crossing an obstacle with a smaller violation. A
/// limit of 0.1 stopped descents early.
const MAX_PLACE_VIOLATION: f64 = 0.16;

pub(super) struct Problem<'a> {
    task: &'a DesignTask<'a>,
    /// Margins, added to the violation of each row of limits, so that limits are also kept between samples.
    margins: &'a [f64],
    criterion: &'a dyn Criterion,
    units: &'a ColumnUnits,
    times: &'a [f64],
    weight: f64,
    information: Information<'a>,
    workspace: LimitWorkspace,
    scales: Vec<f64>,
    scaled_weights: Vec<f64>,
    /// Maximum violation of place limits: [`MAX_PLACE_VIOLATION`], or that of the first motion if larger.
    max_place_violation: Option<f64>,
    parameters: Vec<f64>,
    at_gradient: Vec<f64>,
    motion: Motion,
    adjoint: Motion,
    by_information: Option<DMatrix<f64>>,
    values: Vec<f64>,
    metric: Option<Metric>,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        task: &'a DesignTask<'a>,
        margins: &'a [f64],
        criterion: &'a dyn Criterion,
        units: &'a ColumnUnits,
        times: &'a [f64],
        weight: f64,
        shaped: bool,
    ) -> Self {
        Self {
            information: Information::new(task.limits.model(), task.layout, task.torque_std_nm, task.prior),
            workspace: {
                let mut workspace = task.limits.workspace();
                workspace.test_between_samples();
                workspace
            },
            scales: task
                .limits
                .constraints()
                .iter()
                .map(|constraint| if constraint.kind.is_place() { PLACE_WEIGHT } else { 1.0 })
                .collect(),
            scaled_weights: Vec::new(),
            max_place_violation: None,
            task,
            margins,
            criterion,
            units,
            times,
            weight,
            parameters: Vec::new(),
            at_gradient: Vec::new(),
            motion: Motion::default(),
            adjoint: Motion::default(),
            by_information: None,
            values: Vec::new(),
            metric: if shaped { Metric::new(task, times) } else { None },
        }
    }
}

impl Problem<'_> {
    /// Whether the motion violates place limits so much that it may have crossed an obstacle.
    fn crosses_obstacle(&mut self) -> bool {
        if !self.task.limits.has_places() {
            return false;
        }
        let rows = self.values.chunks_exact(self.times.len()).zip(self.task.limits.constraints());
        let places = rows.filter(|(_, constraint)| constraint.kind.is_place()).flat_map(|(values, _)| values);
        let deepest = places.fold(0.0, |deepest: f64, value| deepest.max(*value));
        deepest > *self.max_place_violation.get_or_insert(deepest.max(MAX_PLACE_VIOLATION))
    }
}

impl ConstrainedProblem for Problem<'_> {
    fn variables(&self) -> usize {
        self.task.family.parameters()
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        self.task.family.bounds()
    }

    fn constraints(&self) -> usize {
        self.task.limits.constraints().len() * self.times.len()
    }

    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.parameters = x.to_vec();
        self.task.family.motion(x, self.times, &mut self.motion);
        self.task.limits.values(&mut self.workspace, &self.motion, &mut self.values);
        for (((to, from), margin), scale) in constraints
            .chunks_exact_mut(self.times.len())
            .zip(self.values.chunks_exact(self.times.len()))
            .zip(self.margins)
            .zip(&self.scales)
        {
            for (to, from) in to.iter_mut().zip(from) {
                *to = scale * (from + margin);
            }
        }
        if self.crosses_obstacle() {
            self.by_information = None;
            return f64::INFINITY;
        }
        let information = self.information.of(&self.motion, self.weight);
        if let Some((value, derivative)) = self.units.value_and_derivative(self.criterion, &information) {
            self.by_information = Some(derivative);
            value
        } else {
            self.by_information = None;
            f64::INFINITY
        }
    }

    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        self.at_gradient.clone_from(&self.parameters);
        self.adjoint.reset(self.motion.joints, self.motion.samples);
        self.scaled_weights.clear();
        for (weights, scale) in weights.chunks_exact(self.times.len()).zip(&self.scales) {
            self.scaled_weights.extend(weights.iter().map(|weight| scale * weight));
        }
        self.task.limits.apply_adjoint(&mut self.workspace, &self.motion, &self.scaled_weights, &mut self.adjoint);
        if let Some(derivative) = &self.by_information {
            self.information.apply_adjoint(&self.motion, self.weight, derivative, &mut self.adjoint);
        }
        self.task.family.apply_adjoint(&self.parameters, self.times, &self.adjoint, gradient);
    }

    fn objective_scale(&self, _objective: f64) -> f64 {
        self.criterion.gradient_scale(self.task.layout.columns().len())
    }

    fn prepare_metric(&mut self, known: &CurvatureFacts<'_>) -> bool {
        let Some(metric) = &mut self.metric else { return false };
        metric.prepare(self.task, self.times, &self.at_gradient, known)
    }

    fn divide_by_metric(&self, vector: &mut [f64]) {
        if let Some(metric) = &self.metric {
            metric.divide(vector);
        }
    }
}
