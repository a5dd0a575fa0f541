//! `criterion`: a name, or a table for what needs settings.

use super::section::CriterionChoice;
use core::fmt;
use serde::de::value::MapAccessDeserializer;
use serde::de::{IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::path::PathBuf;

/// What makes a motion good, as a study has it: `criterion = "d-optimal"`, or `criterion = { kind = "prediction", trajectory = "task.csv" }`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum CriterionSetting {
    /// A criterion that its name says all about.
    Named(CriterionChoice),
    /// A criterion with settings.
    With(CriterionTable),
}

/// Criteria with settings, by their `kind`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CriterionTable {
    /// V-optimality: the mean square error of the torque that the fitted model will predict on a task.
    Prediction {
        /// The task: a table with `t_s`, `q1..` and, if at hand, `dq1..` and `ddq1..` (rad, m, s), or positions under the joints' names. Found as the study's logs are.
        trajectory: PathBuf,
    },
}

impl Default for CriterionSetting {
    fn default() -> Self {
        Self::Named(CriterionChoice::default())
    }
}

impl From<CriterionChoice> for CriterionSetting {
    fn from(choice: CriterionChoice) -> Self {
        Self::Named(choice)
    }
}

impl CriterionSetting {
    /// Whether torque noise plays no part: the figure is of the regressor itself.
    pub(crate) fn of_regressor(&self) -> bool {
        matches!(self, Self::Named(choice) if choice.of_regressor())
    }
}

impl<'de> Deserialize<'de> for CriterionSetting {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NameOrTable)
    }
}

/// By hand, so that a wrong name is told with the right ones and not as "no variant fits".
struct NameOrTable;

impl<'de> Visitor<'de> for NameOrTable {
    type Value = CriterionSetting;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(
            "the name of a criterion, or a table such as { kind = \"prediction\", trajectory = \"task.csv\" }",
        )
    }

    fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Self::Value, E> {
        CriterionChoice::deserialize(name.into_deserializer()).map(CriterionSetting::Named)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        CriterionTable::deserialize(MapAccessDeserializer::new(map)).map(CriterionSetting::With)
    }
}
