use super::stop_reason::{Breach, EnvelopeQuantity, SampleBreach};
use super::workspace::{WorkspaceBox, WorkspaceSettings};
use dynident_dynamics::Workspace as Arrays;
use dynident_model::Model;
use dynident_simulation::{PerJoint, Record, Reference, RunLimits, SimulationError, require};
use serde::{Deserialize, Serialize};

/// Minimum time between the positions from which velocities are computed if the robot does not measure them, s, for
/// an arm of 1.2 m; differences of neighbouring quantised positions are too noisy.
const SPEED_SPAN_S: f64 = 0.01;

/// Default limit of the tracking error of a revolute joint, rad.
pub(crate) const TRACKING_RAD: f64 = 0.3;
/// Default limit of the tracking error of a prismatic joint, m, for an arm of 1.2 m.
pub(crate) const TRACKING_M: f64 = 0.1;
const SEARCH_MARGIN_PERCENT: f64 = 10.0;
/// Factor on the velocity and effort limits of the robot description, for overshoot and sensor noise.
const LIMIT_FACTOR: f64 = 1.1;

/// Settings `[iteration.envelope]`: limits of every sample of a run. The defaults are the limits of the robot
/// description (positions unchanged, velocity and effort increased by 10 %) and a tracking error of 0.3 rad (0.1 m).
/// Each value is one number for all joints or a list with one number per joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct EnvelopeSettings {
    /// Lowest position, rad (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lower: Option<PerJoint>,
    /// Highest position, rad (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<PerJoint>,
    /// Highest velocity, rad/s (m/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed: Option<PerJoint>,
    /// Largest torque, Nm (N).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque: Option<PerJoint>,
    /// Largest tracking error, rad (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_error: Option<PerJoint>,
    /// Box in the base frame that no link origin and no tool point may leave; default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub workspace: Option<WorkspaceSettings>,
    /// Margin, in percent, that motion searches keep inside the envelope. For positions and the workspace it is a
    /// percentage of the allowed tracking error (in the workspace times the lever arm); for a velocity or torque
    /// limit given here, of this limit. Default 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search_margin_percent: Option<f64>,
}

impl EnvelopeSettings {
    /// Margin that motion searches keep inside the envelope, as a share from 0 to 1.
    pub fn search_margin(&self) -> f64 {
        0.01 * self.search_margin_percent.unwrap_or(SEARCH_MARGIN_PERCENT)
    }

    /// Returns the envelope of a robot: given values, otherwise the limits of the robot description, otherwise the
    /// defaults.
    ///
    /// # Errors
    /// Lists of a wrong length, limits that are not positive, positions that are not finite.
    pub fn envelope(&self, model: &Model) -> Result<Envelope, SimulationError> {
        let percent = self.search_margin_percent.unwrap_or(SEARCH_MARGIN_PERCENT);
        require((0.0..=90.0).contains(&percent), "envelope.search_margin_percent", percent, "give 0 to 90")?;
        let joints = model.joints();
        let each = |what: &str, stated: &Option<PerJoint>, positive: bool, own: &dyn Fn(usize) -> Option<f64>| {
            let Some(stated) = stated else { return Ok((0..joints.len()).map(own).collect()) };
            let (fix, holds): (_, fn(f64) -> bool) = if positive {
                ("give a positive number", |x| x > 0.0 && x.is_finite())
            } else {
                ("give a finite number", f64::is_finite)
            };
            let values = stated.values(&format!("envelope.{what}"), joints.len(), fix, holds)?;
            Ok::<Vec<Option<f64>>, SimulationError>(values.into_iter().map(Some).collect())
        };
        let limits = |joint: usize| &joints[joint].limits;
        let own = model.characteristic_scale();
        let path = |joint: usize| Some(if joints[joint].is_rotary() { TRACKING_RAD } else { own.metres(TRACKING_M) });
        Ok(Envelope {
            lower: each("lower", &self.lower, false, &|joint| limits(joint).lower)?,
            upper: each("upper", &self.upper, false, &|joint| limits(joint).upper)?,
            speed: each("speed", &self.speed, true, &|joint| limits(joint).velocity.map(|limit| LIMIT_FACTOR * limit))?,
            torque: each("torque", &self.torque, true, &|joint| {
                limits(joint).effort.map(|limit| LIMIT_FACTOR * limit)
            })?,
            tracking_error: each("tracking_error", &self.tracking_error, true, &path)?,
            workspace: self.workspace.as_ref().map(|own| own.of(model)).transpose()?,
            speed_span_s: own.seconds(SPEED_SPAN_S),
        })
    }
}

