//! Mistake: a wrong gravity vector because of mounting, unit or compensation.

use super::Mistake;
use super::kind::{Breadth, Facts, MistakeKind, Setup, with_model};
use super::numbers::Number;
use super::study_keys::{KeyChange, StudyKeys, list, number};
use dynident_dynamics::ParametricModel;
use dynident_model::Vec3;

/// Default gravity of a study, m/s².
const EARTH_M_S2: f64 = 9.81;
/// Maximum relative difference from earth's gravity that location and rounding cause.
const MAX_EARTH_DIFFERENCE: f64 = 0.03;

/// Another gravity vector: the base is mounted in another orientation, or the torque does not contain gravity (zero
/// vector).
#[derive(Clone, Debug, PartialEq)]
pub struct Gravity {
    /// Gravity vector in the frame of the base, m/s².
    pub gravity_m_s2: [f64; 3],
}

impl MistakeKind for Gravity {
    /// Candidates: the same gravity in other directions. Rarer candidates: another unit, no gravity (compensated by the
    /// controller), and earth's gravity for a study without gravity.
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let gravity = setup.model().gravity();
        let size = gravity.norm();
        let times = |direction: [f64; 3], factor: f64| Self { gravity_m_s2: direction.map(|x| x * factor) };
        let is_other = |direction: &[f64; 3]| {
            let along = direction.iter().zip(gravity.0).map(|(a, b)| a * b).sum::<f64>();
            along < 0.999 * size
        };
        match breadth {
            Breadth::Usual if size > 0.0 => {
                directions().filter(is_other).map(|direction| times(direction, size)).collect()
            }
            Breadth::Rare if size > 0.0 => {
                let is_other_unit = (size / EARTH_M_S2 - 1.0).abs() > MAX_EARTH_DIFFERENCE;
                let on_earth = || Self { gravity_m_s2: gravity.0.map(|g| g * EARTH_M_S2 / size) };
                [Self { gravity_m_s2: [0.0; 3] }].into_iter().chain(is_other_unit.then(on_earth)).collect()
            }
            Breadth::Rare => directions().map(|direction| times(direction, EARTH_M_S2)).collect(),
            Breadth::Usual | Breadth::KnownRobot(_) => Vec::new(),
        }
    }

    fn corrected_robot(&self, robot: &ParametricModel) -> Option<ParametricModel> {
        with_model(robot, robot.model().clone().with_gravity(Vec3(self.gravity_m_s2)).ok()?)
    }

    fn facts(&self) -> Facts {
        Facts { rarity: 0.15, is_of_all_logs: true, ..Facts::of("mounting") }
    }

    fn sentence(&self, _: &[String]) -> String {
        let [x, y, z] = self.gravity_m_s2;
        if self.gravity_m_s2 == [0.0; 3] {
            return "the torque is without gravity: the controller compensated gravity, or this robot has no gravity"
                .to_owned();
        }
        format!(
            "the base is mounted in another orientation: gravity is [{x:.2}, {y:.2}, {z:.2}] m/s² in the frame of the base"
        )
    }

    fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        let gravity = list(self.gravity_m_s2.map(|g| number(g, 4)));
        let without = keys.has_base_rotation.then(|| "# without base_rpy_rad and base_rpy_deg".to_owned());
        let lines = [format!("gravity_m_s2 = {gravity}")].into_iter().chain(without);
        lines.map(|line| KeyChange { table: "robot".to_owned(), line }).collect()
    }

    fn subject(&self) -> Option<Mistake> {
        Some(Self { gravity_m_s2: [0.0; 3] }.into())
    }

    /// Rotates the vector about two perpendicular axes, first by up to 0.5 rad, then by up to 0.1 rad, to the smallest
    /// `value`.
    fn with_best_number(&self, value: &dyn Fn(&Mistake) -> f64) -> Option<Mistake> {
        let mut gravity = self.gravity_m_s2;
        if gravity == [0.0; 3] {
            return None;
        }
        for reach in [0.5, 0.1] {
            for axis in perpendicular_axes(gravity) {
                let start = gravity;
                let with = |angle: f64| Self { gravity_m_s2: turned(start, axis, angle) };
                gravity = turned(start, axis, Number::angle(0.0, reach).minimum(|angle| value(&with(angle).into())));
            }
        }
        Some(Self { gravity_m_s2: gravity }.into())
    }
}

/// 26 directions: along the axes, and halfway between two or three of them.
fn directions() -> impl Iterator<Item = [f64; 3]> {
    let steps = |k: i32| [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1].map(f64::from);
    (0..27).filter(|&k| k != 13).map(move |k| {
        let direction = steps(k);
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        direction.map(|x| x / length)
    })
}

/// Two unit vectors that are perpendicular to `v` and to each other.
fn perpendicular_axes(v: [f64; 3]) -> [[f64; 3]; 2] {
    let least = (0..3).min_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let first = unit(cross(v, other));
    [first, unit(cross(v, first))]
}

/// The vector `v`, rotated by `angle` (rad) about the unit vector `axis` perpendicular to it.
fn turned(v: [f64; 3], axis: [f64; 3], angle: f64) -> [f64; 3] {
    let side = cross(axis, v);
    core::array::from_fn(|k| v[k] * angle.cos() + side[k] * angle.sin())
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::read_urdf;

    #[test]
    fn bodies_without_inertials_keep_no_nominal_values() {
        let urdf = include_str!("../../../../../robots/planar2r.urdf");
        let bare = urdf.split("<inertial>").map(|part| part.split_once("</inertial>").map_or(part, |(_, rest)| rest));
        let model = read_urdf(&bare.collect::<String>()).unwrap().model;
        let bare = ParametricModel::new(model, Vec::new()).unwrap();
        assert!(bare.nominal_base().is_none());
        let gravity = Gravity { gravity_m_s2: [0.0, 0.0, 9.81] };
        assert!(gravity.corrected_robot(&bare).unwrap().nominal_base().is_none());
        let described = ParametricModel::new(read_urdf(urdf).unwrap().model, Vec::new()).unwrap();
        assert!(gravity.corrected_robot(&described).unwrap().nominal_base().is_some());
    }
}
