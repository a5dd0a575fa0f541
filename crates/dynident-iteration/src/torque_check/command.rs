//! Recomputes the torque that the controller commanded along a log from its inputs: the reference, its model, and the
//! positions in the log.

use super::separable_fit::{JointColumns, SHARED, SharedParameter};
use crate::estimation::motion::on_uniform_clock;
use crate::setup::leg::Leg;
use dynident_recording::{DecimationSettings, Decimator, Derivatives, DifferentiatorSettings, Place};
use dynident_simulation::Record;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings, Measured, Target};

/// Ratio of the cut-off frequency of the position smoothing to that of the comparison; it is large enough that
/// smoothing does not affect the comparison.
const SMOOTHING_RATIO: f64 = 4.0;
/// Ratio of the row rate after decimation to the cut-off frequency of the comparison.
const ROWS_PER_CUTOFF: f64 = 4.0;
/// Shared parameters, each with (finite difference, expected size): delays of positions and velocities in the
/// controller, lag of the logged torque (s), relative rate of the log's clock, delay of the feed-forward torque (s).
/// The expected sizes only affect parameters that the rows do not determine, or that another control law explains.
const PARAMETERS: [(f64, f64); SHARED] = [(1e-3, 5e-3), (1e-3, 5e-3), (1e-3, 5e-3), (1e-4, 2e-3), (1e-3, 5e-3)];

/// Start values of the delay (s) for drives with unknown gains: a delay of positions looks like a stiffer loop.
const DELAYS_S: &[f64] = &[-0.03, -0.02, -0.015, -0.01, -0.0075, -0.005, -0.0025, 0.0, 0.0025, 0.005, 0.01, 0.02];

/// Law by which the commanded torque follows from reference and positions.
#[derive(Clone, Copy, Debug)]
pub(super) enum CommandLaw<'a> {
    /// A completely known control law: one column, the commanded torque.
    Known { controller: &'a ControllerSettings, model: Option<&'a ControllerModel> },
    /// The drives have their own position loop with unknown gains. The columns are the feed-forward torque, the
    /// position error, its rate and its integral.
    OwnLoop {
        /// Model of the feed-forward torque; `None` in a run in which the drives receive only a path.
        model: Option<&'a ControllerModel>,
    },
}

pub(super) fn shared_parameters() -> [SharedParameter; SHARED] {
    PARAMETERS.map(|(difference, expected)| SharedParameter { difference, expected })
}

impl CommandLaw<'_> {
    /// Start values of the shared parameters.
    pub(super) fn starts(self) -> Vec<[f64; SHARED]> {
        match self {
            Self::Known { .. } => vec![[0.0; SHARED]],
            Self::OwnLoop { .. } => DELAYS_S.iter().map(|&delay_s| [delay_s, delay_s, 0.0, 0.0, 0.0]).collect(),
        }
    }
}

#[derive(Debug)]
pub(super) struct LoggedMotion<'a> {
    leg: &'a Leg,
    joints: usize,
    rate_hz: f64,
    first_time_s: f64,
    samples: usize,
    /// Positions, velocities and accelerations, joint-major.
    pub(super) q: Vec<f64>,
    pub(super) dq: Vec<f64>,
    pub(super) ddq: Vec<f64>,
}

#[derive(Debug)]
pub(super) struct ObservedLeg<'a> {
    pub(super) motion: LoggedMotion<'a>,
    decimator: Decimator,
    pub(super) torque: Vec<Vec<f64>>,
}

