//! Index of the page: every number of the paper, the reproduced number, and a link.

use crate::PaperFile;
use crate::comparison::EQUAL_TABLE;
use crate::piece::{PaperCell, PaperFigure, PaperTable, rough, shown};
use dynident_report::{Cell, Table};

pub(crate) const EQUAL: &str = "Both methods under equal conditions";
pub(crate) const STATEMENTS: &str = "Reproduced and not reproduced statements";
pub(crate) const DEVIATION_TITLE: &str = "Deviations from the paper, with reasons";
pub(crate) const REFERENCES: &str = "The paper's references [7] to [20] in this project";
pub(crate) const TORQUES: &str = "Verification on another motion";

pub(crate) fn index(file: &PaperFile, tables: &[PaperTable]) -> Table {
    let mut index =
        Table::new("Index of tables, figures and equations", ["in the paper", "what", "the paper's number", "here"])
            .note("the first column contains links");
    let numbers = Numbers { file, tables };
    for entry in ENTRIES {
        if let Some(to) = numbers.target(entry.at) {
            let cells =
                [Cell::link(entry.place, to), entry.what.into(), entry.paper.into(), Cell::from(numbers.here(entry))];
            index.rows.push(cells.to_vec());
        }
    }
    index
}

struct Numbers<'a> {
    file: &'a PaperFile,
    tables: &'a [PaperTable],
}

impl<'a> Numbers<'a> {
    fn table(&self, number: usize) -> Option<&'a PaperTable> {
        self.tables.iter().find(|table| table.number == number)
    }

    fn figure(&self, number: usize) -> Option<&'a PaperFigure> {
        self.file.figures.iter().find(|figure| figure.number == number)
    }

    fn target(&self, at: At) -> Option<String> {
        match at {
            At::Table(number) => self.table(number).map(PaperTable::heading),
            At::Figure(number) => self.figure(number).map(PaperFigure::heading),
            At::Chapter(title) => Some(title.to_owned()),
        }
    }

    fn value(&self, number: usize, name: &str) -> f64 {
        self.figure(number).and_then(|figure| figure.values.get(name)).copied().unwrap_or(f64::NAN)
    }

    fn reached(&self, goal: usize) -> f64 {
        self.file.reached.get(goal).map_or(f64::NAN, |goal| goal.value)
    }

    /// Largest tracking errors of the three runs of a figure.
    fn errors(&self, number: usize) -> String {
        let of = |run: usize| rough(self.value(number, &format!("largest_error_of_run_{run}_rad")));
        format!("{} rad", [1, 2, 3].map(of).join(", "))
    }

    /// Values after the third run in the columns as in the paper, which are in column 4 of Tables 4 and 5.
    fn third(&self, number: usize) -> String {
        let rows = self.table(number).map(|table| table.rows.as_slice()).unwrap_or_default();
        let last = rows.iter().filter(|row| row.get(1) == Some(&PaperCell::Text("3".to_owned())));
        last.filter_map(|row| row.get(4)).map(PaperCell::shown).collect::<Vec<_>>().join(", ")
    }

    fn here(&self, entry: &Entry) -> String {
        match entry.place {
            "Table 3" | "Fig. 7" => format!(
                "genetic algorithm {}, optimum {}",
                shown(self.value(7, "genetic_algorithm")),
                shown(self.value(7, "optimum"))
            ),
            "Table 1" => "a₁ = 1 m".to_owned(),
            "Table 2" => "the same six".to_owned(),
            "Eqs. 11 to 13, Fig. 2" => rough(self.value(2, "largest_derivative_at_minus_10")),
            "Fig. 3" => rough(self.value(3, "largest_rate_at_rest")),
            "Eqs. 21 to 23" => format!("α₂ = {:.4}", 1.4 / 1.7),
            "Fig. 6" => format!("δ = {} s", shown(self.value(6, "delta_s"))),
            "the claim" => {
                let case = self.file.comparison.cases.first();
                case.map_or_else(String::new, |case| {
                    format!("errors {:.2} ± {:.2} times as large", case.quotient, case.quotient_std)
                })
            }
            "Eqs. 3 to 7" => format!("largest difference {}", rough(self.reached(0))),
            "Fig. 9" | "Fig. 10" | "Fig. 11" => {
                let number = match entry.at {
                    At::Figure(number) => number,
                    At::Table(_) | At::Chapter(_) => 0,
                };
                format!("largest error {} rad", rough(self.value(number, "largest_error_rad")))
            }
            "Fig. 12" => self.errors(12),
            "Fig. 14" => self.errors(14),
            "Table 4" => self.third(4),
            "Table 5" => self.third(5),
            "Table 6" => {
                let rows = self.table(6).map(|table| table.rows.as_slice()).unwrap_or_default();
                rows.iter().filter_map(|row| row.get(4)).map(PaperCell::shown).collect::<Vec<_>>().join(", ")
            }
            "Fig. 16" | "Fig. 17" => {
                let number = if entry.place == "Fig. 16" { 16 } else { 17 };
                let [logistic, fourier] = ["logistic", "fourier"]
                    .map(|name| rough(self.value(number, &format!("rms_deviation_with_noise_{name}_nm"))));
                format!("with noise: logistic {logistic}, Fourier {fourier} Nm")
            }
            _ => String::new(),
        }
    }
}

#[derive(Clone, Copy)]
enum At {
    Table(usize),
    Figure(usize),
    Chapter(&'static str),
}

struct Entry {
    place: &'static str,
    at: At,
    what: &'static str,
    paper: &'static str,
}

const fn entry(place: &'static str, at: At, what: &'static str, paper: &'static str) -> Entry {
    Entry { place, at, what, paper }
}

/// Rows of the index, in the paper's order.
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
    entry("Eqs. 15, 16", At::Chapter(DEVIATION_TITLE), "the map from position to velocity and acceleration", ""),
    entry("Fig. 6", At::Figure(6), "samples for the identification", ""),
    entry("Table 3", At::Table(3), "trajectory parameters; H of Eq. 19", "A, ω, δ; H not given"),
    entry("Fig. 7", At::Figure(7), "H by generation, Eqs. 17 to 19", "not given"),
    entry("Fig. 8", At::Figure(8), "the procedure", ""),
    entry("Eqs. 21 to 23", At::Chapter(DEVIATION_TITLE), "the finite-time law", "α₂ = 0.82"),
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
    entry("the claim", At::Chapter(EQUAL), "both methods under equal conditions", "logistic better"),
    entry("all cases", At::Chapter(EQUAL_TABLE), "both methods by differentiator and noise", ""),
    entry("the statements", At::Chapter(STATEMENTS), "reproduced and not reproduced", ""),
    entry("[7] to [20]", At::Chapter(REFERENCES), "their ideas in this project", ""),
];
