//! Friction laws compared with differences, limits and known values.
use dynident_lanes::Dual;
use dynident_model::CharacteristicScale;
use dynident_model::terms::{
    CandidateJoint, CandidateLaw, Coulomb, CoulombShape, Coupling, CouplingEffect, Direction, DirectionalCoulomb,
    DirectionalViscous, DriveInertia, HysteresisState, JointMotion, LoadFriction, MaxwellSlip, Offset, Power,
    PowerExponent, Sigmoid, StatedJoint, Stribeck, TemperatureCoulomb, TemperatureViscous, TermAction, TermInput,
    TorqueTerm, VelocityCurve, Viscous,
};

const STEP: CoulombShape = CoulombShape::Smooth { width: 0.05 };

fn column(term: &TorqueTerm, dq: &[f64]) -> Vec<f64> {
    let zeros = vec![0.0; dq.len()];
    let motion = JointMotion { samples: dq.len(), q: &zeros, dq, ddq: &zeros };
    let mut out = vec![f64::NAN; dq.len()];
    term.column(0, &motion, &mut out);
    out
}

fn terms_of_velocity() -> Vec<TorqueTerm> {
    let joint = 0;
    let mut terms = vec![
        TorqueTerm::Viscous(Viscous { joint }),
        TorqueTerm::Coulomb(Coulomb { joint, shape: STEP }),
        TorqueTerm::Sigmoid(Sigmoid { joint, steepness: 30.0, offset_speed: 0.02 }),
        TorqueTerm::Power(Power { joint, exponent: PowerExponent::CubeRoot, rounding: 1e-2 }),
        TorqueTerm::Power(Power { joint, exponent: PowerExponent::Quadratic, rounding: 1e-2 }),
    ];
    for direction in [Direction::Forward, Direction::Backward] {
        terms.push(TorqueTerm::DirectionalViscous(DirectionalViscous { joint, direction }));
        terms.push(TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint, direction, shape: STEP }));
    }
    for exponent in [0.7, 1.0, 2.0] {
        terms.push(TorqueTerm::Stribeck(Stribeck { joint, speed: 0.1, exponent, shape: STEP }));
    }
    terms
}

/// One law of every kind and shape, of joint 0 or of joints 0 and 1.
fn terms_of_all_kinds() -> Vec<TorqueTerm> {
    let (joint, reference_c) = (0, 20.0);
    let mut terms = terms_of_velocity();
    for shape in [STEP, CoulombShape::Sign { dead_band: 0.0 }] {
        terms.extend([
            TorqueTerm::Coulomb(Coulomb { joint, shape }),
            TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint, direction: Direction::Backward, shape }),
            TorqueTerm::Stribeck(Stribeck { joint, speed: 0.1, exponent: 1.5, shape }),
            TorqueTerm::Load(LoadFriction { joint, shape }),
            TorqueTerm::TemperatureCoulomb(TemperatureCoulomb { joint, reference_c, shape }),
        ]);
    }
    terms.extend([
        TorqueTerm::TemperatureViscous(TemperatureViscous { joint, reference_c }),
        TorqueTerm::MaxwellSlip(MaxwellSlip { joint, yield_displacement: 0.1 }),
        TorqueTerm::Offset(Offset { joint }),
        TorqueTerm::DriveInertia(DriveInertia { joint }),
    ]);
    let coupling =
        |effect| TorqueTerm::Coupling(Coupling { name: "m".into(), first: 0, second: 1, ratios: [1.5, -0.5], effect });
    terms.extend([CouplingEffect::Inertia, CouplingEffect::Viscous, CouplingEffect::Coulomb(STEP)].map(coupling));
    terms
}

