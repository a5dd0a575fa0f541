//! Differences from the robot description as text.

use crate::result::{ChangeExplanation, ChangedPart, DescriptionComparison, ResultFile};
use dynident_report::short;

/// If one or two bodies differ from the robot description: one sentence for each fact (which body, by how much, how
/// certain, the alternatives, and the edit test). Empty if nothing or everything differs.
pub fn difference_words(r: &ResultFile) -> Vec<String> {
    let Some(found) = &r.description_differences else { return Vec::new() };
    let limits = &r.thresholds.differences;
    let Some(best) = found.explanations.first() else { return Vec::new() };
    let few: f64 = found.explanations.iter().filter(|own| !own.parts.is_empty()).map(|own| own.probability).sum();
    if best.parts.is_empty() || few < limits.min_reported_probability {
        return Vec::new();
    }
    let is_certain = best.probability >= limits.min_certain_probability;
    let changes: Vec<String> = best.parts.iter().map(change).collect();
    let perhaps = if is_certain { "" } else { "perhaps " };
    let mut words = vec![format!("{perhaps}{} (probability {:.0} %)", changes.join("; "), 100.0 * best.probability)];
    let is_listed = |own: &&ChangeExplanation| own.probability >= limits.min_alternative_probability;
    let others: Vec<String> = found.explanations.iter().skip(1).filter(is_listed).map(alternative).collect();
    if !others.is_empty() {
        words.push(format!("It could also be: {}", others.join("; or ")));
    }
    let of_model = match (found.is_followed, is_certain) {
        (true, _) => {
            "The exported model follows this; the other bodies keep the values of the robot description within its tolerance"
        }
        (false, true) => {
            "The exported model predicts the torque, but it may spread this change over several bodies, because the logs do not locate it well enough"
        }
        (false, false) => {
            "The logs do not show which bodies differ; the exported model predicts the torque, but single masses may be wrong"
        }
    };
    words.push(of_model.to_owned());
    if is_certain || found.is_followed {
        words.extend(best.parts.iter().filter_map(|part| edit_test(found, part)));
    }
    words
}

fn change(part: &ChangedPart) -> String {
    let Some((mass, bar)) = part.mass_kg.zip(part.half_width_95_kg) else { return part.part.clone() };
    if mass.abs() <= bar {
        return format!(
            "{} differs from the robot description in centre of mass and inertia, and in mass by at most {} kg",
            part.part,
            short(mass.abs() + bar, 2)
        );
    }
    let [verb, more] = if mass > 0.0 { ["carries", "more"] } else { ["has", "less"] };
    let centre = part.centre_m.filter(|_| mass > 0.0).map_or_else(String::new, |at| {
        format!(
            ", centred at ({}, {}, {}) m in the frame of the body",
            short(at[0], 2),
            short(at[1], 2),
            short(at[2], 2)
        )
    });
    let words = format!("{} ± {} kg {more} than the robot description", short(mass.abs(), 3), short(bar, 2));
    format!("{} {verb} {words}{centre}", part.part)
}

fn alternative(explanation: &ChangeExplanation) -> String {
    let parts: Vec<&str> = explanation.parts.iter().map(|part| part.part.as_str()).collect();
    let named = match (explanation.everything, parts.is_empty()) {
        (true, _) => "all bodies".to_owned(),
        (false, true) => "no body".to_owned(),
        (false, false) => parts.join(" and "),
    };
    format!("{named} ({:.0} %)", 100.0 * explanation.probability)
}

/// Edit test: torque error if the body gets the values of the description again.
fn edit_test(found: &DescriptionComparison, part: &ChangedPart) -> Option<String> {
    let body = found.bodies.iter().find(|body| part.part == format!("body `{}`", body.name))?;
    let (error, most) = body.error_percent.zip(body.error_95_percent)?;
    Some(format!(
        "Edit test: if you give {} in the exported model the values of the robot description, the model predicts the \
         torque of a robot with this original body to about {} %, at most {} % (95 %)",
        part.part,
        short(error, 2),
        short(most, 2)
    ))
}
