use crate::estimation::estimate::RunEstimate;
use crate::estimation::run_logs::{RunLog, identification_settings, recordings};
use crate::evidence::clipping::clipping;
use crate::evidence::prediction::{Known, predictions};
use crate::evidence::run_evidence::{JointEvidence, RunEvidence};
use crate::evidence::torque_noise::{TorqueNoise, torque_noise};
use crate::evidence::tracking_floor::{KnownLoop, tracking_floor};
use crate::setup::error::IterationError;
use crate::setup::leg::{IterationTask, Leg};
use crate::setup::settings::{IterationSettings, RunIdentificationSettings};
use crate::signals::oscillation::{OscillationSettings, Search};
use crate::signals::rests::StictionBand;
use dynident_identification::friction::JointFriction;
use dynident_identification::payload::known_payloads;
use dynident_identification::{Execution, Logs, RegressorModel};
use dynident_recording::{cutoff, position_noise};
use dynident_simulation::Record;

/// Largest tracking error with which a joint is considered to follow its trajectory, rad (m): half of its range of
/// motion, within these bounds.
pub(crate) fn following_limits(legs: &[Leg], dof: usize, [low_rad, high_rad]: [f64; 2]) -> Vec<f64> {
    let range = |joint: usize| {
        let of_leg = |leg: &Leg| {
            let motion = leg.reference().motion();
            let q = &motion.q[motion.of(joint)];
            let (low, high) = q.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(*q), h.max(*q)));
            high - low
        };
        legs.iter().map(of_leg).fold(0.0, f64::max)
    };
    (0..dof).map(|joint| (0.5 * range(joint)).clamp(low_rad, high_rad)).collect()
}

/// Examines the records of a run, including the prediction by `known` (the estimate before the run). Rows within the
/// margins around rest are excluded; `task` includes the selected friction.
pub(crate) fn examined(
    task: &IterationTask,
    records: &[Record],
    settings: &RunIdentificationSettings,
    oscillation: &OscillationSettings,
    known: Option<&RunEstimate>,
    rest_margins: &[StictionBand],
) -> Result<RunEvidence, IterationError> {
    let dof = task.robot.dof();
    let noise = torque_noises(records, dof);
    let mut joints = Vec::with_capacity(dof);
    for (joint, noise) in noise.into_iter().enumerate() {
        let (mut square, mut count) = (0.0, 0.0);
        for record in records {
            square += record.tau[record.of(joint)].iter().map(|tau| tau * tau).sum::<f64>();
            count += record.samples as f64;
        }
        let limit = task.torque_limits.as_ref().map(|limits| limits[joint]);
        let torque_rms = if count > 0.0 { (square / count).sqrt() } else { 0.0 };
        let search = Search {
            lowest_hz: oscillation.lowest_hz(task.robot.model()),
            least: 0.01 * oscillation.torque_percent * torque_rms,
            least_share: 0.01 * oscillation.time_percent,
            noise: noise.of_sample,
        };
        let found = records.iter().filter_map(|record| {
            crate::signals::oscillation::oscillation(&record.tau[record.of(joint)], record.rate_hz, search)
        });
        joints.push(JointEvidence {
            torque_rms,
            torque_noise: noise.of_sample,
            row_noise: row_cutoff_hz(records, settings).map_or(noise.of_sample, |cutoff_hz| noise.below(cutoff_hz)),
            clipping: clipping(records, joint, limit, noise.of_sample),
            oscillation: found.reduce(|one, other| if other.share > one.share { other } else { one }),
            prediction: None,
            tracking_floor_rad: None,
        });
    }
    if let Some(known) = known.filter(|known| known.values.len() == task.robot.layout().columns().len()) {
        predict(&mut joints, task, records, settings, known, rest_margins)?;
    }
    Ok(RunEvidence {
        log_rates_hz: records.iter().map(|record| record.rate_hz).collect(),
        joints,
        feedback_delay_s: None,
        other_length: None,
    })
}

fn torque_noises(records: &[Record], dof: usize) -> Vec<TorqueNoise> {
    let mut most = vec![TorqueNoise::default(); dof];
    for record in records.iter().filter(|record| record.samples > 0) {
        let q: Vec<&[f64]> = record.q.chunks_exact(record.samples).collect();
        // The spectrum of torque ends where that of positions ends; only friction at reversals has higher
        // frequencies.
        let motion_hz = cutoff(&q, record.rate_hz).cutoff_hz;
        for (joint, most) in most.iter_mut().enumerate() {
            let tau = &record.tau[record.of(joint)];
            *most = most.or(torque_noise(tau, q[joint], record.rate_hz, motion_hz));
        }
    }
    most
}

