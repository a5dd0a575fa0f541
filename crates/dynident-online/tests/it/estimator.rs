//! After n samples the recursive estimate equals the batch estimate.

use dynident_dynamics::{BatchWorkspace, Panels, ParametricModel, regressor_panels};
use dynident_model::load_robot;
use dynident_model::sample::Random;
use dynident_model::terms::{DriveChoice, JointMotion, terms_per_joint};
use dynident_online::{OnlineError, OnlineEstimator, OnlineSettings, StartingPoint};
use dynident_testing::repository;
use nalgebra::{DMatrix, DVector};

fn robot() -> ParametricModel {
    let model = load_robot(repository("robots/panda_arm7.urdf")).unwrap().model;
    let terms =
        terms_per_joint(&model, |_| DriveChoice { viscous: true, drive_inertia: true, ..DriveChoice::default() });
    ParametricModel::new(model, terms).unwrap()
}

/// Random states with the torque of random parameters, and noise.
struct Samples {
    states: Vec<[Vec<f64>; 4]>,
    /// Rows by joint and sample, divided by the joint's deviation: `[W | τ]`.
    rows: DMatrix<f64>,
}

const STD: [f64; 7] = [0.5, 0.4, 0.3, 0.3, 0.2, 0.1, 0.05];

fn samples(robot: &ParametricModel, count: usize, seed: u64) -> Samples {
    let (dof, columns) = (robot.dof(), robot.layout().columns().len());
    let mut random = Random::new(seed);
    let theta: Vec<f64> = (0..columns).map(|_| random.uniform(-1.0, 1.0)).collect();
    let mut workspace = BatchWorkspace::new(robot.model());
    let mut panels = Panels::default();
    let (mut states, mut rows) = (Vec::new(), DMatrix::zeros(count * dof, columns + 1));
    for sample in 0..count {
        let mut draw = |size: f64| -> Vec<f64> { (0..dof).map(|_| random.uniform(-size, size)).collect() };
        let (q, dq, ddq, noise) = (draw(2.5), draw(2.0), draw(6.0), draw(1.0));
        let motion = JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq };
        regressor_panels(robot.model(), &mut workspace, robot.layout(), &motion, &mut panels);
        let mut tau = vec![0.0; dof];
        for joint in 0..dof {
            let own = robot.layout().joint_columns(joint);
            tau[joint] = own.iter().zip(panels.joint(joint)).map(|(&column, entry)| theta[column] * entry).sum();
            tau[joint] += STD[joint] * noise[joint];
            let row = sample * dof + joint;
            for (&column, entry) in own.iter().zip(panels.joint(joint)) {
                rows[(row, column)] = entry / STD[joint];
            }
            rows[(row, columns)] = tau[joint] / STD[joint];
        }
        states.push([q, dq, ddq, tau]);
    }
    Samples { states, rows }
}

/// Least squares of all rows by SVD, with `(WᵀW)⁻¹`.
fn batch(rows: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let columns = rows.ncols() - 1;
    let (regressor, torque) = (rows.columns(0, columns).into_owned(), rows.column(columns).into_owned());
    let svd = regressor.svd(true, true);
    let theta = svd.solve(&torque, 0.0).unwrap();
    let v = svd.v_t.unwrap().transpose();
    let scaled = DMatrix::from_fn(columns, columns, |i, j| v[(i, j)] / svd.singular_values[j]);
    (theta, &scaled * scaled.transpose())
}

fn fed(settings: OnlineSettings, samples: &Samples, start: Option<&StartingPoint>) -> OnlineEstimator {
    let mut estimator = OnlineEstimator::new(robot(), settings, start).unwrap();
    for [q, dq, ddq, tau] in &samples.states {
        estimator.add(q, dq, ddq, tau).unwrap();
    }
    estimator
}

fn compare(estimator: &OnlineEstimator, rows: &DMatrix<f64>) {
    let (theta, covariance) = batch(rows);
    let mut values = vec![0.0; theta.len()];
    assert!(estimator.values(&mut values));
    // Parameters of size 1; the condition number of the regressor is some hundreds.
    for (found, expected) in values.iter().zip(theta.iter()) {
        assert!((found - expected).abs() < 1e-10, "{found} and {expected}");
    }
    let found = estimator.covariance().unwrap();
    let largest = covariance.amax();
    assert!((&found - &covariance).amax() < 1e-9 * largest, "{}", (found - covariance).amax() / largest);
}

#[test]
fn recursive_estimate_equals_the_batch() {
    let robot = robot();
    assert!(robot.layout().columns().len() >= 55);
    let samples = samples(&robot, 600, 1);
    let estimator = fed(OnlineSettings::new(STD.to_vec()), &samples, None);
    assert_eq!(estimator.samples(), 600);
    compare(&estimator, &samples.rows);
}

