//! Plots of a design.

use crate::error::Error;
use crate::result::DesignFile;
use dynident_dynamics::{Workspace, body_placements};
use dynident_excitation::Motion;
use dynident_excitation::limits::{JointLimit, Limits};
use dynident_excitation::optimisers::Generation;
use dynident_model::{Model, Vec3};
use dynident_report::{ArmPose, ColumnShape, FitnessPicture, MotionCurve, MotionPicture, PathPicture, Place};

const POSE_COUNT: usize = 9;

/// Maximum number of points of a path, limited by the resolution of the plot.
const MAX_POINTS: usize = 900;

/// Position, velocity, acceleration and, with known inertials, torque of every joint over time, with limits as dashed
/// lines.
///
/// # Errors
/// A motion that cannot be plotted.
pub(crate) fn preview(
    file: &DesignFile,
    limits: &Limits,
    times_s: &[f64],
    motion: &Motion,
    torque: Option<&[f64]>,
) -> Result<String, Error> {
    let title = format!("{}: {}, {}", file.name, file.family, file.criterion);
    let quantities = ["position", "speed", "acceleration", "torque"];
    let shown = if torque.is_some() { 4 } else { 3 };
    let mut picture = MotionPicture::new(&title, times_s, &quantities[..shown]);
    let none = JointLimit::default();
    for (joint, name) in file.joints.iter().enumerate() {
        let limit = limits.of(name).unwrap_or(&none);
        let symmetric = |value: Option<f64>| value.map(|value| [-value, value]);
        let bands = [
            limit.position,
            symmetric(limit.speed),
            symmetric(limit.acceleration),
            symmetric(limit.torque.map(|torque| torque * (1.0 - limit.torque_margin))),
        ];
        let all = [&motion.q[..], &motion.dq, &motion.ddq, torque.unwrap_or_default()];
        let curves = all.into_iter().zip(bands).take(shown);
        let curves = curves.map(|(values, limits)| MotionCurve { values: &values[motion.of(joint)], limits });
        picture = picture.joint(name, curves.collect());
    }
    Ok(picture.svg()?)
}

/// Tool path and some poses of the arm in the base frame, from above and from the side, with floor, column and boxes.
/// The tool is the outermost frame on every last body.
///
/// # Errors
/// A motion that cannot be plotted.
pub(crate) fn path(file: &DesignFile, limits: &Limits, model: &Model, motion: &Motion) -> Result<String, Error> {
    let title = format!("{}: {}, {} s", file.name, file.family, file.duration_s);
    let mut workspace = Workspace::new(model);
    let tools = tools(model);
    let mut places_at = |sample: usize| -> [Vec<Place>; 2] {
        let q: Vec<f64> = (0..motion.joints).map(|joint| motion.q[joint * motion.samples + sample]).collect();
        let placements = body_placements(model, &mut workspace, &q);
        let joints = placements.iter().map(|placement| placement.translation.0);
        [joints.collect(), tools.iter().map(|(body, at)| placements[*body].point(*at).0).collect()]
    };
    let mut paths = vec![Vec::new(); tools.len()];
    let step = motion.samples.div_ceil(MAX_POINTS).max(1);
    for sample in (0..motion.samples).step_by(step).chain(motion.samples.checked_sub(1)) {
        let [_, places] = places_at(sample);
        paths.iter_mut().zip(places).for_each(|(path, place): (&mut Vec<Place>, _)| path.push(place));
    }
    let pose_at = |[joints, tips]: [Vec<Place>; 2]| {
        let from_parent = model.tree_joints().iter().zip(&joints).map(|(joint, place)| (joint.parent, *place));
        let to_tool = tools.iter().zip(tips).map(|((body, _), tip)| (Some(*body), tip));
        let from = |body: Option<usize>| body.map_or([0.0; 3], |body| joints[body]);
        let rods = from_parent.chain(to_tool).map(|(parent, place)| [from(parent), place]).collect();
        ArmPose { rods, joints }
    };
    let last = motion.samples.saturating_sub(1);
    let poses =
        (0..POSE_COUNT).filter(|_| motion.samples > 0).map(|pose| pose_at(places_at(pose * last / (POSE_COUNT - 1))));
    let column = limits.column.as_ref();
    let picture = PathPicture {
        title: &title,
        poses: poses.collect(),
        paths,
        floor_m: limits.floor.as_ref().map(|floor| floor.height_m),
        column: column.map(|column| ColumnShape { axis_xy_m: column.axis_xy_m, radius_m: column.radius_m }),
        boxes: limits.boxes.iter().map(|limit| [limit.x_m, limit.y_m, limit.z_m]).collect(),
    };
    Ok(picture.svg()?)
}

/// Best and mean fitness per generation; `None` for a search without generations.
///
/// # Errors
/// A curve that cannot be plotted.
pub(crate) fn fitness(file: &DesignFile, history: &[Generation]) -> Result<Option<String>, Error> {
    if history.is_empty() {
        return Ok(None);
    }
    let title = format!("{}: {}", file.name, file.optimiser);
    let best: Vec<f64> = history.iter().map(|generation| generation.best).collect();
    let mean: Vec<f64> = history.iter().map(|generation| generation.mean).collect();
    let optimum = file.windowed.as_ref().and_then(|windowed| windowed.optimum);
    Ok(Some(FitnessPicture { title: &title, best: &best, mean: &mean, optimum }.svg()?))
}

/// Every last body of a chain, with the position of its outermost link frame.
fn tools(model: &Model) -> Vec<(usize, Vec3)> {
    let last = |body: &usize| model.tree_joints().iter().all(|joint| joint.parent != Some(*body));
    let farthest = |body: usize| {
        let places = model.bodies()[body].links.iter().map(|link| link.placement.translation);
        let far = places.fold(Vec3::ZERO, |far, place| if place.norm() >= far.norm() { place } else { far });
        (body, far)
    };
    (0..model.body_count()).filter(last).map(farthest).collect()
}
