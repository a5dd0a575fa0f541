//! Figs. 16, 17: torques of a run along another motion (Eq. 25), and the predictions of the identified models from its
//! positions.

use crate::arm::{Arm, TRUTH};
use crate::base_parameters::COLUMNS;
use crate::equal_conditions::{Comparison, Differentiation, Method, Trials};
use crate::joint_runs::{failed, model_based};
use crate::piece::{PaperFigure, rough, thinned};
use dynident::Error;
use dynident_dynamics::{BaseParameterSettings, BaseParameters, Workspace, torque_regressor};
use dynident_excitation::{Motion, grid};
use dynident_iteration::IterationError;
use dynident_recording::{Derivatives, DifferentiatorSettings, Place};
use dynident_report::LinePlot;
use dynident_simulation::{ControllerModel, Integrator, LoopSettings, Plant, Reference, closed_loop};

/// Duration of the motion, s, and sampling rate, Hz.
const DURATION_S: f64 = 10.0;
const RATE_HZ: f64 = 1000.0;
const PLOT_DECIMATION: usize = 10;
/// Samples omitted at either end, where differences of order 8 exceed the motion.
const END_SAMPLES: usize = 8;

/// The run along Eq. 25: times, driving torques, and the regressor rows that predict them.
pub(crate) struct Verification {
    times: Vec<f64>,
    driving: [Vec<f64>; 2],
    /// By joint and sample, the six columns.
    rows: [Vec<[f64; 6]>; 2],
}

impl Verification {
    /// Runs the simulated arm along q1 = sin t, q2 = sin(−t) under the law (23) with the true model, and samples
    /// positions and driving torques without noise, so that the difference between driving and predicted torque is the
    /// model error. Velocity and acceleration are central differences of the sampled positions.
    pub(crate) fn run(arm: &Arm) -> Result<Self, Error> {
        Self::made(arm).map_err(|why| failed(&arm.description, why))
    }

    fn made(arm: &Arm) -> Result<Self, IterationError> {
        let times = grid(DURATION_S, (DURATION_S * RATE_HZ) as usize + 1);
        let mut motion = Motion::default();
        motion.reset(2, times.len());
        for (joint, sign) in [1.0, -1.0].into_iter().enumerate() {
            for (sample, place) in motion.of(joint).enumerate() {
                let (sin, cos) = times[sample].sin_cos();
                motion.q[place] = sign * sin;
                motion.dq[place] = sign * cos;
                motion.ddq[place] = -sign * sin;
                motion.dddq[place] = -sign * cos;
            }
        }
        let reference = Reference::new(RATE_HZ, motion)?;
        let known = ControllerModel::new(&arm.model, &[], &[])?;
        let mut controller = model_based().build(2, Some(&known))?;
        let integrator = Integrator::Rk4 { steps_per_sample: 1 };
        let settings = LoopSettings { integrator, ..LoopSettings::default() };
        let run = closed_loop(&mut Plant::new(&arm.model, &[], &[])?, controller.as_mut(), &reference, &settings)?;
        if !run.status.is_done() {
            let problem = format!("the run along Eq. 25 did not reach its end: {}", run.status);
            return Err(IterationError::State { path: arm.description.clone(), problem });
        }
        let differences = DifferentiatorSettings::CentralDifferences { order: 8 }.build(0.0)?;
        let samples = run.samples;
        let mut rates = [0, 1].map(|_| [vec![0.0; samples], vec![0.0; samples], vec![0.0; samples]]);
        for (joint, [q, dq, ddq]) in rates.iter_mut().enumerate() {
            let place = Place { rate_hz: RATE_HZ, joint, first_time_s: 0.0 };
            differences.differentiate_at(place, &run.q[run.of(joint)], Derivatives { q, dq, ddq })?;
        }
        let base = BaseParameters::new(&arm.model, &[], &BaseParameterSettings::default());
        let mut workspace = Workspace::new(&arm.model);
        let width = 10 * arm.model.dof();
        let mut made = Self { times: Vec::new(), driving: Default::default(), rows: Default::default() };
        for sample in END_SAMPLES..samples - END_SAMPLES {
            let of = |k: usize| [rates[0][k][sample], rates[1][k][sample]];
            let regressor = torque_regressor(&arm.model, &mut workspace, &of(0), &of(1), &of(2));
            made.times.push(run.time_s(sample));
            for joint in 0..2 {
                let row = &regressor[joint * width..(joint + 1) * width];
                made.rows[joint].push(COLUMNS.map(|column| row[base.independent()[column]]));
                // The torque is constant between samples; at a sample the mean of the values before and after applies.
                let torque = &run.tau[run.of(joint)];
                made.driving[joint].push(0.5 * (torque[sample - 1] + torque[sample]));
            }
        }
        Ok(made)
    }

