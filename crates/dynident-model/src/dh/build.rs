//! Builds the link tree from the keys of a D-H table.

use super::table::{Base, Dynamics, Inertial, Limits, Number, Row, Table};
use super::{DhError, DhFault};
use crate::dh_convention::DhConvention;
use crate::inertial::InertialParameters;
use crate::joint::{Joint, JointKind, JointLimits};
use crate::place::Located;
use crate::spatial::{Mat3, Transform, Vec3};
use crate::tree::{Body, Link, Model, STANDARD_GRAVITY};
use crate::urdf::{MAX_MAGNITUDE, MAX_MOVING_JOINTS};
use std::collections::{HashMap, HashSet};
use toml::Spanned;

/// Builds the model of `table`, read from `text`, and stores the model of the other convention in it.
pub(super) fn model(text: &str, table: &Table) -> Result<Model, DhError> {
    let stated = model_in(text, table, table.convention)?;
    let other = table.convention.other();
    // An error in the other convention is not an error of the table.
    Ok(match model_in(text, table, other) {
        Ok(model) => stated.with_other_convention(other, model),
        Err(_) => stated,
    })
}

/// Builds the model of `table` in the given convention.
fn model_in(text: &str, table: &Table, convention: DhConvention) -> Result<Model, DhError> {
    let source = Source { text };
    let gravity = table.gravity_m_s2.as_ref().map(|gravity| source.finite("gravity_m_s2", gravity)).transpose()?;
    let base_name = match &table.base.link {
        Some(name) => source.name("link", name)?,
        None => "base",
    };
    if table.joints.is_empty() {
        return Err(source.fault(text.len(), DhFault::NoJoint));
    }
    if table.joints.len() > MAX_MOVING_JOINTS {
        let at = table.joints[MAX_MOVING_JOINTS].span().start;
        return Err(source.fault(at, DhFault::TooManyJoints { limit: MAX_MOVING_JOINTS }));
    }

    let mut places: HashMap<String, LinkPlace> = HashMap::new();
    places.insert(base_name.to_owned(), LinkPlace { body: None, body_from_dh: source.base(&table.base)? });
    let mut joint_names = HashSet::new();
    let (mut joints, mut bodies): (Vec<Joint>, Vec<Body>) = (Vec::new(), Vec::new());
    let mut previous = base_name.to_owned();
    for entry in &table.joints {
        let row = entry.get_ref();
        let name = source.name("joint", &row.name)?;
        if !joint_names.insert(name) {
            let fault = DhFault::DuplicateName { what: "joint", name: name.to_owned() };
            return Err(source.fault(row.name.span().start, fault));
        }
        let (link, link_at) = match &row.link {
            Some(link) => (source.name("link", link)?.to_owned(), link.span().start),
            None => (default_link(name), row.name.span().start),
        };
        if places.contains_key(&link) {
            return Err(source.fault(link_at, DhFault::DuplicateName { what: "link", name: link }));
        }
        let parent = source.parent(row, &previous, &places)?;
        let frames = source.frames(convention, row)?;
        joints.push(source.joint(row, name, parent, &frames)?);
        let inertial = row
            .inertial
            .as_ref()
            .map(|inertial| Ok(source.inertial(inertial)?.expressed_in(&frames.body_from_dh)))
            .transpose()?;
        bodies.push(Body {
            links: vec![Link { name: link.clone(), placement: Transform::IDENTITY, inertial, collision: Vec::new() }],
        });
        places.insert(link.clone(), LinkPlace { body: Some(bodies.len() - 1), body_from_dh: frames.body_from_dh });
        previous = link;
    }

    let base_link =
        Link { name: base_name.to_owned(), placement: Transform::IDENTITY, inertial: None, collision: Vec::new() };
    let gravity = gravity.map_or(STANDARD_GRAVITY, Vec3);
    let model = Model::new(&table.name, Body { links: vec![base_link] }, joints, bodies);
    model.and_then(|model| model.with_gravity(gravity)).map_err(|error| source.fault(0, DhFault::Model(error)))
}

#[derive(Clone, Copy)]
struct LinkPlace {
    /// Body that the link belongs to; `None` for the base.
    body: Option<usize>,
    /// D-H frame of the link in the frame of that body.
    body_from_dh: Transform,
}

pub(super) struct RowFrame {
    pub(super) joint: String,
    pub(super) link: String,
    /// D-H frame i in body frame i.
    pub(super) body_from_dh: Transform,
}

/// Names and frames of all rows of a table that [`model`] accepts.
pub(super) fn rows(text: &str, table: &Table) -> Result<Vec<RowFrame>, DhError> {
    let source = Source { text };
    let of = |entry: &Spanned<Row>| {
        let row = entry.get_ref();
        let joint = row.name.get_ref().clone();
        let link = row.link.as_ref().map_or_else(|| default_link(&joint), |link| link.get_ref().clone());
        Ok(RowFrame { joint, link, body_from_dh: source.frames(table.convention, row)?.body_from_dh })
    };
    table.joints.iter().map(of).collect()
}

