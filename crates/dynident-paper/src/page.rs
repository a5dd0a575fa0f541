//! `report.html` of the reproduction.

use crate::PaperFile;
use crate::comparison::EQUAL_TABLE;
use crate::piece::{PaperCell, PaperFigure, PaperPicture, PaperTable, rough, shown};
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
const EQUAL: &str = "Both methods under equal conditions";
const WORDS: &str = "What comes out, and what does not";
const DEPARTURES: &str = "Where we depart from the paper, and why";
const REFERENCES: &str = "The paper's references [7] to [20], and where their ideas live here";

/// The page: what was reached, where to find what, every table and figure in the order of the paper, the comparison of
/// both methods, what does not come out, where we depart, the references.
pub(crate) fn page(file: &PaperFile, tables: &[PaperTable], extras: &Extras) -> Result<String, Error> {
    let mut page = Report::new("Iterative identification of robot dynamic parameters based on logistic function")
        .subtitle("every table and figure of the paper, computed anew by `dynident reproduce`, the paper's values beside ours");
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
    page.add(
        key.figure(
            "logistic strokes' parameter error over the Fourier series', equal conditions, with noise",
            file.comparison
                .cases
                .first()
                .map_or_else(|| "–".to_owned(), |case| format!("{:.2} ± {:.2}", case.quotient, case.quotient_std)),
            format!("Cramér-Rao bound: {:.2}", file.comparison.bound),
        ),
    );
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
    let mut words = Table::new("What the paper says in words", ["place", "the paper says", "here", "comes out"]);
    for statement in &file.statements {
        let (answer, tone) = if statement.holds { ("yes", Tone::Good) } else { ("no", Tone::Warning) };
        let cells = [&statement.place, &statement.paper, &statement.here].map(|text| Cell::from(text.as_str()));
        words = words.row(cells.into_iter().chain([Cell::judged(answer, tone)]));
    }
    page.add(words);
    page.add(Heading::new(DEPARTURES));
    let mut departures = Table::new("Departures", ["place", "in the paper", "here"]);
    for deviation in &file.deviations {
        departures = departures.row([&deviation.place, &deviation.trouble, &deviation.here]);
    }
    page.add(departures);
    page.add(Heading::new(REFERENCES));
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
    page.add(references);
    page.add(Text::new(format!(
        "Made by dynident {} with seed {} in {:.1} s. The studies lie in the folder `study`: run them again, change them.",
        file.version, file.seed, file.seconds
    )));
    Ok(page.html()?)
}

const TORQUES: &str = "Verification on another motion";

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

/// Every number of the paper, ours, and a link.
fn index(file: &PaperFile, tables: &[PaperTable]) -> Table {
    let mut index =
        Table::new("Index of tables, figures and equations", ["in the paper", "what", "the paper's number", "here"])
            .note("a click on the first column leads there");
    let mut row = |place: &str, to: String, what: &str, paper: &str, here: String| {
        let cells = [Cell::link(place, to), what.into(), paper.into(), Cell::from(here)];
        index.rows.push(cells.to_vec());
    };
    let table = |number: usize| tables.iter().find(|table| table.number == number);
    let figure = |number: usize| file.figures.iter().find(|figure| figure.number == number);
    let value = |number: usize, name: &str| {
        figure(number).and_then(|figure| figure.values.get(name)).copied().unwrap_or(f64::NAN)
    };
    let reached = |k: usize| file.reached.get(k).map_or(f64::NAN, |goal| goal.value);
    let errors = |number: usize| -> String {
        let of = |run: usize| rough(value(number, &format!("largest_error_of_run_{run}_rad")));
        format!("{} rad", [1, 2, 3].map(of).join(", "))
    };
    // Values after the third run as in the paper stand in column 4 of Tables 4 and 5.
    let third = |number: usize| -> String {
        let rows = table(number).map(|table| table.rows.as_slice()).unwrap_or_default();
        let last = rows.iter().filter(|row| row.get(1) == Some(&PaperCell::Text("3".to_owned())));
        last.filter_map(|row| row.get(4)).map(PaperCell::shown).collect::<Vec<_>>().join(", ")
    };
    for entry in ENTRIES {
        let to = match entry.at {
            At::Table(number) => table(number).map(PaperTable::heading),
            At::Figure(number) => figure(number).map(PaperFigure::heading),
            At::Chapter(title) => Some(title.to_owned()),
        };
        let here = match entry.place {
            "Table 3" | "Fig. 7" => format!(
                "genetic algorithm {}, optimum {}",
                shown(value(7, "genetic_algorithm")),
                shown(value(7, "optimum"))
            ),
            "Table 1" => "a₁ = 1 m".to_owned(),
            "Table 2" => "the same six".to_owned(),
            "Eqs. 11 to 13, Fig. 2" => rough(value(2, "largest_derivative_at_minus_10")),
            "Fig. 3" => rough(value(3, "largest_rate_at_rest")),
            "Eqs. 21 to 23" => format!("α₂ = {:.4}", 1.4 / 1.7),
            "Fig. 6" => format!("δ = {} s", shown(value(6, "delta_s"))),
            "the claim" => {
                let case = file.comparison.cases.first();
                case.map_or_else(String::new, |case| {
                    format!("{:.2} ± {:.2} times the errors", case.quotient, case.quotient_std)
                })
            }
            "Eqs. 3 to 7" => format!("largest difference {}", rough(reached(0))),
            "Fig. 9" | "Fig. 10" | "Fig. 11" => {
                let number = match entry.at {
                    At::Figure(number) => number,
                    At::Table(_) | At::Chapter(_) => 0,
                };
                format!("largest error {} rad", rough(value(number, "largest_error_rad")))
            }
            "Fig. 12" => errors(12),
            "Fig. 14" => errors(14),
            "Table 4" => third(4),
            "Table 5" => third(5),
            "Table 6" => {
                let rows = table(6).map(|table| table.rows.as_slice()).unwrap_or_default();
                rows.iter().filter_map(|row| row.get(4)).map(PaperCell::shown).collect::<Vec<_>>().join(", ")
            }
            "Fig. 16" | "Fig. 17" => {
                let number = if entry.place == "Fig. 16" { 16 } else { 17 };
                let [logistic, fourier] = ["logistic", "fourier"]
                    .map(|name| rough(value(number, &format!("rms_deviation_with_noise_{name}_nm"))));
                format!("with noise: logistic {logistic}, Fourier {fourier} Nm")
            }
            _ => String::new(),
        };
        if let Some(to) = to {
            row(entry.place, to, entry.what, entry.paper, here);
        }
    }
    index
}

