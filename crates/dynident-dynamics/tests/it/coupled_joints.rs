//! Robots with coupled joints compared with Pinocchio (`golden/coupled_joints.py`): mimic joints, and a palletising
//! arm with closed chains that constraints close in Pinocchio's tree.

use crate::golden::{close, numbers, text};
use dynident_dynamics::{
    BaseParameterSettings, BaseParameters, BatchWorkspace, Column, MotionGradient, PanelLayout, Panels, Workspace,
    body_placements, forward_dynamics, inverse_dynamics, inverse_dynamics_batch, inverse_dynamics_derivatives,
    mass_matrix, numerical_rank, point_jacobian, regressor_panels, regressor_panels_adjoint,
};
use dynident_model::sample::Random;
use dynident_model::terms::{DriveChoice, JointMotion, terms_per_joint};
use dynident_model::{
    Body, InertialParameters, Joint, LoopClosure, LoopError, Model, Transform, Vec3, load_robot, loops,
};
use dynident_testing::repository;
use serde_json::Value;

/// The same sums in double precision, over ten bodies.
const ROUNDING: f64 = 1e-12;

fn golden() -> Value {
    serde_json::from_str(&std::fs::read_to_string(repository("golden/coupled_joints.json")).unwrap()).unwrap()
}

fn cuts() -> Vec<LoopClosure> {
    let cut = |first: &str, second: &str, passive: [&str; 2]| LoopClosure {
        links: [first.to_owned(), second.to_owned()],
        points_m: [[0.0; 3]; 2],
        passive: passive.map(str::to_owned).to_vec(),
    };
    vec![
        cut("rod_end", "forearm_back", ["elbow_joint", "rod_joint"]),
        cut("strut_end", "plate_back", ["strut_joint", "plate_joint"]),
    ]
}

fn palletizer() -> Model {
    let tree = load_robot(repository("examples/robots/palletizer.urdf")).unwrap().model;
    let followers = loops::followers(&tree, &cuts()).unwrap();
    tree.with_followers(&followers).unwrap()
}

/// Converts joint vectors of the file to the order of the model.
fn order(model: &Model, file: &Value) -> Vec<usize> {
    let names: Vec<&str> = file["joints"].as_array().unwrap().iter().map(text).collect();
    assert_eq!(names.len(), model.dof());
    let place = |name: &str| names.iter().position(|own| *own == name).unwrap();
    model.joints().iter().map(|joint| place(&joint.name)).collect()
}

fn ordered(order: &[usize], value: &Value) -> Vec<f64> {
    let theirs = numbers(value);
    order.iter().map(|&k| theirs[k]).collect()
}

#[test]
fn mimic_joints_agree_with_pinocchio() {
    let golden = golden();
    for (name, path) in [("followers", "golden/coupled/followers.urdf"), ("panda", "robots/panda.urdf")] {
        let (model, file) = (load_robot(repository(path)).unwrap().model, &golden["mimic"][name]);
        let order = order(&model, file);
        assert_eq!(model.body_count() as u64, file["bodies"].as_u64().unwrap());
        let mut workspace = Workspace::new(&model);
        for state in file["states"].as_array().unwrap() {
            let [q, dq, ddq, tau] = ["q", "dq", "ddq", "tau"].map(|key| ordered(&order, &state[key]));
            close(ROUNDING, inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq), &tau, name);
            let rows: Vec<Vec<f64>> = state["mass_matrix"].as_array().unwrap().iter().map(numbers).collect();
            let theirs: Vec<f64> =
                order.iter().flat_map(|&i| order.iter().map(|&j| rows[i][j]).collect::<Vec<_>>()).collect();
            close(ROUNDING, mass_matrix(&model, &mut workspace, &q), &theirs, name);
            // For a finger of 15 g on an arm, one or two more digits are lost from 50 Nm.
            close(1e-9, forward_dynamics(&model, &mut workspace, &q, &dq, &tau), &ddq, name);
            let placements = body_placements(&model, &mut workspace, &q).to_vec();
            for (joint, placement) in model.tree_joints().iter().zip(placements) {
                close(ROUNDING, &placement.translation.0, &numbers(&state["placements_m"][&joint.name]), &joint.name);
            }
        }
    }
}

