//! Limits that are assumed where neither the study nor the description says anything, and what stays unchecked.
//!
//! Every assumption scales with the machine: lengths with the arm's length, accelerations with its speeds.

mod closer;
mod floor;
mod shapes;
mod turns;
mod words;

pub use shapes::ShapesOfLinks;
pub use turns::StartPositions;

use super::description::{JointLimit, Limits};
use super::error::LimitError;
use super::pairs::arm_length_m;
use super::self_collision_shapes::SelfCollision;
use dynident_model::{Joint, Model};
use serde::{Deserialize, Serialize};
use words::listed;

/// Which limits are assumed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct AssumedLimits {
    /// A floor at the base, for a machine that stands on it. Default true.
    pub floor: bool,
    /// Links keep apart from each other. Default true.
    pub self_collision: bool,
    /// Acceleration of every joint with a velocity limit: full speed after 0.2 rad from rest, or a tenth of the stroke
    /// of a joint that slides. Default true.
    pub acceleration: bool,
    /// What is kept free before each of the description's position stops, percent of the way from the middle of the
    /// range to the stop. Default 5.
    pub stop_margin_percent: f64,
    /// Most convex pieces that the mesh of a collision shape is cut into, where its convex hull is too coarse. Default
    /// 8; 1 keeps the hulls.
    pub mesh_pieces: usize,
    /// Most turns between the start of the motion and any position of a turning joint without position limits. With a
    /// `start_posture` the range has this many turns to either side of it. Without one it has half of them to either
    /// side of home, or of zero. 0 means no limit. Default 1.
    pub continuous_turns: f64,
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
        }
    }
}

impl AssumedLimits {
    /// Nothing is assumed.
    pub fn none() -> Self {
        Self {
            floor: false,
            self_collision: false,
            acceleration: false,
            stop_margin_percent: 0.0,
            continuous_turns: 0.0,
            mesh_pieces: 1,
        }
    }
}

/// All limits of an experiment, and in words what they rest on.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitsInForce {
    /// The description's limits, what is assumed, and the study's over both.
    pub limits: Limits,
    /// What was assumed, and the key that changes it.
    pub assumed: Vec<String>,
    /// What no limit looks at.
    pub not_checked: Vec<String>,
}

/// Least distance of links from each other and from the floor, as a share of the arm's length.
const CLEARANCE: f64 = 0.01;

/// The way on which a turning joint reaches its full speed, rad.
const RUN_UP_RAD: f64 = 0.2;

/// The same for a joint that slides, as a share of its stroke.
const RUN_UP: f64 = 0.1;

