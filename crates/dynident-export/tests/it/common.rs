//! Robots with every exportable term, states, and the torque by numeric algorithms (regressor columns of the terms and
//! the dynamics over `f64`), which are independent of the graph.

use dynident_dynamics::{Workspace, forward_dynamics, gravity_torque, inverse_dynamics, mass_matrix};
use dynident_export::RobotModel;
use dynident_model::sample::Random;
use dynident_model::terms::{
    Coulomb, CoulombShape, Coupling, CouplingEffect, Declared, DeclaredLaw, Direction, DirectionalCoulomb,
    DirectionalViscous, DriveInertia, Expression, JointMotion, JointNames, Offset, Power, PowerExponent, Sigmoid,
    Stribeck, TemperatureViscous, TorqueTable, TorqueTerm, Viscous,
};
use dynident_model::{Model, Vec3, load_robot, read_urdf};
use dynident_testing::repository;
use std::process::Command;

/// Number of states in a comparison.
pub(crate) const STATES: usize = 1000;

/// Tolerance relative to the largest torque of a state: rounding of some thousand operations at a condition number of
/// ten.
pub(crate) const TOLERANCE: f64 = 1e-12;

/// A robot of the collection with a tilted base and one term of every exportable kind.
pub(crate) fn all_terms(name: &str) -> RobotModel {
    let model = load_robot(repository("robots").join(name)).unwrap().model;
    let model = model.with_gravity(Vec3([1.0, -3.0, -9.0])).unwrap();
    with_all_terms(model)
}

/// An expression with every function and operation, defined in all states and within all limits.
const ALL_FUNCTIONS: &str = "atan2(sin(q), 2 + cos(q2)) * sqrt(1 + q^2) + min(q, 0.5) * max(dq, -0.3)^3 + exp(-q^2) \
    + ln(8 + q) + asin(q / 8) * acos(dq2 / 8) - atan(q) + sinh(q / 2) - cosh(q / 3) + tanh(dq) + abs(q) + (8 + q)^1.5 \
    + tan(q / 8) + 1 / (8 + q)^2";

pub(crate) fn with_all_terms(model: Model) -> RobotModel {
    let last = model.dof() - 1;
    let smooth = CoulombShape::Smooth { width: 0.05 };
    let sign = CoulombShape::Sign { dead_band: 0.02 };
    let coupling = |name: &str, effect| {
        TorqueTerm::Coupling(Coupling { name: name.to_owned(), first: 0, second: last, ratios: [1.0, -0.5], effect })
    };
    let power = |exponent| TorqueTerm::Power(Power { joint: last, exponent, rounding: 1e-3 });
    let declared = |name: &str, joint, law| {
        let (name, unit) = (name.to_owned(), "Nm".to_owned());
        TorqueTerm::Declared(Declared { name, joint, law, unit, nominal: None, is_spring: false })
    };
    let expression = |own, text: &str| {
        DeclaredLaw::Expression(Expression::parse(text, &JointNames { own: Some(own), names: &[] }).unwrap())
    };
    // States exceed both ends.
    let points = vec![[-2.0, -3.0], [-1.1, -2.0], [-1.0, 0.5], [0.3, 0.5], [1.2, 2.0], [2.5, 1.0]];
    let table = TorqueTable::new(points).unwrap();
    let mut terms: Vec<(TorqueTerm, f64)> =
        (0..=last).map(|joint| (TorqueTerm::DriveInertia(DriveInertia { joint }), 0.7 + 0.1 * joint as f64)).collect();
    terms.extend((0..=last).map(|joint| (TorqueTerm::Offset(Offset { joint }), 0.3 - 0.2 * joint as f64)));
    terms.extend([
        (TorqueTerm::Viscous(Viscous { joint: 0 }), 5.0),
        (TorqueTerm::Coulomb(Coulomb { joint: 0, shape: smooth }), 4.0),
        (TorqueTerm::Coulomb(Coulomb { joint: last, shape: sign }), 2.0),
        (TorqueTerm::DirectionalViscous(DirectionalViscous { joint: 1, direction: Direction::Forward }), 3.0),
        (TorqueTerm::DirectionalViscous(DirectionalViscous { joint: 1, direction: Direction::Backward }), 2.0),
        (
            TorqueTerm::DirectionalCoulomb(DirectionalCoulomb {
                joint: 1,
                direction: Direction::Forward,
                shape: smooth,
            }),
            1.5,
        ),
        (
            TorqueTerm::DirectionalCoulomb(DirectionalCoulomb {
                joint: 1,
                direction: Direction::Backward,
                shape: sign,
            }),
            0.5,
        ),
        (TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.2, exponent: 2.0, shape: smooth }), 1.0),
        (TorqueTerm::Stribeck(Stribeck { joint: 1, speed: 0.3, exponent: 1.3, shape: sign }), 0.9),
        (TorqueTerm::Sigmoid(Sigmoid { joint: last, steepness: 12.0, offset_speed: 0.05 }), 1.1),
        (power(PowerExponent::CubeRoot), 0.8),
        (power(PowerExponent::Quadratic), 0.6),
        (TorqueTerm::TemperatureViscous(TemperatureViscous { joint: 0, reference_c: 25.0 }), 9.0),
        (coupling("a", CouplingEffect::Inertia), 0.2),
        (coupling("b", CouplingEffect::Viscous), 0.4),
        (coupling("c", CouplingEffect::Coulomb(sign)), 0.7),
        (declared("all_functions", 0, expression(0, ALL_FUNCTIONS)), 1.2),
        (declared("counterbalance", 1, expression(1, "sin(q - 0.3) + 0.2 * cos(q1)^2 - tanh(3 * q1) * dq / 2")), -2.5),
        (declared("spring", last, DeclaredLaw::Table(table)), 1.4),
    ]);
    let (terms, values) = terms.into_iter().unzip();
    RobotModel::new(model, terms, values).unwrap()
}

