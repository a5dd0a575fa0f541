//! Correction for explanations in which a body would have a negative mass.

use super::differences::Differences;
use super::parts::Part;
use dynident_estimation::changes::Explanation;
use dynident_estimation::normal_below;

impl Differences {
    /// Conditions the probabilities on positive masses of the bodies that an explanation names. The changes are assumed
    /// normally distributed, which does not exclude that a body of 0.3 kg loses 1 kg. With the condition that the mass
    /// m of each of these bodies is positive, the evidence of explanation e is multiplied by
    ///
    /// ```text
    /// Π P_e(m > 0 | d) / P_e(m > 0)
    /// ```
    ///
    /// (Gelfand, Smith and Lee, JASA 87 (1992) 523, section 2). `nominal` contains the inertial parameters of all
    /// bodies in the description, ten for each.
    pub(super) fn exclude_negative_masses(&mut self, nominal: &[f64]) {
        // Explanations without named bodies keep their factor 1.
        let factors: Vec<f64> = self.explanations.iter().map(|own| self.positive_factor(own, nominal)).collect();
        self.reweight(&factors);
    }

    fn positive_factor(&self, explanation: &Explanation, nominal: &[f64]) -> f64 {
        let of_body = |body: usize| {
            let (change, covariance) = self.change_of(explanation, body);
            let groups = explanation.groups.iter().zip(&explanation.scales);
            let groups = groups.filter(|(group, _)| self.parts[**group] == Part::Body(body));
            let expected: f64 =
                groups.map(|(&group, scale)| (self.unknowns[group].row(0) * *scale).norm_squared()).sum();
            let mass = nominal[10 * body].max(0.0);
            let before = positive(mass, expected);
            positive(mass + change[0], covariance[(0, 0)]) / before
        };
        self.bodies_of(explanation).into_iter().map(of_body).product()
    }
}

/// Probability that a normal variable with this mean and variance is positive.
fn positive(mean: f64, variance: f64) -> f64 {
    if variance > 0.0 { normal_below(mean / variance.sqrt()) } else { f64::from(mean >= 0.0) }
}

#[cfg(test)]
mod tests {
    use super::positive;

    #[test]
    fn a_certain_value_is_positive_or_not() {
        assert!((positive(1.0, 1.0) - 0.841_344_746).abs() < 1e-9);
        assert!((positive(0.0, 4.0) - 0.5).abs() < 1e-12);
        assert_eq!([positive(0.0, 0.0), positive(1.0, 0.0), positive(-1.0, 0.0)], [1.0, 1.0, 0.0]);
    }
}
