//! The samples of recordings that lags are estimated from.

use super::fit::{LagFit, fit_lags, lags_of_log};
use super::measured::{TorqueLag, pooled_delay};
use super::samples::{DELAY_SAMPLES, DelayCheck};
use super::unknowns::Unknowns;
use crate::estimators::EstimationSettings;
use crate::payload::{DriveGain, LoadColumns, free_gains};
use crate::settings::IdentificationSettings;
use dynident_rows::{
    JointRows, LogError, LogPass, Logs, RawSamples, Recording, RegressorModel, RowConsumer, Samples, Silent,
};
use rayon::prelude::*;
use std::borrow::Cow;

impl RowConsumer for DelayCheck<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.take_filtered(rows);
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        self.take_raw(samples);
        Ok(())
    }
}

/// The lags of the joints by all recordings `chosen` together, beyond what the settings of `logs` take off. `values`
/// are what a fit to them found over the `columns`: base parameters of the model, payloads, offsets of single logs. Of
/// the `gains` that were found with them, those that the logs determine are unknowns beside the lags. Recordings have
/// noise of their own where the settings say so. None where the recordings are too short, and where rows inside of a
/// motion are left out.
///
/// # Errors
/// What reading them can give.
pub fn lag_fit(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    model: &RegressorModel,
    columns: &LoadColumns,
    values: &[f64],
    gains: &[DriveGain],
    chosen: &[usize],
) -> Result<Option<LagFit>, LogError> {
    let theta: Vec<Vec<f64>> = chosen.iter().map(|&index| columns.base_values(index, values)).collect();
    let of = |place: usize| &theta[place][..];
    let checks = checks(logs, model, chosen, &of)?;
    let values = &values[..columns.count()];
    let unknowns = Unknowns { values, loads: Some((columns, chosen)), gains: &free_gains(gains) };
    let with = (logs, &settings.estimation);
    Ok(checks.and_then(|checks| fit_lags(&checks, unknowns, settings.log_noise, with)))
}

/// The whole lag of each joint by the recordings `chosen`, each with the base parameters that `theta` gives for it:
/// those of single recordings, pooled. None for a joint where none determines it, and where rows inside of a motion are
/// left out.
///
/// # Errors
/// What reading them can give.
pub fn lags_of_recordings(
    logs: &Logs<'_>,
    settings: &EstimationSettings,
    model: &RegressorModel,
    theta: &(dyn Fn(usize) -> Vec<f64> + Sync),
    chosen: &[usize],
) -> Result<Vec<Option<TorqueLag>>, LogError> {
    let theta: Vec<Vec<f64>> = chosen.iter().map(|&index| theta(index)).collect();
    let of = |place: usize| &theta[place][..];
    let checks = checks(logs, model, chosen, &of)?.unwrap_or_default();
    let lags: Vec<_> = checks.into_iter().map(|check| lags_of_log(check, (logs, settings))).collect();
    let of_joint = |joint: usize| -> Vec<TorqueLag> { lags.iter().filter_map(|log| log[joint]).collect() };
    Ok((0..model.model().dof()).map(|joint| pooled_delay(&of_joint(joint))).collect())
}

/// The whole lag of each joint by recording number `index`, whose pass `check` has seen.
///
/// # Errors
/// What reading it again can give, where the pass left out rows of a motion.
pub(crate) fn lags_after_pass(
    check: DelayCheck<'_>,
    with: (&Logs<'_>, &EstimationSettings),
    index: usize,
) -> Result<Vec<Option<TorqueLag>>, LogError> {
    match whole(&with.0.recordings[index]) {
        Some(Cow::Borrowed(_)) => Ok(lags_of_log(check, with)),
        _ => lags_of_recordings(with.0, with.1, check.model(), &|_| check.theta().to_vec(), &[index]),
    }
}

/// The samples of the recordings `chosen`; none where one of them has rows that are left out.
fn checks<'a>(
    logs: &Logs<'_>,
    model: &'a RegressorModel,
    chosen: &[usize],
    theta: &(dyn Fn(usize) -> &'a [f64] + Sync),
) -> Result<Option<Vec<DelayCheck<'a>>>, LogError> {
    let whole = chosen.iter().map(|&index| whole(&logs.recordings[index])).collect::<Option<Vec<_>>>();
    let Some(whole) = whole else { return Ok(None) };
    let of_log = |place: usize| -> Result<DelayCheck<'a>, LogError> {
        let mut samples = DelayCheck::new(model, theta(place));
        let pass = LogPass {
            recording: &whole[place],
            most_samples: Some(DELAY_SAMPLES as u64),
            progress: &Silent,
            ..logs.pass(model, chosen[place])
        };
        pass.run(&mut samples)?;
        Ok(samples)
    };
    let places = 0..chosen.len();
    let checks = if logs.execution.parallel() {
        places.into_par_iter().map(of_log).collect::<Result<_, _>>()
    } else {
        places.map(of_log).collect()
    };
    checks.map(Some)
}

/// The recording with every row: rows that are left out would move those behind them. `None` where rows inside do not
/// count.
fn whole(recording: &Recording) -> Option<Cow<'_, Recording>> {
    match &recording.samples {
        Samples::Log(_) => Some(Cow::Borrowed(recording)),
        Samples::Motion(record) if record.usable.is_empty() && record.windows.is_none() => {
            Some(Cow::Borrowed(recording))
        }
        Samples::Motion(_) => recording.with_every_row().map(Cow::Owned),
    }
}
