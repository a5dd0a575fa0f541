//! Invariants of rigid-body dynamics on random trees, each compared with another algorithm or a law of physics.

use dynident_dynamics::{
    BatchWorkspace, PanelLayout, Panels, TermHistory, Workspace, all_columns, body_placements, coriolis_matrix,
    forward_dynamics, forward_dynamics_derivatives, gravity_torque, gravity_torque_derivative, inverse_dynamics,
    inverse_dynamics_batch, inverse_dynamics_derivatives, kinetic_energy, mass_matrix, mass_matrix_and_bias,
    potential_energy, regressor_panels, regressor_panels_of_sample, torque_regressor,
};
use dynident_lanes::Level;
use dynident_model::sample::{Random, random_tree};
use dynident_model::terms::JointMotion;
use dynident_model::{Mimic, MimicSource, Model};

/// Two orders of summation over about ten bodies, in double precision.
const ROUNDING: f64 = 1e-11;

pub(crate) struct Case {
    pub(crate) model: Model,
    pub(crate) q: Vec<f64>,
    pub(crate) dq: Vec<f64>,
    pub(crate) ddq: Vec<f64>,
}

/// Random trees, and the same number with coupled joints.
pub(crate) fn cases() -> impl Iterator<Item = Case> {
    (0..120).map(|case| {
        let seed = case / 2;
        let mut random = Random::new(1000 + seed);
        let mut model = random_tree(seed, 1 + (seed as usize) % 12);
        if case % 2 == 1 {
            model = coupled(model, &mut random);
        }
        let dof = model.dof();
        let mut vector = |range: f64| (0..dof).map(|_| random.uniform(-range, range)).collect::<Vec<f64>>();
        Case { q: vector(3.0), dq: vector(2.0), ddq: vector(3.0), model }
    })
}

/// The robot with a third of its joints following one or two others; some of these follow others themselves.
fn coupled(model: Model, random: &mut Random) -> Model {
    let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    // A joint follows joints that are earlier in this order: no cycles, but sources before and after it in the tree.
    let count = names.len();
    let place = |k: usize| (5 * k + 2) % count.max(1);
    let in_turn = !count.is_multiple_of(5);
    let mut followers = Vec::new();
    for k in 1..count {
        if random.uniform(0.0, 3.0) > 1.0 {
            continue;
        }
        let of = |k: usize| names[if in_turn { place(k) } else { k }].clone();
        let mut sources = vec![random.bits() as usize % k, random.bits() as usize % k];
        sources.dedup();
        let mut source = |k: usize| MimicSource { joint: of(k), multiplier: random.uniform(-1.5, 1.5) };
        let sources = sources.into_iter().map(&mut source).collect();
        followers.push((of(k), Mimic { sources, offset: random.uniform(-1.0, 1.0) }));
    }
    model.with_followers(&followers).unwrap()
}

fn assert_close(a: &[f64], b: &[f64], tolerance: f64, what: &str) {
    assert_eq!(a.len(), b.len(), "{what}: lengths");
    let scale = a.iter().chain(b).fold(1.0_f64, |m, x| m.max(x.abs()));
    for (k, (x, y)) in a.iter().zip(b).enumerate() {
        assert!((x - y).abs() <= tolerance * scale, "{what}: entry {k}: {x} against {y}");
    }
}

#[test]
fn regressor_times_parameters_is_inverse_dynamics() {
    for Case { model, q, dq, ddq } in cases() {
        for level in Level::available() {
            let mut ws = Workspace::with_level(&model, level);
            let tau = inverse_dynamics(&model, &mut ws, &q, &dq, &ddq).to_vec();
            let parameters = model.parameter_vector();
            let regressor = torque_regressor(&model, &mut ws, &q, &dq, &ddq);
            let by_regressor: Vec<f64> = regressor
                .chunks_exact(parameters.len())
                .map(|row| row.iter().zip(&parameters).map(|(y, p)| y * p).sum())
                .collect();
            assert_close(&by_regressor, &tau, ROUNDING, level.name());
        }
    }
}

