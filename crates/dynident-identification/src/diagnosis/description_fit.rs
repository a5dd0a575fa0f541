//! Comparison of each joint's torque with the torque of the nominal bodies, to find a wrong unit of the torque or a
//! description of another robot.

use super::friction_spans::FrictionSpans;
use super::motion_rows::MotionRows;
use super::nominal::nominal_torque;
use super::usual_errors::torques_of_likely_robots;
use super::wrong_mass::{WrongMass, wrong_mass};
use crate::diagnosis_settings::DescriptionSettings;
use dynident_dynamics::ParametricModel;
use nalgebra::DVector;

/// Units that are often mistaken for Nm, with their values in Nm.
const UNITS_OF_TORQUE: [(&str, f64); 7] = [
    ("mNm", 1e-3),
    ("Ncm", 1e-2),
    ("kgf m", 9.80665),
    ("kgf cm", 0.0980665),
    ("lbf in", 0.112_984_83),
    ("ozf in", 7.061_552e-3),
    ("kNm", 1e3),
];
/// Fit of each joint's torque by the torque of the nominal bodies (of the robot description) times a factor for this
/// joint.
#[derive(Clone, Debug, PartialEq)]
pub struct DescriptionFit {
    /// Factor on the torque columns of each joint with which the nominal bodies explain them best; `None` if the bodies
    /// explain too little.
    pub scale: Vec<Option<f64>>,
    /// Share of the sum of squares of each joint's torque that the nominal bodies explain, after friction, drive
    /// inertia and offset are removed; `None` if even the best bodies explain little of it.
    pub explained: Vec<Option<f64>>,
    /// Explained share of the best explained joint for robots that differ from this description by usual errors, in
    /// this motion: the smallest value of several random robots. `None` if it was not needed.
    pub least_of_own: Option<f64>,
    /// A single wrong mass that explains the torques better than another unit of most torques.
    pub wrong_mass: Option<WrongMass>,
    pub(super) settings: DescriptionSettings,
}

impl DescriptionFit {
    /// Joints whose torque is not in newton metres if the description is nearly correct. Empty unless most of the
    /// comparable joints agree, because the description of single bodies may be bad.
    pub fn joints_in_another_unit(&self) -> Vec<usize> {
        let max_scale = self.settings.max_scale;
        let is_far = |scale: f64| !(max_scale.recip()..=max_scale).contains(&scale);
        let far: Vec<usize> = (0..self.scale.len()).filter(|&joint| self.scale[joint].is_some_and(is_far)).collect();
        let compared = self.scale.iter().flatten().count();
        if 2 * far.len() > compared { far } else { Vec::new() }
    }

    /// The unit of most comparable joints (within usual errors of descriptions) and its value, Nm (N). `None` if the
    /// factors differ from joint to joint, as for motor currents.
    pub fn common_unit(&self) -> Option<(&'static str, f64)> {
        let DescriptionSettings { max_unit_error, max_unit_spread, .. } = self.settings;
        let mut factors: Vec<f64> = self.scale.iter().flatten().copied().collect();
        factors.sort_by(f64::total_cmp);
        let median = *factors.get(factors.len() / 2)?;
        let near = |factor: f64, unit: f64, share: f64| (factor / unit).ln().abs() < share.ln_1p();
        let agree = |unit: f64| factors.iter().filter(|factor| near(**factor, unit, max_unit_spread)).count();
        let is_common =
            |(_, unit): &&(&str, f64)| near(median, *unit, max_unit_error) && 3 * agree(*unit) >= 2 * factors.len();
        UNITS_OF_TORQUE.iter().find(is_common).copied()
    }