#[test]
fn connected_mjcf_chains_agree_with_mujoco() {
    let path = repository("golden/closed_chains.json");
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let robot = load_robot(repository("golden/coupled/palletizer.xml")).unwrap();
    assert!(robot.notices.is_empty(), "{:?}", robot.notices);
    let model = robot.model;
    let order = order(&model, &file);
    let passive: Vec<&str> = file["passive"].as_array().unwrap().iter().map(text).collect();
    assert_eq!(model.followers().count(), passive.len());
    let mut workspace = Workspace::new(&model);
    for state in file["states"].as_array().unwrap() {
        let [q, dq, ddq, tau] = ["q", "dq", "ddq", "tau"].map(|key| ordered(&order, &state[key]));
        let mut stand = vec![0.0; model.body_count()];
        model.coupling().unwrap().positions(&q, 1, &mut stand);
        for (name, theirs) in passive.iter().zip(numbers(&state["passive"])) {
            let own = model.tree_joints().iter().position(|joint| joint.name == *name).unwrap();
            close(1e-9, &[stand[own]], &[theirs], name);
        }
        close(1e-9, inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq), &tau, "tau");
    }
    // The same robot as the URDF with [[robot.loop]], whose elbow is at zero in the drawing.
    for (_, theirs) in palletizer().followers() {
        let own = model.tree_joints().iter().find(|joint| joint.name == theirs.name).unwrap();
        let (own, theirs) = (own.mimic.as_ref().unwrap(), theirs.mimic.as_ref().unwrap());
        let row = |mimic: &dynident_model::Mimic| {
            let mut row: Vec<_> = mimic.sources.iter().map(|one| (one.joint.clone(), one.multiplier)).collect();
            row.sort_by(|a, b| a.0.cmp(&b.0));
            row
        };
        assert_eq!(row(own), row(theirs));
    }
}

#[test]
fn palletising_arm_equals_its_constrained_tree() {
    let (model, golden) = (palletizer(), golden());
    let file = &golden["loops"];
    let order = order(&model, file);
    let passive: Vec<&str> = file["passive"].as_array().unwrap().iter().map(text).collect();
    let coupling = model.coupling().unwrap();
    let mut workspace = Workspace::new(&model);
    for state in file["states"].as_array().unwrap() {
        let [q, dq, ddq, tau, applied] =
            ["q", "dq", "ddq", "tau", "applied_tau"].map(|key| ordered(&order, &state[key]));
        // The chains close at the solution of Newton's method.
        let mut tree = vec![0.0; model.body_count()];
        coupling.positions(&q, 1, &mut tree);
        for (name, theirs) in passive.iter().zip(numbers(&state["passive_q"])) {
            let place = model.tree_joints().iter().position(|joint| joint.name == *name).unwrap();
            assert!((tree[place] - theirs).abs() < 1e-11, "{name}: {} against {theirs}", tree[place]);
        }
        // Required for closed chains: 1e-8. Least squares of redundant equations has errors of about 1e-11.
        close(1e-9, inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq), &tau, "torque");
        let expected = ordered(&order, &state["forward_ddq"]);
        close(1e-9, forward_dynamics(&model, &mut workspace, &q, &dq, &applied), &expected, "acceleration");
    }
    // Number of base parameters = rank of the regressors of the closed chains.
    let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
    assert_eq!(base.count() as u64, file["base_parameters"].as_u64().unwrap());
}