/// Safety envelope: limits of every sample of a run, joint by joint in the model's order; `None` if unknown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Envelope {
    /// Lowest position, rad (m).
    pub lower: Vec<Option<f64>>,
    /// Highest position, rad (m).
    pub upper: Vec<Option<f64>>,
    /// Highest velocity, rad/s (m/s).
    pub speed: Vec<Option<f64>>,
    /// Largest torque, Nm (N).
    pub torque: Vec<Option<f64>>,
    /// Largest tracking error, rad (m).
    pub tracking_error: Vec<Option<f64>>,
    /// Region of the workspace in which the robot may be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub workspace: Option<WorkspaceBox>,
    /// Minimum time between the positions from which velocities are computed, s.
    #[serde(skip)]
    pub speed_span_s: f64,
}

impl Envelope {
    /// Returns the envelope with joint `j` moved to index `places[j]`.
    pub(super) fn in_order(&self, places: &[usize]) -> Self {
        let sorted = |values: &[Option<f64>]| {
            let mut out = vec![None; values.len()];
            for (value, &place) in values.iter().zip(places) {
                out[place] = *value;
            }
            out
        };
        Self {
            lower: sorted(&self.lower),
            upper: sorted(&self.upper),
            speed: sorted(&self.speed),
            torque: sorted(&self.torque),
            tracking_error: sorted(&self.tracking_error),
            workspace: self.workspace.clone(),
            speed_span_s: self.speed_span_s,
        }
    }

    /// Sets those limits of a simulated run that are not yet set. The simulator saturates torques; the other limits
    /// stop the run.
    pub(crate) fn limit(&self, limits: &mut RunLimits) {
        // JSON cannot represent infinity, so the largest number is used.
        let each = |values: &[Option<f64>], none: f64| {
            Some(PerJoint::Each(values.iter().map(|value| value.unwrap_or(none)).collect()))
        };
        // The workspace is checked separately, because the simulator only knows joints.
        let RunLimits { torque, lower, upper, speed, tracking_error } = limits;
        for (limit, own, none) in [
            (torque, &self.torque, f64::MAX),
            (lower, &self.lower, f64::MIN),
            (upper, &self.upper, f64::MAX),
            (speed, &self.speed, f64::MAX),
            (tracking_error, &self.tracking_error, f64::MAX),
        ] {
            if limit.is_none() {
                *limit = each(own, none);
            }
        }
    }

    /// Returns the violation of the envelope by a motion that is followed without tracking error, if any.
    pub fn broken_by(&self, reference: &Reference, names: &[String]) -> Option<Breach> {
        let motion = reference.motion();
        let outside = self.workspace.as_ref().and_then(|own| own.broken_by(reference));
        let of_joints = (0..motion.samples).find_map(|sample| {
            let time_s = sample as f64 / reference.rate_hz();
            (0..motion.joints).find_map(|joint| {
                let at = joint * motion.samples + sample;
                let place = self.of_position(names, joint, motion.q[at]);
                place.or_else(|| self.of_speed(names, joint, motion.dq[at])).map(|broken| broken.breach(time_s))
            })
        });
        of_joints.or_else(|| outside.map(|(sample, own)| own.breach(sample as f64 / reference.rate_hz())))
    }

    pub(crate) fn outside(&self, q: &[f64], samples: usize, rate_hz: f64) -> Option<Breach> {
        let (sample, own) = self.workspace.as_ref()?.first_of(q, samples)?;
        Some(own.breach(sample as f64 / rate_hz))
    }

    /// Returns the violation of the torque limits, if any.
    pub fn torque_breach(&self, tau: &[f64], names: &[String], time_s: f64) -> Option<Breach> {
        (0..tau.len()).find_map(|joint| Some(self.of_torque(names, joint, tau[joint])?.breach(time_s)))
    }

