//! The summary of `inspect`.

use super::text::{name, rounded, table, wrapped};
use core::fmt::Write;
use dynident::Inspection;

/// A robot description: joints, base parameters, and what is wrong with it.
pub(crate) fn inspection(i: &Inspection) -> String {
    let mut text = format!("{}: {} joints, {:.3} kg that move\n\n", i.name, i.dof, i.moving_mass_kg);
    let count = |level: &str| i.audit.iter().filter(|entry| entry.level == level).count();
    let _ = writeln!(text, "audit: {} problems, {} warnings", count("problem"), count("warning"));
    for level in ["problem", "warning", "info"] {
        for entry in i.audit.iter().filter(|entry| entry.level == level) {
            let level = if level == "problem" { "PROBLEM" } else { level };
            text += &wrapped(&format!("  {level} {}: {}", entry.place, entry.what), 4);
        }
    }
    text.push('\n');
    let rows = i.joints.iter().zip(&i.bodies).map(|(joint, body)| {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        vec![
            name(&joint.name),
            joint.kind.clone(),
            number(joint.lower),
            number(joint.upper),
            number(joint.velocity),
            number(joint.effort),
            body.mass_kg.map_or("unknown".to_owned(), |mass| format!("{mass:.4}")),
        ]
    });
    let header = ["joint", "type", "lower", "upper", "speed", "torque", "mass kg"].map(str::to_owned);
    text += &table(&header, 2..7, rows.collect());
    let base = &i.base_parameters;
    let _ = writeln!(text, "\n{} base parameters (what motion and torque can determine):", base.count);
    for expression in &base.expressions {
        text += &wrapped(&format!("  {}", rounded(expression)), 6);
    }
    if base.numerical_rank != base.count {
        let doubt = format!("  regressors at random states have rank {}: the split is not clear", base.numerical_rank);
        text += &wrapped(&doubt, 4);
    }
    text
}
