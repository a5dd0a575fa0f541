//! Noise in the regressor, gross errors, and results of special estimators.

use super::text::{percent, wrapped};
use dynident::ResultFile;
use dynident::identification::estimators::{NoiseInRegressor, NoiseVerdict};

/// Whether noise in the regressor matters, the rows with low weight in a robust estimator, and results of special
/// estimators; otherwise empty.
pub(crate) fn noise(r: &ResultFile) -> String {
    let mut text = String::new();
    if let Some(noise) = &r.noise_in_regressor {
        let sentence = verdict(noise, r.method.estimator == "instrumental");
        text += &if sentence.is_empty() { sentence } else { wrapped(&sentence, 2) };
    }
    if let Some(gross) = &r.gross_errors
        && let Some((joint, share)) = gross.share.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
    {
        let joint = r.robot.joints.get(joint).map_or("a joint", String::as_str);
        let share = percent(Some(100.0 * share));
        let most =
            format!("gross errors: at most {share}\u{a0}% of a joint's rows lost half their weight or more ({joint})");
        text += &wrapped(&most, 2);
    }
    text += &loops(r);
    if !text.is_empty() {
        text.push('\n');
    }
    text
}

/// Results of special estimators (local noise, periodic or simulated motion), and whether the estimator converged.
fn loops(r: &ResultFile) -> String {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let mut text = String::new();
    if let Some(levels) = &r.noise_levels {
        let most = largest(&mut levels.iter().map(|[least, most]| most / least.max(1e-12)));
        text += &wrapped(&format!("noise of a joint differs by at most a factor of {most:.1} along the logs"), 2);
    }
    if let Some(fit) = &r.periodic {
        let periods: usize = fit.periods.iter().sum();
        let (motion, torque) =
            (largest(&mut fit.motion_std.iter().map(|std| std[0])), largest(&mut fit.torque_std.iter().copied()));
        let ratio = fit.cost / (fit.degrees_of_freedom as f64).max(1.0);
        let line = format!(
            "{periods} periods of {} s: noise of positions at most {motion:.1e} rad, of torques {torque:.2e} Nm; the residuals of the mean period are {ratio:.2} times this noise (1 for a correct model)",
            fit.period_s
        );
        text += &wrapped(&line, 2);
    }
    if let Some(fit) = &r.simulated {
        let line = format!(
            "{} steps from the {} with {} simulations with controller {} at {} Hz",
            fit.iterations, fit.start, fit.simulations, fit.controller, fit.rate_hz
        );
        text += &wrapped(&line, 2);
    }
    if !r.method.is_settled() {
        text += &wrapped("NOT converged: the estimator stopped early, so its values are not reliable", 2);
    }
    text
}

/// The effect of noise in the regressor in a sentence; empty without an effect, unless instrumental variables were
/// requested.
fn verdict(noise: &NoiseInRegressor, used: bool) -> String {
    let test = &noise.hausman;
    let figures = test
        .f
        .zip(test.p_value)
        .map_or(String::new(), |(f, p)| format!(" (Durbin-Wu-Hausman test: F = {f:.1}, p = {p:.1e})"));
    let followed = noise.fast_motion.map_or(String::new(), |fast| {
        format!(
            "{:.0}\u{a0}% of the fast motion agrees with the torque, the rest is noise",
            100.0 * fast.followed.clamp(0.0, 1.0)
        )
    });
    let band = noise.instrument_cutoff_hz.map_or(String::new(), |[_, hz]| format!(" of the motion below {hz:.2} Hz"));
    let lowered = noise
        .cutoff_before_hz
        .map_or(String::new(), |hz| format!("; the cut-off of the motion was reduced from {hz:.1} Hz"));
    match noise.verdict {
        NoiseVerdict::BiasesLeastSquares if used => {
            format!(
                "noise of the positions would bias least squares: {followed}; instruments{band} avoid that{lowered}{figures}"
            )
        }
        NoiseVerdict::Harmless if used => {
            format!("instruments{band}; least squares would suffice: position noise has no significant effect{figures}")
        }
        NoiseVerdict::Undecided if used => format!("instruments{band}{figures}"),
        // Without an effect, or already reported as a problem.
        NoiseVerdict::BiasesLeastSquares | NoiseVerdict::Harmless | NoiseVerdict::Undecided => String::new(),
    }
}
