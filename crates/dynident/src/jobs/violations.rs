//! Physically inconsistent parameters of a full set.

use dynident_dynamics::ParametricModel;
use dynident_model::InertialParameters;

/// Messages about bodies whose mass or pseudo-inertia is not positive, and about terms whose value must not be
/// negative. `values` contains the values of the terms.
pub(in crate::jobs) fn violations(
    model: &ParametricModel,
    inertials: &[InertialParameters],
    values: &[f64],
) -> Vec<String> {
    let mut violations = Vec::new();
    for (body, inertial) in model.model().bodies().iter().zip(inertials) {
        let smallest = inertial.pseudo_inertia().symmetric_eigenvalues().min();
        if inertial.mass_kg() <= 0.0 {
            violations.push(format!("{}: mass {:.4} kg", body.name(), inertial.mass_kg()));
        } else if smallest <= 0.0 {
            violations.push(format!(
                "{}: pseudo-inertia not positive definite (smallest eigenvalue {smallest:.2e})",
                body.name()
            ));
        }
    }
    for (term, value) in model.terms().iter().zip(values) {
        if *value < 0.0 && term.is_nonnegative() {
            violations.push(format!("{} = {value:.4} {}", term.symbol(), term.unit()));
        }
    }
    violations
}
