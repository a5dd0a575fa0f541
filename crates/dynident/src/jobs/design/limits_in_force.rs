//! Limits that apply to a study's motions (robot description, assumptions, study, envelope of the iteration), and the
//! torque of friction and drives that they include.

use super::prior;
use crate::error::{Error, StudyError};
use crate::study::{DesignSection, Folders, IterationSection, StudyFile, StudyRobot};
use dynident_excitation::check::LimitReport;
use dynident_excitation::limits::{
    AssumedLimits, KnownTorque, LimitKind, LimitScale, Limits, LimitsInForce, ShapesOfLinks, StartPositions,
};
use dynident_iteration::with_typical_drives;
use dynident_model::Model;
use dynident_model::terms::{JointProperty, TorqueTerm};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LimitsFor<'a> {
    /// A search, which keeps a margin to the envelope of the iteration.
    Search,
    /// An existing motion with these start positions.
    Motion(&'a [f64]),
    /// Approach and return paths of an iteration.
    Ways,
    /// A log of a finished run: no assumed limits.
    Log,
}

/// # Errors
/// Limits, start posture, home or envelope that are invalid for the robot.
pub(super) fn in_force(
    study: StudyFile<'_>,
    folders: &Folders,
    robot: &StudyRobot,
    purpose: LimitsFor<'_>,
) -> Result<LimitsInForce, Error> {
    let section = study.design.clone().unwrap_or_default();
    section.limits.validate(robot.model()).map_err(Error::section(study.path, "design.limits"))?;
    let settings = if purpose == LimitsFor::Log { AssumedLimits::none() } else { section.defaults.clone() };
    let starts = starts(&section, study.iteration.as_ref(), robot.model(), purpose);
    let starts = starts.map_err(Error::section(study.path, "design"))?;
    let mut given = section.limits.clone();
    if purpose == LimitsFor::Log {
        // A log can come from a faster run than the scaled limits permit.
        given.scale = LimitScale::default();
    }
    let with_shapes = settings.floor || (settings.self_collision && given.self_collision.is_none());
    let folder = robot.robot.path.parent().unwrap_or(Path::new(""));
    let shapes = if with_shapes { ShapesOfLinks::of(robot.model(), folder) } else { ShapesOfLinks::default() };
    let mut in_force = LimitsInForce::new(robot.model(), &shapes, &settings, &given, &starts)
        .map_err(Error::section(study.path, "design.limits"))?;
    let iteration = study.iteration.as_ref();
    if let Some(envelope) =
        iteration.and_then(IterationSection::envelope_in_force).filter(|_| purpose != LimitsFor::Log)
    {
        let margin = if purpose == LimitsFor::Search { envelope.search_margin() } else { 0.0 };
        in_force.limits = envelope
            .narrow(in_force.limits, robot.model(), margin)
            .map_err(Error::section(study.path, "iteration.envelope"))?;
        if margin > 0.0 {
            in_force.assumed.push(format!(
                "the motion keeps a margin of {:.0} % of the allowed tracking error inside the iteration's envelope (iteration.envelope.search_margin_percent)",
                100.0 * margin
            ));
        }
    }
    let known = known_torque(robot, core::mem::take(&mut in_force.limits.known_torque));
    let known = prior::with_earlier_torque(&section.prior, robot, folders, known)?;
    in_force.limits.known_torque = match iteration {
        Some(iteration) if iteration.is_outside() && purpose != LimitsFor::Log => {
            let (all, joints) = with_typical(robot, known);
            if !joints.is_empty() {
                in_force.assumed.push(format!(
                    "torque limits include typical friction and drive inertia of geared drives for {}, because theirs are unknown",
                    join_names(&joints)
                ));
            }
            all
        }
        _ => known,
    };
    Ok(in_force)
}

