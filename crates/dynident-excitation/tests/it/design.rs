//! Whole designs: feasible by independent code, equal for any number of threads, with a correct prediction of the error
//! bars.

use core::ops::ControlFlow;
use dynident_dynamics::{BaseParameterSettings, BaseParameters, BatchWorkspace, PanelLayout, Panels, regressor_panels};
use dynident_estimation::{LinearProblem, SegmentSettings, SegmentedFactor, WeightedSettings, weighted_least_squares};
use dynident_excitation::check::check_limits;
use dynident_excitation::criteria::{Criterion, DOptimal};
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::limits::{LimitSet, Limits};
use dynident_excitation::{Design, DesignSettings, DesignTask, Family, Motion, design, grid, predicted_covariance};
use dynident_model::sample::Random;
use dynident_model::{Model, load_robot};

fn ur10() -> (Model, Limits) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
    let model = load_robot(path).expect("the repository holds it").model;
    let mut limits = Limits::from_model(&model);
    for (joint, acceleration) in limits.joints.iter_mut().zip([10.0, 10.0, 10.0, 15.0, 15.0, 15.0]) {
        joint.acceleration = Some(acceleration);
    }
    (model, limits)
}

fn small() -> DesignSettings {
    DesignSettings {
        starts: Some(3),
        rounds: Some(0),
        evaluations_per_start: Some(500),
        polish_evaluations: 300,
        search_samples: Some(64),
        ..DesignSettings::default()
    }
}

fn designed(threads: usize) -> (Model, Limits, Fourier, PanelLayout, Design) {
    let (model, limits) = ur10();
    let set = LimitSet::new(&limits, &model).expect("limits fit the robot");
    let family = Fourier::new(model.dof(), 10.0, &FourierSettings::default()).expect("settings are valid");
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    let layout = PanelLayout::new(&model, base.base_columns());
    let task = DesignTask {
        family: &family,
        criteria: &[&DOptimal],
        limits: &set,
        layout: &layout,
        torque_std_nm: &vec![1.0; model.dof()],
        prior: None,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
    let result =
        pool.install(|| design(&task, &small(), |_| ControlFlow::Continue(()))).expect("a start can be evaluated");
    (model, limits, family, layout, result)
}

#[test]
fn a_design_keeps_every_limit_at_ten_kilohertz_and_does_not_depend_on_threads() {
    let (model, limits, family, _, one) = designed(1);
    let (.., two) = designed(2);
    assert_eq!(one.parameters, two.parameters);
    assert!(one.violation <= 1e-6, "violation {}", one.violation);
    let reports = check_limits(&limits, &model, family.duration_s(), 10_000.0, |times, out: &mut Motion| {
        family.motion(&one.parameters, times, out);
    })
    .expect("limits fit the robot");
    for report in reports {
        assert!(!report.violated, "{report:?}");
    }
    // Random postures of this family reach 300 to 380; an independent program reaches 439 in a second.
    let figure = -DOptimal.figure(&one.information).expect("every parameter is excited");
    assert!(figure > 435.0, "log det {figure}");
}

#[test]
fn predicted_error_bars_agree_with_simulated_ones() {
    let (model, _, family, layout, design) = designed(2);
    let dof = model.dof();
    let times = grid(10.0, 1001);
    let mut motion = Motion::default();
    family.motion(&design.parameters, &times, &mut motion);
    let mut panels = Panels::default();
    regressor_panels(&model, &mut BatchWorkspace::new(&model), &layout, &motion.view(), &mut panels);
    let columns = layout.columns().len();
    let expected: Vec<f64> = predicted_covariance(&design.information, 3)
        .std
        .into_iter()
        .map(|std| std.expect("every parameter is excited"))
        .collect();
    let mut random = Random::new(77);
    let truth: Vec<f64> = (0..columns).map(|_| random.uniform(-1.0, 1.0)).collect();
    // 200 runs: the standard deviation of a standard deviation from 200 runs is 5 %, so single parameters vary by more
    // than the 10 % tolerance of their mean square.
    let runs = 200;
    let mut squares = vec![0.0; columns];
    for _ in 0..runs {
        let mut problem = LinearProblem::new(
            (0..columns).map(|c| format!("p{c}")).collect(),
            (0..dof).map(|j| format!("j{j}")).collect(),
        );
        for joint in 0..dof {
            let seen = layout.joint_columns(joint);
            let mut panel = panels.joint(joint).to_vec();
            let (regressor, torque) = panel.split_at_mut(seen.len() * times.len());
            for (s, tau) in torque.iter_mut().enumerate() {
                let ideal: f64 = seen.iter().enumerate().map(|(k, &c)| regressor[k * times.len() + s] * truth[c]).sum();
                *tau = ideal + random.normal();
            }
            let settings = SegmentSettings { max_segments: 4, first_length_rows: 256 };
            let mut factor = SegmentedFactor::new(seen.len(), settings).expect("settings are valid");
            factor.absorb(&panel, times.len()).expect("rows are finite");
            problem.add("run", joint, seen.to_vec(), factor).expect("columns exist");
        }
        let estimate = weighted_least_squares(&problem, &WeightedSettings::default()).expect("full rank");
        for (square, (value, truth)) in squares.iter_mut().zip(estimate.values.iter().zip(&truth)) {
            *square += (value - truth).powi(2);
        }
    }
    let ratios: Vec<f64> =
        squares.iter().zip(&expected).map(|(square, std)| (square / f64::from(runs)).sqrt() / std).collect();
    let mean_square = (ratios.iter().map(|r| r * r).sum::<f64>() / columns as f64).sqrt();
    assert!((mean_square - 1.0).abs() < 0.1, "empirical over predicted {mean_square}");
    // Four standard deviations of the scatter for each of the 36.
    assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.2), "{ratios:?}");
}
