//! Nothing depends on the size of the robot or on units: the same motion of a robot a thousand times as heavy or a
//! hundred times as long gives the same model, scaled, with the same bars, choices and findings.

use super::common::{Job, repository};
use core::fmt::Write;
use dynident::IdentificationOutcome;
use dynident::result::{BaseParameterResult, StudyCheck};
use dynident::{RunOptions, Silent, check};

/// Factors of mass, length and time.
#[derive(Clone, Copy, Debug)]
struct Scale {
    mass: f64,
    length: f64,
    time: f64,
}

const AS_IT_IS: Scale = Scale { mass: 1.0, length: 1.0, time: 1.0 };

/// A watch gear and a crane; links of half a millimetre and of sixty metres. Time is not among them: the choice of the
/// cut-off looks at pieces of eight seconds. Nor are links of a kilometre, beside which a kilogram square metre counts
/// as rounding of the description.
fn scales() -> [Scale; 4] {
    let [watch, crane] = [1e-3, 1e3].map(|mass| Scale { mass, ..AS_IT_IS });
    let [short, long] = [1e-3, 1e2].map(|length| Scale { length, ..AS_IT_IS });
    [watch, crane, short, long]
}

impl Scale {
    /// Of a torque.
    fn torque(self) -> f64 {
        self.mass * (self.length / self.time).powi(2)
    }

    /// Of a parameter with this unit.
    fn of(self, unit: &str) -> f64 {
        match unit {
            "kg" => self.mass,
            "kg m" => self.mass * self.length,
            "kg m^2" => self.mass * self.length.powi(2),
            "Nm s/rad" => self.torque() * self.time,
            "Nm" => self.torque(),
            other => panic!("no factor for `{other}`"),
        }
    }

    fn urdf(self, text: &str) -> String {
        let Self { mass, length, time } = self;
        let moment = mass * length.powi(2);
        let mut text = times(text, "<mass value=\"", mass);
        for key in ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"] {
            text = times(&text, &format!(" {key}=\""), moment);
        }
        // Of an axis the length does not matter.
        text = times(&text, "xyz=\"", length);
        text = times(&text, "velocity=\"", time.recip());
        times(&text, "effort=\"", self.torque())
    }

    /// A recording of time, six positions and six torques.
    fn log(self, text: &str) -> String {
        let (head, rows) = text.split_once('\n').unwrap();
        let mut scaled = head.to_owned() + "\n";
        for row in rows.lines() {
            let numbers = row.split(',').enumerate().map(|(column, cell)| match column {
                0 => format!("{:e}", self.time * cell.parse::<f64>().unwrap()),
                1..7 => cell.to_owned(),
                _ => format!("{:e}", self.torque() * cell.parse::<f64>().unwrap()),
            });
            writeln!(scaled, "{}", numbers.collect::<Vec<_>>().join(",")).unwrap();
        }
        scaled
    }
}

/// The text with all numbers behind `key` times `factor`.
fn times(text: &str, key: &str, factor: f64) -> String {
    let mut parts = text.split(key);
    let mut scaled = parts.next().unwrap().to_owned();
    for part in parts {
        let (numbers, rest) = part.split_once('"').unwrap();
        let numbers = numbers.split_whitespace().map(|number| format!("{:e}", factor * number.parse::<f64>().unwrap()));
        write!(scaled, "{key}{}\"{rest}", numbers.collect::<Vec<_>>().join(" ")).unwrap();
    }
    scaled
}

/// The README's example on another scale. The width of the step of Coulomb friction is a velocity, which the study
/// states.
fn example(scale: Scale) -> (tempfile::TempDir, Job) {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read_to_string(repository(name)).unwrap();
    std::fs::write(folder.path().join("arm.urdf"), scale.urdf(&read("robots/ur10.urdf"))).unwrap();
    for name in ["train.csv", "test.csv"] {
        let log = scale.log(&read(&format!("examples/ur10_simulated/{name}")));
        std::fs::write(folder.path().join(name), log).unwrap();
    }
    let study = read("examples/ur10_simulated.toml")
        .replace(
            "file = \"../robots/ur10.urdf\"",
            &format!("file = \"arm.urdf\"\ngravity_m_s2 = [0.0, 0.0, {:e}]", -9.81 * scale.length / scale.time.powi(2)),
        )
        .replace("[drive]", &format!("[drive]\nfriction = \"stated\"\ncoulomb_width = {:e}", 0.02 / scale.time))
        .replace("ur10_simulated/", "");
    let job = Job::new(folder.path(), &study);
    (folder, job)
}

