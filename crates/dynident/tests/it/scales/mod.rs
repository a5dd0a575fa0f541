//! Nothing depends on the size of the robot or on units: the same motion of a robot a thousand times as heavy or
//! long gives the same model, scaled, with the same bars, choices and findings.

mod check;
mod crane;
mod design;
mod identify;
mod iterate;

use crate::common::{Job, repository};
use core::fmt::Write;

/// Factors of mass, length and time.
#[derive(Clone, Copy, Debug)]
struct Scale {
    mass: f64,
    length: f64,
    time: f64,
}

const AS_IT_IS: Scale = Scale { mass: 1.0, length: 1.0, time: 1.0 };

/// A thousand times as heavy, long and slow, and a thousandth: a watch gear and a crane, links of half a millimetre and
/// of half a kilometre, motions of milliseconds and of hours. Every day two scales of all three at once and those of
/// time; one by one in long tests.
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

    /// The keys of `[robot]` for a description of this scale.
    fn robot(self, file: &str) -> String {
        format!("file = \"{file}\"\ngravity_m_s2 = [0.0, 0.0, {:e}]", -9.81 * self.length / self.time.powi(2))
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

/// What tells of two designs and of two iterations whether they are one: powers of two, about 10^±3. Products with them
/// are exact, so that a search of many steps takes the same ones, and what differs is not rounding grown large.
fn binary_scales() -> Vec<Scale> {
    scales_by(THOUSANDTH, THOUSAND)
}

/// The same with the motion's own time.
fn binary_sizes() -> Vec<Scale> {
    let mass = [THOUSANDTH, THOUSAND].map(|mass| Scale { mass, ..AS_IT_IS });
    let length = [THOUSANDTH, THOUSAND].map(|length| Scale { length, ..AS_IT_IS });
    mass.into_iter().chain(length).collect()
}

const THOUSAND: f64 = 1024.0;
const THOUSANDTH: f64 = 1.0 / THOUSAND;

/// The README's example on another scale, with further keys of `[drive]`.
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

/// Viscous friction and a smooth step.
const STATED: &str = "friction = \"stated\"";

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
