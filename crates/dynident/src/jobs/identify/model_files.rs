//! The user's own description with the identified values; of a D-H table or an MJCF a URDF beside it, of an SDF a URDF
//! alone.

use super::joint_values::JointValues;
use crate::result::{InputFile, Provenance, ValueSource};
use crate::study::StudyRobot;
use core::fmt::Write;
use dynident_dynamics::ParametricModel;
use dynident_estimation::HALF_WIDTH_95;
use dynident_identification::Identification;
use dynident_model::mjcf::{Loss, included_from};
use dynident_model::terms::{JointProperty, TermClass};
use dynident_model::{
    Body, DescriptionFormat, INERTIAL_NAMES, InertialParameters, JointChange, LinkChange, Model, Robot, link_changes,
    rewrite_dh, rewrite_mjcf, rewrite_sdf, rewrite_urdf, write_urdf,
};
use std::path::Path;

/// Descriptions with the identified values.
#[derive(Debug)]
pub(super) struct ModelFiles {
    /// The user's own URDF, or one of the robot that a D-H table, an MJCF or an SDF describes.
    pub(super) urdf: String,
    /// The user's own D-H table.
    pub(super) table: Option<String>,
    /// The user's own MJCF, or why there is none.
    pub(super) mjcf: Option<Result<String, String>>,
    /// The user's own SDF, or why there is none.
    pub(super) sdf: Option<Result<String, String>>,
}

/// The user's description with the new values; joints that were locked keep theirs. Otherwise the reason why there is
/// none.
pub(super) fn model_files(
    robot: &StudyRobot,
    found: &Identification,
    sources: &[[ValueSource; 10]],
) -> Result<ModelFiles, String> {
    let (model, inertials) = (&found.model().parametric, &found.inertials()[..]);
    let (parameters, std) = (&found.consistent.parameters[..], &found.consistent.parameter_std[..]);
    let JointValues { changes: joints, is_refitted } = JointValues::of(found, TermClass::DampingAndFriction);
    let mut links = link_changes(model.model(), inertials).map_err(|error| error.to_string())?;
    note_locked(robot, &mut links);
    let known = Known { model, parameters, std, sources, is_refitted };
    known.note(lost_in_urdf, &mut links);
    let Robot { model: whole, format, text, .. } = &robot.robot;
    let urdf = |text: &str| rewrite_urdf(text, &links, &joints).map_err(|error| error.to_string());
    match format {
        DescriptionFormat::Urdf => Ok(ModelFiles { urdf: urdf(text)?, table: None, mjcf: None, sdf: None }),
        DescriptionFormat::Mjcf => {
            let mjcf = keeping(robot, model.model(), inertials).and_then(|mut links| {
                let JointValues { changes: joints, is_refitted } =
                    JointValues::of(found, TermClass::DampingFrictionAndInertia);
                Known { is_refitted, ..known }.note(|property| property.is_none(), &mut links);
                let folder = robot.robot.path.parent().unwrap_or(Path::new(""));
                rewrite_mjcf(text, &mut included_from(folder), &links, &joints).map_err(|error| error.to_string())
            });
            Ok(ModelFiles { urdf: urdf(&write_urdf(whole))?, table: None, mjcf: Some(mjcf), sdf: None })
        }
        DescriptionFormat::Sdf => {
            let sdf = keeping(robot, model.model(), inertials).and_then(|mut links| {
                known.note(lost_in_urdf, &mut links);
                rewrite_sdf(text, &links, &with_springs(found, &joints)).map_err(|error| error.to_string())
            });
            Ok(ModelFiles { urdf: urdf(&write_urdf(whole))?, table: None, mjcf: None, sdf: Some(sdf) })
        }
        DescriptionFormat::Dh => {
            let table = rewrite_dh(text, &links, &joints).map_err(|error| error.to_string())?;
            Ok(ModelFiles { urdf: urdf(&write_urdf(whole))?, table: Some(table), mjcf: None, sdf: None })
        }
    }
}

