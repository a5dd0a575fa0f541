//! Writing identified values back into the user's own D-H table.
//!
//! Only `inertial` and the two friction values of `dynamics` change. Everything else keeps its comments, order and
//! spacing.

use super::build::rows;
use super::{DhError, parsed, toml_fault};
use crate::inertial::InertialParameters;
use crate::urdf::{JointChange, LinkChange};
use std::collections::HashSet;
use thiserror::Error;
use toml_edit::{Array, DocumentMut, InlineTable, Item, TableLike, Value};

const KEYS: [&str; 5] = ["mass_kg", "com_m", "inertia_at_com", "inertia_at_origin", "parameters"];
/// Prefix of comments written by Dynident; a new identification replaces them.
const SIGNATURE: &str = "# identified: ";

/// Why values could not be written into a D-H table.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum DhWriteError {
    /// The original is not readable.
    #[error("{0}")]
    Original(#[from] DhError),
    /// The identified model has a link or joint that this D-H table does not contain. Give the table from which the
    /// model was identified.
    #[error("the D-H table has no {kind} `{name}`: write into the file that the model was read from")]
    Unknown { kind: &'static str, name: String },
    /// A program passed two sets of values for one link or joint. Correct the call.
    #[error("two changes to {kind} `{name}`: give one")]
    Repeated { kind: &'static str, name: String },
    /// A value to write is NaN or infinite. Identify the model again, or correct the values that the program passed.
    #[error("the new values of {kind} `{name}` are not all finite numbers")]
    NotFinite { kind: &'static str, name: String },
}

/// Writes the changes into `original`. The changes give inertials in the **body** frames. They are written in the D-H
/// frames of the rows (see the [module](crate::dh)) as `mass_kg`, `com_m` and `inertia_at_com`, or as `parameters` if
/// there is no centre of mass. Every number has the shortest form that parses to the same `f64`. Notes become
/// comments before the row's `inertial`.
///
/// # Errors
/// An invalid D-H table, an unknown link or joint, a repeated change, or a value that is not finite.
pub fn rewrite_dh(original: &str, links: &[LinkChange], joints: &[JointChange]) -> Result<String, DhWriteError> {
    let (text, table) = parsed(original)?;
    let rows = rows(text, &table)?;
    let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| {
        toml_fault(text, error.span().map_or(0, |span| span.start), error.message())
    })?;
    let has_lines = document.get("joint").is_some_and(Item::is_array_of_tables);
    let unknown = |kind: &'static str, name: &str| DhWriteError::Unknown { kind, name: name.to_owned() };
    let mut seen = HashSet::new();
    let mut once = |kind: &'static str, name: &str| {
        let repeated = || DhWriteError::Repeated { kind, name: name.to_owned() };
        seen.insert((kind, name.to_owned())).then_some(()).ok_or_else(repeated)
    };
    for change in links {
        let (LinkChange::Set { link, .. } | LinkChange::Remove { link }) = change;
        once("link", link)?;
        let place = rows.iter().position(|row| row.link == *link).ok_or_else(|| unknown("link", link))?;
        let row = row_mut(&mut document, place).ok_or_else(|| unknown("link", link))?;
        match change {
            LinkChange::Set { inertial, note, .. } => {
                let inertial = inertial.expressed_in(&rows[place].body_from_dh.inverse());
                if inertial.0.iter().any(|x| !x.is_finite()) {
                    return Err(DhWriteError::NotFinite { kind: "link", name: link.clone() });
                }
                set_inertial(row, &inertial);
                // A row on one line has no place for a comment.
                if let Some(note) = note.as_ref().filter(|_| has_lines) {
                    set_note(row, note);
                }
            }
            LinkChange::Remove { .. } => drop(row.remove("inertial")),
        }
    }
    for JointChange { joint, damping, friction, .. } in joints {
        once("joint", joint)?;
        let place = rows.iter().position(|row| row.joint == *joint).ok_or_else(|| unknown("joint", joint))?;
        let row = row_mut(&mut document, place).ok_or_else(|| unknown("joint", joint))?;
        for (key, number) in [("damping", damping), ("friction", friction)] {
            let Some(number) = *number else { continue };
            if !number.is_finite() {
                return Err(DhWriteError::NotFinite { kind: "joint", name: joint.clone() });
            }
            if let Some(dynamics) = child(row, "dynamics") {
                put(dynamics, key, number.into());
            }
        }
    }
    let mark = &original[..original.len() - text.len()];
    Ok(dynident_text::toml_document(&format!("{mark}{document}")).into_owned())
}

/// A row as a table: `[[joint]]`, or an element of `joint = [..]`.
fn row_mut(document: &mut DocumentMut, index: usize) -> Option<&mut dyn TableLike> {
    match document.get_mut("joint")? {
        Item::ArrayOfTables(rows) => rows.get_mut(index).map(|row| row as &mut dyn TableLike),
        Item::Value(Value::Array(rows)) => {
            rows.get_mut(index)?.as_inline_table_mut().map(|row| row as &mut dyn TableLike)
        }
        Item::None | Item::Value(_) | Item::Table(_) => None,
    }
}

/// The table `key` of a row, created if missing.
fn child<'r>(row: &'r mut dyn TableLike, key: &str) -> Option<&'r mut dyn TableLike> {
    if !row.get(key).is_some_and(Item::is_table_like) {
        row.insert(key, Item::Value(Value::InlineTable(InlineTable::new())));
    }
    row.get_mut(key)?.as_table_like_mut()
}

