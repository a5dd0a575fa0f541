use crate::robot::{TRACKING_M, TRACKING_RAD};
use crate::setup::loop_delay::{highest_omega, highest_omega_if_light, share_of_all};
use crate::setup::posture::{at_sample, inertia_matrix};
use crate::setup::typical_drives::{
    FRICTION, TIMES_THE_LIGHTEST, with_light_drives, with_typical_drives, with_typical_inertia,
};
use dynident_dynamics::ParametricModel;
use dynident_simulation::controllers::{
    ComputedTorqueSettings, ControllerModel, ControllerSettings, FrictionCompensation, JointPdSettings,
};
use dynident_simulation::{PerJoint, Reference, SimulationError, require};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Damping ratio of a joint whose drive may be too light for critical damping: the velocity gain is halved at the
/// same stiffness.
const LIGHT_DAMPING: f64 = 0.5;

/// Number of postures along each motion at which the inertia is evaluated.
const POSTURES: usize = 200;

/// Settings of the derived gains.
#[derive(Clone, Debug, PartialEq)]
pub struct GainSettings {
    /// Natural frequency of each joint's loop, Hz.
    pub bandwidth_hz: PerJoint,
    /// Uncertainty of the nominal inertia, percent: the robot may be lighter by this percentage.
    pub uncertainty_percent: f64,
    /// Largest delay of the control loop, s.
    pub delay_s: f64,
    /// Smallest possible inertia of a drive, as a share of a typical drive inertia, if the robot description contains
    /// no drive inertia; the loop must be stable with it.
    pub lightest_drive: f64,
    /// Largest delay of the control loop for joints with unknown drive inertia, s.
    pub light_delay_s: f64,
    /// Largest deviation from the path before a run is stopped, rad (m); `None` for the default of the safety
    /// envelope.
    pub tracking_error: Option<PerJoint>,
}

/// Controllers with gains derived from the nominal model and a bandwidth.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedControllers {
    /// Joint PD.
    pub model_free: ControllerSettings,
    /// Computed torque with the nominal model.
    pub first: ControllerSettings,
    /// Parameters of the nominal model with typical drive inertia, if the nominal parameters have no drive inertia.
    pub first_model: Option<Vec<f64>>,
    /// Computed torque with the newest model.
    pub model_based: ControllerSettings,
    /// Natural frequency of each joint with the controller without a model, Hz: the requested one, or the highest
    /// that the delay allows.
    pub model_free_hz: Vec<f64>,
    /// Natural frequency of each joint with the nominal model, Hz.
    pub first_hz: Vec<f64>,
    /// Natural frequency of each joint with the newest identified model, Hz.
    pub model_based_hz: Vec<f64>,
}

/// A joint whose bandwidth is lower than requested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LoweredBandwidth {
    /// Name of the joint.
    pub joint: String,
    /// Model of the controller: `none`, `nominal` or `newest`.
    pub model: String,
    /// Requested bandwidth, Hz.
    pub asked_hz: f64,
    /// Achieved bandwidth, Hz.
    pub hz: f64,
}

/// Returns the joints whose bandwidth with a `model` is lower than `asked_hz`.
pub fn lowered_bandwidths(
    model: &str,
    given_hz: &[f64],
    names: &[String],
    asked_hz: &PerJoint,
) -> Vec<LoweredBandwidth> {
    let of_joint = |(joint, (name, &hz)): (usize, (&String, &f64))| LoweredBandwidth {
        joint: name.clone(),
        model: model.to_owned(),
        asked_hz: asked_hz.of(joint),
        hz,
    };
    // Tolerance for the conversion from Hz to rad/s and back.
    let is_lower = |one: &LoweredBandwidth| one.hz < one.asked_hz * (1.0 - 1e-9);
    names.iter().zip(given_hz).enumerate().map(of_joint).filter(is_lower).collect()
}