    fn predicted(&self, joint: usize, theta: &[f64; 6]) -> Vec<f64> {
        self.rows[joint].iter().map(|row| row.iter().zip(theta).map(|(row, theta)| row * theta).sum()).collect()
    }

    /// Root mean square of predicted minus driving torque, Nm.
    pub(crate) fn deviation(&self, joint: usize, theta: &[f64; 6]) -> f64 {
        let predicted = self.predicted(joint, theta);
        let squares = predicted.iter().zip(&self.driving[joint]).map(|(p, d)| (p - d).powi(2));
        (squares.sum::<f64>() / predicted.len() as f64).sqrt()
    }

    /// [`deviation`](Self::deviation) over all noisy trials, Nm.
    pub(crate) fn noisy_deviation(&self, joint: usize, trials: &Trials) -> f64 {
        let squares = trials.noisy.iter().map(|trial| self.deviation(joint, &trial.last()).powi(2));
        (squares.sum::<f64>() / trials.noisy.len() as f64).sqrt()
    }

    /// Figs. 16 and 17: driving torque and both predictions with the default differentiator of studies, and root mean
    /// square deviations of the same noisy trials over time.
    pub(crate) fn figures(&self, comparison: &Comparison) -> Vec<(PaperFigure, LinePlot)> {
        let [Some(logistic), Some(fourier)] =
            [Method::Logistic, Method::Fourier].map(|method| comparison.of(method, Differentiation::Deviation))
        else {
            return Vec::new();
        };
        (0..2).map(|joint| self.figure(joint, logistic, fourier)).collect()
    }

    fn figure(&self, joint: usize, logistic: &Trials, fourier: &Trials) -> (PaperFigure, LinePlot) {
        let title = format!("Predicted and driving torques of joint {}", joint + 1);
        let plot = LinePlot::new(title, "t, s", "torque, Nm", self.times.clone())
            .broad("driving", self.driving[joint].clone())
            .line("logistic", self.predicted(joint, &logistic.clean.last()))
            .dashed("Fourier", self.predicted(joint, &fourier.clean.last()));
        let largest = |trials: &Trials| {
            let predicted = self.predicted(joint, &trials.clean.last());
            predicted.iter().zip(&self.driving[joint]).map(|(p, d)| (p - d).abs()).fold(0.0_f64, f64::max)
        };
        let [clean_l, clean_f] = [largest(logistic), largest(fourier)];
        let [noisy_l, noisy_f] = [logistic, fourier].map(|trials| self.noisy_deviation(joint, trials));
        let caption = format!(
            "Largest deviation of the predicted from the driving torque without noise: logistic {} Nm, Fourier {} Nm; with noise (root mean square over time and {} seeds): logistic {} Nm, Fourier {} Nm",
            rough(clean_l),
            rough(clean_f),
            logistic.noisy.len(),
            rough(noisy_l),
            rough(noisy_f),
        );
        let note = "both models from equal conditions (see above), with the same differentiator, after three runs without noise; driving torque and positions from a run of the simulated arm along Eq. 25, which itself violates (18): its speed is 1 rad/s";
        let figure = PaperFigure::new(16 + joint, thinned(plot, PLOT_DECIMATION), note)
            .value("largest_deviation_logistic_nm", clean_l)
            .value("largest_deviation_fourier_nm", clean_f)
            .value("rms_deviation_with_noise_logistic_nm", noisy_l)
            .value("rms_deviation_with_noise_fourier_nm", noisy_f)
            .caption(caption);
        let over_time = |trials: &Trials| -> Vec<f64> {
            let mut squares = vec![0.0; self.times.len()];
            for trial in &trials.noisy {
                let predicted = self.predicted(joint, &trial.last());
                for ((square, p), d) in squares.iter_mut().zip(predicted).zip(&self.driving[joint]) {
                    *square += (p - d).powi(2) / trials.noisy.len() as f64;
                }
            }
            squares.into_iter().map(f64::sqrt).collect()
        };
        let title =
            format!("Fig. {}, with noise: deviation of the predicted torque of joint {}", 16 + joint, joint + 1);
        let deviation = LinePlot::new(title, "t, s", "rms over seeds, Nm", self.times.clone())
            .line("logistic", over_time(logistic))
            .line("Fourier", over_time(fourier))
            .note(format!(
                "predicted minus driving torque after three noisy runs, root mean square over {} seeds; the largest torque is {} Nm",
                logistic.noisy.len(),
                rough(self.driving[joint].iter().fold(0.0_f64, |most, torque| most.max(torque.abs())))
            ));
        (figure, thinned(deviation, PLOT_DECIMATION))
    }
}

pub(crate) fn worst(theta: &[f64; 6]) -> f64 {
    theta.iter().zip(TRUTH).map(|(value, truth)| (value - truth).abs()).fold(0.0, f64::max)
}
