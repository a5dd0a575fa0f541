//! Positions of LeRobot that are normalised to the calibrated range of each joint, and positions in 0.001 degree.

use super::grippers::{DEGREE, is_gripper};

/// Largest normalised position, and largest amount by which a logged one may exceed it.
const FULL: f64 = 100.0;
const MAX_EXCESS: f64 = 0.5;
/// Normalised position beyond which a joint is near the end of its calibrated range.
const NEAR_END: f64 = 90.0;
/// Minimum number of joints that are near both ends of their range, if the limits of the robot description do not
/// exclude degrees.
const MIN_JOINTS_AT_BOTH_ENDS: usize = 2;
/// Largest amount by which positions exceed the limits of the robot description, rad.
const MAX_BEYOND_LIMITS: f64 = 0.05;
/// Smallest ratio of positions and limits in degrees for which 0.001 degree is plausible.
const MIN_RATIO_OF_THOUSANDTHS: f64 = 50.0;

/// The logged positions of a joint.
pub(super) struct LoggedRange {
    pub(super) joint: String,
    /// Lowest and highest logged position, in the unit of the log.
    pub(super) range: [f64; 2],
    /// Position limits, rad or m.
    pub(super) limits: Option<[f64; 2]>,
    /// Whether the joint is revolute, and not a gripper that is logged as a share of its range.
    pub(super) is_turning: bool,
}

impl LoggedRange {
    /// Whether the positions times `factor` exceed the limits.
    fn is_beyond(&self, factor: f64) -> bool {
        let [low, high] = self.range;
        self.limits.is_some_and(|[lower, upper]| {
            low * factor < lower - MAX_BEYOND_LIMITS || high * factor > upper + MAX_BEYOND_LIMITS
        })
    }
}

/// Evidence that positions are normalised to -100 to 100.
pub(super) enum Normalised {
    /// In degrees this joint would exceed its limits.
    Beyond(String),
    /// Several joints come near both ends of this range.
    AtBothEnds,
}

impl Normalised {
    /// Evidence in positions with names as in LeRobot. `None` if one of them is outside of the range, or if all are
    /// plausible in degrees.
    pub(super) fn find(logged: &[LoggedRange], columns: &[String]) -> Option<Self> {
        let turning = || logged.iter().filter(|logged| logged.is_turning);
        let is_within = |logged: &LoggedRange| logged.range.iter().all(|value| value.abs() <= FULL + MAX_EXCESS);
        if !columns.iter().all(|column| is_lerobot(column)) || !turning().all(is_within) {
            return None;
        }
        if let Some(beyond) = turning().find(|logged| logged.is_beyond(DEGREE)) {
            return Some(Self::Beyond(beyond.joint.clone()));
        }
        let is_at_both_ends = |logged: &&LoggedRange| logged.range[0] <= -NEAR_END && logged.range[1] >= NEAR_END;
        (turning().filter(is_at_both_ends).count() >= MIN_JOINTS_AT_BOTH_ENDS).then_some(Self::AtBothEnds)
    }

    /// The note for the unit, with the scale and offset of each joint.
    pub(super) fn note(&self, logged: &[LoggedRange]) -> String {
        let why = match self {
            Self::Beyond(joint) => format!("in degrees `{joint}` would exceed its limits"),
            Self::AtBothEnds => "several joints come near both ends of this range".to_owned(),
        };
        // A gripper is normalised to 0 to 100, another joint to -100 to 100.
        let mapping = |logged: &LoggedRange| {
            let [lower, upper] = logged.limits?;
            let is_share = is_gripper(&logged.joint);
            let scale = (upper - lower) / if is_share { FULL } else { 2.0 * FULL };
            Some([scale, if is_share { lower } else { 0.5 * (lower + upper) }])
        };
        let mappings: Option<Vec<[f64; 2]>> = logged.iter().map(mapping).collect();
        let keys = mappings.map_or_else(
            || {
                "scale = (upper - lower) / 200 and offset = (upper + lower) / 2 of the limits of each joint, rad"
                    .to_owned()
            },
            |mappings| {
                let list = |at: usize| {
                    let values: Vec<String> = mappings.iter().map(|mapping| format!("{:.5}", mapping[at])).collect();
                    format!("[{}]", values.join(", "))
                };
                format!("scale = {}, offset = {}", list(0), list(1))
            },
        );
        format!(
            "or LeRobot's normalised range -100 to 100 ({why}): if the arm was calibrated over the full range of its joints, write unit = \"rad\", {keys} (and `sign` where the direction of a joint is reversed); LeRobot records degrees with its option use_degrees. Decide this before corrections of `dynident check`"
        )
    }
}

