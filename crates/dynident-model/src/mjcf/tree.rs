//! Joints, bodies and links of an MJCF as they are read.

use super::expanded::Place;
use super::floating::Dropped;
use crate::joint::Joint;
use crate::spatial::{Transform, Vec3};
use crate::tree::{Body, Link};
use std::collections::HashSet;

pub(super) const WORLD: &str = "world";

#[derive(Clone, Debug)]
pub(super) struct LinkPlace {
    pub(super) name: String,
    /// The `<body>` element; `None` for a link between two joints of one body, which has no element.
    pub(super) body: Option<Place>,
    /// Origin of the link's frame in the body's frame, m; the axes are the same.
    pub(super) origin: Vec3,
}

pub(super) struct Tree {
    pub(super) joints: Vec<Joint>,
    /// Elements of the joints, in the same order.
    pub(super) joint_places: Vec<Place>,
    /// Positions in the pose as drawn (`ref`), in the same order, rad or m.
    pub(super) references: Vec<f64>,
    pub(super) bodies: Vec<Body>,
    pub(super) base: Body,
    pub(super) links: Vec<LinkPlace>,
    pub(super) unknown: HashSet<String>,
    /// Objects of the scene that are not part of the robot.
    pub(super) dropped: Dropped,
}

impl Tree {
    pub(super) fn new() -> Self {
        let world =
            Link { name: WORLD.to_owned(), placement: Transform::IDENTITY, inertial: None, collision: Vec::new() };
        Self {
            joints: Vec::new(),
            joint_places: Vec::new(),
            references: Vec::new(),
            bodies: Vec::new(),
            base: Body { links: vec![world] },
            links: Vec::new(),
            unknown: HashSet::new(),
            dropped: Dropped::default(),
        }
    }

    pub(super) fn all_links(&mut self) -> impl Iterator<Item = &mut Link> {
        self.bodies.iter_mut().chain([&mut self.base]).flat_map(|body| &mut body.links)
    }
}
