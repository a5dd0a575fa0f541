//! `[drive]` and `[[coupling]]`: friction, offsets and drive inertia.

use super::arrays::two;
use super::friction::{ExportableForm, FrictionChoice, FrictionTerm};
use super::servo::ServoSection;
use crate::error::{Expected, StudyError};
use dynident_identification::{GainChoice, OffsetChoice};
use dynident_model::terms::{Coupling, TorqueTerm};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Shape of Coulomb friction near zero velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CoulombChoice {
    /// No Coulomb friction.
    None,
    /// Sign function of the velocity.
    Sign,
    /// Smoothed sign function, `tanh(speed / width)`.
    Smooth,
}

/// Section `[drive]`: friction and drives of all joints, with exceptions by joint.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DriveSection {
    /// Whether a joint has drive inertia (inertia of rotor and gear, reflected to the joint). Torque measured at the
    /// link does not include it. By default `identify` tests with the logs whether it is present, and the other
    /// commands assume none.
    pub drive_inertia: Option<bool>,
    /// Whether the model has viscous friction. True by default.
    pub viscous: bool,
    /// Shape of Coulomb friction near zero velocity. `"smooth"` by default.
    pub coulomb: CoulombChoice,
    /// Width of the smoothed sign function of Coulomb friction, rad/s or m/s. By default 0.02 rad/s (m/s) for an arm
    /// of 1.2 m, scaled by length and gravity for other robots: 0.017 rad/s for a UR10, 0.033 for a Stäubli TX40.
    pub coulomb_width: Option<f64>,
    /// Velocity below which the sign function is zero, rad/s or m/s; 0 by default.
    pub coulomb_dead_band: f64,
    /// Whether the model has a constant torque per joint. True by default, except with `exportable = "urdf"` or
    /// `"mjcf"`, which cannot represent it.
    pub offset: Option<bool>,
    /// Whether training logs share their torque offsets (`"shared"`, the default).
    pub offsets: OffsetChoice,
    /// Source of the torque gains (Nm per unit of logged torque). By default those of the log format (`"stated"`).
    pub gains: GainChoice,
    /// Standard deviation of the gains in the log format, percent of each gain, independent between joints. The error
    /// bars of payloads include it. By default the gains are treated as exact.
    pub gain_std_percent: Option<f64>,
    /// Further friction laws. None by default.
    #[serde(rename = "laws")]
    pub terms: Vec<FrictionTerm>,
    /// Whether the keys above define the friction model (`"stated"`), or Dynident selects it with the training logs
    /// (`"auto"`). By default `identify` selects it unless one of the keys above is given for friction, and the other
    /// commands use the keys.
    pub friction: Option<FrictionChoice>,
    /// Largest variance inflation, caused by all other columns, at which the selection may give Coulomb friction a
    /// separate value per direction. Default 10 in `iterate`, so that every parameter is well determined; no limit in
    /// the other commands.
    pub most_inflation: Option<f64>,
    /// Laws that the selection may use in addition to viscous and Coulomb friction: `asymmetric viscous`, `asymmetric
    /// coulomb`, `sigmoid`, `stribeck`, `cube-root`, `quadratic`, `load`, `maxwell-slip`. All by default.
    pub candidates: Option<Vec<String>>,
    /// Uses only torque terms that this export format represents without loss. This restricts friction laws, and also
    /// offsets and drive inertia unless their keys are given. Bodies are then fitted together with these terms. No
    /// restriction by default: the terms of each export format are then fitted again with the bodies of the complete
    /// model.
    pub exportable: Option<ExportableForm>,
    /// Drives with a position controller, for logs with commands instead of torque. By default their values come from
    /// the logs alone.
    pub servo: Option<ServoSection>,
    /// Exceptions for single joints, by joint name.
    pub joints: BTreeMap<String, JointDrive>,
}

impl Default for DriveSection {
    fn default() -> Self {
        Self {
            drive_inertia: None,
            viscous: true,
            coulomb: CoulombChoice::Smooth,
            coulomb_width: None,
            coulomb_dead_band: 0.0,
            offset: None,
            offsets: OffsetChoice::Shared,
            gains: GainChoice::Stated,
            gain_std_percent: None,
            terms: Vec::new(),
            friction: None,
            most_inflation: None,
            candidates: None,
            exportable: None,
            servo: None,
            joints: BTreeMap::new(),
        }
    }
}

/// Exceptions of one joint from `[drive]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct JointDrive {
    /// Overrides `drive.drive_inertia`.
    pub drive_inertia: Option<bool>,
    /// Overrides `drive.viscous`.
    pub viscous: Option<bool>,
    /// Overrides `drive.coulomb`.
    pub coulomb: Option<CoulombChoice>,
    /// Overrides `drive.coulomb_width`.
    pub coulomb_width: Option<f64>,
    /// Overrides `drive.coulomb_dead_band`.
    pub coulomb_dead_band: Option<f64>,
    /// Overrides `drive.offset`.
    pub offset: Option<bool>,
    /// Overrides `drive.laws`.
    #[serde(rename = "laws")]
    pub terms: Option<Vec<FrictionTerm>>,
    /// Overrides `drive.friction`.
    pub friction: Option<FrictionChoice>,
}

