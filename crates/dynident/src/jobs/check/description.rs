//! Findings on the robot description: its units, its masses, or another robot.

use super::wording::finding;
use crate::result::{CheckFinding, StudyChange};
use dynident_identification::diagnosis::{DescriptionFit, StudyKeys, WrongMass};
use dynident_model::{AuditFinding, Model, audit};
use dynident_recording::Level;

/// Times the least factor of a joint's torque that the largest may be where they are one unit, or the currents of
/// drives: motor constants times gear ratios of an arm lie within five of each other.
const MOST_SPREAD: f64 = 10.0;

/// Torques of another size than the description's bodies make: another unit of theirs, or of the masses.
pub(super) fn torque_unit(
    fit: &DescriptionFit,
    far: &[usize],
    model: &Model,
    joints: &[String],
    keys: Option<&StudyKeys>,
) -> CheckFinding {
    let factors = far.iter().map(|&joint| format!("{} {:.3}", joints[joint], fit.scale[joint].unwrap_or(1.0)));
    let factors = factors.collect::<Vec<_>>().join(", ");
    let common = fit.common_unit();
    // Where the description is absurd by itself it is not the torques' unit.
    let audited = audit(model);
    let of_inertia = |found: &&AuditFinding| found.check == "inertia-too-large";
    let most_have_it = 2 * audited.iter().filter(of_inertia).count() > model.bodies().len();
    let absurd = audited.iter().find(|found| ["mass-absurd", "length-unit"].contains(&found.check));
    let absurd = absurd.or_else(|| audited.iter().find(of_inertia).filter(|_| most_have_it));
    if let Some(absurd) = absurd {
        return finding(
            "description",
            format!("the description is in other units: {} {}", absurd.place, absurd.message),
            format!(
                "its bodies would need other torques than the log has, times {factors}: `dynident inspect` says more; where the \
                 description is right the torque is not in Nm (N)"
            ),
        );
    }
    let scales = || far.iter().filter_map(|&joint| fit.scale[joint]);
    let (least, most) = (scales().fold(f64::INFINITY, f64::min), scales().fold(0.0, f64::max));
    // One joint of several may have a body that is described badly.
    let is_alone = far.len() == 1 && joints.len() > 1;
    if is_alone || (common.is_none() && most > MOST_SPREAD * least) {
        return finding(
            "description",
            "the description's masses are not this robot's, or the torques of some joints are in another unit"
                .to_owned(),
            format!(
                "its bodies, friction aside, would need other torques than the log has, times {factors}: {}; compare the \
                 masses of the bodies beyond these joints with the maker's data (`dynident inspect`), and the units of \
                 their columns",
                if is_alone {
                    "one joint, which says nothing of the others' unit"
                } else {
                    "too far apart for one unit or for the currents of drives"
                }
            ),
        );
    }
    let mut found = finding(
        "unit",
        common.map_or_else(|| "the torque is not in Nm (N)".to_owned(), |(name, _)| format!("the torque is in {name}")),
        format!(
            "by the description's bodies, friction aside, a unit of it is worth this many Nm (N): {factors}; for currents that is \
             motor constant times gear ratio, which the maker's data say better, or write `gains = \"unknown\"` under [estimator] and \
             add a log with a known payload"
        ),
    );
    let of_joints = |scale: &[Option<f64>]| keys.map(|keys| StudyChange::from(keys.torque_scale(scale)));
    match common {
        Some((_, unit)) => {
            found.write.extend(keys.map(|keys| keys.torque_unit(unit).into()));
            let other = of_joints(&fit.scale).map(|change| format!("currents ({} {})", change.place(), change.line));
            found.or.extend(other);
        }
        None => found.write.extend(of_joints(&fit.scale)),
    }
    found
}

/// One body of the description is far too heavy or too light: no fit of base parameters suffers, but the nominal ones.
pub(super) fn wrong_mass(wrong: &WrongMass, model: &Model) -> CheckFinding {
    let name = model.bodies()[wrong.body].name();
    let mass_kg = model.inertials()[wrong.body].mass_kg();
    let found = finding(
        "description",
        format!("the description's mass of `{name}` is not this robot's"),
        format!(
            "with {:.4} kg in place of {mass_kg:.4} (times {:.3}, its inertia as well) its bodies leave {:.0} % of the torques, friction \
             aside, where no units of the torques explain more; correct the description: `dynident inspect` looks at it, too",
            wrong.factor * mass_kg,
            wrong.factor,
            100.0 * wrong.left
        ),
    );
    CheckFinding { level: Level::Warning, ..found }
}

/// The description's bodies explain no joint, and other bodies do.
pub(super) fn another_robot(fit: &DescriptionFit, joints: &[String]) -> CheckFinding {
    let best = fit.best_explained().map_or_else(String::new, |(joint, share)| {
        format!("{:.0} % of that of `{}`, which is the most of all joints", 100.0 * share, joints[joint])
    });
    finding(
        "description",
        "the description is of another robot, or its masses are placeholders".to_owned(),
        format!(
            "friction and drive inertia aside, its bodies, scaled as suits each joint, explain {best}, where bodies that could be explain nearly all of it: \
             compare `file` under [robot] with the robot; where nobody knows a body, leave its <inertial> element out"
        ),
    )
}