fn default_link(joint: &str) -> String {
    format!("{joint}_link")
}

struct Frames {
    /// Body frame at position zero, in the parent's D-H frame.
    placement: Transform,
    /// D-H frame i in body frame i.
    body_from_dh: Transform,
}

struct Source<'a> {
    text: &'a str,
}

impl Source<'_> {
    fn fault(&self, at: usize, fault: DhFault) -> DhError {
        Located::at(self.text, at, fault)
    }

    fn name<'n>(&self, what: &'static str, name: &'n Spanned<String>) -> Result<&'n str, DhError> {
        if name.get_ref().trim().is_empty() {
            return Err(self.fault(name.span().start, DhFault::EmptyName { what }));
        }
        Ok(name.get_ref())
    }

    fn number(&self, key: &'static str, number: &Number) -> Result<Option<f64>, DhError> {
        let Some(number) = number else { return Ok(None) };
        let value = *number.get_ref();
        if value.is_finite() && value.abs() <= MAX_MAGNITUDE {
            Ok(Some(value))
        } else {
            Err(self.fault(number.span().start, DhFault::Number { key, value }))
        }
    }

    fn finite<const N: usize>(&self, key: &'static str, numbers: &Spanned<[f64; N]>) -> Result<[f64; N], DhError> {
        match numbers.get_ref().iter().find(|x| !x.is_finite() || x.abs() > MAX_MAGNITUDE) {
            None => Ok(*numbers.get_ref()),
            Some(&value) => Err(self.fault(numbers.span().start, DhFault::Number { key, value })),
        }
    }

    /// Place of a row's parent link; by default, the link of the previous row.
    fn parent(&self, row: &Row, previous: &str, places: &HashMap<String, LinkPlace>) -> Result<LinkPlace, DhError> {
        let parent = row.parent.as_ref().map_or(previous, |parent| parent.get_ref());
        places.get(parent).copied().ok_or_else(|| {
            let mut known: Vec<String> = places.keys().cloned().collect();
            known.sort_unstable();
            known.truncate(20);
            let at = row.parent.as_ref().map_or(0, |parent| parent.span().start);
            self.fault(at, DhFault::UnknownParent { parent: parent.to_owned(), known })
        })
    }

    fn joint(&self, row: &Row, name: &str, parent: LinkPlace, frames: &Frames) -> Result<Joint, DhError> {
        let kind = JointKind::from(row.kind);
        let sign = row.sign.as_ref().map_or(1.0, |sign| *sign.get_ref());
        if sign.abs() != 1.0 {
            let at = row.sign.as_ref().map_or(0, |sign| sign.span().start);
            return Err(self.fault(at, DhFault::Sign { sign }));
        }
        let Dynamics { damping, friction } = &row.dynamics;
        Ok(Joint {
            name: name.to_owned(),
            kind,
            parent: parent.body,
            placement: parent.body_from_dh.then(&frames.placement),
            axis: Vec3([0.0, 0.0, sign]),
            limits: self.limits(kind, &row.limits)?,
            damping: self.number("damping", damping)?,
            friction: self.number("friction", friction)?,
            drive_inertia: None,
            spring: None,
            mimic: None,
        })
    }

    /// Value of a quantity that may be given by one of two keys.
    fn one_of(&self, keys: [&'static str; 2], numbers: [&Number; 2]) -> Result<[Option<f64>; 2], DhError> {
        if let [Some(_), Some(second)] = numbers {
            return Err(self.fault(second.span().start, DhFault::BothUnits { first: keys[0], second: keys[1] }));
        }
        Ok([self.number(keys[0], numbers[0])?, self.number(keys[1], numbers[1])?])
    }

    /// Sine and cosine of an angle in radians or degrees; the angle is 0 if neither key is given.
    fn angle(&self, keys: [&'static str; 2], numbers: [&Number; 2]) -> Result<(f64, f64), DhError> {
        Ok(match self.one_of(keys, numbers)? {
            [_, Some(degrees)] => sin_cos_degrees(degrees),
            [radians, None] => radians.unwrap_or(0.0).sin_cos(),
        })
    }

    fn base(&self, base: &Base) -> Result<Transform, DhError> {
        let translation = match &base.xyz_m {
            Some(xyz) => Vec3(self.finite("xyz_m", xyz)?),
            None => Vec3::ZERO,
        };
        let axes = match (&base.rpy_rad, &base.rpy_deg) {
            (Some(_), Some(degrees)) => {
                let fault = DhFault::BothUnits { first: "rpy_rad", second: "rpy_deg" };
                return Err(self.fault(degrees.span().start, fault));
            }
            (Some(radians), None) => self.finite("rpy_rad", radians)?.map(f64::sin_cos),
            (None, Some(degrees)) => self.finite("rpy_deg", degrees)?.map(sin_cos_degrees),
            (None, None) => return Ok(Transform { rotation: Mat3::IDENTITY, translation }),
        };
        let [roll, pitch, yaw] = axes;
        let about_y = Mat3([[pitch.1, 0.0, pitch.0], [0.0, 1.0, 0.0], [-pitch.0, 0.0, pitch.1]]);
        Ok(Transform {
            rotation: about_z(yaw.0, yaw.1).mul_mat(&about_y).mul_mat(&about_x(roll.0, roll.1)),
            translation,
        })
    }

    fn frames(&self, convention: DhConvention, row: &Row) -> Result<Frames, DhError> {
        let alpha = self.angle(["alpha_rad", "alpha_deg"], [&row.alpha_rad, &row.alpha_deg])?;
        let theta = self.angle(["theta_rad", "theta_deg"], [&row.theta_rad, &row.theta_deg])?;
        let a = self.number("a_m", &row.a_m)?.unwrap_or(0.0);
        let d = self.number("d_m", &row.d_m)?.unwrap_or(0.0);
        let turn_x = Transform { rotation: about_x(alpha.0, alpha.1), translation: Vec3([a, 0.0, 0.0]) };
        let turn_z = Transform { rotation: about_z(theta.0, theta.1), translation: Vec3::ZERO };
        let along_z = Transform { rotation: Mat3::IDENTITY, translation: Vec3([0.0, 0.0, d]) };
        Ok(match convention {
            DhConvention::Modified => {
                Frames { placement: turn_x.then(&along_z).then(&turn_z), body_from_dh: Transform::IDENTITY }
            }
            DhConvention::Standard => Frames { placement: turn_z, body_from_dh: along_z.then(&turn_x) },
        })
    }

    fn limits(&self, kind: JointKind, limits: &Limits) -> Result<JointLimits, DhError> {
        let is_rotary = kind != JointKind::Prismatic;
        let quantity =
            |angle_keys: [&'static str; 2], angles: [&Number; 2], length_key: &'static str, length: &Number| {
                let misfit = if is_rotary {
                    length.as_ref().map(|number| (length_key, number))
                } else {
                    let at = angles.iter().position(|angle| angle.is_some());
                    at.and_then(|at| Some((angle_keys[at], angles[at].as_ref()?)))
                };
                if let Some((key, number)) = misfit {
                    let fix = if is_rotary { "the keys in rad, deg and Nm" } else { "the keys in m and N" };
                    return Err(self.fault(number.span().start, DhFault::WrongUnit { key, kind: kind.name(), fix }));
                }
                if !is_rotary {
                    return self.number(length_key, length);
                }
                let [radians, degrees] = self.one_of(angle_keys, angles)?;
                Ok(radians.or(degrees.map(f64::to_radians)))
            };
        let l = limits;
        Ok(JointLimits {
            lower: quantity(["lower_rad", "lower_deg"], [&l.lower_rad, &l.lower_deg], "lower_m", &l.lower_m)?,
            upper: quantity(["upper_rad", "upper_deg"], [&l.upper_rad, &l.upper_deg], "upper_m", &l.upper_m)?,
            velocity: quantity(
                ["velocity_rad_s", "velocity_deg_s"],
                [&l.velocity_rad_s, &l.velocity_deg_s],
                "velocity_m_s",
                &l.velocity_m_s,
            )?,
            effort: quantity(["effort_nm", "effort_nm"], [&l.effort_nm, &None], "effort_n", &l.effort_n)?,
        })
    }

    fn inertial(&self, inertial: &Spanned<Inertial>) -> Result<InertialParameters, DhError> {
        let Inertial { mass_kg, com_m, inertia_at_com, inertia_at_origin, parameters } = inertial.get_ref();
        let matrix = |[xx, xy, xz, yy, yz, zz]: [f64; 6]| Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
        match (self.number("mass_kg", mass_kg)?, com_m, inertia_at_com, inertia_at_origin, parameters) {
            (Some(mass), Some(com), Some(inertia), None, None) => {
                let com = Vec3(self.finite("com_m", com)?);
                let inertia = matrix(self.finite("inertia_at_com", inertia)?);
                Ok(InertialParameters::from_centre_of_mass(mass, com, &inertia))
            }
            (Some(mass), Some(com), None, Some(inertia), None) => {
                let com = Vec3(self.finite("com_m", com)?);
                let inertia = matrix(self.finite("inertia_at_origin", inertia)?);
                Ok(InertialParameters::from_moments(mass, com.scale(mass), &inertia))
            }
            (None, None, None, None, Some(parameters)) => {
                Ok(InertialParameters(self.finite("parameters", parameters)?))
            }
            _ => Err(self.fault(inertial.span().start, DhFault::Inertial)),
        }
    }
}

/// Sine and cosine of degrees, exact at multiples of 90. Most angles in D-H tables are right angles, and structural
/// zeros of the model depend on exact values.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => degrees.to_radians().sin_cos(),
    }
}

fn about_x(sin: f64, cos: f64) -> Mat3 {
    Mat3([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
}

fn about_z(sin: f64, cos: f64) -> Mat3 {
    Mat3([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
}
