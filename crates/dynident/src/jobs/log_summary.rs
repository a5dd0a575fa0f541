//! Summary of a log in a result.

use crate::result::LogSummary;
use dynident_identification::examination::{
    HeldOutExamination, PriorAgreement, TorqueLag, agreement_findings, delay_findings,
};
use dynident_identification::rows::LogStatistics;
use dynident_identification::{LogFactors, Recording};

pub(super) fn training_summary(
    recording: &Recording,
    factors: &LogFactors,
    delays: &[Option<TorqueLag>],
    joints: &[String],
) -> LogSummary {
    summary(recording, &factors.statistics, factors.nominal_agreement.clone(), delays, joints)
}

pub(super) fn held_out_summary(
    recording: &Recording,
    examination: &HeldOutExamination,
    joints: &[String],
) -> LogSummary {
    let HeldOutExamination { statistics, nominal_agreement, delays, .. } = examination;
    summary(recording, statistics, nominal_agreement.clone(), delays, joints)
}

fn summary(
    recording: &Recording,
    statistics: &LogStatistics,
    prior_agreement: Option<PriorAgreement>,
    delays: &[Option<TorqueLag>],
    joints: &[String],
) -> LogSummary {
    let mut model_findings = prior_agreement.as_ref().map_or_else(Vec::new, agreement_findings);
    model_findings.extend(delay_findings(delays, joints));
    let of_joints = |value: &dyn Fn(&TorqueLag) -> f64| delays.iter().map(|lag| lag.as_ref().map(value)).collect();
    LogSummary {
        log: recording.name.clone(),
        role: recording.role,
        import: statistics.report.clone().unwrap_or_default(),
        motion_cutoff_hz: statistics.motion_cutoff_hz,
        filter_cutoff_hz: statistics.filter_cutoff_hz,
        filtered_rate_hz: statistics.filtered_rate_hz,
        filtered_rows: statistics.filtered_rows,
        prior_agreement,
        torque_lag_s: of_joints(&|lag| lag.lag_s),
        torque_lag_std_s: of_joints(&|lag| lag.std_s),
        torque_lag_half_width_95_s: of_joints(&|lag| lag.half_width_95_s),
        velocities: statistics.velocities.clone(),
        model_findings,
        events: Vec::new(),
    }
}
