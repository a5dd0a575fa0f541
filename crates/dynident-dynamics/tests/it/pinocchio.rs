//! Dynident compared with Pinocchio 4.1 and MuJoCo 4.0 on every robot of `robots/`, at every processor level.
//!
//! Deviations are relative to the largest entry of an array. Required: 1e-10. The expected rounding is smaller:
//! several hundred roundings of 1e-16 along a chain of at most twenty joints, i.e. 1e-13, and ten times that for
//! cancelling terms.

use crate::golden::{ARMS, Golden, ROBOTS, assert_close, numbers, text};
use dynident_dynamics::{
    BatchWorkspace, PanelLayout, Panels, Workspace, all_columns, body_placements, forward_dynamics, gravity_torque,
    inverse_dynamics, inverse_dynamics_batch, inverse_dynamics_derivatives, kinetic_energy, mass_matrix,
    potential_energy, regressor_panels, torque_regressor,
};
use dynident_lanes::Level;
use dynident_model::terms::JointMotion;
use dynident_model::{Model, Transform, Vec3};
use serde_json::Value;

/// Sums along a chain, see above.
const CHAIN: f64 = 1e-12;
/// Single products of rotations and lengths, without sums over bodies.
const GEOMETRY: f64 = 1e-13;
/// The required accuracy. The mass matrix of a humanoid with fingers has a condition number above 1e6, so
/// accelerations of the joints with the least inertia have a million times the rounding.
const PROMISE: f64 = 1e-10;

struct State {
    what: String,
    q: Vec<f64>,
    dq: Vec<f64>,
    ddq: Vec<f64>,
}

fn each(robots: &[&'static str], mut check: impl FnMut(&Golden, &Value, &State, &mut Workspace)) {
    for name in robots {
        let golden = Golden::of("pinocchio", name);
        for level in Level::available() {
            let mut workspace = Workspace::with_level(&golden.model, level);
            for entry in golden.states() {
                let vector = |key: &str| golden.vector(&entry[key]);
                let what = format!("{name}, state `{}`, {}", text(&entry["label"]), level.name());
                let state = State { what, q: vector("q"), dq: vector("dq"), ddq: vector("ddq") };
                check(&golden, entry, &state, &mut workspace);
            }
        }
    }
}

#[test]
fn readers_give_the_same_model() {
    for name in ROBOTS {
        let Golden { model, file, .. } = Golden::of("pinocchio", name);
        for (index, joint) in model.joints().iter().enumerate() {
            let parent = joint.parent.map(|parent| model.joints()[parent].name.as_str());
            assert_eq!(parent, file["parents"][&joint.name].as_str(), "{name}: parent of {}", joint.name);
            // Lumped over fixed joints. Terms of parallel axes cancel if a link is far from its joint.
            let theirs = numbers(&file["inertial_parameters"][&joint.name]);
            assert_close(&model.inertials()[index].0, &theirs, CHAIN, &format!("{name}: inertials of {}", joint.name));
        }
        let mass: f64 = model.inertials().iter().map(dynident_model::InertialParameters::mass_kg).sum();
        assert_close(&[mass], &[file["moving_mass_kg"].as_f64().unwrap()], GEOMETRY, name);
        assert_close(&model.gravity().0, &numbers(&file["gravity_mps2"]), 0.0, name);
    }
}

#[test]
fn inverse_dynamics_agree() {
    let mut worst = 0.0_f64;
    each(&ROBOTS, |golden, entry, State { what, q, dq, ddq }, workspace| {
        let tau = inverse_dynamics(&golden.model, workspace, q, dq, ddq);
        worst = worst.max(assert_close(tau, &golden.vector(&entry["tau"]), CHAIN, what));
        let tau = gravity_torque(&golden.model, workspace, q);
        worst = worst.max(assert_close(tau, &golden.vector(&entry["gravity_torque"]), CHAIN, what));
    });
    println!("largest relative deviation {worst:.1e}");
}

#[test]
fn inverse_dynamics_agree_under_a_tilted_base() {
    for name in ROBOTS {
        let golden = Golden::of("pinocchio", name);
        let gravity = Vec3(numbers(&golden.file["tilted_gravity_mps2"]).try_into().unwrap());
        let by_gravity = golden.model.clone().with_gravity(gravity).unwrap();
        // The same as a base rotated under the standard gravity g: a rotation with Rᵀ (0, 0, -|g|) along the tilted
        // one.
        let size = gravity.norm();
        let upright = golden.model.clone().with_gravity(Vec3([0.0, 0.0, -size])).unwrap();
        let pitch = (gravity[0] / size).asin();
        let roll = (-gravity[1]).atan2(-gravity[2]);
        let by_base = upright.with_base_orientation(roll, pitch, 0.0).unwrap();
        for model in [&by_gravity, &by_base] {
            let mut workspace = Workspace::new(model);
            for entry in golden.states() {
                let [q, dq, ddq] = ["q", "dq", "ddq"].map(|key| golden.vector(&entry[key]));
                let tau = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq);
                assert_close(tau, &golden.vector(&entry["tau_tilted_gravity"]), CHAIN, name);
            }
        }
    }
}

