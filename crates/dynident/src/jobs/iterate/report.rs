//! Content of `iterations.json`.

use super::bound::cramer_rao;
use crate::result::{
    INTERRUPTED, ITERATIONS_SCHEMA, IterationParameter, IterationRun, IterationsFile, Provenance, RunForecast,
    UnmetConditionEntry,
};
use crate::study::{StudyFile, StudyRobot};
use dynident_dynamics::ParametricModel;
use dynident_iteration::{
    IterationStatus, Leg, LoweredBandwidth, MotionForecast, RunEstimate, RunRecord, UnmetCondition,
};
use dynident_simulation::SensorSettings;

/// The newest earlier run whose estimate is the controller's model in this run.
fn model_of_run(record: &RunRecord, records: &[RunRecord]) -> Option<usize> {
    let model = record.controller.model.as_ref()?;
    let with_model = |before: &&RunRecord| {
        before.run < record.run && before.knowledge().and_then(RunEstimate::for_controller).as_ref() == Some(model)
    };
    records.iter().rfind(with_model).map(|before| before.run)
}

pub(super) struct IterationReport<'a> {
    pub(super) study: StudyFile<'a>,
    pub(super) provenance: Provenance,
    pub(super) robot: &'a StudyRobot,
    /// Duration of a run with all its trajectories, s.
    pub(super) duration_s: f64,
    pub(super) truth: Option<Vec<f64>>,
    /// Cramér-Rao bound of a run with the first motion.
    pub(super) bound: Option<Vec<f64>>,
    pub(super) sensors: &'a SensorSettings,
    pub(super) lowered: Vec<LoweredBandwidth>,
}

/// State of one iteration of trajectories that are identified together.
pub(super) struct Stage<'a> {
    /// Number of the trajectory from 1, if each trajectory has a separate iteration.
    pub(super) leg: Option<usize>,
    pub(super) robot: &'a ParametricModel,
    pub(super) records: &'a [RunRecord],
    pub(super) status: &'a IterationStatus,
    pub(super) shortfalls: &'a [UnmetCondition],
    /// Forecast of a further run whose gain was too small.
    pub(super) declined: Option<&'a MotionForecast>,
    /// Error bar of each base parameter from an earlier stage, if it was determined there.
    pub(super) known_std: &'a [Option<f64>],
}

impl IterationReport<'_> {
    pub(super) fn file(&self, stage: &Stage<'_>) -> IterationsFile {
        let Stage { records, status, shortfalls, declined, .. } = *stage;
        let known = self.known(stage);
        let good: Vec<&RunRecord> = records.iter().filter(|record| record.accepted).collect();
        let tracking_improvement = match good[..] {
            [first, .., last] if last.tracking_error() > 0.0 => Some(first.tracking_error() / last.tracking_error()),
            _ => None,
        };
        let last = good.last().and_then(|record| record.knowledge());
        IterationsFile {
            schema: ITERATIONS_SCHEMA.to_owned(),
            name: self.study.title(),
            provenance: Some(self.provenance.clone()),
            converged: status.is_converged(),
            status: status_key(status).to_owned(),
            reason: in_words(status, shortfalls, declined),
            declined: declined.map(|forecast| run_forecast(forecast, None)),
            unmet: shortfalls.iter().filter(|own| !is_irrelevant(own, status)).map(unmet).collect(),
            joints: self.robot.parametric.joint_names(),
            lowered_bandwidths: self.lowered.clone(),
            duration_s: self.duration_s,
            runs: records.iter().map(|record| self.run(record, stage, known)).collect(),
            tracking_improvement,
            error_over_bound: good.last().and_then(|record| self.error_over_bound(record, known)),
            bound: known.bound.map(<[f64]>::to_vec),
            base_parameters: Vec::new(),
            no_result: None,
            possible_parameters: last.and_then(|estimate| estimate.possible.clone()),
        }
    }

    /// True parameters and bound of a stage; both are valid only if the friction terms of the study are used.
    fn known(&self, stage: &Stage<'_>) -> Known<'_> {
        let is_stated = stage.robot.terms() == self.robot.terms();
        Known { truth: self.truth.as_deref().filter(|_| is_stated), bound: self.bound.as_deref().filter(|_| is_stated) }
    }

    fn run(&self, record: &RunRecord, stage: &Stage<'_>, known: Known<'_>) -> IterationRun {
        let parameters = |estimate: Option<&RunEstimate>| {
            estimate.map_or_else(Vec::new, |estimate| parameters(estimate, stage, known.truth))
        };
        IterationRun {
            run: record.run,
            leg: stage.leg,
            controller: record.controller.name.clone(),
            model_based: record.controller.model.is_some(),
            model_of_run: model_of_run(record, stage.records),
            damping: record.controller.damping,
            stiffness: record.controller.stiffness,
            accepted: record.accepted,
            outcome: record.outcome.clone(),
            reason: record.reason.clone(),
            max_tracking_error_rad: record.max_tracking_error_rad.clone(),
            warm_up: record.warm_up.clone(),
            held_out: record.held_out.clone(),
            parameters: parameters(record.estimate.as_ref()),
            pooled: parameters(record.pooled.as_ref()),
            run_offsets: record.pooled.as_ref().map_or_else(Vec::new, |all| all.run_offsets.clone()),
            evidence: record.evidence.clone(),
            torque_check: record.torque_check.clone(),
            differentiator: record.estimate.as_ref().and_then(|own| own.differentiator.clone()),
            forecast: record.forecast.as_ref().map(|forecast| {
                let known = record.knowledge().filter(|_| record.accepted);
                run_forecast(forecast, known.and_then(|known| forecast.reached_gain_percent(known)))
            }),
            bound: known.bound.and_then(|_| self.own_bound(record)),
            torque_lags: record.estimate.as_ref().map_or_else(Vec::new, |own| own.torque_lags.clone()),
        }
    }

    /// Root mean square of a run's parameter errors relative to their Cramér-Rao bound for a single run.
    fn error_over_bound(&self, record: &RunRecord, known: Known<'_>) -> Option<f64> {
        let first_motion = known.bound?;
        let own = self.own_bound(record);
        let bound = own.as_deref().unwrap_or(first_motion);
        let (estimate, truth) = record.estimate.as_ref().zip(known.truth)?;
        let ratios: Vec<f64> = (0..bound.len())
            .filter(|&k| bound[k] > 0.0 && !estimate.fixed.contains(&k))
            .map(|k| ((estimate.values[k] - truth[k]) / bound[k]).powi(2))
            .collect();
        (!ratios.is_empty()).then(|| (ratios.iter().sum::<f64>() / ratios.len() as f64).sqrt())
    }

    fn own_bound(&self, record: &RunRecord) -> Option<Vec<f64>> {
        let references = &record.motion.as_ref()?.references;
        let legs: Result<Vec<Leg>, _> = references.iter().map(|reference| Leg::whole(reference.clone())).collect();
        cramer_rao(self.robot, &legs.ok()?, self.sensors)
    }
}

