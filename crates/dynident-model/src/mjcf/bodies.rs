//! Builds the tree of moving bodies from nested `<body>` elements.

use super::classes::{ClassId, Classes, MAIN, Stated};
use super::compiler::{Compiler, FromGeoms};
use super::expanded::{Element, Expanded, Place};
use super::fault::{MjcfError, MjcfFault};
use super::floating::{ActuatedNames, free_joint, is_free};
use super::geoms::{Geom, GeomMass, geom};
use super::inertials::{corrected, inertial};
use super::joints::{JointElement, joint, nested_free_joint};
use super::meshes::Meshes;
use super::notices::{MjcfLoss, Notices};
use super::orientation::place;
use super::tree::{LinkPlace, Tree, WORLD};
use crate::collision::{CollisionGeometry, CollisionShape};
use crate::inertial::InertialParameters;
use crate::joint::Joint;
use crate::spatial::{Mat3, Transform, Vec3};
use crate::tree::{Body, Link};
use crate::urdf::MAX_MOVING_JOINTS;
use crate::xml::shortened;
use std::collections::{HashMap, HashSet};

/// Elements of a body that do not influence its dynamics.
const NON_DYNAMIC_ELEMENTS: [&str; 4] = ["site", "camera", "light", "plugin"];
const IN_BODY: [&str; 14] = [
    "name",
    "class",
    "childclass",
    "pos",
    "quat",
    "axisangle",
    "xyaxes",
    "zaxis",
    "euler",
    "mocap",
    "gravcomp",
    "user",
    "sleep",
    "simple",
];
const IN_INERTIAL: [&str; 9] =
    ["pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "mass", "diaginertia", "fullinertia"];
const IN_JOINT: [&str; 25] = [
    "name",
    "class",
    "type",
    "group",
    "pos",
    "axis",
    "springdamper",
    "limited",
    "actuatorfrclimited",
    "solreflimit",
    "solimplimit",
    "solreffriction",
    "solimpfriction",
    "stiffness",
    "range",
    "actuatorfrcrange",
    "actuatorgravcomp",
    "margin",
    "ref",
    "springref",
    "armature",
    "damping",
    "frictionloss",
    "user",
    "align",
];

#[derive(Clone, Copy)]
struct PendingBody<'t> {
    element: &'t Element,
    /// Body of the model that carries the surrounding `<body>`.
    carrier: Option<usize>,
    /// Pose of the surrounding `<body>` or `<frame>` in the carrier.
    carrier_from_parent: Transform,
    childclass: ClassId,
    /// Whether the body is directly in `<worldbody>`.
    is_top: bool,
}

#[derive(Default)]
struct Contents<'t> {
    inertial: Option<InertialParameters>,
    joints: Vec<JointElement>,
    geoms: Vec<Result<Geom, MjcfError>>,
    /// Nested bodies with their surrounding frame and class.
    bodies: Vec<(&'t Element, Transform, ClassId)>,
}

pub(super) struct Reader<'t, 'f> {
    pub(super) document: &'t Expanded,
    pub(super) classes: &'t Classes<'t>,
    pub(super) compiler: &'t Compiler,
    pub(super) meshes: &'t mut Meshes<'f>,
    pub(super) notices: &'t mut Notices,
    body_count: usize,
    body_names: HashSet<String>,
    joint_names: HashSet<String>,
    unknown: HashMap<String, (String, Place)>,
    actuated: ActuatedNames<'t>,
    /// Objects of the scene, which are read only if `settotalmass` includes their masses.
    objects: Vec<PendingBody<'t>>,
    keeps_objects: bool,
}

impl<'t, 'f> Reader<'t, 'f> {
    pub(super) fn new(
        document: &'t Expanded,
        classes: &'t Classes<'t>,
        compiler: &'t Compiler,
        meshes: &'t mut Meshes<'f>,
        notices: &'t mut Notices,
    ) -> Self {
        let body_names = HashSet::from([WORLD.to_owned()]);
        Self {
            document,
            classes,
            compiler,
            meshes,
            notices,
            body_count: 0,
            body_names,
            joint_names: HashSet::new(),
            unknown: HashMap::new(),
            actuated: ActuatedNames::new(document),
            objects: Vec::new(),
            keeps_objects: false,
        }
    }