#[test]
fn invalid_loops_are_reported() {
    let tree = load_robot(repository("examples/robots/palletizer.urdf")).unwrap().model;
    let changed = |change: &dyn Fn(&mut LoopClosure)| {
        let mut all = cuts();
        change(&mut all[0]);
        loops::followers(&tree, &all).unwrap_err()
    };
    assert!(matches!(changed(&|cut| cut.links[0] = "tail".into()), LoopError::UnknownLink { link } if link == "tail"));
    assert!(matches!(changed(&|cut| cut.passive[0] = "knee".into()), LoopError::UnknownJoint { .. }));
    assert!(matches!(changed(&|cut| cut.points_m[0][1] = f64::NAN), LoopError::NotFinite { .. }));
    // No passive joint reaches a point out of the plane of the chain.
    assert!(matches!(changed(&|cut| cut.points_m[0][1] = 0.05), LoopError::Open { gap_m, .. } if gap_m > 0.04));
    // A rod 3 cm longer still closes the chain, but not as a parallelogram.
    assert!(matches!(changed(&|cut| cut.points_m[0][2] = 0.03), LoopError::NotLinear { .. }));
    assert!(matches!(changed(&|cut| cut.passive.push("wrist_joint".into())), LoopError::Undetermined { .. }));
}

#[test]
fn base_parameters_of_coupled_joints_are_minimal() {
    let followers = load_robot(repository("golden/coupled/followers.urdf")).unwrap().model;
    for model in [palletizer(), followers] {
        let choice = DriveChoice { drive_inertia: true, viscous: true, offset: true, ..DriveChoice::default() };
        let terms = terms_per_joint(&model, |_| choice);
        let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
        // States that differ from those used for the base parameters.
        let rank = numerical_rank(&model, &terms, 99, 2e-5);
        assert_eq!(rank.independent, base.independent(), "{}", model.name());
        let mut random = Random::new(5);
        let all: Vec<f64> = (0..base.all_columns().len()).map(|_| random.uniform(-3.0, 3.0)).collect();
        let theta = base.values(&all);
        let (dof, samples) = (model.dof(), 20);
        let mut motion = || (0..dof * samples).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
        let (q, dq, ddq) = (motion(), motion(), motion());
        let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
        let torque = |layout: &PanelLayout, values: &[f64]| {
            let mut panels = Panels::default();
            regressor_panels(&model, &mut BatchWorkspace::new(&model), layout, &motion, &mut panels);
            let mut tau = vec![0.0; dof * samples];
            for joint in 0..dof {
                for (place, &column) in layout.joint_columns(joint).iter().enumerate() {
                    let entries = &panels.joint(joint)[place * samples..(place + 1) * samples];
                    for (to, entry) in tau[joint * samples..(joint + 1) * samples].iter_mut().zip(entries) {
                        *to += entry * values[column];
                    }
                }
            }
            tau
        };
        let full = torque(&PanelLayout::new(&model, base.all_columns().to_vec()), &all);
        let short = torque(&PanelLayout::new(&model, base.base_columns()), &theta);
        // Dependencies are accurate to rounding, for columns with different units of length.
        close(1e-9, &short, &full, model.name());
        // The bodies' part is the inverse dynamics.
        let mut own = all;
        own[..model.inertial_count()].copy_from_slice(&model.parameter_vector());
        own[model.inertial_count()..].fill(0.0);
        let mut tau = vec![0.0; dof * samples];
        inverse_dynamics_batch(&model, &mut BatchWorkspace::new(&model), &motion, &mut tau);
        close(ROUNDING, &torque(&PanelLayout::new(&model, base.all_columns().to_vec()), &own), &tau, model.name());
    }
}

/// The robot with all lengths and masses scaled; the ratios of prismatic joints that follow revolute joints are scaled
/// as well.
fn scaled(model: &Model, length: f64, mass: f64) -> Model {
    let placed = |placement: Transform| Transform { translation: placement.translation.scale(length), ..placement };
    let body = |body: &Body| {
        let mut body = body.clone();
        for link in &mut body.links {
            link.placement = placed(link.placement);
            link.inertial = link.inertial.map(|inertial| {
                let by = |k: usize| {
                    if k == 0 {
                        1.0
                    } else if k < 4 {
                        length
                    } else {
                        length * length
                    }
                };
                InertialParameters(core::array::from_fn(|k| mass * by(k) * inertial.0[k]))
            });
        }
        body
    };
    let tree = model.tree_joints();
    let reach = |joint: &Joint| if joint.is_rotary() { 1.0 } else { length };
    let joints = tree.iter().map(|joint| {
        let mut joint = Joint { placement: placed(joint.placement), ..joint.clone() };
        let own = reach(&joint);
        if let Some(mimic) = &mut joint.mimic {
            mimic.offset *= own;
            for source in &mut mimic.sources {
                let followed = tree.iter().find(|other| other.name == source.joint).unwrap();
                source.multiplier *= own / reach(followed);
            }
        }
        joint
    });
    let bodies = model.bodies().iter().map(body).collect();
    let scaled = Model::new(model.name(), body(model.base()), joints.collect(), bodies).unwrap();
    scaled.with_gravity(model.gravity()).unwrap()
}

