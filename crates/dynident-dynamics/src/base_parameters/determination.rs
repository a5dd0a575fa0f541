//! Determination of single parameters by the base parameters.

use super::BaseParameters;
use crate::regressor_panels::Column;

/// Regrouping coefficients below this value (relative to the robot's size) are treated as zero. They come from
/// rounding, also in robot descriptions: `1.5708` for π/2 has an error of 4e-6.
const MIN_REGROUPING_ENTRY: f64 = 1.0e-4;

/// Whether the torque determines a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Determination {
    /// The value is determined.
    Measured,
    /// Only combinations with other parameters are determined.
    Partly,
    /// The torque does not determine the value; it keeps its nominal value.
    Nominal,
}

impl BaseParameters {
    /// Whether the torque determines each parameter (ten per body, then the terms), if the base parameters with the
    /// indices `fixed` are not estimated.
    ///
    /// With `θ = π_i + R π_d` (base parameters θ, independent parameters π_i, dependent parameters π_d), a parameter
    /// is determined if it is independent and its row of `R` is zero. A dependent parameter does not affect the
    /// torque if its column of `R` is zero. `length_m` is a typical link length: entries of `R` are powers of
    /// lengths, and the threshold for zero scales with them.
    pub fn determination(&self, fixed: &[usize], length_m: f64) -> Vec<Determination> {
        let mut all = vec![Determination::Nominal; self.all_columns().len()];
        let size = |column: usize| match &self.all_columns()[column] {
            Column::Body { parameter: 0, .. } => 1.0,
            Column::Body { parameter: 1..=3, .. } => length_m,
            // Drive inertia combines with moments of inertia; other drive parameters are never regrouped.
            Column::Body { .. } | Column::Term(_) => length_m * length_m,
        };
        let mut regrouping = self.regrouping().clone();
        for (place, &column) in self.dependent().iter().enumerate() {
            for (row, &independent) in self.independent().iter().enumerate() {
                regrouping[(row, place)] *= size(column) / size(independent);
            }
        }
        let counts = |row: usize| !fixed.contains(&row);
        for (row, &column) in self.independent().iter().enumerate() {
            let is_alone = regrouping.row(row).iter().all(|share| share.abs() < MIN_REGROUPING_ENTRY);
            all[column] = match (counts(row), is_alone) {
                (true, true) => Determination::Measured,
                (true, false) => Determination::Partly,
                (false, _) => Determination::Nominal,
            };
        }
        for (place, &column) in self.dependent().iter().enumerate() {
            let has_share = |(row, share): (usize, &f64)| counts(row) && share.abs() >= MIN_REGROUPING_ENTRY;
            if regrouping.column(place).iter().enumerate().any(has_share) {
                all[column] = Determination::Partly;
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base_parameters::BaseParameterSettings;

    /// A pendulum about y: only parameters that rotate about its axis affect the torque, each separately.
    #[test]
    fn pendulum_determines_first_moments_and_one_inertia() {
        let text = r#"<robot name="p"><link name="b"/><link name="r"><inertial><mass value="1"/><inertia ixx="1"
            iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous">
            <parent link="b"/><child link="r"/><axis xyz="0 1 0"/></joint></robot>"#;
        let model = dynident_model::read_urdf(text).unwrap().model;
        let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
        let all = base.determination(&[], 1.0);
        let of = |which: Determination| -> Vec<usize> { (0..10).filter(|&k| all[k] == which).collect() };
        // m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
        assert_eq!(of(Determination::Measured), [1, 3, 7]);
        assert_eq!(of(Determination::Nominal), [0, 2, 4, 5, 6, 8, 9]);
        assert_eq!(base.determination(&[2], 1.0)[7], Determination::Nominal);
    }
}
