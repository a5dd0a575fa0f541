//! Correct logs of slow robots with unmodelled friction and usual errors of their descriptions.

use super::{check_text, problems, study_of};
use crate::common::{Motion, Random, Truth, header, repository};
use core::f64::consts::PI;
use dynident::dynamics::{Workspace, inverse_dynamics, mass_matrix};
use dynident::result::CheckFinding;
use std::fmt::Write;
use std::path::Path;

const ROBOTS: [&str; 5] = ["ur10", "panda_arm7", "iiwa14", "tx40", "planar2r"];
/// Peak velocities, rad/s: friction dominates at the lowest, rigid bodies at the highest.
const VELOCITIES: [f64; 4] = [0.5, 0.8, 1.2, 2.0];
/// Widths of friction steps, rad/s; the default of a study is 0.02.
const WIDTHS: [f64; 5] = [0.002, 0.01, 0.03, 0.05, 0.1];
const RATES_HZ: [f64; 4] = [50.0, 100.0, 125.0, 250.0];
const SECONDS: [f64; 3] = [15.0, 20.0, 30.0];

/// Cases with placeholder inertials.
const PLACEHOLDERS: [usize; 6] = [0, 1, 2, 5, 6, 7];

/// Gear ratio of motors whose positions are logged.
const GEAR_RATIO: f64 = 101.0;

struct Drive {
    inertia: f64,
    viscous: f64,
    /// Coulomb friction, forward and backward.
    coulomb: [f64; 2],
    /// Coulomb friction per Nm of rigid-body torque.
    load: f64,
    /// Stribeck friction: amplitude and velocity.
    stribeck: [f64; 2],
    offset: f64,
}

impl Drive {
    /// Friction of one of four laws, scaled to the torque of the joint.
    fn new(law: usize, torque: f64, inertia: f64, random: &mut Random) -> Self {
        let coulomb = torque * (0.15 + 0.08 * random.next());
        let asymmetry = if law == 1 { 0.2 + 0.05 * random.next() } else { 0.0 };
        Self {
            inertia: inertia * (0.5 + 0.3 * random.next()),
            viscous: torque * (0.12 + 0.05 * random.next()),
            coulomb: [coulomb * (1.0 + asymmetry), coulomb * (1.0 - asymmetry)],
            load: if law == 2 { 0.1 + 0.05 * random.next() } else { 0.0 },
            stribeck: [if law == 3 { 0.6 * coulomb } else { 0.0 }, 0.08 + 0.04 * random.next()],
            offset: 0.15 * coulomb * random.next(),
        }
    }

    fn torque(&self, bodies: f64, dq: f64, ddq: f64, width: f64) -> f64 {
        let step = (dq / width).tanh();
        let [falling, velocity] = self.stribeck;
        let dry =
            self.coulomb[usize::from(dq < 0.0)] + self.load * bodies.abs() + falling * (-(dq / velocity).powi(2)).exp();
        bodies + self.inertia * ddq + self.viscous * dq + dry * step + self.offset
    }
}

/// Root mean square of the rigid-body torque in a motion, and of the diagonal of the mass matrix.
fn sizes(truth: &Truth, motion: &Motion) -> Vec<[f64; 2]> {
    let mut workspace = Workspace::new(&truth.model);
    let mut squares = vec![[0.0; 2]; truth.model.dof()];
    for k in 0..200 {
        let [q, dq, ddq] = motion.at(0.05 * f64::from(k));
        let torque = inverse_dynamics(&truth.model, &mut workspace, &q, &dq, &ddq).to_vec();
        let mass = mass_matrix(&truth.model, &mut workspace, &q).to_vec();
        for (j, square) in squares.iter_mut().enumerate() {
            square[0] += torque[j].powi(2) / 200.0;
            square[1] += mass[j * torque.len() + j].powi(2) / 200.0;
        }
    }
    squares.into_iter().map(|square| square.map(f64::sqrt)).collect()
}

