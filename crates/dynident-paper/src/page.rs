//! `report.html` of the reproduction.

use crate::PaperFile;
use crate::index::{DEVIATION_TITLE, EQUAL, REFERENCES, STATEMENTS, TORQUES, index};
use crate::piece::{PaperCell, PaperFigure, PaperPicture, PaperTable, shown};
use dynident::Error;
use dynident_report::{Cell, Heading, KeyFigures, LinePlot, Report, Scene, Section, Table, Text, Tone};

/// Content of the page in addition to the paper's tables and figures.
pub(crate) struct Extras {
    pub(crate) scene: Scene,
    pub(crate) comparison_plots: Vec<LinePlot>,
    pub(crate) noisy_plots: Vec<LinePlot>,
    /// Largest parameter error of our variant after one, three and six runs.
    pub(crate) own_errors: [f64; 3],
}

const INDEX: &str = "Index";

/// Builds the page: goals, index, every table and figure in the order of the paper, comparison of both methods,
/// statements, deviations, references.
pub(crate) fn page(file: &PaperFile, tables: &[PaperTable], extras: &Extras) -> Result<String, Error> {
    let mut page = Report::new("Iterative identification of robot dynamic parameters based on logistic function")
        .subtitle("every table and figure of the paper, computed by `dynident reproduce`, with the paper's values for comparison");
    page.add(key_figures(file));
    page.add(Text::new(file.comparison.statement.clone()));
    page.add(Text::new(file.comparison.one_run(extras.own_errors)));
    page.add(extras.scene.clone());
    page.add(Heading::new(INDEX));
    page.add(index(file, tables));
    for (title, table_numbers, figure_numbers) in CHAPTERS {
        if *title == TORQUES {
            equal_conditions(&mut page, file, extras);
        }
        page.add(Heading::new(*title));
        for table in tables.iter().filter(|table| table_numbers.contains(&table.number)) {
            page.add(section(table));
        }
        for figure in file.figures.iter().filter(|figure| figure_numbers.contains(&figure.number)) {
            page.add(drawn(figure));
            if *title == TORQUES {
                let comparison_plots = extras
                    .noisy_plots
                    .iter()
                    .filter(|plot| plot.title.starts_with(&format!("Fig. {},", figure.number)));
                comparison_plots.for_each(|plot| {
                    page.add(plot.clone());
                });
            }
        }
    }
    page.add(Heading::new(STATEMENTS));
    page.add(statements(file));
    page.add(Heading::new(DEVIATION_TITLE));
    page.add(deviations(file));
    page.add(Heading::new(REFERENCES));
    page.add(references(file));
    page.add(Text::new(format!(
        "Created by dynident {} with seed {} in {:.1} s. The studies are in the folder `study`: you can run and change them.",
        file.version, file.seed, file.seconds
    )));
    Ok(page.html()?)
}

fn key_figures(file: &PaperFile) -> KeyFigures {
    let mut key = KeyFigures::new();
    for figure in &file.reached {
        let tone = if figure.met { Tone::Good } else { Tone::Bad };
        let note = if figure.what.ends_with("own loop") {
            format!("paper: at most {}", shown(figure.goal))
        } else {
            format!("goal: at most {}", shown(figure.goal))
        };
        key = key.judged(&figure.what, shown(figure.value), note, tone);
    }
    key.figure(
        "ratio of parameter errors, logistic strokes to Fourier series, equal conditions, with noise",
        file.comparison
            .cases
            .first()
            .map_or_else(|| "–".to_owned(), |case| format!("{:.2} ± {:.2}", case.quotient, case.quotient_std)),
        format!("Cramér-Rao bound: {:.2}", file.comparison.bound),
    )
}

fn statements(file: &PaperFile) -> Table {
    let mut statements = Table::new("Statements of the paper", ["place", "the paper states", "here", "reproduced"]);
    for statement in &file.statements {
        let (answer, tone) = if statement.holds { ("yes", Tone::Good) } else { ("no", Tone::Warning) };
        let cells = [&statement.place, &statement.paper, &statement.here].map(|text| Cell::from(text.as_str()));
        statements = statements.row(cells.into_iter().chain([Cell::judged(answer, tone)]));
    }
    statements
}

fn deviations(file: &PaperFile) -> Table {
    let mut deviations = Table::new("Deviations", ["place", "in the paper", "here"]);
    for deviation in &file.deviations {
        deviations = deviations.row([&deviation.place, &deviation.trouble, &deviation.here]);
    }
    deviations
}

fn references(file: &PaperFile) -> Table {
    let mut references = Table::new("References", ["number", "authors", "idea", "here"])
        .note("names as in the paper's text; keys of a study, pages of the book");
    for reference in &file.references {
        references = references.row([
            format!("[{}]", reference.number),
            reference.source.clone(),
            reference.idea.clone(),
            reference.here.clone(),
        ]);
    }
    references
}

/// Chapters: title, tables, figures.
const CHAPTERS: &[(&str, &[usize], &[usize])] = &[
    ("The arm and its base parameters", &[1, 2], &[1]),
    ("The excitation trajectory", &[], &[2, 3, 4, 5, 6]),
    ("Its optimisation", &[3], &[7]),
    ("The iteration", &[], &[8]),
    ("Joint 2, three runs", &[4], &[9, 10, 11, 12]),
    ("Joint 1, three runs", &[5], &[13, 14]),
    ("Fourier series for comparison", &[6], &[15]),
    (TORQUES, &[], &[16, 17]),
];

fn equal_conditions(page: &mut Report, file: &PaperFile, extras: &Extras) {
    page.add(Heading::new(EQUAL));
    page.add(Text::new(file.comparison.conditions.clone()));
    page.add(Text::new(file.comparison.statement.clone()));
    page.add(file.comparison.table());
    for plot in &extras.comparison_plots {
        page.add(plot.clone());
    }
}

fn section(table: &PaperTable) -> Table {
    let mut section = Table::new(table.heading(), table.columns.iter().cloned()).note(table.note.clone());
    for row in &table.rows {
        section = section.row(row.iter().map(PaperCell::shown).collect::<Vec<String>>());
    }
    section
}

/// Starts with a capital letter, because the text can follow another sentence.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn drawn(figure: &PaperFigure) -> Section {
    let parts = [figure.caption.as_str(), figure.note.as_str()].map(sentence);
    let note = parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(". ");
    match figure.picture.clone() {
        PaperPicture::Plot(plot) => LinePlot { title: figure.heading(), note, ..plot }.into(),
        PaperPicture::Diagram(diagram) => dynident_report::Diagram { title: figure.heading(), note, ..diagram }.into(),
    }
}