    /// The joint whose torque the nominal bodies explain best, and the explained share.
    pub fn best_explained(&self) -> Option<(usize, f64)> {
        let shares = self.explained.iter().enumerate().filter_map(|(joint, share)| Some((joint, (*share)?)));
        shares.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Whether the nominal bodies, with any factor, explain no joint's torque, although they would do so for any robot
    /// that differs from the description by usual errors.
    pub fn is_of_another_robot(&self) -> bool {
        let least = self.least_of_own.unwrap_or(f64::INFINITY).min(self.settings.min_explained_of_best);
        self.best_explained().is_some_and(|(_, share)| share < least)
    }
}

/// Fits each joint's torque by the torque of the nominal bodies times a factor, with viscous and Coulomb friction,
/// drive inertia and an offset. `None` if inertial parameters of a body are unknown or the bodies require no torque.
/// `left` is the unexplained share of each joint's torque for the best physically consistent robot.
pub(super) fn description_fit(
    robot: &ParametricModel,
    rows: &MotionRows,
    left: &[f64],
    settings: DescriptionSettings,
) -> Option<DescriptionFit> {
    let nominal = nominal_torque(robot, rows)?;
    let friction = FrictionSpans::new(robot, rows)?;
    let bodies = friction.remove_all(&nominal);
    let fit_of = |joint: usize| {
        let tau = &rows.tau[joint];
        joint_fit(tau, &friction.remove(joint, tau), &bodies[joint], left[joint], &settings)
    };
    let fits: Vec<JointFit> = (0..bodies.len()).map(fit_of).collect();
    let left_by_scales = fits.iter().map(|fit| fit.left).sum();
    let scale = fits.iter().map(|fit| fit.scale).collect();
    let explained = fits.iter().map(|fit| fit.explained).collect();
    let mut fit = DescriptionFit { scale, explained, least_of_own: None, wrong_mass: None, settings };
    if fit.is_of_another_robot() {
        let joints: Vec<usize> = (0..fits.len()).filter(|&joint| fits[joint].explained.is_some()).collect();
        fit.least_of_own = Some(least_of_own(robot, rows, &friction, &bodies, &joints, left));
    }
    if !fit.joints_in_another_unit().is_empty() {
        fit.wrong_mass = wrong_mass(robot, rows, &friction, left_by_scales, settings.usual_mass_ratios);
    }
    nominal.iter().flatten().any(|&tau| tau != 0.0).then_some(fit)
}

#[derive(Default)]
struct JointFit {
    /// Unexplained share of the sum of squares of the torque, after friction is removed.
    left: f64,
    scale: Option<f64>,
    explained: Option<f64>,
}

/// Fits one joint. `tau` is its torque, `torque` is the same without friction, `bodies` is the torque of the nominal
/// bodies without components that look like friction, and `best_left` is the unexplained share for the best robot.
fn joint_fit(
    tau: &[f64],
    torque: &DVector<f64>,
    bodies: &DVector<f64>,
    best_left: f64,
    settings: &DescriptionSettings,
) -> JointFit {
    let without = torque.norm_squared();
    if without == 0.0 {
        return JointFit::default();
    }
    let (share, gain) = (share_explained(torque, bodies, 0.0), torque.dot(bodies) / bodies.norm_squared());
    let all: f64 = tau.iter().map(|tau| tau * tau).sum();
    let is_comparable = best_left.powi(2) * all < settings.max_unexplained.powi(2) * without;
    JointFit {
        left: 1.0 - share,
        scale: (share > settings.min_explained && gain.is_finite()).then(|| gain.recip()),
        explained: is_comparable.then_some(share),
    }
}

/// Share of the sum of squares of torque and noise that the torque of the bodies times a positive factor explains; zero
/// for bodies that require no torque.
fn share_explained(torque: &DVector<f64>, bodies: &DVector<f64>, noise: f64) -> f64 {
    let along = torque.dot(bodies).max(0.0);
    let all = (torque.norm_squared() + noise) * bodies.norm_squared();
    if all > 0.0 { along * along / all } else { 0.0 }
}

/// Explained share of the best explained joint among `joints`: the smallest value over random robots that differ from
/// the description by usual errors. They move as in these rows, and the unexplained share `left` is added as noise.
fn least_of_own(
    robot: &ParametricModel,
    rows: &MotionRows,
    friction: &FrictionSpans,
    bodies: &[DVector<f64>],
    joints: &[usize],
    left: &[f64],
) -> f64 {
    let Some(torques) = torques_of_likely_robots(robot, rows) else { return 0.0 };
    let most = |torque: Vec<Vec<f64>>| {
        let share = |&joint: &usize| {
            let noise = left[joint].powi(2) * rows.tau[joint].iter().map(|tau| tau * tau).sum::<f64>();
            share_explained(&friction.remove(joint, &torque[joint]), &bodies[joint], noise)
        };
        joints.iter().map(share).fold(0.0, f64::max)
    };
    torques.map(most).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_agree_on_a_unit_and_not_on_motor_constants() {
        let unit = |scale: &[f64]| {
            let scale: Vec<Option<f64>> = scale.iter().copied().map(Some).collect();
            let (explained, settings) = (vec![None; scale.len()], DescriptionSettings::default());
            let fit = DescriptionFit { explained, scale, least_of_own: None, wrong_mass: None, settings };
            fit.common_unit().map(|(name, _)| name)
        };
        assert_eq!(unit(&[0.0114, 0.00992, 0.0111, 0.0174, 0.0154]), Some("Ncm"));
        assert_eq!(unit(&[9.7, 11.2, 10.8, 17.0, 15.1]), Some("kgf m"));
        assert_eq!(unit(&[13.6, 13.6, 8.7, 8.7, 29.2, 20.6]), None);
        assert_eq!(unit(&[]), None);
    }
}
