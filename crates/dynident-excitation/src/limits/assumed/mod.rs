//! Limits that are assumed where neither the study nor the robot description defines them, and the list of possible
//! violations that are not checked.
//!
//! All assumptions scale with the machine: lengths with the arm's length, accelerations with its speeds.

mod closer;
mod floor;
mod shapes;
mod thresholds;
mod turns;
mod words;

pub use shapes::{CAPSULE_RADIUS_SHARE, ShapesOfLinks};
pub use thresholds::AssumptionThresholds;
pub use turns::StartPositions;

use super::description::{JointLimit, Limits};
use super::error::LimitError;
use super::pairs::arm_length_m;
use super::self_collision_shapes::SelfCollision;
use dynident_model::{Joint, Model};
use serde::{Deserialize, Serialize};
use words::listed;

/// Selection of the assumed limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct AssumedLimits {
    /// Floor below the base, unless the machine hangs or is mounted on a wall. Default true.
    pub floor: bool,
    /// Minimum distance between links. Default true.
    pub self_collision: bool,
    /// Whether the acceleration of every joint with a velocity limit is limited: the joint reaches full speed from
    /// rest within 0.2 rad, or within a tenth of the range of a prismatic joint. Default true.
    pub acceleration: bool,
    /// Margin to each position limit of the robot description, in percent of half the position range. Default 5.
    pub stop_margin_percent: f64,
    /// Maximum number of convex pieces into which the mesh of a collision shape is cut if its convex hull is too
    /// coarse. Default 8; 1 keeps the hulls.
    pub mesh_pieces: usize,
    /// Range, in turns, of a revolute joint without position limits. With a `start_posture` the joint may move by
    /// this number of turns to either side of it, otherwise by half of this number to either side of the home
    /// position, or of zero. 0 means no limit. Default 1.
    pub continuous_turns: f64,
    /// Thresholds of the assumptions; they are not part of study files.
    #[serde(skip)]
    pub thresholds: AssumptionThresholds,
}

impl Default for AssumedLimits {
    fn default() -> Self {
        Self {
            floor: true,
            self_collision: true,
            acceleration: true,
            stop_margin_percent: 5.0,
            continuous_turns: 1.0,
            mesh_pieces: 8,
            thresholds: AssumptionThresholds::default(),
        }
    }
}

impl AssumedLimits {
    /// Assumes nothing.
    pub fn none() -> Self {
        Self {
            floor: false,
            self_collision: false,
            acceleration: false,
            stop_margin_percent: 0.0,
            continuous_turns: 0.0,
            mesh_pieces: 1,
            thresholds: AssumptionThresholds::default(),
        }
    }
}

/// All limits of an experiment, and a description of their origin.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitsInForce {
    /// Limits of the robot description and assumed limits; limits given in the study replace both.
    pub limits: Limits,
    /// Assumptions, each with the key that changes it.
    pub assumed: Vec<String>,
    /// Possible violations that no limit covers.
    pub not_checked: Vec<String>,
}