fn row_cutoff_hz(records: &[Record], settings: &RunIdentificationSettings) -> Option<f64> {
    let (filter, record) = settings.parallel_filter.as_ref().zip(records.first())?;
    let cutoff_hz = filter.cutoff_hz.unwrap_or(0.4 * record.rate_hz / filter.factor.max(1) as f64);
    Some(cutoff_hz.min(0.5 * record.rate_hz))
}

fn predict(
    joints: &mut [JointEvidence],
    task: &IterationTask,
    records: &[Record],
    settings: &RunIdentificationSettings,
    known: &RunEstimate,
    rest_margins: &[StictionBand],
) -> Result<(), IterationError> {
    let log = RunLog { run: 1, legs: &task.legs, records, joint_sigma: &[], differentiator: None, rest_margins };
    let recordings = recordings(task, &[log], settings)?;
    let mut identification = identification_settings(task, settings, 1);
    // The same lag was removed from the rows of the fit.
    identification.motion.torque_lag_s = known.lag.taken_off();
    let all: Vec<usize> = (0..recordings.len()).collect();
    let logs =
        Logs::new(task.robot.model(), &recordings, identification.row_settings(), &all, None, Execution::default())?;
    let model = RegressorModel::from(task.robot.clone());
    let model = model.clone().with_load_of_estimate(&model, &known.values);
    let added =
        known_payloads(&settings.payloads, &model).map_err(dynident_identification::IdentificationError::from)?;
    let mut groups: Vec<(Vec<f64>, Vec<usize>)> = Vec::new();
    for index in all {
        let theta = match &recordings[index].payload {
            None => known.values.clone(),
            Some(name) => {
                let Some((_, added)) = added.iter().find(|(known, _)| known == name) else { continue };
                known.values.iter().zip(added).map(|(value, added)| value + added).collect()
            }
        };
        match groups.iter_mut().find(|(other, _)| *other == theta) {
            Some((_, legs)) => legs.push(index),
            None => groups.push((theta, vec![index])),
        }
    }
    for (theta, legs) in groups {
        let known = Known { theta: &theta, covariance: &known.covariance, joint_sigma: &known.joint_sigma };
        for (joint, found) in joints.iter_mut().zip(predictions(&logs, &model, &legs, &known)?) {
            let better =
                |old: &crate::evidence::run_evidence::Prediction| found.is_none_or(|new| old.inside <= new.inside);
            joint.prediction = joint.prediction.filter(better).or(found);
        }
    }
    Ok(())
}

/// Adds the tracking error that noise, friction and delay explain for each joint, if any joint exceeds the tolerance.
/// `known` is the estimate after the run, `friction` the selected friction.
pub(crate) fn add_tracking_floors(
    evidence: &mut RunEvidence,
    task: &IterationTask,
    records: &[Record],
    settings: &IterationSettings,
    known: &RunEstimate,
    friction: &[JointFriction],
    errors_rad: &[f64],
) {
    let Some(parameters) = &known.possible else { return };
    if errors_rad.iter().all(|error| *error <= settings.settled.tracking_tolerance) {
        return;
    }
    let delay_s = known.lag.longest_s();
    let mut floors = vec![0.0_f64; task.robot.dof()];
    let mut feedback_delay_s: Option<f64> = None;
    for (leg, record) in task.legs.iter().zip(records) {
        let q: Vec<&[f64]> = record.q.chunks_exact(record.samples.max(1)).collect();
        let position_noise = &position_noise(&q, record.rate_hz, cutoff(&q, record.rate_hz).cutoff_hz)[..];
        let (robot, controller) = (&task.robot, &settings.controller);
        let known = KnownLoop { robot, parameters, friction, controller, position_noise, delay_s };
        let Some(of_leg) = tracking_floor(leg.reference(), record, &known) else { return };
        floors.iter_mut().zip(of_leg.floor).for_each(|(most, floor)| *most = most.max(floor));
        // The longest delay among several trajectories.
        feedback_delay_s = feedback_delay_s.into_iter().chain(of_leg.feedback_delay_s).reduce(f64::max);
    }
    evidence.feedback_delay_s = feedback_delay_s;
    for (joint, floor) in evidence.joints.iter_mut().zip(floors) {
        joint.tracking_floor_rad = Some(floor);
    }
}
