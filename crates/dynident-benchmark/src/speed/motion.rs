//! States and motions for timing.

use core::f64::consts::{PI, TAU};
use dynident_model::Model;
use dynident_model::sample::Random;

/// States in one sweep: enough to defeat branch prediction.
pub(crate) const STATES: usize = 512;

/// Random samples, stored joint by joint: positions within the limits (at most one turn), speeds and accelerations
/// within ±1.
pub(crate) struct Motion {
    pub(crate) samples: usize,
    pub(crate) q: Vec<f64>,
    pub(crate) dq: Vec<f64>,
    pub(crate) ddq: Vec<f64>,
}

impl Motion {
    pub(crate) fn random(model: &Model, samples: usize) -> Self {
        let mut random = Random::new(1);
        let mut motion = Self { samples, q: Vec::new(), dq: Vec::new(), ddq: Vec::new() };
        for joint in model.joints() {
            let low = joint.limits.lower.unwrap_or(-PI).max(-PI);
            let high = joint.limits.upper.unwrap_or(PI).min(PI);
            for _ in 0..samples {
                motion.q.push(random.uniform(low, high));
                motion.dq.push(random.uniform(-1.0, 1.0));
                motion.ddq.push(random.uniform(-1.0, 1.0));
            }
        }
        motion
    }

    /// A smooth exciting motion of `duration_s`: five harmonics of 0.1 Hz, as in the Python program.
    pub(crate) fn fourier(model: &Model, samples: usize, duration_s: f64) -> Self {
        let mut random = Random::new(3);
        let zeros = || vec![0.0; model.dof() * samples];
        let mut motion = Self { samples, q: zeros(), dq: zeros(), ddq: zeros() };
        for harmonic in 1..=5 {
            let w = TAU * 0.1 * f64::from(harmonic);
            for joint in 0..model.dof() {
                let (a, b) = (0.4 * random.normal(), 0.4 * random.normal());
                for sample in 0..samples {
                    let (sine, cosine) = (w * duration_s * sample as f64 / samples as f64).sin_cos();
                    let at = joint * samples + sample;
                    motion.q[at] += (a * sine - b * cosine) / w;
                    motion.dq[at] += a * cosine + b * sine;
                    motion.ddq[at] += w * (b * cosine - a * sine);
                }
            }
        }
        motion
    }

    /// The motion in blocks of at most `block` samples, each stored joint by joint.
    pub(crate) fn blocks(&self, block: usize) -> Vec<Self> {
        let dof = self.q.len() / self.samples;
        let cut = |array: &[f64], start: usize, end: usize| -> Vec<f64> {
            (0..dof).flat_map(|joint| array[joint * self.samples..][start..end].to_vec()).collect()
        };
        (0..self.samples)
            .step_by(block)
            .map(|start| {
                let end = (start + block).min(self.samples);
                Self {
                    samples: end - start,
                    q: cut(&self.q, start, end),
                    dq: cut(&self.dq, start, end),
                    ddq: cut(&self.ddq, start, end),
                }
            })
            .collect()
    }

    pub(crate) fn by_sample(&self) -> Vec<[Vec<f64>; 3]> {
        let dof = self.q.len() / self.samples;
        let at = |array: &[f64], sample: usize| (0..dof).map(|joint| array[joint * self.samples + sample]).collect();
        (0..self.samples).map(|s| [at(&self.q, s), at(&self.dq, s), at(&self.ddq, s)]).collect()
    }

    pub(crate) fn view(&self) -> dynident_model::terms::JointMotion<'_> {
        dynident_model::terms::JointMotion { samples: self.samples, q: &self.q, dq: &self.dq, ddq: &self.ddq }
    }
}
