//! `report.html` of the reproduction.

use crate::PaperFile;
use crate::index::{DEPARTURES, EQUAL, REFERENCES, TORQUES, WORDS, index};
use crate::piece::{PaperCell, PaperFigure, PaperPicture, PaperTable, shown};
use dynident::Error;
use dynident_report::{Cell, Heading, KeyFigures, LinePlot, Report, Section, Table, Text, Tone};

/// What the page shows beside the paper's own tables and figures.
pub(crate) struct Extras {
    /// The compared motions, and how both were followed.
    pub(crate) beside: Vec<LinePlot>,
    /// Beside Figs. 16 and 17.
    pub(crate) with_noise: Vec<LinePlot>,
    /// Largest parameter error of our variant after one, three and six runs.
    pub(crate) own_errors: [f64; 3],
}

const INDEX: &str = "Where to find what";

/// The page: what was reached, where to find what, every table and figure in the order of the paper, the comparison of
/// both methods, what does not come out, where we depart, the references.
pub(crate) fn page(file: &PaperFile, tables: &[PaperTable], extras: &Extras) -> Result<String, Error> {
    let mut page = Report::new("Iterative identification of robot dynamic parameters based on logistic function")
        .subtitle("every table and figure of the paper, computed anew by `dynident reproduce`, the paper's values beside ours");
    page.add(key_figures(file));
    page.add(Text::new(file.comparison.statement.clone()));
    page.add(Text::new(file.comparison.one_run(extras.own_errors)));
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
                let beside =
                    extras.with_noise.iter().filter(|plot| plot.title.starts_with(&format!("Fig. {},", figure.number)));
                beside.for_each(|plot| {
                    page.add(plot.clone());
                });
            }
        }
    }
    page.add(Heading::new(WORDS));
    page.add(words(file));
    page.add(Heading::new(DEPARTURES));
    page.add(departures(file));
    page.add(Heading::new(REFERENCES));
    page.add(references(file));
    page.add(Text::new(format!(
        "Made by dynident {} with seed {} in {:.1} s. The studies lie in the folder `study`: run them again, change them.",
        file.version, file.seed, file.seconds
    )));
    Ok(page.html()?)
}

/// The goals and the comparison of both methods.
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
        "logistic strokes' parameter error over the Fourier series', equal conditions, with noise",
        file.comparison
            .cases
            .first()
            .map_or_else(|| "–".to_owned(), |case| format!("{:.2} ± {:.2}", case.quotient, case.quotient_std)),
        format!("Cramér-Rao bound: {:.2}", file.comparison.bound),
    )
}

/// The statements of the paper, each with its result here.
fn words(file: &PaperFile) -> Table {
    let mut words = Table::new("What the paper says in words", ["place", "the paper says", "here", "comes out"]);
    for statement in &file.statements {
        let (answer, tone) = if statement.holds { ("yes", Tone::Good) } else { ("no", Tone::Warning) };
        let cells = [&statement.place, &statement.paper, &statement.here].map(|text| Cell::from(text.as_str()));
        words = words.row(cells.into_iter().chain([Cell::judged(answer, tone)]));
    }
    words
}

/// The deviations from the paper.
fn departures(file: &PaperFile) -> Table {
    let mut departures = Table::new("Departures", ["place", "in the paper", "here"]);
    for deviation in &file.deviations {
        departures = departures.row([&deviation.place, &deviation.trouble, &deviation.here]);
    }
    departures
}

/// The references of the paper.
fn references(file: &PaperFile) -> Table {
    let mut references = Table::new("References", ["number", "whose", "idea", "here"])
        .note("names are those of the paper's text; keys are those of a study, pages those of the book");
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
    ("Fourier series beside it", &[6], &[15]),
    (TORQUES, &[], &[16, 17]),
];

fn equal_conditions(page: &mut Report, file: &PaperFile, extras: &Extras) {
    page.add(Heading::new(EQUAL));
    page.add(Text::new(file.comparison.conditions.clone()));
    page.add(Text::new(file.comparison.statement.clone()));
    page.add(file.comparison.table());
    for plot in &extras.beside {
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

/// With a capital letter, for a sentence may follow another one.
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
