//! Gains of a first controller from the nominal model, its uncertainty, and a stated bandwidth.

use crate::posture::{at_sample, inertia_matrix};
use crate::typical_drives::with_typical_drives;
use dynident_dynamics::ParametricModel;
use dynident_simulation::controllers::{
    ComputedTorqueSettings, ControllerModel, ControllerSettings, FrictionCompensation, JointPdSettings,
};
use dynident_simulation::{PerJoint, Reference, SimulationError, require};

/// Postures of each motion that are looked at.
const POSTURES: usize = 200;

/// Controllers whose gains come from the nominal model and a bandwidth.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedControllers {
    /// Joint PD.
    pub model_free: ControllerSettings,
    /// Computed torque with the nominal model; joint PD with its gravity where it knows nothing of the drives.
    pub first: ControllerSettings,
    /// Computed torque with the newest model.
    pub model_based: ControllerSettings,
}

/// Controllers of a robot whose nominal bodies are known, critically damped, with the natural frequency `ω = 2π
/// bandwidth` of each joint:
///
/// * joint PD: `K_p = ω² m`, `K_d = 2 ω m`, `m = (1 - uncertainty) max M_jj(q)` along the motions;
/// * computed torque with the nominal model: `K_p = (1 - uncertainty) ω²`, `K_d = 2 √K_p`; where the model has drive
///   inertia or friction of which the description says nothing, joint PD with the nominal gravity takes its place, and
///   M_jj has the inertia of a typical drive (the effort limit accelerates it by 300 rad/s²);
/// * computed torque with an identified model: `K_p = ω²`, `K_d = 2 ω`.
///
/// So the lightest robot that the uncertainty leaves is not faster than stated: under computed torque anywhere, under
/// joint PD in the posture that is heaviest for the joint (in lighter ones it is faster, and more than critically
/// damped). A heavier one is slower, and sags more: whether that is enough, the rehearsal shows.
///
/// # Errors
/// A bandwidth that is not positive, a bound that takes all inertia away, a nominal model without inertia.
pub fn derived_controllers(
    robot: &ParametricModel,
    references: &[&Reference],
    bandwidth_hz: &PerJoint,
    uncertainty_percent: f64,
) -> Result<DerivedControllers, SimulationError> {
    let dof = robot.dof();
    let bandwidth =
        bandwidth_hz.values("bandwidth_hz", dof, "give more than 0 and at most 100000 Hz", |f| f > 0.0 && f <= 1e5)?;
    let typical = with_typical_drives(robot);
    let parameters = typical.as_deref().unwrap_or(robot.nominal());
    let mut model = ControllerModel::from_parameters(robot.model(), robot.terms(), parameters)?;
    let mut largest = vec![0.0_f64; dof];
    for reference in references {
        let step = (reference.samples() / POSTURES).max(1);
        for sample in (0..reference.samples()).step_by(step) {
            let [q, ..] = at_sample(reference, sample);
            let matrix = inertia_matrix(&mut model, &q);
            largest.iter_mut().enumerate().for_each(|(joint, most)| *most = most.max(matrix[(joint, joint)]));
        }
    }
    for (joint, inertia) in robot.model().joints().iter().zip(&largest) {
        let what = format!("nominal inertia about {}", joint.name);
        require(*inertia > 0.0 && inertia.is_finite(), what, *inertia, "state the gains: the description has none")?;
    }
    let left = 1.0 - 0.01 * uncertainty_percent;
    let omega: Vec<f64> = bandwidth.iter().map(|f| core::f64::consts::TAU * f).collect();
    let each = |of: &dyn Fn(usize) -> f64| PerJoint::Each((0..dof).map(of).collect());
    let pd = JointPdSettings {
        kp: each(&|joint| omega[joint].powi(2) * left * largest[joint]),
        kd: each(&|joint| 2.0 * omega[joint] * left * largest[joint]),
    };
    let computed = |share: f64| {
        ControllerSettings::ComputedTorque(ComputedTorqueSettings {
            kp: each(&|joint| share * omega[joint].powi(2)),
            kd: each(&|joint| 2.0 * share.sqrt() * omega[joint]),
            friction: FrictionCompensation::Reference,
        })
    };
    Ok(DerivedControllers {
        model_free: ControllerSettings::JointPd(pd.clone()),
        first: if typical.is_some() { ControllerSettings::PdGravity(pd) } else { computed(left) },
        model_based: computed(1.0),
    })
}
