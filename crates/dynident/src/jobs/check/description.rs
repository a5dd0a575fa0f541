//! Findings about the robot description: units, masses, or the description of another robot.

use super::wording::{FindingContext, finding};
use crate::result::{CheckFinding, StudyChange};
use dynident_identification::diagnosis::{DescriptionFit, WrongMass};
use dynident_model::{AuditFinding, Model, audit};
use dynident_recording::Level;

/// The torque magnitude differs from that of the robot description: another torque unit, or another unit of the
/// masses.
pub(super) fn torque_unit(
    fit: &DescriptionFit,
    far: &[usize],
    model: &Model,
    words: &FindingContext<'_>,
) -> CheckFinding {
    let FindingContext { joints, keys, thresholds } = *words;
    let factors = far.iter().map(|&joint| format!("{} {:.3}", joints[joint], fit.scale[joint].unwrap_or(1.0)));
    let factors = factors.collect::<Vec<_>>().join(", ");
    let common = fit.common_unit();
    // If the robot description is implausible, this is reported instead of the torque unit.
    let audited = audit(model);
    let of_inertia = |found: &&AuditFinding| found.check == "inertia-too-large";
    let most_have_it = 2 * audited.iter().filter(of_inertia).count() > model.bodies().len();
    let absurd = audited.iter().find(|found| ["mass-absurd", "length-unit"].contains(&found.check));
    let absurd = absurd.or_else(|| audited.iter().find(of_inertia).filter(|_| most_have_it));
    if let Some(absurd) = absurd {
        return finding(
            "description",
            format!("the robot description uses other units: {} {}", absurd.place, absurd.message),
            format!(
                "the log's torques differ from those of its bodies by the factors {factors}: run `dynident inspect`; if the \
                 description is correct, the torque is not in Nm (N)"
            ),
        );
    }
    let scales = || far.iter().filter_map(|&joint| fit.scale[joint]);
    let (least, most) = (scales().fold(f64::INFINITY, f64::min), scales().fold(0.0, f64::max));
    // A difference at a single joint can also come from one wrong body.
    let is_alone = far.len() == 1 && joints.len() > 1;
    if is_alone || (common.is_none() && most > thresholds.max_factor_ratio * least) {
        return finding(
            "description",
            "wrong masses in the robot description, or torques of some joints in another unit".to_owned(),
            format!(
                "without friction, the log's torques differ from those of its bodies by the factors {factors}: {}; compare the \
                 masses of the bodies beyond these joints with the manufacturer's data (`dynident inspect`), and the units of \
                 their columns",
                if is_alone {
                    "only one joint, so the unit is not common to all"
                } else {
                    "the spread is too large for one unit or for motor currents"
                }
            ),
        );
    }
    let mut found = finding(
        "unit",
        common.map_or_else(|| "the torque is not in Nm (N)".to_owned(), |(name, _)| format!("the torque is in {name}")),
        format!(
            "Nm (N) per logged unit, from the bodies of the robot description without friction: {factors}; for currents this is \
             motor constant times gear ratio (prefer the manufacturer's data), or set `gains = \"unknown\"` under [drive] and \
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

/// One body of the robot description is far too heavy or too light. Base parameters are not affected, but nominal
/// parameters are.
pub(super) fn wrong_mass(wrong: &WrongMass, model: &Model) -> CheckFinding {
    let name = model.bodies()[wrong.body].name();
    let mass_kg = model.inertials()[wrong.body].mass_kg();
    let found = finding(
        "description",
        format!("wrong mass of `{name}` in the robot description"),
        format!(
            "with {:.4} kg instead of {mass_kg:.4} kg (factor {:.3}, also for its inertia) the unexplained torque is {:.0} %, without friction, \
             and no other torque unit explains more; correct the robot description (see `dynident inspect`)",
            wrong.factor * mass_kg,
            wrong.factor,
            100.0 * wrong.left
        ),
    );
    CheckFinding { level: Level::Warning, ..found }
}

/// The bodies of the robot description do not explain the torque of any joint, while other consistent bodies do.
pub(super) fn another_robot(fit: &DescriptionFit, joints: &[String]) -> CheckFinding {
    let best = fit.best_explained().map_or_else(String::new, |(joint, share)| {
        format!("{:.0} % of the torque of `{}`, the largest share of all joints", 100.0 * share, joints[joint])
    });
    finding(
        "description",
        "the robot description is of another robot, or its masses are placeholders".to_owned(),
        format!(
            "without friction and drive inertia, its bodies, scaled per joint, explain {best}; other physically consistent bodies explain nearly all of it: \
             compare `file` under [robot] with the robot; if the inertia of a body is unknown, remove its <inertial> element"
        ),
    )
}
