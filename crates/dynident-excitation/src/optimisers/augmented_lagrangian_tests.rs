use super::*;
use core::ops::ControlFlow;

fn at(x: &[f64]) -> AugmentedLagrangianState {
    x.to_vec().into()
}

fn never(_: &Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

struct Textbook {
    bounds: Vec<[f64; 2]>,
    equalities: usize,
    constraints: usize,
    values: fn(&[f64], &mut [f64]) -> f64,
    gradients: fn(&[f64]) -> Vec<Vec<f64>>,
    x: Vec<f64>,
}

impl ConstrainedProblem for Textbook {
    fn variables(&self) -> usize {
        self.bounds.len()
    }
    fn bounds(&self) -> Vec<[f64; 2]> {
        self.bounds.clone()
    }
    fn constraints(&self) -> usize {
        self.constraints
    }
    fn equalities(&self) -> usize {
        self.equalities
    }
    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.x = x.to_vec();
        (self.values)(x, constraints)
    }
    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        let gradients = (self.gradients)(&self.x);
        gradient.copy_from_slice(&gradients[0]);
        for (weight, row) in weights.iter().zip(&gradients[1..]) {
            gradient.iter_mut().zip(row).for_each(|(g, r)| *g += weight * r);
        }
    }
}

/// Problem 71 of Hock and Schittkowski (1981).
fn hs71() -> Textbook {
    Textbook {
        bounds: vec![[1.0, 5.0]; 4],
        equalities: 1,
        constraints: 2,
        values: |x, c| {
            c[0] = x.iter().map(|x| x * x).sum::<f64>() - 40.0;
            c[1] = 25.0 - x.iter().product::<f64>();
            x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
        },
        gradients: |x| {
            let sum = x[0] + x[1] + x[2];
            let all: f64 = x.iter().product();
            vec![
                vec![x[3] * (sum + x[0]), x[0] * x[3], x[0] * x[3] + 1.0, x[0] * sum],
                x.iter().map(|x| 2.0 * x).collect(),
                x.iter().map(|x| -all / x).collect(),
            ]
        },
        x: Vec::new(),
    }
}

#[test]
fn hock_and_schittkowski_71() {
    let settings = AugmentedLagrangianSettings::default();
    let result = augmented_lagrangian(&mut hs71(), &at(&[1.0, 5.0, 5.0, 1.0]), &settings, &mut never).unwrap();
    assert_eq!(result.status, AugmentedLagrangianStatus::Converged, "{result:?}");
    // The published solution, to its printed digits.
    assert!((result.value - 17.014_017_3).abs() < 1e-6, "{}", result.value);
    for (x, published) in result.best.iter().zip([1.0, 4.742_999_4, 3.821_150_3, 1.379_408_2]) {
        assert!((x - published).abs() < 1e-5, "{x} against {published}");
    }
    assert!(result.feasible && result.violation <= 1e-8);
    // The multipliers 0.161469 and 0.552294, as interior-point programs print them for this problem.
    assert!((result.end.multipliers[0] - 0.161_468_6).abs() < 1e-5, "{:?}", result.end.multipliers);
    assert!((result.end.multipliers[1] - 0.552_293_7).abs() < 1e-5, "{:?}", result.end.multipliers);
}

