use super::text::{table, wrapped};
use dynident_benchmark::accuracy::BenchmarkFile;

pub(crate) fn benchmark(file: &BenchmarkFile) -> String {
    let header =
        ["robot", "noise", "estimator", "fail", "bias", "rmse", "rmse/m", "worst", "cover %", "ms"].map(str::to_owned);
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
    };
    let rows = file
        .cells
        .iter()
        .map(|cell| {
            vec![
                cell.robot.clone(),
                cell.noise.clone(),
                cell.estimator.clone(),
                cell.failures.to_string(),
                number(cell.bias_over_bound, 2),
                number(cell.rmse_over_bound, 2),
                number(cell.rmse_over_bound_with_motion, 2),
                number(cell.worst_rmse_over_bound, 2),
                number(cell.coverage_percent, 1),
                format!("{:.1}", cell.time_ms),
            ]
        })
        .collect();
    let words = format!(
        "{} runs of {} s at {} Hz, seed {}. bias, rmse, worst: in units of the Cramér-Rao bound for known motion (root mean square over the parameters, and the worst one); rmse/m: in units of the bound for unknown motion. cover: true values inside their 95 % intervals.",
        file.settings.runs, file.duration_s, file.rate_hz, file.settings.seed,
    );
    format!("{}{}", table(&header, 3..10, rows), wrapped(&words, 0))
}
