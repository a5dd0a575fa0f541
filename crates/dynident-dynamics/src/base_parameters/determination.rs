//! What base parameters say of a single parameter.

use super::BaseParameters;
use crate::regressor_panels::Column;

/// Entries of the regrouping below this, of the unit that the robot's size gives them, are rounding, of descriptions
/// too: `1.5708` for π/2 leaves 4e-6.
const NOTHING: f64 = 1.0e-4;

/// Whether torque tells a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Determination {
    /// Its value by itself.
    Measured,
    /// Only sums of it with others: how they are shared out is not measured.
    Partly,
    /// Nothing: the value is the nominal one.
    Nominal,
}

impl BaseParameters {
    /// For every parameter (ten for each body, then the terms) whether the base parameters determine it, those among
    /// them that `fixed` names by their number not counted.
    ///
    /// With `θ = π_i + R π_d` a parameter is determined alone if it is independent and no dependent one has a share in
    /// its row of `R`; it is not in any torque if its column of `R` is zero. `length_m` is a length that the robot's
    /// links have: entries of `R` are powers of lengths, and what counts as zero grows with them.
    pub fn determination(&self, fixed: &[usize], length_m: f64) -> Vec<Determination> {
        let mut all = vec![Determination::Nominal; self.all_columns().len()];
        let size = |column: usize| match &self.all_columns()[column] {
            Column::Body { parameter: 0, .. } => 1.0,
            Column::Body { parameter: 1..=3, .. } => length_m,
            // Drive inertia stands beside moments of inertia; nothing else of a drive is regrouped.
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
            let is_alone = regrouping.row(row).iter().all(|share| share.abs() < NOTHING);
            all[column] = match (counts(row), is_alone) {
                (true, true) => Determination::Measured,
                (true, false) => Determination::Partly,
                (false, _) => Determination::Nominal,
            };
        }
        for (place, &column) in self.dependent().iter().enumerate() {
            let has_share = |(row, share): (usize, &f64)| counts(row) && share.abs() >= NOTHING;
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

    /// A pendulum about y: only what turns about its axis is felt, and that by itself.
    #[test]
    fn a_pendulum_tells_its_first_moments_and_one_inertia() {
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
