//! Closed chains that are parallelograms, as in palletising arms: finds the linear law by which the passive joints
//! follow the active ones (mimic law).
//!
//! A robot description is a tree, so every loop is cut at one point of two links, with `p_1(q) = p_2(q)`. In a
//! parallelogram the passive joints follow linearly, `q_p = C q_a + c`, with the same `C` in every posture. `C =
//! -J_p⁺ J_a` with the Jacobians of the gap `p_1 - p_2` (Khalil and Dombre, *Modeling, Identification and Control of
//! Robots*, 2004, section 7.3). [`followers`] computes `C` and `c`, and rejects other loops.

use crate::joint::{Mimic, MimicSource};
use crate::sample::Random;
use crate::spatial::{Transform, Vec3};
use crate::tree::Model;
use nalgebra::{DMatrix, DVector};
use thiserror::Error;

/// Largest accepted gap of a closed loop relative to its size: lengths in descriptions have at least seven digits.
const GAP_TOLERANCE: f64 = 1e-6;
/// Number of random postures that are tested; their range about zero, rad (a fifth of the number in metres).
const POSTURE_COUNT: usize = 50;
const POSTURE_RANGE_RAD: f64 = 1.5;
/// Maximum number of Newton iterations from the description's zero position.
const NEWTON_STEPS: usize = 30;
/// Multipliers within this distance of an integer are rounded to it: parallelograms have integer multipliers.
const INTEGER_TOLERANCE: f64 = 1e-7;

/// The cut of a loop: a point of one link that coincides with a point of another.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopClosure {
    /// The two links.
    pub links: [String; 2],
    /// The points in the frames of the links, m.
    pub points_m: [[f64; 3]; 2],
    /// Joints of the tree that have no drive and that the loop moves.
    pub passive: Vec<String>,
}

/// Why the mimic law of passive joints could not be computed.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum LoopError {
    /// `links` of a `[[robot.loop]]` names a link that the robot description does not have. Correct the name.
    #[error("there is no link `{link}`, which closes a loop: fix its name")]
    UnknownLink { link: String },
    /// `passive` of a `[[robot.loop]]` names a joint that the robot does not have. Use one of the listed names.
    #[error("there is no joint `{joint}`; the joints are: {}", known.join(", "))]
    UnknownJoint { joint: String, known: Vec<String> },
    /// `points_m` states where the two links of the loop meet. One of its numbers is NaN or infinite.
    #[error("points_m of the loop at `{link}`: give finite numbers, m")]
    NotFinite { link: String },
    /// The two links of a `[[robot.loop]]` do not meet at `points_m` at any position of the passive joints. Correct
    /// `links`, `points_m` or `passive`.
    #[error(
        "the loop between `{first}` and `{second}` does not close: with the other joints at zero its gap is at least {gap_m:.3e} m; check links, points_m and which joints are passive"
    )]
    Open { first: String, second: String, gap_m: f64 },
    /// A joint in `passive` moves freely although the loop is closed, because it is not part of a loop. Remove it from
    /// `passive`.
    #[error("the loops do not determine the passive joints {}: name only joints of a loop", joints.join(", "))]
    Undetermined { joints: Vec<String> },
    /// Dynident supports closed chains that are parallelograms. This one is not: delete the `[[robot.loop]]`, so that
    /// all its joints are independent.
    #[error(
        "the loop between `{first}` and `{second}` is not a parallelogram: passive joints that follow linearly give a gap of {gap_m:.3e} m; delete this [[robot.loop]]"
    )]
    NotLinear { first: String, second: String, gap_m: f64 },
}

/// Returns the mimic laws of the passive joints, for [`Model::with_followers`]. They replace existing mimic laws of
/// passive joints; laws of other joints are kept.
///
/// # Errors
/// Unknown names, a loop that does not close or is not a parallelogram, or passive joints that the loops do not
/// determine.
pub fn followers(model: &Model, loops: &[LoopClosure]) -> Result<Vec<(String, Mimic)>, LoopError> {
    let loops = Loops::of(model, loops)?;
    if loops.passive.is_empty() {
        return Ok(Vec::new());
    }
    let q = loops.closed()?;
    let law = loops.law(&q)?;
    loops.check(&law, q)?;
    Ok(loops.mimics(&law))
}

struct Loops<'a> {
    model: &'a Model,
    cuts: Vec<Cut>,
    passive: Vec<usize>,
    active: Vec<usize>,
}

struct Law {
    /// Matrix `C`: one row per passive joint, one column per active joint.
    multipliers: DMatrix<f64>,
    offsets: Vec<f64>,
}

