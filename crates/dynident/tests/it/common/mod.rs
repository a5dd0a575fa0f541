//! Robots with known parameters and their logs: inverse dynamics of the bodies plus explicit friction.
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::model::terms::CoulombShape;
use dynident::model::{InertialParameters, Model, load_robot};
use dynident::{IdentificationOutcome, RunOptions, Silent, Study, StudyRobot, identify};
pub(crate) use dynident_testing::{recordings, repository};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Pseudo-random numbers in [-1, 1): a linear congruential generator (Knuth's MMIX constants).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Approximately standard normal: a sum of twelve uniform numbers.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() / 2.0
    }
}

/// Bodies, and per joint drive inertia, viscous friction, Coulomb friction, offset.
#[derive(Clone)]
pub(crate) struct Truth {
    pub(crate) model: Model,
    pub(crate) drive: Vec<[f64; 4]>,
}

impl Truth {
    /// Bodies near the robot description, with masses and sizes scaled randomly by `change`, and drives with friction.
    pub(crate) fn near(description: &Path, change: f64, drive_inertia: bool) -> Self {
        let model = load_robot(description).unwrap().model;
        let mut random = Random(7);
        let inertials: Vec<InertialParameters> = model
            .inertials()
            .iter()
            .map(|body| {
                let scale = 0.3 * body.mass_kg();
                InertialParameters(core::array::from_fn(|k| {
                    body.0[k] + change * random.next() * if k == 0 { body.mass_kg() } else { 0.2 * scale }
                }))
            })
            .collect();
        let drive = (0..model.dof())
            .map(|_| {
                let inertia = if drive_inertia { 0.3 + 0.1 * random.next() } else { 0.0 };
                [inertia, 2.0 + random.next(), 1.5 + random.next(), 0.5 * random.next()]
            })
            .collect();
        Self { model: model.with_inertials(&inertials).unwrap(), drive }
    }

    /// A physically consistent robot: masses up to 30 % from the description, centres of mass up to 10 % nearer or
    /// farther.
    pub(crate) fn other(description: &Path, random: &mut Random) -> Self {
        let mut truth = Self::near(description, 0.0, false);
        let mut other = |body: &InertialParameters| {
            let (mass, distance) = (1.0 + 0.3 * random.next(), 1.0 + 0.1 * random.next());
            let (com, inertia) = (body.com_m().unwrap(), body.inertia_at_com().unwrap());
            InertialParameters::from_centre_of_mass(mass * body.mass_kg(), com.scale(distance), &inertia.scale(mass))
        };
        let bodies: Vec<InertialParameters> = truth.model.inertials().iter().map(&mut other).collect();
        truth.model = truth.model.with_inertials(&bodies).unwrap();
        truth
    }

    pub(crate) fn coulomb_width(&self, joint: usize) -> f64 {
        let is_rotary = self.model.joints()[joint].is_rotary();
        self.model.characteristic_scale().velocity(is_rotary, CoulombShape::USUAL_WIDTH)
    }

    pub(crate) fn torque(&self, workspace: &mut Workspace, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let bodies = inverse_dynamics(&self.model, workspace, q, dq, ddq);
        let drives = self.drive.iter().enumerate().map(|(j, [inertia, viscous, coulomb, offset])| {
            inertia * ddq[j] + viscous * dq[j] + coulomb * (dq[j] / self.coulomb_width(j)).tanh() + offset
        });
        bodies.iter().zip(drives).map(|(body, drive)| body + drive).collect()
    }

    /// Expected estimate: the true base parameters.
    pub(crate) fn base_values(&self, robot: &StudyRobot) -> Vec<f64> {
        use dynident::model::terms::TorqueTerm;
        let mut all = self.model.parameter_vector();
        all.extend(robot.terms().iter().map(|term| match term {
            TorqueTerm::DriveInertia(term) => self.drive[term.joint][0],
            TorqueTerm::Viscous(term) => self.drive[term.joint][1],
            TorqueTerm::Coulomb(term) => self.drive[term.joint][2],
            TorqueTerm::Offset(term) => self.drive[term.joint][3],
            _ => 0.0,
        }));
        robot.base().values(&all)
    }
}

pub(crate) struct Motion {
    centre: Vec<f64>,
    amplitude: Vec<[f64; 5]>,
    phase: Vec<[f64; 5]>,
}

impl Motion {
    /// Lowest frequency, Hz; the highest is five times as high.
    const SLOWEST_HZ: f64 = 0.13;

    pub(crate) fn new(dof: usize, seed: u64) -> Self {
        let mut random = Random(seed);
        let mut numbers = |scale: f64| -> Vec<[f64; 5]> {
            (0..dof).map(|_| core::array::from_fn(|_| scale * random.next())).collect()
        };
        Self { centre: vec![0.0; dof], amplitude: numbers(0.5), phase: numbers(3.1) }
    }

