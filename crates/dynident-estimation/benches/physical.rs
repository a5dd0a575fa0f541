//! Time of a physically consistent fit from a finished factor: 7 and 30 bodies, best and median of several random problems. Prints one line per case.
//! `cargo bench -p dynident-estimation --bench physical`

#![allow(clippy::print_stdout, reason = "a benchmark prints")]
#![allow(clippy::unwrap_used, reason = "a benchmark fails as tests do")]

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../tests/it/physical_problems/mod.rs"]
mod physical_problems;

use dynident_estimation::consistent::{PhysicalRoute, PhysicalSettings, physical_fit};
use physical_problems::case;
use std::time::Instant;

fn main() {
    for (route, name) in
        [(PhysicalRoute::InteriorPoint, "interior point"), (PhysicalRoute::LogCholesky, "log-Cholesky")]
    {
        for bodies in [7, 30] {
            let mut times = Vec::new();
            let (mut iterations, mut columns) = (0, 0);
            for seed in 0..12 {
                let case = case(seed, bodies);
                let settings = PhysicalSettings { route, ..case.settings.clone() };
                let mut best = f64::INFINITY;
                for _ in 0..3 {
                    let start = Instant::now();
                    let fit = physical_fit(&case.problem, &settings).unwrap();
                    best = best.min(start.elapsed().as_secs_f64());
                    iterations = iterations.max(fit.iterations);
                    columns = fit.parameters.len();
                }
                times.push(1.0e3 * best);
            }
            times.sort_by(f64::total_cmp);
            println!(
                "{name}, {bodies} bodies, {columns} parameters: {:.2} ms (median of 12 problems; {:.2} to {:.2}), at most {iterations} iterations",
                times[times.len() / 2],
                times[0],
                times[times.len() - 1]
            );
        }
    }
}
