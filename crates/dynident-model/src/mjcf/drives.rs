//! `<actuator>`, `<equality>`, `<tendon>`, `<option>`: effort limits, mimic joints, gravity, and notices of unsupported
//! contents.

use super::chains::Connect;
use super::classes::{Classes, MAIN, Stated};
use super::expanded::{Element, Expanded};
use super::fault::{MjcfError, MjcfFault};
use super::notices::{MjcfLoss, Notices};
use super::tree::{Tree, WORLD};
use crate::joint::Mimic;
use crate::spatial::Vec3;
use crate::tree::STANDARD_GRAVITY;
use crate::xml::shortened;
use std::collections::{HashMap, HashSet};

pub(super) fn gravity(document: &Expanded, notices: &mut Notices) -> Result<Vec3, MjcfError> {
    let (mut gravity, mut is_on) = (STANDARD_GRAVITY, true);
    for option in document.sections("option") {
        let stated = Stated::own(document, option);
        gravity = stated.vector("gravity")?.unwrap_or(gravity);
        let medium = [stated.number("density")?, stated.number("viscosity")?];
        if medium.iter().flatten().any(|&number| number != 0.0) {
            notices.note(&stated, MjcfLoss::Medium);
        }
        for flag in document.children(option).filter(|child| child.tag == "flag") {
            if let Some(word) =
                Stated::own(document, flag).word("gravity", &["enable", "disable"], "enable or disable")?
            {
                is_on = word == "enable";
            }
        }
    }
    Ok(if is_on { gravity } else { Vec3::ZERO })
}

/// Effort limits of joints from their actuators: the sum of the limits of a joint's actuators, if each has a
/// symmetric limit. A smaller limit of the joint itself is kept. Returns the joints that have actuators.
pub(super) fn efforts(
    document: &Expanded,
    classes: &Classes<'_>,
    tree: &mut Tree,
    notices: &mut Notices,
) -> Result<HashSet<String>, MjcfError> {
    let mut sums: HashMap<usize, Option<f64>> = HashMap::new();
    let index: HashMap<String, usize> =
        tree.joints.iter().enumerate().map(|(index, joint)| (joint.name.clone(), index)).collect();
    for element in document.sections("actuator").flat_map(|section| document.children(section)) {
        let Some(name) = ["joint", "jointinparent"].iter().find_map(|key| element.attribute(key)) else { continue };
        let Some(&joint) = index.get(&name.value) else {
            if tree.dropped.joints.contains(&name.value) {
                continue;
            }
            let fault = MjcfFault::UnknownJoint { element: shortened(&element.tag), joint: shortened(&name.value) };
            return Err(document.fault(name.place, fault));
        };
        let stated = classes.stated(document, element, MAIN)?;
        let gear = stated.numbers_between("gear", 1, 6)?.map_or(1.0, |gear| gear[0]);
        let limit = match force(&stated, element)? {
            Some([low, high]) if low == -high && high > 0.0 => Some(high * gear.abs()),
            Some([low, high]) => {
                let joint = format!("`{}`", shortened(&name.value));
                notices.note(&stated, MjcfLoss::OneSidedEffort { joint, low: low * gear, high: high * gear });
                None
            }
            None => None,
        };
        let sum = sums.entry(joint).or_insert(Some(0.0));
        *sum = sum.zip(limit).map(|(sum, limit)| sum + limit);
    }
    let driven = sums.keys().map(|&joint| tree.joints[joint].name.clone()).collect();
    for (joint, sum) in sums {
        let Some(sum) = sum.filter(|sum| sum.is_finite()) else { continue };
        let limits = &mut tree.joints[joint].limits;
        limits.effort = Some(limits.effort.map_or(sum, |own| own.min(sum)));
    }
    Ok(driven)
}

/// Force range of an actuator: `forcerange`, or the control range of a motor, whose control equals its force.
fn force(stated: &Stated<'_>, element: &Element) -> Result<Option<[f64; 2]>, MjcfError> {
    let limited = |range: &str, limited: &str| -> Result<Option<[f64; 2]>, MjcfError> {
        let is_off = stated.flag(limited)? == Some(false);
        Ok(stated.range(range)?.filter(|[low, high]| low < high && !is_off))
    };
    let force = limited("forcerange", "forcelimited")?;
    let is_direct = element.tag == "motor"
        || element.tag == "general"
            && ["gaintype", "gainprm", "biastype", "biasprm", "dyntype", "dynprm"]
                .iter()
                .all(|&key| stated.get(key).is_none());
    let control = if is_direct { limited("ctrlrange", "ctrllimited")? } else { None };
    Ok(match (force, control) {
        (Some([a, b]), Some([c, d])) => Some([a.max(c), b.min(d)]),
        (force, control) => force.or(control),
    })
}

