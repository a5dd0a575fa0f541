//! Fig. 15 and Table 6: the same iteration on a finite Fourier series inside the same limits.

use crate::arm::{Arm, TRUTH};
use crate::base_parameters::{COLUMNS, theta};
use crate::joint_runs::{failed, first_gains, model_based, prior};
use crate::piece::{PaperCell, PaperFigure, PaperTable};
use core::ops::ControlFlow;
use dynident::{Error, RunOptions, Study, design_study, write_whole};
use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_iteration::{Iteration, IterationError, IterationSettings, IterationTask, Leg, iterate};
use dynident_iteration::{Robot, SimulatedRobot};
use dynident_recording::DifferentiatorSettings;
use dynident_report::LinePlot;
use dynident_simulation::{Integrator, LoopSettings, Plant, Reference};
use std::path::Path;

/// The design of the comparison: two periods, of which the second is used.
const STUDY: &str = r#"# The comparison of the paper's Table 6: a finite Fourier series with five harmonics inside the paper's limits (18), two periods of 40 s.
name = "Fourier series inside the paper's limits"

[robot]
file = "robots/paper_2r.toml"

[drive]
viscous = false
coulomb = "none"
offset = false

[design]
family = { kind = "fourier", harmonics = 5, periods = 2 }
criterion = "d-optimal"
duration_s = 80.0
torque_std_nm = 1.0

[design.search]
rate_hz = 100.0
seed = 1

[design.limits]
joints = [
    { joint = "joint1", position = [0.0, 3.141592653589793], speed = 0.5235987755982988, acceleration = 0.20943951023931953 },
    { joint = "joint2", position = [0.0, 3.141592653589793], speed = 0.5235987755982988, acceleration = 0.20943951023931953 },
]
boxes = [{ y_m = [0.0, 2.5], points = [{ link = "link2", at_m = [1.0, 0.0, 0.0] }] }]

# The paper's limits and no others.
[design.defaults]
floor = false
self_collision = false
acceleration = false
stop_margin_percent = 0.0
"#;

/// Its name among the outputs, and its text.
pub(crate) const DESIGN: (&str, &str) = ("study/design_fourier.toml", STUDY);

const PERIOD_S: f64 = 40.0;
const RATE_HZ: f64 = 1000.0;
/// Harmonics of the fit to measured positions: the commanded five, and what the tracking error adds.
const FITTED: usize = 15;
const RUNS: usize = 3;

/// The paper's Table 6.
const PAPER: [f64; 6] = [1.98, 2.0, 0.0, 1.007, 1.00, 0.009];

/// What the Fourier series gives.
pub(crate) struct FourierRuns {
    pub(crate) figure_15: PaperFigure,
    pub(crate) table_6: PaperTable,
    pub(crate) values: [f64; 6],
}

/// Designs the series, runs and identifies three times with both joints moving, and keeps the last estimate.
pub(crate) fn fourier(arm: &Arm, folder: &Path, seed: u64, options: &RunOptions<'_>) -> Result<FourierRuns, Error> {
    let path = folder.join(DESIGN.0);
    write_whole(&path, DESIGN.1.as_bytes())?;
    let mut study = Study::load(&path)?;
    study.design.get_or_insert_default().search.seed = seed;
    let outcome = design_study(&study, &path, options, |_| ControlFlow::Continue(()))?;
    let (times, motion) = outcome.sampled(RATE_HZ);
    let values = identified(arm, &motion).map_err(|why| failed(&arm.description, why))?;
    let note = if outcome.file.feasible { "inside (18), checked at 10 kHz" } else { "no series inside (18) was found" };
    let plot = LinePlot::new("Optimized Fourier series trajectories", "t, s", "q, rad", times)
        .line("joint 1", motion.q[motion.of(0)].to_vec())
        .line("joint 2", motion.q[motion.of(1)].to_vec());
    let note = format!("{note}; the paper does not give its coefficients");
    let mut table = PaperTable::new(
        6,
        "Inertia parameters identified by Fourier series",
        &["parameter", "true", "paper", "its error", "here", "its error"],
        "three runs of both joints together, the second period of each; an error of 0.02 without noise as in the paper does not come about",
    );
    for place in 0..6 {
        let truth = TRUTH[place];
        let both = |value: f64| [PaperCell::from(value), (value - truth).abs().into()];
        let head = [PaperCell::Text(theta(place)), truth.into()];
        table.row(head.into_iter().chain(both(PAPER[place])).chain(both(values[place])));
    }
    Ok(FourierRuns { figure_15: PaperFigure::new(15, plot, &note), table_6: table, values })
}

fn identified(arm: &Arm, motion: &Motion) -> Result<[f64; 6], IterationError> {
    let reference = Reference::new(RATE_HZ, motion.clone())?;
    let second = vec![vec![[PERIOD_S, 2.0 * PERIOD_S]]; 2];
    let robot = ParametricModel::new(arm.model.clone(), Vec::new())?.with_nominal(prior(false))?;
    let task =
        IterationTask { robot, legs: vec![Leg::windowed(reference, second)?], known: Vec::new(), torque_limits: None };
    let mut settings = IterationSettings::default();
    settings.identification.differentiator =
        DifferentiatorSettings::FourierFit { base_hz: 1.0 / PERIOD_S, harmonics: FITTED, trend: false };
    settings.model_free = first_gains();
    settings.controller = model_based();
    settings.max_runs = RUNS;
    let iteration = Iteration::new(task, settings)?;
    let plant = Plant::new(&arm.model, &[], &[])?;
    let integrator = Integrator::Rk4 { steps_per_sample: 1 };
    let mut robot = SimulatedRobot::new(plant, LoopSettings { integrator, ..LoopSettings::default() })?;
    let outcome = iterate(&iteration, &mut [&mut robot as &mut dyn Robot], None, &mut |_, _| {})?;
    let last = outcome.runs.iter().rev().find_map(|run| run.estimate.as_ref());
    let values = last.map(|estimate| estimate.values.as_slice()).unwrap_or_default();
    Ok([0, 1, 2, 3, 4, 5].map(|place| values.get(COLUMNS[place]).copied().unwrap_or(f64::NAN)))
}