impl<'a> Loops<'a> {
    fn of(model: &'a Model, loops: &[LoopClosure]) -> Result<Self, LoopError> {
        let tree = model.tree_joints();
        let known = || tree.iter().map(|joint| joint.name.clone()).collect();
        let place = |name: &String| {
            let found = tree.iter().position(|joint| joint.name == *name);
            found.ok_or_else(|| LoopError::UnknownJoint { joint: name.clone(), known: known() })
        };
        let mut passive = loops.iter().flat_map(|one| &one.passive).map(place).collect::<Result<Vec<usize>, _>>()?;
        passive.sort_unstable();
        passive.dedup();
        let cuts = loops.iter().map(|one| Cut::of(model, one)).collect::<Result<Vec<Cut>, _>>()?;
        // Only joints that move the points of a loop can be sources.
        let on_loop = |joint: usize| cuts.iter().any(|cut| cut.ends.iter().any(|(path, _)| path.contains(&joint)));
        let active = (0..tree.len()).filter(|joint| !passive.contains(joint) && on_loop(*joint)).collect();
        Ok(Self { model, cuts, passive, active })
    }

    /// Positions near the zero position of the robot description that close all loops.
    fn closed(&self) -> Result<Vec<f64>, LoopError> {
        let Self { model, cuts, passive, .. } = self;
        let mut q = vec![0.0; model.tree_joints().len()];
        for _ in 0..NEWTON_STEPS {
            let (gap, jacobian) = (gaps(model, cuts, &q), jacobian(model, cuts, &q, passive));
            let Ok(step) = jacobian.svd(true, true).solve(&gap, 1e-9) else { break };
            for (&joint, step) in passive.iter().zip(step.iter()) {
                q[joint] -= step;
            }
        }
        let (gap_m, cut) = worst(model, cuts, &q);
        if gap_m.is_nan() || gap_m > GAP_TOLERANCE * cut.size_m {
            let [first, second] = cut.links.clone();
            return Err(LoopError::Open { first, second, gap_m });
        }
        Ok(q)
    }

    /// Law `C`, `c` from the Jacobians at positions that close the loops.
    fn law(&self, q: &[f64]) -> Result<Law, LoopError> {
        let Self { model, cuts, passive, active } = self;
        let of_passive = jacobian(model, cuts, q, passive).svd(true, true);
        let largest = of_passive.singular_values.max();
        if of_passive.rank(1e-6 * largest) < passive.len() {
            let joints = passive.iter().map(|&joint| model.tree_joints()[joint].name.clone()).collect();
            return Err(LoopError::Undetermined { joints });
        }
        let of_active = jacobian(model, cuts, q, active);
        let solved = of_passive.solve(&of_active, 1e-9 * largest).unwrap_or_else(|_| of_active.map(|_| f64::NAN));
        let whole = |x: f64| if (x - x.round()).abs() < INTEGER_TOLERANCE { x.round() + 0.0 } else { x };
        let offsets = passive.iter().map(|&joint| whole(q[joint])).collect();
        Ok(Law { multipliers: (-solved).map(whole), offsets })
    }

    /// Checks that the law closes all loops in random postures, starting from `q`.
    fn check(&self, law: &Law, mut q: Vec<f64>) -> Result<(), LoopError> {
        let Self { model, cuts, passive, active } = self;
        let mut random = Random::new(1);
        for _ in 0..POSTURE_COUNT {
            for &joint in active {
                let reach =
                    if model.tree_joints()[joint].is_rotary() { POSTURE_RANGE_RAD } else { 0.2 * POSTURE_RANGE_RAD };
                q[joint] = random.uniform(-reach, reach);
            }
            for (row, &joint) in passive.iter().enumerate() {
                let followed = active.iter().enumerate();
                let followed = followed.map(|(column, &source)| law.multipliers[(row, column)] * q[source]);
                q[joint] = law.offsets[row] + followed.sum::<f64>();
            }
            let (gap_m, cut) = worst(model, cuts, &q);
            // The multipliers are only as exact as the lengths of the description, and postures far from zero amplify
            // their errors.
            if gap_m.is_nan() || gap_m > 10.0 * GAP_TOLERANCE * cut.size_m {
                let [first, second] = cut.links.clone();
                return Err(LoopError::NotLinear { first, second, gap_m });
            }
        }
        Ok(())
    }

