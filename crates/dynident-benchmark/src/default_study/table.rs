//! Results as a table, as CSV, and compared with the goals.

use super::cases::DefaultCase;
use super::figures::{CaseFigures, Covered};
use super::fits::NamedEstimator;
use core::fmt::Write;

/// Goal for the ratio of the error with default settings to that with the best cut-off and the true friction laws and
/// lag; also for the same ratio with the true laws and default settings for everything else.
const MAX_ERROR_OVER_BEST: f64 = 1.15;
/// Goal for the ratio of the error with default settings to that with the true friction laws.
const MAX_ERROR_OVER_TRUE_LAWS: f64 = 1.3;
/// Goal for the ratio of the error to the Cramér-Rao bound.
const MAX_ERROR_OVER_BOUND: f64 = 1.2;
/// Goal for the coverage of the 95 % intervals, percent.
const COVERAGE_PERCENT: [f64; 2] = [93.0, 97.0];
/// Goal for the share of joints for which load-dependent friction or friction with hysteresis is selected although
/// the true friction has none, percent.
const MAX_UNNEEDED_LAWS_PERCENT: f64 = 2.0;
/// Goal for the share of distinguishable joints for which the true law is selected, percent.
const MIN_CORRECT_LAWS_PERCENT: f64 = 90.0;

/// Columns of [`csv_line`], followed for each estimator by its error in percent and the runs in which it converged.
const COLUMNS: &str = "robot,harmonics,length_s,rate_hz,friction,position_noise_rad,encoder_bits,torque_noise,torque_colour_s,outlier_share,lag_ms,runs,default_percent,default_free_percent,laws_stated_percent,best_percent,best_free_percent,best_cutoff_over_spectrum,default_cutoff_over_spectrum,default_over_best,plain_percent,plain_weighted_percent,error_over_bound,bodies_covered,bodies_intervals,friction_covered,friction_intervals,law_told,law_tellable,lag_found_ms,lag_held_runs,instruments_runs,laws_unneeded,joints_without_need";

/// The first two lines of the table.
pub const TABLE_HEADER: &str = "| robot | motion | friction | noise | lag, ms | default, % | laws stated, % | best, % | over best | plain, % | best by name, % | over bound | bodies cover, % | friction cover, % | law chosen | lag found, ms |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |";

/// Header of [`csv_line`].
pub fn csv_header() -> String {
    let names = NamedEstimator::ALL.map(NamedEstimator::name);
    let of_names = names.map(|name| format!("{name}_percent,{name}_settled"));
    format!("{COLUMNS},{}", of_names.join(","))
}

/// A case and its results as a line of CSV; missing values are empty.
pub fn csv_line(case: &DefaultCase, figures: &CaseFigures) -> String {
    let DefaultCase { robot, motion, friction, noise, lag_s } = case;
    let percent = |share: f64| format!("{:.4}", 100.0 * share);
    let maybe = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.4}"));
    let bits = noise.encoder_bits.map_or_else(String::new, |bits| bits.to_string());
    let mut line = format!(
        "{},{},{},{},{},{:e},{bits},{},{},{},{}",
        robot.name,
        motion.harmonics,
        motion.duration_s,
        motion.rate_hz,
        friction.name(),
        noise.position_rad,
        noise.torque,
        noise.torque_colour_s,
        noise.outlier_share,
        1e3 * lag_s,
    );
    let figure = [
        figures.runs.to_string(),
        percent(figures.of_default),
        percent(figures.of_default_free),
        percent(figures.of_laws_stated),
        percent(figures.of_best),
        percent(figures.of_best_free),
        figures.best_multiple.to_string(),
        format!("{:.3}", figures.default_multiple),
        format!("{:.4}", figures.over_best()),
        maybe(figures.of_plain.map(|share| 100.0 * share)),
        maybe(figures.of_plain_weighted.map(|share| 100.0 * share)),
        maybe(figures.over_bound),
        figures.bodies.inside.to_string(),
        figures.bodies.all.to_string(),
        figures.friction.inside.to_string(),
        figures.friction.all.to_string(),
        figures.told.to_string(),
        figures.tellable.to_string(),
        maybe(figures.lag_found_s.map(|lag_s| 1e3 * lag_s)),
        figures.lag_held.to_string(),
        figures.instruments.to_string(),
        figures.unneeded.to_string(),
        figures.without_need.to_string(),
    ];
    for figure in figure {
        line.push(',');
        line.push_str(&figure);
    }
    for named in &figures.by_name {
        let error = named.filter(|named| named.settled > 0).map(|named| 100.0 * named.error);
        let settled = named.map_or_else(String::new, |named| named.settled.to_string());
        // Writing to a string cannot fail.
        let _ = write!(line, ",{},{settled}", maybe(error));
    }
    line
}

