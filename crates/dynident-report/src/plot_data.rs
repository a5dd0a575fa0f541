//! Data of interactive plots for the page's script.

use crate::error::ReportError;
use serde::Serialize;

/// One decimated plot, with gaps as null.
#[derive(Serialize)]
pub(crate) struct PlotData<'a> {
    pub(crate) x: Vec<f64>,
    pub(crate) curves: Vec<CurveData<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) strip: Option<StripData<'a>>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) shaded: &'a [[f64; 2]],
    pub(crate) x_label: &'a str,
    pub(crate) y_label: &'a str,
    pub(crate) log: bool,
    /// Whether the x axis has integers only.
    pub(crate) counts: bool,
}

#[derive(Serialize)]
pub(crate) struct CurveData<'a> {
    pub(crate) name: &'a str,
    pub(crate) y: Vec<Option<f64>>,
    pub(crate) dashed: bool,
    pub(crate) points: bool,
    pub(crate) broad: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) bars: Option<[Vec<Option<f64>>; 2]>,
}

#[derive(Serialize)]
pub(crate) struct StripData<'a> {
    pub(crate) name: &'a str,
    pub(crate) of: [usize; 2],
}

/// JSON for a script element, without `<`, which could end the element, and without `>` and `&`.
pub(crate) fn embedded(data: &impl Serialize) -> Result<String, ReportError> {
    let json = dynident_text::json::to_string(data)?;
    Ok(json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026"))
}

/// Seven significant digits, to reduce the size of the page.
pub(crate) fn rounded(value: f64) -> Option<f64> {
    if !value.is_finite() {
        return None;
    }
    format!("{value:.6e}").parse().ok()
}

/// Eleven significant digits of a time, so that samples of a long log remain distinct.
pub(crate) fn rounded_time(value: f64) -> f64 {
    format!("{value:.10e}").parse().unwrap_or(value)
}

pub(crate) fn check_axis(section: &str, x: &[f64]) -> Result<(), ReportError> {
    let wrong = (0..x.len()).find(|&i| !x[i].is_finite() || (i > 0 && x[i] < x[i - 1]));
    match wrong {
        None => Ok(()),
        Some(at) => Err(ReportError::Axis { section: section.to_owned(), at, value: x[at] }),
    }
}

pub(crate) fn check_length(section: &str, what: &str, found: usize, expected: usize) -> Result<(), ReportError> {
    if found == expected {
        return Ok(());
    }
    Err(ReportError::Shape { section: section.to_owned(), what: format!("`{what}`"), expected, found })
}
