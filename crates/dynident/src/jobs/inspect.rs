//! What a robot description says, and what is wrong with it.

use crate::error::Error;
use crate::result::{AuditEntry, BaseSummary, BodySummary, INSPECTION_SCHEMA, Inspection, JointSummary};
use dynident_dynamics::{BaseParameterSettings, BaseParameters, numerical_rank_by_body};
use dynident_model::{InertialParameters, UrdfIrregularity, audit, load_robot};
use std::path::Path;

/// Reads and audits a robot description.
///
/// # Errors
/// If the description cannot be read.
pub fn inspect(path: &Path) -> Result<Inspection, Error> {
    let robot = load_robot(path)?;
    let model = &robot.model;
    let settings = BaseParameterSettings::default();
    let base = BaseParameters::new(model, &[], &settings);
    let (weakest, strongest) = base.gap();
    let joints = model.joints().iter().map(|joint| JointSummary {
        name: joint.name.clone(),
        kind: joint.kind.name().to_owned(),
        parent: joint.parent.map(|parent| model.bodies()[parent].name().to_owned()),
        lower: joint.limits.lower,
        upper: joint.limits.upper,
        velocity: joint.limits.velocity,
        effort: joint.limits.effort,
        mimic: joint.mimic.as_ref().map(|mimic| mimic.source.clone()),
    });
    let bodies = model.bodies().iter().map(|body| {
        let prior = body.prior();
        BodySummary {
            name: body.name().to_owned(),
            mass_kg: prior.map(|prior| prior.mass_kg()),
            com_m: prior.and_then(|prior| prior.com_m()).map(|com| com.0),
            links: body.links.iter().map(|link| link.name.clone()).collect(),
        }
    });
    let mut entries: Vec<AuditEntry> = audit(model)
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
        what: format!("<{}> under <{}> was not read: misspelt, or given twice", unread.element, unread.parent),
    }));
    entries.extend(robot.irregularities.iter().map(irregularity));
    Ok(Inspection {
        schema: INSPECTION_SCHEMA.to_owned(),
        name: model.name().to_owned(),
        file: path.display().to_string(),
        dof: model.dof(),
        moving_mass_kg: model.inertials().iter().map(InertialParameters::mass_kg).sum(),
        gravity_m_s2: model.gravity().0,
        joints: joints.collect(),
        bodies: bodies.collect(),
        base_parameters: BaseSummary {
            count: base.count(),
            expressions: base.exact_expressions(),
            unidentifiable: base.unidentifiable().iter().map(|&column| base.all_columns()[column].symbol()).collect(),
            numerical_rank: numerical_rank_by_body(model, 1, settings.tolerance).independent.len(),
            gap: [weakest, strongest],
        },
        audit: entries,
    })
}

fn irregularity(found: &UrdfIrregularity) -> AuditEntry {
    let (check, line, what) = match found {
        UrdfIrregularity::UndeclaredPrefix { line, prefix } => (
            "undeclared-prefix",
            line,
            format!(
                "names begin with `{prefix}:`, which no xmlns:{prefix} declares: they are passed over; strict XML readers refuse the file"
            ),
        ),
        UrdfIrregularity::UnknownMimic { line, joint, source_joint } => (
            "unknown-mimic",
            line,
            format!(
                "joint `{joint}` mimics `{source_joint}`, which is no joint of this robot, and counts as free: fix the name or delete <mimic>"
            ),
        ),
    };
    AuditEntry { level: "warning".to_owned(), check: check.to_owned(), place: format!("line {line}"), what }
}