impl<'a> LoggedMotion<'a> {
    /// Creates the motion, smoothed below `smoothing_hz` or from differences of neighbouring samples; `None` if it is
    /// too short or not finite.
    pub(super) fn new(leg: &'a Leg, record: &Record, smoothing_hz: Option<f64>) -> Option<Self> {
        let (joints, samples) = (record.joints.len(), record.samples);
        if samples < 4 || joints != leg.reference().joints() {
            return None;
        }
        let first_time_s = record.times_s[0];
        let rate_hz = (samples - 1) as f64 / (record.times_s[samples - 1] - first_time_s);
        if !rate_hz.is_finite() || record.q.iter().chain(&record.tau).any(|value| !value.is_finite()) {
            return None;
        }
        let smoothing_hz = smoothing_hz.map(|hertz| hertz.min(0.4 * rate_hz));
        let way = match smoothing_hz {
            Some(_) => DifferentiatorSettings::Butterworth { order: 2, cutoff_hz: smoothing_hz },
            None => DifferentiatorSettings::CentralDifferences { order: 2 },
        };
        let way = way.build_following(smoothing_hz.unwrap_or(rate_hz), None).ok()?;
        let raw = on_uniform_clock(record, &record.q);
        let [mut q, mut dq, mut ddq] = [(); 3].map(|()| vec![0.0; joints * samples]);
        for joint in 0..joints {
            let own = joint * samples..(joint + 1) * samples;
            let out = Derivatives { q: &mut q[own.clone()], dq: &mut dq[own.clone()], ddq: &mut ddq[own.clone()] };
            way.differentiate_at(Place { rate_hz, joint, first_time_s }, &raw[own], out).ok()?;
        }
        Some(Self { leg, joints, rate_hz, first_time_s, samples, q, dq, ddq })
    }
}

impl<'a> ObservedLeg<'a> {
    /// Creates the log filtered below `cutoff_hz`; `None` if it is too short for the filter or not finite.
    pub(super) fn new(leg: &'a Leg, record: &Record, cutoff_hz: f64) -> Option<Self> {
        let motion = LoggedMotion::new(leg, record, Some(SMOOTHING_RATIO * cutoff_hz))?;
        let (rate_hz, joints) = (motion.rate_hz, motion.joints);
        if rate_hz <= 2.5 * cutoff_hz {
            return None;
        }
        let factor = ((rate_hz / (ROWS_PER_CUTOFF * cutoff_hz)).floor() as usize).clamp(1, 1000);
        let settings = DecimationSettings { factor, cutoff_hz: Some(cutoff_hz), ..DecimationSettings::default() };
        let decimator = Decimator::new(&settings, rate_hz, joints).ok()?;
        let mut observed = Self { motion, decimator, torque: Vec::new() };
        observed.torque = observed.decimated(&on_uniform_clock(record, &record.tau));
        (observed.rows() > 0).then_some(observed)
    }

    pub(super) fn rows(&self) -> usize {
        self.torque.first().map_or(0, Vec::len)
    }

    fn decimated(&self, panel: &[f64]) -> Vec<Vec<f64>> {
        let count = self.motion.joints;
        let mut decimator = self.decimator.with_columns(count);
        let mut out = Vec::new();
        let rows = decimator.push(panel, self.motion.samples, &mut out);
        if rows == 0 { vec![Vec::new(); count] } else { out.chunks_exact(rows).map(<[f64]>::to_vec).collect() }
    }

    pub(super) fn filtered_motion(&self) -> [Vec<Vec<f64>>; 3] {
        [&self.motion.q, &self.motion.dq, &self.motion.ddq].map(|values| self.decimated(values))
    }

    pub(super) fn columns(&self, law: CommandLaw<'_>, timing: &[f64; SHARED]) -> Vec<JointColumns> {
        let series = match law {
            CommandLaw::Known { controller, model } => {
                self.motion.commanded(controller, model, timing).map(|commanded| vec![commanded])
            }
            CommandLaw::OwnLoop { model } => Some(self.motion.own_loop(model, timing)),
        };
        let mut columns: Vec<JointColumns> = vec![Vec::new(); self.motion.joints];
        for of_all in series.iter().flatten() {
            for (joint, column) in self.decimated(of_all).into_iter().enumerate() {
                columns[joint].push(column);
            }
        }
        columns
    }
}