    /// Visits the bodies depth first, in the order of the document.
    pub(super) fn tree(mut self) -> Result<Tree, MjcfError> {
        let mut tree = Tree::new();
        // A stack avoids recursion, because a chain may be as long as the file.
        let mut ahead: Vec<PendingBody<'t>> = Vec::new();
        for world in self.document.sections("worldbody") {
            let contents = self.contents(world, WORLD, MAIN, true)?;
            tree.base.links[0].collision.extend(shapes(contents.geoms, Vec3::ZERO));
            ahead.extend(contents.bodies.into_iter().map(|(element, carrier_from_parent, childclass)| PendingBody {
                element,
                carrier: None,
                carrier_from_parent,
                childclass,
                is_top: true,
            }));
        }
        ahead.reverse();
        while let Some(next) = ahead.pop() {
            self.visit(next, &mut tree, &mut ahead)?;
        }
        self.set_total_mass(&mut tree)?;
        tree.unknown = self.unknown.into_keys().collect();
        Ok(tree)
    }

    fn visit(
        &mut self,
        next: PendingBody<'t>,
        tree: &mut Tree,
        ahead: &mut Vec<PendingBody<'t>>,
    ) -> Result<(), MjcfError> {
        let PendingBody { element, carrier, carrier_from_parent, childclass, is_top } = next;
        let stated = Stated::own(self.document, element);
        let class = self.classes.named(self.document, element, "childclass")?.unwrap_or(childclass);
        let free = free_joint(self.document, self.classes, element, class)?;
        if free.is_some() && is_top && !self.keeps_objects && self.actuated.is_object(self.document, element) {
            let body = element.attribute("name").map_or("without a name", |name| &name.value);
            self.notices.note(&stated, MjcfLoss::FreeObject { body: shortened(body) });
            tree.dropped.add(self.document, element);
            self.objects.push(next);
            return Ok(());
        }
        let name = self.body_name(element)?;
        if let Some(free) = free {
            self.floating_base(free, &name, &stated, is_top, tree)?;
        }
        self.note_unread(&stated, &IN_BODY);
        if stated.number("gravcomp")?.is_some_and(|part| part != 0.0) {
            self.notices.note(&stated, MjcfLoss::GravityCompensation { body: name.clone() });
        }
        let mut contents = self.contents(element, &name, class, false)?;
        let moves = carrier.is_some() || !contents.joints.is_empty();
        let inertial = self.mass(&name, element, &mut contents, moves)?;

        // Each joint gets a separate body; all but the last are massless.
        let joints = std::mem::take(&mut contents.joints);
        let (mut at, mut origin) = (carrier, Vec3::ZERO);
        let mut placement = carrier_from_parent.then(&place(&stated, self.compiler)?);
        let last = joints.len().checked_sub(1);
        for (number, element) in joints.into_iter().enumerate() {
            let anchor = element.anchor.unwrap_or(origin);
            let frame = Transform { rotation: Mat3::IDENTITY, translation: anchor - origin };
            origin = anchor;
            let (place, reference) = (element.place, element.reference);
            let joint = self.joint(element, at, placement.then(&frame), &name, number)?;
            at = Some(tree.joints.len());
            placement = Transform::IDENTITY;
            let link = if Some(number) == last {
                tree.links.push(LinkPlace { name: name.clone(), body: Some(stated.place), origin });
                Link { name: name.clone(), placement, inertial: None, collision: Vec::new() }
            } else {
                let between = self.free_name(format!("{name}/{}", joint.name));
                tree.links.push(LinkPlace { name: between.clone(), body: None, origin });
                let inertial = Some(InertialParameters::ZERO);
                Link { name: between, placement, inertial, collision: Vec::new() }
            };
            if tree.joints.len() >= MAX_MOVING_JOINTS {
                return Err(self.document.fault(place, MjcfFault::TooManyJoints { limit: MAX_MOVING_JOINTS }));
            }
            tree.joints.push(joint);
            tree.joint_places.push(place);
            tree.references.push(reference);
            tree.bodies.push(Body { links: vec![link] });
        }
        let shift = Transform { rotation: Mat3::IDENTITY, translation: -origin };
        let inertial =
            inertial.map(|inertial| if origin == Vec3::ZERO { inertial } else { inertial.expressed_in(&shift) });
        let collision = shapes(std::mem::take(&mut contents.geoms), origin);
        let host = at.map_or(&mut tree.base, |at| &mut tree.bodies[at]);
        if last.is_some() {
            (host.links[0].inertial, host.links[0].collision) = (inertial, collision);
        } else {
            tree.links.push(LinkPlace { name: name.clone(), body: Some(stated.place), origin });
            host.links.push(Link { name, placement, inertial, collision });
        }
        let carrier_from_body = placement.then(&shift);
        ahead.extend(contents.bodies.into_iter().rev().map(|(element, body_from_frame, childclass)| PendingBody {
            element,
            carrier: at,
            carrier_from_parent: carrier_from_body.then(&body_from_frame),
            childclass,
            is_top: false,
        }));
        Ok(())
    }