#[test]
fn hock_and_schittkowski_43() {
    // Rosen and Suzuki's problem: solution (0, 1, 2, -1), value -44, second and first constraint active.
    let mut problem = Textbook {
        bounds: vec![[f64::NEG_INFINITY, f64::INFINITY]; 4],
        equalities: 0,
        constraints: 3,
        values: |x, c| {
            let [a, b, d, e] = [x[0], x[1], x[2], x[3]];
            c[0] = a * a + b * b + d * d + e * e + a - b + d - e - 8.0;
            c[1] = a * a + 2.0 * b * b + d * d + 2.0 * e * e - a - e - 10.0;
            c[2] = 2.0 * a * a + b * b + d * d + 2.0 * a - b - e - 5.0;
            a * a + b * b + 2.0 * d * d + e * e - 5.0 * a - 5.0 * b - 21.0 * d + 7.0 * e
        },
        gradients: |x| {
            let [a, b, d, e] = [x[0], x[1], x[2], x[3]];
            vec![
                vec![2.0 * a - 5.0, 2.0 * b - 5.0, 4.0 * d - 21.0, 2.0 * e + 7.0],
                vec![2.0 * a + 1.0, 2.0 * b - 1.0, 2.0 * d + 1.0, 2.0 * e - 1.0],
                vec![2.0 * a - 1.0, 4.0 * b, 2.0 * d, 4.0 * e - 1.0],
                vec![4.0 * a + 2.0, 2.0 * b - 1.0, 2.0 * d, -1.0],
            ]
        },
        x: Vec::new(),
    };
    let settings = AugmentedLagrangianSettings::default();
    let result = augmented_lagrangian(&mut problem, &at(&[0.0; 4]), &settings, &mut never).unwrap();
    assert_eq!(result.status, AugmentedLagrangianStatus::Converged, "{result:?}");
    assert!((result.value + 44.0).abs() < 1e-6);
    for (x, exact) in result.best.iter().zip([0.0, 1.0, 2.0, -1.0]) {
        assert!((x - exact).abs() < 1e-5, "{:?}", result.best);
    }
    // Stationarity at that point gives the multipliers 1, 0, 2.
    for (multiplier, exact) in result.end.multipliers.iter().zip([1.0, 0.0, 2.0]) {
        assert!((multiplier - exact).abs() < 1e-4, "{:?}", result.end.multipliers);
    }
}

/// As many constraints as a sampled trajectory has: the nearest point of a disc of radius 1 bounded by 7000
/// half-planes.
struct ManyHalfPlanes(Vec<f64>);

impl ConstrainedProblem for ManyHalfPlanes {
    fn variables(&self) -> usize {
        50
    }
    fn bounds(&self) -> Vec<[f64; 2]> {
        vec![[-10.0, 10.0]; 50]
    }
    fn constraints(&self) -> usize {
        7000
    }
    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.0 = x.to_vec();
        for (i, c) in constraints.iter_mut().enumerate() {
            let (sin, cos) = (core::f64::consts::TAU * i as f64 / 7000.0).sin_cos();
            *c = cos * x[0] + sin * x[1] - 1.0;
        }
        (x[0] - 3.0).powi(2) + (x[1] - 4.0).powi(2) + x[2..].iter().map(|x| (x - 0.5).powi(2)).sum::<f64>()
    }
    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        gradient.iter_mut().zip(&self.0).for_each(|(g, x)| *g = 2.0 * (x - 0.5));
        gradient[0] = 2.0 * (self.0[0] - 3.0);
        gradient[1] = 2.0 * (self.0[1] - 4.0);
        for (i, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let (sin, cos) = (core::f64::consts::TAU * i as f64 / 7000.0).sin_cos();
            gradient[0] += weight * cos;
            gradient[1] += weight * sin;
        }
    }
}

#[test]
fn thousands_of_constraints() {
    let settings = AugmentedLagrangianSettings::default();
    let result = augmented_lagrangian(&mut ManyHalfPlanes(Vec::new()), &at(&[0.0; 50]), &settings, &mut never).unwrap();
    assert!(result.feasible, "{:?} {}", result.status, result.violation);
    // The polygon is between the discs of radius 1 and 1/cos(π/7000) = 1 + 1e-7: the distance from (3, 4) is 4 within
    // that, and the value 16 within 1e-6.
    assert!((result.value - 16.0).abs() < 2e-6, "{} {:?}", result.value, result.status);
    assert!((result.best[0] - 0.6).abs() < 1e-3 && (result.best[1] - 0.8).abs() < 1e-3);
}

/// x1 >= 1 and x1 <= -1: infeasible, with a minimum violation of 1.
fn contradiction() -> Textbook {
    Textbook {
        bounds: vec![[-10.0, 10.0]; 2],
        equalities: 0,
        constraints: 2,
        values: |x, c| {
            c[0] = 1.0 - x[0];
            c[1] = x[0] + 1.0;
            x[1] * x[1]
        },
        gradients: |x| vec![vec![0.0, 2.0 * x[1]], vec![-1.0, 0.0], vec![1.0, 0.0]],
        x: Vec::new(),
    }
}

#[test]
fn contradictions_are_named() {
    let settings = AugmentedLagrangianSettings::default();
    let result = augmented_lagrangian(&mut contradiction(), &at(&[5.0, 5.0]), &settings, &mut never).unwrap();
    assert_eq!(result.status, AugmentedLagrangianStatus::Infeasible, "{result:?}");
    assert!(!result.feasible);
    assert!((result.violation - 1.0).abs() < 1e-6, "{result:?}");
}

