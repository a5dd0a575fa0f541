use super::stop_reason::{EnvelopeQuantity, SampleBreach};
use dynident_dynamics::{Workspace as Arrays, body_placements};
use dynident_model::{Model, Vec3};
use dynident_simulation::{Reference, SimulationError, require};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Largest distance from the axis of a joint on the base at which a point is treated as on the axis, so that the
/// joint does not move it, m.
const MAX_AXIS_DISTANCE_M: f64 = 1e-9;

/// Settings `workspace` of `[iteration.envelope]`: a box in the base frame that no link origin and no tool point may
/// leave. Infinite bounds (default) are inactive. For a floor, set only the lower bound of z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct WorkspaceSettings {
    /// Lowest x, y, z, m.
    pub lower: [f64; 3],
    /// Highest x, y, z, m.
    pub upper: [f64; 3],
    /// An additional point in the frame of the last link, m, for example the tip of a tool.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool: Option<[f64; 3]>,
}

impl Default for WorkspaceSettings {
    fn default() -> Self {
        Self { lower: [f64::NEG_INFINITY; 3], upper: [f64::INFINITY; 3], tool: None }
    }
}

impl WorkspaceSettings {
    /// Returns the box with the watched points of a robot: the origins of all moving links, and the tool.
    ///
    /// # Errors
    /// Bounds that are not numbers or leave no space, a tool that is not finite.
    pub fn of(&self, model: &Model) -> Result<WorkspaceBox, SimulationError> {
        for (low, high) in self.lower.into_iter().zip(self.upper) {
            require(low < high, "envelope.workspace", low, "give lower bounds below the upper ones")?;
        }
        let mut points = Vec::new();
        let mut add = |link: &str, body: usize, offset: Vec3| {
            let joint = &model.tree_joints()[body];
            let away = offset - joint.axis.scale(joint.axis.dot(offset));
            // A point on the axis of a revolute joint on the base does not move.
            if joint.parent.is_some() || !joint.is_rotary() || away.norm() > MAX_AXIS_DISTANCE_M {
                points.push(WatchedPoint {
                    link: link.to_owned(),
                    joint: joint.name.clone(),
                    offset_m: offset.0,
                    body,
                });
            }
        };
        for (body, own) in model.bodies().iter().enumerate() {
            for link in &own.links {
                add(&link.name, body, link.placement.translation);
            }
        }
        if let Some(tool) = self.tool {
            for value in tool {
                require(value.is_finite(), "envelope.workspace.tool", value, "give three numbers, m")?;
            }
            let body = model.body_count() - 1;
            let placement = model.bodies()[body].links.last().map(|link| link.placement);
            add("the tool", body, placement.map_or(Vec3(tool), |placement| placement.point(Vec3(tool))));
        }
        let finite = |values: [f64; 3]| values.map(|value| Some(value).filter(|value| value.is_finite()));
        Ok(WorkspaceBox {
            lower: finite(self.lower),
            upper: finite(self.upper),
            points,
            model: Arc::new(model.clone()),
        })
    }
}

/// A watched point of the robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WatchedPoint {
    /// The link of which the point is the origin, or the tool.
    pub link: String,
    /// The joint that moves the point.
    pub joint: String,
    /// Position of the point in the frame of that joint, m.
    pub offset_m: [f64; 3],
    #[serde(skip)]
    pub(super) body: usize,
}

/// A box in the base frame with the points that must stay inside.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorkspaceBox {
    /// Lowest x, y, z, m; `None` if unbounded.
    pub lower: [Option<f64>; 3],
    /// Highest x, y, z, m; `None` if unbounded.
    pub upper: [Option<f64>; 3],
    /// The watched points.
    pub points: Vec<WatchedPoint>,
    #[serde(skip)]
    model: Arc<Model>,
}

impl WorkspaceBox {
    pub(super) fn arrays(&self) -> Arrays {
        Arrays::new(&self.model)
    }

    /// The first point outside the box at the positions `q`, rad (m), all joints in the model's order.
    pub(super) fn breach(&self, arrays: &mut Arrays, q: &[f64]) -> Option<SampleBreach> {
        let placements = body_placements(&self.model, arrays, q);
        self.points.iter().find_map(|point| {
            let place = placements[point.body].point(Vec3(point.offset_m));
            (0..3).find_map(|axis| {
                let value = place.0[axis];
                let lower = self.lower[axis].filter(|limit| value < *limit);
                let limit = lower.or_else(|| self.upper[axis].filter(|limit| value > *limit))?;
                let quantity = [EnvelopeQuantity::X, EnvelopeQuantity::Y, EnvelopeQuantity::Z][axis];
                Some(SampleBreach { name: point.link.clone(), quantity, value, limit })
            })
        })
    }

    pub(super) fn first_of(&self, q: &[f64], samples: usize) -> Option<(usize, SampleBreach)> {
        let mut arrays = self.arrays();
        let mut at = vec![0.0; self.model.dof()];
        (0..samples).find_map(|sample| {
            at.iter_mut().enumerate().for_each(|(joint, at)| *at = q[joint * samples + sample]);
            self.breach(&mut arrays, &at).map(|breach| (sample, breach))
        })
    }

    /// The first violation by a motion that is followed without tracking error.
    pub(super) fn broken_by(&self, reference: &Reference) -> Option<(usize, SampleBreach)> {
        self.first_of(&reference.motion().q, reference.samples())
    }
}