#[derive(Clone, Copy)]
struct Known<'a> {
    truth: Option<&'a [f64]>,
    bound: Option<&'a [f64]>,
}

/// The base parameters of an estimate, with the error bars of earlier stages where these determined them.
fn parameters(estimate: &RunEstimate, stage: &Stage<'_>, truth: Option<&[f64]>) -> Vec<IterationParameter> {
    let columns = stage.robot.layout().columns();
    let expressions = stage.robot.base().expressions();
    let one = |k: usize| IterationParameter {
        symbol: columns[k].symbol(),
        expression: expressions[k].clone(),
        unit: columns[k].unit().to_owned(),
        value: estimate.values[k],
        std: stage
            .known_std
            .get(k)
            .copied()
            .flatten()
            .or_else(|| (!estimate.fixed.contains(&k)).then_some(estimate.std[k])),
        error: truth.map(|truth| estimate.values[k] - truth[k]),
    };
    (0..columns.len()).map(one).collect()
}

fn status_key(status: &IterationStatus) -> &'static str {
    match status {
        IterationStatus::Converged => "converged",
        IterationStatus::Settled => "settled",
        IterationStatus::RunsUsedUp => "runs-used-up",
        IterationStatus::Refused { .. } => "refused",
        IterationStatus::Interrupted { .. } => INTERRUPTED,
        IterationStatus::Waiting { .. } => "waiting",
    }
}

fn run_forecast(forecast: &MotionForecast, reached_gain_percent: Option<f64>) -> RunForecast {
    RunForecast {
        redesigned: forecast.redesigned,
        reason: forecast.reason.clone(),
        gain_percent: forecast.gain_percent,
        repeat_gain_percent: forecast.repeat_gain_percent,
        reached_gain_percent,
        std: forecast.std.clone(),
        largest_torque: forecast.largest_torque.clone(),
    }
}

/// The status as text, with the first unmet condition or the gain of a run that was not made.
fn in_words(status: &IterationStatus, shortfalls: &[UnmetCondition], declined: Option<&MotionForecast>) -> String {
    if let Some(forecast) = declined {
        return format!(
            "{status}: a further run would reduce the largest error bars by only {:.0} %",
            forecast.gain_percent
        );
    }
    match (status, shortfalls) {
        (IterationStatus::Settled | IterationStatus::RunsUsedUp, [first, rest @ ..]) => {
            let more = if rest.is_empty() { String::new() } else { format!(" (and {} more)", rest.len()) };
            format!("{status}; {first}{more}")
        }
        _ => status.to_string(),
    }
}

/// A too small number of runs is not reported if something else ended the iteration, because more runs would not
/// help.
fn is_irrelevant(shortfall: &UnmetCondition, status: &IterationStatus) -> bool {
    let ended = matches!(
        status,
        IterationStatus::Interrupted { .. } | IterationStatus::Waiting { .. } | IterationStatus::Refused { .. }
    );
    ended && matches!(shortfall, UnmetCondition::TooFewRuns { .. })
}

fn unmet(shortfall: &UnmetCondition) -> UnmetConditionEntry {
    let (message, remedy) = (shortfall.to_string(), shortfall.remedy().to_owned());
    UnmetConditionEntry { shortfall: shortfall.clone(), message, remedy }
}

/// Merges the iterations of several trajectories: converged if all have converged, with the status of the last.
pub(super) fn merged(stages: Vec<IterationsFile>) -> Option<IterationsFile> {
    let converged = stages.iter().all(|stage| stage.converged);
    let improvement = stages.iter().filter_map(|stage| stage.tracking_improvement).reduce(f64::min);
    let unmet =
        stages.iter().find(|stage| !stage.unmet.is_empty()).map(|stage| stage.unmet.clone()).unwrap_or_default();
    let unsettled =
        stages.iter().find(|stage| !stage.converged).map(|stage| (stage.status.clone(), stage.reason.clone()));
    let mut runs = Vec::new();
    let mut last = None;
    for stage in stages {
        let IterationsFile { runs: own, .. } = &stage;
        runs.extend(own.iter().cloned());
        last = Some(stage);
    }
    let last = last?;
    let (status, reason) = match (last.converged, unsettled) {
        (true, Some(unsettled)) => unsettled,
        _ => (last.status.clone(), last.reason.clone()),
    };
    Some(IterationsFile { converged, status, reason, unmet, runs, tracking_improvement: improvement, ..last })
}
