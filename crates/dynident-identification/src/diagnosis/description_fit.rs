//! What the description's bodies say of each joint's torque: its unit, and whether they are this robot's at all.

use super::beside_friction::BesideFriction;
use super::motion_rows::MotionRows;
use super::nominal::nominal_torque;
use super::usual_errors::torques_of_likely_robots;
use super::wrong_mass::{WrongMass, wrong_mass};
use dynident_dynamics::ParametricModel;
use nalgebra::DVector;

/// Share of a joint's torque that the description's bodies, times any factor, must explain beside friction before the
/// factor says anything.
const EXPLAINED: f64 = 0.5;
/// A factor beyond this (or below its inverse) is a unit or a motor constant; descriptions err by less.
const UNIT_FACTOR: f64 = 3.0;
/// Share of what friction and drive inertia leave of its torque that the best robot of this description may leave for
/// a joint to say anything: else that is not the work of bodies.
const TELLING: f64 = 0.4;
/// Share of the best explained joint below which the description is another robot's. Of six sets of real logs with
/// described bodies the least has 0.90; descriptions of other arms with as many joints reach 0.45. Of slow or small
/// motion their own descriptions explain less than that as well.
const OWN_ROBOT: f64 = 0.65;

/// Units of torque that are taken for Nm, and their factors.
const UNITS_OF_TORQUE: [(&str, f64); 7] = [
    ("mNm", 1e-3),
    ("Ncm", 1e-2),
    ("kgf m", 9.80665),
    ("kgf cm", 0.0980665),
    ("lbf in", 0.112_984_83),
    ("ozf in", 7.061_552e-3),
    ("kNm", 1e3),
];
/// Share by which the middle joint's factor may differ from a unit's, and by which those that agree with it may.
const UNIT_SHARE: f64 = 0.15;
const UNIT_SPREAD: f64 = 0.8;

/// Each joint's torque by the description's bodies times a factor of the joint's own.
#[derive(Clone, Debug, PartialEq)]
pub struct DescriptionFit {
    /// For each joint what its column has to be multiplied by so that the description's bodies explain it best; none
    /// where they explain too little of it.
    pub scale: Vec<Option<f64>>,
    /// For each joint the share of its torque's squares beside friction, drive inertia and an offset that the bodies
    /// explain; none where even the best bodies explain little of that.
    pub explained: Vec<Option<f64>>,
    /// The least that this description explains of the best explained joint of robots that it errs about as usual, on
    /// this motion; none where nobody had to ask.
    pub least_of_own: Option<f64>,
    /// One body's mass that explains what else asks for another unit of most torques.
    pub wrong_mass: Option<WrongMass>,
}

impl DescriptionFit {
    /// Joints whose torque cannot be in newton metres if the description is near the truth; none unless most joints
    /// that say anything agree, for single bodies may be described badly.
    pub fn joints_in_another_unit(&self) -> Vec<usize> {
        let is_far = |scale: f64| !(UNIT_FACTOR.recip()..=UNIT_FACTOR).contains(&scale);
        let far: Vec<usize> = (0..self.scale.len()).filter(|&joint| self.scale[joint].is_some_and(is_far)).collect();
        let telling = self.scale.iter().flatten().count();
        if 2 * far.len() > telling { far } else { Vec::new() }
    }

    /// The unit that most joints which say anything agree on, within what descriptions err by, and a factor of it to
    /// Nm (N); none where each has a factor of its own, as currents have.
    pub fn common_unit(&self) -> Option<(&'static str, f64)> {
        let mut telling: Vec<f64> = self.scale.iter().flatten().copied().collect();
        telling.sort_by(f64::total_cmp);
        let middle = *telling.get(telling.len() / 2)?;
        let near = |factor: f64, unit: f64, share: f64| (factor / unit).ln().abs() < share.ln_1p();
        let agree = |unit: f64| telling.iter().filter(|factor| near(**factor, unit, UNIT_SPREAD)).count();
        let is_common =
            |(_, unit): &&(&str, f64)| near(middle, *unit, UNIT_SHARE) && 3 * agree(*unit) >= 2 * telling.len();
        UNITS_OF_TORQUE.iter().find(is_common).copied()
    }

