//! A matrix in colours.

use crate::error::ReportError;
use crate::pen::tenth;
use crate::ticks::short;
use serde::Serialize;

/// Maximum number of cells with a tooltip, which limits the size of the page.
const MAX_TOOLTIPS: usize = 4096;
/// Total width of the cells, px; maximum number of characters of a name, and their width, px.
const CELLS_WIDTH: f64 = 560.0;
const MAX_NAME_CHARS: usize = 22;
const CHAR_WIDTH: f64 = 6.5;
const NEGATIVE_COLOUR: &str = "#0072b2";
const POSITIVE_COLOUR: &str = "#d55e00";
/// Width of the colour scale, px, and number of steps on each side.
const SCALE_WIDTH: f64 = 240.0;
const SCALE_STEPS: usize = 10;
/// Maximum number of entries in the description for screen readers.
const MAX_SPOKEN_ENTRIES: usize = 5;

/// A matrix in colours with a colour scale: blue for negative and red for positive values, stronger for larger
/// magnitudes. Missing values and the upper half of a symmetric matrix are empty. Tooltips show the values.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Title.
    pub title: String,
    /// Note below the title; may be empty.
    pub note: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Values by row, NaN for gaps.
    pub values: Vec<Vec<f64>>,
    /// The value with full colour; by default the largest magnitude.
    pub limit: Option<f64>,
}

impl HeatMap {
    /// Creates a map from names and values.
    pub fn new<C: Into<String>, R: Into<String>>(
        title: impl Into<String>,
        rows: impl IntoIterator<Item = R>,
        columns: impl IntoIterator<Item = C>,
        values: Vec<Vec<f64>>,
    ) -> Self {
        Self {
            title: title.into(),
            note: String::new(),
            columns: columns.into_iter().map(Into::into).collect(),
            rows: rows.into_iter().map(Into::into).collect(),
            values,
            limit: None,
        }
    }

    /// Sets the note below the title.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Sets the value with full colour.
    #[must_use]
    pub fn limit(mut self, limit: f64) -> Self {
        self.limit = Some(limit);
        self
    }

    fn is_symmetric(&self) -> bool {
        let same = |row: usize, column: usize| {
            let [one, other] = [self.values[row][column], self.values[column][row]];
            one == other || (one.is_nan() && other.is_nan())
        };
        self.rows == self.columns && (0..self.rows.len()).all(|row| (0..row).all(|column| same(row, column)))
    }

    /// Description for screen readers: the largest entries, without the upper half of a symmetric matrix.
    fn in_words(&self) -> String {
        let entries = self
            .values
            .iter()
            .enumerate()
            .flat_map(|(row, values)| values.iter().enumerate().map(move |(column, value)| (row, column, *value)));
        let symmetric = self.is_symmetric();
        let wanted = |(row, column, value): &(usize, usize, f64)| value.is_finite() && (!symmetric || row > column);
        let mut entries: Vec<_> = entries.filter(wanted).collect();
        entries.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        let words = entries.iter().take(MAX_SPOKEN_ENTRIES).map(|(row, column, value)| {
            format!("{} and {} {}", self.rows[*row], self.columns[*column], short(*value, 2))
        });
        format!("strongest {}", words.collect::<Vec<_>>().join(", "))
    }

