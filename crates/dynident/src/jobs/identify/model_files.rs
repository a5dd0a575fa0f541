//! The user's robot description with the identified values; additionally a URDF for D-H tables, MJCF and SDF.

use super::joint_values::JointValues;
use crate::result::{FormResult, InputFile, Provenance, ValueSource};
use crate::study::{Study, StudyRobot};
use core::fmt::Write;
use dynident_dynamics::ParametricModel;
use dynident_estimation::HALF_WIDTH_95;
use dynident_identification::Identification;
use dynident_model::mjcf::{MjcfLoss, included_from};
use dynident_model::terms::{JointProperty, TermClass, TorqueTerm};
use dynident_model::{
    Body, DescriptionFormat, INERTIAL_NAMES, InertialParameters, JointChange, LinkChange, Model, Robot, link_changes,
    rewrite_dh, rewrite_mjcf, rewrite_sdf, rewrite_urdf, write_urdf,
};
use std::path::Path;

#[derive(Debug)]
pub(super) struct ModelFiles {
    /// The user's URDF, or one converted from a D-H table, MJCF or SDF.
    pub(super) urdf: String,
    pub(super) table: Option<String>,
    /// The user's MJCF, or the reason why it is missing.
    pub(super) mjcf: Option<Result<String, String>>,
    /// The user's SDF, or the reason why it is missing.
    pub(super) sdf: Option<Result<String, String>>,
}

/// Writes the new values into the user's robot description; locked joints keep their values. A URDF converted from
/// another format has the limits of `study` where the description has none. The error is the reason for a missing
/// description.
pub(super) fn model_files(
    study: &Study,
    robot: &StudyRobot,
    found: &Identification,
    sources: &[[ValueSource; 10]],
) -> Result<ModelFiles, String> {
    let (model, inertials) = (&found.model().parametric, &found.inertials()[..]);
    let (parameters, std) = (&found.consistent.parameters[..], &found.consistent.parameter_std[..]);
    let JointValues { changes: joints, is_refitted } = JointValues::of(found, TermClass::DampingAndFriction);
    let mut links = link_changes(model.model(), inertials).map_err(|error| error.to_string())?;
    note_locked(robot, &mut links);
    let known = BodyNotes { model, parameters, std, sources, is_refitted };
    known.note(lost_in_urdf, &mut links);
    let Robot { model: whole, format, text, .. } = &robot.robot;
    let urdf = |text: &str| rewrite_urdf(text, &links, &joints).map_err(|error| error.to_string());
    let converted = || write_urdf(&whole.clone().with_missing_limits(|joint| study.joint_limits(joint)));
    match format {
        DescriptionFormat::Urdf => Ok(ModelFiles { urdf: urdf(text)?, table: None, mjcf: None, sdf: None }),
        DescriptionFormat::Mjcf => {
            let mjcf = keeping(robot, model.model(), inertials).and_then(|mut links| {
                let JointValues { changes: joints, is_refitted } =
                    JointValues::of(found, TermClass::DampingFrictionAndInertia);
                BodyNotes { is_refitted, ..known }.note(|property| property.is_none(), &mut links);
                let folder = robot.robot.path.parent().unwrap_or(Path::new(""));
                rewrite_mjcf(text, &mut included_from(folder), &links, &joints).map_err(|error| error.to_string())
            });
            Ok(ModelFiles { urdf: urdf(&converted())?, table: None, mjcf: Some(mjcf), sdf: None })
        }
        DescriptionFormat::Sdf => {
            let sdf = keeping(robot, model.model(), inertials).and_then(|mut links| {
                known.note(lost_in_urdf, &mut links);
                rewrite_sdf(text, &links, &with_springs(found, &joints)).map_err(|error| error.to_string())
            });
            Ok(ModelFiles { urdf: urdf(&converted())?, table: None, mjcf: None, sdf: Some(sdf) })
        }
        DescriptionFormat::Dh => {
            let table = rewrite_dh(text, &links, &joints).map_err(|error| error.to_string())?;
            Ok(ModelFiles { urdf: urdf(&converted())?, table: Some(table), mjcf: None, sdf: None })
        }
    }
}

