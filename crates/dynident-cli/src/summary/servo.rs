use super::text::{table, wrapped};
use core::fmt::Write;
use dynident::result::{ServoFile, ServoForm, ServoLog, ServoNumber};
use dynident::verdict_words;
use std::path::Path;

/// Quantities of a drive in the table: name in the result, and title of the column.
const SHOWN: [(&str, &str); 5] = [
    ("stiffness", "stiffness"),
    ("damping", "damping"),
    ("armature", "armature"),
    ("Coulomb friction", "friction"),
    ("delay", "delay, s"),
];

pub(crate) fn servo(file: &ServoFile, out: &Path, models: &[&str]) -> String {
    let mut text = wrapped(&verdict_words(file), 0);
    text += &wrapped(&file.scale.anchor, 0);
    text.push('\n');
    let header: Vec<String> =
        core::iter::once("error, mrad (mm)".to_owned()).chain(file.joints.iter().cloned()).collect();
    let columns = header.len();
    let row = |log: &ServoLog, role: &str| {
        let mut row = vec![format!("{} ({role})", log.name)];
        row.extend(log.errors.iter().map(|error| format!("{:.1}", 1e3 * error)));
        row
    };
    let held_out = file.validation.iter().map(|log| row(log, "held out"));
    let rows = held_out.chain(file.training.iter().map(|log| row(log, "training"))).collect();
    text += &table(&header, 1..columns, rows);
    text.push('\n');
    let header: Vec<String> =
        core::iter::once("joint".to_owned()).chain(SHOWN.iter().map(|(_, column)| (*column).to_owned())).collect();
    let rows = file.joints.iter().zip(&file.drives).map(|(joint, drive)| {
        let values = drive.shown_values();
        let value = |name: &str| values.iter().find(|value| value.name == name);
        let cells = SHOWN.iter().map(|(name, _)| value(name).map_or_else(String::new, estimate));
        core::iter::once(joint.clone()).chain(cells).collect()
    });
    text += &table(&header, 1..SHOWN.len() + 1, rows.collect());
    let _ = writeln!(
        text,
        "  in Nm, rad, s, kg (N, m for a slide), ± 95 % at this scale; in brackets: not determined by the motion"
    );
    text += &forms(file);
    for note in &file.notes {
        text += &wrapped(&format!("note: {note}"), 2);
    }
    let files: Vec<String> =
        ["result.json", "report.html"].iter().chain(models).map(|name| out.join(name).display().to_string()).collect();
    text += &wrapped(&format!("written: {}", files.join(", ")), 2);
    text
}

/// The held-out errors of the exported files, compared with those of the identified drives.
fn forms(file: &ServoFile) -> String {
    let Some(model) = file.forms.iter().find_map(ServoForm::mean_errors).map(|[_, model]| model) else {
        return String::new();
    };
    let form = |form: &ServoForm| {
        let error = form
            .mean_errors()
            .map_or_else(|| "unknown (the simulation fails)".to_owned(), |[own, _]| format!("{:.1}", 1e3 * own));
        format!("{} {error}", form.form)
    };
    let forms: Vec<String> = file.forms.iter().map(form).collect();
    let line = format!(
        "error with the drives of exported files, mrad (mm), mean over joints and logs: {}; identified drives {:.1}",
        forms.join(", "),
        1e3 * model
    );
    wrapped(&line, 2)
}

fn estimate(value: &ServoNumber) -> String {
    let text = format!("{:.4} ± {:.4}", value.value, value.half_width_95_at_scale);
    if value.determined { text } else { format!("({text})") }
}
