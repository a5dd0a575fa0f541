use super::findings::findings;
use super::text::{name, percent, table, wrapped};
use dynident::estimation::ValidationReport;
use dynident::identification::examination::{JointResiduals, LogValidation};
use dynident::result::{LogSummary, TorqueErrorSettings};

/// Significance level of the residual tests.
const SIGNIFICANCE: f64 = 0.01;

pub(crate) fn validation(logs: &[LogValidation], summaries: &[LogSummary], settings: &TorqueErrorSettings) -> String {
    let mut text = String::new();
    for log in logs {
        let free = match log.physical {
            Some(_) => format!("unconstrained fit {} %, ", percent(log.model.relative_error_percent)),
            None => String::new(),
        };
        let headline = format!(
            "{}: torque error {} % ({free}robot description {} %), {} samples",
            log.log,
            percent(log.exported().relative_error_percent),
            percent(log.prior.as_ref().and_then(|prior| prior.relative_error_percent)),
            log.model.samples
        );
        text += &wrapped(&headline, 4);
        let mut rows: Vec<Vec<String>> = (0..log.model.joints.len()).map(|joint| row(log, Some(joint))).collect();
        rows.push(row(log, None));
        let header = ["joint", "error %", "rms Nm", "max Nm", "R2", "free, raw %", "prior %"].map(str::to_owned);
        text += &table(&header, 1..7, rows);
        text += &residuals(log, settings);
        text.push('\n');
    }
    text += &findings(summaries);
    text
}

/// The properties of a held-out log's residuals in one line.
pub(super) fn residuals(log: &LogValidation, settings: &TorqueErrorSettings) -> String {
    let count = |of: &dyn Fn(&JointResiduals) -> bool| log.residuals.iter().filter(|joint| of(joint)).count();
    let all = log.residuals.len();
    let coloured = count(&|joint| joint.whiteness.is_some_and(|test| test.p_value < SIGNIFICANCE));
    let odd = count(&|joint| joint.normality.is_some_and(|test| test.p_value < SIGNIFICANCE));
    let ratio = |joint: &JointResiduals| {
        let regimes = joint.regimes?;
        let ratio = regimes.reversal.rmse_nm? / regimes.fast.rmse_nm?;
        ratio.is_finite().then_some(ratio)
    };
    let ratios: Vec<f64> = log.residuals.iter().filter_map(ratio).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let reversal = if ratios.is_empty() {
        String::new()
    } else {
        let ratio = mean(&ratios);
        let cause = if ratio >= settings.min_reversal_ratio { " (usually friction near standstill)" } else { "" };
        format!(", at reversals {ratio:.2} times those of fast motion{cause}")
    };
    let covered: Vec<f64> =
        log.residuals.iter().filter_map(|joint| Some(joint.band.as_ref()?.coverage_percent)).collect();
    let band = if covered.is_empty() {
        String::new()
    } else {
        format!("; {:.1} % of the torque is inside the 95 % band", mean(&covered))
    };
    let mut text = wrapped(
        &format!("  residuals: correlated in {coloured} of {all} joints, not normal in {odd}{reversal}{band}"),
        4,
    );
    text += &at_rest(log);
    text
}

/// A joint is reported if at least this share of the squared error comes from its samples at rest.
const MIN_REPORTED_SHARE: f64 = 0.3;

/// Reports the joint whose samples at rest contribute much of the error. The positions do not determine the static
/// friction at rest.
fn at_rest(log: &LogValidation) -> String {
    // Residuals in the frequency band of the fit are used if available.
    let report = log.in_fit_band.as_ref().unwrap_or(&log.model);
    let all: f64 = report.joints.iter().map(|joint| joint.samples as f64 * joint.rmse_nm.powi(2)).sum();
    let most = log
        .residuals
        .iter()
        .filter_map(|joint| {
            let regimes = joint.regimes?;
            let (rest, fast) = (regimes.at_rest.rmse_nm?, regimes.fast.rmse_nm?);
            Some((regimes.at_rest.samples as f64 * rest.powi(2) / all, rest, fast, &joint.name))
        })
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match most {
        Some((share, rest, fast, name)) if share > MIN_REPORTED_SHARE => wrapped(
            &format!(
                "  {:.0} % of the squared error occurs while {} is at rest ({rest:.2} Nm, in motion {fast:.2} Nm): the torque of stiction does not follow from the positions",
                100.0 * share,
                self::name(name)
            ),
            4,
        ),
        _ => String::new(),
    }
}

fn row(log: &LogValidation, joint: Option<usize>) -> Vec<String> {
    let relative = |report: &ValidationReport| {
        joint.map_or(report.relative_error_percent, |j| report.joints[j].relative_error_percent)
    };
    let own = log.exported();
    let (rms, max, r_squared) = joint.map_or((own.rmse_nm, own.max_error_nm, own.r_squared), |j| {
        let joint = &own.joints[j];
        (joint.rmse_nm, joint.max_error_nm, joint.r_squared)
    });
    vec![
        joint.map_or("all joints".to_owned(), |j| name(&log.model.joints[j].name)),
        percent(relative(own)),
        format!("{rms:.4}"),
        format!("{max:.4}"),
        r_squared.map_or("-".to_owned(), |r| format!("{r:.4}")),
        percent(relative(&log.raw)),
        percent(log.prior.as_ref().and_then(relative)),
    ]
}