/// The same values with the springs of the joints, which SDF can represent and URDF cannot.
fn with_springs(found: &Identification, joints: &[JointChange]) -> Vec<JointChange> {
    let springs = JointValues::of(found, TermClass::DampingFrictionAndInertia).changes;
    let spring = |joint: &JointChange| springs.iter().find(|own| own.joint == joint.joint)?.stiffness;
    joints.iter().map(|joint| JointChange { stiffness: spring(joint), ..joint.clone() }).collect()
}

/// URDF, SDF and D-H tables cannot express drive inertia.
fn lost_in_urdf(property: Option<JointProperty>) -> bool {
    !matches!(property, Some(JointProperty::Damping | JointProperty::Friction))
}

/// Changes for MJCF and SDF. Links behind locked joints (MJCF) or fixed links (SDF) keep their mass in these formats:
/// MuJoCo rejects a moving body without mass, and SDF assumes 1 kg for a link without mass. The body that carries
/// such links gets the remaining part.
fn keeping(robot: &StudyRobot, model: &Model, inertials: &[InertialParameters]) -> Result<Vec<LinkChange>, String> {
    let is_sdf = robot.robot.format == DescriptionFormat::Sdf;
    let mut rest = inertials.to_vec();
    let mut bodies: Vec<Body> = model.bodies().to_vec();
    let mut kept = Vec::new();
    for (body, rest) in bodies.iter_mut().zip(&mut rest) {
        let own = robot.robot.model.bodies().iter().find(|original| original.name() == body.name());
        let moving = body.name().to_owned();
        let is_own = |name: &str| match own {
            _ if is_sdf => name == moving,
            Some(own) => own.links.iter().any(|link| link.name == name),
            None => true,
        };
        let (own, behind): (Vec<_>, Vec<_>) = body.links.drain(..).partition(|link| is_own(&link.name));
        body.links = own;
        for link in &behind {
            let is_unknown = |loss: &MjcfLoss| matches!(loss, MjcfLoss::UnknownMass { body, .. } if *body == link.name);
            if robot.robot.notices.iter().any(|notice| is_unknown(&notice.loss)) {
                return Err(format!("unknown mass of `{}` behind a locked joint: add an <inertial>", link.name));
            }
            if is_sdf && link.inertial.is_none() {
                let name = &link.name;
                return Err(format!(
                    "the fixed link `{name}` has no mass, for which SDF assumes 1 kg: add an <inertial>"
                ));
            }
            if let Some(inertial) = link.inertial {
                let theirs = inertial.expressed_in(&link.placement);
                *rest = InertialParameters(core::array::from_fn(|k| rest.0[k] - theirs.0[k]));
            }
        }
        let names: Vec<String> = behind.into_iter().map(|link| link.name).collect();
        kept.push(names);
    }
    let reduced = Model::new(model.name(), model.base().clone(), model.tree_joints().to_vec(), bodies);
    let reduced = reduced.map_err(|error| error.to_string())?;
    let mut links = link_changes(&reduced, &rest).map_err(|error| error.to_string())?;
    for (body, kept) in model.bodies().iter().zip(kept).filter(|(_, kept)| !kept.is_empty()) {
        let set = links.iter_mut().find_map(|change| match change {
            LinkChange::Set { link, note, .. } if link == body.name() => Some(note),
            _ => None,
        });
        if let Some(note) = set {
            let what = if is_sdf { "are fixed to it" } else { "are behind locked joints" };
            let text = format!("without links that {what}, which keep their values: {}", kept.join(", "));
            *note = Some(note.take().map_or(text.clone(), |note| format!("{note}; {text}")));
        }
    }
    Ok(links)
}

#[derive(Clone, Copy)]
struct BodyNotes<'a> {
    model: &'a ParametricModel,
    parameters: &'a [f64],
    std: &'a [Option<f64>],
    sources: &'a [[ValueSource; 10]],
    /// Whether damping and friction were fitted again for the file.
    is_refitted: bool,
}

