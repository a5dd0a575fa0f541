//! Points of links, resolved to the model's bodies.

use super::error::LimitError;
use dynident_model::{Model, Transform, Vec3};
use serde::{Deserialize, Serialize};

/// A sphere fixed to a link, usually of radius zero: a point whose place is limited.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LinkPoint {
    /// Name of the link.
    pub link: String,
    /// Position in the link's frame, m.
    #[serde(default)]
    pub at_m: [f64; 3],
    /// Radius of the sphere, m.
    #[serde(default)]
    pub radius_m: f64,
}

/// A point fixed to a body (`None`: the base).
#[derive(Clone, Debug)]
pub(crate) struct BodyPoint {
    pub(crate) body: Option<usize>,
    pub(crate) at: Vec3,
    pub(crate) radius_m: f64,
    pub(crate) name: String,
}

pub(crate) fn link_place(model: &Model, name: &str, what: &str) -> Result<(Option<usize>, Transform), LimitError> {
    let bodies = core::iter::once((None, model.base()))
        .chain(model.bodies().iter().enumerate().map(|(index, body)| (Some(index), body)));
    let mut known = Vec::new();
    for (index, body) in bodies {
        for link in &body.links {
            if link.name == name {
                return Ok((index, link.placement));
            }
            known.push(link.name.clone());
        }
    }
    Err(LimitError::UnknownLink { what: what.to_owned(), link: name.to_owned(), known })
}

/// The points with the bodies they are fixed to; for an empty list the origins of all moving bodies.
pub(crate) fn body_points(model: &Model, points: &[LinkPoint], what: &str) -> Result<Vec<BodyPoint>, LimitError> {
    if points.is_empty() {
        let origins = model.bodies().iter().enumerate().map(|(index, body)| BodyPoint {
            body: Some(index),
            at: Vec3::ZERO,
            radius_m: 0.0,
            name: body.name().to_owned(),
        });
        return Ok(origins.collect());
    }
    let on_body = |point: &LinkPoint| {
        let (body, placement) = link_place(model, &point.link, what)?;
        let name = match point.at_m {
            [0.0, 0.0, 0.0] => point.link.clone(),
            [x, y, z] => format!("{} at ({x}, {y}, {z})", point.link),
        };
        Ok(BodyPoint { body, at: placement.point(Vec3(point.at_m)), radius_m: point.radius_m, name })
    };
    points.iter().map(on_body).collect()
}
