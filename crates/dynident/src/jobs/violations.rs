//! Parameters of a full set that are not physically consistent.

use dynident_dynamics::ParametricModel;
use dynident_model::InertialParameters;

/// Bodies whose mass or pseudo-inertia is not positive, and terms with a negative value that cannot be negative, a
/// sentence each. `values` are those of the terms.
pub(in crate::jobs) fn violations(
    model: &ParametricModel,
    inertials: &[InertialParameters],
    values: &[f64],
) -> Vec<String> {
    let mut violations = Vec::new();
    for (body, inertial) in model.model().bodies().iter().zip(inertials) {
        let least = inertial.pseudo_inertia().symmetric_eigenvalues().min();
        if inertial.mass_kg() <= 0.0 {
            violations.push(format!("{}: mass {:.4} kg", body.name(), inertial.mass_kg()));
        } else if least <= 0.0 {
            violations
                .push(format!("{}: pseudo-inertia not positive definite (least eigenvalue {least:.2e})", body.name()));
        }
    }
    for (term, value) in model.terms().iter().zip(values) {
        if *value < 0.0 && term.is_nonnegative() {
            violations.push(format!("{} = {value:.4} {}", term.symbol(), term.unit()));
        }
    }
    violations
}