/// Where a row of the index leads.
#[derive(Clone, Copy)]
enum At {
    Table(usize),
    Figure(usize),
    Chapter(&'static str),
}

/// A row of the index.
struct Entry {
    place: &'static str,
    at: At,
    what: &'static str,
    paper: &'static str,
}

const fn entry(place: &'static str, at: At, what: &'static str, paper: &'static str) -> Entry {
    Entry { place, at, what, paper }
}

/// The index, in the paper's order.
const ENTRIES: &[Entry] = &[
    entry("Table 1", At::Table(1), "modified D-H parameters", ""),
    entry("Fig. 1", At::Figure(1), "the arm and its frames", ""),
    entry("Table 2", At::Table(2), "base parameters", "six"),
    entry("Eqs. 3 to 7", At::Table(2), "observation matrix against the general regressor", ""),
    entry("Eqs. 8 to 10", At::Chapter("Joint 2, three runs"), "joint 2 first, then joint 1", ""),
    entry("Eqs. 11 to 13, Fig. 2", At::Figure(2), "logistic function", "below 1e-4 at rest"),
    entry("Fig. 3", At::Figure(3), "spliced logistic function", "below 1e-4 at rest"),
    entry("Eq. 14, Fig. 4", At::Figure(4), "different ω", ""),
    entry("Fig. 5", At::Figure(5), "different T", ""),
    entry("Eqs. 15, 16", At::Chapter(DEPARTURES), "the map from position to velocity and acceleration", ""),
    entry("Fig. 6", At::Figure(6), "the samples that are used", ""),
    entry("Table 3", At::Table(3), "trajectory parameters; H of Eq. 19", "A, ω, δ; H not given"),
    entry("Fig. 7", At::Figure(7), "H by generation, Eqs. 17 to 19", "not given"),
    entry("Fig. 8", At::Figure(8), "the procedure", ""),
    entry("Eqs. 21 to 23", At::Chapter(DEPARTURES), "the finite-time law", "α₂ = 0.82"),
    entry("Fig. 9", At::Figure(9), "first run of joint 2", ""),
    entry("Fig. 10", At::Figure(10), "second run of joint 2", ""),
    entry("Fig. 11", At::Figure(11), "third run of joint 2", ""),
    entry("Fig. 12", At::Figure(12), "tracking errors of joint 2", "0.6, 0.15, 0 rad"),
    entry("Table 4", At::Table(4), "θ₄, θ₅, θ₆ after three runs", "0.993, 1.000, 0.000"),
    entry("Fig. 13", At::Figure(13), "runs of joint 1", ""),
    entry("Fig. 14", At::Figure(14), "tracking errors of joint 1", "last one 0"),
    entry("Table 5", At::Table(5), "θ₁, θ₂, θ₃ after three runs", "1.991, 2.000, 0.002"),
    entry("Eq. 24, Fig. 15", At::Figure(15), "Fourier series", ""),
    entry("Table 6", At::Table(6), "θ by the Fourier series' own fit", "1.98, 2.0, 0.0, 1.007, 1.00, 0.009"),
    entry("Eq. 25, verification", At::Chapter(TORQUES), "q₁ = sin t, q₂ = sin(−t)", ""),
    entry("Fig. 16", At::Figure(16), "torques of joint 1", "drawn only"),
    entry("Fig. 17", At::Figure(17), "torques of joint 2", "drawn only"),
    entry("the claim", At::Chapter(EQUAL), "both methods, alike", "logistic better"),
    entry("all cases", At::Chapter(EQUAL_TABLE), "both methods by differentiator and noise", ""),
    entry("the words", At::Chapter(WORDS), "what comes out, and what does not", ""),
    entry("[7] to [20]", At::Chapter(REFERENCES), "where their ideas live here", ""),
];

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