/// The same with the springs of the joints, which SDF has and URDF has not.
fn with_springs(found: &Identification, joints: &[JointChange]) -> Vec<JointChange> {
    let springs = JointValues::of(found, TermClass::DampingFrictionAndInertia).changes;
    let spring = |joint: &JointChange| springs.iter().find(|own| own.joint == joint.joint)?.stiffness;
    joints.iter().map(|joint| JointChange { stiffness: spring(joint), ..joint.clone() }).collect()
}

/// URDF, SDF and the D-H table have no drive inertia.
fn lost_in_urdf(property: Option<JointProperty>) -> bool {
    !matches!(property, Some(JointProperty::Damping | JointProperty::Friction))
}

/// The changes of an MJCF, in which bodies behind locked joints must keep their mass, for MuJoCo takes no body with a
/// joint and without mass, or of an SDF, in which every fixed link must, for it counts as 1 kg without: the body that
/// carries them gets the rest.
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
            let is_unknown = |loss: &Loss| matches!(loss, Loss::UnknownMass { body, .. } if *body == link.name);
            if robot.robot.notices.iter().any(|notice| is_unknown(&notice.loss)) {
                return Err(format!(
                    "the mass of `{}` behind a locked joint is not known: give it an <inertial>",
                    link.name
                ));
            }
            if is_sdf && link.inertial.is_none() {
                let name = &link.name;
                return Err(format!(
                    "the fixed link `{name}` has no mass, which SDF takes for 1 kg: give it an <inertial>"
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
            let what = if is_sdf { "is fixed to it" } else { "stands behind locked joints" };
            let text = format!("without what {what} and keeps its values: {}", kept.join(", "));
            *note = Some(note.take().map_or(text.clone(), |note| format!("{note}; {text}")));
        }
    }
    Ok(links)
}

/// What the comment of a body states about its values.
#[derive(Clone, Copy)]
struct Known<'a> {
    model: &'a ParametricModel,
    parameters: &'a [f64],
    std: &'a [Option<f64>],
    sources: &'a [[ValueSource; 10]],
    /// Whether damping and friction were fitted again for the file.
    is_refitted: bool,
}

