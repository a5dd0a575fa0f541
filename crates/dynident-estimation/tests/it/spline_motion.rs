//! Motion and parameters at once, the motion a spline: a pendulum with known truth.

use dynident_estimation::{
    CovarianceMethod, EstimateStatus, EstimationError, SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings,
    SplineRecord, TorqueModel, TorqueSlopes, spline_motion_least_squares,
};
use dynident_model::sample::Random;
use dynident_model::terms::JointMotion;

/// `τ_j = J_j q̈_j + g_j sin q_j + v_j q̇_j + c_j tanh(q̇_j/w) + o_j`, joints apart but for `k (q̈_1 + q̈_2)` in both.
struct Pendulums {
    joints: usize,
}

const WIDTH: f64 = 0.05;

impl Pendulums {
    fn values(&self, parameters: &[f64], joint: usize, q: &[f64], dq: &[f64], ddq: &[f64]) -> (f64, [f64; 5], [f64; 3]) {
        let own = &parameters[5 * joint..5 * joint + 5];
        let smooth = (dq[joint] / WIDTH).tanh();
        let columns = [ddq[joint], q[joint].sin(), dq[joint], smooth, 1.0];
        let slopes = [
            own[1] * q[joint].cos(),
            own[2] + own[3] * (1.0 - smooth * smooth) / WIDTH,
            own[0],
        ];
        (columns.iter().zip(own).map(|(w, p)| w * p).sum(), columns, slopes)
    }

    fn shared(&self, parameters: &[f64]) -> Option<f64> {
        (self.joints > 1).then(|| parameters[5 * self.joints])
    }
}

impl TorqueModel for Pendulums {
    type Error = EstimationError;

