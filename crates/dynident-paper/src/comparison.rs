//! Results of the runs under equal conditions: Fig. 15, Table 6, additional tables and figures, and one sentence about
//! the paper's claim.

use crate::arm::TRUTH;
use crate::base_parameters::theta;
use crate::equal_conditions::{
    CUTOFF_HZ, Comparison, DURATION_S, DesignedMotion, Differentiation, FITTED_HARMONICS, Method, POSITION_STD_RAD,
    RATE_HZ, RUNS, SEEDS, TORQUE_STD_NM, Trial, Trials, WINDOW_S, quotient,
};
use crate::piece::{PaperCell, PaperFigure, PaperTable, rough, thinned};
use crate::verification::{Verification, worst};
use dynident_report::{LinePlot, Table};
use dynident_simulation::Run;
use serde::{Deserialize, Serialize};

/// The paper's Table 6.
const PAPER: [f64; 6] = [1.98, 2.0, 0.0, 1.007, 1.00, 0.009];

const PLOT_DECIMATION: usize = 4;

/// Comparison of both methods under equal conditions.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PaperComparison {
    /// Description of the equal conditions.
    pub conditions: String,
    /// Conclusion about the paper's claim.
    pub statement: String,
    /// Ratio of the parameter errors of the logistic strokes to those of the Fourier series, by the Cramér-Rao bound of
    /// the two motions: geometric mean over the six parameters.
    pub bound: f64,
    /// Number of noisy iterations of each method and differentiator.
    pub seeds: u64,
    /// Results by differentiator.
    pub cases: Vec<ComparisonCase>,
}

/// Results with one differentiator.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparisonCase {
    /// Description of the differentiator.
    pub differentiator: String,
    /// Results of the logistic strokes.
    pub logistic: MethodFigures,
    /// Results of the Fourier series.
    pub fourier: MethodFigures,
    /// Ratio of the parameter errors after the last noisy run, logistic strokes to Fourier series: geometric mean over
    /// the six of the quotients of root mean squares over seeds.
    pub quotient: f64,
    /// Standard deviation of the ratio.
    pub quotient_std: f64,
}

/// Results of one method.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MethodFigures {
    /// Largest parameter error of each run, without noise.
    pub parameter_error: Vec<f64>,
    /// Largest parameter error of each run with noise, root mean square over seeds.
    pub parameter_error_with_noise: Vec<f64>,
    /// Largest tracking error of both joints in each run without noise, rad.
    pub tracking_error_rad: Vec<f64>,
    /// Root mean square of predicted minus driving torque of each joint along Eq. 25 after the last run, Nm.
    pub torque_deviation_nm: [f64; 2],
    /// The same with noise in the identified runs, over all seeds.
    pub torque_deviation_with_noise_nm: [f64; 2],
}

impl Differentiation {
    fn name(self) -> String {
        match self {
            Self::Deviation => format!("deviation from the commanded motion, smoothed at {CUTOFF_HZ} Hz"),
            Self::Filter => format!("positions alone, zero-phase Butterworth filter at {CUTOFF_HZ} Hz"),
            Self::Own => {
                format!(
                    "the differentiator of each method: the paper's map within {WINDOW_S} s of the mid-points, a Fourier fit with {FITTED_HARMONICS} harmonics"
                )
            }
        }
    }
}

