//! Statements and figure readings of the paper, and whether the reproduction confirms them.

use crate::joint_runs::{FIGURE_12, JointRuns, PAPER};
use crate::piece::{PaperStatement, rough, shown};
use dynident_simulation::Run;

/// Minimum error of a swing to one side, as a share of the run's largest error.
const MIN_SWING_SHARE: f64 = 0.1;

/// All statements in the order of the paper. `figures` contains H of the optimum inside (18) and of the genetic
/// algorithm; `claim` is the sentence on both methods.
pub(crate) fn statements(runs: &JointRuns, figures: [f64; 2], claim: &str, quotient: f64) -> Vec<PaperStatement> {
    let [optimum, genetic] = figures;
    let convergence = statement(
        "section 2.2, Fig. 7",
        "after 500 generations the optimal solution is no longer updated and the genetic algorithm has converged",
        format!("it stops at H = {}; the optimum inside (18) is {}", shown(genetic), shown(optimum)),
        genetic < 1.01 * optimum,
    );
    let comparison = statement(
        "section 3, Figs. 16, 17",
        "the logistic method predicts torques better than the Fourier series",
        claim.to_owned(),
        quotient < 1.0,
    );
    [vec![convergence], tracking(runs), parameters(runs), vec![comparison]].concat()
}

fn statement(place: &str, paper: &str, here: String, holds: bool) -> PaperStatement {
    PaperStatement { place: place.to_owned(), paper: paper.to_owned(), here, holds }
}

/// Statements on the tracking errors of joint 2.
fn tracking(runs: &JointRuns) -> Vec<PaperStatement> {
    let errors: Vec<f64> = runs.as_paper[1].runs.iter().map(|run| run.max_error[1]).collect();
    let swings: Vec<usize> = runs.as_paper[1].runs.iter().take(2).map(|run| swings(run, 1)).collect();
    let many = |count: &usize| *count > 4;
    let share = 100.0 * errors.get(1).copied().unwrap_or(f64::NAN) / errors.first().copied().unwrap_or(f64::NAN);
    vec![
        statement(
            "section 3, Figs. 9, 10",
            "the actual trajectory fluctuates up and down near the desired one in runs 1 and 2",
            format!(
                "no fluctuation: in the two strokes of a run the error has {} (run 1) and {} (run 2) long intervals of one sign; the arm sags and lags",
                swings.first().copied().unwrap_or_default(),
                swings.get(1).copied().unwrap_or_default()
            ),
            swings.iter().all(many),
        ),
        statement(
            "section 3, Fig. 12",
            "largest tracking errors of joint 2: 0.6, 0.15 and 0 rad",
            format!(
                "{} rad; the first agrees because the gains of the first run's joint PD were chosen for it, the others result from it",
                errors.iter().map(|error| rough(*error)).collect::<Vec<_>>().join(", ")
            ),
            // The axis of the figure can be read to 0.05 rad.
            errors.iter().zip(FIGURE_12).all(|(error, paper)| (error - paper).abs() < 0.05),
        ),
        statement(
            "section 3, Fig. 12",
            "the second run's error is 25 % of the first's",
            format!("{share:.0} %"),
            (share - 25.0).abs() < 5.0,
        ),
    ]
}

/// Statements on the parameters, run by run.
fn parameters(runs: &JointRuns) -> Vec<PaperStatement> {
    // Values by run, of the columns as in the paper.
    let values = |joint: usize, place: usize| -> Vec<f64> {
        runs.as_paper[joint].values.iter().take(FIGURE_12.len()).map(|values| values[place]).collect()
    };
    let listed = |values: &[f64]| values.iter().map(|value| shown(*value)).collect::<Vec<_>>().join(", ");
    let (theta_4, theta_1) = (values(1, 0), values(0, 0));
    let [_, three, six] = runs.literal_errors;
    vec![
        statement(
            "Table 4",
            "θ₄ rises run by run: 0.203, 0.698, 0.993",
            format!("{}: overshoot in the second run", listed(&theta_4)),
            theta_4.windows(2).all(|pair| pair[0] <= pair[1]),
        ),
        statement(
            "Table 5",
            &format!("the first θ₁ is positive: {}", PAPER[0][0][0]),
            format!("{}: a negative inertia, which is not physical", listed(&theta_1[..1.min(theta_1.len())])),
            theta_1.first().is_some_and(|value| *value > 0.0),
        ),
        statement(
            "Tables 4, 5",
            "after three runs every parameter has an error below 0.01 (largest error 0.009)",
            format!("largest error {} with the paper's own loop", rough(three)),
            three < 0.01,
        ),
        statement(
            "section 3",
            "more iterations make the parameters more accurate",
            format!(
                "largest error {} after three and {} after six runs of the paper's own loop",
                rough(three),
                rough(six)
            ),
            six < three,
        ),
    ]
}

/// Number of swings of a run's tracking error: intervals of one sign that reach a tenth of the largest error.
fn swings(run: &Run, joint: usize) -> usize {
    let least = MIN_SWING_SHARE * run.max_error[joint];
    let mut side = 0.0;
    let mut count = 0;
    for error in run.tracking_error(joint).filter(|error| error.abs() >= least) {
        if error.signum() != side {
            (side, count) = (error.signum(), count + 1);
        }
    }
    count
}
