//! Joint parameters of simulators, with error bars.

use crate::descriptions::omitted_terms;
use crate::drive_torque::drive_inertia;
use crate::error::ExportError;
use crate::exported::Exported;
use crate::nearest_friction::{ComparedOver, NearestFriction, TermSensitivity};
use crate::robot_model::RobotModel;
use core::fmt::Write;
use dynident_text::markdown;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`SimulatorFile`].
pub const SIMULATOR_SCHEMA: &str = "dynident/simulator/1";

const NO_DRIVE_INERTIA_NOTE: &str = "the study has no drive inertia, so that a part of it is included in the links (drive.drive_inertia = true identifies it)";

const NO_FRICTION_NOTE: &str = "not in the identified law, or at its bound of zero";

/// Joint parameters of a simulator in addition to the bodies: `τ = armature q̈ + damping q̇ + frictionloss sign(q̇)`,
/// delay and gain of the drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulatorFile {
    /// Name and version of the schema, [`SIMULATOR_SCHEMA`].
    pub schema: String,
    /// Name of the robot.
    pub name: String,
    /// Name and version of the program that wrote the file.
    pub written_by: String,
    /// Origin of the values, contents that simulators cannot represent, and problems of the values, one sentence
    /// each.
    pub notes: Vec<String>,
    /// Common delay of all joints, ms, defined like [`SimulatorJoint::delay`]; null if the logs do not determine it.
    pub common_delay: Option<SimulatorValue>,
    /// Joints in the order of the robot.
    pub joints: Vec<SimulatorJoint>,
}

/// Parameters of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulatorJoint {
    /// Name of the joint.
    pub name: String,
    /// Drive inertia, kg m² (kg at a prismatic joint): MuJoCo's `armature`, PhysX's `armature`.
    pub armature: SimulatorValue,
    /// Viscous friction, Nm s/rad (N s/m): MuJoCo's `damping`, PhysX's `viscousFrictionCoefficient`.
    pub damping: SimulatorValue,
    /// Coulomb friction, Nm (N): MuJoCo's `frictionloss`, PhysX's `staticFrictionEffort` and `dynamicFrictionEffort`.
    pub frictionloss: SimulatorValue,
    /// Error of the approximation of the identified friction by `damping` and `frictionloss`.
    pub friction_error: FrictionError,
    /// Delay of the logged torque relative to the motion that it causes, ms. For a measured torque it is the delay of
    /// the measurement. For a commanded torque it is minus the delay of the actuator. Null if the logs do not
    /// determine it.
    pub delay: Option<SimulatorValue>,
    /// Joint torque per unit of the logged torque, Nm (N).
    pub actuator_gain: SimulatorValue,
}

/// A value with its error bar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulatorValue {
    /// The value.
    pub value: f64,
    /// Half-width of the 95 % interval; null if the logs do not determine it, with the reason in `note`.
    pub half_width_95: Option<f64>,
    /// Unit of the value.
    pub unit: String,
    /// Remark on the value; absent if there is no remark.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// Error of the simplified friction relative to the identified friction and offset of a joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionError {
    /// Root mean square of the error, Nm (N).
    pub rms_nm: f64,
    /// Largest error, Nm (N).
    pub most_nm: f64,
    /// Largest velocity at which the friction was compared, rad/s (m/s).
    pub most_speed_rad_s: f64,
    /// Which velocities were compared. `recorded-motion`: velocities of the fitted logs, except near rest.
    /// `velocity-limit`: equally spaced velocities up to the joint's limit, because no velocities were recorded.
    pub over: String,
}

/// Error bars of torque terms, and delays and gains of the drives.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveKnowledge {
    /// Covariance of the values of each pair of terms, scaled such that the square root of a variance is the
    /// half-width of the 95 % interval; `None` for terms without an individual interval.
    pub term_products: Vec<Vec<Option<f64>>>,
    /// For each term, the reason why it has no individual interval; `None` if it has one.
    pub term_notes: Vec<Option<String>>,
    /// Common delay of all joints.
    pub common_delay: Option<SimulatorValue>,
    /// Delay of each joint.
    pub delays: Vec<Option<SimulatorValue>>,
    /// Actuator gain of each joint.
    pub actuator_gains: Vec<SimulatorValue>,
}