    /// Reports a robot that floats; its base is read as fixed.
    fn floating_base(
        &mut self,
        free: &Element,
        body: &str,
        stated: &Stated<'_>,
        is_top: bool,
        tree: &mut Tree,
    ) -> Result<(), MjcfError> {
        let name = free.attribute("name").map(|name| &name.value);
        if !is_top {
            let label = name.map_or_else(|| "without a name".to_owned(), |name| format!("`{}`", shortened(name)));
            return Err(self.document.fault(free.place, nested_free_joint(&label)));
        }
        tree.dropped.joints.extend(name.cloned());
        if !self.keeps_objects {
            self.notices.note(stated, MjcfLoss::FloatingBase { body: shortened(body) });
        }
        Ok(())
    }

    /// Joint at `placement` in its parent; `ref` is the joint position in the pose as drawn.
    fn joint(
        &mut self,
        element: JointElement,
        parent: Option<usize>,
        placement: Transform,
        body: &str,
        number: usize,
    ) -> Result<Joint, MjcfError> {
        let name = if let Some(name) = element.name {
            if !self.joint_names.insert(name.clone()) {
                let fault = MjcfFault::DuplicateName { kind: "joint", name: shortened(&name) };
                return Err(self.document.fault(element.place, fault));
            }
            name
        } else {
            let (mut name, mut count) = (format!("{body}_joint"), number);
            while !self.joint_names.insert(name.clone()) {
                count += 1;
                name = format!("{body}_joint{count}");
            }
            name
        };
        let axis = element.axis;
        let drawn = match (element.reference == 0.0, element.anchor.is_some()) {
            (true, _) => Transform::IDENTITY,
            (false, true) => {
                Transform { rotation: Mat3::from_axis_angle(axis, -element.reference), translation: Vec3::ZERO }
            }
            (false, false) => Transform { rotation: Mat3::IDENTITY, translation: axis.scale(-element.reference) },
        };
        Ok(Joint {
            name,
            kind: element.kind,
            parent,
            placement: placement.then(&drawn),
            axis,
            limits: element.limits,
            damping: element.damping,
            friction: element.friction,
            drive_inertia: element.drive_inertia,
            spring: element.spring,
            mimic: None,
        })
    }

    /// Collects everything in a body, including nested `<frame>` elements.
    fn contents(
        &mut self,
        body: &'t Element,
        name: &str,
        class: ClassId,
        is_world: bool,
    ) -> Result<Contents<'t>, MjcfError> {
        let mut found = Contents::default();
        let children = |element: &'t Element| self.document.children(element).rev();
        let mut ahead: Vec<(&'t Element, Transform, ClassId)> =
            children(body).map(|child| (child, Transform::IDENTITY, class)).collect();
        while let Some((element, frame, class)) = ahead.pop() {
            let unsupported = |what: &str, fix| {
                Err(self.document.fault(element.place, MjcfFault::Unsupported { what: what.to_owned(), fix }))
            };
            match element.tag.as_str() {
                "frame" => {
                    let inside = frame.then(&place(&Stated::own(self.document, element), self.compiler)?);
                    let class = self.classes.named(self.document, element, "childclass")?.unwrap_or(class);
                    ahead.extend(self.document.children(element).rev().map(|child| (child, inside, class)));
                }
                "body" => {
                    found.bodies.push((element, frame, class));
                }
                "geom" => {
                    let stated = self.classes.stated(self.document, element, class)?;
                    found.geoms.push(geom(&stated, &frame, self.compiler, self.meshes));
                }
                "inertial" if is_world => return Err(self.document.fault(element.place, MjcfFault::WorldInertial)),
                "inertial" => {
                    if found.inertial.is_some() {
                        let fault = MjcfFault::RepeatedInertial { body: name.to_owned() };
                        return Err(self.document.fault(element.place, fault));
                    }
                    let stated = Stated::own(self.document, element);
                    found.inertial = Some(inertial(&stated, &frame, self.compiler)?);
                    self.note_unread(&stated, &IN_INERTIAL);
                }
                "joint" | "freejoint" if is_world => {
                    return unsupported("a joint of the world", "put it into the <body> that it moves");
                }
                "joint" => {
                    let stated = self.classes.stated(self.document, element, class)?;
                    if is_free(&stated) {
                        continue;
                    }
                    found.joints.push(joint(&stated, &frame, self.compiler, self.notices)?);
                    self.note_unread(&Stated::own(self.document, element), &IN_JOINT);
                }
                "freejoint" => {}
                "composite" | "flexcomp" | "replicate" | "attach" => {
                    let what = format!("<{}>", element.tag);
                    return unsupported(&what, "save the model from MuJoCo (mj_saveLastXML), which writes it out");
                }
                tag if NON_DYNAMIC_ELEMENTS.contains(&tag) => {}
                tag => {
                    let loss = MjcfLoss::Unread { element: shortened(tag), attribute: None };
                    self.notices.note_at(self.document, element.place, loss);
                }
            }
        }
        Ok(found)
    }

