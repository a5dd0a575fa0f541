//! Experiment of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function* as one motion:
//! spliced logistic functions of one joint after another, while the others rest.

use super::error::FamilyError;
use super::spliced_logistic::{SplicedLogistic, SplicedLogisticSettings};
use crate::family::Family;
use crate::motion::{Motion, MotionAdjoint};
use dynident_model::sample::Random;

/// Parameters per step: A, ω.
const PARAMETERS_PER_STEP: usize = 2;

/// Motion of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Index of the joint.
    pub joint: usize,
    /// Period T of the joint's motion, s.
    pub period_s: f64,
}

/// [`SplicedLogistic`] of single joints, one after another. Parameters: A in rad (m) and ω in 1/s of each step, in the
/// order of the steps.
///
/// Before and after its own motion a joint rests at the start of its function, A/(1 + e^(ωT/4)) from its offset. A
/// joint that never moves rests at its offset. Velocity and acceleration are discontinuous at the splices (Eq. 17 of
/// the paper requires less than 1e-4).
#[derive(Clone, Debug)]
pub struct StepWiseLogistic {
    offsets: Vec<f64>,
    steps: Vec<Turn>,
    duration_s: f64,
}

#[derive(Clone, Debug)]
struct Turn {
    joint: usize,
    start_s: f64,
    family: SplicedLogistic,
}

impl StepWiseLogistic {
    /// Creates the family of motions that move one joint after another, one for each entry of `steps`. `offsets`
    /// contains the position h (rad, m) of each joint from which its motion is measured; ωT and the number of
    /// repetitions are those of `settings`.
    ///
    /// # Errors
    /// Errors of [`SplicedLogistic::new`] for each step.
    ///
    /// # Panics
    /// If a step contains a joint without offset.
    pub fn new(offsets: &[f64], steps: &[Step], settings: &SplicedLogisticSettings) -> Result<Self, FamilyError> {
        let mut start_s = 0.0;
        let mut is_rotary = Vec::with_capacity(steps.len());
        for step in steps {
            let lasts_s = step.period_s * settings.repetitions as f64;
            let own = SplicedLogisticSettings {
                periods_s: Some(vec![step.period_s]),
                offsets: Some(vec![offsets[step.joint]]),
                ..settings.clone()
            };
            is_rotary.push(Turn { joint: step.joint, start_s, family: SplicedLogistic::new(1, lasts_s, &own)? });
            start_s += lasts_s;
        }
        Ok(Self { offsets: offsets.to_vec(), steps: is_rotary, duration_s: start_s })
    }
}

impl Turn {
    fn moves(&self, time_s: f64) -> bool {
        (self.start_s..=self.start_s + self.family.duration_s()).contains(&time_s)
    }

    fn own_times(&self, times_s: &[f64]) -> Vec<f64> {
        times_s.iter().map(|time| (time - self.start_s).clamp(0.0, self.family.duration_s())).collect()
    }
}

impl Family for StepWiseLogistic {
    fn name(&self) -> &'static str {
        "step_wise_logistic"
    }

    fn joints(&self) -> usize {
        self.offsets.len()
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn parameters(&self) -> usize {
        PARAMETERS_PER_STEP * self.steps.len()
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        self.steps.iter().flat_map(|turn| turn.family.bounds()).collect()
    }

    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        let one = |turn: &Turn| turn.family.random(&[ranges[turn.joint]], &[speeds[turn.joint]], random);
        self.steps.iter().flat_map(one).collect()
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        assert_eq!(parameters.len(), self.parameters(), "parameters of {}", self.name());
        out.reset(self.offsets.len(), times_s.len());
        for (joint, offset) in self.offsets.iter().enumerate() {
            let of = out.of(joint);
            out.q[of].fill(*offset);
        }
        let mut alone = Motion::default();
        for (turn, own) in self.steps.iter().zip(parameters.chunks_exact(PARAMETERS_PER_STEP)) {
            turn.family.motion(own, &turn.own_times(times_s), &mut alone);
            for (sample, (at, time)) in out.of(turn.joint).zip(times_s).enumerate() {
                out.q[at] = alone.q[sample];
                if turn.moves(*time) {
                    (out.dq[at], out.ddq[at], out.dddq[at]) = (alone.dq[sample], alone.ddq[sample], alone.dddq[sample]);
                }
            }
        }
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        assert_eq!(gradient.len(), self.parameters(), "gradient of {}", self.name());
        let mut alone = Motion::default();
        let parts = parameters.chunks_exact(PARAMETERS_PER_STEP).zip(gradient.chunks_exact_mut(PARAMETERS_PER_STEP));
        for (turn, (own, gradient)) in self.steps.iter().zip(parts) {
            alone.reset(1, times_s.len());
            for (sample, (at, time)) in adjoint.of(turn.joint).zip(times_s).enumerate() {
                alone.q[sample] = adjoint.q[at];
                if turn.moves(*time) {
                    (alone.dq[sample], alone.ddq[sample], alone.dddq[sample]) =
                        (adjoint.dq[at], adjoint.ddq[at], adjoint.dddq[at]);
                }
            }
            turn.family.apply_adjoint(own, &turn.own_times(times_s), &alone, gradient);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::check;
    use crate::grid;

    fn family() -> StepWiseLogistic {
        let steps = [Step { joint: 1, period_s: 40.0 }, Step { joint: 0, period_s: 20.0 }];
        StepWiseLogistic::new(&[0.1, 0.2, 0.3], &steps, &SplicedLogisticSettings::default()).unwrap()
    }

    #[test]
    fn one_joint_moves_at_a_time_with_the_peaks_of_equation_16() {
        let family = family();
        let times = grid(60.0, 6001);
        let mut motion = Motion::default();
        family.motion(&[2.0, 1.0, 1.5, 2.0], &times, &mut motion);
        for sample in 0..times.len() {
            assert!((0..3).filter(|joint| motion.dq[joint * 6001 + sample] != 0.0).count() <= 1);
            assert_eq!(motion.q[2 * 6001 + sample], 0.3);
        }
        assert!((motion.dq[6001 + 1000] - 0.5).abs() < 1e-12 && (motion.dq[4500] - 0.75).abs() < 1e-12);
    }

    #[test]
    fn gradients_are_exact() {
        let family = family();
        let times = grid(60.0, 101);
        check::gradient_on(&family, &[2.0, 1.1, 1.5, 2.2], &times, 4);
    }
}
