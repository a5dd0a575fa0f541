//! `[simulation]`: deviations of the simulated robot from its description, sensors and limits.

use super::drive::{CouplingSection, DriveSection};
use super::robot_model::{StudyRobot, torque_terms};
use crate::error::{Expected, StudyError};
use dynident_iteration::SimulatedRobot;
use dynident_model::sample::Random;
use dynident_model::terms::{JointProperty, TermAction, TorqueTerm};
use dynident_model::{InertialParameters, Model};
use dynident_simulation::{
    Integrator, LoopSettings, PerJoint, Plant, RunLimits, SensorSettings, Start, with_length_errors,
};
use nalgebra::Matrix4;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Relative variation of lengths within a body, relative to the variation of its mass: a third, so that the mass
/// distributions also differ in shape.
const LENGTH_SPREAD_PER_MASS_SPREAD: f64 = 1.0 / 3.0;

/// Section `[simulation]`; every key is optional. By default the robot is as described, without friction, with
/// perfect sensors.
///
/// ```
/// let section: dynident_study::SimulationSection = toml::from_str(
///     "off_percent = 30.0\nviscous = 5.0\ncoulomb = [8.0, 8.0]\nsensors = { position_std = 1.7e-5, torque_std = 0.05 }",
/// )?;
/// assert!(section.validate(2).is_ok() && section.validate(3).is_err());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SimulationSection {
    /// Sampling rate of the controller, Hz; 1000 by default.
    pub rate_hz: f64,
    /// Deviation of the simulated bodies from the robot description, percent: every mass is larger or smaller by this
    /// percentage, and lengths within bodies by up to a third of it. Bodies stay physically consistent. 0 by default.
    pub off_percent: f64,
    /// True friction of the joints, with the keys of `[drive]`; it can differ from the friction of the study's model.
    /// By default that of the study.
    pub drive: Option<DriveSection>,
    /// Viscous friction of the joints, Nm s/rad (N s/m); 0 by default. This key and the following three are used only
    /// if the simulated drive has the corresponding term.
    pub viscous: PerJoint,
    /// Coulomb friction, Nm (N); 0 by default.
    pub coulomb: PerJoint,
    /// Drive inertia, kg m² (kg); 0 by default.
    pub drive_inertia: PerJoint,
    /// Constant torques, Nm (N); 0 by default.
    pub offset: PerJoint,
    /// Parameters of terms by their symbols (`fs1 = 2.0`); these override the keys above.
    #[serde(rename = "laws")]
    pub terms: BTreeMap<String, f64>,
    /// Standard deviation of the true joint positions (geometry) relative to the robot description, m; 0 by default.
    pub length_std_m: f64,
    /// Standard deviation of the directions of the true joint axes relative to the robot description, rad; 0 by
    /// default.
    pub angle_std_rad: f64,
    /// Integrator; semi-implicit Euler with one step per sample by default.
    pub integrator: Integrator,
    /// Start of a run; by default on the reference.
    pub start: Start,
    /// Whether torques saturate at the effort limits of the robot description; true by default.
    pub effort_limits: bool,
    /// Limits that stop a run; they replace those of the robot description.
    pub limits: RunLimits,
    /// Sensors; perfect by default.
    pub sensors: SensorSettings,
    /// Seed of the deviations from the robot description; 1 by default. Noise has a separate seed in `sensors`.
    pub seed: u64,
}

impl Default for SimulationSection {
    fn default() -> Self {
        Self {
            rate_hz: 1000.0,
            off_percent: 0.0,
            drive: None,
            viscous: 0.0.into(),
            coulomb: 0.0.into(),
            drive_inertia: 0.0.into(),
            offset: 0.0.into(),
            terms: BTreeMap::new(),
            length_std_m: 0.0,
            angle_std_rad: 0.0,
            integrator: Integrator::default(),
            start: Start::default(),
            effort_limits: true,
            limits: RunLimits::default(),
            sensors: SensorSettings::default(),
            seed: 1,
        }
    }
}

/// The simulated robot and its true parameters.
#[derive(Debug)]
pub struct SimulatedTruth {
    /// The robot.
    pub robot: SimulatedRobot,
    /// Bodies of the simulated robot.
    pub model: Model,
    /// Torque terms of its joints.
    pub terms: Vec<TorqueTerm>,
    /// All parameters: ten per body, one per term.
    pub parameters: Vec<f64>,
    /// True values of the base parameters of the study's model; terms that the simulated robot does not have are
    /// zero.
    pub base_values: Vec<f64>,
}

impl SimulationSection {
    /// Checks the settings for `joints` joints.
    ///
    /// # Errors
    /// The first invalid key, with its valid range.
    pub fn validate(&self, joints: usize) -> Result<(), StudyError> {
        Expected::Range(1e-3, 1e6).check("rate_hz", self.rate_hz)?;
        Expected::Range(0.0, 90.0).check("off_percent", self.off_percent)?;
        for (what, values) in
            [("viscous", &self.viscous), ("coulomb", &self.coulomb), ("drive_inertia", &self.drive_inertia)]
        {
            values.values(what, joints, "give zero or a finite positive number", |x| x >= 0.0 && x.is_finite())?;
        }
        self.offset.values("offset", joints, "give a finite number", f64::is_finite)?;
        Ok(self.loop_settings(None).validate(joints)?)
    }