/// Links of a millimetre or a kilometre, a gram or a ton: the same base parameters with scaled factors, at the same
/// gravity. 1e-7 of a factor is the rounding of the split, 1e-12, at a share of at least 2e-5.
#[test]
fn base_parameters_of_coupled_joints_do_not_depend_on_size() {
    let followers = load_robot(repository("golden/coupled/followers.urdf")).unwrap().model;
    let panda = load_robot(repository("robots/panda.urdf")).unwrap().model;
    for model in [palletizer(), followers, panda] {
        let choice = DriveChoice { drive_inertia: true, viscous: true, offset: true, ..DriveChoice::default() };
        let base_of = |model: &Model| {
            let terms = terms_per_joint(model, |_| choice);
            let base = BaseParameters::new(model, &terms, &BaseParameterSettings::default());
            assert_eq!(numerical_rank(model, &terms, 99, 2e-5).independent, base.independent(), "{}", model.name());
            base
        };
        let usual = base_of(&model);
        let unit = |column: &Column, length: f64| match column {
            Column::Body { parameter: 0, .. } => 1.0,
            Column::Body { parameter: 1..=3, .. } => length,
            Column::Body { .. } => length * length,
            Column::Term(term) if model.joints()[term.own_joint().unwrap()].is_rotary() => length * length,
            Column::Term(_) => 1.0,
        };
        for (length, mass) in [(1e-3, 1.0), (1e3, 1.0), (1.0, 1e-3), (1.0, 1e3), (1e-3, 1e-3), (1e3, 1e3)] {
            let base = base_of(&scaled(&model, length, mass));
            assert_eq!(base.independent(), usual.independent(), "{} {length} {mass}", model.name());
            for (d, dependent) in base.dependent().iter().enumerate() {
                for (b, independent) in base.independent().iter().enumerate() {
                    let factor = |column: usize| unit(&base.all_columns()[column], length);
                    let expected = usual.regrouping()[(b, d)] * factor(*independent) / factor(*dependent);
                    let size = factor(*independent) / factor(*dependent);
                    let found = base.regrouping()[(b, d)];
                    let near = (found - expected).abs() <= 1e-7 * expected.abs().max(size);
                    assert!(near, "{} {length}: {found} for {expected}", model.name());
                }
            }
        }
    }
}