impl LimitsInForce {
    /// Combines the limits of the robot description, the assumptions that `settings` selects, and the limits `given`,
    /// which have priority. `starts` contains the positions around which joints without position limits may turn.
    ///
    /// # Errors
    /// Errors of [`Limits::validate`] for the shapes and `given`; a threshold out of range.
    pub fn new(
        model: &Model,
        shapes: &ShapesOfLinks,
        settings: &AssumedLimits,
        given: &Limits,
        starts: &StartPositions,
    ) -> Result<Self, LimitError> {
        settings.thresholds.validate()?;
        let mut under = Limits::from_model(model);
        let (mut assumed, mut not_checked) = (Vec::new(), Vec::new());
        let margin = settings.stop_margin_percent / 100.0;
        if margin > 0.0 && keep_from_stops(&mut under, given, margin) {
            assumed.push(format!(
                "each joint keeps a margin of {}% of its half range to its stops (defaults.stop_margin_percent)",
                settings.stop_margin_percent
            ));
        }
        assumed.extend(turns::bound_turns(&mut under, given, model, settings.continuous_turns, starts));
        if settings.acceleration && bound_accelerations(&mut under, given, model, &settings.thresholds) {
            assumed.push(format!(
                "acceleration: full speed within {} rad from rest, or {}% of the stroke of a prismatic joint (defaults.acceleration)",
                settings.thresholds.run_up_rad,
                100.0 * settings.thresholds.run_up_stroke_share
            ));
        }
        given.scale.validate()?;
        assumed.extend(scaled(&mut under, given));
        let clearance_m = settings.thresholds.clearance_share * arm_length_m(model);
        if settings.floor {
            let over = given.floor.as_ref();
            match floor::assumed_floor(model, shapes, over, clearance_m, &settings.thresholds)? {
                Ok((floor, words)) => {
                    under.floor = Some(floor);
                    assumed.extend(words);
                }
                Err(why) if over.is_none() => not_checked.push(format!("floor: {why}")),
                Err(_) => {}
            }
        } else if given.floor.is_none() {
            not_checked.push("floor (defaults.floor is off)".to_owned());
        }
        if settings.self_collision && given.self_collision.is_none() && !shapes.shapes.is_empty() {
            let (limit, words) = assumed_self_collision(model, shapes, settings, clearance_m)?;
            under.self_collision = Some(limit);
            assumed.push(words);
        }
        let mut limits = under.overlaid(given);
        if let (Some(floor), Some(over)) = (&mut limits.floor, &given.floor)
            && over.points.is_empty()
            && over.shapes.is_empty()
            && settings.floor
        {
            // A floor height given in the study applies to the shapes of all links.
            floor::over_all_shapes(model, shapes, floor)?;
        }
        not_checked.extend(self_collision_gaps(model, shapes, &limits)?);
        not_checked.extend(shapes.dropped.iter().cloned());
        not_checked.extend(joint_gaps(model, &limits));
        not_checked.extend(follower_gaps(model));
        not_checked.push(
            "not in the robot description: surroundings, cables, a tool or payload, tracking error of the controller"
                .to_owned(),
        );
        Ok(Self { limits, assumed, not_checked })
    }
}

/// Multiplies limits by the scale of `given`, and states it; `None` for a scale of one.
fn scaled(under: &mut Limits, given: &Limits) -> Option<String> {
    let scale = given.scale;
    (!scale.is_one()).then(|| {
        under.scale_joints(scale);
        format!(
            "limits of the robot description and assumed accelerations are multiplied by {} (speed), {} (acceleration), {} (torque) (limits.scale)",
            scale.speed, scale.acceleration, scale.torque
        )
    })
}

fn assumed_self_collision(
    model: &Model,
    shapes: &ShapesOfLinks,
    settings: &AssumedLimits,
    clearance_m: f64,
) -> Result<(SelfCollision, String), LimitError> {
    let (closer, in_pieces) = if settings.mesh_pieces > 1 && clearance_m > 0.0 {
        shapes.refined(model, clearance_m, settings)?
    } else {
        (shapes.shapes.clone(), Vec::new())
    };
    let words = format!(
        "non-adjacent links keep a distance of {clearance_m:.3} m, with {} (defaults.self_collision)",
        shapes.description(&in_pieces)
    );
    let limit = SelfCollision { clearance_m, shapes: closer, leave_out_touching: true, ..SelfCollision::default() };
    Ok((limit, words))
}

/// Narrows the position ranges by the margin to the limits of the description; returns whether a range was narrowed.
fn keep_from_stops(under: &mut Limits, given: &Limits, margin: f64) -> bool {
    let mut any = false;
    for limit in &mut under.joints {
        if given.of(&limit.joint).is_some_and(|given| given.position.is_some()) {
            continue;
        }
        if let Some([lower, upper]) = &mut limit.position
            && *lower < *upper
        {
            let free = 0.5 * margin * (*upper - *lower);
            (*lower, *upper) = (*lower + free, *upper - free);
            any = true;
        }
    }
    any
}