/// Derives critically damped controllers for a robot with nominal bodies. The natural frequency of each joint is `ω =
/// 2π bandwidth`, `M` is the mass matrix:
///
/// * joint PD: `K_p = ω² m`, `K_d = 2 ω m` with `m = (1 - uncertainty) max M_jj(q)` along the motions;
/// * computed torque with the nominal model: `K_p = (1 - uncertainty) ω²`, `K_d = 2 √K_p`. If the robot description
///   has no drive inertia, the model and M_jj include a typical drive inertia (which the effort limit accelerates by
///   300 rad/s²);
/// * computed torque with an identified model: `K_p = ω²`, `K_d = 2 ω`.
///
/// So the lightest robot within the uncertainty is not faster than requested. Under computed torque this is true in
/// all postures, under joint PD in the posture with the largest inertia of the joint (in other postures it is faster,
/// and overdamped). A heavier robot is slower and sags more; the rehearsal in simulation shows whether it follows
/// well enough.
///
/// A loop with delay becomes unstable if it is too fast. Under joint PD, a folded arm can have a tenth of the inertia
/// for which the gains are designed. So `ω` is reduced, first for each joint, then for all together, until every
/// posture along the motions has a phase margin of 30 degrees at this delay. It is never increased.
///
/// A drive whose inertia is not in the robot description can be much lighter than a typical one: a gripper of 30 Nm
/// had a tenth of the typical inertia, which makes the loop ten times as fast. With `lightest_drive` times the
/// typical inertia and a delay of `light_delay_s`, each joint must keep a phase margin of 15 degrees. Where
/// necessary, its damping is halved and `ω` reduced. `ω` stays high enough that typical friction (5 % of the effort
/// limit, and as much at full velocity) keeps the joint at most 80 % of `tracking_error` away from its path.
///
/// # Errors
/// A bandwidth that is not positive, an uncertainty of 100 % or more, a nominal model without inertia, or a negative
/// delay.
pub fn derived_controllers(
    robot: &ParametricModel,
    references: &[&Reference],
    settings: &GainSettings,
) -> Result<DerivedControllers, SimulationError> {
    let GainSettings { bandwidth_hz, uncertainty_percent, lightest_drive, light_delay_s, .. } = settings;
    let (dof, delay_s) = (robot.dof(), settings.delay_s);
    require((0.0..=1e3).contains(light_delay_s), "light_delay_s", *light_delay_s, "give 0 to 1000 s")?;
    require(*lightest_drive > 0.0 && *lightest_drive <= 1.0, "lightest_drive", *lightest_drive, "give 0 to 1")?;
    require((0.0..=1e3).contains(&delay_s), "delay_s", delay_s, "give 0 to 1000 s")?;
    let bandwidth =
        bandwidth_hz.values("bandwidth_hz", dof, "give more than 0 and at most 100000 Hz", |f| f > 0.0 && f <= 1e5)?;
    let tracking_error = &settings.tracking_error;
    let tracking_error = tracking_error
        .as_ref()
        .map(|stated| stated.values("envelope.tracking_error", dof, "give a positive distance", |error| error > 0.0))
        .transpose()?;
    let typical = with_typical_drives(robot);
    let parameters = typical.as_deref().unwrap_or(robot.nominal());
    let matrices = mass_matrices(robot, references, parameters)?;
    let largest = largest_inertia(robot, &matrices)?;
    let left = 1.0 - 0.01 * uncertainty_percent;
    let asked: Vec<f64> = bandwidth.iter().map(|f| core::f64::consts::TAU * f).collect();
    let lowered = |ratio: &dyn Fn(usize) -> f64| -> Vec<f64> {
        asked.iter().enumerate().map(|(joint, asked)| asked.min(highest_omega(ratio(joint), delay_s))).collect()
    };
    // Computed torque with a model that is heavier than the robot makes the loop faster.
    let first_model = with_typical_inertia(robot);
    let drives = if first_model.is_some() { TIMES_THE_LIGHTEST } else { 1.0 };
    let with_model = lowered(&|_| 1.0 / left);
    // With the lightest possible drives each joint only has to be stable.
    let light = with_light_drives(robot, *lightest_drive).map(|light| mass_matrices(robot, references, &light));
    let light = light.transpose()?;
    let stiff = stiff_enough(robot, &matrices, left, tracking_error.as_deref());
    let stable = |omega: Vec<f64>, ratios: &dyn Fn(&[DMatrix<f64>]) -> Vec<f64>| match &light {
        Some(light) => Loops::stable(omega, &ratios(light), &stiff, *light_delay_s),
        None => Loops { omega, damping: vec![1.0; dof] },
    };
    let with_nominal = stable(lowered(&|_| drives), &|light| inertia_ratios(&matrices, light, dof));
    // Joint PD in the posture with the lowest inertia of the joint, with the other joints free.
    let pd_ratios = |matrices: &[DMatrix<f64>]| -> Vec<f64> {
        largest.iter().zip(lightest_inertia(matrices, dof)).map(|(most, least)| (most / least).max(1.0)).collect()
    };
    let own_ratios = pd_ratios(&matrices);
    let mut alone = stable(lowered(&|joint| own_ratios[joint]), &pd_ratios);
    let kd: Vec<f64> = (0..dof).map(|joint| 2.0 * alone.damping[joint] * alone.omega[joint] * largest[joint]).collect();
    let shares = matrices.iter().filter_map(|matrix| share_of_all(matrix, &kd, &alone.omega, delay_s));
    let share = shares.fold(1.0, f64::min);
    for omega in &mut alone.omega {
        *omega *= share;
    }
    let with_model = Loops { omega: with_model, damping: vec![1.0; dof] };
    Ok(DerivedControllers {
        model_free: alone.joint_pd(&largest, left),
        first: with_nominal.computed_torque(left),
        first_model,
        model_based: with_model.computed_torque(1.0),
        model_free_hz: alone.in_hz(),
        first_hz: with_nominal.in_hz(),
        model_based_hz: with_model.in_hz(),
    })
}

