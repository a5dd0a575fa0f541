//! Robots with parallel or perpendicular axes and origins on axes, for which the recursions skip zeros. The oracle
//! skips nothing: the same mechanics in the bodies' own frames, with plain numbers and dual numbers.

use dynident_dynamics::{
    BatchWorkspace, JointMatrices, PanelLayout, Panels, Workspace, all_columns, forward_dynamics, inverse_dynamics,
    inverse_dynamics_batch, inverse_dynamics_derivative_matrices, inverse_dynamics_derivatives, inverse_dynamics_over,
    mass_matrices, mass_matrix, mass_matrix_and_bias, mass_matrix_over, regressor_panels, torque_regressor,
};
use dynident_lanes::{Dual, Level};
use dynident_model::sample::{Random, random_tree};
use dynident_model::terms::JointMotion;
use dynident_model::{JointKind, Mat3, Mimic, MimicSource, Model, Vec3};
use dynident_testing::count;

/// Two orders of summation over about ten bodies, in double precision, relative to the largest entry.
const ROUNDING: f64 = 1e-12;

/// Not a multiple of any number of lanes, fewer than any, and whole groups.
const SAMPLES: [usize; 3] = [13, 3, 16];

/// A tree whose rotations, axes and origins are randomly special (as on most robots) or general.
fn robot(seed: u64) -> Model {
    let mut random = Random::new(seed ^ 0x51ab);
    let plain = random_tree(seed, 1 + seed as usize % 9);
    // From all right angles to all general.
    let general = [0.0, 0.0, 0.2, 1.0][seed as usize % 4];
    let mut joints = plain.tree_joints().to_vec();
    for (index, joint) in joints.iter_mut().enumerate() {
        if !seed.is_multiple_of(3) {
            joint.parent = index.checked_sub(1);
        }
        if random.uniform(0.0, 1.0) < 0.5 {
            joint.kind = JointKind::Continuous;
        }
        for entry in 0..3 {
            if random.uniform(0.0, 1.0) < 0.6 {
                joint.placement.translation[entry] = 0.0;
            }
        }
        if random.uniform(0.0, 1.0) >= general {
            let mut unit = || {
                let at = random.bits() as usize % 3;
                Vec3(core::array::from_fn(|k| f64::from(u8::from(k == at))))
            };
            let is_rotary = [unit(), unit(), unit()];
            joint.axis = is_rotary[0].scale(if random.bits().is_multiple_of(2) { 1.0 } else { -1.0 });
            // As in a URDF: roll, pitch and yaw by multiples of 90°, rounded.
            let mut quarter = |axis| {
                let quarters = f64::from(random.bits() as u8 % 4);
                Mat3::from_axis_angle(axis, core::f64::consts::FRAC_PI_2 * quarters)
            };
            joint.placement.rotation = quarter(is_rotary[1]).mul_mat(&quarter(is_rotary[2]));
        }
        if random.uniform(0.0, 1.0) < 0.2 {
            // A rotation about the joint's own axis changes none of the joint's zeros.
            let turn = Mat3::from_axis_angle(joint.axis, random.uniform(-3.0, 3.0));
            joint.placement.rotation = joint.placement.rotation.mul_mat(&turn);
        }
    }
    let gravity = if seed.is_multiple_of(2) { Vec3([0.0, 0.0, -9.81]) } else { plain.gravity() };
    let model = Model::new("right angles", plain.base().clone(), joints, plain.bodies().to_vec()).unwrap();
    let model = model.with_gravity(gravity).unwrap();
    if seed % 5 == 4 && model.dof() > 2 {
        let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let source = MimicSource { joint: names[0].clone(), multiplier: -0.7 };
        let mimic = Mimic { sources: vec![source], offset: 0.3 };
        return model.with_followers(&[(names[2].clone(), mimic)]).unwrap();
    }
    model
}

/// Results of the recursions in the bodies' own frames for one sample.
struct Expected {
    tau: Vec<f64>,
    mass: Vec<f64>,
    /// By position, velocity and acceleration, row-major.
    derivatives: [Vec<f64>; 3],
}

fn expected(model: &Model, state: [&[f64]; 3]) -> Expected {
    let dof = model.dof();
    let mut derivatives = [(); 3].map(|()| vec![0.0; dof * dof]);
    for (which, matrix) in derivatives.iter_mut().enumerate() {
        for joint in 0..dof {
            let duals = |k: usize| -> Vec<Dual> {
                let varied = |(i, &x): (usize, &f64)| {
                    if k == which && i == joint { Dual::variable(x) } else { Dual::constant(x) }
                };
                state[k].iter().enumerate().map(varied).collect()
            };
            for (row, tau) in inverse_dynamics_over(model, &duals(0), &duals(1), &duals(2)).iter().enumerate() {
                matrix[row * dof + joint] = tau.derivative;
            }
        }
    }
    Expected {
        tau: inverse_dynamics_over(model, state[0], state[1], state[2]),
        mass: mass_matrix_over(model, state[0]),
        derivatives,
    }
}

fn assert_near(what: &str, found: impl IntoIterator<Item = f64>, expected: &[f64]) {
    let scale = expected.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    let mut entries = 0;
    for (entry, (found, expected)) in found.into_iter().zip(expected).enumerate() {
        assert!((found - expected).abs() <= ROUNDING * scale, "{what}, entry {entry}: {found} against {expected}");
        entries += 1;
    }
    assert_eq!(entries, expected.len(), "{what}");
}

