//! Findings about recordings of a bench whose files state different masses or gains.

use crate::result::{CheckFinding, StudyChange};
use crate::study::{Study, StudyLogSource};
use dynident_recording::Level;
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::path::Path;

/// Longest file whose head is read, bytes: that of logs in JSON.
const MAX_BYTES: u64 = 1 << 25;
/// Names of a load and of a gain in files of benches.
const MASSES: [&str; 2] = ["mass", "mass_kg"];
const GAINS: [&str; 3] = ["kp", "p_gain", "gain"];

/// Findings about masses and gains that differ between the files and that the study does not state.
pub(super) fn bench_findings(study: &Study, sources: &[StudyLogSource]) -> Vec<CheckFinding> {
    let heads: Vec<Map<String, Value>> = sources.iter().map(|source| head(&source.path())).collect();
    let stated = |names: &[&str]| -> Vec<(usize, f64)> {
        let of = |head: &Map<String, Value>| names.iter().find_map(|name| head.get(*name)?.as_f64());
        heads.iter().enumerate().filter_map(|(log, head)| Some((log, of(head)?))).collect()
    };
    let (mut masses, mut gains) = (stated(&MASSES), stated(&GAINS));
    let largest = gains.iter().map(|(_, gain)| *gain).fold(0.0, f64::max);
    masses.retain(|(log, _)| study.log[*log].payload.is_none());
    gains.retain(|(log, _)| study.log[*log].servo_gain.is_none());
    let payload = |value: f64| format!("payload = \"{value} kg\"");
    let gain = |value: f64| format!("servo_gain = {}", value / largest);
    let of_masses = differing(
        study,
        &masses,
        "masses",
        "the fit takes the logs for one body; describe each mass in a [[payload]] with name, link, mass_kg and com_m",
        payload,
    );
    let of_gains = differing(
        study,
        &gains,
        "position gains",
        "the fit takes the logs for one stiffness; state each gain, relative to the largest one",
        gain,
    );
    of_masses.into_iter().chain(of_gains).collect()
}

/// The finding about values that differ, with the `key` of each log; `None` if all are equal.
fn differing(
    study: &Study,
    values: &[(usize, f64)],
    name: &str,
    evidence: &str,
    key: impl Fn(f64) -> String,
) -> Option<CheckFinding> {
    let different: BTreeSet<String> = values.iter().map(|(_, value)| value.to_string()).collect();
    let change = |(log, value): &(usize, f64)| StudyChange { table: format!("[[log]] {}", log + 1), line: key(*value) };
    (different.len() > 1).then(|| CheckFinding {
        level: Level::Warning,
        kind: "command".to_owned(),
        what: format!(
            "the files of {} logs state different {name} ({}) and the study does not, first in `{}`",
            values.len(),
            different.into_iter().collect::<Vec<_>>().join(", "),
            study.log_name(values[0].0)
        ),
        evidence: evidence.to_owned(),
        write: values.iter().map(change).collect(),
        or: Vec::new(),
        code: "check-command".to_owned(),
    })
}

/// The values of a JSON object next to its samples; empty for other files.
fn head(path: &Path) -> Map<String, Value> {
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) {
        return Map::new();
    }
    let bytes = dynident_files::read(path, MAX_BYTES).unwrap_or_default();
    serde_json::from_slice(&bytes).unwrap_or_default()
}