struct Loops {
    /// Natural frequencies, rad/s.
    omega: Vec<f64>,
    /// Damping ratios.
    damping: Vec<f64>,
}

impl Loops {
    /// Loops that stay stable with the lightest drives, but not slower than `stiff`. The inertia with the lightest
    /// drives is the modelled inertia divided by `ratios`.
    fn stable(omega: Vec<f64>, ratios: &[f64], stiff: &[f64], light_delay_s: f64) -> Self {
        let of_joint = |((omega, &ratio), stiff): ((f64, &f64), &f64)| {
            if omega <= highest_omega_if_light(ratio, light_delay_s, 1.0) {
                return (omega, 1.0);
            }
            let highest = highest_omega_if_light(ratio, light_delay_s, LIGHT_DAMPING);
            (omega.min(highest.max(*stiff)), LIGHT_DAMPING)
        };
        let (omega, damping) = omega.into_iter().zip(ratios).zip(stiff).map(of_joint).unzip();
        Self { omega, damping }
    }

    fn each(&self, of: &dyn Fn(usize) -> f64) -> PerJoint {
        PerJoint::Each((0..self.omega.len()).map(of).collect())
    }

    fn joint_pd(&self, inertia: &[f64], share: f64) -> ControllerSettings {
        let Self { omega, damping } = self;
        ControllerSettings::JointPd(JointPdSettings {
            kp: self.each(&|joint| omega[joint].powi(2) * share * inertia[joint]),
            kd: self.each(&|joint| 2.0 * damping[joint] * omega[joint] * share * inertia[joint]),
        })
    }

    fn computed_torque(&self, share: f64) -> ControllerSettings {
        let Self { omega, damping } = self;
        ControllerSettings::ComputedTorque(ComputedTorqueSettings {
            kp: self.each(&|joint| share * omega[joint].powi(2)),
            kd: self.each(&|joint| 2.0 * damping[joint] * share.sqrt() * omega[joint]),
            friction: FrictionCompensation::Reference,
        })
    }

