//! A fit ends at the same motion from starts that are wrong by a factor of five.

use dynident_model::read_urdf;
use dynident_servo::{Drive, Run, Search, ServoRobot, ServoSettings, search, simulate, start_drives, unknowns};

const COUNT: f64 = core::f64::consts::TAU / 4096.0;

/// A servo with a weight: all of its size is the distance of the centre of mass.
const PENDULUM: &str = r#"<robot name="pendulum">
  <link name="bench"/>
  <link name="rod"><inertial><origin xyz="0 0 -0.1"/><mass value="0.35"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.0001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="swing" type="continuous"><parent link="bench"/><child link="rod"/><axis xyz="0 1 0"/></joint>
</robot>"#;

fn truth() -> ServoRobot {
    let drive = Drive {
        stiffness: 8.0,
        damping: 0.35,
        armature: 0.006,
        coulomb: 0.08,
        load_friction: 0.05,
        stribeck: 0.02,
        stribeck_speed: 0.1,
        torque_limit: f64::INFINITY,
        profile_acceleration: f64::INFINITY,
        profile_speed: f64::INFINITY,
        delay_s: 0.02,
        read_delay_s: 0.0,
        zero: 0.0,
    };
    ServoRobot { model: read_urdf(PENDULUM).unwrap().model, drives: vec![drive], floor: None }
}

/// Sines, then steps with rests.
fn recording(robot: &ServoRobot, step_s: f64) -> Run {
    let times_s: Vec<f64> = (0..1000).map(|k| 0.02 * f64::from(k)).collect();
    let command = |t: f64| {
        if t < 12.0 { 0.8 * (1.3 * t).sin() + 0.3 * (6.1 * t).sin() } else { 0.5 * ((0.7 * t).floor() % 3.0) - 0.4 }
    };
    let commands: Vec<Vec<f64>> = vec![times_s.iter().map(|&t| command(t)).collect()];
    let mut run = Run {
        name: "run".into(),
        positions: commands.clone(),
        commands,
        times_s,
        payloads: Vec::new(),
        gains: Vec::new(),
    };
    let positions = simulate(robot, &run, step_s).unwrap().unwrap();
    run.positions = positions.into_iter().map(|q| q.iter().map(|q| (q / COUNT).round() * COUNT).collect()).collect();
    run
}

fn fitted(drive: Drive, run: &Run, settings: &ServoSettings) -> Search {
    let nominal = ServoRobot { drives: vec![drive], ..truth() };
    let parameters = unknowns(&nominal, settings);
    search(&nominal, &parameters, &vec![0.0; parameters.len()], std::slice::from_ref(run), settings).unwrap()
}

#[test]
fn starts_within_a_factor_of_five_end_at_the_same_motion() {
    let (truth, settings) = (truth(), ServoSettings::default());
    let run = recording(&truth, settings.step_s);
    let start = start_drives(&truth.model, std::slice::from_ref(&run), &truth.drives, false)[0];
    let best = fitted(start, &run, &settings).errors[0];
    assert!(best < 0.5 * COUNT, "{best}");
    // All corners of stiffness, damping and armature, with friction and delay in turn.
    for corner in 0..8 {
        let factor = |bit: u32| if corner >> bit & 1 == 1 { 5.0 } else { 0.2 };
        let own = truth.drives[0];
        let drive = Drive {
            stiffness: factor(0) * own.stiffness,
            damping: factor(1) * own.damping,
            armature: factor(2) * own.armature,
            coulomb: factor(corner % 3) * own.coulomb,
            delay_s: if corner % 2 == 0 { 0.0 } else { 0.06 },
            ..own
        };
        let error = fitted(drive, &run, &settings).errors[0];
        assert!(error < 1.01 * best, "corner {corner}: {error} against {best}");
    }
}
