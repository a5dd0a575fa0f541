//! Samples of recordings for the estimation of lags.

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

/// Estimates the lags of the joints from all recordings `chosen`, in addition to the lag that the settings of `logs`
/// compensate. `values` are the results of a fit with the unknowns in `columns`: base parameters, payloads, and offsets
/// of single logs. `gains` are the torque gains of this fit; gains that the logs determine are estimated again together
/// with the lags. Recordings have separate noise if the settings require it. `None` if recordings are too short or rows
/// inside a motion are excluded.
///
/// # Errors
/// A recording cannot be read.
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

/// Total lag of each joint (compensated and remaining part), as a mean over the recordings `chosen`. `theta` returns
/// the base parameters of a recording. `None` for a joint that no recording determines, and if rows inside a motion are
/// excluded.
///
/// # Errors
/// A recording cannot be read.
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

/// Total lag of each joint in recording `index`, after a pass that collected its samples in `check`.
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

/// Collects the samples of the recordings `chosen`; `None` if one of them excludes rows.
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
    let places: Vec<usize> = (0..chosen.len()).collect();
    logs.execution.try_map(&places, |&place| of_log(place)).map(Some)
}

/// The recording with all rows, because excluded rows would shift the following ones in time. `None` if rows inside the
/// motion are unusable.
fn whole(recording: &Recording) -> Option<Cow<'_, Recording>> {
    match &recording.samples {
        Samples::Log(_) => Some(Cow::Borrowed(recording)),
        Samples::Motion(record) if record.usable.is_empty() && record.windows.is_none() => {
            Some(Cow::Borrowed(recording))
        }
        Samples::Motion(_) => recording.with_every_row().map(Cow::Owned),
    }
}