#[test]
fn forgetting_weights_equal_those_of_a_batch() {
    let robot = robot();
    let (samples, columns, dof) = (samples(&robot, 800, 2), robot.layout().columns().len(), robot.dof());
    let start = StartingPoint {
        values: vec![0.1; columns],
        covariance: DMatrix::from_fn(columns, columns, |i, j| if i == j { 0.04 } else { 0.002 }),
    };
    let half = 150.0;
    let settings = OnlineSettings { half_life_samples: Some(half), ..OnlineSettings::new(STD.to_vec()) };
    let estimator = fed(settings, &samples, Some(&start));
    // The latest sample has full weight; the start precedes the first sample.
    let last = samples.states.len() - 1;
    let weight = |sample: usize| 0.5_f64.powf(0.5 * (last - sample) as f64 / half);
    let root = start.covariance.clone().cholesky().unwrap().inverse().cholesky().unwrap().l().transpose();
    let mut rows = DMatrix::zeros(samples.rows.nrows() + columns, columns + 1);
    for row in 0..samples.rows.nrows() {
        rows.row_mut(row).copy_from(&(samples.rows.row(row) * weight(row / dof)));
    }
    let right = &root * DVector::from_column_slice(&start.values);
    rows.view_mut((samples.rows.nrows(), 0), (columns, columns)).copy_from(&(root * weight(0)));
    rows.view_mut((samples.rows.nrows(), columns), (columns, 1)).copy_from(&(right * weight(0)));
    compare(&estimator, &rows);
}

#[test]
fn rescaling_keeps_the_estimate_over_a_long_run() {
    // A half-life of five samples: weights overflow many times without rescaling.
    let robot = robot();
    let samples = samples(&robot, 400, 3);
    let settings = OnlineSettings { half_life_samples: Some(5.0), ..OnlineSettings::new(STD.to_vec()) };
    let mut estimator = OnlineEstimator::new(robot, settings, None).unwrap();
    for [q, dq, ddq, tau] in samples.states.iter().cycle().take(4_000) {
        estimator.add(q, dq, ddq, tau).unwrap();
    }
    let mut values = vec![0.0; estimator.factor().columns()];
    assert!(estimator.values(&mut values) && values.iter().all(|value| value.is_finite()));
    assert!(estimator.covariance().is_some());
}

#[test]
fn too_few_samples_determine_nothing_and_bad_ones_change_nothing() {
    let robot = robot();
    let samples = samples(&robot, 30, 4);
    let mut estimator = OnlineEstimator::new(robot, OnlineSettings::new(STD.to_vec()), None).unwrap();
    let mut values = vec![0.0; estimator.factor().columns()];
    let [q, dq, ddq, tau] = &samples.states[0];
    estimator.add(q, dq, ddq, tau).unwrap();
    assert!(!estimator.values(&mut values));
    let before = estimator.factor().to_triangular();
    assert!(matches!(estimator.add(&q[1..], dq, ddq, tau), Err(OnlineError::Length { .. })));
    let mut bad = tau.clone();
    bad[3] = f64::NAN;
    assert!(matches!(estimator.add(q, dq, ddq, &bad), Err(OnlineError::Number { .. })));
    assert_eq!((estimator.factor().to_triangular(), estimator.samples()), (before.clone(), 1));
    let columns = before.columns();
    let start = StartingPoint { values: vec![0.0; columns], covariance: -DMatrix::identity(columns, columns) };
    let refused = OnlineEstimator::new(self::robot(), OnlineSettings::new(STD.to_vec()), Some(&start));
    assert!(matches!(refused, Err(OnlineError::Covariance)));
    assert!(OnlineEstimator::new(self::robot(), OnlineSettings::new(vec![0.1; 3]), None).is_err());
}

#[test]
fn fixed_parameters_stay_while_others_change() {
    let robot = robot();
    let (samples, columns) = (samples(&robot, 300, 6), robot.layout().columns().len());
    let held = [3, 20];
    let covariance = DMatrix::from_fn(columns, columns, |i, j| if i == j && !held.contains(&i) { 0.04 } else { 0.0 });
    let start = StartingPoint { values: vec![0.1; columns], covariance };
    let estimator = fed(OnlineSettings::new(STD.to_vec()), &samples, Some(&start));
    let mut values = vec![0.0; columns];
    assert!(estimator.values(&mut values));
    let std: Vec<f64> = estimator.covariance().unwrap().diagonal().iter().map(|variance| variance.sqrt()).collect();
    for (column, (value, std)) in values.iter().zip(&std).enumerate() {
        if held.contains(&column) {
            // A thousandth of 0.2, and some hundred such deviations of influence from the samples.
            assert!((value - 0.1).abs() < 0.05 && *std < 2.1e-4, "{value} and {std}");
        } else {
            assert!((value - 0.1).abs() > 1e-6 && *std < 0.2);
        }
    }
}

#[test]
fn a_covariance_of_few_segments_is_a_start() {
    let robot = robot();
    let (samples, columns) = (samples(&robot, 200, 8), robot.layout().columns().len());
    let mut random = Random::new(9);
    let scores = DMatrix::from_fn(columns, columns / 2, |_, _| random.uniform(-0.1, 0.1));
    let start = StartingPoint { values: vec![0.1; columns], covariance: &scores * scores.transpose() };
    let estimator = fed(OnlineSettings::new(STD.to_vec()), &samples, Some(&start));
    let before = OnlineEstimator::new(robot, OnlineSettings::new(STD.to_vec()), Some(&start)).unwrap();
    let (before, after) = (before.covariance().unwrap(), estimator.covariance().unwrap());
    for column in 0..columns {
        // No parameter is more certain than stated, except for the floor of the eigenvalues, and samples add
        // information.
        assert!(before[(column, column)] >= 0.999 * start.covariance[(column, column)]);
        assert!(after[(column, column)] < before[(column, column)]);
    }
}