/// Whether a column has a name as in LeRobot: `observation.state[elbow.pos]`, `action[0]`, `elbow.pos`.
fn is_lerobot(column: &str) -> bool {
    column.starts_with("observation.state")
        || column.starts_with("action")
        || column.rsplit_once('.').is_some_and(|(_, quantity)| quantity == "pos")
}

/// Whether 0.001 degree fits the limits of all revolute joints, and degrees are far from them.
pub(super) fn are_thousandths(logged: &[LoggedRange]) -> bool {
    let turning: Vec<&LoggedRange> = logged.iter().filter(|logged| logged.is_turning).collect();
    let is_far = |logged: &&LoggedRange| {
        let [low, high] = logged.range;
        let most = logged.limits.map_or(0.0, |[lower, upper]| upper.max(-lower));
        most > 0.0 && high.max(-low) * DEGREE > MIN_RATIO_OF_THOUSANDTHS * most
    };
    turning.iter().all(|logged| logged.limits.is_some() && !logged.is_beyond(1e-3 * DEGREE))
        && turning.iter().any(is_far)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logged(joints: &[([f64; 2], [f64; 2])]) -> Vec<LoggedRange> {
        let one = |(at, (range, limits)): (usize, &([f64; 2], [f64; 2]))| LoggedRange {
            joint: format!("joint{at}"),
            range: *range,
            limits: Some(*limits),
            is_turning: true,
        };
        joints.iter().enumerate().map(one).collect()
    }

    #[test]
    fn normalised_positions_are_distinguished_from_degrees() {
        let columns = ["action[a.pos]".to_owned(), "action[b.pos]".to_owned()];
        // The limits are 0 and 2 rad; the joint moves from 0.5 to 1.97 rad.
        let beyond = logged(&[([-50.0, 97.0], [0.0, 2.0]), ([-60.0, 60.0], [-1.5, 1.5])]);
        let found = Normalised::find(&beyond, &columns).unwrap();
        let note = found.note(&beyond);
        assert!(note.contains("`joint0`") && note.contains("scale = [0.01000, 0.01500]"), "{note}");
        assert!(note.contains("offset = [1.00000, 0.00000]") && note.contains("use_degrees"), "{note}");
        let ends = logged(&[([-99.0, 98.0], [-1.8, 1.8]), ([-95.0, 100.2], [-1.8, 1.8])]);
        assert!(matches!(Normalised::find(&ends, &columns), Some(Normalised::AtBothEnds)));
        // Degrees within the limits, larger values, and columns of another recorder.
        let degrees = logged(&[([-99.0, 98.0], [-1.8, 1.8]), ([-40.0, 60.0], [-1.8, 1.8])]);
        assert!(Normalised::find(&degrees, &columns).is_none());
        assert!(Normalised::find(&logged(&[([-50.0, 140.0], [0.0, 2.0])]), &columns).is_none());
        assert!(Normalised::find(&beyond, &["q1".to_owned(), "q2".to_owned()]).is_none());
    }

    #[test]
    fn thousandths_of_a_degree_fit_the_limits() {
        assert!(are_thousandths(&logged(&[([-48e3, 145e3], [-1.4, 3.5]), ([-500.0, 700.0], [-1.5, 1.5])])));
        assert!(!are_thousandths(&logged(&[([-48e3, 145e3], [-1.4, 1.5])])));
        // Degrees.
        assert!(!are_thousandths(&logged(&[([-80.0, 170.0], [-1.4, 3.5])])));
    }
}