/// The simulated torque of a law equals its regressor column.
#[test]
fn columns_equal_the_simulated_torque() {
    let (q, dq, ddq) = ([0.3, -0.2], [0.07, 0.4], [2.0, -3.0]);
    let motion = JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq };
    let load = 7.0;
    for term in terms_of_all_kinds() {
        let joints = term.joints();
        for &row in &joints {
            let mut out = [f64::NAN];
            let mut memory = HysteresisState::default();
            let mut input = TermInput { load: Some(&[load]), temperature_c: None, memory: &mut memory };
            term.column_following(row, &motion, &mut input, &mut out);
            let across = |x: &[f64; 2]| x[*joints.iter().rfind(|&&other| other != row).unwrap_or(&row)];
            let expected = match term.action() {
                TermAction::State(_) => unreachable!("the test of declared torques has them"),
                TermAction::Inertia { factor } => factor * across(&ddq),
                TermAction::Damping { factor } => factor * across(&dq),
                TermAction::Constant => 1.0,
                // An undeflected spring, and a joint at its reference temperature.
                TermAction::Hysteresis | TermAction::Temperature => 0.0,
                TermAction::Friction(friction) => {
                    let speed: f64 = joints.iter().zip(friction.ratios).map(|(&joint, ratio)| ratio * dq[joint]).sum();
                    let curve = match friction.curve {
                        VelocityCurve::Step { forward, backward } => {
                            f64::from(forward && speed > 0.0) - f64::from(backward && speed < 0.0)
                        }
                        VelocityCurve::Smooth(function) => function.value(speed),
                    };
                    let faded = friction.fading.map_or(1.0, |[v, delta]| (-(speed / v).abs().powf(delta)).exp());
                    let share = joints.iter().zip(friction.ratios).find(|(joint, _)| **joint == row).unwrap().1;
                    share * curve * faded * if friction.by_load { load } else { 1.0 }
                }
            };
            assert!((out[0] - expected).abs() < 1e-14, "{term:?} in row {row}: {} {expected}", out[0]);
            let across_entry =
                term.mass_matrix_entry(row, *joints.iter().rfind(|&&other| other != row).unwrap_or(&row));
            assert_eq!(across_entry != 0.0, matches!(term.action(), TermAction::Inertia { .. }), "{term:?}");
            assert_eq!(term.functions().is_empty(), !term.is_friction(), "{term:?}");
        }
    }
}

#[test]
fn slopes_equal_central_differences() {
    let speeds: Vec<f64> = (-40..40).map(|k| 0.013 * (f64::from(k) + 0.5)).collect();
    let h = 1e-5;
    let moved = |by: f64| speeds.iter().map(|dq| dq + by).collect::<Vec<_>>();
    let zeros = vec![0.0; speeds.len()];
    let motion = JointMotion { samples: speeds.len(), q: &zeros, dq: &speeds, ddq: &zeros };
    for term in terms_of_velocity() {
        let (more, less) = (column(&term, &moved(h)), column(&term, &moved(-h)));
        let [mut by_q, mut by_dq, mut by_ddq] = [zeros.clone(), zeros.clone(), zeros.clone()];
        let gradient = [&mut by_q[..], &mut by_dq[..], &mut by_ddq[..]];
        term.apply_adjoint(0, &motion, &vec![2.0; speeds.len()], gradient);
        for k in 0..speeds.len() {
            let expected = 2.0 * (more[k] - less[k]) / (2.0 * h);
            // Error h² times a third derivative of about 1/(0.006)³, at velocities half a step from rest.
            let tolerance = 1e-3 * (1.0 + expected.abs());
            assert!((by_dq[k] - expected).abs() <= tolerance, "{term:?} at {}: {} {expected}", speeds[k], by_dq[k]);
            assert!(by_q[k] == 0.0 && by_ddq[k] == 0.0);
        }
    }
}

#[test]
fn friction_is_finite_and_dissipative() {
    let speeds = [0.0, 1e-300, -1e-300, 1e-9, 1.0, -1.0, 1e6, -1e6];
    let zeros = [0.0; 8];
    for term in terms_of_velocity() {
        let motion = JointMotion { samples: 8, q: &zeros, dq: &speeds, ddq: &zeros };
        let [mut by_q, mut by_dq, mut by_ddq] = [zeros; 3];
        term.apply_adjoint(0, &motion, &[1.0; 8], [&mut by_q, &mut by_dq, &mut by_ddq]);
        for ((value, slope), dq) in column(&term, &speeds).iter().zip(by_dq).zip(speeds) {
            assert!(value.is_finite() && slope.is_finite() && value * dq >= 0.0, "{term:?} at {dq}: {value} {slope}");
        }
    }
}

#[test]
fn both_directions_together_are_the_symmetric_term() {
    let speeds = [-0.4, -0.01, 0.0, 0.02, 1.3];
    let sum = |make: &dyn Fn(Direction) -> TorqueTerm| -> Vec<f64> {
        let (a, b) = (column(&make(Direction::Forward), &speeds), column(&make(Direction::Backward), &speeds));
        a.iter().zip(&b).map(|(a, b)| a + b).collect()
    };
    let viscous = sum(&|direction| TorqueTerm::DirectionalViscous(DirectionalViscous { joint: 0, direction }));
    assert_eq!(viscous, speeds);
    let coulomb =
        sum(&|direction| TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint: 0, direction, shape: STEP }));
    assert_eq!(coulomb, column(&TorqueTerm::Coulomb(Coulomb { joint: 0, shape: STEP }), &speeds));
}

