use super::text::{name, table, wrapped};
use core::fmt::Write;
use dynident::result::{ServoDesignFile, ServoForecastValue};
use std::path::Path;

/// Quantities of a drive in the table: name in the file, and title of the column.
const SHOWN: [(&str, &str); 5] = [
    ("stiffness", "stiffness"),
    ("damping", "damping"),
    ("armature", "armature"),
    ("Coulomb friction", "friction"),
    ("delay", "delay"),
];

pub(crate) fn servo_design(file: &ServoDesignFile, out: &Path, files: &[&str]) -> String {
    let mut text = wrapped(&file.study, 2);
    let _ = writeln!(
        text,
        "commands for {} joints, {} s at {} Hz, seed {}\n",
        file.joints.len(),
        file.duration_s,
        file.rate_hz,
        file.seed
    );
    let verdict = format!(
        "Expected error bars are {:.2} times those of a chirp of the same length (geometric mean over all values; log \
         det {:.1} instead of {:.1}).",
        file.error_bars_to_chirp, file.log_det, file.chirp_log_det
    );
    text += &wrapped(&verdict, 0);
    if file.feasible {
        text.push_str("feasible: the simulated motion keeps every limit\n");
    } else {
        text.push_str("NOT FEASIBLE: the simulated motion breaks a limit; use another --seed\n");
        for report in file.limits.iter().filter(|report| report.violated) {
            let line = format!("  {} of {} at {:.2} s", report.kind, name(&report.joint), report.at_s);
            text += &wrapped(&line, 4);
        }
    }
    for (heading, items) in [("NOT checked:", &file.not_checked), ("assumed:", &file.assumed)] {
        if !items.is_empty() {
            let _ = writeln!(text, "{heading}");
            for item in items {
                text += &wrapped(&format!("  {item}"), 4);
            }
        }
    }
    text.push('\n');
    let header: Vec<String> =
        ["expected ± 95 %, %"].into_iter().chain(SHOWN.map(|(_, column)| column)).map(str::to_owned).collect();
    let rows = file.drives.iter().map(|drive| {
        let value = |wanted: &str| drive.values.iter().find(|value| value.name == wanted);
        let cells = SHOWN.iter().map(|(wanted, _)| value(wanted).map_or_else(String::new, percent));
        core::iter::once(name(&drive.name)).chain(cells).collect()
    });
    text += &table(&header, 1..SHOWN.len() + 1, rows.collect());
    text.push_str("  at this scale; in brackets: those of the chirp\n");
    if !file.not_determined.is_empty() {
        text += &wrapped(&format!("not determined: {}", file.not_determined.join(", ")), 2);
    }
    for note in &file.notes {
        text += &wrapped(&format!("note: {note}"), 2);
    }
    let _ = writeln!(text, "\n{} candidates in {:.2} s", file.evaluations, file.seconds);
    let files: Vec<String> = files.iter().map(|name| out.join(name).display().to_string()).collect();
    text += &wrapped(&format!("wrote {}", files.join(", ")), 2);
    text
}

fn percent(value: &ServoForecastValue) -> String {
    let share = |half: f64| 100.0 * half / value.value.abs();
    format!("{:.1} ({:.1})", share(value.half_width_95_at_scale), share(value.half_width_95_chirp))
}