impl BodyNotes<'_> {
    /// Writes the comment of a body: error bar of its mass, identifiable values, and drive values that the file
    /// cannot express or only approximates.
    fn note(&self, lost: fn(Option<JointProperty>) -> bool, changes: &mut [LinkChange]) {
        let Self { model, parameters, std, sources, is_refitted } = self;
        for (index, (body, sources)) in model.model().bodies().iter().zip(*sources).enumerate() {
            let of = |which: ValueSource| -> String {
                let names = (0..10).filter(|&k| sources[k] == which).map(|k| INERTIAL_NAMES[k]);
                let names: Vec<&str> = names.collect();
                if names.is_empty() { "none".to_owned() } else { names.join(" ") }
            };
            let mut text = format!(
                "in the link's frame, identified: {}; identified in sums: {}; not identified, near the original values: {}",
                of(ValueSource::Measured),
                of(ValueSource::Partly),
                of(ValueSource::Nominal)
            );
            if let Some(std) = std[10 * index] {
                let _ = write!(text, "; mass {:.4} kg ± {:.2e} kg (95 %)", parameters[10 * index], HALF_WIDTH_95 * std);
            }
            let terms = model.terms().iter().zip(&parameters[model.model().inertial_count()..]);
            // A coupling of two joints is listed at the first joint.
            let is_here = |term: &TorqueTerm| term.joints().first() == Some(&index);
            let lost = terms.filter(|(term, _)| is_here(term) && lost(term.property()));
            let lost: Vec<String> =
                lost.map(|(term, value)| format!("{} = {value:.4} {}", term.symbol(), term.unit())).collect();
            if !lost.is_empty() {
                let _ = write!(text, "; drive values of this joint that this file cannot express: {}", lost.join(", "));
            }
            if *is_refitted && index < model.dof() {
                let _ = write!(text, "; its damping and friction are fitted to the training logs without these terms");
            }
            let set = changes.iter_mut().find_map(|change| match change {
                LinkChange::Set { link, note, .. } if link == body.name() => Some(note),
                _ => None,
            });
            if let Some(note) = set {
                *note = Some(note.take().map_or(text.clone(), |note| format!("{note}; {text}")));
            }
        }
    }
}

/// Start of the provenance comment in XML and in TOML.
const XML_COMMENT_START: &str = "<!-- dynident ";
const TOML_COMMENT_START: &str = "# dynident ";

impl ModelFiles {
    /// Adds a comment about the origin of the values and the held-out error of the file to each file; it replaces the
    /// comment of an earlier identification.
    pub(super) fn with_provenance(self, provenance: &Provenance, forms: &[FormResult]) -> Self {
        let errors = |class: TermClass| -> String {
            let form = forms.iter().find(|form| form.class == class);
            form.into_iter()
                .flat_map(|form| form.sentences("this file"))
                .fold(String::new(), |all, one| all + ". " + &one)
        };
        let line = provenance_line(provenance, &errors(TermClass::DampingAndFriction));
        let line_of_mjcf = provenance_line(provenance, &errors(TermClass::DampingFrictionAndInertia));
        let table = |text: String| {
            let earlier = text.strip_prefix(TOML_COMMENT_START).and_then(|rest| rest.split_once('\n'));
            let rest = earlier.map_or(&*text, |(_, rest)| rest);
            format!("{TOML_COMMENT_START}{line}\n{}", rest.trim_start_matches('\u{feff}'))
        };
        let mjcf = self.mjcf.map(|text| text.map(|text| commented_xml(&text, &line_of_mjcf)));
        let sdf = self.sdf.map(|text| text.map(|text| commented_xml(&text, &line)));
        Self { urdf: commented_xml(&self.urdf, &line), table: self.table.map(table), mjcf, sdf }
    }
}

/// Adds a comment about the origin of the values after the XML declaration; it replaces the comment of an earlier
/// identification.
fn commented_xml(urdf: &str, line: &str) -> String {
    let comment = format!("{XML_COMMENT_START}{line} -->");
    let declared = urdf.find("<?xml").and_then(|from| urdf[from..].find("?>").map(|length| from + length + 2));
    let mark = if urdf.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    let (head, rest) = urdf.split_at(declared.filter(|_| urdf[mark..].starts_with("<?xml")).unwrap_or(mark));
    let start = rest.trim_start();
    let earlier = start.strip_prefix(XML_COMMENT_START).and_then(|rest| rest.split_once("-->")).map(|(_, rest)| rest);
    let line = if head.len() > mark { "\n" } else { "" };
    match earlier {
        Some(rest) => format!("{head}{line}{comment}{rest}"),
        None => format!("{head}{line}{comment}{}{rest}", if rest.starts_with(['\n', '\r']) { "" } else { "\n" }),
    }
}