impl LoggedMotion<'_> {
    pub(super) fn commanded(
        &self,
        controller: &ControllerSettings,
        model: Option<&ControllerModel>,
        timing: &[f64; SHARED],
    ) -> Option<Vec<f64>> {
        let mut controller = controller.build(self.joints, model).ok()?;
        let mut out = vec![0.0; self.joints * self.samples];
        let mut tau = vec![0.0; self.joints];
        self.each_instant(timing, &mut |sample, time_s, target, measured| {
            controller.torque(time_s, target, measured, &mut tau);
            for (joint, tau) in tau.iter().enumerate() {
                out[joint * self.samples + sample] = *tau;
            }
        });
        out.iter().all(|value| value.is_finite()).then_some(out)
    }

    /// Inputs of drives with their own position loop, joint-major: feed-forward torque, position error, its rate, and
    /// its integral.
    fn own_loop(&self, model: Option<&ControllerModel>, timing: &[f64; SHARED]) -> Vec<Vec<f64>> {
        let mut model = model.cloned();
        let mut out = vec![vec![0.0; self.joints * self.samples]; 4];
        let mut ahead = vec![0.0; self.joints];
        let mut integral = vec![0.0; self.joints];
        let [mut q, mut dq, mut ddq] = [(); 3].map(|()| vec![0.0; self.joints]);
        let [_, _, _, _, ahead_s] = *timing;
        self.each_instant(timing, &mut |sample, time_s, target, measured| {
            if let Some(model) = &mut model {
                self.reference(time_s - ahead_s, [&mut q, &mut dq, &mut ddq]);
                model.reference_torque(&q, &dq, &ddq, &mut ahead);
            }
            for joint in 0..self.joints {
                let error = target.q[joint] - measured.q[joint];
                integral[joint] += error / self.rate_hz;
                let values = [ahead[joint], error, target.dq[joint] - measured.dq[joint], integral[joint]];
                let at = joint * self.samples + sample;
                out.iter_mut().zip(values).for_each(|(out, value)| out[at] = value);
            }
        });
        out
    }

    /// Calls `then` for each sample with its time, and the target and measurement of the controller.
    fn each_instant(&self, timing: &[f64; SHARED], then: &mut dyn FnMut(usize, f64, Target<'_>, Measured<'_>)) {
        let [position_delay_s, velocity_delay_s, torque_lag_s, clock_rate, _] = *timing;
        let [mut q, mut dq, mut ddq, mut seen_q, mut seen_dq] = [(); 5].map(|()| vec![0.0; self.joints]);
        for sample in 0..self.samples {
            let log_time_s = self.first_time_s + sample as f64 / self.rate_hz - torque_lag_s;
            let time_s = log_time_s * (1.0 + clock_rate);
            self.reference(time_s, [&mut q, &mut dq, &mut ddq]);
            for joint in 0..self.joints {
                seen_q[joint] = self.between(&self.q, &self.dq, joint, log_time_s - position_delay_s);
                seen_dq[joint] = self.between(&self.dq, &self.ddq, joint, log_time_s - velocity_delay_s);
            }
            let target = Target { q: &q, dq: &dq, ddq: &ddq };
            then(sample, time_s, target, Measured { q: &seen_q, dq: &seen_dq });
        }
    }

    fn reference(&self, time_s: f64, motion: [&mut [f64]; 3]) {
        let [q, dq, ddq] = motion;
        for joint in 0..self.joints {
            [q[joint], dq[joint], ddq[joint]] = self.leg.commanded().at(joint, time_s);
        }
    }

    /// Cubic Hermite interpolation of a joint's values with their derivatives; constant outside of the log.
    fn between(&self, values: &[f64], slopes: &[f64], joint: usize, time_s: f64) -> f64 {
        let own = joint * self.samples;
        let place = ((time_s - self.first_time_s) * self.rate_hz).clamp(0.0, (self.samples - 1) as f64);
        let before = (place.floor() as usize).min(self.samples - 2);
        let s = place - before as f64;
        let (v0, v1) = (values[own + before], values[own + before + 1]);
        let (m0, m1) = (slopes[own + before] / self.rate_hz, slopes[own + before + 1] / self.rate_hz);
        let rise = v1 - v0;
        v0 + s * (m0 + s * (3.0 * rise - 2.0 * m0 - m1 + s * (m0 + m1 - 2.0 * rise)))
    }
}