/// Sets a value and keeps the spacing and comment around it.
fn put(table: &mut dyn TableLike, key: &str, mut value: Value) {
    match table.get_mut(key) {
        Some(item) => {
            if let Some(old) = item.as_value() {
                *value.decor_mut() = old.decor().clone();
            }
            *item = Item::Value(value);
        }
        None => drop(table.insert(key, Item::Value(value))),
    }
}

fn set_inertial(row: &mut dyn TableLike, inertial: &InertialParameters) {
    let Some(table) = child(row, "inertial") else { return };
    let known: Vec<(&str, Value)> = match (inertial.com_m(), inertial.inertia_at_com()) {
        (Some(com), Some(i)) => {
            let six = [i.0[0][0], i.0[0][1], i.0[0][2], i.0[1][1], i.0[1][2], i.0[2][2]];
            vec![
                (KEYS[0], inertial.mass_kg().into()),
                (KEYS[1], Value::Array(Array::from_iter(com.0))),
                (KEYS[2], Value::Array(Array::from_iter(six))),
            ]
        }
        _ => vec![(KEYS[4], Value::Array(Array::from_iter(inertial.0)))],
    };
    for key in KEYS.iter().filter(|key| known.iter().all(|(kept, _)| kept != *key)) {
        table.remove(key);
    }
    for (key, value) in known {
        put(table, key, value);
    }
}

fn set_note(row: &mut dyn TableLike, note: &str) {
    let line = format!("{SIGNATURE}{}\n", dynident_text::comment(note));
    let with_note = |before: Option<&str>| -> String {
        let others =
            before.unwrap_or("").split_inclusive('\n').filter(|line| !line.trim_start().starts_with(SIGNATURE));
        others.collect::<String>() + &line
    };
    match row.get_mut("inertial") {
        Some(Item::Table(table)) if !table.is_dotted() => {
            let before = table.decor().prefix().and_then(|prefix| prefix.as_str()).map(str::to_owned);
            table.decor_mut().set_prefix(with_note(before.as_deref()));
        }
        Some(_) => {
            if let Some(mut key) = row.key_mut("inertial") {
                let before = key.leaf_decor().prefix().and_then(|prefix| prefix.as_str()).map(str::to_owned);
                key.leaf_decor_mut().set_prefix(with_note(before.as_deref()));
            }
        }
        None => {}
    }
}