/// Two branches, a prismatic joint, and an axis that is not aligned with its frame.
pub(crate) fn tree() -> RobotModel {
    let link = |name: &str, x: f64| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="{x} 0.1 -0.05" rpy="0.1 0.2 0.3"/><mass value="2.5"/>
            <inertia ixx="0.03" iyy="0.02" izz="0.025" ixy="0.001" ixz="-0.002" iyz="0.0005"/></inertial></link>"#
        )
    };
    let joint = |name: &str, kind: &str, parent: &str, child: &str, rest: &str| {
        format!(
            r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{rest}
            <limit lower="-2" upper="2" velocity="3" effort="100"/></joint>"#
        )
    };
    let text = [
        r#"<robot name="2 branches"><link name="base"/>"#.to_owned(),
        link("trunk", 0.2),
        link("left", 0.3),
        link("right", -0.1),
        link("hand", 0.05),
        joint("turn", "revolute", "base", "trunk", r#"<origin xyz="0 0 0.3" rpy="0.2 0 0"/><axis xyz="0 0 1"/>"#),
        joint("slide", "prismatic", "trunk", "left", r#"<origin xyz="0.1 0.2 0" rpy="0 0.4 0"/><axis xyz="1 0 0"/>"#),
        joint("swing", "revolute", "trunk", "right", r#"<origin xyz="0 -0.2 0.1"/><axis xyz="0.6 0 0.8"/>"#),
        joint(
            "wrist",
            "revolute",
            "left",
            "hand",
            r#"<origin xyz="0.4 0 0" rpy="1.5707963267948966 0 0"/><axis xyz="0 1 0"/>"#,
        ),
        "</robot>".to_owned(),
    ];
    with_all_terms(read_urdf(&text.concat()).unwrap().model)
}

/// One state with the outputs of the numeric algorithms.
pub(crate) struct Expected {
    pub(crate) q: Vec<f64>,
    pub(crate) dq: Vec<f64>,
    pub(crate) ddq: Vec<f64>,
    pub(crate) tau: Vec<f64>,
    /// Inverse dynamics, gravity, Coriolis, friction, mass matrix, forward dynamics under `tau`, declared torques.
    pub(crate) outputs: [Vec<f64>; 7],
}

/// Torque of the terms from their regressor columns.
fn terms_torque(robot: &RobotModel, [q, dq, ddq]: [&[f64]; 3], wanted: impl Fn(&TorqueTerm) -> bool) -> Vec<f64> {
    let mut torque = vec![0.0; robot.model().dof()];
    let motion = JointMotion { samples: 1, q, dq, ddq };
    for (term, value) in robot.terms().filter(|(term, _)| wanted(term)) {
        for joint in term.joints() {
            let mut column = [0.0];
            term.column(joint, &motion, &mut column);
            torque[joint] += value * column[0];
        }
    }
    torque
}

pub(crate) fn expected(robot: &RobotModel) -> Vec<Expected> {
    let (model, dof) = (robot.model(), robot.model().dof());
    let mut workspace = Workspace::new(model);
    let mut random = Random::new(7);
    let rest = vec![0.0; dof];
    (0..STATES)
        .map(|state| {
            let mut vector = |size: f64| (0..dof).map(|_| random.uniform(-size, size)).collect::<Vec<f64>>();
            let (q, mut dq, ddq) = (vector(3.0), vector(2.0), vector(8.0));
            if state % 10 == 0 {
                // Zero velocity, and velocities within dead bands.
                let share = if state % 20 == 0 { 0.0 } else { 0.005 };
                for dq in &mut dq {
                    *dq *= share;
                }
            }
            let rigid = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq).to_vec();
            let gravity = gravity_torque(model, &mut workspace, &q).to_vec();
            let bias = inverse_dynamics(model, &mut workspace, &q, &dq, &rest).to_vec();
            let terms = terms_torque(robot, [&q, &dq, &ddq], |_| true);
            let friction = terms_torque(robot, [&q, &dq, &rest], |term| !term.is_declared());
            let mut mass = mass_matrix(model, &mut workspace, &q).to_vec();
            for (term, value) in robot.terms() {
                for row in 0..dof {
                    for column in 0..dof {
                        mass[row * dof + column] += value * term.mass_matrix_entry(row, column);
                    }
                }
            }
            let tau: Vec<f64> = rigid.iter().zip(&terms).map(|(rigid, terms)| rigid + terms).collect();
            let coriolis = bias.iter().zip(&gravity).map(|(bias, gravity)| bias - gravity).collect();
            let declared = terms_torque(robot, [&q, &dq, &rest], TorqueTerm::is_declared);
            let outputs = [tau.clone(), gravity, coriolis, friction, mass, ddq.clone(), declared];
            Expected { q, dq, ddq, tau, outputs }
        })
        .collect()
}

/// Rigid forward dynamics by another algorithm: an independent reference for robots without drives.
pub(crate) fn rigid_accelerations(model: &Model, state: &Expected) -> Vec<f64> {
    forward_dynamics(model, &mut Workspace::new(model), &state.q, &state.dq, &state.tau).to_vec()
}

pub(crate) fn has(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Runs a program on the states, one line each of q, dq, ddq, tau, and compares every number of every line that it
/// prints.
pub(crate) fn compare(program: &mut Command, robot: &RobotModel, states: &[Expected]) {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("states");
    let mut file = std::fs::File::create(&path).unwrap();
    for state in states {
        let numbers = [&state.q, &state.dq, &state.ddq, &state.tau].into_iter().flatten();
        let line: Vec<String> = numbers.map(|x| format!("{x:?}")).collect();
        writeln!(file, "{}", line.join(" ")).unwrap();
    }
    let output = program.stdin(std::fs::File::open(&path).unwrap()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), states.len());
    let names = ["inverse_dynamics", "gravity", "coriolis", "friction", "mass_matrix", "forward_dynamics", "declared"];
    // The scale is the torque of a moving state. For accelerations the rounding error grows by the condition number of
    // the mass matrix, some thousand for six joints with drives.
    for (number, (line, state)) in text.lines().zip(states).enumerate() {
        let mut found = line.split_whitespace().map(|word| word.parse::<f64>().unwrap());
        let scale = state.tau.iter().chain(&state.outputs[2]).fold(1.0, |most: f64, tau| most.max(tau.abs()));
        for (name, expected) in names.iter().zip(&state.outputs) {
            let tolerance = if *name == "forward_dynamics" { 1e-9 } else { TOLERANCE } * scale;
            for (place, &expected) in expected.iter().enumerate() {
                let found = found.next().unwrap();
                assert!(
                    (found - expected).abs() <= tolerance,
                    "{} state {number} {name}[{place}]: {found} for {expected}",
                    robot.model().name()
                );
            }
        }
        assert!(found.next().is_none());
    }
}