impl PaperComparison {
    pub(crate) fn new(all: &Comparison, verification: &Verification) -> Self {
        let bound = quotient(all.motions[0].bounds, all.motions[1].bounds);
        let cases: Vec<ComparisonCase> = Differentiation::ALL
            .into_iter()
            .filter_map(|way| {
                let [logistic, fourier] = [all.of(Method::Logistic, way)?, all.of(Method::Fourier, way)?];
                let quotient = quotient(logistic.noisy_errors(RUNS - 1), fourier.noisy_errors(RUNS - 1));
                Some(ComparisonCase {
                    differentiator: way.name(),
                    logistic: MethodFigures::of(logistic, verification),
                    fourier: MethodFigures::of(fourier, verification),
                    quotient,
                    // A root mean square of n runs has the relative error 1/√(2n), a quotient of two 1/√n. The
                    // parameters of one run are not independent, so the error is not divided further.
                    quotient_std: quotient / (SEEDS as f64).sqrt(),
                })
            })
            .collect();
        let conditions = format!(
            "Same arm, same limits (18), {DURATION_S} s with both joints moving, each motion designed for the same criterion (D-optimal) within its own family, {RATE_HZ} samples per second, first run under the same joint PD, then the law (23) with the paper's gains and the parameters of the previous run, {RUNS} runs, all samples used (except with the paper's map), torque and columns with the same filter. Once without noise, and {SEEDS} times with normal noise of {:.0e}° in positions and {TORQUE_STD_NM} Nm in torques, also for the controller. True parameters are those of section 3.",
            POSITION_STD_RAD.to_degrees()
        );
        let statement = statement(&cases, bound);
        Self { conditions, statement, bound, seeds: SEEDS, cases }
    }

    /// Result of a single run, in a sentence: largest parameter error after the first and the last run without noise.
    pub(crate) fn one_run(&self, own: [f64; 3]) -> String {
        let Some(case) = self.cases.first() else { return String::new() };
        let ends =
            |values: &[f64]| [values.first(), values.last()].map(|value| rough(value.copied().unwrap_or(f64::NAN)));
        let ([p1, p3], [n1, n3], [t1, t3]) = (
            ends(&case.logistic.parameter_error),
            ends(&case.logistic.parameter_error_with_noise),
            ends(&case.logistic.tracking_error_rad),
        );
        format!(
            "With a differentiator of the measured motion, one run is enough for the parameters, and further runs improve only the tracking. In our variant of Tables 4 and 5 the largest parameter error is {} after the first run ({} after the third). Under equal conditions it is {p1} and {p3} without noise, {n1} and {n3} with noise, while the largest tracking error decreases from {t1} to {t3} rad. Only the paper's map, which computes speed from a path that the arm does not follow exactly, needs several runs to find the parameters.",
            rough(own[0]),
            rough(own[1]),
        )
    }

    pub(crate) fn table(&self) -> Table {
        let columns = [
            "differentiator",
            "noise",
            "error of θ, logistic, run 1",
            "run 3",
            "error of θ, Fourier, run 1",
            "run 3",
            "logistic over Fourier, run 3",
            "torque of joint 1 along Eq. 25, Nm: logistic",
            "Fourier",
        ];
        let mut table = Table::new(EQUAL_TABLE, columns).note(
            "error of θ: the largest of the six; with noise root mean squares over seeds; logistic over Fourier: geometric mean over the six parameters. Torque: root mean square of predicted minus driving torque in the run of Fig. 16. The error of the logistic strokes without noise in the first row is caused by the splices, where the commanded speed jumps by about 1e-4 rad/s. With one joint at a time the paper's map is more accurate (Tables 4, 5)",
        );
        for case in &self.cases {
            let methods = [&case.logistic, &case.fourier];
            for noise in [false, true] {
                let mut row = vec![case.differentiator.clone(), if noise { "with" } else { "without" }.to_owned()];
                for method in methods {
                    let errors = if noise { &method.parameter_error_with_noise } else { &method.parameter_error };
                    row.extend([errors.first(), errors.last()].map(|value| rough(value.copied().unwrap_or(f64::NAN))));
                }
                row.push(if noise {
                    format!("{:.2} ± {:.2}", case.quotient, case.quotient_std)
                } else {
                    "–".to_owned()
                });
                row.extend(methods.map(|method| {
                    rough(if noise { method.torque_deviation_with_noise_nm[0] } else { method.torque_deviation_nm[0] })
                }));
                table = table.row(row);
            }
        }
        table
    }
}

pub(crate) const EQUAL_TABLE: &str = "Errors of parameters and torques, both methods";