/// The robot model with the payload of the motion.
///
/// # Errors
/// A payload that the study does not define, or whose mass or centre of mass is unknown.
pub(super) fn loaded(study: StudyFile<'_>, robot: &StudyRobot) -> Result<Model, Error> {
    let model = robot.model();
    let Some(name) = study.design.as_ref().and_then(|design| design.payload.as_ref()) else { return Ok(model.clone()) };
    let wrong = Error::section::<StudyError>(study.path, "design");
    let Some(section) = study.payload.iter().find(|payload| payload.name == *name) else {
        let known = study.payload.iter().map(|payload| payload.name.clone()).collect();
        return Err(wrong(StudyError::Unknown { key: "payload", what: "payload", name: name.clone(), known }));
    };
    let Some(known) = section.known() else {
        let fix = "torque limits need a known payload: add mass_kg and com_m to its [[payload]]";
        return Err(wrong(StudyError::conflict(format!("payload = \"{name}\""), fix)));
    };
    let links = model.bodies().iter().enumerate();
    let mut links = links.flat_map(|(body, own)| own.links.iter().map(move |link| (body, link)));
    let Some((body, link)) = links.find(|(_, link)| link.name == section.link) else {
        let known = model.bodies().iter().flat_map(|body| &body.links).map(|link| link.name.clone()).collect();
        let (key, name) = ("payload.link", section.link.clone());
        return Err(wrong(StudyError::Unknown { key, what: "moving link", name, known }));
    };
    if !model.bodies_without_prior().is_empty() {
        return Ok(model.clone());
    }
    let mut inertials = model.inertials().to_vec();
    inertials[body] = inertials[body].plus(&known.expressed_in(&link.placement));
    model.with_inertials(&inertials).map_err(Error::study(study.path))
}

/// Limits of a study's robot for approach and return paths.
///
/// # Errors
/// Same as for [`in_force`].
pub(in crate::jobs) fn limits_of(study: StudyFile<'_>, folders: &Folders, robot: &StudyRobot) -> Result<Limits, Error> {
    Ok(in_force(study, folders, robot, LimitsFor::Ways)?.limits)
}

fn starts(
    section: &DesignSection,
    iteration: Option<&IterationSection>,
    model: &Model,
    purpose: LimitsFor<'_>,
) -> Result<StartPositions, StudyError> {
    let start = match (purpose, &section.start_posture) {
        (LimitsFor::Motion(start), _) => start.iter().copied().map(Some).collect(),
        (LimitsFor::Search | LimitsFor::Ways | LimitsFor::Log, Some(start)) => start.named("start_posture", model)?,
        (LimitsFor::Search | LimitsFor::Ways | LimitsFor::Log, None) => section.start_of_family(),
    };
    let home = iteration.and_then(|own| own.home.as_ref()).map(|home| home.named("home", model)).transpose()?;
    Ok(StartPositions { start, home: home.unwrap_or_default() })
}

/// Limits of a study's robot for the motion that position commands cause. Acceleration, jerk, torque and power are
/// not limited, because the drive limits them.
///
/// # Errors
/// Same as for [`in_force`].
pub(in crate::jobs) fn limits_of_commands(
    study: StudyFile<'_>,
    folders: &Folders,
    robot: &StudyRobot,
) -> Result<LimitsInForce, Error> {
    let mut own = (*study).clone();
    own.design.get_or_insert_default().defaults.acceleration = false;
    let mut found = in_force(study.with_study(&own), folders, robot, LimitsFor::Ways)?;
    for limit in &mut found.limits.joints {
        (limit.acceleration, limit.jerk, limit.torque, limit.power_w) = (None, None, None, None);
    }
    Ok(found)
}

/// The known torque of the robot description and of declared torques with a nominal value.
fn known_torque(robot: &StudyRobot, described: KnownTorque) -> KnownTorque {
    let declared = robot.terms().iter().filter(|term| term.is_declared());
    let valued = declared.filter_map(|term| Some((term, term.described(robot.model())?)));
    valued.fold(described, |known, (term, value)| known.with(term.clone(), value))
}

/// Adds typical friction and drive inertia where they are unknown, and returns the joints with typical values.
fn with_typical(robot: &StudyRobot, known: KnownTorque) -> (KnownTorque, Vec<String>) {
    let Some(typical) = with_typical_drives(&robot.parametric) else { return (known, Vec::new()) };
    let values = &typical[robot.model().inertial_count()..];
    let (mut all, mut joints) = (known, Vec::<String>::new());
    for (term, &value) in robot.terms().iter().zip(values) {
        let Some(joint) = term.own_joint().filter(|_| value != 0.0) else { continue };
        if !is_known(&all, joint, term.property()) {
            let name = &robot.model().joints()[joint].name;
            if joints.last() != Some(name) {
                joints.push(name.clone());
            }
            all = all.with(term.clone(), value);
        }
    }
    joints.dedup();
    (all, joints)
}

