//! Page of a comparison of results.

use super::robot::RobotAppearance;
use super::robot_colours::change_colouring;
use super::unit;
use crate::error::Error;
use crate::result::{ChangeExplanation, ChangesFrom, ComparisonFile};
use dynident_report::{BarPlot, Cell, Heading, Report, Table, Text, Tone, short};

/// A parameter is marked if its difference exceeds this number of standard deviations; without a change, 0.3 % of
/// parameters exceed it.
const NOTABLE_Z: f64 = 3.0;

/// Writes the page: changes, the robot coloured by them, and a comparison of parameters, masses and friction.
///
/// # Errors
/// [`Error::Report`], which indicates a bug.
pub fn comparison_page(c: &ComparisonFile, robot: Option<&RobotAppearance>) -> Result<String, Error> {
    let names: Vec<&str> = c.results.iter().map(|result| result.name.as_str()).collect();
    let robot_name = c.results.first().map_or("", |result| result.robot.as_str());
    let mut page = Report::new(format!("Comparison: {}", names.join(", "))).subtitle(format!(
        "{robot_name}: {} results, {} common base parameters",
        c.results.len(),
        c.parameters.len()
    ));
    for changes in &c.changes {
        page.add(changed(c, changes));
    }
    if !c.notes.is_empty() {
        page.add(Text { paragraphs: c.notes.clone(), points: Vec::new() });
    }
    if let (Some(robot), Some(changes)) = (robot, c.changes.last()) {
        let mut scene = robot.scene("What changed");
        let probability = |name: &str| body_probability(changes, name);
        let names: Vec<&str> = scene.bodies.iter().map(|body| body.name.as_str()).collect();
        let words = |name: &str| format!("{:.0} %", 100.0 * probability(name));
        let of = |name: &&str| Some((probability(name), words(name)));
        // The first body is the base.
        let bodies: Vec<_> = names.iter().enumerate().map(|(k, name)| of(name).filter(|_| k > 0)).collect();
        scene.colourings = vec![change_colouring("probability that a body changed", &bodies)];
        scene.words = "the arm with the probability that each body changed".into();
        page.add(scene);
    }
    page.add(Heading::new("Parameters"));
    parameters(&mut page, c);
    page.add(Heading::new("Bodies and friction"));
    bodies(&mut page, c);
    page.add(Heading::new("Errors"));
    page.add(errors(c));
    Ok(page.html()?)
}

/// Probability that a body changed: the sum over all explanations that contain it.
fn body_probability(changes: &ChangesFrom, body: &str) -> f64 {
    let name = format!("body `{body}`");
    let with = |own: &&ChangeExplanation| own.everything || own.parts.iter().any(|part| part.part == name);
    changes.explanations.iter().filter(with).map(|own| own.probability).sum()
}

/// Text of an explanation, such as ``body `link7`: +0.48 ± 0.03 kg at (0.01, 0, 0.07) m``.
pub fn explanation_words(explanation: &ChangeExplanation) -> String {
    if explanation.everything {
        return "every part changed".to_owned();
    }
    if explanation.parts.is_empty() {
        return "nothing changed".to_owned();
    }
    let part = |part: &crate::result::ChangedPart| {
        let Some((mass, bar)) = part.mass_kg.zip(part.half_width_95_kg) else { return part.part.clone() };
        let sign = if mass < 0.0 { "" } else { "+" };
        let centre = part.centre_m.map_or_else(String::new, |at| {
            format!(" at ({}, {}, {}) m", short(at[0], 2), short(at[1], 2), short(at[2], 2))
        });
        format!("{}: {sign}{} ± {} kg{centre}", part.part, short(mass, 3), short(bar, 2))
    };
    explanation.parts.iter().map(part).collect::<Vec<_>>().join("; ")
}