fn honest(folder: &Path, case: usize) -> String {
    let mut random = Random(9_000 + case as u64);
    let mut one_of = |values: &[f64]| values[((random.next() + 1.0) * 0.5 * values.len() as f64) as usize];
    let (velocity, width) = (one_of(&VELOCITIES), one_of(&WIDTHS));
    let (rate_hz, seconds, noise) = (one_of(&RATES_HZ), one_of(&SECONDS), one_of(&[0.01, 0.02, 0.05]));
    let position_noise = one_of(&[1e-6, 1e-5, 3e-5]);
    let law = one_of(&[0.0, 1.0, 2.0, 3.0]) as usize;
    let description = repository(&format!("robots/{}.urdf", ROBOTS[case % ROBOTS.len()]));
    let truth = Truth::other(&description, &mut random);
    let dof = truth.model.dof();
    let motion = |seed: u64| Motion::within(&truth.model, velocity, 1_000 * case as u64 + seed);
    let sizes = sizes(&truth, &motion(1));
    let weakest = 0.02 * sizes.iter().map(|size| size[0]).fold(0.0, f64::max);
    let drives: Vec<Drive> =
        sizes.iter().map(|[torque, mass]| Drive::new(law, torque.max(weakest), *mass, &mut random)).collect();
    let mut workspace = Workspace::new(&truth.model);
    for (name, seed) in [("train.csv", 1), ("test.csv", 2)] {
        let motion = motion(seed);
        let mut text = header(dof) + "\n";
        for k in 0..(rate_hz * seconds) as usize {
            let t = k as f64 / rate_hz;
            let [q, dq, ddq] = motion.at(t);
            let bodies = inverse_dynamics(&truth.model, &mut workspace, &q, &dq, &ddq).to_vec();
            write!(text, "{t}").unwrap();
            for q in &q {
                write!(text, ",{:.9}", q + position_noise * random.normal()).unwrap();
            }
            for (j, drive) in drives.iter().enumerate() {
                let tau = drive.torque(bodies[j], dq[j], ddq[j], width);
                write!(text, ",{:.6}", tau + noise * sizes[j][0].max(weakest) * random.normal()).unwrap();
            }
            text.push('\n');
        }
        std::fs::write(folder.join(name), text).unwrap();
    }
    study_of(&description, dof, &["train.csv", "test.csv"])
}

/// Of 200 such studies 39 once gave false alarms: other robots, rates, position units, gains.
#[test]
fn slow_logs_with_friction_of_their_own_raise_no_alarm() {
    let mut alarms = String::new();
    for case in 0..dynident_testing::count(10, 200) {
        let folder = tempfile::tempdir().unwrap();
        let study = honest(folder.path(), case);
        for (_, sentence) in problems(&check_text(folder.path(), &study)) {
            writeln!(alarms, "{case}: {sentence}").unwrap();
        }
    }
    assert!(alarms.is_empty(), "{alarms}");
}

/// Placeholder inertials of 1 kg and 1 kg m² must not lead to proposals that compensate for them.
#[test]
fn placeholders_are_no_other_rate() {
    for case in PLACEHOLDERS {
        let folder = tempfile::tempdir().unwrap();
        let study = honest(folder.path(), case);
        let file = study.split("file = \"").nth(1).unwrap().split('"').next().unwrap();
        let mut description = std::fs::read_to_string(file).unwrap();
        for (attribute, value) in [("mass value=\"", "1.0"), ("ixx=\"", "1.0"), ("iyy=\"", "1.0"), ("izz=\"", "1.0")] {
            description = with_all(&description, attribute, value);
        }
        for attribute in ["ixy=\"", "ixz=\"", "iyz=\""] {
            description = with_all(&description, attribute, "0.0");
        }
        std::fs::write(folder.path().join("placeholders.urdf"), description).unwrap();
        let check = check_text(folder.path(), &study.replace(file, "placeholders.urdf"));
        let of_time =
            check.findings.iter().flat_map(|finding| &finding.write).any(|change| change.table == "format.time");
        assert!(!of_time, "{case}: {:?}", problems(&check));
    }
}

