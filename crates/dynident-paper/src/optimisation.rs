//! Fig. 7 and Table 3: the paper's genetic algorithm on the paper's problem, and the optimum for comparison.

use crate::arm::Arm;
use crate::piece::{PaperCell, PaperFigure, PaperTable, shown};
use crate::problem;
use core::ops::ControlFlow;
use dynident::result::{StrokeFile, WindowedFile};
use dynident::{Error, RunOptions, Study, StudyError, StudyFileError, design_study};
use dynident_excitation::optimisers::Generation;
use dynident_excitation::step_wise::Stroke;
use dynident_report::LinePlot;

/// Rate at which the paper's δ is interpreted as a number of samples, Hz.
const DELTA_RATE_HZ: f64 = 100.0;

pub(crate) struct OptimumMotion {
    pub(crate) figure_7: PaperFigure,
    pub(crate) table_3: PaperTable,
    /// The optimum inside (18), joint 1 first.
    pub(crate) optimum: [Stroke; 2],
    /// H of the optimum and of the genetic algorithm.
    pub(crate) fitness: [f64; 2],
}

/// Solves the design study in `out/study`, like `dynident design`.
pub(crate) fn optimised(arm: &Arm, seed: u64, options: &RunOptions<'_>) -> Result<OptimumMotion, Error> {
    let mut study = Study::load(&arm.design)?;
    study.design.get_or_insert_default().search.seed = seed;
    let outcome = design_study(&study, &arm.design, options, |_| ControlFlow::Continue(()))?;
    let windowed =
        outcome.file.windowed.as_ref().filter(|file| file.optimum_strokes.len() == 2 && file.strokes.len() == 2);
    let Some((file, optimum_fitness)) = windowed.and_then(|file| Some((file, file.optimum?))) else {
        let error = StudyError::conflict("design", "the search found no motion inside the limits (18)");
        return Err(StudyFileError::study(&arm.design)(error).into());
    };
    let [optimum, genetic] =
        [&file.optimum_strokes, &file.strokes].map(|strokes| ["joint1", "joint2"].map(|joint| stroke(strokes, joint)));
    Ok(OptimumMotion {
        figure_7: figure_7(&outcome.history, optimum_fitness),
        table_3: table_3(file, optimum, genetic),
        optimum,
        fitness: [optimum_fitness, file.fitness],
    })
}

/// Stroke of a joint by name; a step-wise design begins with the tip joint.
fn stroke(strokes: &[StrokeFile], joint: &str) -> Stroke {
    let found = strokes.iter().find(|stroke| stroke.joint == joint).unwrap_or(&strokes[0]);
    Stroke { amplitude_rad: found.amplitude_rad, steepness_per_s: found.steepness_per_s, window_s: found.window_s }
}

fn figure_7(history: &[Generation], optimum: f64) -> PaperFigure {
    let generations: Vec<f64> = (0..history.len()).map(|generation| generation as f64).collect();
    let best: Vec<f64> = history.iter().map(|generation| generation.best_so_far).collect();
    let mean: Vec<f64> = history.iter().map(|generation| generation.mean).collect();
    let last = best.last().copied().unwrap_or(f64::NAN);
    let plot = LinePlot::new("Optimization process", "generation", "H", generations)
        .line("best so far", best)
        .dashed("mean", mean)
        .dashed("optimum", vec![optimum; history.len()])
        .log_y();
    PaperFigure::new(7, plot, "the paper's genetic algorithm: 20 bits, 40 individuals, roulette by 1/H, crossover 0.5, mutation 0.01, 500 generations, penalty 1000")
        .value("genetic_algorithm", last)
        .value("optimum", optimum)
        .caption(format!("Last H of the genetic algorithm: {}; the optimum inside (18): {}", shown(last), shown(optimum)))
}

fn table_3(file: &WindowedFile, optimum: [Stroke; 2], genetic: [Stroke; 2]) -> PaperTable {
    let paper = problem::table_3(DELTA_RATE_HZ);
    let constants = problem::constants();
    let note = format!(
        "H of the optimum inside (18) is {:.2}, the genetic algorithm ends {:.0} % above it; the paper's own values violate (18)",
        file.optimum.unwrap_or(f64::NAN),
        file.above_optimum_percent.unwrap_or(f64::NAN)
    );
    let columns = ["parameter", "paper", "genetic algorithm, here", "optimum inside (18), here"];
    let mut table = PaperTable::new(3, "Optimized trajectory parameters", &columns, &note);
    let all = [&paper, &genetic, &optimum];
    for joint in 0..2 {
        let index = ["₁", "₂"][joint];
        let mut row = |name: String, of: &dyn Fn(&Stroke) -> f64| {
            table.row(core::iter::once(PaperCell::Text(name)).chain(all.map(|strokes| of(&strokes[joint]).into())));
        };
        row(format!("A{index}, rad"), &|stroke| stroke.amplitude_rad);
        row(format!("ω{index}, 1/s"), &|stroke| stroke.steepness_per_s);
        row(format!("δ{index}, s"), &|stroke| stroke.window_s);
        row(format!("condition number, joint {}", joint + 1), &|stroke| constants.condition_number(stroke));
        row(format!("peak speed over its limit, joint {}", joint + 1), &|stroke| {
            0.25 * stroke.amplitude_rad * stroke.steepness_per_s / constants.speed_limit
        });
        row(format!("peak acceleration over its limit, joint {}", joint + 1), &|stroke| {
            // The maximum of f(1-f)(1-2f) is 1/(6√3).
            stroke.amplitude_rad * stroke.steepness_per_s.powi(2)
                / (6.0 * 3.0_f64.sqrt())
                / constants.acceleration_limit
        });
    }
    table
}