fn changed(c: &ComparisonFile, changes: &ChangesFrom) -> Text {
    let name = |index: usize| c.results.get(index).map_or("", |result| result.name.as_str());
    let from = changes.from.map_or("the robot description", name);
    let mut text = Text::new(format!("What changed from {from} to {}:", name(changes.result)));
    for explanation in &changes.explanations {
        let words = format!("{:.0} %: {}", 100.0 * explanation.probability, explanation_words(explanation));
        let words = if explanation.remaining > 2.0 {
            format!("{words}; differences {} times the error bars remain", short(explanation.remaining.sqrt(), 2))
        } else {
            words
        };
        text = text.point(Tone::Plain, words);
    }
    text.point(
        Tone::Plain,
        format!(
            "all {} parameters together: χ² = {}, p = {} if nothing changed",
            changes.degrees_of_freedom,
            short(changes.chi_squared, 3),
            short(changes.p_value, 2)
        ),
    )
}

fn parameters(page: &mut Report, c: &ComparisonFile) {
    let mut columns = vec!["parameter".to_owned(), "unit".to_owned()];
    for result in &c.results {
        columns.extend([result.name.clone(), "± (95 %)".to_owned()]);
    }
    columns.push("difference in standard deviations".to_owned());
    let rows = c.parameters.iter().map(|own| {
        let mut row = vec![Cell::from(&own.expression), Cell::from(unit(&own.unit))];
        for (value, bar) in own.values.iter().zip(&own.half_widths_95) {
            row.extend([Cell::from(short(*value, 5)), Cell::from(short(*bar, 2))]);
        }
        let tone = if own.largest_z > NOTABLE_Z { Tone::Warning } else { Tone::Plain };
        row.push(Cell::judged(short(own.largest_z, 3), tone));
        row
    });
    page.add(Table::new("Base parameters side by side", columns).rows(rows));
    if let [first, second] = &c.results[..] {
        let mut units: Vec<&str> = c.parameters.iter().map(|own| own.unit.as_str()).collect();
        units.sort_unstable();
        units.dedup();
        for of in units {
            let mut plot = BarPlot::new(format!("Base parameters in {}", unit(of)), unit(of))
                .note(format!("bars: {}, with 95 % error bars", second.name))
                .reference_label(first.name.clone());
            for own in c.parameters.iter().filter(|own| own.unit == of) {
                plot = plot.bar(&own.expression, own.values[1], Some(own.half_widths_95[1]), Some(own.values[0]));
            }
            page.add(plot);
        }
    }
    if !c.not_compared.is_empty() {
        let points = c.not_compared.iter().map(|reason| (Tone::Plain, reason.clone())).collect();
        page.add(Text { paragraphs: vec!["Not compared:".to_owned()], points });
    }
}

fn bodies(page: &mut Report, c: &ComparisonFile) {
    let mut columns = vec!["body".to_owned()];
    for result in &c.results {
        columns.extend([format!("{}, kg", result.name), "± (95 %)".to_owned()]);
    }
    let rows = c.bodies.iter().map(|body| {
        let mut row = vec![Cell::from(&body.name)];
        for (mass, bar) in body.mass_kg.iter().zip(&body.half_width_95_kg) {
            row.push(short(*mass, 4).into());
            row.push(bar.map_or_else(|| "–".to_owned(), |bar| short(bar, 2)).into());
        }
        row
    });
    page.add(
        Table::new("Masses side by side", columns).note("± with 30 % uncertainty of the robot description").rows(rows),
    );
    let columns = core::iter::once("joint".to_owned()).chain(c.results.iter().map(|result| result.name.clone()));
    let rows = c
        .friction
        .iter()
        .map(|own| core::iter::once(Cell::from(&own.joint)).chain(own.laws.iter().map(Cell::from)).collect::<Vec<_>>());
    page.add(Table::new("Friction laws", columns).rows(rows));
}

fn errors(c: &ComparisonFile) -> Table {
    let rows = c.results.iter().flat_map(|result| {
        result.held_out.iter().map(|(log, error)| {
            let error = error.map_or_else(|| "–".to_owned(), |error| short(error, 3));
            vec![Cell::from(&result.name), Cell::from(log), error.into(), Cell::from(&result.file)]
        })
    });
    Table::new("Torque errors on held-out logs", ["result", "log", "error, %", "file"]).rows(rows)
}