/// Mimic joints, chains that may be closed, and unsupported constraints.
pub(super) fn couplings<'t>(
    document: &'t Expanded,
    tree: &mut Tree,
    notices: &mut Notices,
) -> Result<Vec<Connect<'t>>, MjcfError> {
    let mut connects = Vec::new();
    for element in document.sections("equality").flat_map(|section| document.children(section)) {
        let stated = Stated::own(document, element);
        if stated.get("active").is_some_and(|active| active.value == "false") {
            continue;
        }
        let is_dropped =
            |key: &str, names: &HashSet<String>| element.attribute(key).is_some_and(|name| names.contains(&name.value));
        let bodies = ["body1", "body2"].map(|key| is_dropped(key, &tree.dropped.bodies));
        let joints = ["joint1", "joint2"].map(|key| is_dropped(key, &tree.dropped.joints));
        // A constraint between an object and the robot is kept, because it applies forces to the robot.
        let has_second = element.attribute("body2").is_some_and(|name| name.value != WORLD);
        if joints.contains(&true) || bodies == [true, true] || bodies[0] && !has_second {
            continue;
        }
        let named = |key: &str| element.attribute(key).map(|name| format!("`{}`", shortened(&name.value)));
        let keys = ["joint1", "joint2", "body1", "body2", "site1", "site2", "tendon1", "tendon2", "flex"];
        let between: Vec<String> = keys.iter().filter_map(|key| named(key)).collect();
        let constraint = || MjcfLoss::Constraint { element: shortened(&element.tag), between: between.join(" and ") };
        if let ("connect", Some(body), Some(anchor)) =
            (&*element.tag, element.attribute("body1"), stated.vector("anchor")?)
        {
            let second = element.attribute("body2").map_or(WORLD, |name| &name.value);
            connects.push(Connect { stated, bodies: [body.value.clone(), second.to_owned()], anchor });
            continue;
        }
        if element.tag != "joint" {
            notices.note(&stated, constraint());
            continue;
        }
        let find = |key: &str| -> Result<Option<usize>, MjcfError> {
            let Some(name) = element.attribute(key) else { return Ok(None) };
            let unknown = || MjcfFault::UnknownJoint { element: "joint".to_owned(), joint: shortened(&name.value) };
            let index = tree.joints.iter().position(|joint| joint.name == name.value);
            index.map(Some).ok_or_else(|| document.fault(name.place, unknown()))
        };
        let missing = || MjcfFault::MissingAttribute { element: "joint".to_owned(), attribute: "joint1" };
        let follower = find("joint1")?.ok_or_else(|| stated.fault(missing()))?;
        let Some(source) = find("joint2")? else {
            notices.note(&stated, constraint());
            continue;
        };
        let mut law = stated.numbers_between("polycoef", 1, 5)?.unwrap_or_default();
        let given = law.len();
        law.extend_from_slice(&[0.0, 1.0, 0.0, 0.0, 0.0][given..]);
        if law[2..].iter().any(|&number| number != 0.0) {
            notices.note(&stated, MjcfLoss::CouplingPolynomial { joint: tree.joints[follower].name.clone() });
            continue;
        }
        // MuJoCo relates the distances from `ref`: q1 - ref1 = c0 + c1 (q2 - ref2).
        let offset = tree.references[follower] + law[0] - law[1] * tree.references[source];
        let mimic = Mimic::of(&tree.joints[source].name, law[1], offset);
        tree.joints[follower].mimic = Some(mimic);
    }
    Ok(connects)
}

/// Reports tendons with a spring, damping, friction or inertia.
pub(super) fn tendons(document: &Expanded, notices: &mut Notices) -> Result<(), MjcfError> {
    for element in document.sections("tendon").flat_map(|section| document.children(section)) {
        let stated = Stated::own(document, element);
        let mut acts = false;
        for key in ["stiffness", "damping", "frictionloss", "armature"] {
            let numbers = stated.numbers_between(key, 0, 10)?.unwrap_or_default();
            acts |= numbers.iter().any(|&number| number != 0.0);
        }
        if acts {
            let name = element
                .attribute("name")
                .map_or("without a name".to_owned(), |name| format!("`{}`", shortened(&name.value)));
            notices.note(&stated, MjcfLoss::Tendon { tendon: name });
        }
    }
    Ok(())
}