#[test]
fn forward_dynamics_inverts_inverse_dynamics() {
    for Case { model, q, dq, ddq } in cases() {
        let mut ws = Workspace::new(&model);
        let tau = inverse_dynamics(&model, &mut ws, &q, &dq, &ddq).to_vec();
        let back = forward_dynamics(&model, &mut ws, &q, &dq, &tau);
        // Rounding times the condition number of the mass matrix (up to several thousand here).
        assert_close(back, &ddq, 1e-8, "accelerations");
    }
}

#[test]
fn derivative_by_acceleration_is_the_mass_matrix_and_inverse_dynamics_is_affine_in_it() {
    for Case { model, q, dq, ddq } in cases() {
        let dof = model.dof();
        let mut ws = Workspace::new(&model);
        let m = mass_matrix(&model, &mut ws, &q).to_vec();
        let bias = inverse_dynamics(&model, &mut ws, &q, &dq, &vec![0.0; dof]).to_vec();
        for j in 0..dof {
            let mut unit = vec![0.0; dof];
            unit[j] = 1.0;
            let tau = inverse_dynamics(&model, &mut ws, &q, &dq, &unit).to_vec();
            let column: Vec<f64> = tau.iter().zip(&bias).map(|(t, b)| t - b).collect();
            let expected: Vec<f64> = (0..dof).map(|i| m[i * dof + j]).collect();
            assert_close(&column, &expected, ROUNDING, "mass matrix column");
        }
        let derivatives = inverse_dynamics_derivatives(&model, &mut ws, &q, &dq, &ddq);
        assert_close(derivatives.by_acceleration, &m, ROUNDING, "derivative by acceleration");
    }
}

#[test]
fn acceleration_derivatives_equal_differences() {
    for Case { model, q, dq, ddq } in cases() {
        let dof = model.dof();
        for level in Level::available() {
            let mut ws = Workspace::with_level(&model, level);
            let tau = inverse_dynamics(&model, &mut ws, &q, &dq, &ddq).to_vec();
            let mass = nalgebra::DMatrix::from_row_slice(dof, dof, mass_matrix(&model, &mut ws, &q));
            let acceleration = forward_dynamics(&model, &mut ws, &q, &dq, &tau).to_vec();
            let found = forward_dynamics_derivatives(&model, &mut ws, &q, &dq, &tau);
            assert_eq!(found.acceleration, acceleration, "acceleration by articulated bodies");
            // Rounding times the condition number of the mass matrix (up to several thousand here).
            let identity = nalgebra::DMatrix::from_row_slice(dof, dof, found.by_torque) * &mass;
            assert_close(identity.as_slice(), nalgebra::DMatrix::identity(dof, dof).as_slice(), 1e-9, "inverse");
            let found = [found.by_position, found.by_velocity, found.by_torque].map(<[f64]>::to_vec);

            let state = [q.clone(), dq.clone(), tau];
            let mut change = |which: usize, joint: usize, step: f64| -> Vec<f64> {
                let [mut up, mut down] = [state.clone(), state.clone()];
                (up[which][joint], down[which][joint]) = (state[which][joint] + step, state[which][joint] - step);
                let up = forward_dynamics(&model, &mut ws, &up[0], &up[1], &up[2]).to_vec();
                let down = forward_dynamics(&model, &mut ws, &down[0], &down[1], &down[2]);
                up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * step)).collect()
            };
            for (which, matrix) in found.iter().enumerate() {
                // Fourth-order differences with a step of 1e-3: error about h^4 times fifth derivatives, which are
                // large for light bodies on heavy ones.
                for joint in 0..dof {
                    let (coarse, fine) = (change(which, joint, 2e-3), change(which, joint, 1e-3));
                    let slope: Vec<f64> = fine.iter().zip(&coarse).map(|(f, c)| (4.0 * f - c) / 3.0).collect();
                    let column: Vec<f64> = (0..dof).map(|row| matrix[row * dof + joint]).collect();
                    assert_close(&column, &slope, 1e-6, level.name());
                }
            }
        }
    }
}

#[test]
fn mass_matrix_is_symmetric_and_positive_definite() {
    for Case { model, q, .. } in cases() {
        let dof = model.dof();
        let mut ws = Workspace::new(&model);
        let m = nalgebra::DMatrix::from_row_slice(dof, dof, mass_matrix(&model, &mut ws, &q));
        assert_eq!(m, m.transpose());
        assert!(m.cholesky().is_some(), "not positive definite");
    }
}

