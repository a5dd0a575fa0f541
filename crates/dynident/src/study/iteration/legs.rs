//! `[[iteration.leg]]`: trajectories of which some joints are held, together in every run or one after another.

use super::super::DesignSection;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What becomes of several legs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum LegOrder {
    /// Every run has all of them, and is identified from all.
    #[default]
    Together,
    /// Each has an iteration of its own, until that has settled or its runs are used up; what it has found is held in
    /// those after it. The paper's way: tip first.
    OneAfterAnother,
}

/// `[[iteration.leg]]`: one trajectory.
///
/// ```
/// let section: dynident::study::IterationSection = toml::from_str(
///     r#"
///     order = "one-after-another"
///     leg = [{ hold = { joint1 = 0.0 } }, { hold = { joint2 = 0.5 }, trajectory = "joint1.csv", windows = { joint1 = [[2.0, 8.0]] } }]
///     "#,
/// )?;
/// assert_eq!(section.leg[1].hold["joint2"], 0.5);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LegSection {
    /// Joints that are held, and where, rad (m); none by default. Their torque does not count. Of a windowed design
    /// only the strokes of the other joints are run.
    pub hold: BTreeMap<String, f64>,
    /// Whether the simulator locks them (the default), or the controller has to hold them. A robot outside gets them as
    /// joints that are to rest.
    pub locked: bool,
    /// Its trajectory, in place of the study's.
    pub trajectory: Option<PathBuf>,
    /// Its design, in place of the study's `[design]`.
    pub design: Option<DesignSection>,
    /// For joints by name the times (from, to; s) that count; what the design says by default, or everything. Joints
    /// that are not named do not count then.
    pub windows: BTreeMap<String, Vec<[f64; 2]>>,
    /// The `[[payload]]` that the robot carries on it, by name; none by default.
    pub payload: Option<String>,
}

impl Default for LegSection {
    fn default() -> Self {
        Self {
            hold: BTreeMap::new(),
            locked: true,
            trajectory: None,
            design: None,
            windows: BTreeMap::new(),
            payload: None,
        }
    }
}