impl SimulatorFile {
    /// Returns the parameters of `robot`, whose friction is fitted over its recorded velocities. A parameter that is
    /// the combination `a` of the terms' values has the half-width h with `h² = aᵀ H a` and H =
    /// [`DriveKnowledge::term_products`].
    ///
    /// # Errors
    /// [`ExportError::Values`] if `knowledge` does not match the robot.
    pub fn of(robot: &RobotModel, knowledge: &DriveKnowledge, further: &[String]) -> Result<Self, ExportError> {
        let (model, terms) = (robot.model(), robot.terms().count());
        let DriveKnowledge { term_products, term_notes, common_delay, delays, actuator_gains } = knowledge;
        let same = |found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(ExportError::Values { expected, found }) }
        };
        same(term_products.len(), terms)?;
        term_products.iter().try_for_each(|row| same(row.len(), terms))?;
        same(term_notes.len(), terms)?;
        same(delays.len(), model.dof())?;
        same(actuator_gains.len(), model.dof())?;
        let rotors = drive_inertia(robot);
        let joints = (0..model.dof()).map(|joint| {
            let is_rotary = model.joints()[joint].is_rotary();
            let unit = |turning: &str, sliding: &str| if is_rotary { turning.to_owned() } else { sliding.to_owned() };
            let nearest = NearestFriction::of(robot, joint);
            let shares = NearestFriction::shares(robot, joint);
            let of_shares = |share: fn(&TermSensitivity) -> f64| {
                shares.iter().map(|one| (one.term, share(one))).filter(|(_, share)| *share != 0.0).collect::<Vec<_>>()
            };
            let drives =
                robot.terms().enumerate().map(|(term, (kind, _))| (term, kind.mass_matrix_entry(joint, joint)));
            let drives: Vec<_> = drives.filter(|(_, share)| *share != 0.0).collect();
            let value = |value: f64, parts: &[(usize, f64)], none: &str, unit: String| {
                let (half_width_95, note) = knowledge.bar(parts, none);
                SimulatorValue { value, half_width_95, unit, note }
            };
            SimulatorJoint {
                name: model.joints()[joint].name.clone(),
                armature: value(
                    rotors[joint * model.dof() + joint],
                    &drives,
                    NO_DRIVE_INERTIA_NOTE,
                    unit("kg m^2", "kg"),
                ),
                damping: value(
                    nearest.viscous,
                    &of_shares(|one| one.viscous),
                    NO_FRICTION_NOTE,
                    unit("Nm s/rad", "N s/m"),
                ),
                frictionloss: value(nearest.coulomb, &of_shares(|one| one.coulomb), NO_FRICTION_NOTE, unit("Nm", "N")),
                friction_error: FrictionError {
                    rms_nm: nearest.rms_error,
                    most_nm: nearest.most_error,
                    most_speed_rad_s: nearest.most_speed,
                    over: match nearest.over {
                        ComparedOver::RecordedMotion => "recorded-motion".to_owned(),
                        ComparedOver::VelocityLimit => "velocity-limit".to_owned(),
                    },
                },
                delay: delays[joint].clone(),
                actuator_gain: actuator_gains[joint].clone(),
            }
        });
        let joints = joints.collect();
        let notes = further.iter().cloned().chain(omitted_terms(robot, true)).collect();
        Ok(Self {
            schema: SIMULATOR_SCHEMA.to_owned(),
            name: model.name().to_owned(),
            written_by: format!("dynident {}", env!("CARGO_PKG_VERSION")),
            notes,
            common_delay: common_delay.clone(),
            joints,
        })
    }

    /// The content as JSON.
    ///
    /// # Errors
    /// [`ExportError::Json`] for values that are not finite.
    pub fn json(&self) -> Result<Exported, ExportError> {
        let text = dynident_text::json::to_string_pretty(self)
            .map_err(|error| ExportError::Json { message: error.to_string() });
        Ok(Exported { text: text? + "\n", notes: self.notes.clone() })
    }

    /// A Markdown table, followed by the notes.
    pub fn table(&self) -> Exported {
        let mut text = format!(
            "# {}\n\n| joint | armature | damping | frictionloss | friction off by, rms (most) | delay | gain |\n| --- | --- | --- | --- | --- | --- | --- |\n",
            markdown(&self.name)
        );
        let mut remarks = Vec::new();
        for joint in &self.joints {
            let name = markdown(&joint.name);
            let delay = joint.delay.as_ref();
            let _ = writeln!(
                text,
                "| {name} | {} | {} | {} | {:.3} ({:.3}) | {} | {} |",
                with_bar(&joint.armature),
                with_bar(&joint.damping),
                with_bar(&joint.frictionloss),
                joint.friction_error.rms_nm,
                joint.friction_error.most_nm,
                delay.map_or("not determined".to_owned(), with_bar),
                with_bar(&joint.actuator_gain)
            );
            let values = [
                ("armature", Some(&joint.armature)),
                ("damping", Some(&joint.damping)),
                ("frictionloss", Some(&joint.frictionloss)),
                ("delay", delay),
                ("gain", Some(&joint.actuator_gain)),
            ];
            let said = values.into_iter().filter_map(|(what, value)| Some((what, value?.note.as_ref()?)));
            remarks.extend(said.map(|(what, note)| (format!("{what}: {}", markdown(note)), name.clone())));
        }
        text += "\nError bars are half the widths of 95 % intervals; `?` if the logs do not determine them.\n";
        if let Some(delay) = &self.common_delay {
            let _ = writeln!(text, "Delay of all joints together: {}.", with_bar(delay));
        }
        // Equal remarks of several joints are merged.
        let mut said: Vec<(String, Vec<String>)> = Vec::new();
        for (remark, joint) in remarks {
            match said.iter_mut().find(|(earlier, _)| *earlier == remark) {
                Some((_, joints)) => joints.push(joint),
                None => said.push((remark, vec![joint])),
            }
        }
        let remarks = said.into_iter().map(|(remark, joints)| format!("{}, {remark}", joints.join(", ")));
        let lines: Vec<String> = remarks.chain(self.notes.iter().map(|note| markdown(note))).collect();
        if !lines.is_empty() {
            let _ = writeln!(text, "\n- {}", lines.join("\n- "));
        }
        Exported { text, notes: self.notes.clone() }
    }
}

