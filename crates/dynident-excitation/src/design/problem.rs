//! Criterion and limits of a trajectory, as an optimiser takes them.

use super::DesignTask;
use super::column_units::ColumnUnits;
use super::metric::Metric;
use crate::criteria::Criterion;
use crate::information::Information;
use crate::limits::LimitWorkspace;
use crate::motion::Motion;
use crate::optimisers::{ConstrainedProblem, CurvatureFacts};
use nalgebra::DMatrix;

/// A place that is broken weighs so much more than a velocity: a search may wander outside a joint's limits and come
/// back, but not to the other side of an obstacle.
const PLACE_SCALE: f64 = 5.0;

/// No step leads deeper into an obstacle than this share of its limit (arm's lengths for a floor): penalties alone do
/// not keep a long step from ending on its other side. Chosen on the UR10 of the examples, whose wrist crosses its
/// column by breaking it by 18 %: an obstacle that can be crossed by breaking it less is not held by it. A wall at 0.1
/// stopped descents early.
const WALL: f64 = 0.16;

/// Criterion and limits of one trajectory as functions of the family's parameters.
pub(super) struct Problem<'a> {
    task: &'a DesignTask<'a>,
    /// Added to every value of each row, so that what is kept on samples is kept between them.
    margins: &'a [f64],
    criterion: &'a dyn Criterion,
    units: &'a ColumnUnits,
    times: &'a [f64],
    weight: f64,
    information: Information<'a>,
    workspace: LimitWorkspace,
    /// What each row's values are multiplied by.
    scales: Vec<f64>,
    scaled_weights: Vec<f64>,
    /// How far places may be broken: [`WALL`], or as far as the first motion does.
    wall: Option<f64>,
    parameters: Vec<f64>,
    /// Where the gradient was last asked for; a rejected trial may have followed.
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
                workspace.sweep();
                workspace
            },
            scales: task
                .limits
                .constraints()
                .iter()
                .map(|constraint| if constraint.kind.is_place() { PLACE_SCALE } else { 1.0 })
                .collect(),
            scaled_weights: Vec::new(),
            wall: None,
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
    /// Whether the motion breaks places so deeply that it may have come to the other side of an obstacle.
    fn beyond_the_wall(&mut self) -> bool {
        if !self.task.limits.has_places() {
            return false;
        }
        let rows = self.values.chunks_exact(self.times.len()).zip(self.task.limits.constraints());
        let places = rows.filter(|(_, constraint)| constraint.kind.is_place()).flat_map(|(values, _)| values);
        let deepest = places.fold(0.0, |deepest: f64, value| deepest.max(*value));
        deepest > *self.wall.get_or_insert(deepest.max(WALL))
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
        if self.beyond_the_wall() {
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
