//! Results do not depend on the size of the robot or on units: the same motion of a robot a thousand times as heavy or
//! long gives the same scaled model, error bars, choices and findings.

mod check;
mod crane;
mod design;
mod identify;
mod iterate;

use crate::common::{Job, repository};
use core::fmt::Write;

#[derive(Clone, Copy, Debug)]
struct Scale {
    mass: f64,
    length: f64,
    time: f64,
}

const AS_IT_IS: Scale = Scale { mass: 1.0, length: 1.0, time: 1.0 };

/// Factors of 1000 and 0.001 in mass, length and time: from a watch gear to a crane, links of 0.5 mm to 500 m, motions
/// of ms to hours. By default two scales of all three and those of time; one by one in long tests.
fn scales_by(less: f64, more: f64) -> Vec<Scale> {
    let mixed =
        [Scale { mass: less, length: more, time: more }, Scale { mass: more, length: less, time: less }].into_iter();
    let slow = [less, more].map(|time| Scale { time, ..AS_IT_IS });
    let heavy = [less, more].map(|mass| Scale { mass, ..AS_IT_IS });
    let long = [less, more].map(|length| Scale { length, ..AS_IT_IS });
    mixed.chain(slow).chain(heavy).chain(long).take(dynident_testing::count(4, 8)).collect()
}

fn scales() -> Vec<Scale> {
    scales_by(1e-3, 1e3)
}

impl Scale {
    fn torque(self) -> f64 {
        self.mass * (self.length / self.time).powi(2)
    }

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
        // The length scale does not apply to an axis.
        for key in ["xyz=\"", "radius=\"", " length=\"", "size=\""] {
            text = times(&text, key, length);
        }
        text = times(&text, "velocity=\"", time.recip());
        text = times(&text, "damping=\"", self.torque() * time);
        for key in ["effort=\"", "friction=\""] {
            text = times(&text, key, self.torque());
        }
        text
    }

    fn robot(self, file: &str) -> String {
        format!("file = \"{file}\"\ngravity_m_s2 = [0.0, 0.0, {:e}]", -9.81 * self.length / self.time.powi(2))
    }

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

/// Scales for designs and iterations: powers of two, about 10^±3. Products with them are exact, so that a long search
/// takes the same steps.
fn binary_scales() -> Vec<Scale> {
    scales_by(THOUSANDTH, THOUSAND)
}

fn binary_sizes() -> Vec<Scale> {
    let mass = [THOUSANDTH, THOUSAND].map(|mass| Scale { mass, ..AS_IT_IS });
    let length = [THOUSANDTH, THOUSAND].map(|length| Scale { length, ..AS_IT_IS });
    mass.into_iter().chain(length).collect()
}

const THOUSAND: f64 = 1024.0;
const THOUSANDTH: f64 = 1.0 / THOUSAND;

/// The example of README at another scale, with further keys of `[drive]`.
fn example(scale: Scale, drive: &str) -> (tempfile::TempDir, Job) {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read_to_string(repository(name)).unwrap();
    std::fs::write(folder.path().join("arm.urdf"), scale.urdf(&read("robots/ur10.urdf"))).unwrap();
    for name in ["train.csv", "test.csv"] {
        let log = scale.log(&read(&format!("examples/ur10_simulated/{name}")));
        std::fs::write(folder.path().join(name), log).unwrap();
    }
    let study = read("examples/ur10_simulated.toml")
        .replace("file = \"../robots/ur10.urdf\"", &scale.robot("arm.urdf"))
        .replace("[format]", &format!("[drive]\n{drive}\n\n[format]"))
        .replace("ur10_simulated/", "");
    let job = Job::new(folder.path(), &study);
    (folder, job)
}

const STATED: &str = "friction = \"stated\"";

/// Differences between a scale and the original beyond the tolerance.
struct Differences {
    scale: Scale,
    found: Vec<String>,
}

impl Differences {
    fn new(scale: Scale) -> Self {
        Self { scale, found: Vec::new() }
    }

    fn compare(&mut self, what: &str, found: f64, expected: f64, tolerance: f64) {
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
