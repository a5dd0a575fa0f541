//! Motion and parameters estimated together with a spline motion: a pendulum with known truth.

use dynident_estimation::{
    CovarianceMethod, EstimateStatus, EstimationError, SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings,
    SplineRecord, TorqueModel, TorqueSlopes, spline_motion_least_squares,
};
use dynident_model::sample::Random;
use dynident_model::terms::JointMotion;

/// `τ_j = J_j q̈_j + g_j sin q_j + v_j q̇_j + c_j tanh(q̇_j/w) + o_j`, independent joints except for `k (q̈_1 +
/// q̈_2)`.
struct Pendulums {
    joints: usize,
}

const WIDTH: f64 = 0.05;

impl Pendulums {
    fn values(parameters: &[f64], joint: usize, q: &[f64], dq: &[f64], ddq: &[f64]) -> (f64, [f64; 5], [f64; 3]) {
        let own = &parameters[5 * joint..5 * joint + 5];
        let smooth = (dq[joint] / WIDTH).tanh();
        let columns = [ddq[joint], q[joint].sin(), dq[joint], smooth, 1.0];
        let slopes = [own[1] * q[joint].cos(), own[2] + own[3] * (1.0 - smooth * smooth) / WIDTH, own[0]];
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
                let (mut torque, columns, slopes) = Self::values(parameters, j, &q, &dq, &ddq);
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

/// A motion of three sines, its exact torque, and noise of both; `colour` is the lag-1 correlation of the torque
/// noise.
fn record(
    joints: usize,
    rate_hz: f64,
    samples: usize,
    position: f64,
    torque: f64,
    colour: f64,
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
    for q in &mut q {
        *q += position * random.normal();
    }
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
    // A start that is 20 % wrong.
    let parameters = truth(joints).iter().map(|p| 1.2 * p).collect();
    let problem = SplineMotionProblem { names, joints: joint_names, records, parameters, held };
    spline_motion_least_squares(&problem, settings, &mut Pendulums { joints }).unwrap()
}

fn white() -> SplineMotionSettings {
    SplineMotionSettings { covariance: CovarianceMethod::White, ..SplineMotionSettings::default() }
}

/// Errors in units of their error bars must have an RMS near one: for 6 runs of 11 parameters the sampling error is
/// 1/√(2·66) = 9 %; tolerance 3 σ plus 10 % for the uncertainty of the smoothness.
#[test]
fn errors_agree_with_their_error_bars() {
    for colour in [0.0, 0.8] {
        let (mut squares, mut count) = (0.0, 0);
        for seed in 0..dynident_testing::count(6, 60) as u64 {
            let mut random = Random::new(100 + seed);
            let log = record(2, 200.0, 2000, 5e-4, 0.05, colour, &mut random);
            let found = fitted(2, vec![log], &white());
            assert_eq!(
                found.estimate.status,
                EstimateStatus::Complete,
                "seed {seed}: {} steps",
                found.estimate.iterations
            );
            assert!(found.cost <= found.cost_at_start);
            for ((value, true_value), std) in found.estimate.values.iter().zip(truth(2)).zip(&found.estimate.std) {
                squares += ((value - true_value) / std).powi(2);
                count += 1;
            }
            let own = &found.logs[0].joints[0];
            assert!((own.position_std / 5e-4 - 1.0).abs() < 0.1, "{}", own.position_std);
        }
        let ratio = (squares / f64::from(count)).sqrt();
        assert!((0.63..1.47).contains(&ratio), "colour {colour}: {ratio}");
    }
}

/// Two pieces with a gap are equivalent to one log of their length, and a held parameter does not change.
#[test]
fn pieces_have_separate_motions() {
    let mut random = Random::new(7);
    let whole = record(1, 200.0, 2000, 5e-4, 0.05, 0.0, &mut random);
    let part = |run: core::ops::Range<usize>| SplineRecord {
        q: whole.q[run.clone()].to_vec(),
        tau: whole.tau[run].to_vec(),
        ..whole.clone()
    };
    let one = fitted(1, vec![whole.clone()], &white());
    let two = fitted(1, vec![part(0..990), part(1010..2000)], &white());
    assert_eq!((two.logs.len(), two.motion.len()), (1, 2));
    for ((a, b), std) in one.estimate.values.iter().zip(&two.estimate.values).zip(&one.estimate.std) {
        // One sample in a hundred is missing, and there are four free ends instead of two: a third of an error bar.
        assert!((a - b).abs() < 0.33 * std, "{a} {b} {std}");
    }
    for (a, b) in one.estimate.std.iter().zip(&two.estimate.std) {
        assert!((a / b - 1.0).abs() < 0.1, "{a} {b}");
    }
    let names: Vec<String> = (0..5).map(|k| format!("p{k}")).collect();
    let mut parameters = truth(1);
    parameters[4] = 0.25;
    let held = vec![false, false, false, false, true];
    let problem = SplineMotionProblem { names, joints: vec!["joint".into()], records: vec![whole], parameters, held };
    let found = spline_motion_least_squares(&problem, &white(), &mut Pendulums { joints: 1 }).unwrap();
    assert_eq!((found.estimate.values[4], found.estimate.std[4]), (0.25, 0.0));
    assert_eq!(found.estimate.status, EstimateStatus::NotAllExcited);
}

#[test]
fn threads_do_not_change_the_estimate() {
    let made = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let log = record(2, 200.0, 600, 5e-4, 0.05, 0.0, &mut Random::new(9));
        pool.install(|| fitted(2, vec![log], &white())).estimate
    };
    assert_eq!(made(1), made(3));
}

#[test]
fn wrong_input_is_an_error() {
    let good = record(1, 200.0, 200, 5e-4, 0.05, 0.0, &mut Random::new(1));
    let names: Vec<String> = (0..5).map(|k| format!("p{k}")).collect();
    let joints = vec!["joint".to_owned()];
    let begun = |record: SplineRecord| SplineMotionProblem {
        names: names.clone(),
        joints: joints.clone(),
        records: vec![record],
        parameters: truth(1),
        held: vec![false; 5],
    };
    let run = |problem: &SplineMotionProblem, settings: &SplineMotionSettings| {
        spline_motion_least_squares(problem, settings, &mut Pendulums { joints: 1 }).map(|_| ())
    };
    let short = SplineRecord { q: good.q[..9].to_vec(), tau: good.tau[..9].to_vec(), ..good.clone() };
    assert!(matches!(run(&begun(short), &white()), Err(EstimationError::TooFewRows { rows: 9, .. })));
    let mut broken = good.clone();
    broken.tau[3] = f64::NAN;
    assert!(matches!(run(&begun(broken), &white()), Err(EstimationError::Unusable { row: 3, column: 1, .. })));
    let uneven = SplineRecord { tau: good.tau[1..].to_vec(), ..good.clone() };
    assert!(matches!(run(&begun(uneven), &white()), Err(EstimationError::Mismatch { .. })));
    let none = SplineMotionSettings { max_iterations: 0, ..white() };
    assert!(matches!(
        run(&begun(good.clone()), &none),
        Err(EstimationError::Setting { setting: "max_iterations", .. })
    ));
    // At rest inertia and friction are not distinguishable.
    let still = SplineRecord { q: vec![0.3; 200], tau: vec![1.0; 200], ..good };
    let found = run(&begun(still), &white());
    assert!(matches!(found, Err(EstimationError::Undetermined { .. })), "{found:?}");
}