    /// Mass of a body from its `<inertial>` or its geoms, with the corrections of `<compiler>`.
    fn mass(
        &mut self,
        name: &str,
        element: &Element,
        contents: &mut Contents<'_>,
        moves: bool,
    ) -> Result<Option<InertialParameters>, MjcfError> {
        let from_geoms = match self.compiler.from_geoms {
            FromGeoms::Always => true,
            FromGeoms::WhereMissing => contents.inertial.is_none(),
            FromGeoms::Never => false,
        };
        let mut sum: Option<InertialParameters> = None;
        if from_geoms {
            if let Some(faulty) = contents.geoms.iter().position(Result::is_err) {
                contents.geoms.swap_remove(faulty)?;
            }
            // Meshes of a body that does not move are not read: its mass does not affect any torque.
            let is_needed = moves || self.compiler.total_mass.is_some();
            for geom in contents.geoms.iter().flatten() {
                let inertial = match geom.mass {
                    GeomMass::Mesh { .. } if !is_needed => Err("is not needed".to_owned()),
                    ref mass => mass.inertial(self.meshes),
                };
                match inertial {
                    Ok(None) => {}
                    Ok(Some(inertial)) => sum = Some(sum.map_or(inertial, |sum| sum.plus(&inertial))),
                    Err(why) => {
                        if moves {
                            let loss = MjcfLoss::UnknownMass { body: name.to_owned(), why: why.clone() };
                            self.notices.note_at(self.document, element.place, loss);
                        }
                        self.unknown.insert(name.to_owned(), (why, element.place));
                        return Ok(None);
                    }
                }
            }
        }
        Ok(corrected(sum.or(contents.inertial), self.compiler))
    }

    /// Applies `settotalmass`: scales all masses and inertias by one factor. The total includes objects of the scene.
    fn set_total_mass(&mut self, tree: &mut Tree) -> Result<(), MjcfError> {
        let Some(total) = self.compiler.total_mass else { return Ok(()) };
        let (mut scene, mut ahead) = (Tree::new(), std::mem::take(&mut self.objects));
        self.keeps_objects = true;
        while let Some(next) = ahead.pop() {
            self.visit(next, &mut scene, &mut ahead)?;
        }
        if let Some((body, (why, place))) = self.unknown.iter().min_by_key(|(_, (_, place))| (place.source, place.at)) {
            return Err(self.document.fault(*place, MjcfFault::TotalMass { body: body.clone(), why: why.clone() }));
        }
        let all = tree.all_links().chain(scene.all_links());
        let sum: f64 = all.filter_map(|link| link.inertial).map(|inertial| inertial.mass_kg()).sum();
        if sum > 0.0 {
            let factor = total / sum;
            for link in tree.all_links() {
                link.inertial = link.inertial.map(|inertial| InertialParameters(inertial.0.map(|x| x * factor)));
            }
        }
        Ok(())
    }

    fn body_name(&mut self, element: &Element) -> Result<String, MjcfError> {
        self.body_count += 1;
        match element.attribute("name").filter(|name| !name.value.trim().is_empty()) {
            None => Ok(self.free_name(format!("body{}", self.body_count))),
            Some(name) => {
                if !self.body_names.insert(name.value.clone()) {
                    let fault = MjcfFault::DuplicateName { kind: "body", name: shortened(&name.value) };
                    return Err(self.document.fault(element.place, fault));
                }
                Ok(name.value.clone())
            }
        }
    }

    /// Returns `name`, with underscores appended if it is already used.
    fn free_name(&mut self, mut name: String) -> String {
        while !self.body_names.insert(name.clone()) {
            name.push('_');
        }
        name
    }

    fn note_unread(&mut self, stated: &Stated<'_>, known: &[&str]) {
        for attribute in stated.own_attributes().filter(|attribute| !known.contains(&&*attribute.name)) {
            let loss = MjcfLoss::Unread { element: stated.tag.to_owned(), attribute: Some(shortened(&attribute.name)) };
            self.notices.note_at(self.document, attribute.place, loss);
        }
    }
}

/// Shapes of geoms, in a frame with the origin `origin` in the body.
fn shapes(geoms: Vec<Result<Geom, MjcfError>>, origin: Vec3) -> Vec<CollisionShape> {
    let faulty = |error: MjcfError| {
        let geometry = CollisionGeometry::Unsupported { what: error.to_string() };
        Some(CollisionShape { placement: Transform::IDENTITY, geometry })
    };
    let shapes = geoms.into_iter().filter_map(|geom| geom.map_or_else(faulty, |geom| geom.shape));
    shapes
        .map(|mut shape| {
            shape.placement.translation = shape.placement.translation - origin;
            shape
        })
        .collect()
}