    fn of_position(&self, names: &[String], joint: usize, q: f64) -> Option<SampleBreach> {
        let lower = self.lower[joint].filter(|limit| q < *limit);
        let upper = self.upper[joint].filter(|limit| q > *limit);
        let limit = lower.or(upper)?;
        Some(SampleBreach { name: names[joint].clone(), quantity: EnvelopeQuantity::Position, value: q, limit })
    }

    fn of_speed(&self, names: &[String], joint: usize, dq: f64) -> Option<SampleBreach> {
        let limit = self.speed[joint].filter(|limit| dq.abs() > *limit)?;
        Some(SampleBreach { name: names[joint].clone(), quantity: EnvelopeQuantity::Speed, value: dq, limit })
    }

    fn of_torque(&self, names: &[String], joint: usize, tau: f64) -> Option<SampleBreach> {
        let limit = self.torque[joint].filter(|limit| tau.abs() > *limit)?;
        Some(SampleBreach { name: names[joint].clone(), quantity: EnvelopeQuantity::Torque, value: tau, limit })
    }

    fn of_error(&self, names: &[String], joint: usize, error: f64) -> Option<SampleBreach> {
        let limit = self.tracking_error[joint].filter(|limit| error.abs() > *limit)?;
        Some(SampleBreach {
            name: names[joint].clone(),
            quantity: EnvelopeQuantity::TrackingError,
            value: error,
            limit,
        })
    }
}

/// Position of the reference at a time, rad (m): linear interpolation, constant beyond its ends.
pub(super) fn target_at(reference: &Reference, joint: usize, time_s: f64) -> f64 {
    let samples = reference.samples();
    let target = &reference.motion().q[joint * samples..(joint + 1) * samples];
    let place = (time_s * reference.rate_hz()).clamp(0.0, (samples - 1) as f64);
    let from = place.floor() as usize;
    let next = (from + 1).min(samples - 1);
    target[from] + (place - from as f64) * (target[next] - target[from])
}

#[derive(Debug)]
pub(super) struct EnvelopeWatch<'a> {
    envelope: Option<&'a Envelope>,
    reference: &'a Reference,
    /// Index of the sample from which velocities are computed.
    from: usize,
    /// Scratch memory for the positions of links.
    arrays: Option<Arrays>,
}

impl<'a> EnvelopeWatch<'a> {
    pub(super) fn new(envelope: Option<&'a Envelope>, reference: &'a Reference) -> Self {
        let arrays = envelope.and_then(|envelope| envelope.workspace.as_ref()).map(WorkspaceBox::arrays);
        Self { envelope, reference, from: 0, arrays }
    }

    /// Returns the violation of the envelope by the last sample of a record, if any. The record's arrays are
    /// sample-major; `dq` are measured velocities, if available.
    pub(super) fn look(&mut self, record: &Record, dq: Option<&[f64]>) -> Option<Breach> {
        let envelope = self.envelope?;
        let (names, joints) = (&record.joints, record.joints.len());
        let last = record.samples.checked_sub(1)?;
        let time_s = record.times_s[last];
        while self.from + 1 < last && time_s - record.times_s[self.from + 1] >= envelope.speed_span_s {
            self.from += 1;
        }
        let span_s = time_s - record.times_s[self.from];
        for joint in 0..joints {
            let at = last * joints + joint;
            let q = record.q[at];
            let speed = match dq {
                Some(dq) => Some(dq[joint]),
                None => (span_s >= envelope.speed_span_s).then(|| (q - record.q[self.from * joints + joint]) / span_s),
            };
            let broken = envelope
                .of_position(names, joint, q)
                .or_else(|| envelope.of_error(names, joint, target_at(self.reference, joint, time_s) - q))
                .or_else(|| envelope.of_speed(names, joint, speed?))
                .or_else(|| envelope.of_torque(names, joint, record.tau[at]));
            if let Some(broken) = broken {
                return Some(broken.breach(time_s));
            }
        }
        let (own, arrays) = (envelope.workspace.as_ref()?, self.arrays.as_mut()?);
        Some(own.breach(arrays, &record.q[last * joints..(last + 1) * joints])?.breach(time_s))
    }