/// The paper's claim, and the conclusion from these results.
fn statement(cases: &[ComparisonCase], bound: f64) -> String {
    let Some(case) = cases.first() else { return String::new() };
    let (quotient, bar) = (case.quotient, case.quotient_std);
    let last = |method: &MethodFigures| method.parameter_error.last().copied().unwrap_or(f64::NAN);
    let (word, claim) = if quotient > 1.0 && bound > 1.0 {
        ("larger", "does not hold")
    } else if quotient + 2.0 * bar < 1.0 && bound < 1.0 {
        ("smaller", "holds")
    } else {
        ("about as large", "is undecided")
    };
    format!(
        "Under equal conditions the paper's claim that its logistic function identifies better than a Fourier series {claim}: with noise the logistic strokes' parameter errors are {word}, {quotient:.2} ± {bar:.2} times those of the Fourier series (Cramér-Rao bound of the two motions: {bound:.2}), and without noise both find the parameters, with errors of {} and {} after three runs.",
        rough(last(&case.logistic)),
        rough(last(&case.fourier)),
    )
}

impl MethodFigures {
    fn of(trials: &Trials, verification: &Verification) -> Self {
        Self {
            parameter_error: trials.clean.theta.iter().map(worst).collect(),
            parameter_error_with_noise: (0..RUNS)
                .map(|run| trials.noisy_errors(run).into_iter().fold(0.0, f64::max))
                .collect(),
            tracking_error_rad: trials.clean.tracking.iter().map(|[one, two]| one.max(*two)).collect(),
            torque_deviation_nm: [0, 1].map(|joint| verification.deviation(joint, &trials.clean.last())),
            torque_deviation_with_noise_nm: [0, 1].map(|joint| verification.noisy_deviation(joint, trials)),
        }
    }
}

/// Fig. 15: the Fourier series, and the compared strokes.
pub(crate) fn figure_15(all: &Comparison) -> (PaperFigure, LinePlot) {
    let [logistic, fourier] = &all.motions;
    let note = if fourier.feasible {
        "five harmonics inside (18), checked at 10 kHz"
    } else {
        "no series inside (18) was found"
    };
    let note = format!("{note}; the paper does not state its coefficients");
    let plot = drawn(fourier, "Optimized Fourier series trajectories");
    let strokes =
        drawn(logistic, "For comparison with Fig. 15: logistic strokes for the same limits, time and criterion")
            .note("Eq. 14 for both joints at once, amplitude, ω and offset free");
    (PaperFigure::new(15, plot, &note), strokes)
}

fn drawn(motion: &DesignedMotion, title: &str) -> LinePlot {
    let motion = (motion.reference.motion(), motion.reference.rate_hz());
    let times = (0..motion.0.samples).map(|sample| sample as f64 / motion.1).collect();
    let plot = LinePlot::new(title, "t, s", "q, rad", times)
        .line("joint 1", motion.0.q[motion.0.of(0)].to_vec())
        .line("joint 2", motion.0.q[motion.0.of(1)].to_vec());
    thinned(plot, PLOT_DECIMATION)
}

/// Table 6: parameters of the Fourier series after three runs.
pub(crate) fn table_6(all: &Comparison) -> PaperTable {
    let columns = [
        "parameter",
        "true",
        "paper",
        "its error",
        "Fourier fit",
        "its error",
        "deviation",
        "its error",
        "deviation, with noise: rms error",
        "logistic strokes, same conditions",
    ];
    let note = "three runs of both joints together, without noise except in the last two columns (root mean square over seeds). Fourier fit: a fit of the measured positions; deviation: differentiation of the measured deviation from the commanded motion, as in all of our own columns. An error of 0.02 without noise, as in the paper, is caused by the fit, not by the motion";
    let mut table = PaperTable::new(6, "Inertia parameters identified by Fourier series", &columns, note);
    let of = |way| all.of(Method::Fourier, way);
    let last = |way| of(way).map_or([f64::NAN; 6], |trials| trials.clean.last());
    let noisy = |method| {
        all.of(method, Differentiation::Deviation).map_or([f64::NAN; 6], |trials| trials.noisy_errors(RUNS - 1))
    };
    let (fit, deviation) = (last(Differentiation::Own), last(Differentiation::Deviation));
    let (fourier, logistic) = (noisy(Method::Fourier), noisy(Method::Logistic));
    for place in 0..6 {
        let truth = TRUTH[place];
        let both = |value: f64| [PaperCell::from(value), (value - truth).abs().into()];
        let head = [PaperCell::Text(theta(place)), truth.into()];
        let cells = [PAPER[place], fit[place], deviation[place]].into_iter().flat_map(both);
        table.row(head.into_iter().chain(cells).chain([fourier[place].into(), logistic[place].into()]));
    }
    table
}

