//! **Reproduction of the paper**: every table and figure of *Iterative Identification of Robot Dynamic Parameters Based
//! on Logistic Function*, computed with the same crates and studies as a user's own robot, and with the parts that only
//! the paper needs.
//!
//! [`reproduce`] computes everything for the command `dynident reproduce`.

#![forbid(unsafe_code)]

mod arm;
mod base_parameters;
mod comparison;
mod deviations;
mod drawings;
mod equal_conditions;
mod index;
mod joint_runs;
mod literal_map;
mod optimisation;
mod outcomes;
mod page;
mod piece;
mod problem;
mod references;
mod scene;
mod strokes;
mod verification;

pub use comparison::{ComparisonCase, MethodFigures, PaperComparison};
pub use piece::{Deviation, PaperCell, PaperFigure, PaperPicture, PaperReference, PaperStatement, PaperTable};

use arm::Arm;
use deviations::deviations;
use dynident::{Error, OutputSet, RunOptions, check_writable};
use dynident_system::TemporaryFolder;
use joint_runs::JointRuns;
use references::references;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;
use verification::Verification;

/// Name and version of the schema of [`PaperFile`].
pub const PAPER_SCHEMA: &str = "dynident/paper/1";

/// Output of `reproduce` as JSON, also written as `paper.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperFile {
    /// [`PAPER_SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Goals of the reproduction.
    pub reached: Vec<GoalFigures>,
    /// Tables 1 to 6, by number.
    pub tables: BTreeMap<String, PaperTable>,
    /// Figures 1 to 17.
    pub figures: Vec<PaperFigure>,
    /// Comparison of both methods under equal conditions, and the conclusion about the paper's claim.
    pub comparison: PaperComparison,
    /// Statements and figure readings of the paper, and their results.
    pub statements: Vec<PaperStatement>,
    /// Deviations from the paper, with reasons.
    pub deviations: Vec<Deviation>,
    /// References 7 to 20 of the paper, and the corresponding parts of this project.
    pub references: Vec<PaperReference>,
    /// Wall time, s.
    pub seconds: f64,
}

/// A goal of the reproduction.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct GoalFigures {
    /// Measured quantity.
    pub what: String,
    /// Its value.
    pub value: f64,
    /// Maximum value of the goal.
    pub goal: f64,
    /// Whether the goal is reached.
    pub met: bool,
}

impl GoalFigures {
    fn at_most(what: &str, value: f64, goal: f64) -> Self {
        Self { what: what.to_owned(), value, goal, met: value <= goal }
    }
}

/// Computes every table and figure and writes `paper.json`, `report.html`, the pictures and the studies into `out`.
///
/// # Errors
/// A file that cannot be written; a study without the required result.
pub fn reproduce(out: &Path, seed: u64, options: &RunOptions<'_>) -> Result<PaperFile, Error> {
    let begun = Instant::now();
    check_writable(out)?;
    let stage = |name: &str| options.progress.begin(name, None);
    let done = || options.progress.end();
    stage("1 of 5: base parameters and strokes");
    // The studies are loaded like a user's own, and appear in the output at the end.
    let folder = TemporaryFolder::new().map_err(|source| Error::Output { path: std::env::temp_dir(), source })?;
    let arm = Arm::written(folder.path())?;
    let (table_2, difference) = base_parameters::table_2(&arm);
    done();
    stage("2 of 5: genetic algorithm and optimum");
    let optimised = optimisation::optimised(&arm, seed, options)?;
    done();
    stage("3 of 5: runs of joint 2 and joint 1");
    let runs = joint_runs::joint_runs(&arm, &optimised.optimum)?;
    done();
    stage("4 of 5: logistic strokes and Fourier series under equal conditions");
    let both = equal_conditions::compared(&arm, folder.path(), seed, options)?;
    done();
    stage("5 of 5: verification");
    let verification = Verification::run(&arm)?;
    let comparison = PaperComparison::new(&both, &verification);
    done();
    let [one, two] = &optimised.optimum;
    let mut figures = vec![
        drawings::figure_1(),
        strokes::figure_2(),
        strokes::figure_3(),
        strokes::figure_4(),
        strokes::figure_5(),
        strokes::figure_6(one.amplitude_rad, one.steepness_per_s, one.window_s.min(two.window_s)),
        optimised.figure_7,
        drawings::figure_8(),
    ];
    let quotient = comparison.cases.first().map_or(f64::NAN, |case| case.quotient);
    let statements = outcomes::statements(&runs, optimised.fitness, &comparison.statement, quotient);
    let scene = scene::scene(&arm, &runs.as_paper, &both);
    let JointRuns { literal_errors, own_errors, .. } = runs;
    figures.extend(runs.figures);
    let (figure_15, comparison_plot) = comparison::figure_15(&both);
    figures.push(figure_15);
    let (torques, noisy_plots): (Vec<_>, Vec<_>) = verification.figures(&both).into_iter().unzip();
    figures.extend(torques);
    let mut comparison_plots = comparison::tracking_figures(&both);
    comparison_plots.insert(0, comparison_plot);
    let tables =
        [vec![drawings::table_1(&arm), table_2, optimised.table_3], runs.tables, vec![comparison::table_6(&both)]]
            .concat();
    let file = PaperFile {
        schema: PAPER_SCHEMA.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        reached: goals(difference, optimised.fitness[0], literal_errors, own_errors),
        tables: tables.iter().map(|table| (table.number.to_string(), table.clone())).collect(),
        figures,
        comparison,
        statements,
        deviations: deviations(),
        references: references(),
        seconds: begun.elapsed().as_secs_f64(),
    };
    let extras = page::Extras { scene, comparison_plots, noisy_plots, own_errors };
    write(out, &file, &tables, &extras)?;
    Ok(file)
}

/// Goals. `difference` is that of the observation matrices, `optimum` is H of the optimum inside (18), and the
/// parameter errors are after one, three and six runs.
fn goals(difference: f64, optimum: f64, literal_errors: [f64; 3], own_errors: [f64; 3]) -> Vec<GoalFigures> {
    let three_runs = "largest parameter error after three runs";
    vec![
        GoalFigures::at_most("observation matrix against Eq. 7", difference, 1e-12),
        GoalFigures::at_most("H of the optimum inside (18)", optimum, 161.3 * 1.001),
        GoalFigures::at_most(&format!("{three_runs}, the paper's own loop"), literal_errors[1], 0.009),
        GoalFigures::at_most(&format!("{three_runs}, our variant"), own_errors[1], 1e-6),
    ]
}

fn write(out: &Path, file: &PaperFile, tables: &[PaperTable], extras: &page::Extras) -> Result<(), Error> {
    let json = dynident::text::json::to_string_pretty(file)
        .map_err(|error| Error::Result { path: out.join("paper.json"), message: error.to_string() })?;
    let mut set = OutputSet::new(out).file("paper.json", json + "\n");
    set = set.file("report.html", page::page(file, tables, extras)?);
    for (name, contents) in [arm::DESCRIPTION, arm::DESIGN, equal_conditions::FOURIER, equal_conditions::LOGISTIC] {
        set = set.file(name, contents);
    }
    for figure in &file.figures {
        set = set.file(&figure.file, figure.picture.svg(WIDTH, HEIGHT)?);
    }
    set.write()
}

/// Size of the pictures, px.
const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 320.0;
