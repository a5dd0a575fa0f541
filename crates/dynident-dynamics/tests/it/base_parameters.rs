//! Base parameters compared with the paper, numerical ranks, and full-parameter torques.

use dynident_dynamics::{
    BaseParameterSettings, BaseParameters, Workspace, inverse_dynamics, numerical_rank, numerical_rank_by_body,
    torque_regressor,
};
use dynident_model::sample::{Random, planar_2r, random_tree};
use dynident_model::terms::{CoulombShape, Coupling, CouplingEffect, DriveChoice, TorqueTerm, terms_per_joint};
use dynident_model::{Model, read_urdf};

fn all_terms(model: &Model) -> Vec<TorqueTerm> {
    terms_per_joint(model, |_| DriveChoice {
        drive_inertia: true,
        viscous: true,
        coulomb: Some(CoulombShape::Sign { dead_band: 0.0 }),
        offset: true,
    })
}

#[test]
fn planar_arm_has_the_base_parameters_of_table_2() {
    let mut random = Random::new(1);
    // a1 = 0.7, so that a1 and a1² differ from 1: θ1 = Izz1 + a1² m2, θ2 = m1 r1x + a1 m2, θ3 = m1 r1y, θ4..6 = Izz2,
    // m2 r2x, m2 r2y.
    let model = planar_2r(0.7, random.body(), random.body());
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    let mut expressions = base.expressions();
    expressions.sort();
    let mut expected = ["Izz1 + 0.49 m2", "mx1 + 0.7 m2", "my1", "Izz2", "mx2", "my2"].map(str::to_owned);
    expected.sort();
    assert_eq!(expressions, expected);
}

#[allow(clippy::approx_constant, clippy::format_push_string, reason = "rounded angles as people write them")]
#[test]
fn rounded_angles_change_numbers_but_not_names() {
    // An arm with shoulder and elbow offsets; every right angle is written with `digits`.
    let arm = |right: f64, half: f64, size: f64| {
        let mut text = r#"<robot name="r"><link name="l0"/>"#.to_owned();
        let joints = [
            ([0.0, 0.0, 0.3], [0.0, 0.0, 0.0]),
            ([0.05, 0.0, 0.2], [right, 0.0, 0.0]),
            ([0.4, 0.0, 0.03], [0.0, 0.0, right]),
            ([0.02, 0.35, 0.0], [-right, half, 0.0]),
            ([0.0, 0.04, 0.1], [right, 0.0, half]),
            ([0.0, 0.08, 0.0], [-right, 0.0, 0.0]),
        ];
        for (k, (xyz, rpy)) in joints.iter().enumerate() {
            let [x, y, z] = xyz.map(|length| length * size);
            let [roll, pitch, yaw] = rpy;
            text += &format!(
                r#"<link name="l{child}"/><joint name="j{child}" type="continuous"><parent link="l{k}"/><child link="l{child}"/>
                <origin xyz="{x} {y} {z}" rpy="{roll} {pitch} {yaw}"/><axis xyz="0 0 1"/></joint>"#,
                child = k + 1
            );
        }
        BaseParameters::new(&read_urdf(&(text + "</robot>")).unwrap().model, &[], &BaseParameterSettings::default())
    };
    let (right, half) = (core::f64::consts::FRAC_PI_2, core::f64::consts::PI);
    for size in [0.2, 1.0, 5.0] {
        let exact = arm(right, half, size);
        let rounded = arm(1.5708, 3.1416, size);
        let symbols = |base: &BaseParameters| -> Vec<String> {
            let words = |sum: String| -> Vec<String> {
                sum.split(' ').filter(|word| word.parse::<f64>().is_err()).map(str::to_owned).collect()
            };
            base.expressions().into_iter().map(|sum| words(sum).join(" ")).collect()
        };
        assert_eq!(symbols(&rounded), symbols(&exact), "size {size}");
        // The numbers keep the effect of the angles, and complete names show it.
        let difference = (rounded.regrouping() - exact.regrouping()).amax();
        assert!((1e-8..1e-3).contains(&difference), "{difference:e}");
        let long = |base: &BaseParameters| base.complete_expressions().concat().len();
        assert!(long(&rounded) > long(&exact) + 100, "size {size}");
        assert_eq!(exact.complete_expressions(), exact.expressions(), "size {size}");
    }
}

#[test]
fn structure_and_random_states_choose_the_same_columns() {
    for seed in 0..40 {
        let model = random_tree(seed, 1 + seed as usize % 7);
        for terms in [Vec::new(), all_terms(&model)] {
            let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
            // With random geometry dependent columns are at rounding (about 1e-13) and the others above 1e-6.
            let numerical = numerical_rank(&model, &terms, 77, 1e-8);
            assert_eq!(base.independent(), numerical.independent, "seed {seed}, {} laws", terms.len());
        }
    }
}

