//! Sentences about torque errors and poorly known parameters, for the page and the terminal.

use crate::result::{FormatError, JointError, PoorlyKnown, ResultFile};
use dynident_recording::Level;
use dynident_report::short;

/// Maximum number of joints that are listed with their errors.
const MAX_JOINTS: usize = 3;
/// Ratio of two torque errors up to which two models predict about equally.
const MAX_EQUAL_RATIO: f64 = 1.2;
/// Codes of findings about torque that is constantly or mostly zero.
const DEAD_CODES: [&str; 2] = ["import-dead", "import-mostly-dead"];

/// A percentage with three digits.
pub(crate) fn percent_words(percent: f64) -> String {
    format!("{}\u{a0}%", short(percent, 3))
}

/// Joints with their errors, the worst first: `arm_6 83 % (0.02 Nm), arm_5 71 % (0.3 Nm); their torque is small`.
/// `name` shortens a name.
pub fn joint_error_words(joints: &[JointError], name: &dyn Fn(&str) -> String) -> String {
    let one = |joint: &JointError| {
        let rmse = short(joint.rmse, 2);
        format!("{} {} ({rmse}\u{a0}{})", name(&joint.name), percent_words(joint.relative_error_percent), joint.unit)
    };
    let mut words = joints.iter().take(MAX_JOINTS).map(one).collect::<Vec<_>>().join(", ");
    if joints.len() > MAX_JOINTS {
        words = format!("{words} and {} more", joints.len() - MAX_JOINTS);
    }
    let small: Vec<String> =
        joints.iter().take(MAX_JOINTS).filter(|joint| joint.is_small).map(|joint| name(&joint.name)).collect();
    match small.len() {
        0 => words,
        1 if joints.len() == 1 => format!("{words}; its torque is small"),
        _ if joints.iter().all(|joint| joint.is_small) => format!("{words}; their torque is small"),
        _ => format!("{words}; small torque: {}", small.join(", ")),
    }
}

/// Export formats with their errors: `URDF, SDF 27 %; MJCF 26 %; code 12 %`.
pub fn format_error_words(formats: &[&FormatError]) -> String {
    let one = |format: &&FormatError| format!("{} {}", format.formats, percent_words(format.relative_error_percent));
    formats.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// The poorly known parameters by kind: `inertia 33 of 36 (arm_1 to arm_7), friction 20 of 23 (..)`.
pub fn poorly_known_words(found: &[PoorlyKnown]) -> String {
    found.iter().map(PoorlyKnown::words).collect::<Vec<_>>().join(", ")
}

/// Compares the physically consistent model ("it") with the unconstrained estimate, in words with the p-value of the F
/// test; `None` without this test.
pub fn consistency_words(r: &ResultFile) -> Option<String> {
    let test = r.physical.fit.as_ref()?.difference?;
    let p = format!("F test, p\u{a0}=\u{a0}{}", short(test.p_value, 2));
    if !test.is_significant {
        return Some(format!("it fits as well as the unconstrained estimate ({p})"));
    }
    let errors = r.validation.first().and_then(|log| {
        let [own, free] = [log.exported(), &log.model].map(|report| report.relative_error_percent);
        Some([own?, free?])
    });
    let although = match errors {
        Some([own, free]) if own <= MAX_EQUAL_RATIO * free => ", although both predict held-out torque about equally",
        _ => "",
    };
    Some(format!("it fits worse than the unconstrained estimate, by more than chance allows ({p}){although}"))
}

/// Joints whose torque is constantly or mostly zero in a log.
pub fn dead_torques(r: &ResultFile) -> Vec<String> {
    let groups = crate::result::grouped_findings(&r.logs, Level::Problem);
    let dead = groups.into_iter().filter(|group| group.quantity == "torque" && DEAD_CODES.contains(&&group.code[..]));
    let mut joints: Vec<String> = Vec::new();
    for joint in dead.flat_map(|group| group.joints().to_vec()) {
        if !joints.contains(&joint) {
            joints.push(joint);
        }
    }
    joints
}