#[test]
fn torque_and_regressor_derivatives_equal_differences() {
    let model = palletizer();
    let (dof, samples, step) = (model.dof(), 5, 1e-6);
    let mut random = Random::new(3);
    let mut vector = |count: usize| (0..count).map(|_| random.uniform(-0.8, 0.8)).collect::<Vec<f64>>();
    let state = [vector(dof), vector(dof), vector(dof)];
    let mut workspace = Workspace::new(&model);
    let found = inverse_dynamics_derivatives(&model, &mut workspace, &state[0], &state[1], &state[2]);
    let found = [found.by_position, found.by_velocity, found.by_acceleration].map(<[f64]>::to_vec);
    let mut torque =
        |state: &[Vec<f64>; 3]| inverse_dynamics(&model, &mut workspace, &state[0], &state[1], &state[2]).to_vec();
    for (which, matrix) in found.iter().enumerate() {
        for joint in 0..dof {
            let [mut up, mut down] = [state.clone(), state.clone()];
            up[which][joint] += step;
            down[which][joint] -= step;
            let slope: Vec<f64> = torque(&up).iter().zip(torque(&down)).map(|(a, b)| (a - b) / (2.0 * step)).collect();
            let column: Vec<f64> = (0..dof).map(|row| matrix[row * dof + joint]).collect();
            // Central differences of 1e-6 of torques of about 100 Nm.
            let scale = slope.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
            assert!(
                column.iter().zip(&slope).all(|(a, b)| (a - b).abs() < 1e-7 * scale + 1e-6),
                "{column:?} {slope:?}"
            );
        }
    }

    let layout =
        PanelLayout::new(&model, BaseParameters::new(&model, &[], &BaseParameterSettings::default()).base_columns());
    let motion: Vec<Vec<f64>> = (0..3).map(|_| vector(dof * samples)).collect();
    let mut batch = BatchWorkspace::new(&model);
    let mut weights = Panels::default();
    weights.resize(&layout, samples);
    for joint in 0..dof {
        let count = weights.joint(joint).len();
        weights.joint_mut(joint).copy_from_slice(&vector(count));
    }
    let mut cost = |motion: &[Vec<f64>]| -> f64 {
        let mut panels = Panels::default();
        let motion = JointMotion { samples, q: &motion[0], dq: &motion[1], ddq: &motion[2] };
        regressor_panels(&model, &mut batch, &layout, &motion, &mut panels);
        let row = |joint: usize| {
            let entries = layout.joint_columns(joint).len() * samples;
            panels.joint(joint)[..entries].iter().zip(weights.joint(joint)).map(|(a, b)| a * b).sum::<f64>()
        };
        (0..dof).map(row).sum()
    };
    let mut gradient = [(); 3].map(|()| vec![0.0; dof * samples]);
    let [by_q, by_dq, by_ddq] = &mut gradient;
    let view = JointMotion { samples, q: &motion[0], dq: &motion[1], ddq: &motion[2] };
    let mut to = MotionGradient { by_q, by_dq, by_ddq };
    regressor_panels_adjoint(&model, &mut BatchWorkspace::new(&model), &layout, &view, &weights, &mut to);
    for (which, found) in gradient.iter().enumerate() {
        for (place, found) in found.iter().enumerate() {
            let [mut up, mut down] = [motion.clone(), motion.clone()];
            up[which][place] += step;
            down[which][place] -= step;
            let slope = (cost(&up) - cost(&down)) / (2.0 * step);
            assert!((slope - found).abs() < 1e-6 * (1.0 + slope.abs()), "{which} {place}: {found} against {slope}");
        }
    }
}

/// The Jacobian of a point equals the differences of its poses, also if joints follow others.
#[test]
fn jacobians_are_differences_of_poses() {
    const STEP: f64 = 1e-6;
    for path in ["golden/coupled/followers.urdf", "robots/ur10.urdf"] {
        let model = load_robot(repository(path)).unwrap().model;
        let mut workspace = Workspace::new(&model);
        let q: Vec<f64> = (0..model.dof()).map(|joint| 0.3 + 0.2 * joint as f64).collect();
        let point = Vec3([0.1, -0.2, 0.3]);
        for body in 0..model.body_count() {
            let found = point_jacobian(&model, &mut workspace, &q, body, point);
            let pose = body_placements(&model, &mut workspace, &q)[body];
            for joint in 0..model.dof() {
                let mut at = |step: f64| {
                    let mut moved = q.clone();
                    moved[joint] += step;
                    body_placements(&model, &mut workspace, &moved)[body]
                };
                let (plus, minus) = (at(STEP), at(-STEP));
                let slope = (plus.point(point) - minus.point(point)).scale(0.5 / STEP);
                // Ṙ Rᵀ is the matrix of the cross product with ω.
                let spin = (plus.rotation - minus.rotation).scale(0.5 / STEP).mul_mat(&pose.rotation.transpose()).0;
                let omega = [spin[2][1], spin[0][2], spin[1][0]];
                // The error of central differences is some 1e-16 / 1e-6.
                close(1e-8, &found.linear[joint].0, &slope.0, path);
                close(1e-8, &found.angular[joint].0, &omega, path);
            }
        }
    }
}