/// A serial arm of the joints and bodies of a random tree.
fn random_chain(seed: u64, dof: usize) -> Model {
    let tree = random_tree(seed, dof);
    let mut joints = tree.joints().to_vec();
    for (index, joint) in joints.iter_mut().enumerate() {
        joint.parent = index.checked_sub(1);
    }
    Model::new("chain", tree.base().clone(), joints, tree.bodies().to_vec()).unwrap()
}

#[test]
fn motions_of_one_joint_choose_the_same_columns() {
    for seed in 0..40 {
        let model = random_tree(seed, 1 + seed as usize % 7);
        let weightless = model.clone().with_gravity(dynident_model::Vec3([0.0; 3])).unwrap();
        for model in [model, weightless] {
            let by_body = numerical_rank_by_body(&model, 5, 1e-8);
            assert_eq!(by_body.independent, numerical_rank(&model, &[], 77, 1e-8).independent, "seed {seed}");
        }
    }
}

#[test]
fn long_chains_keep_their_base_parameters() {
    // Short enough for regressors of all joints at once.
    let model = random_chain(3, 40);
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    assert_eq!(base.independent(), numerical_rank(&model, &[], 77, 1e-8).independent);
    // Too long for that: body by body.
    let model = random_chain(4, 250);
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    assert_eq!(base.independent(), numerical_rank_by_body(&model, 5, 1e-8).independent);
    assert_full_torques(&model, 4);
}

#[test]
fn base_parameters_give_the_full_torques() {
    for seed in 0..30 {
        assert_full_torques(&random_tree(seed, 1 + seed as usize % 8), seed);
    }
}

fn assert_full_torques(model: &Model, seed: u64) {
    let (mut random, dof) = (Random::new(seed), model.dof());
    let base = BaseParameters::new(model, &[], &BaseParameterSettings::default());
    let theta = base.values(&model.parameter_vector());
    let mut ws = Workspace::new(model);
    let mut vector = || (0..dof).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
    let (q, dq, ddq) = (vector(), vector(), vector());
    let tau = inverse_dynamics(model, &mut ws, &q, &dq, &ddq).to_vec();
    let regressor = torque_regressor(model, &mut ws, &q, &dq, &ddq);
    for (joint, row) in regressor.chunks_exact(10 * dof).enumerate() {
        let by_base: f64 = base.independent().iter().zip(&theta).map(|(&c, t)| row[c] * t).sum();
        // The regrouping solves triangles with condition numbers up to several thousand.
        let scale = tau.iter().fold(1.0_f64, |m, t| m.max(t.abs()));
        assert!((by_base - tau[joint]).abs() <= 1e-9 * scale, "seed {seed}: {by_base} against {}", tau[joint]);
    }
}

#[test]
fn drives_regroup_according_to_structure() {
    let mut random = Random::new(9);
    let model = planar_2r(1.0, random.body(), random.body());
    let terms = all_terms(&model);
    let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
    // Joint 1's drive combines with link 1: one more parameter for joint 2's drive only, and three of friction and
    // offset per joint.
    assert_eq!(base.count(), 6 + 1 + 6);
    assert!(base.expressions().iter().any(|e| e == "Izz1 + m2 + Ia1"), "{:?}", base.expressions());
    assert_eq!(base.independent(), numerical_rank(&model, &terms, 5, 1e-8).independent);
}

#[test]
fn couplings_and_terms_given_twice_are_found() {
    let model = random_tree(4, 4);
    let coupling =
        |effect| TorqueTerm::Coupling(Coupling { name: "m".into(), first: 2, second: 3, ratios: [1.0, -0.5], effect });
    let mut terms = all_terms(&model);
    terms.extend([
        coupling(CouplingEffect::Inertia),
        coupling(CouplingEffect::Viscous),
        coupling(CouplingEffect::Coulomb(CoulombShape::Sign { dead_band: 0.0 })),
    ]);
    let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
    assert_eq!(base.independent(), numerical_rank(&model, &terms, 5, 1e-8).independent);
    let once = base.count();
    terms.push(coupling(CouplingEffect::Viscous));
    let twice = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
    assert_eq!(twice.count(), once);
    assert!(twice.expressions().iter().any(|e| e == "fv_m + fv_m"));
}

#[test]
fn without_gravity_fewer_parameters_are_identifiable() {
    let mut random = Random::new(2);
    let model = planar_2r(1.0, random.body(), random.body());
    let weightless = model.clone().with_gravity(dynident_model::Vec3([0.0; 3])).unwrap();
    let base = BaseParameters::new(&weightless, &[], &BaseParameterSettings::default());
    assert_eq!(base.independent(), numerical_rank(&weightless, &[], 5, 1e-8).independent);
    assert_eq!(base.count(), 4);
}