#[test]
fn mass_rate_minus_twice_coriolis_is_skew() {
    // dM/dt - 2 C is skew for the C of Christoffel symbols. Equivalent without C: q̇ᵀ (dM/dt) q̇ = 2 q̇ᵀ C q̇, with
    // dM/dt from the mass matrix (Richardson-extrapolated differences along q̇) and C q̇ from the inverse dynamics.
    for Case { model, q, dq, .. } in cases() {
        let dof = model.dof();
        let mut ws = Workspace::new(&model);
        let mut power_at = |step: f64| {
            let at: Vec<f64> = q.iter().zip(&dq).map(|(q, v)| q + step * v).collect();
            2.0 * kinetic_energy(&model, &mut ws, &at, &dq)
        };
        let h = 1e-3;
        let coarse = (power_at(2.0 * h) - power_at(-2.0 * h)) / (4.0 * h);
        let fine = (power_at(h) - power_at(-h)) / (2.0 * h);
        let rate = (4.0 * fine - coarse) / 3.0;
        let with_gravity = inverse_dynamics(&model, &mut ws, &q, &dq, &vec![0.0; dof]).to_vec();
        let gravity = gravity_torque(&model, &mut ws, &q);
        let coriolis: f64 = dq.iter().zip(with_gravity.iter().zip(gravity)).map(|(v, (t, g))| v * (t - g)).sum();
        // Fourth-order differences with a step of 1e-3: error about h^4 times fifth derivatives (several hundred).
        assert!((rate - 2.0 * coriolis).abs() <= 1e-7 * (1.0 + rate.abs()), "{rate} against {}", 2.0 * coriolis);
    }
}

