//! The user's own description with the identified values; of a D-H table a URDF beside it.

use crate::result::{InputFile, Provenance, ValueSource};
use crate::study::StudyRobot;
use core::fmt::Write;
use dynident_dynamics::ParametricModel;
use dynident_model::terms::JointProperty;
use dynident_model::{
    DescriptionFormat, INERTIAL_NAMES, InertialParameters, JointChange, LinkChange, Robot, link_changes, rewrite_dh,
    rewrite_urdf, write_urdf,
};

/// Descriptions with the identified values.
#[derive(Debug)]
pub(super) struct ModelFiles {
    /// The user's own URDF, or one of the robot that a D-H table describes.
    pub(super) urdf: String,
    /// The user's own D-H table.
    pub(super) table: Option<String>,
}

/// The user's description with the new values; joints that were locked keep theirs. Otherwise the reason why there is
/// none.
pub(super) fn model_files(
    robot: &StudyRobot,
    model: &ParametricModel,
    (inertials, parameters): (&[InertialParameters], &[f64]),
    sources: &[[ValueSource; 10]],
) -> Result<ModelFiles, String> {
    let mut links = link_changes(model.model(), inertials).map_err(|error| error.to_string())?;
    note_locked(robot, &mut links);
    note_sources(model, parameters, sources, &mut links);
    let mut joints: Vec<JointChange> = Vec::new();
    let terms = model.terms().iter().zip(&parameters[10 * model.model().dof()..]);
    for (term, &value) in terms {
        let (Some(joint), Some(property)) = (term.own_joint(), term.property()) else { continue };
        let (damping, friction) = match property {
            JointProperty::Damping => (Some(value), None),
            JointProperty::Friction => (None, Some(value)),
        };
        let name = &model.model().joints()[joint].name;
        let place = joints.iter().position(|change| change.joint == *name).unwrap_or_else(|| {
            joints.push(JointChange { joint: name.clone(), damping: None, friction: None });
            joints.len() - 1
        });
        joints[place].damping = damping.or(joints[place].damping);
        joints[place].friction = friction.or(joints[place].friction);
    }
    let Robot { model: whole, format, text, .. } = &robot.robot;
    let urdf = |text: &str| rewrite_urdf(text, &links, &joints).map_err(|error| error.to_string());
    match format {
        DescriptionFormat::Urdf => Ok(ModelFiles { urdf: urdf(text)?, table: None }),
        DescriptionFormat::Mjcf => Ok(ModelFiles { urdf: urdf(&write_urdf(whole))?, table: None }),
        DescriptionFormat::Dh => {
            let table = rewrite_dh(text, &links, &joints).map_err(|error| error.to_string())?;
            Ok(ModelFiles { urdf: urdf(&write_urdf(whole))?, table: Some(table) })
        }
    }
}

/// Says in a body's comment which of its values torque told, and what of its joint's drive no URDF holds.
fn note_sources(
    model: &ParametricModel,
    parameters: &[f64],
    sources: &[[ValueSource; 10]],
    changes: &mut [LinkChange],
) {
    for (index, (body, sources)) in model.model().bodies().iter().zip(sources).enumerate() {
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
        let terms = model.terms().iter().zip(&parameters[10 * model.dof()..]);
        let lost = terms.filter(|(term, _)| term.own_joint() == Some(index) && term.property().is_none());
        let lost: Vec<String> =
            lost.map(|(term, value)| format!("{} = {value:.4} {}", term.symbol(), term.unit())).collect();
        if !lost.is_empty() {
            let _ = write!(text, "; of this joint's drive this file does not hold {}", lost.join(", "));
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
        Self { urdf: commented_urdf(&self.urdf, &line), table: self.table.map(table) }
    }
}

/// The description with a comment that says where its values come from, before everything but the XML declaration; that
/// of an earlier identification gives way.
fn commented_urdf(urdf: &str, line: &str) -> String {
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
    let named = |input: Option<&InputFile>| {
        // No comment holds two hyphens in a row, nor a line's end; the second time for what the first one joins.
        input.map_or_else(
            || "in memory".to_owned(),
            |input| input.file.replace("--", "- -").replace("--", "- -").replace(char::is_control, " "),
        )
    };
    format!(
        "{}, identity {}: identified from the study {} and the description {}; result.json has the rest",
        provenance.version,
        provenance.identity,
        named(provenance.study.as_ref()),
        named(robot)
    )
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
            let once = commented_urdf(urdf, &provenance_line(&of("one")));
            assert!(once.starts_with(&format!("{head}<!-- dynident ")) && once.contains("identity one"), "{once}");
            let rest = |text: &str| text.split_once("-->").unwrap().1.trim_start().to_owned();
            assert!(urdf.ends_with(&rest(&once)), "{once}");
            let twice = commented_urdf(&once, &provenance_line(&of("two")));
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
        let urdf = commented_urdf("<robot name=\"a\"/>", &provenance_line(&provenance));
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
