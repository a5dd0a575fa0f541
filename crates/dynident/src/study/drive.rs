//! `[drive]` and `[[coupling]]`: friction, offsets and drive inertia.

use super::arrays::two;
use super::friction::{FrictionChoice, FrictionTerm};
use crate::error::{Expected, StudyError};
use dynident_identification::{GainChoice, OffsetChoice};
use dynident_model::terms::Coupling;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How a Coulomb step looks near zero velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CoulombChoice {
    /// No Coulomb friction.
    None,
    /// The sign of the velocity.
    Sign,
    /// `tanh(speed / width)`.
    Smooth,
}

/// `[drive]`: the laws of every joint, and exceptions by joint.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DriveSection {
    /// Inertia of rotor and gear as seen from the joint: where torque is measured at the link it does not show. By
    /// default `identify` lets the logs say whether it does, and the other commands have none.
    pub drive_inertia: Option<bool>,
    /// Viscous friction. On by default.
    pub viscous: bool,
    /// Coulomb friction. `"smooth"` by default.
    pub coulomb: CoulombChoice,
    /// Width of the smooth step, rad/s or m/s. By default 0.02 rad/s (m/s) of an arm of 1.2 m, and of other robots as
    /// much in their own seconds, which go by their length and gravity: 0.017 rad/s for a UR10, 0.033 for a TX40.
    pub coulomb_width: Option<f64>,
    /// Velocity below which the sign counts as zero, rad/s or m/s; 0 by default.
    pub coulomb_dead_band: f64,
    /// A constant torque. On by default.
    pub offset: bool,
    /// Whether training logs share their offsets (`"shared"`, the default).
    pub offsets: OffsetChoice,
    /// Who says what a unit of logged torque is worth. The format (`"stated"`) by default.
    pub gains: GainChoice,
    /// How well stated gains are known: one standard deviation in percent of each, independent from joint to joint. It
    /// goes into the error bars of payloads. By default they count as exact.
    pub gain_std_percent: Option<f64>,
    /// Further laws of friction. None by default.
    #[serde(rename = "laws")]
    pub terms: Vec<FrictionTerm>,
    /// Whether the keys above say which friction there is (`"stated"`), or the training logs (`"auto"`). By default
    /// `identify` lets the logs choose where no key above states friction, and the other commands take the keys.
    pub friction: Option<FrictionChoice>,
    /// Where the logs choose: the largest variance inflation with which Coulomb friction may differ by direction,
    /// beside gravity, offset and all other columns. By default `iterate` takes 10, so that no parameter is hardly
    /// known, and the other commands have no limit.
    pub most_inflation: Option<f64>,
    /// Exceptions, by joint name.
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
            offset: true,
            offsets: OffsetChoice::Shared,
            gains: GainChoice::Stated,
            gain_std_percent: None,
            terms: Vec::new(),
            friction: None,
            most_inflation: None,
            joints: BTreeMap::new(),
        }
    }
}

/// What one joint has in place of `[drive]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct JointDrive {
    /// In place of `drive.drive_inertia`.
    pub drive_inertia: Option<bool>,
    /// In place of `drive.viscous`.
    pub viscous: Option<bool>,
    /// In place of `drive.coulomb`.
    pub coulomb: Option<CoulombChoice>,
    /// In place of `drive.coulomb_width`.
    pub coulomb_width: Option<f64>,
    /// In place of `drive.coulomb_dead_band`.
    pub coulomb_dead_band: Option<f64>,
    /// In place of `drive.offset`.
    pub offset: Option<bool>,
    /// In place of `drive.laws`.
    #[serde(rename = "laws")]
    pub terms: Option<Vec<FrictionTerm>>,
    /// In place of `drive.friction`.
    pub friction: Option<FrictionChoice>,
}

/// `[[coupling]]`: a drive whose velocity is `ratios[0] · q̇_first + ratios[1] · q̇_second`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CouplingSection {
    /// Name of the drive in the parameters' symbols.
    pub name: String,
    /// The two joints.
    #[serde(deserialize_with = "two")]
    pub joints: [String; 2],
    /// Drive velocity per joint velocity; 1 and 1 by default.
    #[serde(default = "one_one", deserialize_with = "two")]
    pub ratios: [f64; 2],
    /// Cross inertia. On by default.
    #[serde(default = "yes")]
    pub inertia: bool,
    /// Cross viscous friction. On by default.
    #[serde(default = "yes")]
    pub viscous: bool,
    /// Coulomb friction on the drive's own velocity; by default as `drive.coulomb`.
    #[serde(default)]
    pub coulomb: Option<CoulombChoice>,
}

impl DriveSection {
    /// Whether this joint's drive has inertia, where a key says so.
    pub(crate) fn drive_inertia_of(&self, joint: &str) -> Option<bool> {
        self.joints.get(joint).and_then(|own| own.drive_inertia).or(self.drive_inertia)
    }

    /// Who says which friction this joint has, where a key does; `None` where all keys of friction, the joint's and
    /// those of all joints, are as they are by default.
    pub(crate) fn friction_of(&self, joint: &str) -> Option<FrictionChoice> {
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
}

impl CouplingSection {
    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        if self.ratios.iter().any(|ratio| !Coupling::RATIOS.contains(&ratio.abs())) {
            return Err(StudyError::Numbers {
                key: "ratios".to_owned(),
                values: self.ratios.to_vec(),
                expected: "numbers of 1e-6 to 1e6 in size, positive or negative",
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
