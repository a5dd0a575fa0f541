//! `[[payload]]` and `[arm]`: what the arm carries in which log, and an arm that is known already.

use super::arrays::exactly;
use crate::error::StudyError;
use dynident_identification::payload::Refit;
use dynident_model::{InertialParameters, Mat3, Vec3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// `[[payload]]`: something that some logs were recorded with, at a link of the robot. A `[[log]]` carries it by its
/// name. Without `mass_kg` it is estimated; with `mass_kg` and `com_m` it is known; with
/// `mass_kg` alone, as from a balance, the rest is estimated.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PayloadSection {
    /// What logs call it.
    pub name: String,
    /// The link that it is fixed to: its mass, centre of mass and inertia are in that link's frame.
    pub link: String,
    /// Its mass, where it is known.
    #[serde(default)]
    pub mass_kg: Option<f64>,
    /// Its centre of mass in the link's frame, where it is known.
    #[serde(default, deserialize_with = "exactly")]
    pub com_m: Option<[f64; 3]>,
    /// Its inertia about its centre of mass, axes of the link's frame: xx, xy, xz, yy, yz, zz. Zero by default, which
    /// is a point mass.
    #[serde(default, deserialize_with = "exactly")]
    pub inertia_at_com_kgm2: Option<[f64; 6]>,
}

/// `[arm]`: the arm by an earlier identification. Only payloads are estimated then, and the arm's error bars go into
/// theirs.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ArmSection {
    /// The earlier `result.json`, of the same robot with the same drives.
    pub result: PathBuf,
    /// What is fitted again; nothing by default.
    #[serde(default)]
    pub refit: Refit,
}

/// A body's pseudo-inertia may be this much negative, beside its largest entry: rounding of a thin body's inertia in
/// print.
const ROUNDING: f64 = 1.0e-6;

impl PayloadSection {
    /// Its mass, where that is all that is known.
    pub(crate) fn known_mass_kg(&self) -> Option<f64> {
        self.mass_kg.filter(|_| self.com_m.is_none())
    }

    /// Its ten parameters in the link's frame, where it is known.
    pub(crate) fn known(&self) -> Option<InertialParameters> {
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
                    "what is known of it",
                    "a known payload has mass_kg and com_m (and inertia_at_com_kgm2 unless it is a point), one to estimate has none of them or a positive mass_kg alone",
                ));
            }
        }
        let Some(known) = self.known() else { return Ok(()) };
        let pseudo_inertia = known.pseudo_inertia();
        if known.mass_kg() <= 0.0 || pseudo_inertia.symmetric_eigenvalues().min() < -ROUNDING * pseudo_inertia.amax() {
            return Err(StudyError::conflict(
                "no body has this mass and inertia",
                "the mass must be positive and no moment about the centre of mass larger than the sum of the other two",
            ));
        }
        Ok(())
    }
}
