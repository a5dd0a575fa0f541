//! Plausibility of the numbers in a result.

use super::identification::ResultFile;
use super::parameters::BodyResult;
use dynident_model::InertialParameters;
use dynident_model::urdf::MAX_MAGNITUDE;

/// Largest accepted base parameter: a mass times a squared length, each at most [`MAX_MAGNITUDE`].
const MAX_BASE_PARAMETER: f64 = MAX_MAGNITUDE * MAX_MAGNITUDE * MAX_MAGNITUDE;

/// Relative tolerance for numbers of a body that can be computed from others; the quotient may be rounded.
const MAX_RELATIVE_ROUNDING: f64 = 1e-9;

impl ResultFile {
    /// Checks list lengths, magnitudes, agreement of redundant numbers of bodies, and physical consistency if
    /// `physical.consistent` is true.
    ///
    /// # Errors
    /// The problem, with its place and the fix.
    pub(super) fn require_sound_numbers(&self) -> Result<(), String> {
        let count = self.base_parameters.len();
        let matrices = [
            ("base_parameter_covariance", &self.base_parameter_covariance),
            ("base_parameter_joint_covariance", &self.base_parameter_joint_covariance),
        ];
        for (key, rows) in matrices {
            if !rows.is_empty() && (rows.len() != count || rows.iter().any(|row| row.len() != count)) {
                return Err(format!(
                    "{key} does not have {count} rows of {count} numbers, one per base parameter: {FIX}"
                ));
            }
        }
        for (place, parameter) in self.base_parameters.iter().enumerate() {
            for (key, value) in [("value", Some(parameter.value)), ("physical", parameter.physical)] {
                // Values that are not finite are rejected where they are used.
                if let Some(value) = value.filter(|value| value.abs() > MAX_BASE_PARAMETER) {
                    return Err(too_large(&format!("base_parameters[{place}].{key}"), value));
                }
            }
        }
        for (place, body) in self.bodies.iter().enumerate() {
            body.require_sound_numbers(&format!("bodies[{place}] (`{}`)", body.name), self.physical.consistent)?;
        }
        let of_joints = self.joints.iter().enumerate().map(|(place, joint)| (format!("joints[{place}]"), &joint.terms));
        for (place, terms) in of_joints.chain([("couplings".to_owned(), &self.couplings)]) {
            if let Some(term) = terms.iter().find(|term| term.value.abs() > MAX_BASE_PARAMETER) {
                return Err(too_large(&format!("{place}: `{}`", term.symbol), term.value));
            }
        }
        for payload in &self.payloads {
            let Some(body) = &payload.possible else { continue };
            let numbers = body.com_m.iter().chain(&body.inertia_at_com_kgm2).chain([&body.mass_kg]);
            if let Some(&value) = numbers.into_iter().find(|value| value.abs() > MAX_MAGNITUDE) {
                return Err(too_large(&format!("payload `{}`", payload.name), value));
            }
            if body.mass_kg < 0.0 {
                return Err(format!("payload `{}`: mass_kg is {}, negative: {FIX}", payload.name, body.mass_kg));
            }
        }
        Ok(())
    }
}

/// Fix for a damaged result.
const FIX: &str = "the file was edited or damaged; identify again";

fn too_large(place: &str, value: f64) -> String {
    format!("{place} is {value:e}, too large for a robot: {FIX}")
}

impl BodyResult {
    fn require_sound_numbers(&self, place: &str, is_consistent: bool) -> Result<(), String> {
        if let Some(&value) = self.parameters.iter().find(|value| value.abs() > MAX_MAGNITUDE) {
            return Err(too_large(&format!("{place}: a number of parameters"), value));
        }
        let inertial = InertialParameters(self.parameters);
        let com = inertial.com_m().map(|com| com.0);
        let same = |a: f64, b: f64| (a - b).abs() <= MAX_RELATIVE_ROUNDING * a.abs().max(b.abs());
        let all_same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| same(*a, *b));
        let other = if !same(self.mass_kg, inertial.mass_kg()) {
            Some("mass_kg")
        } else if !all_same(&self.inertia_at_origin_kgm2, &self.parameters[4..]) {
            Some("inertia_at_origin_kgm2")
        } else if com.is_some() != self.com_m.is_some()
            || !all_same(&self.com_m.unwrap_or_default(), &com.unwrap_or_default())
        {
            Some("com_m")
        } else {
            None
        };
        if let Some(key) = other {
            return Err(format!("{place}: {key} does not match parameters: {FIX}"));
        }
        let least = inertial.pseudo_inertia().symmetric_eigenvalues().min();
        // Another computer may round differently.
        let rounding = f64::EPSILON * self.parameters.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        if is_consistent && !(inertial.mass_kg() > 0.0 && least > -16.0 * rounding) {
            return Err(format!(
                "{place}: mass {} kg, smallest eigenvalue of the pseudo-inertia {least:e}; both must be positive because physical.consistent is true: {FIX}",
                inertial.mass_kg()
            ));
        }
        Ok(())
    }
}