impl Known<'_> {
    /// Says in a body's comment how well its mass is known, which of its values torque told, and what of its joint's
    /// drive the file does not hold or holds as something near to it.
    fn note(&self, lost: fn(Option<JointProperty>) -> bool, changes: &mut [LinkChange]) {
        let Self { model, parameters, std, sources, is_refitted } = self;
        for (index, (body, sources)) in model.model().bodies().iter().zip(*sources).enumerate() {
            let of = |which: ValueSource| -> String {
                let names = (0..10).filter(|&k| sources[k] == which).map(|k| INERTIAL_NAMES[k]);
                let names: Vec<&str> = names.collect();
                if names.is_empty() { "none".to_owned() } else { names.join(" ") }
            };
            let mut text = format!(
                "about the link's frame, measured: {}; partly, in sums with others: {}; not measured, near the description: {}",
                of(ValueSource::Measured),
                of(ValueSource::Partly),
                of(ValueSource::Nominal)
            );
            if let Some(std) = std[10 * index] {
                let _ = write!(text, "; mass {:.4} kg ± {:.2e} kg (95 %)", parameters[10 * index], HALF_WIDTH_95 * std);
            }
            let terms = model.terms().iter().zip(&parameters[model.model().inertial_count()..]);
            let lost = terms.filter(|(term, _)| term.own_joint() == Some(index) && lost(term.property()));
            let lost: Vec<String> =
                lost.map(|(term, value)| format!("{} = {value:.4} {}", term.symbol(), term.unit())).collect();
            if !lost.is_empty() {
                let _ = write!(text, "; of this joint's drive this file does not hold {}", lost.join(", "));
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

/// What the comment of a description that this program has written begins with.
const SIGNATURE: &str = "<!-- dynident ";
const TABLE_SIGNATURE: &str = "# dynident ";

impl ModelFiles {
    /// The same with a comment in each that says where its values come from; that of an earlier identification gives
    /// way.
    pub(super) fn with_provenance(self, provenance: &Provenance) -> Self {
        let line = provenance_line(provenance);
        let table = |text: String| {
            let earlier = text.strip_prefix(TABLE_SIGNATURE).and_then(|rest| rest.split_once('\n'));
            let rest = earlier.map_or(&*text, |(_, rest)| rest);
            format!("{TABLE_SIGNATURE}{line}\n{}", rest.trim_start_matches('\u{feff}'))
        };
        let commented = |text: Result<String, String>| text.map(|text| commented_xml(&text, &line));
        let (mjcf, sdf) = (self.mjcf.map(commented), self.sdf.map(commented));
        Self { urdf: commented_xml(&self.urdf, &line), table: self.table.map(table), mjcf, sdf }
    }
}

/// The description with a comment that says where its values come from, before everything but the XML declaration; that
/// of an earlier identification gives way.
fn commented_xml(urdf: &str, line: &str) -> String {
    let comment = format!("{SIGNATURE}{line} -->");
    let declared = urdf.find("<?xml").and_then(|from| urdf[from..].find("?>").map(|length| from + length + 2));
    let mark = if urdf.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    let (head, rest) = urdf.split_at(declared.filter(|_| urdf[mark..].starts_with("<?xml")).unwrap_or(mark));
    let start = rest.trim_start();
    let earlier = start.strip_prefix(SIGNATURE).and_then(|rest| rest.split_once("-->")).map(|(_, rest)| rest);
    let line = if head.len() > mark { "\n" } else { "" };
    match earlier {
        Some(rest) => format!("{head}{line}{comment}{rest}"),
        None => format!("{head}{line}{comment}{}{rest}", if rest.starts_with(['\n', '\r']) { "" } else { "\n" }),
    }
}

/// Where the values come from, in a line that no comment of XML or TOML ends in.
fn provenance_line(provenance: &Provenance) -> String {
    let robot = provenance.inputs.iter().find(|input| input.what == "robot");
    let named = |input: Option<&InputFile>| input.map_or_else(|| "in memory".to_owned(), |input| input.file.clone());
    let line = format!(
        "{}, identity {}: identified from the study {} and the description {}; result.json has the rest",
        provenance.version,
        provenance.identity,
        named(provenance.study.as_ref()),
        named(robot)
    );
    // One form for both: comments of XML allow less than those of TOML.
    dynident_text::xml::comment(&line)
}

/// Says in a body's comment which of its links are not fixed but stood behind locked joints: its values hold while
/// those stay where they were.
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
            let locked = format!("holds with the joints locked behind which stand: {}", behind.join(", "));
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
            let once = commented_xml(urdf, &provenance_line(&of("one")));
            assert!(once.starts_with(&format!("{head}<!-- dynident ")) && once.contains("identity one"), "{once}");
            let rest = |text: &str| text.split_once("-->").unwrap().1.trim_start().to_owned();
            assert!(urdf.ends_with(&rest(&once)), "{once}");
            let twice = commented_xml(&once, &provenance_line(&of("two")));
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
        let urdf = commented_xml("<robot name=\"a\"/>", &provenance_line(&provenance));
        assert_eq!(roxmltree_names(&urdf), ["a"]);
    }

    /// Names of the elements, by the reader of robots' descriptions: a comment that ended early would add one.
    fn roxmltree_names(urdf: &str) -> Vec<String> {
        let inside = urdf.split_once("<!--").unwrap().1;
        let (comment, rest) = inside.split_once("-->").unwrap();
        assert!(!comment.contains("--"), "{comment}");
        rest.split("name=\"").skip(1).map(|part| part.split('"').next().unwrap().to_owned()).collect()
    }
}