    /// Settings of a simulated run, with the effort limits of `model`.
    pub(crate) fn loop_settings(&self, model: Option<&Model>) -> LoopSettings {
        let mut limits = self.limits.clone();
        if let Some(model) = model.filter(|_| self.effort_limits && limits.torque.is_none()) {
            limits.torque = RunLimits::of_model(model).torque;
        }
        LoopSettings {
            integrator: self.integrator,
            start: self.start.clone(),
            limits,
            sensors: self.sensors.clone(),
            accelerations: false,
        }
    }

    /// Builds the simulated robot from a study's robot; `coupling` contains the study's coupled drives.
    ///
    /// # Errors
    /// Invalid numbers, bodies without inertials, terms without a parameter, a robot that cannot be simulated.
    pub fn truth(&self, coupling: &[CouplingSection], robot: &StudyRobot) -> Result<SimulatedTruth, StudyError> {
        let described = robot.model();
        let terms = match &self.drive {
            Some(drive) => {
                drive.validate()?;
                let declared = robot.terms().iter().filter(|term| term.is_declared()).cloned();
                torque_terms(drive, coupling, described)?.into_iter().chain(declared).collect()
            }
            None => robot.terms().to_vec(),
        };
        self.validate(described.dof())?;
        let unknown = described.bodies_without_prior();
        if !unknown.is_empty() {
            let fix = "a simulation needs the inertial parameters of all bodies: add them to the robot description";
            return Err(StudyError::NoInertials { bodies: unknown.into_iter().map(str::to_owned).collect(), fix });
        }
        let bodies = self.bodies(described);
        let model = described.with_inertials(&bodies)?;
        let model = with_length_errors(&model, self.length_std_m, self.angle_std_rad, self.seed)?;
        let symbols: Vec<String> = terms.iter().map(TorqueTerm::symbol).collect();
        if let Some(other) = self.terms.keys().find(|symbol| !symbols.contains(symbol)) {
            return Err(StudyError::Unknown { key: "laws", what: "law", name: other.clone(), known: symbols });
        }
        let term_parameters = terms
            .iter()
            .zip(&symbols)
            .map(|(term, symbol)| {
                let by_kind = term.described(described).filter(|_| term.is_declared()).or_else(|| {
                    term.own_joint().and_then(|joint| match (term.property(), term.action()) {
                        (Some(JointProperty::Damping), _) => Some(self.viscous.of(joint)),
                        (Some(JointProperty::Friction), _) => Some(self.coulomb.of(joint)),
                        (Some(JointProperty::DriveInertia), _) => Some(self.drive_inertia.of(joint)),
                        (None, TermAction::Constant) => Some(self.offset.of(joint)),
                        // The stiffness of the spring in the robot description was already used above.
                        (Some(JointProperty::Stiffness), _)
                        | (
                            None,
                            TermAction::Inertia { .. }
                            | TermAction::Damping { .. }
                            | TermAction::Friction(_)
                            | TermAction::Hysteresis
                            | TermAction::Temperature
                            | TermAction::State(_),
                        ) => None,
                    })
                });
                let value = self.terms.get(symbol).copied().or(by_kind);
                value.ok_or_else(|| {
                    let nominal = if term.is_declared() { ", or its nominal in [[torque]]" } else { "" };
                    StudyError::missing(format!("laws.{symbol}"), format!("give its value, {symbol} = ...{nominal}"))
                })
            })
            .collect::<Result<Vec<f64>, StudyError>>()?;
        let plant = Plant::new(&model, &terms, &term_parameters)?;
        let simulated = SimulatedRobot::new(plant, self.loop_settings(Some(described)))?;
        let of_law = |term: &TorqueTerm| {
            let place = symbols.iter().position(|symbol| *symbol == term.symbol());
            place.map_or(0.0, |place| term_parameters[place])
        };
        let of_bodies = model.parameter_vector();
        let sought = of_bodies.iter().copied().chain(robot.terms().iter().map(of_law)).collect::<Vec<f64>>();
        let base_values = robot.base().values(&sought);
        let parameters = [of_bodies, term_parameters].concat();
        Ok(SimulatedTruth { robot: simulated, model, terms, parameters, base_values })
    }

    /// Bodies of the simulated robot. The pseudo-inertia P becomes s D P D with a diagonal D, which keeps it
    /// physically consistent.
    fn bodies(&self, model: &Model) -> Vec<InertialParameters> {
        let mut random = Random::new(self.seed);
        let off = 0.01 * self.off_percent;
        let stretched = |inertial: &InertialParameters, random: &mut Random| {
            let sign = if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
            let mut stretch = Matrix4::identity();
            for axis in 0..3 {
                stretch[(axis, axis)] = 1.0 + LENGTH_SPREAD_PER_MASS_SPREAD * random.uniform(-off, off);
            }
            let p = (1.0 + sign * off) * stretch * inertial.pseudo_inertia() * stretch;
            // Conversion from second moments back to inertia: I = tr(S) 1 - S.
            let trace = p[(0, 0)] + p[(1, 1)] + p[(2, 2)];
            InertialParameters([
                p[(3, 3)],
                p[(0, 3)],
                p[(1, 3)],
                p[(2, 3)],
                trace - p[(0, 0)],
                -p[(0, 1)],
                -p[(0, 2)],
                trace - p[(1, 1)],
                -p[(1, 2)],
                trace - p[(2, 2)],
            ])
        };
        let bodies = model.inertials().iter();
        if off == 0.0 { bodies.copied().collect() } else { bodies.map(|body| stretched(body, &mut random)).collect() }
    }
}
