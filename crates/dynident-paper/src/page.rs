//! `report.html` of the reproduction.

use crate::PaperFile;
use crate::piece::{PaperCell, PaperFigure, PaperTable};
use dynident::Error;
use dynident_report::{Heading, KeyFigures, Report, Table, Text, Tone};

/// The page: what was reached, then every table and figure in the order of the paper, then where we depart from it.
pub(crate) fn page(file: &PaperFile, tables: &[PaperTable], figures: &[PaperFigure]) -> Result<String, Error> {
    let mut page = Report::new("Iterative identification of robot dynamic parameters based on logistic function")
        .subtitle("every table and figure of the paper, computed anew by `dynident reproduce`, the paper's values beside ours");
    let mut key = KeyFigures::new();
    for figure in &file.reached {
        let tone = if figure.met { Tone::Good } else { Tone::Bad };
        key = key.judged(&figure.what, shown(figure.value), format!("goal: at most {}", shown(figure.goal)), tone);
    }
    page.add(key);
    for (title, table_numbers, figure_numbers) in CHAPTERS {
        page.add(Heading::new(*title));
        for table in tables.iter().filter(|table| table_numbers.contains(&table.number)) {
            page.add(section(table));
        }
        for figure in figures.iter().filter(|figure| figure_numbers.contains(&figure.number)) {
            let mut plot = figure.plot.clone().note(note(figure));
            plot.title = format!("Fig. {}: {}", figure.number, figure.title);
            page.add(plot);
        }
    }
    page.add(Heading::new("Where we depart from the paper, and why"));
    let mut departures = Table::new("", ["place", "in the paper", "here"]);
    for deviation in &file.deviations {
        departures = departures.row([&deviation.place, &deviation.trouble, &deviation.here]);
    }
    page.add(departures);
    page.add(Text::new(format!(
        "Made by dynident {} with seed {} in {:.1} s. The studies lie in the folder `study`: run them again, change them.",
        file.version, file.seed, file.seconds
    )));
    Ok(page.html()?)
}

/// Chapters: title, tables, figures.
const CHAPTERS: &[(&str, &[usize], &[usize])] = &[
    ("Base parameters", &[2], &[]),
    ("The excitation trajectory", &[], &[2, 3, 4, 5, 6]),
    ("Its optimisation", &[3], &[7]),
    ("Joint 2, three runs", &[4], &[9, 10, 11, 12]),
    ("Joint 1, three runs", &[5], &[13, 14]),
    ("Fourier series beside it", &[6], &[15]),
    ("Verification on another motion", &[], &[16, 17]),
];

fn section(table: &PaperTable) -> Table {
    let mut section = Table::new(format!("Table {}: {}", table.number, table.title), table.columns.iter().cloned())
        .note(table.note.clone());
    for row in &table.rows {
        section = section.row(row.iter().map(PaperCell::shown).collect::<Vec<String>>());
    }
    section
}

fn note(figure: &PaperFigure) -> String {
    let values = figure.values.iter().map(|(name, value)| format!("{}: {}", name.replace('_', " "), shown(*value)));
    let parts: Vec<String> =
        core::iter::once(figure.note.clone()).filter(|note| !note.is_empty()).chain(values).collect();
    parts.join("; ")
}

fn shown(value: f64) -> String {
    PaperCell::from(value).shown()
}