impl DriveKnowledge {
    /// Half-width of the interval of `Σ share value` over the terms, or the reason why there is no interval.
    fn bar(&self, parts: &[(usize, f64)], none: &str) -> (Option<f64>, Option<String>) {
        let notes: Vec<&str> = parts.iter().filter_map(|(term, _)| self.term_notes[*term].as_deref()).collect();
        let note = (!notes.is_empty()).then(|| notes.join("; "));
        if parts.is_empty() {
            return (None, Some(none.to_owned()));
        }
        let pairs = parts.iter().flat_map(|a| parts.iter().map(move |b| (a, b)));
        let square: Option<f64> = pairs.map(|(a, b)| Some(a.1 * b.1 * self.term_products[a.0][b.0]?)).sum();
        (square.map(|square| square.max(0.0).sqrt()), note)
    }
}

/// A value with its error bar; both are rounded to two significant digits of the error bar.
fn with_bar(value: &SimulatorValue) -> String {
    let unit = &value.unit;
    match value.half_width_95.filter(|half| *half > 0.0 && half.is_finite()) {
        Some(half) => {
            let digits = (1.0 - half.log10().floor()).clamp(0.0, 12.0) as usize;
            format!("{:.digits$} ± {half:.digits$} {unit}", value.value)
        }
        None => format!("{:.4} ± ? {unit}", value.value),
    }
}