    fn mimics(&self, law: &Law) -> Vec<(String, Mimic)> {
        let tree = self.model.tree_joints();
        let follower = |(row, &joint): (usize, &usize)| {
            let source = |(column, &source): (usize, &usize)| {
                let multiplier = law.multipliers[(row, column)];
                (multiplier != 0.0).then(|| MimicSource { joint: tree[source].name.clone(), multiplier })
            };
            let sources = self.active.iter().enumerate().filter_map(source).collect();
            (tree[joint].name.clone(), Mimic { sources, offset: law.offsets[row] })
        };
        self.passive.iter().enumerate().map(follower).collect()
    }
}

/// Tree joints on the path to a link, and the pose of the link in the frame of the last joint's body, or in the base
/// frame if the path is empty.
pub(crate) fn path_to(model: &Model, link: &str) -> Option<(Vec<usize>, Transform)> {
    let bodies = model.bodies().iter().enumerate().map(|(body, of)| (Some(body), of));
    let mut all = core::iter::once((None, model.base())).chain(bodies);
    let (body, own) = all.find_map(|(body, of)| Some((body, of.links.iter().find(|own| own.name == *link)?)))?;
    Some((body.map_or_else(Vec::new, |body| model.path(body)), own.placement))
}

struct Cut {
    links: [String; 2],
    /// Both ends of the cut: tree joints on the path to it, and the point in the frame of the last joint's body (or
    /// of the base).
    ends: [(Vec<usize>, Vec3); 2],
    size_m: f64,
}

impl Cut {
    fn of(model: &Model, closure: &LoopClosure) -> Result<Self, LoopError> {
        let end = |k: usize| {
            let link = &closure.links[k];
            if closure.points_m[k].iter().any(|x| !x.is_finite()) {
                return Err(LoopError::NotFinite { link: link.clone() });
            }
            let (path, placement) =
                path_to(model, link).ok_or_else(|| LoopError::UnknownLink { link: link.clone() })?;
            Ok((path, placement.point(Vec3(closure.points_m[k]))))
        };
        let ends = [end(0)?, end(1)?];
        let length = |(path, point): &(Vec<usize>, Vec3)| {
            point.norm()
                + path.iter().map(|&joint| model.tree_joints()[joint].placement.translation.norm()).sum::<f64>()
        };
        let size_m = ends.iter().map(length).fold(f64::MIN_POSITIVE, f64::max);
        Ok(Self { links: closure.links.clone(), ends, size_m })
    }

    /// Position of an end in the base frame, and the pose of every joint on the path.
    fn end(&self, model: &Model, k: usize, q: &[f64]) -> (Vec3, Vec<(usize, Transform)>) {
        let (path, point) = &self.ends[k];
        let mut placement = Transform::IDENTITY;
        let mut joints = Vec::with_capacity(path.len());
        for &joint in path {
            placement = placement.then(&model.tree_joints()[joint].transform(q[joint]));
            joints.push((joint, placement));
        }
        (placement.point(*point), joints)
    }
}

/// Gaps `p_1 - p_2` of all loops, m.
fn gaps(model: &Model, cuts: &[Cut], q: &[f64]) -> DVector<f64> {
    let gap = |cut: &Cut| cut.end(model, 0, q).0 - cut.end(model, 1, q).0;
    DVector::from_iterator(3 * cuts.len(), cuts.iter().flat_map(|cut| gap(cut).0))
}

fn worst<'c>(model: &Model, cuts: &'c [Cut], q: &[f64]) -> (f64, &'c Cut) {
    let gap = |cut: &Cut| (cut.end(model, 0, q).0 - cut.end(model, 1, q).0).norm();
    let of_size = |cut: &&Cut| gap(cut) / cut.size_m;
    let widest = cuts.iter().max_by(|a, b| of_size(a).total_cmp(&of_size(b))).unwrap_or(&cuts[0]);
    (gap(widest), widest)
}

/// Jacobian of the gaps with respect to the positions of the joints `by`.
fn jacobian(model: &Model, cuts: &[Cut], q: &[f64], by: &[usize]) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(3 * cuts.len(), by.len());
    for (number, cut) in cuts.iter().enumerate() {
        for (k, sign) in [(0, 1.0), (1, -1.0)] {
            let (point, joints) = cut.end(model, k, q);
            for (joint, placement) in joints {
                let Some(column) = by.iter().position(|own| *own == joint) else { continue };
                let own = &model.tree_joints()[joint];
                let axis = placement.rotation.mul_vec(own.axis);
                let moves = if own.is_rotary() { axis.cross(point - placement.translation) } else { axis };
                for (row, x) in moves.0.into_iter().enumerate() {
                    all[(3 * number + row, column)] += sign * x;
                }
            }
        }
    }
    all
}