/// Motor-side positions of a slow UR10: half of the scale was once proposed without a note about its uncertainty,
/// because a smaller scale makes a wide friction step narrow.
#[test]
fn positions_of_the_motors_side_have_their_gear_ratio() {
    let cases = dynident_testing::count(3, 40);
    let mut wrong = String::new();
    for case in (0..cases).map(|number| number * ROBOTS.len()) {
        let folder = tempfile::tempdir().unwrap();
        let study = honest(folder.path(), case);
        for log in ["train.csv", "test.csv"] {
            let path = folder.path().join(log);
            std::fs::write(&path, of_motors_side(&std::fs::read_to_string(&path).unwrap())).unwrap();
        }
        let check = check_text(folder.path(), &study);
        let of_positions = |finding: &&CheckFinding| finding.write.iter().any(|line| line.table == "format.position");
        let Some(found) = check.findings.iter().find(of_positions) else {
            writeln!(wrong, "{case}: {:?}", problems(&check)).unwrap();
            continue;
        };
        let line = &found.write[0].line;
        let value = line.split_once("   #").map_or(&line[..], |(value, _)| value);
        let scale = if line.contains("deg") { PI / 180.0 } else { value.rsplit(' ').next().unwrap().parse().unwrap() };
        let [least, greatest] = numbers_between(&found.evidence).unwrap_or([0.9 * scale, 1.1 * scale]);
        // Ranges from slow logs extend to twice and half of the truth.
        if !(least..=greatest).contains(&GEAR_RATIO.recip()) || !(0.5..2.0).contains(&(GEAR_RATIO * scale)) {
            writeln!(wrong, "{case}: {scale}, {}", found.evidence).unwrap();
        }
    }
    // The range is not a confidence interval: of 40, two miss the truth by a few hundredths, and in one case another
    // finding comes first.
    assert!(wrong.lines().count() <= cases / 10, "{wrong}");
}

/// A wrong rate is named with its factor, or with a range that contains it. Ten was once the answer for every rate.
#[test]
fn another_rate_has_its_range() {
    let (cases, factors) = (dynident_testing::count(3, 30), [4.0, 0.25, 5.0]);
    let mut wrong = String::new();
    let mut named = 0;
    for case in 0..cases {
        let folder = tempfile::tempdir().unwrap();
        let study = honest(folder.path(), case);
        let log = std::fs::read_to_string(folder.path().join("train.csv")).unwrap();
        let second: f64 = log.lines().nth(2).unwrap().split(',').next().unwrap().parse().unwrap();
        let factor = factors[case % factors.len()];
        let time = "time = { column = \"t\" }";
        assert!(study.contains(time), "{study}");
        let check = check_text(folder.path(), &study.replace(time, &format!("rate_hz = {:.3}", factor / second)));
        let found = problems(&check);
        let Some((_, text)) = found.iter().find(|(_, text)| text.contains("another rate")) else { continue };
        named += 1;
        let (_, rest) = text.split_once("time stamps by ").unwrap();
        let number: f64 = rest.split(' ').next().unwrap().parse().unwrap();
        let [least, greatest] = numbers_between(text).unwrap_or([0.95 * number, 1.05 * number]);
        if !(least..=greatest).contains(&factor) {
            writeln!(wrong, "{case}: {factor}, {text}").unwrap();
        }
    }
    assert!(wrong.is_empty() && named > 0, "{named} of {cases}: {wrong}");
}

fn numbers_between(text: &str) -> Option<[f64; 2]> {
    let (_, rest) = text.split_once("between ")?;
    let (least, rest) = rest.split_once(" and ")?;
    Some([least, rest.split(':').next()?].map(|number| number.parse().unwrap()))
}

fn of_motors_side(log: &str) -> String {
    let mut lines = log.lines();
    let header = lines.next().unwrap();
    let is_position: Vec<bool> = header.split(',').map(|name| name.starts_with('q')).collect();
    let mut text = header.to_owned() + "\n";
    for line in lines {
        let value = |(text, is_position): (&str, &bool)| {
            if *is_position { format!("{:.7}", GEAR_RATIO * text.parse::<f64>().unwrap()) } else { text.to_owned() }
        };
        let values: Vec<String> = line.split(',').zip(&is_position).map(value).collect();
        text += &(values.join(",") + "\n");
    }
    text
}

fn with_all(description: &str, attribute: &str, value: &str) -> String {
    let mut parts = description.split(attribute);
    let first = parts.next().unwrap().to_owned();
    parts.fold(first, |text, part| text + attribute + value + "\"" + part.split_once('"').unwrap().1)
}
