//! `[[payload]]` and `[arm]`: payloads in the logs, and an arm that was identified earlier.

use super::arrays::exactly;
use crate::error::StudyError;
use dynident_identification::payload::Refit;
use dynident_model::{InertialParameters, Mat3, Vec3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Section `[[payload]]`: a payload at a link of the robot during some recordings. A `[[log]]` refers to it by name.
/// Without `mass_kg` all its parameters are estimated. With `mass_kg` and `com_m` the payload is known. With
/// `mass_kg` alone (weighed on a scale) the other parameters are estimated.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PayloadSection {
    /// Name by which logs refer to the payload.
    pub name: String,
    /// The link to which the payload is fixed; the payload's parameters are in the frame of this link.
    pub link: String,
    /// Mass, kg, if known.
    #[serde(default)]
    pub mass_kg: Option<f64>,
    /// Centre of mass in the link's frame, m, if known.
    #[serde(default, deserialize_with = "exactly")]
    pub com_m: Option<[f64; 3]>,
    /// Inertia about the payload's centre of mass, in the axes of the link's frame, kg m²: xx, xy, xz, yy, yz, zz.
    /// Zero (a point mass) by default.
    #[serde(default, deserialize_with = "exactly")]
    pub inertia_at_com_kgm2: Option<[f64; 6]>,
}

/// Section `[arm]`: the arm from an earlier identification. Then only payloads are estimated; their error bars
/// include those of the arm.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ArmSection {
    /// Path of the earlier `result.json`, of the same robot with the same drives.
    pub result: PathBuf,
    /// Parameters of the arm that are estimated again; none by default.
    #[serde(default)]
    pub refit: Refit,
}

/// Largest accepted negative eigenvalue of a pseudo-inertia, relative to its largest entry: rounding in published
/// values of thin bodies.
const MAX_RELATIVE_ROUNDING: f64 = 1.0e-6;

impl PayloadSection {
    /// Mass of a payload of which only the mass is known.
    pub(crate) fn known_mass_kg(&self) -> Option<f64> {
        self.mass_kg.filter(|_| self.com_m.is_none())
    }

    /// The ten parameters of a known payload in the link's frame.
    pub fn known(&self) -> Option<InertialParameters> {
        let [xx, xy, xz, yy, yz, zz] = self.inertia_at_com_kgm2.unwrap_or_default();
        let inertia = Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
        let com = Vec3(self.com_m?);
        self.mass_kg.map(|mass| InertialParameters::from_centre_of_mass(mass, com, &inertia))
    }

    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        let numbers = self.com_m.iter().flatten().chain(self.inertia_at_com_kgm2.iter().flatten());
        if let Some(value) = numbers.chain(&self.mass_kg).find(|value| !value.is_finite() || value.abs() > 1.0e6) {
            let (key, expected) = ("a number".to_owned(), "finite numbers in kg, m and kg m^2");
            return Err(StudyError::Numbers { key, values: vec![*value], expected });
        }
        match (self.mass_kg, self.com_m, self.inertia_at_com_kgm2) {
            (None, None, None) => return Ok(()),
            (Some(mass), None, None) if mass > 0.0 => return Ok(()),
            (Some(_), Some(_), _) => {}
            _ => {
                return Err(StudyError::conflict(
                    "incomplete payload",
                    "give mass_kg and com_m for a known payload (and inertia_at_com_kgm2 unless it is a point mass); give none of them, or only a positive mass_kg, to estimate it",
                ));
            }
        }
        let Some(known) = self.known() else { return Ok(()) };
        if !is_consistent(&known) {
            return Err(StudyError::conflict("mass and inertia are not physically consistent", self.fix()));
        }
        Ok(())
    }

    /// Fix for a payload that is not physically consistent. If the moments are consistent in the order of MuJoCo's
    /// `fullinertia` (xx, yy, zz, xy, xz, yz), this is the line to write.
    fn fix(&self) -> String {
        let general = "the mass must be positive and no moment about the centre of mass larger than the sum of the other two; \
                       inertia_at_com_kgm2 has the order xx, xy, xz, yy, yz, zz";
        let reordered = self.inertia_at_com_kgm2.map(|[xx, yy, zz, xy, xz, yz]| [xx, xy, xz, yy, yz, zz]);
        let other = Self { inertia_at_com_kgm2: reordered, ..self.clone() };
        match (reordered, other.known().is_some_and(|known| is_consistent(&known))) {
            (Some(moments), true) => format!(
                "{general}. The six numbers are consistent in MuJoCo's order (xx, yy, zz, xy, xz, yz); if they are in that order, write \
                 inertia_at_com_kgm2 = {moments:?}"
            ),
            _ => general.to_owned(),
        }
    }
}

fn is_consistent(payload: &InertialParameters) -> bool {
    let pseudo_inertia = payload.pseudo_inertia();
    payload.mass_kg() > 0.0
        && pseudo_inertia.symmetric_eigenvalues().min() >= -MAX_RELATIVE_ROUNDING * pseudo_inertia.amax()
}

#[cfg(test)]
mod tests {
    use super::PayloadSection;

    fn message(numbers: &str) -> Option<String> {
        let text = format!(
            "name = \"p\"\nlink = \"l\"\nmass_kg = 1.0\ncom_m = [0.0, 0.0, 0.1]\ninertia_at_com_kgm2 = {numbers}"
        );
        toml::from_str::<PayloadSection>(&text).unwrap().validate().err().map(|error| error.to_string())
    }

    #[test]
    fn inertia_in_the_order_of_mujoco_is_recognised() {
        assert_eq!(message("[0.02, 0.0, 0.001, 0.03, 0.0, 0.04]"), None);
        let found = message("[0.02, 0.03, 0.04, 0.0, 0.001, 0.0]").unwrap();
        assert!(found.ends_with("write inertia_at_com_kgm2 = [0.02, 0.0, 0.001, 0.03, 0.0, 0.04]"), "{found}");
        let neither = message("[0.02, 0.0, 0.0, 0.03, 0.0, 0.9]").unwrap();
        assert!(neither.ends_with("the order xx, xy, xz, yy, yz, zz"), "{neither}");
    }
}
