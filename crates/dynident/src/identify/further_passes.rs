//! Estimators that need more than the joints' factors: another pass over the rows, or the joints side by side.

use crate::error::Error;
use crate::identify::fit::Logs;
use crate::measured::rows::{JointRows, RawSamples, RowSink};
use dynident_estimation::{
    CrossProblem, EstimationError, GeneralizedEstimate, LinearProblem, NoiseWeightedEstimate, RobustEstimate,
    RobustSettings, RowBlock, RowVisitor, RowWeight, SegmentedFactor, WeightedSettings, generalized_least_squares,
    noise_weighted_least_squares, robust_least_squares,
};

/// What stops an estimator that comes back to the logs: itself, or what reads or simulates them.
pub(crate) enum Stop {
    Estimator(EstimationError),
    Log(Error),
}

impl From<EstimationError> for Stop {
    fn from(error: EstimationError) -> Self {
        Self::Estimator(error)
    }
}

impl Stop {
    /// As an error of the study.
    pub(crate) fn of(self, logs: &Logs<'_>) -> Error {
        match self {
            Self::Estimator(source) => logs.in_study(source),
            Self::Log(error) => error,
        }
    }
}

/// Hands a log's rows to a visitor.
struct Visiting<'a, 'b> {
    log: usize,
    visit: &'a mut RowVisitor<'b>,
    refused: Option<EstimationError>,
}

impl RowSink for Visiting<'_, '_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error> {
        if self.refused.is_none() {
            let block = RowBlock { log: self.log, joint: rows.joint, rows: rows.rows, panel: rows.panel };
            self.refused = (self.visit)(&block).err();
        }
        Ok(())
    }

    fn raw(&mut self, _samples: &RawSamples<'_>) -> Result<(), Error> {
        Ok(())
    }
}

/// One pass: every row of every training log.
fn every_row(logs: &Logs<'_>, visit: &mut RowVisitor<'_>) -> Result<(), Stop> {
    logs.begin("reweighting rows");
    for (log, &index) in logs.training.iter().enumerate() {
        let mut sink = Visiting { log, visit: &mut *visit, refused: None };
        logs.pass(index).run(&mut sink).map_err(Stop::Log)?;
        if let Some(refused) = sink.refused {
            return Err(refused.into());
        }
    }
    logs.options.progress.end();
    Ok(())
}

/// Iteratively reweighted least squares: the logs are read once for every pass.
pub(crate) fn robust(logs: &Logs<'_>, problem: &LinearProblem, weight: RowWeight) -> Result<RobustEstimate, Error> {
    let section = &logs.study.estimator;
    let settings =
        RobustSettings { weight, rank: section.rank, covariance: section.covariance, ..RobustSettings::default() };
    robust_least_squares::<Stop>(problem, &settings, |visit| every_row(logs, visit)).map_err(|stop| stop.of(logs))
}

/// Reweighting by the noise around each row: the logs are read once for every pass.
pub(crate) fn noise_weighted(logs: &Logs<'_>, problem: &LinearProblem) -> Result<NoiseWeightedEstimate, Error> {
    let section = &logs.study.estimator;
    let settings = section.noise_levels.settings(section);
    noise_weighted_least_squares::<Stop>(problem, &settings, |visit| every_row(logs, visit))
        .map_err(|stop| stop.of(logs))
}

/// Puts the joints' rows of the same instants side by side.
struct SideBySide<'a> {
    logs: &'a Logs<'a>,
    factor: SegmentedFactor,
    panel: Vec<f64>,
    joints: usize,
}

impl RowSink for SideBySide<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error> {
        // Joints of a block come in their order, with as many rows each.
        if rows.joint == 0 {
            self.panel.clear();
        }
        self.panel.extend_from_slice(rows.panel);
        if rows.joint + 1 == self.joints {
            self.factor.absorb(&self.panel, rows.rows).map_err(|source| self.logs.in_study(source))?;
        }
        Ok(())
    }

    fn raw(&mut self, _samples: &RawSamples<'_>) -> Result<(), Error> {
        Ok(())
    }
}

/// Generalised least squares: the logs are read once more, all joints into one factor.
pub(crate) fn generalized(logs: &Logs<'_>, problem: &LinearProblem) -> Result<GeneralizedEstimate, Error> {
    let section = &logs.study.estimator;
    let joints = problem.joints().len();
    let lists = (0..joints).map(|joint| logs.machine.layout().joint_columns(joint).to_vec()).collect();
    let mut cross = CrossProblem::new(problem.columns().to_vec(), problem.joints().to_vec(), lists)
        .and_then(|cross| cross.with_fallback(problem.fallback().to_vec()))
        .map_err(|source| logs.in_study(source))?;
    logs.begin("joints side by side");
    for (place, &index) in logs.training.iter().enumerate() {
        let factor = SegmentedFactor::new(cross.width(), section.segments).map_err(|source| logs.in_study(source))?;
        let mut sink = SideBySide { logs, factor, panel: Vec::new(), joints };
        logs.pass(index).run(&mut sink)?;
        cross.add(&problem.logs()[place], sink.factor).map_err(|source| logs.in_study(source))?;
    }
    logs.options.progress.end();
    let settings =
        WeightedSettings { rank: section.rank, covariance: section.covariance, ..WeightedSettings::default() };
    generalized_least_squares(&cross, &settings).map_err(|source| logs.in_study(source))
}