#[test]
fn mass_matrices_and_energies_agree() {
    let mut worst = 0.0_f64;
    each(&ROBOTS, |golden, entry, State { what, q, dq, .. }, workspace| {
        let theirs = golden.symmetric(&entry["mass_matrix_lower"]);
        worst = worst.max(assert_close(mass_matrix(&golden.model, workspace, q), &theirs, CHAIN, what));
        let kinetic = kinetic_energy(&golden.model, workspace, q, dq);
        assert_close(&[kinetic], &[entry["kinetic_energy_j"].as_f64().unwrap()], CHAIN, what);
        // Heights of bodies above and below the base cancel: relative to the weight at one metre.
        let potential = potential_energy(&golden.model, workspace, q);
        let theirs = entry["potential_energy_j"].as_f64().unwrap();
        let weight = 9.81 * golden.file["moving_mass_kg"].as_f64().unwrap();
        assert!((potential - theirs).abs() <= CHAIN * weight.max(theirs.abs()), "{what}: {potential} against {theirs}");
    });
    println!("largest relative deviation of a mass matrix {worst:.1e}");
}

#[test]
fn forward_dynamics_agree() {
    let mut worst = 0.0_f64;
    each(&ROBOTS, |golden, entry, State { what, q, dq, .. }, workspace| {
        let tau = golden.vector(&entry["forward_dynamics"]["tau"]);
        let theirs = golden.vector(&entry["forward_dynamics"]["ddq"]);
        worst =
            worst.max(assert_close(forward_dynamics(&golden.model, workspace, q, dq, &tau), &theirs, PROMISE, what));
    });
    println!("largest relative deviation {worst:.1e}");
}

#[test]
fn regressors_agree() {
    let mut worst = 0.0_f64;
    each(&ROBOTS, |golden, entry, State { what, q, dq, ddq }, workspace| {
        let width = 10 * golden.model.dof();
        let regressor = torque_regressor(&golden.model, workspace, q, dq, ddq);
        if let Some(rows) = entry.get("regressor") {
            worst = worst.max(assert_close(regressor, &golden.regressor(rows), CHAIN, what));
        } else {
            let rows = entry["regressor_rows"].as_object().unwrap();
            assert!(!rows.is_empty(), "{what}: the file holds no regressor");
            let (mut ours, mut theirs) = (Vec::new(), Vec::new());
            for (joint, row) in rows {
                let at = width * golden.model.joint_index(joint).unwrap();
                ours.extend(&regressor[at..at + width]);
                theirs.extend(golden.parameters(row));
            }
            worst = worst.max(assert_close(&ours, &theirs, CHAIN, what));
        }
        let probes = golden.file["probe_parameters"].as_array().unwrap();
        for (probe, torques) in probes.iter().zip(entry["probe_torques"].as_array().unwrap()) {
            let probe = golden.parameters(probe);
            let product = |row: &[f64]| row.iter().zip(&probe).map(|(y, p)| y * p).sum::<f64>();
            let ours: Vec<f64> = regressor.chunks_exact(width).map(product).collect();
            assert_close(&ours, &golden.vector(torques), CHAIN, what);
        }
    });
    println!("largest relative deviation {worst:.1e}");
}

#[test]
fn derivatives_agree() {
    let mut worst = 0.0_f64;
    each(&ARMS, |golden, entry, State { what, q, dq, ddq }, workspace| {
        let ours = inverse_dynamics_derivatives(&golden.model, workspace, q, dq, ddq);
        worst = worst.max(assert_close(ours.by_position, &golden.square(&entry["dtau_dq"]), CHAIN, what));
        worst = worst.max(assert_close(ours.by_velocity, &golden.square(&entry["dtau_dv"]), CHAIN, what));
        let theirs = golden.symmetric(&entry["mass_matrix_lower"]);
        worst = worst.max(assert_close(ours.by_acceleration, &theirs, CHAIN, what));
    });
    println!("largest relative deviation {worst:.1e}");
}

#[test]
fn placements_agree() {
    each(&ROBOTS, |golden, entry, State { what, q, .. }, workspace| {
        let placements = body_placements(&golden.model, workspace, q).to_vec();
        for (joint, theirs) in entry["joint_placements"].as_object().unwrap() {
            assert_placement(
                &placements[golden.model.joint_index(joint).unwrap()],
                theirs,
                &format!("{what}, {joint}"),
            );
        }
        let Some(links) = entry.get("link_placements") else { return };
        for (link, theirs) in links.as_object().unwrap() {
            let placement = link_placement(&golden.model, &placements, link);
            assert_placement(&placement, theirs, &format!("{what}, link {link}"));
        }
    });
}