/// Origin of the values, in one line that cannot end a comment of XML or TOML.
fn provenance_line(provenance: &Provenance, errors: &str) -> String {
    let robot = provenance.inputs.iter().find(|input| input.what == "robot");
    let named = |input: Option<&InputFile>| input.map_or_else(|| "in memory".to_owned(), |input| input.file.clone());
    let line = format!(
        "{}, identity {}: identified from the study {} and the robot description {}; details in result.json{errors}",
        provenance.version,
        provenance.identity,
        named(provenance.study.as_ref()),
        named(robot)
    );
    // XML is stricter than TOML about comments.
    dynident_text::xml::comment(&line)
}

/// Notes links behind locked joints in a body's comment: the values are only valid while these joints are locked at
/// the same positions.
fn note_locked(robot: &StudyRobot, changes: &mut [LinkChange]) {
    for body in robot.model().bodies() {
        let own = robot.robot.model.bodies().iter().find(|original| original.name() == body.name());
        let behind: Vec<&str> = body
            .links
            .iter()
            .map(|link| &link.name[..])
            .filter(|&name| own.is_some_and(|own| own.links.iter().all(|link| link.name != name)))
            .collect();
        let set = changes.iter_mut().find_map(|change| match change {
            LinkChange::Set { link, note, .. } if link == body.name() => Some(note),
            _ => None,
        });
        if let (Some(note), false) = (set, behind.is_empty()) {
            let locked = format!("valid only with the joints locked that carry: {}", behind.join(", "));
            *note = Some(note.take().map_or(locked.clone(), |note| format!("{note}; {locked}")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_comment_stands_first_and_once() {
        let of = |identity: &str| Provenance { identity: identity.to_owned(), ..Provenance::default() };
        for (urdf, head) in [
            ("<robot name=\"a\"/>", ""),
            ("<?xml version=\"1.0\"?>\n<!-- mine -->\n<robot/>", "<?xml version=\"1.0\"?>\n"),
            ("\u{feff}<?xml version=\"1.0\"?><robot/>", "\u{feff}<?xml version=\"1.0\"?>\n"),
        ] {
            let once = commented_xml(urdf, &provenance_line(&of("one"), ""));
            assert!(once.starts_with(&format!("{head}<!-- dynident ")) && once.contains("identity one"), "{once}");
            let rest = |text: &str| text.split_once("-->").unwrap().1.trim_start().to_owned();
            assert!(urdf.ends_with(&rest(&once)), "{once}");
            let twice = commented_xml(&once, &provenance_line(&of("two"), ""));
            assert_eq!(twice, once.replace("identity one", "identity two"));
        }
    }

    #[test]
    fn a_hostile_name_does_not_end_the_comment() {
        let file = |what: &str| InputFile {
            what: what.to_owned(),
            file: "a-->\n<robot name=\"evil\"/>---".to_owned(),
            bytes: 0,
            sha256: String::new(),
        };
        let provenance =
            Provenance { study: Some(file("study")), inputs: vec![file("robot")], ..Provenance::default() };
        let urdf = commented_xml("<robot name=\"a\"/>", &provenance_line(&provenance, ". On a-->.csv"));
        assert_eq!(roxmltree_names(&urdf), ["a"]);
    }

    /// Names of the elements: a comment that ended early would add one.
    fn roxmltree_names(urdf: &str) -> Vec<String> {
        let inside = urdf.split_once("<!--").unwrap().1;
        let (comment, rest) = inside.split_once("-->").unwrap();
        assert!(!comment.contains("--"), "{comment}");
        rest.split("name=\"").skip(1).map(|part| part.split('"').next().unwrap().to_owned()).collect()
    }
}