    fn torque(
        &mut self,
        place: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<Vec<f64>, EstimationError> {
        Ok(self.slopes(place, motion, parameters)?.torque)
    }

    fn slopes(
        &mut self,
        _: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<TorqueSlopes, EstimationError> {
        let (n, samples) = (self.joints, motion.samples);
        let mut out = TorqueSlopes {
            torque: vec![0.0; n * samples],
            by_motion: vec![0.0; 3 * n * n * samples],
            columns: (0..n).map(|j| (5 * j..5 * j + 5).chain((n > 1).then_some(5 * n)).collect()).collect(),
            by_parameters: vec![vec![0.0; (5 + usize::from(n > 1)) * samples]; n],
        };
        for s in 0..samples {
            let at = |values: &[f64]| -> Vec<f64> { (0..n).map(|j| values[j * samples + s]).collect() };
            let (q, dq, ddq) = (at(motion.q), at(motion.dq), at(motion.ddq));
            let sum: f64 = ddq.iter().sum();
            for j in 0..n {
                let (mut torque, columns, slopes) = self.values(parameters, j, &q, &dq, &ddq);
                for (k, column) in columns.iter().enumerate() {
                    out.by_parameters[j][k * samples + s] = *column;
                }
                for (order, slope) in slopes.iter().enumerate() {
                    out.by_motion[(j * 3 * n + order * n + j) * samples + s] += slope;
                }
                if let Some(k) = self.shared(parameters) {
                    torque += k * sum;
                    out.by_parameters[j][5 * samples + s] = sum;
                    for other in 0..n {
                        out.by_motion[(j * 3 * n + 2 * n + other) * samples + s] += k;
                    }
                }
                out.torque[j * samples + s] = torque;
            }
        }
        Ok(out)
    }
}

fn truth(joints: usize) -> Vec<f64> {
    let mut all: Vec<f64> = (0..joints).flat_map(|j| [0.3 + 0.1 * j as f64, 4.0, 0.2, 0.5, 0.1]).collect();
    all.extend((joints > 1).then_some(0.2));
    all
}

/// A motion of three sines, its exact torque, and noise of both; the torque's of lag-one correlation `colour`.
fn record(
    joints: usize,
    (rate_hz, samples): (f64, usize),
    (position, torque, colour): (f64, f64, f64),
    random: &mut Random,
) -> SplineRecord {
    let (mut q, mut dq, mut ddq) = (Vec::new(), Vec::new(), Vec::new());
    for joint in 0..joints {
        let parts = [(0.8, 1.3), (0.4, 3.7), (0.1, 8.1)].map(|(a, w)| (a, w * (1.0 + 0.1 * joint as f64)));
        for k in 0..samples {
            let t = k as f64 / rate_hz;
            q.push(parts.iter().map(|(a, w)| a * (w * t).sin()).sum::<f64>());
            dq.push(parts.iter().map(|(a, w)| a * w * (w * t).cos()).sum::<f64>());
            ddq.push(parts.iter().map(|(a, w)| -a * w * w * (w * t).sin()).sum::<f64>());
        }
    }
    let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
    let mut tau = Pendulums { joints }.torque((0, 0), &motion, &truth(joints)).unwrap();
    q.iter_mut().for_each(|q| *q += position * random.normal());
    for own in tau.chunks_exact_mut(samples) {
        let mut error = torque * random.normal();
        for tau in own {
            *tau += error;
            error = colour * error + torque * (1.0 - colour * colour).sqrt() * random.normal();
        }
    }
    SplineRecord { log: 0, rate_hz, q, tau }
}

fn fitted(joints: usize, records: Vec<SplineRecord>, settings: &SplineMotionSettings) -> SplineMotionEstimate {
    let names: Vec<String> = (0..truth(joints).len()).map(|k| format!("p{k}")).collect();
    let held = vec![false; names.len()];
    let joint_names = (0..joints).map(|j| format!("joint{j}")).collect();
    // A start that is 20 % off.
    let parameters = truth(joints).iter().map(|p| 1.2 * p).collect();
    let problem = SplineMotionProblem { names, joints: joint_names, records, parameters, held };
    spline_motion_least_squares(&problem, settings, &mut Pendulums { joints }).unwrap()
}

fn white() -> SplineMotionSettings {
    SplineMotionSettings { covariance: CovarianceMethod::White, ..SplineMotionSettings::default() }
}

/// Over seeded repetitions errors in own error bars must have a root mean square near one: with 6 runs of 11
/// parameters each, chance leaves 1/√(2·66) = 9 %; three of these on either side and 10 % for what the smoothness's own
/// uncertainty adds.
#[test]
fn scratch() {
    for h in [None, Some(0.15), Some(0.1), Some(0.06), Some(0.03), Some(0.015)] {
    for colour in [0.0, 0.8] {
        let (mut squares, mut count) = (0.0, 0);
        let mut errors = vec![0.0;11];
        let mut stds = vec![0.0;11];
        let mut iters = vec![];
        let mut last = String::new();
        for seed in 0..10 {
            let mut random = Random::new(100 + seed);
            let log = record(2, (200.0, 2000), (5e-4, 0.05, colour), &mut random);
            let found = fitted(2, vec![log], &SplineMotionSettings { knot_spacing_s: h, ..white() });
            iters.push(found.estimate.iterations);
            for (k,((value, true_value), std)) in found.estimate.values.iter().zip(truth(2)).zip(&found.estimate.std).enumerate() {
                squares += ((value - true_value) / std).powi(2);
                errors[k] += (value - true_value).powi(2)/10.0;
                stds[k] += std/10.0;
                count += 1;
            }
            let own = &found.logs[0].joints[0];
            last = format!("{own:?} {}", found.logs[0].functions);
        }
        let ratio = (squares / f64::from(count)).sqrt();
        println!("h {h:?} colour {colour}: {ratio:.3} {iters:?} {last}\n rmse {:?}\n std {stds:?}", errors.iter().map(|x: &f64| x.sqrt()).collect::<Vec<_>>());
    }
    }
}
#[test]
fn errors_are_as_large_as_their_bars() {
    for colour in [0.0, 0.8] {
        let (mut squares, mut count) = (0.0, 0);
        for seed in 0..dynident_testing::count(6, 60) as u64 {
            let mut random = Random::new(100 + seed);
            let log = record(2, (200.0, 2000), (5e-4, 0.05, colour), &mut random);
            let found = fitted(2, vec![log], &white());
            assert_eq!(found.estimate.status, EstimateStatus::Complete, "seed {seed}: {} steps", found.estimate.iterations);
            assert!(found.cost <= found.cost_at_start);
            for ((value, true_value), std) in found.estimate.values.iter().zip(truth(2)).zip(&found.estimate.std) {
                squares += ((value - true_value) / std).powi(2);
                count += 1;
            }
            let own = &found.logs[0].joints[0];
            assert!((own.position_std / 5e-4 - 1.0).abs() < 0.1, "{}", own.position_std);
            println!("{} {} {:?} {:?}", found.estimate.iterations, found.logs[0].knot_spacing_s, own, found.estimate.std);
        }
        let ratio = (squares / f64::from(count)).sqrt();
        println!("colour {colour}: {ratio}");
        assert!((0.63..1.47).contains(&ratio), "colour {colour}: {ratio}");
    }
}
