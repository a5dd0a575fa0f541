use super::singular_values::Singular3;
use super::*;
use crate::optimisers::{AugmentedLagrangianStatus, ConstrainedProblem};
use core::f64::consts::PI;
use dynident_dynamics::{BaseParameterSettings, BaseParameters, torque_regressor};
use dynident_model::sample::planar_2r;
use nalgebra::DMatrix;

fn never(_: &Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A joint with horizontal axis and the limits of the paper's equation 18.
fn level() -> StrokeConstants {
    StrokeConstants {
        gravity: 9.8,
        rate_hz: 100.0,
        period_times_steepness: 40.0,
        position_limit_rad: PI,
        speed_limit: PI / 6.0,
        acceleration_limit: PI / 15.0,
        rest_limit: 1e-4,
        penalty: 1000.0,
        amplitude_range: [0.1, PI],
        steepness_range: [0.1, 3.0],
        window_range: [0.1, 10.0],
    }
}

fn planar() -> StepWiseProblem {
    StepWiseProblem { joints: [1, 0].map(|joint| StepWiseJoint { joint, constants: level() }).to_vec() }
}

/// The best stroke inside the limits, computed by an independent program.
const KNOWN: Stroke = Stroke { amplitude_rad: 1.991, steepness_per_s: 1.046, window_s: 5.74 };

#[test]
fn the_known_optimum_is_inside_the_limits_with_the_known_condition_number() {
    let problem = planar();
    let condition = level().condition_number(&KNOWN);
    // 80.6 is rounded to 0.05, A and ω to 5e-4.
    assert!((condition - 80.6).abs() < 0.15, "{condition}");
    let inside = Stroke { amplitude_rad: 1.989, ..KNOWN };
    for limit in problem.limits(0, &inside) {
        assert!(limit.kept() && limit.excess() < 0.0, "{limit:?}");
    }
    let x = [1.989, 1.046, 5.74, 1.989, 1.046, 5.74];
    assert!((problem.fitness(&x) - 2.0 * level().condition_number(&inside)).abs() < 1e-9);
    // A violated limit adds the penalty once.
    let broken = [1.989, 1.2, 5.74, 1.989, 1.2, 5.74];
    let sum: f64 = problem.condition_numbers(&problem.strokes(&broken)).iter().sum();
    assert!((problem.fitness(&broken) - sum - 1000.0).abs() < 1e-9);
}

/// Condition number from the library's regressor of the planar arm, its base columns and nalgebra's singular values.
fn condition_by_the_regressor(constants: &StrokeConstants, stroke: &Stroke, joint: usize) -> f64 {
    let mut random = Random::new(1);
    let model = planar_2r(1.0, random.body(), random.body());
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    let columns: Vec<usize> = base.independent().iter().copied().filter(|column| column / 10 == joint).collect();
    assert_eq!(columns.len(), 3);
    let mut workspace = Workspace::new(&model);
    let last = (stroke.window_s * constants.rate_hz).round() as i64;
    let mut rows = Vec::new();
    for k in -last..=last {
        let (position, acceleration) = stroke.position_and_acceleration(k as f64 / constants.rate_hz);
        let f = position / stroke.amplitude_rad;
        let (mut q, mut dq, mut ddq) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        (q[joint], ddq[joint]) = (position, acceleration);
        dq[joint] = stroke.amplitude_rad * stroke.steepness_per_s * f * (1.0 - f);
        let regressor = torque_regressor(&model, &mut workspace, &q, &dq, &ddq);
        rows.extend(columns.iter().map(|column| regressor[20 * joint + column]));
    }
    let singular = DMatrix::from_row_slice(rows.len() / 3, 3, &rows).singular_values();
    singular.max() / singular.min()
}

#[test]
fn closed_form_rows_are_those_of_the_arms_regressor() {
    let constants = level();
    for stroke in [KNOWN, Stroke { amplitude_rad: 2.7, steepness_per_s: 0.4, window_s: 2.5 }] {
        for joint in 0..2 {
            let (here, there) =
                (constants.condition_number(&stroke), condition_by_the_regressor(&constants, &stroke, joint));
            // Two backward stable algorithms: condition number times some roundings.
            assert!((here / there - 1.0).abs() < 1e-10, "joint {joint}: {here} against {there}");
        }
    }
}

#[test]
fn three_columns_have_true_singular_values_up_to_huge_condition_numbers() {
    // W = U diag V with known singular values: three orthonormal columns, scaled and rotated.
    let (sin, cos) = 0.7_f64.sin_cos();
    for ratio in [1.0, 1e3, 1e8, 1e12] {
        let values = [5.0, 2.0, 5.0 / ratio];
        let columns = [[0.5, 0.5, 0.5, 0.5], [0.5, -0.5, 0.5, -0.5], [0.5, 0.5, -0.5, -0.5]];
        let turn = [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]];
        let rows = (0..4)
            .map(|s| core::array::from_fn(|column| (0..3).map(|k| columns[k][s] * values[k] * turn[k][column]).sum()));
        let condition = Singular3::of_rows(rows).condition_number();
        let exact = 5.0 / values[2].min(2.0);
        // Forming the rows loses some roundings of the largest value.
        assert!((condition / exact - 1.0).abs() < 1e-14 * ratio.max(10.0), "{condition} against {exact}");
    }
    assert_eq!(Singular3::of_rows([[1.0, 0.0, 0.0]; 4]).condition_number(), f64::INFINITY);
}