#[test]
fn known_values() {
    // The sigmoid with φ₃ = 0 is half a smooth step of width 2/φ₂.
    let speeds = [-0.3, -0.02, 0.0, 0.05];
    let sigmoid = column(&TorqueTerm::Sigmoid(Sigmoid { joint: 0, steepness: 40.0, offset_speed: 0.0 }), &speeds);
    for (value, dq) in sigmoid.iter().zip(speeds) {
        assert!((value - 0.5 * (dq / 0.05).tanh()).abs() < 1e-14);
    }
    // At the Stribeck velocity, the share 1/e remains.
    let shape = CoulombShape::Sign { dead_band: 0.0 };
    let stribeck = TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.05, exponent: 1.6, shape });
    assert!((column(&stribeck, &[-0.05])[0] + (-1.0_f64).exp()).abs() < 1e-14);
    let root = TorqueTerm::Power(Power { joint: 0, exponent: PowerExponent::CubeRoot, rounding: 1e-6 });
    assert!((column(&root, &[-8.0])[0] + 2.0).abs() < 1e-9);
    let square = TorqueTerm::Power(Power { joint: 0, exponent: PowerExponent::Quadratic, rounding: 1e-6 });
    assert!((column(&square, &[-3.0])[0] + 9.0).abs() < 1e-9);
}

#[test]
fn friction_by_load() {
    let term = TorqueTerm::Load(LoadFriction { joint: 0, shape: CoulombShape::Sign { dead_band: 0.0 } });
    let zeros = [0.0; 3];
    let motion = JointMotion { samples: 3, q: &zeros, dq: &[1.0, -2.0, 0.0], ddq: &zeros };
    let mut out = [f64::NAN; 3];
    term.column_following(
        0,
        &motion,
        &mut TermInput { load: Some(&[-5.0, -7.0, 9.0]), temperature_c: None, memory: &mut HysteresisState::default() },
        &mut out,
    );
    assert_eq!(out, [5.0, -7.0, 0.0]);
    term.column(0, &motion, &mut out);
    assert_eq!(out, zeros);
}

#[test]
fn maxwell_slip_follows_masing_loops_across_blocks() {
    let limit = 0.1;
    let term = TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 0, yield_displacement: limit });
    // Forward by three yield displacements, back by one, back by three, forward again.
    let q: Vec<f64> = [0.0, 0.05, 0.1, 0.3, 0.2, 0.1, -0.1, 0.0].to_vec();
    let expected = [0.0, 0.5, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0];
    let zeros = vec![0.0; q.len()];
    let mut whole = vec![f64::NAN; q.len()];
    term.column(0, &JointMotion { samples: q.len(), q: &q, dq: &zeros, ddq: &zeros }, &mut whole);
    for (value, expected) in whole.iter().zip(expected) {
        // Tolerance: differences of positions below one.
        assert!((value - expected).abs() < 1e-14, "{whole:?}");
    }
    for split in 0..=q.len() {
        let (mut memory, mut parts) = (HysteresisState::default(), vec![f64::NAN; q.len()]);
        for range in [0..split, split..q.len()] {
            let samples = range.len();
            let motion = JointMotion { samples, q: &q[range.clone()], dq: &zeros[..samples], ddq: &zeros[..samples] };
            term.column_following(
                0,
                &motion,
                &mut TermInput { load: None, temperature_c: None, memory: &mut memory },
                &mut parts[range],
            );
        }
        assert_eq!(parts, whole);
        memory.restart();
        assert_eq!(memory, HysteresisState::default());
    }
}