/// `Y π` of rows with ten columns per body, including followers.
fn times_parameters(model: &Model, row: impl Iterator<Item = f64>) -> f64 {
    let parameters = model.inertials().iter().flat_map(|body| body.0);
    row.zip(parameters).map(|(entry, parameter)| entry * parameter).sum()
}

#[test]
fn one_sample_equals_the_general_method() {
    for seed in 0..count(160, 3000) as u64 {
        let model = robot(seed);
        let dof = model.dof();
        let mut random = Random::new(seed);
        let mut vector = |range: f64| (0..dof).map(|_| random.uniform(-range, range)).collect::<Vec<f64>>();
        let (q, dq, ddq) = (vector(3.0), vector(2.0), vector(3.0));
        let Expected { tau, mass, derivatives } = expected(&model, [&q, &dq, &ddq]);
        let bias = inverse_dynamics_over(&model, &q, &dq, &vec![0.0; dof]);
        for level in Level::available() {
            let mut workspace = Workspace::with_level(&model, level);
            let of = |what: &str| format!("seed {seed}, {}, {what}", level.name());
            // Twice in alternation: no call may affect the next one.
            for _ in 0..2 {
                let found = inverse_dynamics_derivatives(&model, &mut workspace, &q, &dq, &ddq);
                assert_near(&of("by position"), found.by_position.iter().copied(), &derivatives[0]);
                assert_near(&of("by velocity"), found.by_velocity.iter().copied(), &derivatives[1]);
                assert_near(&of("by acceleration"), found.by_acceleration.iter().copied(), &derivatives[2]);
                let found = inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq);
                assert_near(&of("torque"), found.iter().copied(), &tau);
                let found = mass_matrix(&model, &mut workspace, &q);
                assert_near(&of("mass matrix"), found.iter().copied(), &mass);
                let found = mass_matrix_and_bias(&model, &mut workspace, &q, &dq);
                assert_near(&of("mass matrix with the bias"), found.0.iter().copied(), &mass);
                assert_near(&of("bias"), found.1.iter().copied(), &bias);
                let rows = torque_regressor(&model, &mut workspace, &q, &dq, &ddq);
                let found = rows.chunks_exact(10 * model.body_count());
                let found = found.map(|row| times_parameters(&model, row.iter().copied()));
                assert_near(&of("regressor"), found, &tau);
                let back = forward_dynamics(&model, &mut workspace, &q, &dq, &tau).to_vec();
                let again = inverse_dynamics_over(&model, &q, &dq, &back);
                // Compared by torque, because accelerations of a body with almost no inertia are inaccurate.
                assert_near(&of("torque of the forward dynamics"), again, &tau);
            }
        }
    }
}

#[test]
fn many_samples_equal_the_general_method() {
    for seed in 0..count(60, 1000) as u64 {
        let model = robot(seed);
        let dof = model.dof();
        let layout = PanelLayout::new(&model, all_columns(&model, &[]));
        let mut kept = [(); 4].map(|()| JointMatrices::new(&model));
        for samples in SAMPLES {
            let mut random = Random::new(seed);
            let mut array =
                |range: f64| (0..dof * samples).map(|_| random.uniform(-range, range)).collect::<Vec<f64>>();
            let (q, dq, ddq) = (array(3.0), array(2.0), array(3.0));
            let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
            let at = |array: &[f64], s: usize| (0..dof).map(|j| array[j * samples + s]).collect::<Vec<f64>>();
            let states = (0..samples).map(|s| expected(&model, [&at(&q, s), &at(&dq, s), &at(&ddq, s)]));
            let states: Vec<Expected> = states.collect();
            for level in Level::available() {
                let mut workspace = BatchWorkspace::with_level(&model, level);
                let mut tau = vec![f64::NAN; dof * samples];
                inverse_dynamics_batch(&model, &mut workspace, &motion, &mut tau);
                let [mass, derivatives @ ..] = &mut kept;
                mass_matrices(&model, &mut workspace, &q, samples, mass);
                inverse_dynamics_derivative_matrices(&model, &mut workspace, &motion, derivatives);
                let mut panels = Panels::default();
                regressor_panels(&model, &mut workspace, &layout, &motion, &mut panels);
                for (s, state) in states.iter().enumerate() {
                    let of = |what: &str| format!("seed {seed}, {}, {samples} samples, {s}: {what}", level.name());
                    assert_near(&of("torque"), at(&tau, s), &state.tau);
                    let matrices = [&state.mass, &state.derivatives[0], &state.derivatives[1], &state.derivatives[2]];
                    for (k, expected) in matrices.into_iter().enumerate() {
                        let entries = (0..dof * dof).map(|entry| (entry / dof, entry % dof));
                        let found = entries.map(|(row, column)| kept[k].entry(row, column)[s]);
                        assert_near(&of(&format!("matrix {k}")), found, expected);
                    }
                    let torques = (0..dof).map(|joint| {
                        let columns = layout.joint_columns(joint).iter().enumerate();
                        let parameters: Vec<f64> = model.inertials().iter().flat_map(|body| body.0).collect();
                        columns.map(|(k, &c)| panels.joint(joint)[k * samples + s] * parameters[c]).sum::<f64>()
                    });
                    assert_near(&of("regressor"), torques, &state.tau);
                }
            }
            assert!(kept.iter().all(|matrices| (matrices.dof(), matrices.samples()) == (dof, samples)));
        }
    }
}