    /// Returns the first violation in a complete joint-major record, for logs that arrive after the run.
    pub(super) fn first(envelope: Option<&Envelope>, reference: &Reference, record: &Record) -> Option<Breach> {
        envelope?;
        let mut watch = EnvelopeWatch::new(envelope, reference);
        let joints = record.joints.len();
        let major = |values: &[f64]| -> Vec<f64> {
            (0..joints * record.samples).map(|at| values[at % joints * record.samples + at / joints]).collect()
        };
        let mut growing = Record { q: major(&record.q), tau: major(&record.tau), ..record.clone() };
        (1..=record.samples).find_map(|samples| {
            growing.samples = samples;
            watch.look(&growing, None)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::planar_2r;

    fn envelope() -> Envelope {
        let none = vec![None, None];
        Envelope {
            lower: vec![Some(-1.0), None],
            upper: vec![Some(1.0), None],
            speed: vec![None, Some(0.5)],
            torque: vec![Some(9.0), None],
            tracking_error: none,
            workspace: None,
            speed_span_s: SPEED_SPAN_S,
        }
    }

    fn record(rows: &[[f64; 5]]) -> Record {
        let pick = |from: usize| rows.iter().flat_map(|row| row[from..from + 2].to_vec()).collect();
        Record {
            joints: vec!["a".to_owned(), "b".to_owned()],
            rate_hz: 100.0,
            samples: rows.len(),
            times_s: rows.iter().map(|row| row[0]).collect(),
            q: pick(1),
            tau: pick(3),
        }
    }

    fn broken(rows: &[[f64; 5]]) -> Option<(String, EnvelopeQuantity, f64, f64)> {
        let reference = Reference::standing(&[0.0, 0.0], 100.0, 1.0).unwrap();
        let envelope = envelope();
        let breach = EnvelopeWatch::new(Some(&envelope), &reference).look(&record(rows), None)?;
        Some((breach.joint, breach.quantity, breach.limit, breach.time_s))
    }

    #[test]
    fn the_quantity_that_leaves_is_named() {
        assert_eq!(broken(&[[0.0, 0.9, 5.0, 9.0, 1e3]]), None);
        let position = Some(("a".to_owned(), EnvelopeQuantity::Position, -1.0, 0.0));
        assert_eq!(broken(&[[0.0, -1.1, 0.0, 0.0, 0.0]]), position);
        let torque = Some(("a".to_owned(), EnvelopeQuantity::Torque, 9.0, 0.0));
        assert_eq!(broken(&[[0.0, 0.0, 0.0, -9.1, 0.0]]), torque);
    }

    /// A step of quantised positions between two samples is not a speed; a lasting change is.
    #[test]
    fn speeds_come_from_positions_apart() {
        let step = [[0.0, 0.0, 0.0, 0.0, 0.0], [0.001, 0.0, 0.004, 0.0, 0.0]];
        assert_eq!(broken(&step), None);
        let moving: Vec<[f64; 5]> =
            (0..21).map(|k| f64::from(k) * 0.001).map(|t| [t, 0.0, 0.6 * t, 0.0, 0.0]).collect();
        let speed = broken(&moving).unwrap();
        assert_eq!((speed.1, speed.2), (EnvelopeQuantity::Speed, 0.5));
    }

    #[test]
    fn the_descriptions_limits_are_the_default() {
        let tip = dynident_model::InertialParameters([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let arm = planar_2r(1.0, tip, tip);
        let envelope = EnvelopeSettings::default().envelope(&arm).unwrap();
        assert_eq!(envelope.tracking_error, vec![Some(TRACKING_RAD); 2]);
        let efforts: Vec<_> = arm.joints().iter().map(|joint| joint.limits.effort.map(|x| LIMIT_FACTOR * x)).collect();
        assert_eq!(envelope.torque, efforts);
        let stated = EnvelopeSettings { tracking_error: Some(vec![0.1, 0.2].into()), ..EnvelopeSettings::default() };
        assert_eq!(stated.envelope(&arm).unwrap().tracking_error, vec![Some(0.1), Some(0.2)]);
        let wrong = EnvelopeSettings { speed: Some((-1.0).into()), ..EnvelopeSettings::default() };
        assert!(wrong.envelope(&arm).unwrap_err().to_string().contains("envelope.speed"));
    }
}