impl LimitsInForce {
    /// The description's limits, the assumptions that `settings` asks for, and `given`, whose values win. `starts` are
    /// the positions about which joints without position limits turn.
    ///
    /// # Errors
    /// As [`Limits::validate`] of the shapes and `given`.
    pub fn new(
        model: &Model,
        shapes: &ShapesOfLinks,
        settings: &AssumedLimits,
        given: &Limits,
        starts: &StartPositions,
    ) -> Result<Self, LimitError> {
        let mut under = Limits::from_model(model);
        let (mut assumed, mut not_checked) = (Vec::new(), Vec::new());
        let margin = settings.stop_margin_percent / 100.0;
        if margin > 0.0 && keep_from_stops(&mut under, given, margin) {
            assumed.push(format!(
                "each joint keeps {}% of its half range free before its stops (defaults.stop_margin_percent)",
                settings.stop_margin_percent
            ));
        }
        assumed.extend(turns::bound_turns(&mut under, given, model, settings.continuous_turns, starts));
        if settings.acceleration && bound_accelerations(&mut under, given, model) {
            assumed.push(
                "acceleration: full speed after 0.2 rad from rest, a tenth of the stroke where a joint slides (defaults.acceleration)"
                    .to_owned(),
            );
        }
        let clearance_m = CLEARANCE * arm_length_m(model);
        if settings.floor {
            let over = given.floor.as_ref();
            match floor::assumed_floor(model, shapes, over, clearance_m)? {
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
            let (limit, words) = assumed_self_collision(model, shapes, settings.mesh_pieces, clearance_m)?;
            under.self_collision = Some(limit);
            assumed.push(words);
        }
        let mut limits = under.overlaid(given);
        if let (Some(floor), Some(over)) = (&mut limits.floor, &given.floor)
            && over.points.is_empty()
            && over.shapes.is_empty()
            && settings.floor
        {
            // The study's height for the shapes of all links.
            floor::over_all_shapes(model, shapes, floor)?;
        }
        not_checked.extend(self_collision_gaps(model, shapes, &limits)?);
        not_checked.extend(shapes.dropped.iter().cloned());
        not_checked.extend(joint_gaps(model, &limits));
        not_checked.extend(follower_gaps(model));
        not_checked.push(
            "what the description does not hold: surroundings, cables, a tool or payload, deviation of the controller"
                .to_owned(),
        );
        Ok(Self { limits, assumed, not_checked })
    }
}

/// The distance that links keep from each other, and its description in words.
fn assumed_self_collision(
    model: &Model,
    shapes: &ShapesOfLinks,
    mesh_pieces: usize,
    clearance_m: f64,
) -> Result<(SelfCollision, String), LimitError> {
    let (closer, in_pieces) = if mesh_pieces > 1 && clearance_m > 0.0 {
        shapes.refined(model, clearance_m, mesh_pieces)?
    } else {
        (shapes.shapes.clone(), Vec::new())
    };
    let words = format!(
        "links that are no neighbours keep {clearance_m:.3} m apart, by {} (defaults.self_collision)",
        shapes.in_words(&in_pieces)
    );
    let limit = SelfCollision { clearance_m, shapes: closer, leave_out_touching: true, ..SelfCollision::default() };
    Ok((limit, words))
}

/// Narrows the description's ranges; whether there was one.
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

/// Bounds accelerations by velocities, where neither is given otherwise; whether there was one.
fn bound_accelerations(under: &mut Limits, given: &Limits, model: &Model) -> bool {
    let mut any = false;
    let none = JointLimit::default();
    for (limit, joint) in under.joints.iter_mut().zip(model.joints()) {
        let own = given.of(&limit.joint).unwrap_or(&none);
        let speed = own.speed.or(limit.speed).filter(|speed| *speed > 0.0 && speed.is_finite());
        let range = own.position.or(joint.limits.lower.zip(joint.limits.upper).map(|(lower, upper)| [lower, upper]));
        if let (None, Some(speed), Some(run_up)) = (own.acceleration, speed, run_up(joint, range)) {
            limit.acceleration = Some(speed * speed / (2.0 * run_up));
            any = true;
        }
    }
    any
}

/// The way on which a joint reaches its full speed, rad (m).
fn run_up(joint: &Joint, range: Option<[f64; 2]>) -> Option<f64> {
    if joint.turns() {
        return Some(RUN_UP_RAD);
    }
    range.map(|[lower, upper]| RUN_UP * (upper - lower)).filter(|run_up| *run_up > 0.0)
}

/// What self-collision does not look at.
fn self_collision_gaps(model: &Model, shapes: &ShapesOfLinks, limits: &Limits) -> Result<Vec<String>, LimitError> {
    let Some(limit) = &limits.self_collision else {
        return Ok(vec!["self-collision (no shapes, or defaults.self_collision is off)".to_owned()]);
    };
    let mut gaps = vec!["links that are neighbours, against each other".to_owned()];
    let resolved = limit.resolve(model)?;
    // Complete lists: what is not checked must be known.
    let pairs = |pairs: &[[String; 2]]| pairs.iter().map(|[a, b]| format!("{a} / {b}")).collect::<Vec<_>>().join(", ");
    if !resolved.left_out.is_empty() {
        gaps.push(format!(
            "pairs whose shapes overlap in the neutral posture and in most others: {}",
            pairs(&resolved.left_out)
        ));
    }
    if !resolved.close.is_empty() {
        gaps.push(format!("pairs that run close by each other in every posture: {}", pairs(&resolved.close)));
    }
    if limit.leave_out_touching && !shapes.without.is_empty() {
        gaps.push(format!("links without a collision shape: {}", shapes.without.join(", ")));
    }
    Ok(gaps)
}

/// Joints that follow more joints than a torque term can act on, whose friction, inertia or spring is left out.
fn follower_gaps(model: &Model) -> Option<String> {
    let left_out = |(place, joint): &(usize, &Joint)| {
        let drivers = model.drivers(*place).filter(|(_, share)| *share != 0.0).count();
        let drive =
            [joint.damping, joint.friction, joint.drive_inertia].into_iter().flatten().any(|value| value != 0.0);
        (drivers > 1 && joint.spring.is_some()) || (drivers > 2 && drive)
    };
    let joints: Vec<String> = model.followers().filter(left_out).map(|(_, joint)| joint.name.clone()).collect();
    (!joints.is_empty())
        .then(|| format!("torque of springs and friction at {}, each of which follows several joints", listed(&joints)))
}

/// Joints that something is not limited of.
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