/// Limits accelerations in proportion to the velocity limits where the study has no acceleration limit; returns
/// whether a limit was added.
fn bound_accelerations(under: &mut Limits, given: &Limits, model: &Model, thresholds: &AssumptionThresholds) -> bool {
    let mut any = false;
    let none = JointLimit::default();
    for (limit, joint) in under.joints.iter_mut().zip(model.joints()) {
        let own = given.of(&limit.joint).unwrap_or(&none);
        let speed = own.speed.or(limit.speed).filter(|speed| *speed > 0.0 && speed.is_finite());
        let range = own.position.or(joint.limits.lower.zip(joint.limits.upper).map(|(lower, upper)| [lower, upper]));
        if let (None, Some(speed), Some(run_up)) = (own.acceleration, speed, run_up(joint, range, thresholds)) {
            limit.acceleration = Some(speed * speed / (2.0 * run_up));
            any = true;
        }
    }
    any
}

/// Distance within which a joint reaches its full speed, rad (m).
fn run_up(joint: &Joint, range: Option<[f64; 2]>, thresholds: &AssumptionThresholds) -> Option<f64> {
    if joint.is_rotary() {
        return Some(thresholds.run_up_rad);
    }
    range.map(|[lower, upper]| thresholds.run_up_stroke_share * (upper - lower)).filter(|run_up| *run_up > 0.0)
}

fn self_collision_gaps(model: &Model, shapes: &ShapesOfLinks, limits: &Limits) -> Result<Vec<String>, LimitError> {
    let Some(limit) = &limits.self_collision else {
        return Ok(vec!["self-collision (no shapes, or defaults.self_collision is off)".to_owned()]);
    };
    let mut gaps = vec!["adjacent links against each other".to_owned()];
    let resolved = limit.resolve(model)?;
    // Complete lists of pairs, because the user must know every pair that is not checked.
    let pairs = |pairs: &[[String; 2]]| pairs.iter().map(|[a, b]| format!("{a} / {b}")).collect::<Vec<_>>().join(", ");
    if !resolved.left_out.is_empty() {
        gaps.push(format!(
            "pairs whose shapes overlap in the neutral posture and in most others: {}",
            pairs(&resolved.left_out)
        ));
    }
    if !resolved.close.is_empty() {
        gaps.push(format!("pairs that are close to each other in every posture: {}", pairs(&resolved.close)));
    }
    if limit.leave_out_touching && !shapes.without.is_empty() {
        gaps.push(format!("links without a collision shape: {}", shapes.without.join(", ")));
    }
    Ok(gaps)
}

/// Joints that follow more joints than a torque term can act on. Their friction, inertia or spring is omitted.
fn follower_gaps(model: &Model) -> Option<String> {
    let left_out = |(place, joint): &(usize, &Joint)| {
        let drivers = model.drivers(*place).filter(|(_, share)| *share != 0.0).count();
        let drive =
            [joint.damping, joint.friction, joint.drive_inertia].into_iter().flatten().any(|value| value != 0.0);
        (drivers > 1 && joint.spring.is_some()) || (drivers > 2 && drive)
    };
    let joints: Vec<String> = model.followers().filter(left_out).map(|(_, joint)| joint.name.clone()).collect();
    (!joints.is_empty())
        .then(|| format!("torque of springs and friction at joints that follow several others: {}", listed(&joints)))
}

fn joint_gaps(model: &Model, limits: &Limits) -> Vec<String> {
    let none = JointLimit::default();
    let lacking = |has: &dyn Fn(&JointLimit) -> bool| -> Vec<String> {
        let joints = model.joints().iter().filter(|joint| !has(limits.of(&joint.name).unwrap_or(&none)));
        joints.map(|joint| joint.name.clone()).collect()
    };
    let mut gaps = Vec::new();
    for (what, joints) in [
        ("position", lacking(&|limit| limit.position.is_some())),
        ("speed", lacking(&|limit| limit.speed.is_some())),
        ("acceleration", lacking(&|limit| limit.acceleration.is_some())),
        ("torque", lacking(&|limit| limit.torque.is_some())),
        ("jerk", lacking(&|limit| limit.jerk.is_some())),
    ] {
        if joints.len() == model.dof() {
            gaps.push(format!("{what} of the joints"));
        } else if !joints.is_empty() {
            gaps.push(format!("{what} of {}", listed(&joints)));
        }
    }
    gaps
}