fn link_placement(model: &Model, bodies: &[Transform], name: &str) -> Transform {
    let moving =
        bodies.iter().zip(model.bodies()).flat_map(|(at, body)| body.links.iter().map(move |link| (*at, link)));
    let resting = model.base().links.iter().map(|link| (Transform::IDENTITY, link));
    let (at, link) = resting.chain(moving).find(|(_, link)| link.name == name).expect("every link belongs to a body");
    at.then(&link.placement)
}

/// Metres and entries of rotations are both of order one.
fn assert_placement(ours: &Transform, theirs: &Value, what: &str) {
    let rotation = theirs["rotation"].as_array().unwrap().iter().flat_map(numbers);
    let theirs: Vec<f64> = numbers(&theirs["position_m"]).into_iter().chain(rotation).collect();
    let ours: Vec<f64> = ours.translation.0.into_iter().chain(ours.rotation.0.into_iter().flatten()).collect();
    assert_close(&ours, &theirs, GEOMETRY, what);
}

#[test]
fn batches_agree() {
    for name in ROBOTS {
        let golden = Golden::of("pinocchio", name);
        let (model, dof) = (&golden.model, golden.model.dof());
        // Thirteen samples: a full and a partial block at every width.
        let entries: Vec<&Value> = golden.states().iter().cycle().take(13).collect();
        let samples = entries.len();
        let joint_major = |key: &str| -> Vec<f64> {
            let rows: Vec<Vec<f64>> = entries.iter().map(|entry| golden.vector(&entry[key])).collect();
            (0..dof).flat_map(|joint| rows.iter().map(|row| row[joint]).collect::<Vec<_>>()).collect()
        };
        let [q, dq, ddq, tau] = ["q", "dq", "ddq", "tau"].map(joint_major);
        let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
        let parameters = model.parameter_vector();
        let layout = PanelLayout::new(model, all_columns(model, &[]));
        for level in Level::available() {
            let mut workspace = BatchWorkspace::with_level(model, level);
            let mut ours = vec![0.0; dof * samples];
            inverse_dynamics_batch(model, &mut workspace, &motion, &mut ours);
            let mut panels = Panels::default();
            regressor_panels(model, &mut workspace, &layout, &motion, &mut panels);
            for (sample, entry) in entries.iter().enumerate() {
                let what = format!("{name}, sample {sample}, {}", level.name());
                let column = |array: &[f64]| (0..dof).map(|joint| array[joint * samples + sample]).collect::<Vec<_>>();
                assert_close(&column(&ours), &column(&tau), CHAIN, &what);
                let by_panels = |joint: usize| -> f64 {
                    let columns = layout.joint_columns(joint).iter().enumerate();
                    columns.map(|(place, &c)| panels.joint(joint)[place * samples + sample] * parameters[c]).sum()
                };
                let torques: Vec<f64> = (0..dof).map(by_panels).collect();
                assert_close(&torques, &column(&tau), CHAIN, &what);
                let Some(rows) = entry.get("regressor") else { continue };
                let mut dense = vec![0.0; dof * 10 * dof];
                for joint in 0..dof {
                    for (place, &c) in layout.joint_columns(joint).iter().enumerate() {
                        dense[joint * 10 * dof + c] = panels.joint(joint)[place * samples + sample];
                    }
                }
                assert_close(&dense, &golden.regressor(rows), CHAIN, &what);
            }
        }
    }
}

#[test]
fn mujoco_agrees() {
    for name in ["panda_arm7", "ur10"] {
        let golden = Golden::of("mujoco", name);
        assert_close(&golden.model.gravity().0, &numbers(&golden.file["gravity_mps2"]), 0.0, name);
        let mut workspace = Workspace::new(&golden.model);
        for entry in golden.states() {
            let [q, dq, ddq] = ["q", "dq", "ddq"].map(|key| golden.vector(&entry[key]));
            let what = format!("{name}, state `{}`", text(&entry["label"]));
            let tau = inverse_dynamics(&golden.model, &mut workspace, &q, &dq, &ddq);
            // MuJoCo converts inertias to principal axes and back by quaternions, which loses one more digit.
            assert_close(tau, &golden.vector(&entry["tau"]), 1e-11, &what);
            let matrix = mass_matrix(&golden.model, &mut workspace, &q);
            assert_close(matrix, &golden.symmetric(&entry["mass_matrix_lower"]), 1e-11, &what);
        }
    }
}