    /// A motion between the position limits whose joints reach `velocity` (rad/s, m/s), or less if limits require it.
    pub(crate) fn within(model: &Model, velocity: f64, seed: u64) -> Self {
        /// Used fraction of the limits, and the range of a joint without position limits, rad.
        const SHARE: f64 = 0.9;
        const RANGE: [f64; 2] = [-2.0, 2.0];
        let mut motion = Self::new(model.dof(), seed);
        let instants: Vec<[Vec<f64>; 3]> = (0..1000).map(|k| motion.at(f64::from(k) * 0.01)).collect();
        for (j, joint) in model.joints().iter().enumerate() {
            let peak = |order: usize| instants.iter().map(|at| at[order][j].abs()).fold(0.0, f64::max);
            let low = joint.limits.lower.unwrap_or(RANGE[0]).max(RANGE[0]);
            let high = joint.limits.upper.unwrap_or(RANGE[1]).min(RANGE[1]);
            let limit = joint.limits.velocity.filter(|limit| *limit > 0.0).unwrap_or(f64::INFINITY);
            let scale = (velocity.min(SHARE * limit) / peak(1)).min(SHARE * 0.5 * (high - low) / peak(0));
            motion.centre[j] = 0.5 * (low + high);
            motion.amplitude[j] = motion.amplitude[j].map(|amplitude| scale * amplitude);
        }
        motion
    }

    pub(crate) fn at(&self, t: f64) -> [Vec<f64>; 3] {
        let sum = |order: u32| {
            let joint = |(amplitude, phase): (&[f64; 5], &[f64; 5])| {
                (0..5)
                    .map(|k| {
                        let w = core::f64::consts::TAU * Self::SLOWEST_HZ * (k + 1) as f64;
                        let quarter = core::f64::consts::FRAC_PI_2 * f64::from(order);
                        amplitude[k] * w.powi(order as i32) * (w * t + phase[k] + quarter).sin()
                    })
                    .sum()
            };
            self.amplitude.iter().zip(&self.phase).map(joint).collect()
        };
        let q = self.centre.iter().zip(sum(0)).map(|(centre, q)| centre + q).collect();
        [q, sum(1), sum(2)]
    }
}

pub(crate) fn write_log(
    path: &Path,
    truth: &Truth,
    motion: &Motion,
    (rate_hz, seconds): (f64, f64),
    header: &str,
    mut row: impl FnMut(&[f64], &[f64]) -> Vec<f64>,
) {
    let mut workspace = Workspace::new(&truth.model);
    let mut text = format!("{header}\n");
    for k in 0..(rate_hz * seconds) as usize {
        let t = k as f64 / rate_hz;
        let [q, dq, ddq] = motion.at(t);
        let tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        write!(text, "{t}").unwrap();
        for value in row(&q, &tau) {
            write!(text, ",{value}").unwrap();
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

pub(crate) fn header(dof: usize) -> String {
    let numbered = |name: &str| (1..=dof).map(|j| format!("{name}{j}")).collect::<Vec<_>>().join(",");
    format!("t,{},{}", numbered("q"), numbered("tau"))
}

pub(crate) fn plain(q: &[f64], tau: &[f64]) -> Vec<f64> {
    [q, tau].concat()
}

/// Columns and differentiator, accurate to 1e-6, without filters.
pub(crate) fn format(dof: usize) -> String {
    format!(
        r#"
        [motion]
        differentiator = {{ method = "central-differences", order = 8 }}
        [format]
        time = {{ column = "t" }}
        position = {{ columns = "q{{1..{dof}}}" }}
        torque = {{ columns = "tau{{1..{dof}}}" }}
        "#
    )
}

pub(crate) struct Job {
    pub(crate) study: Study,
    pub(crate) path: PathBuf,
}

impl Job {
    pub(crate) fn new(folder: &Path, text: &str) -> Self {
        let path = folder.join("study.toml");
        std::fs::write(&path, text).unwrap();
        Self { study: Study::load(&path).unwrap_or_else(|error| panic!("{error}\n{text}")), path }
    }

    /// Error message of an unreadable study.
    pub(crate) fn new_error(folder: &Path, text: &str) -> String {
        let path = folder.join("study.toml");
        std::fs::write(&path, text).unwrap();
        Study::load(&path).unwrap_err().to_string()
    }

    pub(crate) fn options(threads: usize) -> RunOptions<'static> {
        RunOptions { data: None, threads, progress: &Silent }
    }

    pub(crate) fn identify(&self) -> IdentificationOutcome {
        let found = identify(&self.study, &self.path, &Self::options(1)).unwrap_or_else(|error| panic!("{error}"));
        assert_reads_back(&found.result);
        found
    }

    pub(crate) fn robot(&self) -> StudyRobot {
        let folders = dynident::Folders::new(&self.study, &self.path, None);
        StudyRobot::new(&self.study, &self.path, &folders).unwrap()
    }
}

/// Checks that a file is read and rewritten identically, and conforms to its schema.
pub(crate) fn assert_reads_back<T: Serialize + DeserializeOwned>(file: &T) {
    let value = serde_json::to_value(file).unwrap();
    if let Some(schema) = value["schema"].as_str() {
        let differences = dynident_testing::schema::differences(schema.split('/').nth(1).unwrap(), &value);
        assert!(differences.is_empty(), "{differences:#?}: CONTRIBUTING.md says how schemas are made again");
    }
    let text = serde_json::to_string_pretty(file).unwrap();
    let read: T = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(serde_json::to_string_pretty(&read).unwrap(), text);
}

/// Checks every base parameter within `tolerance`, relative to itself or to 0.01 of its unit.
pub(crate) fn assert_recovered(found: &IdentificationOutcome, expected: &[f64], tolerance: f64) {
    assert_eq!(found.result.base_parameters.len(), expected.len());
    for (parameter, truth) in found.result.base_parameters.iter().zip(expected) {
        let error = (parameter.value - truth).abs() / truth.abs().max(0.01);
        assert!(
            error <= tolerance,
            "{}: {} instead of {truth}, relative error {error:.2e}",
            parameter.expression,
            parameter.value
        );
    }
}