    fn in_hz(&self) -> Vec<f64> {
        self.omega.iter().map(|omega| omega / core::f64::consts::TAU).collect()
    }
}

/// Largest inertia about each joint, with the other joints fixed.
fn largest_inertia(robot: &ParametricModel, matrices: &[DMatrix<f64>]) -> Result<Vec<f64>, SimulationError> {
    let mut largest = vec![0.0_f64; robot.dof()];
    for matrix in matrices {
        largest.iter_mut().enumerate().for_each(|(joint, most)| *most = most.max(matrix[(joint, joint)]));
    }
    for (joint, inertia) in robot.model().joints().iter().zip(&largest) {
        let what = format!("nominal inertia about {}", joint.name);
        require(
            *inertia > 0.0 && inertia.is_finite(),
            what,
            *inertia,
            "state the gains: the robot description has no inertia",
        )?;
    }
    Ok(largest)
}

/// Natural frequency of each joint at which typical friction F would keep it 80 % of the largest tracking error away
/// from its path, rad/s: `√(F / (left · M_jj · e))`. It is 0 for a joint with unknown effort limit.
fn stiff_enough(
    robot: &ParametricModel,
    matrices: &[DMatrix<f64>],
    left: f64,
    tracking_error: Option<&[f64]>,
) -> Vec<f64> {
    let own = robot.model().characteristic_scale();
    let of_joint = |(joint, description): (usize, &dynident_model::Joint)| {
        let Some(effort) = description.limits.effort else { return 0.0 };
        let default = if description.is_rotary() { TRACKING_RAD } else { own.metres(TRACKING_M) };
        let error = 0.8 * tracking_error.map_or(default, |stated| stated[joint]);
        let least = matrices.iter().fold(f64::INFINITY, |least, matrix| least.min(matrix[(joint, joint)]));
        (2.0 * FRICTION * effort / (left * least * error)).sqrt()
    };
    robot.model().joints().iter().enumerate().map(of_joint).collect()
}

/// Ratio of actual to commanded acceleration of each joint under computed torque with the mass matrices `matrices`,
/// if the true ones are `light`: the largest `(M_light⁻¹ M)_jj`, at least 1.
fn inertia_ratios(matrices: &[DMatrix<f64>], light: &[DMatrix<f64>], dof: usize) -> Vec<f64> {
    let mut ratios = vec![1.0_f64; dof];
    for (matrix, light) in matrices.iter().zip(light) {
        let Some(own) = light.clone().cholesky() else { continue };
        let product = own.inverse() * matrix;
        ratios.iter_mut().enumerate().for_each(|(joint, most)| *most = most.max(product[(joint, joint)]));
    }
    ratios
}

/// Lowest inertia of each joint with the other joints free, `1 / (M⁻¹)_jj`.
fn lightest_inertia(matrices: &[DMatrix<f64>], dof: usize) -> Vec<f64> {
    let mut lightest = vec![f64::INFINITY; dof];
    for inverse in matrices.iter().filter_map(|matrix| matrix.clone().cholesky().map(|own| own.inverse())) {
        lightest.iter_mut().enumerate().for_each(|(joint, least)| *least = least.min(1.0 / inverse[(joint, joint)]));
    }
    lightest
}

fn mass_matrices(
    robot: &ParametricModel,
    references: &[&Reference],
    parameters: &[f64],
) -> Result<Vec<DMatrix<f64>>, SimulationError> {
    let mut model = ControllerModel::from_parameters(robot.model(), robot.terms(), parameters)?;
    let mut matrices = Vec::new();
    for reference in references {
        let step = (reference.samples() / POSTURES).max(1);
        for sample in (0..reference.samples()).step_by(step) {
            let [q, ..] = at_sample(reference, sample);
            matrices.push(inertia_matrix(&mut model, &q));
        }
    }
    Ok(matrices)
}