    /// Renders the map as SVG.
    ///
    /// # Errors
    /// If the numbers of values and names differ.
    pub fn svg(&self) -> Result<String, ReportError> {
        self.check_shape()?;
        let finite = self.values.iter().flatten().filter(|value| value.is_finite());
        let largest = finite.fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let limit = self.limit.filter(|limit| limit.is_finite() && *limit > 0.0).unwrap_or(largest);
        let side = (CELLS_WIDTH / self.columns.len().max(1) as f64).clamp(4.0, 36.0);
        let longest = self.rows.iter().chain(&self.columns).map(|name| name.chars().count().min(MAX_NAME_CHARS)).max();
        let labels = 14.0 + CHAR_WIDTH * longest.unwrap_or(0) as f64;
        let (right, bottom) = (labels + side * self.columns.len() as f64, labels + side * self.rows.len() as f64);
        let lines = (0..=self.columns.len())
            .map(|k| format!("M{} {labels}V{}", tenth(labels + side * k as f64), tenth(bottom)));
        let rows =
            (0..=self.rows.len()).map(|k| format!("M{labels} {}H{}", tenth(labels + side * k as f64), tenth(right)));
        // The colour scale from the negative to the positive limit.
        let step_width = SCALE_WIDTH / (2 * SCALE_STEPS + 1) as f64;
        let scale = (0..=2 * SCALE_STEPS).map(|k| {
            let value = k as f64 / SCALE_STEPS as f64 - 1.0;
            ScaleStep {
                x: tenth(labels + step_width * k as f64),
                y: tenth(bottom + 18.0),
                colour: if value < 0.0 { NEGATIVE_COLOUR } else { POSITIVE_COLOUR },
                strength: value.abs(),
            }
        });
        let marks = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| {
            let x = labels + 0.5 * step_width + (SCALE_WIDTH - step_width) * 0.5 * (share + 1.0);
            (tenth(x), short(share * limit, 3))
        });
        // Names that would overlap are skipped; the tooltips contain them.
        let every = (11.0 / side).ceil().max(1.0) as usize;
        let names = |names: &[String]| -> Vec<(f64, String)> {
            let shown = names.iter().enumerate().step_by(every);
            shown
                .map(|(k, name)| (labels + side * (k as f64 + 0.5), name.chars().take(MAX_NAME_CHARS).collect()))
                .collect()
        };
        let view = Picture {
            title: &self.title,
            words: self.in_words(),
            width: (right + 8.0).max(labels + SCALE_WIDTH + 24.0),
            height: bottom + 46.0,
            labels,
            side: tenth(side),
            columns: names(&self.columns),
            rows: names(&self.rows),
            signs: self.cells(limit, side, labels),
            grid: lines.chain(rows).collect(),
            scale: scale.collect(),
            step_width: tenth(step_width + 0.1),
            scale_frame: [labels, tenth(bottom + 18.0), SCALE_WIDTH],
            marks,
        };
        crate::templates::rendered("heat_map.svg", &view)
    }

    fn check_shape(&self) -> Result<(), ReportError> {
        let wrong =
            |what: String, expected, found| ReportError::Shape { section: self.title.clone(), what, expected, found };
        if self.values.len() != self.rows.len() {
            return Err(wrong("values".to_owned(), self.rows.len(), self.values.len()));
        }
        match self.values.iter().position(|row| row.len() != self.columns.len()) {
            Some(row) => Err(wrong(format!("row {row} (0-based)"), self.columns.len(), self.values[row].len())),
            None => Ok(()),
        }
    }

    /// Negative cells and the others with their colours. `side` and the width of `labels` are in px; values of `limit`
    /// have full colour.
    fn cells(&self, limit: f64, side: f64, labels: f64) -> [(&'static str, Vec<CellView>); 2] {
        let texts = self.columns.len() * self.rows.len() <= MAX_TOOLTIPS;
        let symmetric = self.is_symmetric();
        let strength =
            |value: f64| if limit > 0.0 { ((value.abs() / limit).min(1.0) * 100.0).round() / 100.0 } else { 0.0 };
        let (mut below, mut above) = (Vec::new(), Vec::new());
        for (row, values) in self.values.iter().enumerate() {
            for (column, &value) in values.iter().enumerate() {
                let is_hidden = !value.is_finite() || (symmetric && column > row);
                // An invisible cell is needed only for its tooltip.
                if is_hidden || !(texts || strength(value) > 0.0) {
                    continue;
                }
                let cell = CellView {
                    x: tenth(labels + side * column as f64),
                    y: tenth(labels + side * row as f64),
                    strength: format!("{}", strength(value)),
                    text: texts.then(|| format!("{} × {}: {}", self.rows[row], self.columns[column], short(value, 3))),
                };
                if value < 0.0 { below.push(cell) } else { above.push(cell) }
            }
        }
        [(NEGATIVE_COLOUR, below), (POSITIVE_COLOUR, above)]
    }
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    words: String,
    width: f64,
    height: f64,
    labels: f64,
    side: f64,
    columns: Vec<(f64, String)>,
    rows: Vec<(f64, String)>,
    signs: [(&'static str, Vec<CellView>); 2],
    grid: Vec<String>,
    scale: Vec<ScaleStep>,
    step_width: f64,
    scale_frame: [f64; 3],
    marks: [(f64, String); 5],
}

#[derive(Serialize)]
struct ScaleStep {
    x: f64,
    y: f64,
    colour: &'static str,
    strength: f64,
}

#[derive(Serialize)]
struct CellView {
    x: f64,
    y: f64,
    strength: String,
    text: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_stay_empty_and_ragged_matrices_are_refused() {
        let map = HeatMap::new("t", ["a", "b"], ["x", "y<"], vec![vec![1.0, -0.5], vec![f64::NAN, 0.0]]);
        let svg = map.svg().unwrap();
        assert_eq!(svg.matches("<title>").count(), 3, "{svg}");
        assert!(svg.contains("strongest a and x 1") && svg.contains(">-0.5</text>"), "{svg}");
        assert!(svg.contains("b × y&lt;: 0") && !svg.contains("NaN"));
        assert!(HeatMap::new("t", ["a"], ["x"], vec![]).svg().is_err());
        assert!(HeatMap::new("t", ["a"], ["x"], vec![vec![1.0, 2.0]]).svg().is_err());
        assert!(!HeatMap::new("zeros", ["a"], ["x"], vec![vec![0.0]]).svg().unwrap().contains("NaN"));
        let none: [&str; 0] = [];
        assert!(HeatMap::new("none", none, none, vec![]).svg().is_ok());
    }
}