/// A case and its results as a line of the table.
pub fn table_line(case: &DefaultCase, figures: &CaseFigures) -> String {
    let DefaultCase { robot, motion, friction, noise, lag_s } = case;
    let percent = |share: f64| format!("{:.2}", 100.0 * share);
    let covered = |covered: Covered| covered.percent().map_or_else(|| "-".to_owned(), |share| format!("{share:.0}"));
    let position =
        noise.encoder_bits.map_or_else(|| format!("{:.0e} rad", noise.position_rad), |bits| format!("{bits} bits"));
    let colour = if noise.torque_colour_s > 0.0 {
        format!(", {} ms", 1e3 * noise.torque_colour_s)
    } else if noise.outlier_share > 0.0 {
        ", outliers".to_owned()
    } else {
        String::new()
    };
    let settled = |named: &&super::ErrorOfName| named.settled == figures.runs;
    let named = NamedEstimator::ALL.iter().zip(&figures.by_name);
    let named = named.filter_map(|(name, error)| Some((name, error.as_ref().filter(settled)?.error)));
    let least = named.min_by(|a, b| a.1.total_cmp(&b.1));
    format!(
        "| {} | {} × 0.1 Hz, {} s, {} Hz | {} | {position}, {} %{colour} | {} | {} | {} | {} | {:.2} | {} | {} | {} | {} | {} | {} of {} | {} |",
        robot.name,
        motion.harmonics,
        motion.duration_s,
        motion.rate_hz,
        friction.name(),
        100.0 * noise.torque,
        1e3 * lag_s,
        percent(figures.of_default),
        percent(figures.of_laws_stated),
        percent(figures.of_best),
        figures.over_best(),
        figures.of_plain.map_or_else(|| "-".to_owned(), percent),
        least.map_or_else(|| "-".to_owned(), |(name, error)| format!("{} {}", percent(error), name.name())),
        figures.over_bound.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.2}")),
        covered(figures.bodies),
        covered(figures.friction),
        figures.told,
        figures.tellable,
        figures.lag_found_s.map_or_else(|| "-".to_owned(), |lag_s| format!("{:.1}", 1e3 * lag_s)),
    )
}

fn verdict(reached: bool) -> &'static str {
    if reached { "reached" } else { "MISSED" }
}

/// How many ratios are at most `most`, with median and worst.
fn within(what: &str, ratios: &[f64], most: f64) -> String {
    let mut sorted = ratios.to_vec();
    sorted.sort_by(f64::total_cmp);
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"));
    let middle = [sorted.len().saturating_sub(1) / 2, sorted.len() / 2].map(|place| sorted.get(place));
    let median = middle.into_iter().flatten().sum::<f64>() / 2.0;
    let median = (!sorted.is_empty()).then_some(median);
    let inside = ratios.iter().filter(|ratio| **ratio <= most).count();
    format!(
        "{what} at most {most:.2}: {inside} of {} cases, median {}, worst {}, {}",
        ratios.len(),
        number(median),
        number(sorted.last().copied()),
        verdict(inside == ratios.len())
    )
}

/// Goals and results, one line each.
pub fn goals(done: &[CaseFigures]) -> Vec<String> {
    let of = |ratio: fn(&CaseFigures) -> f64| -> Vec<f64> { done.iter().map(ratio).collect() };
    let (all, laws) = (of(CaseFigures::over_best), of(CaseFigures::over_laws_stated));
    let ratios = of(CaseFigures::laws_stated_over_best);
    let bounds: Vec<f64> = done.iter().filter_map(|figures| figures.over_bound).collect();
    let bodies: Covered = done.iter().map(|figures| figures.bodies).sum();
    let friction: Covered = done.iter().map(|figures| figures.friction).sum();
    let (told, tellable) =
        done.iter().fold((0, 0), |(told, all), figures| (told + figures.told, all + figures.tellable));
    let (unneeded, without_need) =
        done.iter().fold((0, 0), |(some, all), figures| (some + figures.unneeded, all + figures.without_need));
    let wins = |figures: &&CaseFigures| {
        let plain = [figures.of_plain, figures.of_plain_weighted];
        plain.into_iter().flatten().all(|plain| figures.of_default < plain)
    };
    let held: usize = done.iter().map(|figures| figures.lag_held).sum();
    let runs: usize = done.iter().map(|figures| figures.runs).sum();
    let share = |part: usize, all: usize| 100.0 * part as f64 / all.max(1) as f64;
    let is_covered = |covered: Covered| {
        covered.percent().is_none_or(|percent| (COVERAGE_PERCENT[0]..=COVERAGE_PERCENT[1]).contains(&percent))
    };
    let coverage = |what: &str, covered: Covered| {
        format!(
            "95 % intervals of {what} hold the truth in {} to {} %: {:.1} % of {}, {}",
            COVERAGE_PERCENT[0],
            COVERAGE_PERCENT[1],
            covered.percent().unwrap_or(f64::NAN),
            covered.all,
            verdict(is_covered(covered))
        )
    };
    vec![
        within("cut-off and lag, with the laws stated: error over the best", &ratios, MAX_ERROR_OVER_BEST),
        within("laws chosen: error over that with the laws stated", &laws, MAX_ERROR_OVER_TRUE_LAWS),
        within("all by default: error over the best", &all, MAX_ERROR_OVER_BEST),
        within("error of the bodies over the Cramér-Rao bound", &bounds, MAX_ERROR_OVER_BOUND),
        coverage("bodies", bodies),
        coverage("friction whose law was chosen as it is", friction),
        format!(
            "law chosen where it can be told, at least {MIN_CORRECT_LAWS_PERCENT} %: {told} of {tellable}, {:.0} %, {}",
            share(told, tellable),
            verdict(share(told, tellable) >= MIN_CORRECT_LAWS_PERCENT)
        ),
        format!(
            "law with memory or under load where the truth has none, at most {MAX_UNNEEDED_LAWS_PERCENT} %: {unneeded} of \
             {without_need}, {:.1} %, {}",
            share(unneeded, without_need),
            verdict(share(unneeded, without_need) <= MAX_UNNEEDED_LAWS_PERCENT)
        ),
        format!(
            "better than plain least squares, ordinary and weighted: {} of {} cases, {}",
            done.iter().filter(wins).count(),
            done.len(),
            verdict(done.iter().all(|figures| wins(&figures)))
        ),
        format!("95 % bar of the lag holds it: {held} of {runs} runs, {:.0} %", share(held, runs)),
    ]
}
