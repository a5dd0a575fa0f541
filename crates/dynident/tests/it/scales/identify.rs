//! `identify`: the same model, scaled, with the same bars, choices and findings.

use super::{AS_IT_IS, Differences, example, scales};
use dynident::IdentificationOutcome;
use dynident::result::BaseParameterResult;

fn errors(found: &IdentificationOutcome) -> [f64; 2] {
    let held_out = &found.result.validation[0];
    let of = |report: &dynident::estimation::ValidationReport| report.relative_error_percent.unwrap();
    [of(&held_out.model), of(held_out.physical.as_ref().unwrap())]
}

/// Review of trust, section 1: the exported model went from 0.953 to 32.7 % on the robot a thousand times as heavy.
/// 1e-6 is what the solver's own tolerance leaves of a relative error.
#[test]
fn a_crane_and_a_watch_are_identified_alike() {
    const TOLERANCE: f64 = 1e-6;
    let expected = example(AS_IT_IS).1.identify();
    let mut all = Vec::new();
    for scale in scales() {
        let found = example(scale).1.identify();
        let mut differences = Differences::new(scale);
        for (found, expected) in errors(&found).into_iter().zip(errors(&expected)) {
            differences.compare("held-out error", (found, expected), TOLERANCE * expected);
        }
        for (found, expected) in found.result.base_parameters.iter().zip(&expected.result.base_parameters) {
            let factor = scale.of(&expected.unit);
            // In units of the parameter's own bar where it is near zero.
            let within = TOLERANCE * (expected.value.abs() + expected.std);
            let physical = |parameter: &BaseParameterResult| parameter.physical.unwrap();
            differences.compare(&expected.symbol, (found.value / factor, expected.value), within);
            differences.compare(&expected.symbol, (found.std / factor, expected.std), TOLERANCE * expected.std);
            differences.compare(&expected.symbol, (physical(found) / factor, physical(expected)), within);
            differences.equal("excited", &found.excited, &expected.excited);
        }
        for (found, expected) in found.result.bodies.iter().zip(&expected.result.bodies) {
            differences.equal("sources", &found.sources, &expected.sources);
        }
        differences.equal("problems", &found.result.problems, &expected.result.problems);
        let findings = |of: &IdentificationOutcome| of.result.check.as_ref().map(|check| check.findings.clone());
        differences.equal("findings", &findings(&found), &findings(&expected));
        all.extend(differences.found);
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}