fn is_known(known: &KnownTorque, joint: usize, property: Option<JointProperty>) -> bool {
    known.terms().iter().any(|(term, _)| {
        let is_same = match property {
            Some(JointProperty::DriveInertia) => term.is_drive_inertia(),
            Some(JointProperty::Damping | JointProperty::Friction | JointProperty::Stiffness) | None => {
                term.property() == property
            }
        };
        is_same && term.acts_on(joint)
    })
}

/// Note about the torque that the limits include in addition to the rigid bodies; `None` if there is none.
pub(super) fn included(limits: &Limits, model: &Model) -> Option<String> {
    let mut by_kind: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (term, _) in limits.known_torque.terms() {
        let kind = match term {
            TorqueTerm::Declared(own) => format!("declared torque {}", own.name),
            other => format!("{} torque", other.kind_name()),
        };
        let joints = term.joints().into_iter().map(|joint| model.joints()[joint].name.clone());
        by_kind.entry(kind).or_default().extend(joints);
    }
    let parts: Vec<String> =
        by_kind.into_iter().map(|(kind, joints)| format!("{kind} of {}", join_names(&joints))).collect();
    let is_limited = limits.joints.iter().any(|limit| limit.torque.or(limit.power_w).is_some());
    (is_limited && !parts.is_empty())
        .then(|| format!("torque limits include, in addition to the rigid bodies: {}", parts.join("; ")))
}

/// Note about torque that the limits do not include because it is unknown, with the margin of each limit.
pub(super) fn not_included(limits: &Limits, robot: &StudyRobot, reports: &[LimitReport]) -> Vec<String> {
    let model = robot.model();
    let limited: Vec<(usize, &LimitReport)> = reports
        .iter()
        .filter(|report| report.kind == LimitKind::Torque)
        .filter_map(|report| Some((model.joint_index(&report.joint)?, report)))
        .collect();
    let known = &limits.known_torque;
    let has_friction = |joint: usize| known.terms().iter().any(|(term, _)| term.is_friction() && term.acts_on(joint));
    let has_inertia =
        |joint: usize| known.terms().iter().any(|(term, _)| term.is_drive_inertia() && term.acts_on(joint));
    let without = |has: &dyn Fn(usize) -> bool| -> Vec<String> {
        let joints = limited.iter().filter(|(joint, _)| !has(*joint));
        joints
            .map(|(_, report)| {
                let left = 100.0 * (1.0 - report.worst_ratio).clamp(0.0, 1.0);
                format!("{} {left:.0} %", report.joint)
            })
            .collect()
    };
    let mut lines = Vec::new();
    for (what, joints) in [("friction", without(&has_friction)), ("drive inertia", without(&has_inertia))] {
        if !joints.is_empty() {
            lines.push(format!(
                "torque of {what} (unknown); margin of each torque limit at the peak: {}",
                join_names(&joints)
            ));
        }
    }
    let unvalued = robot.terms().iter().filter(|term| {
        let without_value = term.is_declared() && term.described(model).is_none();
        (without_value || matches!(term, TorqueTerm::Coupling(_)))
            && !known
                .terms()
                .iter()
                .any(|(known, _)| known.kind_name() == term.kind_name() && known.symbol() == term.symbol())
    });
    let unvalued: Vec<String> = unvalued.map(TorqueTerm::symbol).collect();
    if !unvalued.is_empty() {
        lines.push(format!("torque of terms without a known value: {}", join_names(&unvalued)));
    }
    lines
}

fn join_names(names: &[String]) -> String {
    const MAX_SHOWN: usize = 8;
    match names.len().checked_sub(MAX_SHOWN) {
        Some(more) if more > 0 => format!("{} and {more} more", names[..MAX_SHOWN].join(", ")),
        _ => names.join(", "),
    }
}