fn examined(scale: Scale) -> StudyCheck {
    let (_folder, job) = example(scale);
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    check(&job.study, &job.path, &options).unwrap().check
}

fn errors(found: &IdentificationOutcome) -> [f64; 2] {
    let held_out = &found.result.validation[0];
    let of = |report: &dynident::estimation::ValidationReport| report.relative_error_percent.unwrap();
    [of(&held_out.model), of(held_out.physical.as_ref().unwrap())]
}

/// What differs by more than its tolerance between a scale and the original.
struct Differences {
    scale: Scale,
    found: Vec<String>,
}

impl Differences {
    fn new(scale: Scale) -> Self {
        Self { scale, found: Vec::new() }
    }

    /// `found` against `expected` to `tolerance` of `size`.
    fn compare(&mut self, what: &str, (found, expected): (f64, f64), tolerance: f64) {
        if (found - expected).abs().is_nan() || (found - expected).abs() > tolerance {
            self.found.push(format!("{:?}: {what} {found} for {expected}", self.scale));
        }
    }

    fn equal<T: PartialEq + core::fmt::Debug>(&mut self, what: &str, found: &T, expected: &T) {
        if found != expected {
            self.found.push(format!("{:?}: {what} {found:?} for {expected:?}", self.scale));
        }
    }
}

/// Review of trust, section 1: the exported model went from 0.953 to 32.7 % on the robot a thousand times as heavy.
/// 1e-6 is what the solver's own tolerance leaves of a relative error.
#[test]
fn a_crane_and_a_watch_are_identified_alike() {
    const TOLERANCE: f64 = 1e-6;
    let expected = example(AS_IT_IS).1.identify();
    let mut all = Vec::new();
    for scale in scales() {
        let found = example(scale).1.identify();
        let mut differences = Differences::new(scale);
        for (found, expected) in errors(&found).into_iter().zip(errors(&expected)) {
            differences.compare("held-out error", (found, expected), TOLERANCE * expected);
        }
        for (found, expected) in found.result.base_parameters.iter().zip(&expected.result.base_parameters) {
            let factor = scale.of(&expected.unit);
            // In units of the parameter's own bar where it is near zero.
            let within = TOLERANCE * (expected.value.abs() + expected.std);
            let physical = |parameter: &BaseParameterResult| parameter.physical.unwrap();
            differences.compare(&expected.symbol, (found.value / factor, expected.value), within);
            differences.compare(&expected.symbol, (found.std / factor, expected.std), TOLERANCE * expected.std);
            differences.compare(&expected.symbol, (physical(found) / factor, physical(expected)), within);
            differences.equal("excited", &found.excited, &expected.excited);
        }
        for (found, expected) in found.result.bodies.iter().zip(&expected.result.bodies) {
            differences.equal("sources", &found.sources, &expected.sources);
        }
        differences.equal("problems", &found.result.problems, &expected.result.problems);
        let findings = |of: &IdentificationOutcome| of.result.check.as_ref().map(|check| check.findings.clone());
        differences.equal("findings", &findings(&found), &findings(&expected));
        all.extend(differences.found);
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// The score agrees to the accuracy that readings are compared with, a hundredth.
#[test]
fn a_crane_and_a_watch_are_examined_alike() {
    let expected = examined(AS_IT_IS);
    let mut all = Vec::new();
    for scale in scales() {
        let found = examined(scale);
        let mut differences = Differences::new(scale);
        let score = |check: &StudyCheck| check.as_written.as_ref().unwrap().score;
        differences.compare("score", (score(&found), score(&expected)), 1e-2 * score(&expected).abs());
        differences.equal("findings", &found.findings, &expected.findings);
        all.extend(differences.found);
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}