#[test]
fn limits_and_callback_end_it_with_the_best_so_far() {
    let settings = AugmentedLagrangianSettings { max_evaluations: 12, ..Default::default() };
    let result = augmented_lagrangian(&mut hs71(), &at(&[1.0, 5.0, 5.0, 1.0]), &settings, &mut never).unwrap();
    assert_eq!(result.status, AugmentedLagrangianStatus::IterationLimit);
    assert_eq!(result.evaluations, 12);
    let mut tenth =
        |p: &Progress<'_>| if p.evaluations == 10 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let settings = AugmentedLagrangianSettings::default();
    let result = augmented_lagrangian(&mut hs71(), &at(&[1.0, 5.0, 5.0, 1.0]), &settings, &mut tenth).unwrap();
    assert_eq!((result.status, result.evaluations), (AugmentedLagrangianStatus::Stopped, 10));
    let mut c = [0.0; 2];
    assert_eq!(hs71().values(&result.best, &mut c), result.value);
}

#[test]
fn bad_starts_and_settings_are_named() {
    let settings = AugmentedLagrangianSettings::default();
    let error = augmented_lagrangian(&mut hs71(), &at(&[1.0; 3]), &settings, &mut never).unwrap_err();
    assert_eq!(error.to_string(), "start has 3 entries, expected 4");
    let error = augmented_lagrangian(&mut hs71(), &at(&[1.0, f64::NAN, 1.0, 1.0]), &settings, &mut never).unwrap_err();
    assert_eq!(error, OptimiserError::Start);
    let flat = AugmentedLagrangianSettings { penalty_growth: 1.0, ..Default::default() };
    let error = augmented_lagrangian(&mut hs71(), &at(&[1.0; 4]), &flat, &mut never).unwrap_err();
    assert_eq!(error.to_string(), "setting `penalty_growth` is 1; it must be finite and above 1");
}

#[test]
fn a_search_goes_on_where_another_ended() {
    let settings = AugmentedLagrangianSettings::default();
    let whole = augmented_lagrangian(&mut hs71(), &at(&[1.0, 5.0, 5.0, 1.0]), &settings, &mut never).unwrap();
    let short = AugmentedLagrangianSettings { max_evaluations: 25, ..settings.clone() };
    let first = augmented_lagrangian(&mut hs71(), &at(&[1.0, 5.0, 5.0, 1.0]), &short, &mut never).unwrap();
    let rest = augmented_lagrangian(&mut hs71(), &first.end, &settings, &mut never).unwrap();
    assert_eq!(rest.status, AugmentedLagrangianStatus::Converged);
    assert!((rest.value - whole.value).abs() < 1e-6, "{} and {}", rest.value, whole.value);
    // At a solution the two values agree, because the remaining violations are within the tolerance.
    assert!((rest.lagrangian - rest.value).abs() < 1e-6, "{rest:?}");
    // From the solution itself few evaluations are needed.
    let again = augmented_lagrangian(&mut hs71(), &whole.end, &settings, &mut never).unwrap();
    assert!(again.evaluations < whole.evaluations / 2, "{} of {}", again.evaluations, whole.evaluations);
    let other = AugmentedLagrangianState { multipliers: vec![0.0; 5], ..whole.end };
    let error = augmented_lagrangian(&mut hs71(), &other, &settings, &mut never).unwrap_err();
    assert_eq!(error.to_string(), "multipliers has 5 entries, expected 2");
}

#[test]
fn many_starts_give_the_same_on_any_number_of_threads() {
    let starts: Vec<AugmentedLagrangianState> = (0..6).map(|k| vec![1.0 + 0.7 * f64::from(k); 4].into()).collect();
    let settings = AugmentedLagrangianSettings::default();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let go = || super::super::multi_start(hs71, &starts, &settings, |_| ControlFlow::Continue(())).unwrap();
        pool.install(go)
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one, three);
    let best = one.best().unwrap();
    assert!((best.value - 17.014_017_3).abs() < 1e-6, "{}", best.value);
    assert!(one.runs.iter().flatten().filter(|run| run.feasible).all(|run| run.value >= best.value));
}
