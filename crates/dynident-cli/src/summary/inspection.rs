use super::text::{name, table, wrapped};
use core::fmt::Write;
use dynident::Inspection;
use dynident::result::SlipEntry;
use std::path::Path;

const MAX_SHOWN: usize = 6;

pub(crate) fn inspection(i: &Inspection) -> String {
    let mut text = format!("{}: {} joints, {:.3} kg moving mass\n\n", i.name, i.dof, i.moving_mass_kg);
    let count = |level: &str| i.audit.iter().filter(|entry| entry.level == level).count();
    let _ = writeln!(text, "audit: {} problems, {} warnings", count("problem"), count("warning"));
    for level in ["problem", "warning", "info"] {
        for entry in i.audit.iter().filter(|entry| entry.level == level) {
            let level = if level == "problem" { "PROBLEM" } else { level };
            text += &wrapped(&format!("  {level} {}: {}", entry.place, entry.what), 4);
        }
    }
    for slip in &i.slips {
        text += &of_slip(slip);
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
    let _ = writeln!(text, "\n{} base parameters (combinations that motion and torque determine):", base.count);
    for expression in &base.names {
        text += &wrapped(&format!("  {expression}"), 6);
    }
    if base.numerical_rank != base.count {
        let doubt = format!(
            "  the regressor at random states has rank {}: the base parameters are not reliable",
            base.numerical_rank
        );
        text += &wrapped(&doubt, 4);
    }
    text
}

fn of_slip(slip: &SlipEntry) -> String {
    let mut text = wrapped(&format!("  SLIP ({}): {}", slip.slip, slip.what), 4);
    text += &wrapped(&format!("    evidence: {}", slip.evidence), 6);
    for one in slip.corrections.iter().take(MAX_SHOWN) {
        text += &wrapped(&format!("    {} {}: {} -> {}", name(&one.link), one.number, one.from, one.to), 6);
    }
    let count = slip.corrections.len();
    if count > MAX_SHOWN {
        let _ = writeln!(text, "    and {} more numbers", count - MAX_SHOWN);
    }
    if count > 0 {
        text += "    --fix OUT.urdf writes a copy with these numbers\n";
    }
    text
}

pub(crate) fn mended(before: &Inspection, after: &Inspection, out: &Path) -> String {
    let numbers: usize = before.slips.iter().map(|slip| slip.corrections.len()).sum();
    let problems = |i: &Inspection| i.audit.iter().filter(|entry| entry.level == "problem").count();
    format!(
        "{}: {numbers} numbers changed, all other bytes unchanged; problems: {} before, {} now; suspected export errors: {} before, {} now",
        out.display(),
        problems(before),
        problems(after),
        before.slips.len(),
        after.slips.len()
    )
}
