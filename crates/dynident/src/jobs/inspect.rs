//! `inspect`: summary and audit of a robot description.

use crate::error::Error;
use crate::result::{
    AuditEntry, BaseSummary, BodySummary, CorrectionEntry, INSPECTION_SCHEMA, Inspection, JointSummary, SlipEntry,
};
use crate::study::{LoadSettings, load_robot};
use dynident_dynamics::{BaseParameterSettings, BaseParameters, numerical_rank_by_body};
use dynident_model::{
    Body, DescriptionError, DescriptionFormat, InertialParameters, Joint, Model, ReadError, Robot, Slips,
    UrdfIrregularity, audit, rewrite_inertials, slips,
};
use std::path::Path;

/// Information about the robot in addition to its description.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InspectSettings {
    /// Sum of all masses including the base, kg; by default the total in a comment of the file.
    pub total_mass_kg: Option<f64>,
}

/// Reads and audits a robot description.
///
/// # Errors
/// If the description cannot be read.
pub fn inspect(path: &Path) -> Result<Inspection, Error> {
    inspect_with(path, &InspectSettings::default())
}

/// Correction of a robot description.
#[derive(Clone, Debug, PartialEq)]
pub enum CorrectedDescription {
    /// The URDF with all corrections; all other bytes are unchanged.
    Urdf(String),
    /// No mistake with a known correction was found.
    NothingToMend,
    /// The file is a D-H table, MJCF or SDF; only URDF can be corrected.
    NoUrdf,
}

/// Returns a URDF with the corrections that [`inspect_with`] lists.
///
/// # Errors
/// If the description cannot be read.
pub fn mended(path: &Path, settings: &InspectSettings) -> Result<CorrectedDescription, Error> {
    mended_robot(&load_robot(path, &LoadSettings::default())?, settings)
}

/// Like [`mended`] with a robot description in memory.
///
/// # Errors
/// A URDF in which the numbers to correct are ambiguous.
pub fn mended_robot(robot: &Robot, settings: &InspectSettings) -> Result<CorrectedDescription, Error> {
    let Some(slips) = slips_of(robot, settings)? else { return Ok(CorrectedDescription::NoUrdf) };
    if slips.stated == slips.corrected {
        return Ok(CorrectedDescription::NothingToMend);
    }
    rewrite_inertials(&robot.text, &slips.stated, &slips.corrected)
        .map(CorrectedDescription::Urdf)
        .map_err(|error| Error::Result { path: robot.path.clone(), message: error.to_string() })
}

/// Mistakes found in a URDF; `None` for other formats.
fn slips_of(robot: &Robot, settings: &InspectSettings) -> Result<Option<Slips>, Error> {
    if robot.format != DescriptionFormat::Urdf {
        return Ok(None);
    }
    let found = slips(&robot.text, &robot.model, settings.total_mass_kg);
    let fault = |source| ReadError::Urdf { path: robot.path.clone(), source: Box::new(source) };
    Ok(Some(found.map_err(fault)?))
}

/// Like [`inspect`], with additional information about the robot.
///
/// # Errors
/// If the description cannot be read.
pub fn inspect_with(path: &Path, settings: &InspectSettings) -> Result<Inspection, Error> {
    inspect_robot(&load_robot(path, &LoadSettings::default())?, settings)
}

/// Like [`inspect_with`] with a robot description in memory.
///
/// # Errors
/// A URDF in which the numbers to correct are ambiguous.
pub fn inspect_robot(robot: &Robot, settings: &InspectSettings) -> Result<Inspection, Error> {
    let slips = slips_of(robot, settings)?.map_or_else(Vec::new, |slips| slips.found);
    let model = &robot.model;
    Ok(Inspection {
        schema: INSPECTION_SCHEMA.to_owned(),
        name: model.name().to_owned(),
        file: robot.path.display().to_string(),
        dof: model.dof(),
        moving_mass_kg: model.inertials().iter().map(InertialParameters::mass_kg).sum(),
        gravity_m_s2: model.gravity().0,
        joints: joint_summaries(model),
        bodies: body_summaries(model),
        base_parameters: base_summary(model),
        audit: audit_entries(robot),
        slips: slips.iter().map(slip_entry).collect(),
    })
}