#[test]
fn coriolis_matrix_of_christoffel_symbols_makes_the_difference_skew() {
    // C_ij = Σ_k ½ (∂_k M_ij + ∂_j M_ik - ∂_i M_jk) q̇_k must give the velocity torque of the inverse dynamics, and
    // dM/dt - 2 C must be skew.
    for Case { model, q, dq, .. } in cases().filter(|case| case.model.dof() <= 6) {
        let dof = model.dof();
        let mut ws = Workspace::new(&model);
        let mut mass = |q: &[f64]| nalgebra::DMatrix::from_row_slice(dof, dof, mass_matrix(&model, &mut ws, q));
        let h = 1e-3;
        let slope: Vec<_> = (0..dof)
            .map(|k| {
                let mut at = |step: f64| {
                    let mut q = q.clone();
                    q[k] += step;
                    mass(&q)
                };
                (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
            })
            .collect();
        let c = nalgebra::DMatrix::from_fn(dof, dof, |i, j| {
            (0..dof).map(|k| 0.5 * (slope[k][(i, j)] + slope[j][(i, k)] - slope[i][(j, k)]) * dq[k]).sum::<f64>()
        });
        // Fourth-order differences of masses of several tens: as above.
        let found = coriolis_matrix(&model, &mut Workspace::new(&model), &q, &dq).to_vec();
        assert_close(&found, &c.transpose().iter().copied().collect::<Vec<f64>>(), 1e-7, "Coriolis matrix");
        let velocity_torque: Vec<f64> = (&c * nalgebra::DVector::from_column_slice(&dq)).iter().copied().collect();
        let total = inverse_dynamics(&model, &mut ws, &q, &dq, &vec![0.0; dof]).to_vec();
        let gravity = gravity_torque(&model, &mut ws, &q).to_vec();
        let expected: Vec<f64> = total.iter().zip(&gravity).map(|(t, g)| t - g).collect();
        assert_close(&velocity_torque, &expected, 1e-7, "velocity torque");
        let rate = (0..dof).fold(nalgebra::DMatrix::zeros(dof, dof), |sum, k| sum + &slope[k] * dq[k]);
        let skew = rate - 2.0 * c;
        assert!((&skew + skew.transpose()).amax() < 1e-9, "not skew");
    }
}

#[test]
fn gravity_torque_is_the_slope_of_potential_energy() {
    for Case { model, q, .. } in cases() {
        let mut ws = Workspace::new(&model);
        let gravity = gravity_torque(&model, &mut ws, &q).to_vec();
        let h = 1e-3;
        let slope: Vec<f64> = (0..model.dof())
            .map(|k| {
                let mut at = |step: f64| {
                    let mut q = q.clone();
                    q[k] += step;
                    potential_energy(&model, &mut ws, &q)
                };
                (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
            })
            .collect();
        // Rounding of energies (several hundred joules) over the step: 1e-16 · 1e2 / 1e-3 = 1e-11, and h^4 of
        // harmonics.
        assert_close(&slope, &gravity, 1e-8, "gravity");
        let stiffness = gravity_torque_derivative(&model, &mut ws, &q).to_vec();
        let slopes: Vec<Vec<f64>> = (0..model.dof())
            .map(|k| {
                let mut at = |step: f64| {
                    let mut q = q.clone();
                    q[k] += step;
                    gravity_torque(&model, &mut ws, &q).to_vec()
                };
                let (near, far) = ([at(h), at(-h)], [at(2.0 * h), at(-2.0 * h)]);
                let slope = |i: usize| (8.0 * (near[0][i] - near[1][i]) - (far[0][i] - far[1][i])) / (12.0 * h);
                (0..model.dof()).map(slope).collect()
            })
            .collect();
        // The second derivative of an energy is symmetric.
        assert_close(&slopes.concat(), &stiffness, 1e-8, "derivative of gravity");
    }
}

/// Entries of joints on different branches are never written, so remains of another algorithm would stay.
#[test]
fn algorithms_do_not_affect_each_other_in_a_workspace() {
    type Quantity = fn(&Model, &mut Workspace, &[f64], &[f64], &[f64]) -> Vec<f64>;
    let quantities: [Quantity; 7] = [
        |model, ws, q, dq, ddq| {
            let found = forward_dynamics_derivatives(model, ws, q, dq, ddq);
            [found.by_position, found.by_velocity, found.by_torque].concat()
        },
        |model, ws, q, dq, ddq| {
            let found = inverse_dynamics_derivatives(model, ws, q, dq, ddq);
            [found.by_position, found.by_velocity, found.by_acceleration].concat()
        },
        |model, ws, q, _, _| mass_matrix(model, ws, q).to_vec(),
        |model, ws, q, dq, _| mass_matrix_and_bias(model, ws, q, dq).0.to_vec(),
        |model, ws, q, dq, _| coriolis_matrix(model, ws, q, dq).to_vec(),
        |model, ws, q, _, _| gravity_torque_derivative(model, ws, q).to_vec(),
        |model, ws, q, dq, ddq| forward_dynamics(model, ws, q, dq, ddq).to_vec(),
    ];
    for Case { model, q, dq, ddq } in cases() {
        let mut used = Workspace::new(&model);
        for before in quantities {
            for quantity in quantities {
                before(&model, &mut used, &dq, &q, &ddq);
                let fresh = quantity(&model, &mut Workspace::new(&model), &q, &dq, &ddq);
                assert_eq!(quantity(&model, &mut used, &q, &dq, &ddq), fresh);
            }
        }
    }
}

#[test]
fn coriolis_matrix_and_gravity_derivative_are_parts_of_the_derivatives_of_the_torque() {
    for Case { model, q, dq, ddq } in cases() {
        let dof = model.dof();
        let zeros = vec![0.0; dof];
        for level in Level::available() {
            let mut ws = Workspace::with_level(&model, level);
            let found = inverse_dynamics_derivatives(&model, &mut ws, &q, &dq, &ddq);
            let half: Vec<f64> = found.by_velocity.iter().map(|entry| 0.5 * entry).collect();
            let at_rest = inverse_dynamics_derivatives(&model, &mut ws, &q, &zeros, &zeros).by_position.to_vec();
            // The same products in the same order.
            assert_close(coriolis_matrix(&model, &mut ws, &q, &dq), &half, 1e-14, "Coriolis matrix");
            // Cancelling terms: masses at some metres from the base's origin.
            assert_close(gravity_torque_derivative(&model, &mut ws, &q), &at_rest, 1e-12, "derivative of gravity");

            let torque = inverse_dynamics(&model, &mut ws, &q, &dq, &zeros).to_vec();
            let gravity = gravity_torque(&model, &mut ws, &q).to_vec();
            let c = nalgebra::DMatrix::from_row_slice(dof, dof, &half);
            let of_velocity = c * nalgebra::DVector::from_column_slice(&dq);
            let wanted: Vec<f64> = torque.iter().zip(&gravity).map(|(torque, gravity)| torque - gravity).collect();
            assert_close(of_velocity.as_slice(), &wanted, 1e-11, "C dq");
        }
    }
}

#[test]
fn energy_balance_holds_along_a_simulated_motion() {
    for Case { model, q, dq, .. } in cases().filter(|case| case.model.dof() <= 5) {
        // Runge-Kutta 4 over 0.1 s under a time-varying torque; the work must equal the change of energy.
        let dof = model.dof();
        let mut ws = Workspace::new(&model);
        let torque = |t: f64| (0..dof).map(|j| (3.0 * t + j as f64).sin()).collect::<Vec<f64>>();
        let (mut q, mut dq, mut work) = (q.clone(), dq.clone(), 0.0);
        let energy = |ws: &mut Workspace, q: &[f64], dq: &[f64]| {
            kinetic_energy(&model, ws, q, dq) + potential_energy(&model, ws, q)
        };
        let before = energy(&mut ws, &q, &dq);
        let h = 1e-4;
        for step in 0..1000 {
            let t = f64::from(step) * h;
            let mut slope = |t: f64, q: &[f64], dq: &[f64]| {
                let tau = torque(t);
                let power: f64 = tau.iter().zip(dq).map(|(a, b)| a * b).sum();
                (dq.to_vec(), forward_dynamics(&model, &mut ws, q, dq, &tau).to_vec(), power)
            };
            let go = |x: &[f64], k: &[f64], h: f64| x.iter().zip(k).map(|(x, k)| x + h * k).collect::<Vec<f64>>();
            let k1 = slope(t, &q, &dq);
            let k2 = slope(t + h / 2.0, &go(&q, &k1.0, h / 2.0), &go(&dq, &k1.1, h / 2.0));
            let k3 = slope(t + h / 2.0, &go(&q, &k2.0, h / 2.0), &go(&dq, &k2.1, h / 2.0));
            let k4 = slope(t + h, &go(&q, &k3.0, h), &go(&dq, &k3.1, h));
            for j in 0..dof {
                q[j] += h / 6.0 * (k1.0[j] + 2.0 * k2.0[j] + 2.0 * k3.0[j] + k4.0[j]);
                dq[j] += h / 6.0 * (k1.1[j] + 2.0 * k2.1[j] + 2.0 * k3.1[j] + k4.1[j]);
            }
            work += h / 6.0 * (k1.2 + 2.0 * k2.2 + 2.0 * k3.2 + k4.2);
        }
        let gain = energy(&mut ws, &q, &dq) - before;
        // Fourth order with a step of 1e-4 s; light tips reach about 100 rad/s, so the tolerance is not smaller.
        assert!((gain - work).abs() <= 1e-6 * (1.0 + before.abs() + work.abs()), "gain {gain}, work {work}");
    }
}

#[test]
fn every_processor_level_and_the_batch_agree() {
    for Case { model, .. } in cases().take(24) {
        let (dof, samples) = (model.dof(), 37);
        let mut random = Random::new(5);
        let mut array = || (0..dof * samples).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
        let (q, dq, ddq) = (array(), array(), array());
        let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
        let layout = PanelLayout::new(&model, all_columns(&model, &[]));
        for level in Level::available() {
            let mut batch = BatchWorkspace::with_level(&model, level);
            let mut single = Workspace::with_level(&model, Level::portable());
            let mut tau = vec![0.0; dof * samples];
            inverse_dynamics_batch(&model, &mut batch, &motion, &mut tau);
            let mut panels = Panels::default();
            regressor_panels(&model, &mut batch, &layout, &motion, &mut panels);
            for s in 0..samples {
                let at = |a: &[f64]| (0..dof).map(|j| a[j * samples + s]).collect::<Vec<f64>>();
                let expected = inverse_dynamics(&model, &mut single, &at(&q), &at(&dq), &at(&ddq)).to_vec();
                assert_close(&at(&tau), &expected, ROUNDING, level.name());
                let regressor = torque_regressor(&model, &mut single, &at(&q), &at(&dq), &at(&ddq));
                for joint in 0..dof {
                    let columns = layout.joint_columns(joint);
                    let count = model.inertial_count();
                    let mut row = vec![0.0; count];
                    for (place, &column) in columns.iter().enumerate() {
                        row[column] = panels.joint(joint)[place * samples + s];
                    }
                    assert_close(&row, &regressor[joint * count..(joint + 1) * count], ROUNDING, level.name());
                }
                // The same panels, one sample at a time.
                let mut sample = Panels::default();
                let (q, dq, ddq) = (at(&q), at(&dq), at(&ddq));
                let motion = JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq };
                let history = &mut TermHistory::default();
                regressor_panels_of_sample(&model, &mut single, &layout, &motion, history, &mut sample);
                for joint in 0..dof {
                    let count = layout.joint_columns(joint).len();
                    let column: Vec<f64> = (0..count).map(|place| panels.joint(joint)[place * samples + s]).collect();
                    assert_close(&sample.joint(joint)[..count], &column, ROUNDING, level.name());
                }
            }
        }
    }
}

#[test]
fn gravity_and_placements_follow_a_turned_base() {
    let model = random_tree(3, 5);
    let q = [0.1, -0.4, 0.9, 1.4, -2.0];
    let turned = model.clone().with_base_orientation(0.4, -0.2, 1.0).unwrap();
    let mut ws = Workspace::new(&model);
    // Potential energy depends on world heights: rotate all placements instead of gravity.
    let turn = dynident_model::Mat3::from_roll_pitch_yaw(0.4, -0.2, 1.0);
    let energy: f64 = body_placements(&model, &mut ws, &q)
        .iter()
        .zip(model.inertials())
        .map(|(place, inertial)| {
            let moment = place.rotation.mul_vec(inertial.first_moment()) + place.translation.scale(inertial.mass_kg());
            -model.gravity().dot(turn.mul_vec(moment))
        })
        .sum();
    assert!((potential_energy(&turned, &mut ws, &q) - energy).abs() < 1e-10);
}

#[test]
fn locked_joints_change_nothing_but_the_number_of_joints() {
    for Case { model, mut q, mut dq, mut ddq } in cases().filter(|case| case.model.dof() >= 3) {
        let held = model.dof() / 2;
        (dq[held], ddq[held]) = (0.0, 0.0);
        let mut ws = Workspace::new(&model);
        let mut expected = inverse_dynamics(&model, &mut ws, &q, &dq, &ddq).to_vec();
        let locked = model.locked(&[(model.joints()[held].name.clone(), q[held])]).unwrap();
        for vector in [&mut q, &mut dq, &mut ddq, &mut expected] {
            vector.remove(held);
        }
        let mut ws = Workspace::new(&locked);
        assert_close(inverse_dynamics(&locked, &mut ws, &q, &dq, &ddq), &expected, ROUNDING, "locked");
    }
}

#[test]
#[should_panic(expected = "another tree")]
fn workspaces_of_another_tree_are_refused() {
    // Same number of joints, other branches: the regressor's scratch would use the wrong paths.
    let (model, other) = (random_tree(2, 6), random_tree(5, 6));
    let parents = |model: &Model| model.joints().iter().map(|joint| joint.parent).collect::<Vec<_>>();
    assert_ne!(parents(&model), parents(&other), "choose seeds with different trees");
    let mut workspace = Workspace::new(&model);
    let zeros = [0.0; 6];
    let _ = torque_regressor(&other, &mut workspace, &zeros, &zeros, &zeros);
}

/// Mass matrix and bias of one call are bit-identical to those of two calls.
#[test]
fn equation_of_motion_equals_the_sum_of_its_terms() {
    for seed in 0..10 {
        let model = random_tree(seed, 1 + seed as usize);
        let dof = model.dof();
        for level in Level::available() {
            let mut workspace = Workspace::with_level(&model, level);
            let mut random = Random::new(seed);
            let mut vector = || (0..dof).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
            let (q, dq) = (vector(), vector());
            // Other content in the scratch.
            inverse_dynamics(&model, &mut workspace, &dq, &q, &q);
            let (matrix, bias) = mass_matrix_and_bias(&model, &mut workspace, &q, &dq);
            let (matrix, bias) = (matrix.to_vec(), bias.to_vec());
            assert_eq!(matrix, mass_matrix(&model, &mut workspace, &q));
            assert_eq!(bias, inverse_dynamics(&model, &mut workspace, &q, &dq, &vec![0.0; dof]));
        }
    }
}
