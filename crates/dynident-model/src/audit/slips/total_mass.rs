//! Masses that do not add up to the total mass in the file.

use super::{Search, SlipKind, scaled_by_power, trace};
use crate::urdf::StatedInertial;

/// Units of a total mass, with the power of ten that converts to kilograms.
const UNITS: [(&str, i32); 2] = [("kg", 0), ("g", -3)];

pub(super) fn find(search: &mut Search, text: &str, total_kg: Option<f64>) {
    let Some(total) = total_kg.or_else(|| stated_in_comment(text)).filter(|total| *total > 0.0 && total.is_finite())
    else {
        return;
    };
    let sum: f64 = search.now.iter().map(|one| one.mass_kg).sum();
    let near = |sum: f64, share: f64| (sum - total).abs() <= share * total;
    if near(sum, search.settings.total_mass_tolerance) {
        return;
    }
    let evidence = format!("masses add up to {sum} kg, the stated total is {total} kg");
    if let Some(power) =
        [-3, 3].into_iter().find(|&power| near(scaled_by_power(sum, power), search.settings.total_mass_tolerance))
    {
        let all: Vec<(usize, StatedInertial)> = (0..search.now.len())
            .map(|place| (place, scaled(&search.now[place], power)))
            .filter(|(place, new)| search.now[*place] != *new)
            .collect();
        let unit = if power < 0 { "grams" } else { "tonnes" };
        let message = format!("masses are in {unit}: write kilograms");
        search.note(SlipKind::TotalMass, message, evidence, all);
        return;
    }
    // Hypothesis: one mass has a misplaced decimal point.
    let mut ways: Vec<(usize, i32)> = Vec::new();
    for (place, one) in search.now.iter().enumerate().filter(|(_, one)| one.mass_kg > 0.0) {
        let powers = [-3, -2, -1, 1, 2, 3];
        ways.extend(
            powers
                .into_iter()
                .filter(|&power| {
                    near(
                        sum - one.mass_kg + scaled_by_power(one.mass_kg, power),
                        search.settings.corrected_mass_tolerance,
                    )
                })
                .filter(|&power| improves_gyration(search, place, power))
                .map(|power| (place, power)),
        );
    }
    // Hypothesis: a link is duplicated.
    let twice: Vec<usize> = (0..search.now.len())
        .filter(|&place| {
            let one = &search.now[place];
            one.mass_kg > 0.0
                && near(sum - one.mass_kg, search.settings.corrected_mass_tolerance)
                && search.now[..place].iter().any(|other| (other.mass_kg, other.moments) == (one.mass_kg, one.moments))
        })
        .collect();
    match (&ways[..], &twice[..]) {
        (&[(place, power)], []) => {
            let new = scaled(&search.now[place], power);
            let message = format!(
                "the mass of {} has its decimal point in the wrong place: {} kg instead of {} kg gives the total",
                new.link, new.mass_kg, search.now[place].mass_kg
            );
            search.note(SlipKind::TotalMass, message, evidence, vec![(place, new)]);
        }
        ([], &[place]) => {
            let message = format!(
                "{} has the mass and moments of another link, and without it the masses give the total: if the link is a duplicate, delete its <inertial>",
                search.now[place].link
            );
            search.note_uncorrected(SlipKind::TotalMass, &[place], message, evidence);
        }
        _ => {
            let several = ways.len() + twice.len();
            let why = if several == 0 {
                "no change of a single mass explains it"
            } else {
                "changes of several single masses explain it"
            };
            let message = format!("masses do not add up to the stated total, and {why}: weigh the parts");
            search.note_uncorrected(SlipKind::TotalMass, &[], message, evidence);
        }
    }
}

/// Whether the correction brings the ratio of radius of gyration to link length closer to that of the other links.
/// This check is needed because with ten links and six powers of ten, one of them often matches a total by chance.
fn improves_gyration(search: &Search, place: usize, power: i32) -> bool {
    let Some(lengths) = &search.lengths else { return true };
    let figure = |place: usize| {
        let one = &search.now[place];
        (0.5 * trace(&one.moments) / one.mass_kg).sqrt().log10() - lengths[place].log10()
    };
    let mut others: Vec<f64> = search.with_mass().into_iter().filter(|&other| other != place).map(figure).collect();
    others.sort_by(f64::total_cmp);
    let Some(&middle) = others.get(others.len() / 2) else { return true };
    let before = figure(place) - middle;
    // The radius of gyration scales with 1/√mass.
    (before - 0.5 * f64::from(power)).abs() < before.abs()
}

fn scaled(stated: &StatedInertial, power: i32) -> StatedInertial {
    StatedInertial { mass_kg: scaled_by_power(stated.mass_kg, power), ..stated.clone() }
}

/// The total mass in a comment: `total mass` or `total weight`, then a number and its unit.
fn stated_in_comment(text: &str) -> Option<f64> {
    let mut rest = text;
    while let Some(start) = rest.find("<!--") {
        let comment = &rest[start + 4..];
        let end = comment.find("-->")?;
        if let Some(total) = total_in(&comment[..end].to_lowercase()) {
            return Some(total);
        }
        rest = &comment[end + 3..];
    }
    None
}

fn total_in(comment: &str) -> Option<f64> {
    let after =
        ["total mass", "total weight"].iter().find_map(|key| Some(&comment[comment.find(key)? + key.len()..]))?;
    let number = after.find(|c: char| c.is_ascii_digit()).filter(|&at| at <= 30)?;
    let end = after[number..].find(|c: char| !(c.is_ascii_digit() || c == '.')).map_or(after.len(), |end| number + end);
    let value = after[number..end].trim_end_matches('.').parse::<f64>().ok()?;
    let unit: String = after[end..].trim_start().chars().take_while(char::is_ascii_alphabetic).collect();
    let (_, power) = UNITS.iter().find(|(name, _)| *name == unit)?;
    Some(scaled_by_power(value, *power))
}

#[cfg(test)]
mod tests {
    use super::stated_in_comment;

    #[test]
    fn a_total_is_read_from_a_comment() {
        assert_eq!(stated_in_comment("<a/><!-- arm --><!-- Total mass: 12.5 kg, with cables -->"), Some(12.5));
        assert_eq!(stated_in_comment("<!-- total weight of the arm = 900 g -->"), Some(0.9));
        for none in ["<!-- total mass unknown -->", "total mass 3 kg", "<!-- total mass 3 -->", "<!-- total mass 3 lb"]
        {
            assert_eq!(stated_in_comment(none), None, "{none}");
        }
    }
}
