//! Explanations of the difference from a robot description or between two results, as results list them.

use crate::result::{ChangeExplanation, ChangedPart, DescriptionComparison};
use dynident_estimation::HALF_WIDTH_95;
use dynident_identification::changes::Differences;
use dynident_identification::{DescriptionThresholds, Identification};
use dynident_model::Model;

/// The explanations, most probable first. All explanations in which every body differs are merged.
pub(in crate::jobs) fn explanations_of(
    found: &Differences,
    model: &Model,
    limits: &DescriptionThresholds,
) -> Vec<ChangeExplanation> {
    let sets = found.sets(limits).into_iter().map(|(probability, own)| {
        let changed = found.parts_of(own).into_iter().map(|part| {
            let words = part.words(model);
            let Some(body) = part.body() else { return ChangedPart { part: words, ..ChangedPart::default() } };
            let (change, covariance) = found.change_of(own, body);
            changed_body(words, change.as_slice(), covariance[(0, 0)].max(0.0).sqrt())
        });
        ChangeExplanation { parts: changed.collect(), everything: false, probability, remaining: own.remaining }
    });
    let everything = ChangeExplanation {
        everything: true,
        probability: found.everywhere(limits),
        remaining: found.remaining_everywhere(limits),
        ..ChangeExplanation::default()
    };
    let mut all: Vec<ChangeExplanation> = sets.chain([everything]).collect();
    all.retain(|own| own.probability >= limits.min_listed_probability);
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// The differences of an identified robot from its description; `None` without a description of all bodies.
pub(in crate::jobs) fn description_comparison(
    found: &Identification,
    limits: &DescriptionThresholds,
) -> Option<DescriptionComparison> {
    let consistent = &found.consistent;
    let differences = consistent.differences.as_ref()?;
    Some(DescriptionComparison {
        explanations: explanations_of(differences, found.model().model(), limits),
        bodies: consistent.restored.clone(),
        is_followed: consistent.follows_explanation,
    })
}

/// A body with the change of its ten values: of its mass, and its centre if the change of the mass is significant.
fn changed_body(part: String, change: &[f64], mass_std: f64) -> ChangedPart {
    let (mass, half_width) = (change[0], HALF_WIDTH_95 * mass_std);
    let centre = (mass.abs() > half_width).then(|| [change[1] / mass, change[2] / mass, change[3] / mass]);
    ChangedPart { part, mass_kg: Some(mass), half_width_95_kg: Some(half_width), centre_m: centre }
}