#[test]
fn friction_changes_with_the_temperature_about_its_reference() {
    let (speeds, temperature) = ([0.4, -0.4, 0.0, 1.0], [25.0, 35.0, 35.0, 15.0]);
    let motion = JointMotion { samples: 4, q: &[0.0; 4], dq: &speeds, ddq: &[0.0; 4] };
    let shape = CoulombShape::Sign { dead_band: 0.0 };
    let viscous = TorqueTerm::TemperatureViscous(TemperatureViscous { joint: 0, reference_c: 25.0 });
    let coulomb = TorqueTerm::TemperatureCoulomb(TemperatureCoulomb { joint: 0, reference_c: 25.0, shape });
    for (term, expected) in [(&viscous, [0.0, -4.0, 0.0, -10.0]), (&coulomb, [0.0, -10.0, 0.0, -10.0])] {
        let mut out = [1.0; 4];
        let mut input =
            TermInput { load: None, temperature_c: Some(&temperature), memory: &mut HysteresisState::default() };
        term.column_following(0, &motion, &mut input, &mut out);
        assert_eq!(out, expected, "{}", term.symbol());
        // Without a temperature the joint is at the reference temperature.
        term.column(0, &motion, &mut out);
        assert_eq!(out, [0.0; 4]);
        assert!(term.needs_temperature() && term.is_joint_friction() && !term.is_nonnegative());
    }
    assert_eq!((&viscous.symbol()[..], viscous.unit()), ("fvT1", "Nm s/(rad K)"));
    assert_eq!((&coulomb.symbol()[..], coulomb.unit()), ("fcT1", "Nm/K"));
}

#[test]
fn coordinates_set_the_constants() {
    const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };
    let stribeck = |shape| TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.1, exponent: 1.5, shape });
    let sigmoid = TorqueTerm::Sigmoid(Sigmoid { joint: 0, steepness: 40.0, offset_speed: 0.01 });
    let coulomb = TorqueTerm::Coulomb(Coulomb { joint: 0, shape: STEP });
    for term in [stribeck(STEP), stribeck(SIGN), sigmoid, coulomb] {
        let own = term.kind().coordinates();
        let back = term.at(&own, 1.0).kind().coordinates();
        // Tolerance: rounding error of logarithm and exponential.
        assert!(own.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-12) && own.len() == back.len(), "{term:?}");
    }
    // A change of one coordinate changes only the named constant.
    let names = ["speed", "exponent"];
    let own = stribeck(STEP).kind().coordinates();
    for (place, name) in names.into_iter().enumerate() {
        let mut moved = own.clone();
        moved[place] += 0.5;
        let values: Vec<_> = (0..2).map(|place| stribeck(STEP).constant_at(place, &moved, 1.0)).collect();
        assert!(values.iter().map(|(name, _)| *name).eq(names), "{values:?}");
        let ratio = values[place].1 / stribeck(STEP).constant_at(place, &own, 1.0).1;
        assert!((ratio - 0.5_f64.exp()).abs() < 1e-12, "{name}: {ratio}");
    }
}

/// Generated code and simulation use the same expression as the column.
#[test]
fn torque_over_any_scalar_is_the_column() {
    for term in terms_of_velocity() {
        for dq in [-0.3, -0.02, 0.0, 0.004, 0.7] {
            let (number, dual) = (term.torque(0, &[dq]).unwrap(), term.torque(0, &[Dual::variable(dq)]).unwrap());
            assert_eq!(dual.value, number);
            // Tangent and exponential of lanes are accurate to 4 units in the last place.
            assert!((column(&term, &[dq])[0] - number).abs() < 1e-14, "{term:?} {dq}");
        }
    }
    for term in terms_of_all_kinds() {
        let needs_more = term.needs_load() || term.has_memory();
        assert_eq!(term.torque(0, &[0.1, 0.2]).is_err(), needs_more, "{term:?}");
    }
}

/// Every candidate can be stated in a study, and has a unique name and place.
#[test]
fn every_candidate_can_be_stated() {
    let joint = CandidateJoint {
        joint: 0,
        velocity: 1.0,
        position: 1.0,
        alone: vec![STEP],
        widths: vec![0.01, 0.05],
        width: 0.02,
    };
    let mut ranks: Vec<_> = TorqueTerm::candidates().map(CandidateLaw::rank).collect();
    ranks.sort_unstable();
    ranks.dedup();
    assert_eq!(ranks.len(), TorqueTerm::candidates().count());
    for law in TorqueTerm::candidates() {
        for term in (law.grid)(&joint).into_iter().flat_map(|point| point.terms) {
            assert_eq!(term.candidate(), Some(law));
            let constants = term.kind().coordinates().len();
            assert!(constants == law.constants || law.constants == 0, "{term:?}");
            // Viscous and Coulomb friction have separate keys.
            let Some(stated) = term.kind().stated() else {
                assert!(term.property().is_some(), "{term:?}");
                continue;
            };
            assert_eq!(stated.law().check(), Ok(()));
            let own = StatedJoint {
                joint: 0,
                step: term.step().unwrap_or(STEP),
                is_rotary: true,
                scale: CharacteristicScale::USUAL,
            };
            assert!(stated.law().terms(&own).contains(&term), "{term:?}");
        }
    }
}