fn joint_summaries(model: &Model) -> Vec<JointSummary> {
    let one = |joint: &Joint| JointSummary {
        name: joint.name.clone(),
        kind: joint.kind.name().to_owned(),
        parent: joint.parent.map(|parent| model.bodies()[parent].name().to_owned()),
        lower: joint.limits.lower,
        upper: joint.limits.upper,
        velocity: joint.limits.velocity,
        effort: joint.limits.effort,
        mimic: joint.mimic.as_ref().map(dynident_model::Mimic::source_names),
    };
    model.tree_joints().iter().map(one).collect()
}

fn body_summaries(model: &Model) -> Vec<BodySummary> {
    let one = |body: &Body| {
        let prior = body.prior();
        BodySummary {
            name: body.name().to_owned(),
            mass_kg: prior.map(|prior| prior.mass_kg()),
            com_m: prior.and_then(|prior| prior.com_m()).map(|com| com.0),
            links: body.links.iter().map(|link| link.name.clone()).collect(),
        }
    };
    model.bodies().iter().map(one).collect()
}

/// Base parameters of the rigid bodies, without torque terms.
fn base_summary(model: &Model) -> BaseSummary {
    let settings = BaseParameterSettings::default();
    let base = BaseParameters::new(model, &[], &settings);
    let (weakest, strongest) = base.gap();
    BaseSummary {
        count: base.count(),
        expressions: base.exact_expressions(),
        names: base.expressions(),
        unidentifiable: base.unidentifiable().iter().map(|&column| base.all_columns()[column].symbol()).collect(),
        numerical_rank: numerical_rank_by_body(model, 1, settings.tolerance).independent.len(),
        gap: [weakest, strongest],
    }
}

fn audit_entries(robot: &Robot) -> Vec<AuditEntry> {
    let mut entries: Vec<AuditEntry> = audit(&robot.model)
        .into_iter()
        .map(|finding| AuditEntry {
            level: finding.level.name().to_owned(),
            check: finding.check.to_owned(),
            place: finding.place,
            what: finding.message,
        })
        .collect();
    entries.extend(robot.unread.iter().map(|unread| AuditEntry {
        level: "info".to_owned(),
        check: "not-read".to_owned(),
        place: format!("line {}", unread.line),
        what: format!("<{}> under <{}> was ignored: misspelt or duplicate", unread.element, unread.parent),
    }));
    entries.extend(robot.irregularities.iter().map(irregularity));
    entries.extend(robot.notices.iter().map(|notice| AuditEntry {
        level: notice.loss.level().name().to_owned(),
        check: notice.loss.name().to_owned(),
        place: match &notice.file {
            Some(file) => format!("{file}, line {}", notice.line),
            None => format!("line {}", notice.line),
        },
        what: notice.loss.to_string(),
    }));
    entries.extend(robot.sdf_notices.iter().map(|notice| AuditEntry {
        level: notice.loss.level().name().to_owned(),
        check: notice.loss.name().to_owned(),
        place: format!("line {}", notice.line),
        what: notice.loss.to_string(),
    }));
    entries
}

fn slip_entry(slip: &DescriptionError) -> SlipEntry {
    let corrections = slip.corrections.iter().map(|one| CorrectionEntry {
        link: one.link.clone(),
        number: one.number.to_owned(),
        from: one.from,
        to: one.to,
    });
    SlipEntry {
        slip: slip.kind.name().to_owned(),
        links: slip.links.clone(),
        what: slip.message.clone(),
        evidence: slip.evidence.clone(),
        corrections: corrections.collect(),
    }
}

fn irregularity(found: &UrdfIrregularity) -> AuditEntry {
    let (check, line, what) = match found {
        UrdfIrregularity::UndeclaredPrefix { line, prefix } => (
            "undeclared-prefix",
            line,
            format!(
                "undeclared namespace prefix `{prefix}:` (no xmlns:{prefix}): its names are ignored; strict XML readers reject the file"
            ),
        ),
        UrdfIrregularity::UnknownMimic { line, joint, source_joint } => (
            "unknown-mimic",
            line,
            format!(
                "joint `{joint}` mimics the unknown joint `{source_joint}` and is treated as free: fix the name or delete <mimic>"
            ),
        ),
    };
    AuditEntry { level: "warning".to_owned(), check: check.to_owned(), place: format!("line {line}"), what }
}