#[test]
fn smooth_and_sampled_agree() {
    for x in [[1.989, 1.046, 5.74], [2.5, 0.4, 3.0], [0.5, 1.5, 1.2]] {
        let smooth = SmoothStroke::new(&level()).start(&x)[3].exp();
        let sampled = level().condition_number(&Stroke::of(&x));
        // A window differs by one of at least 241 samples: 1/241 in length, at most to the fourth power in the smallest
        // singular value.
        assert!((smooth / sampled - 1.0).abs() < 4.0 / 241.0, "{smooth} against {sampled}");
    }
}

#[test]
fn gradients_are_those_of_the_values() {
    let mut random = Random::new(11);
    let mut smooth = SmoothStroke::new(&level());
    let bounds = smooth.bounds();
    let (count, mut c) = (smooth.constraints(), vec![0.0; smooth.constraints()]);
    for _ in 0..20 {
        // Away from the corner where the matrix loses its rank and differences are inaccurate.
        let x: Vec<f64> = bounds.iter().map(|[low, high]| random.uniform(low.max(0.5), high.min(4.0))).collect();
        let weights: Vec<f64> = (0..count).map(|_| random.uniform(0.0, 2.0)).collect();
        let mut gradient = vec![0.0; x.len()];
        smooth.values(&x, &mut c);
        smooth.gradient(&weights, &mut gradient);
        let mut lagrangian = |x: &[f64]| {
            let value = smooth.values(x, &mut c);
            value + c.iter().zip(&weights).map(|(c, w)| c * w).sum::<f64>()
        };
        for i in 0..x.len() {
            // Five-point difference: truncation h⁴ and rounding cond·1e-16/h are both below 1e-7 of the largest slopes
            // here.
            let h = 1e-3 * x[i];
            let mut at = |steps: f64| {
                let mut moved = x.clone();
                moved[i] += steps * h;
                lagrangian(&moved)
            };
            let difference = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
            assert!((difference - gradient[i]).abs() < 1e-7 * gradient[i].abs().max(1.0), "{x:?} {i}: {difference}");
        }
    }
}

#[test]
fn gradients_reach_the_known_optimum_from_every_seed() {
    let problem = planar();
    for seed in 0..10 {
        let (x, _) = problem.gradient_solution(seed, 3, never).unwrap();
        let fitness = problem.fitness(&x);
        // 161.3 is rounded to 0.05; the project requires 0.1 %.
        assert!((161.15..161.3 * 1.001).contains(&fitness), "seed {seed}: {fitness}");
    }
}

#[test]
fn the_optimum_lies_on_the_kink_of_the_condition_number() {
    let mut smooth = SmoothStroke::new(&level());
    let start: AugmentedLagrangianState = smooth.start(&[1.0, 0.8, 4.0]).into();
    let settings = AugmentedLagrangianSettings::default();
    let result = multi_start(|| smooth.clone(), &[start], &settings, never).unwrap();
    let best = result.best().unwrap();
    assert_eq!(best.status, AugmentedLagrangianStatus::Converged);
    let mut c = vec![0.0; smooth.constraints()];
    smooth.values(&best.best, &mut c);
    // Both pairs of singular values and the acceleration limit are active, the velocity limit is not. Tolerance of a
    // converged solution; the gap of the velocity is 0.6 %.
    assert!(c[0].abs() < 1e-6 && c[1].abs() < 1e-6 && c[4].abs() < 1e-6, "{c:?}");
    assert!(c[3] < -0.003, "{c:?}");
}

#[test]
fn unusable_constants_are_named() {
    let with = |constants| StepWiseProblem { joints: vec![StepWiseJoint { joint: 0, constants }] };
    let problem = with(StrokeConstants { gravity: 0.0, ..level() });
    assert_eq!(problem.validate().unwrap_err().to_string(), "setting `gravity` is 0; it must be positive and finite");
    let problem = with(StrokeConstants { window_range: [3.0, 2.0], ..level() });
    assert!(problem.validate().unwrap_err().to_string().starts_with("variable 2: cannot search the range 3 to 2"));
    let problem = with(StrokeConstants { rate_hz: 1e9, ..level() });
    assert!(problem.gradient_solution(0, 1, never).unwrap_err().to_string().contains("`rate_hz`"));
    assert!(planar().gradient_solution(0, 0, never).is_err());
}

#[test]
fn gravity_across_an_axis() {
    let mut random = Random::new(1);
    let arm = planar_2r(1.0, random.body(), random.body());
    // Both axes are horizontal: all of 9.8 m/s², up to rounding.
    for joint in 0..2 {
        assert!((gravity_across(&arm, joint, &[0.3, -0.2]).unwrap() - 9.8).abs() < 1e-14);
    }
    let standing = arm.with_gravity(dynident_model::Vec3([0.0, 0.0, -9.8])).unwrap();
    let error = gravity_across(&standing, 0, &[0.0; 2]).unwrap_err();
    assert_eq!(error, StepWiseError::NoGravity { joint: "joint1".to_owned() });
}
