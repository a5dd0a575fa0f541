use super::*;

const FREE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

fn never(_: &Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum()
}

fn rastrigin(x: &[f64]) -> f64 {
    x.iter().map(|x| 10.0 + x * x - 10.0 * (core::f64::consts::TAU * x).cos()).sum()
}

#[test]
fn finds_the_end_of_rosenbrocks_valley() {
    let settings = CmaEsSettings { seed: 1, ..Default::default() };
    let result = cma_es(rosenbrock, &[-1.0; 5], &[0.5; 5], &[FREE; 5], &settings, &mut never).unwrap();
    assert!(matches!(result.status, CmaEsStatus::FunctionTolerance | CmaEsStatus::StepTolerance), "{result:?}");
    // A spread of 1e-12 in the values is about 1e-6 in the variables; the other local solution has the value 3.9.
    assert!(result.value < 1e-9, "{}", result.value);
    assert!(result.best.iter().all(|x| (x - 1.0).abs() < 1e-4), "{:?}", result.best);
    // The tutorial's program needs about 3000 evaluations; an incorrect covariance update needs ten times as many.
    assert!(result.evaluations < 8000, "{}", result.evaluations);
}

#[test]
fn learns_axes_of_a_million_to_one() {
    // A tilted ellipsoid: without covariance adaptation the evaluations would grow with the condition number.
    let n = 8;
    let ellipsoid = |x: &[f64]| -> f64 {
        (0..n)
            .map(|i| {
                let along = x[i] + 0.5 * x[(i + 1) % n];
                10_f64.powf(6.0 * i as f64 / (n as f64 - 1.0)) * along * along
            })
            .sum()
    };
    let settings = CmaEsSettings { seed: 2, target: Some(1e-10), ..Default::default() };
    let result = cma_es(ellipsoid, &[3.0; 8], &[1.0; 8], &[FREE; 8], &settings, &mut never).unwrap();
    assert_eq!(result.status, CmaEsStatus::TargetReached);
    assert!(result.evaluations < 12_000, "{}", result.evaluations);
}

#[test]
fn bounds_are_kept_and_can_be_active() {
    let settings = CmaEsSettings { seed: 3, ..Default::default() };
    let bounds = [[-2.0, 0.5], [-3.0, 3.0]];
    let objective = |x: &[f64]| {
        assert!((-2.0..=0.5).contains(&x[0]) && (-3.0..=3.0).contains(&x[1]));
        rosenbrock(x)
    };
    let result = cma_es(objective, &[-1.0, 2.0], &[0.5, 0.5], &bounds, &settings, &mut never).unwrap();
    // Minimum inside the bounds: 0.25 at (0.5, 0.25).
    assert!((result.value - 0.25).abs() < 1e-8, "{result:?}");
}

#[test]
fn restarts_leave_local_solutions() {
    let bounds = [[-5.12, 5.12]; 4];
    let settings = CmaEsSettings { seed: 4, restarts: 7, target: Some(1e-8), ..Default::default() };
    let result = cma_es(rastrigin, &[4.2; 4], &[1.0; 4], &bounds, &settings, &mut never).unwrap();
    assert_eq!(result.status, CmaEsStatus::TargetReached, "{result:?}");
    for (run, doubled) in result.runs.iter().zip(0..) {
        assert_eq!(run.population, 8 << doubled);
    }
    assert_eq!(result.evaluations, result.runs.iter().map(|run| run.evaluations).sum::<usize>());
}

#[test]
fn only_the_seed_decides_on_any_number_of_threads() {
    let run = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = CmaEsSettings { seed, restarts: 1, max_evaluations: 2000, ..Default::default() };
        pool.install(|| cma_es(rastrigin, &[3.0; 3], &[1.0; 3], &[[-5.0, 5.0]; 3], &settings, &mut never).unwrap())
    };
    assert_eq!(run(1, 5), run(3, 5));
    assert_ne!(run(1, 5), run(1, 6));
}

#[test]
fn objectives_without_numbers_end_too() {
    let settings = CmaEsSettings::default();
    for bad in [f64::NAN, f64::INFINITY] {
        let result = cma_es(|_| bad, &[0.0; 3], &[1.0; 3], &[[-5.0, 5.0]; 3], &settings, &mut never).unwrap();
        assert_eq!(result.status, CmaEsStatus::FunctionTolerance);
        assert_eq!(result.value, f64::INFINITY);
    }
    // Unbounded below: the steps grow without limit.
    let result = cma_es(|x| x[0], &[0.0; 2], &[1.0; 2], &[FREE; 2], &settings, &mut never).unwrap();
    assert_eq!(result.status, CmaEsStatus::Diverged);
}

#[test]
fn the_callback_ends_it_and_errors_name_the_input() {
    let settings = CmaEsSettings::default();
    let mut third =
        |p: &Progress<'_>| if p.iteration == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let result = cma_es(rosenbrock, &[0.0; 2], &[1.0; 2], &[FREE; 2], &settings, &mut third).unwrap();
    assert_eq!((result.status, result.evaluations), (CmaEsStatus::Stopped, 18));
    let error = cma_es(rosenbrock, &[0.0; 2], &[1.0; 3], &[FREE; 2], &settings, &mut never).unwrap_err();
    assert_eq!(error.to_string(), "steps has 3 entries, expected 2");
    let error = cma_es(rosenbrock, &[0.0; 2], &[1.0, 0.0], &[FREE; 2], &settings, &mut never).unwrap_err();
    assert_eq!(error.to_string(), "setting `steps` is 0; it must be positive and finite");
}

/// The eigenvalue routine must work for covariances close to the 1e14 at which a run ends.
#[test]
fn eigenvectors_of_a_stretched_covariance_are_true() {
    let n = 12;
    let mut random = Random::new(8);
    let turn = DMatrix::from_fn(n, n, |_, _| random.normal()).qr().q();
    let values = DVector::from_fn(n, |i, _| 10_f64.powf(-12.0 * i as f64 / (n as f64 - 1.0)));
    let mut strategy = Strategy::new(&vec![0.0; n], &vec![1.0; n], 10);
    strategy.covariance = &turn * DMatrix::from_diagonal(&values) * turn.transpose();
    strategy.decompose();
    let squares = strategy.lengths.component_mul(&strategy.lengths);
    let again = &strategy.axes * DMatrix::from_diagonal(&squares) * strategy.axes.transpose();
    // Backward stable: some hundred roundings of the largest eigenvalue, 1.
    assert!((&again - &strategy.covariance).amax() < 1e-13);
    assert!((strategy.axes.tr_mul(&strategy.axes) - DMatrix::<f64>::identity(n, n)).amax() < 1e-13);
}