/// Section `[[coupling]]`: a drive whose velocity is `ratios[0] · q̇_first + ratios[1] · q̇_second`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CouplingSection {
    /// Name of the drive, used in the symbols of its parameters.
    pub name: String,
    /// The two joints.
    #[serde(deserialize_with = "two")]
    pub joints: [String; 2],
    /// Drive velocity divided by the velocity of each joint; 1 and 1 by default.
    #[serde(default = "one_one", deserialize_with = "two")]
    pub ratios: [f64; 2],
    /// Whether the drive has cross inertia. True by default.
    #[serde(default = "yes")]
    pub inertia: bool,
    /// Whether the drive has cross viscous friction. True by default.
    #[serde(default = "yes")]
    pub viscous: bool,
    /// Coulomb friction that depends on the velocity of this drive; by default the value of `drive.coulomb`.
    #[serde(default)]
    pub coulomb: Option<CoulombChoice>,
}

impl DriveSection {
    /// Whether the keys give drive inertia to this joint; `None` if no key does.
    pub(crate) fn drive_inertia_of(&self, joint: &str) -> Option<bool> {
        let in_form = (self.exportable == Some(ExportableForm::Urdf)).then_some(false);
        self.joints.get(joint).and_then(|own| own.drive_inertia).or(self.drive_inertia).or(in_form)
    }

    /// Whether a joint has a constant torque.
    pub(crate) fn offset_of(&self, joint: &str) -> bool {
        let in_form = !matches!(self.exportable, Some(ExportableForm::Urdf | ExportableForm::Mjcf));
        self.joints.get(joint).and_then(|own| own.offset).or(self.offset).unwrap_or(in_form)
    }

    /// Source of this joint's friction model according to the keys; `None` if all friction keys have their default
    /// values.
    pub fn friction_of(&self, joint: &str) -> Option<FrictionChoice> {
        let own = self.joints.get(joint);
        if let Some(choice) = own.and_then(|own| own.friction).or(self.friction) {
            return Some(choice);
        }
        let usual = Self::default();
        let of_all = self.viscous == usual.viscous
            && self.coulomb == usual.coulomb
            && self.coulomb_width == usual.coulomb_width
            && self.coulomb_dead_band == usual.coulomb_dead_band
            && self.terms.is_empty();
        let of_joint = own.is_none_or(|own| {
            let width = own.coulomb_width.is_none() && own.coulomb_dead_band.is_none();
            own.viscous.is_none() && own.coulomb.is_none() && width && own.terms.is_none()
        });
        (!(of_all && of_joint)).then_some(FrictionChoice::Stated)
    }

    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        if let Some(width) = self.coulomb_width {
            Expected::Positive.check("drive.coulomb_width", width)?;
        }
        Expected::NotNegative.check("drive.coulomb_dead_band", self.coulomb_dead_band)?;
        if let Some(most) = self.most_inflation {
            Expected::Positive.check("drive.most_inflation", most)?;
        }
        self.validate_candidates()?;
        if let Some(servo) = &self.servo {
            servo.validate()?;
        }
        if let Some(percent) = self.gain_std_percent {
            Expected::Range(0.0, 100.0).check("drive.gain_std_percent", percent)?;
        }
        for (index, term) in self.terms.iter().enumerate() {
            term.law()
                .check()
                .map_err(StudyError::from)
                .map_err(StudyError::at(format!("drive.laws number {}", index + 1)))?;
        }
        for (joint, drive) in &self.joints {
            for (index, term) in drive.terms.iter().flatten().enumerate() {
                let place = format!("drive.joints.{joint}.laws number {}", index + 1);
                term.law().check().map_err(StudyError::from).map_err(StudyError::at(place))?;
            }
            if let Some(width) = drive.coulomb_width {
                Expected::Positive.check(format!("drive.joints.{joint}.coulomb_width"), width)?;
            }
            if let Some(band) = drive.coulomb_dead_band {
                Expected::NotNegative.check(format!("drive.joints.{joint}.coulomb_dead_band"), band)?;
            }
        }
        Ok(())
    }

    fn validate_candidates(&self) -> Result<(), StudyError> {
        let keys = [("drive.candidates", self.candidates.is_some()), ("drive.exportable", self.exportable.is_some())];
        if let Some((key, _)) = keys.iter().find(|(_, is_stated)| *is_stated)
            && self.friction == Some(FrictionChoice::Stated)
        {
            let fix = "it restricts the selection of friction; use friction = \"auto\" or remove one of both keys";
            return Err(StudyError::conflict(*key, fix));
        }
        let known = || TorqueTerm::candidates().map(|law| law.name);
        for name in self.candidates.iter().flatten() {
            if !known().any(|law| law == name) {
                return Err(StudyError::Unknown {
                    key: "drive.candidates",
                    what: "law",
                    name: name.clone(),
                    known: known().map(str::to_owned).collect(),
                });
            }
        }
        Ok(())
    }
}

impl CouplingSection {
    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        if self.ratios.iter().any(|ratio| !Coupling::RATIOS.contains(&ratio.abs())) {
            return Err(StudyError::Numbers {
                key: "ratios".to_owned(),
                values: self.ratios.to_vec(),
                expected: "numbers with an absolute value of 1e-6 to 1e6",
            });
        }
        if self.joints[0] == self.joints[1] {
            return Err(StudyError::conflict("joints", "name two different joints"));
        }
        Ok(())
    }
}

fn one_one() -> [f64; 2] {
    [1.0, 1.0]
}

fn yes() -> bool {
    true
}