    /// The joint that the bodies explain best, and the share that they explain of it; none where no joint tells.
    pub fn best_explained(&self) -> Option<(usize, f64)> {
        let shares = self.explained.iter().enumerate().filter_map(|(joint, share)| Some((joint, (*share)?)));
        shares.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Whether the bodies, however scaled, explain no joint's torque, and would explain that of any robot that they
    /// describe with usual errors: they are not this robot's.
    pub fn is_of_another_robot(&self) -> bool {
        let least = self.least_of_own.unwrap_or(f64::INFINITY).min(OWN_ROBOT);
        self.best_explained().is_some_and(|(_, share)| share < least)
    }
}

/// Fits each joint's torque by the nominal bodies' torque times a factor, with viscous and Coulomb friction, drive
/// inertia and an offset; `None` while a body's inertials are unknown or the bodies need no torque at all. `left` is
/// the share of each joint's torque that the best robot of this description leaves.
pub(super) fn description_fit(robot: &ParametricModel, rows: &MotionRows, left: &[f64]) -> Option<DescriptionFit> {
    let nominal = nominal_torque(robot, rows)?;
    let beside = BesideFriction::new(robot, rows)?;
    let bodies = beside.of_all(&nominal);
    let fits: Vec<JointFit> = (0..bodies.len())
        .map(|joint| joint_fit(&rows.tau[joint], &beside.of(joint, &rows.tau[joint]), &bodies[joint], left[joint]))
        .collect();
    let left_by_scales = fits.iter().map(|fit| fit.left).sum();
    let scale = fits.iter().map(|fit| fit.scale).collect();
    let explained = fits.iter().map(|fit| fit.explained).collect();
    let mut fit = DescriptionFit { scale, explained, least_of_own: None, wrong_mass: None };
    if fit.is_of_another_robot() {
        let joints: Vec<usize> = (0..fits.len()).filter(|&joint| fits[joint].explained.is_some()).collect();
        fit.least_of_own = Some(least_of_own(robot, rows, &beside, &bodies, &joints, left));
    }
    if !fit.joints_in_another_unit().is_empty() {
        fit.wrong_mass = wrong_mass(robot, rows, &beside, left_by_scales);
    }
    nominal.iter().flatten().any(|&tau| tau != 0.0).then_some(fit)
}

/// What the description's bodies say of one joint.
#[derive(Default)]
struct JointFit {
    /// Share of its torque's squares beside friction that its own factor leaves.
    left: f64,
    scale: Option<f64>,
    explained: Option<f64>,
}

/// The factor of one joint's column and the share explained, of its torque, what friction leaves of it and of that of
/// the bodies, and the share that the best robot leaves.
fn joint_fit(tau: &[f64], torque: &DVector<f64>, bodies: &DVector<f64>, best_left: f64) -> JointFit {
    let without = torque.norm_squared();
    if without == 0.0 {
        return JointFit::default();
    }
    let (share, gain) = (share_explained(torque, bodies, 0.0), torque.dot(bodies) / bodies.norm_squared());
    let all: f64 = tau.iter().map(|tau| tau * tau).sum();
    let is_telling = best_left.powi(2) * all < TELLING.powi(2) * without;
    JointFit {
        left: 1.0 - share,
        scale: (share > EXPLAINED && gain.is_finite()).then(|| gain.recip()),
        explained: is_telling.then_some(share),
    }
}

/// Share of a torque's squares, with those of noise, that the bodies' torque times a factor explains. Bodies that need
/// no torque explain none; those of another sign neither.
fn share_explained(torque: &DVector<f64>, bodies: &DVector<f64>, noise: f64) -> f64 {
    let along = torque.dot(bodies).max(0.0);
    let all = (torque.norm_squared() + noise) * bodies.norm_squared();
    if all > 0.0 { along * along / all } else { 0.0 }
}

/// The least that the description explains of the best explained of `joints`, over robots whose bodies are those of the
/// description with errors as descriptions have them, moved as in these rows and measured as well as the best robot
/// explains them.
fn least_of_own(
    robot: &ParametricModel,
    rows: &MotionRows,
    beside: &BesideFriction,
    bodies: &[DVector<f64>],
    joints: &[usize],
    left: &[f64],
) -> f64 {
    let Some(torques) = torques_of_likely_robots(robot, rows) else { return 0.0 };
    let most = |torque: Vec<Vec<f64>>| {
        let share = |&joint: &usize| {
            let noise = left[joint].powi(2) * rows.tau[joint].iter().map(|tau| tau * tau).sum::<f64>();
            share_explained(&beside.of(joint, &torque[joint]), &bodies[joint], noise)
        };
        joints.iter().map(share).fold(0.0, f64::max)
    };
    torques.map(most).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_common_where_joints_agree_and_constants_of_motors_are_none() {
        let unit = |scale: &[f64]| {
            let scale: Vec<Option<f64>> = scale.iter().copied().map(Some).collect();
            DescriptionFit { explained: vec![None; scale.len()], scale, least_of_own: None, wrong_mass: None }
                .common_unit()
                .map(|(name, _)| name)
        };
        assert_eq!(unit(&[0.0114, 0.00992, 0.0111, 0.0174, 0.0154]), Some("Ncm"));
        assert_eq!(unit(&[9.7, 11.2, 10.8, 17.0, 15.1]), Some("kgf m"));
        assert_eq!(unit(&[13.6, 13.6, 8.7, 8.7, 29.2, 20.6]), None);
        assert_eq!(unit(&[]), None);
    }
}
