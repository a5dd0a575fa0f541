//! Data of a figure as a table of texts and numbers.

use core::fmt::Write;
use dynident_text::csv_field;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Text(String),
    Number(f64),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<&String> for Value {
    fn from(text: &String) -> Self {
        Self::Text(text.clone())
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<Option<f64>> for Value {
    fn from(number: Option<f64>) -> Self {
        Self::Number(number.unwrap_or(f64::NAN))
    }
}

#[derive(Clone, Debug)]
pub(super) struct Data {
    columns: Vec<&'static str>,
    rows: Vec<Vec<Value>>,
}

impl Data {
    pub(super) fn new<const N: usize>(columns: [&'static str; N]) -> Self {
        Self { columns: columns.into(), rows: Vec::new() }
    }

    pub(super) fn add(&mut self, row: impl Into<Vec<Value>>) {
        self.rows.push(row.into());
    }

    pub(super) fn csv(&self) -> String {
        let mut text = self.columns.join(",") + "\n";
        for row in &self.rows {
            for (place, value) in row.iter().enumerate() {
                let comma = if place == 0 { "" } else { "," };
                // Writing to a string cannot fail.
                let _ = match value {
                    Value::Text(value) => write!(text, "{comma}{}", csv_field(value)),
                    Value::Number(value) if value.is_finite() => write!(text, "{comma}{value:?}"),
                    Value::Number(_) => write!(text, "{comma}"),
                };
            }
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_numbers_and_missing_values_are_empty() {
        let mut data = Data::new(["name", "value", "bar"]);
        data.add(["-1, a".into(), (-1.5e-9).into(), None.into()]);
        assert_eq!(data.csv(), "name,value,bar\n\"'-1, a\",-1.5e-9,\n");
    }
}