/// Tracking of both methods without noise, next to Figs. 9 to 14.
pub(crate) fn tracking_figures(all: &Comparison) -> Vec<LinePlot> {
    let [Some(logistic), Some(fourier)] = [Method::Logistic, Method::Fourier]
        .map(|method| all.of(method, Differentiation::Deviation).map(|trials| &trials.clean))
    else {
        return Vec::new();
    };
    let mut plots = vec![
        followed(
            logistic,
            "For comparison with Figs. 9 to 11 and 13: logistic strokes of both joints, first and third run",
        ),
        followed(
            fourier,
            "For comparison with Figs. 9 to 11 and 13: Fourier series of both joints, first and third run",
        ),
    ];
    plots.extend([1, 0].map(|joint| errors(joint, logistic, fourier)));
    plots.into_iter().map(|plot| thinned(plot, PLOT_DECIMATION)).collect()
}

fn times(run: &Run) -> Vec<f64> {
    (0..run.samples).map(|sample| run.time_s(sample)).collect()
}

fn followed(trial: &Trial, title: &str) -> LinePlot {
    let mut plot = LinePlot::new(title, "t, s", "q, rad", trial.runs.first().map(times).unwrap_or_default());
    let length = plot.x.len();
    let shown = |values: &[f64]| {
        let mut values = values.to_vec();
        values.resize(length, f64::NAN);
        values
    };
    if let Some(first) = trial.runs.first() {
        for joint in 0..2 {
            plot = plot.broad(format!("joint {}: desired", joint + 1), shown(&first.reference.q[first.of(joint)]));
        }
    }
    for (number, run) in [(1, trial.runs.first()), (3, trial.runs.last())] {
        let Some(run) = run else { continue };
        for joint in 0..2 {
            plot = plot.line(format!("joint {}: run {number}", joint + 1), shown(&run.q[run.of(joint)]));
        }
    }
    plot.note("equal conditions, without noise, differentiation of the deviation from the commanded motion")
}

fn errors(joint: usize, logistic: &Trial, fourier: &Trial) -> LinePlot {
    let number = if joint == 1 { 12 } else { 14 };
    let title = format!("For comparison with Fig. {number}: tracking errors of joint {}, both methods", joint + 1);
    let mut plot = LinePlot::new(title, "t, s", "e, rad", logistic.runs.first().map(times).unwrap_or_default());
    let length = plot.x.len();
    let mut caption = Vec::new();
    for (name, trial) in [("logistic", logistic), ("Fourier", fourier)] {
        for (k, run) in trial.runs.iter().enumerate() {
            let mut values: Vec<f64> = run.tracking_error(joint).collect();
            values.resize(length, f64::NAN);
            let label = format!("{name}, run {}", k + 1);
            plot = if name == "Fourier" { plot.dashed(label, values) } else { plot.line(label, values) };
        }
        let largest: Vec<String> = trial.tracking.iter().map(|run| rough(run[joint])).collect();
        caption.push(format!("{name} {} rad", largest.join(", ")));
    }
    plot.note(format!("largest errors in runs 1 to 3 without noise: {}", caption.join("; ")))
}
