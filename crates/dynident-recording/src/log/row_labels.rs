//! Names of joints in text fields of a row, which belong to numbers in other fields of the row:
//! `name0, name1, position0, position1`, or lists `['a', 'b']` and `[0.1, 0.2]` in the columns `name` and `position`.

use super::field::number;
use super::text_columns::Column;

/// Names in the first row, and the columns to which they belong.
#[derive(Clone, Debug)]
pub(super) struct RowLabels {
    /// Fields with the names: one field with a list, or one field for each name.
    fields: Vec<usize>,
    is_list: bool,
    /// Texts of these fields in the first row.
    texts: Vec<Vec<u8>>,
    labels: Vec<String>,
    /// Columns of each quantity, in the order of the names in the first row.
    quantities: Vec<Vec<Column>>,
}

/// For each name of the first row, its position in another row; `None` for a missing name.
pub(super) type Order = Vec<Option<usize>>;

impl RowLabels {
    /// Finds the names in the first row `line`, and returns them with new names for all columns, for example
    /// `position[elbow]`. `None` for a table without such fields.
    pub(super) fn find(
        header: &[String],
        columns: &[Column],
        line: &[u8],
        row: &[(usize, usize)],
    ) -> Option<(Self, Vec<String>)> {
        let text = |field: usize| row.get(field).map(|(from, to)| &line[*from..*to]);
        let (fields, labels, is_list) = (0..header.len())
            .filter(|field| is_names(&header[*field]))
            .find_map(|field| Some((vec![field], listed(text(field)?)?, true)))
            .or_else(|| {
                let parts = |field: &usize| Some((*field, numbered(&header[*field])?));
                let named: Vec<_> = (0..header.len())
                    .filter_map(|field| parts(&field))
                    .filter(|(_, (stem, _))| is_names(stem))
                    .collect();
                let fields: Vec<usize> =
                    named.iter().filter(|(_, (stem, _))| *stem == named[0].1.0).map(|(field, _)| *field).collect();
                let labels: Option<Vec<String>> = fields.iter().map(|field| label(text(*field)?)).collect();
                Some((fields, labels?, false))
            })?;
        let is_distinct = (1..labels.len()).all(|at| !labels[..at].contains(&labels[at]));
        let first = &header[*fields.first()?];
        let prefix = &first[..first.len() - last_word(first).len()];
        if labels.len() < 2 || !is_distinct {
            return None;
        }
        // Columns of one quantity have the same name except for their number.
        let mut quantities: Vec<(String, Vec<Column>)> = Vec::new();
        for column in columns.iter().filter(|column| !fields.contains(&column.field)) {
            let name = &header[column.field];
            let stem = if column.entry.is_some() { Some(&name[..]) } else { numbered(name).map(|(stem, _)| stem) };
            let Some(stem) = stem.filter(|stem| stem[..stem.len() - last_word(stem).len()] == *prefix) else {
                continue;
            };
            match quantities.iter_mut().find(|(known, _)| known == stem) {
                Some((_, columns)) => columns.push(*column),
                None => quantities.push((stem.to_owned(), vec![*column])),
            }
        }
        quantities.retain(|(_, columns)| columns.len() == labels.len());
        let name = |column: &Column| {
            let of = |(stem, columns): &(String, Vec<Column>)| {
                let place = columns.iter().position(|known| known == column)?;
                Some(format!("{stem}[{}]", labels[place]))
            };
            quantities.iter().find_map(of).unwrap_or_else(|| column.name(header))
        };
        let names = columns.iter().map(name).collect();
        let texts = fields.iter().map(|field| text(*field).unwrap_or_default().to_vec()).collect();
        let quantities: Vec<Vec<Column>> = quantities.into_iter().map(|(_, columns)| columns).collect();
        (!quantities.is_empty()).then_some((Self { fields, is_list, texts, labels, quantities }, names))
    }

    /// Order of the names in a row; `None` if it is the order of the first row.
    pub(super) fn order(&self, line: &[u8], row: &[(usize, usize)]) -> Option<Order> {
        let text = |field: &usize| &line[row[*field].0..row[*field].1];
        if self.fields.iter().zip(&self.texts).all(|(field, first)| text(field) == first) {
            return None;
        }
        let own: Vec<String> = if self.is_list {
            listed(text(&self.fields[0])).unwrap_or_default()
        } else {
            self.fields.iter().map(|field| label(text(field)).unwrap_or_default()).collect()
        };
        Some(self.labels.iter().map(|label| own.iter().position(|name| name == label)).collect())
    }

    /// Column that contains the value of `column` in a row with this order; `None` if the name is missing in the row.
    pub(super) fn column(&self, column: Column, order: &Order) -> Option<Column> {
        let own = self.quantities.iter().find_map(|columns| {
            let place = columns.iter().position(|known| *known == column)?;
            Some(order[place].map(|at| columns[at]))
        });
        own.unwrap_or(Some(column))
    }
}

/// Last part of a name after its topic: `position` for `/joint_states.position`.
fn last_word(name: &str) -> &str {
    name.rsplit(['.', '/']).next().unwrap_or(name)
}

fn is_names(name: &str) -> bool {
    let word = last_word(name);
    word == "name" || word == "names" || word.ends_with("_names")
}

/// Splits `position0`, `position_0` or `position[0]` into `position` and 0.
fn numbered(name: &str) -> Option<(&str, usize)> {
    let inner = name.strip_suffix(']').unwrap_or(name);
    let stem = inner.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = inner[stem.len()..].parse().ok()?;
    Some((stem.strip_suffix(['[', '_']).unwrap_or(stem), number))
}

/// A name with or without quotes; `None` for an empty field or a number.
fn label(text: &[u8]) -> Option<String> {
    let text = core::str::from_utf8(text).ok()?.trim().trim_matches(['\'', '"']);
    (!text.is_empty() && number(text.as_bytes(), false).is_none()).then(|| text.to_owned())
}

/// The names of a list `['a', 'b']`; `None` for other fields.
fn listed(text: &[u8]) -> Option<Vec<String>> {
    let ([b'[', inner @ .., b']'] | [b'(', inner @ .., b')']) = text else { return None };
    let between = |byte: &u8| matches!(byte, b',' | b';') || byte.is_ascii_whitespace();
    inner.split(between).filter(|entry| !entry.is_empty()).map(label).collect()
}
