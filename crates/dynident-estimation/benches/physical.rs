//! Time of a physically consistent fit from a factor: 7 and 30 bodies, best and median of several random problems.
//! Prints one line per case.
//! `cargo bench -p dynident-estimation --bench physical`
//!
//! `-- --intervals` prints the time of one interval of 7 bodies instead.
//!
//! `-- --problems FIRST LAST [--both-routes]` prints the random problems of the tests with their solutions as JSON
//! lines instead, for `benchmarks/bench_lmi.py`.

#![allow(clippy::print_stdout, reason = "a benchmark prints")]
#![allow(clippy::unwrap_used, reason = "a benchmark fails as tests do")]

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../tests/it/physical_problems/mod.rs"]
mod physical_problems;

use dynident_estimation::consistent::{
    ConsistentIntervals, IntervalSettings, PhysicalFit, PhysicalRoute, PhysicalSettings, physical_fit,
};
use physical_problems::{Case, case};
use serde_json::{Value, json};
use std::time::Instant;

const ROUTES: [(PhysicalRoute, &str); 2] =
    [(PhysicalRoute::InteriorPoint, "interior point"), (PhysicalRoute::LogCholesky, "log-Cholesky")];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.iter().any(|argument| argument == "--intervals") {
        return intervals();
    }
    let Some(place) = arguments.iter().position(|argument| argument == "--problems") else {
        return times();
    };
    let [first, last] = [1, 2].map(|k| arguments[place + k].parse::<u64>().unwrap());
    let routes = if arguments.iter().any(|argument| argument == "--both-routes") { 2 } else { 1 };
    for seed in first..last {
        let case = case(seed, 2 + (seed % 29) as usize);
        println!("{}", described(seed, &case, &ROUTES[..routes]));
    }
}

/// Processor time of this thread, s, independent of other load; wall time if it is not available.
fn seconds(start: Instant) -> f64 {
    let own = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = own.and_then(|text| text.split(' ').next().and_then(|field| field.parse::<f64>().ok()));
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |time| 1.0e-9 * time)
}

/// The fit by a route and the best time of `repeats`, s.
fn timed(case: &Case, route: PhysicalRoute, repeats: usize) -> (PhysicalFit, f64) {
    let settings = PhysicalSettings { route, ..case.settings.clone() };
    let mut best = f64::INFINITY;
    let mut fit = None;
    for _ in 0..repeats {
        let clock = Instant::now();
        let start = seconds(clock);
        fit = Some(physical_fit(&case.problem, &settings).unwrap());
        best = best.min(seconds(clock) - start);
    }
    (fit.unwrap(), best)
}

fn times() {
    for (route, name) in ROUTES {
        for bodies in [7, 30] {
            let mut times = Vec::new();
            let (mut iterations, mut columns) = (0, 0);
            for seed in 0..12 {
                let (fit, seconds) = timed(&case(seed, bodies), route, 3);
                iterations = iterations.max(fit.iterations);
                columns = fit.parameters.len();
                times.push(1.0e3 * seconds);
            }
            times.sort_by(f64::total_cmp);
            println!(
                "{name}, {bodies} bodies, {columns} parameters: {:.2} ms (median of 12 problems; {:.2} to {:.2}), \
                 at most {iterations} iterations",
                times[times.len() / 2],
                times[0],
                times[times.len() - 1]
            );
        }
    }
}

/// The time of every tenth parameter's interval, and what holds its ends.
fn intervals() {
    for seed in 0..4 {
        let case = case(seed, 7);
        let physical = PhysicalSettings { prior_weight: 1.0e-5, ..case.settings.clone() };
        let settings = IntervalSettings { physical, ..IntervalSettings::default() };
        let clock = Instant::now();
        let start = seconds(clock);
        let intervals = ConsistentIntervals::new(&case.problem, None, 1000.0, settings).unwrap();
        let found: Vec<_> =
            (0..intervals.best().parameters.len()).step_by(10).map(|index| intervals.of(index).unwrap()).collect();
        let time = 1.0e3 * (seconds(clock) - start) / found.len() as f64;
        let ends: Vec<String> = found.iter().map(|one| format!("{:?} {:?}", one.lower, one.upper)).collect();
        println!("intervals, 7 bodies: {time:.2} ms each; {}", ends.join(", "));
    }
}

/// A problem from its definitions, and what each route answers.
fn described(seed: u64, case: &Case, routes: &[(PhysicalRoute, &str)]) -> Value {
    let bodies: Vec<Value> = case
        .problem
        .bodies()
        .iter()
        .map(|body| {
            let inside = body.inside.map(|inside| (inside.centre_m, inside.semi_axes_m));
            json!({ "reference": body.reference, "known": body.known, "mass_kg": body.mass_kg, "com_box_m": body.com_box_m,
                "inside": inside })
        })
        .collect();
    let scalars: Vec<Value> = case
        .problem
        .scalars()
        .iter()
        .map(|scalar| json!({ "lower": scalar.lower, "upper": scalar.upper, "prior": scalar.prior }))
        .collect();
    let answers: serde_json::Map<String, Value> = routes
        .iter()
        .map(|&(route, name)| {
            // The slow route once: all thousand problems take it a quarter of an hour.
            let repeats = if route == PhysicalRoute::InteriorPoint { 2 } else { 1 };
            let (fit, seconds) = timed(case, route, repeats);
            let answer = json!({ "time_s": seconds, "status": fit.status, "iterations": fit.iterations,
                "kkt": fit.kkt_residual(), "objective": fit.data_objective + fit.prior_objective,
                "parameters": fit.parameters });
            (name.to_owned(), answer)
        })
        .collect();
    let base = case.problem.base().matrix();
    let (triangle, right) = &case.rows;
    json!({
        "seed": seed, "bodies": bodies, "scalars": scalars, "total_mass_kg": case.total_mass_kg,
        "prior": case.settings.prior, "prior_weight": case.settings.prior_weight, "margin": case.settings.margin,
        "base_map": entries(base), "rows": entries(triangle), "right": right.as_slice(), "answers": answers,
    })
}

/// Row, column and value of what is not zero.
fn entries(matrix: &nalgebra::DMatrix<f64>) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
    let mut found = (Vec::new(), Vec::new(), Vec::new());
    for column in 0..matrix.ncols() {
        for row in (0..matrix.nrows()).filter(|&row| matrix[(row, column)] != 0.0) {
            found.0.push(row);
            found.1.push(column);
            found.2.push(matrix[(row, column)]);
        }
    }
    found
}
