//! Compares a value with a JSON schema in both directions: the schema must contain every key of an object, and the
//! object every required key. Supports the part of draft 7 that is used by `docs/schemas`.

use serde_json::Value;
use std::collections::BTreeSet;

/// Differences of `value` from the schema `docs/schemas/NAME.json`; empty if there are no differences.
///
/// # Panics
/// If the schema does not exist.
pub fn differences(name: &str, value: &Value) -> Vec<String> {
    let path = crate::repository(&format!("docs/schemas/{name}.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let root = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut found = Vec::new();
    Checker { root: &root }.value(&root, value, "", &mut found);
    found
}

struct Checker<'a> {
    root: &'a Value,
}

impl Checker<'_> {
    fn value(&self, schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
        // `true` allows any value.
        let Some(rules) = schema.as_object().filter(|rules| !rules.is_empty()) else { return };
        let mut known = BTreeSet::new();
        self.part(schema, value, at, found, &mut known);
        let is_any =
            ["type", "$ref", "allOf", "anyOf", "oneOf", "enum", "const"].iter().all(|key| !rules.contains_key(*key));
        if let Some(object) = value.as_object().filter(|_| !is_any) {
            let unknown = object.keys().filter(|key| !known.contains(key.as_str()));
            found.extend(unknown.map(|key| format!("{at}.{key}: not in the schema")));
        }
    }

    /// Compares a value with one part of its schema; `known` collects the keys that the parts contain.
    fn part<'v>(
        &self,
        schema: &Value,
        value: &'v Value,
        at: &str,
        found: &mut Vec<String>,
        known: &mut BTreeSet<&'v str>,
    ) {
        if let Some(target) = schema["$ref"].as_str() {
            let target = self.root.pointer(target.trim_start_matches('#'));
            self.part(target.unwrap_or_else(|| panic!("{at}: {schema}")), value, at, found, known);
        }
        for part in schema["allOf"].as_array().into_iter().flatten() {
            self.part(part, value, at, found, known);
        }
        for key in ["anyOf", "oneOf"] {
            if let Some(alternatives) = schema[key].as_array() {
                self.best_alternative(alternatives, value, at, found, known);
            }
        }
        let is_one_of = |types: &Value| match types {
            Value::Array(types) => types.iter().any(|one| is_of(value, one)),
            one => is_of(value, one),
        };
        if schema.get("type").is_some_and(|types| !is_one_of(types)) {
            found.push(format!("{at}: {value} is not of type {}", schema["type"]));
        }
        if schema.get("const").is_some_and(|only| only != value)
            || schema["enum"].as_array().is_some_and(|all| !all.contains(value))
        {
            found.push(format!("{at}: {value} is not among {}{}", schema["const"], schema["enum"]));
        }
        match value {
            Value::Object(object) => {
                for (key, value) in object {
                    let own = schema["properties"].get(key);
                    if let Some(own) = own.or_else(|| schema.get("additionalProperties").filter(|all| **all != false)) {
                        known.insert(key);
                        self.value(own, value, &format!("{at}.{key}"), found);
                    }
                }
                let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
                let missing = required.filter(|key| !object.contains_key(*key));
                found.extend(missing.map(|key| format!("{at}.{key}: missing")));
            }
            Value::Array(values) => self.array(schema, values, at, found),
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
        }
    }

    /// Compares a value with the alternative that has the fewest differences.
    fn best_alternative<'v>(
        &self,
        alternatives: &[Value],
        value: &'v Value,
        at: &str,
        found: &mut Vec<String>,
        known: &mut BTreeSet<&'v str>,
    ) {
        let tried = alternatives.iter().map(|alternative| {
            let (mut found, mut known) = (Vec::new(), BTreeSet::new());
            self.part(alternative, value, at, &mut found, &mut known);
            (found, known)
        });
        match tried.min_by_key(|(found, _)| found.len()) {
            Some((fewest, own)) => {
                found.extend(fewest);
                known.extend(own);
            }
            None => found.push(format!("{at}: no alternative in the schema")),
        }
    }

    /// Compares the length and the values of an array with its schema.
    fn array(&self, schema: &Value, values: &[Value], at: &str, found: &mut Vec<String>) {
        let count = values.len() as u64;
        if schema["minItems"].as_u64().is_some_and(|least| count < least)
            || schema["maxItems"].as_u64().is_some_and(|most| count > most)
        {
            found.push(format!("{at}: wrong number of values ({count})"));
        }
        for (index, value) in values.iter().enumerate() {
            let own = schema["items"].get(index).or_else(|| schema.get("items"));
            if let Some(own) = own {
                self.value(own, value, &format!("{at}[{index}]"), found);
            }
        }
    }
}

fn is_of(value: &Value, name: &Value) -> bool {
    match value {
        Value::Null => name == "null",
        Value::Bool(_) => name == "boolean",
        Value::Number(number) => name == "number" || (name == "integer" && !number.is_f64()),
        Value::String(_) => name == "string",
        Value::Array(_) => name == "array",
        Value::Object(_) => name == "object",
    }
}
