//! Fits of all joints, and a robust first fit that excludes the least consistent blocks of the log.

use crate::normal::Normal;
use crate::rows::{DRIVE_COLUMNS, DRY_FRICTION, LogRows, median};
use core::ops::Range;
use nalgebra::DVector;

/// Maximum number of blocks; it limits the time of the first fit.
const MAX_BLOCKS: usize = 100;
/// Number of iterations (concentration steps) from each start.
const STEPS: usize = 4;

/// Model parameters of all joints.
pub(crate) type Fit = Vec<DVector<f64>>;

/// Normal equations of each block of bins.
pub(crate) struct Blocks<'a> {
    pub(crate) rows: &'a LogRows,
    ranges: Vec<Range<usize>>,
    /// Normal equations by joint and block.
    normals: Vec<Vec<Normal>>,
    /// Whether any joint moves in a block.
    moving: Vec<bool>,
}

impl<'a> Blocks<'a> {
    pub(crate) fn new(rows: &'a LogRows) -> Self {
        let per_block = ((rows.settings.robust_fit.block_s / rows.bin_s).round() as usize)
            .max(rows.len().div_ceil(MAX_BLOCKS))
            .max(1);
        let ranges: Vec<Range<usize>> =
            (0..rows.len()).step_by(per_block).map(|from| from..(from + per_block).min(rows.len())).collect();
        let of_joint = |joint: usize| -> Vec<Normal> {
            let one = |range: &Range<usize>| Normal::of_range(rows, joint, range.clone(), |_| true, |_, _| ());
            ranges.iter().map(one).collect()
        };
        let normals = (0..rows.joints()).map(of_joint).collect();
        let moves = |range: &Range<usize>| range.clone().any(|bin| rows.is_moving(bin));
        let moving = ranges.iter().map(moves).collect();
        Self { rows, ranges, normals, moving }
    }

    /// Fit to the blocks that `kept` selects; `None` if too few rows remain.
    pub(crate) fn fit(&self, kept: &[bool]) -> Option<(Vec<Normal>, Fit)> {
        let mut sums = Vec::new();
        for joint in 0..self.rows.joints() {
            let mut sum = Normal::zero(self.rows.width[joint]);
            for (range, normal) in self.ranges.iter().zip(&self.normals[joint]) {
                let count = kept[range.clone()].iter().filter(|kept| **kept).count();
                if count == range.len() {
                    sum.add(normal);
                } else if count > 0 {
                    sum.add(&Normal::of_range(self.rows, joint, range.clone(), |bin| kept[bin], |_, _| ()));
                }
            }
            sums.push(sum);
        }
        let fit: Option<Fit> = sums.iter().map(Normal::solution).collect();
        fit.map(|fit| (sums, fit))
    }

    /// Fit to the most consistent [`kept_share`](crate::RobustFitSettings::kept_share) of the blocks (least trimmed
    /// squares with concentration steps, Rousseeuw and Van Driessen, 2006).
    pub(crate) fn trimmed_fit(&self) -> Option<Fit> {
        let blocks = self.ranges.len();
        let all = |_: usize| true;
        let thirds = |part: usize| move |block: usize| 3 * block / blocks != part;
        let halves = |part: usize| move |block: usize| 2 * block / blocks == part;
        let starts: [Box<dyn Fn(usize) -> bool>; 6] = [
            Box::new(all),
            Box::new(thirds(0)),
            Box::new(thirds(1)),
            Box::new(thirds(2)),
            Box::new(halves(0)),
            Box::new(halves(1)),
        ];
        let mut best: Option<(f64, Fit)> = None;
        for start in &starts {
            let mut kept: Vec<bool> = (0..blocks).map(start).collect();
            let mut found = None;
            for _ in 0..STEPS {
                let Some((objective, fit, next)) = self.concentrated(&kept) else { break };
                (found, kept) = (Some((objective, fit)), next);
            }
            if let Some((objective, fit)) = found
                && best.as_ref().is_none_or(|(least, _)| objective < *least)
            {
                best = Some((objective, fit));
            }
        }
        best.map(|(_, fit)| fit)
    }

    /// One concentration step: objective and fit of the selected blocks, and the blocks with the smallest errors of
    /// this fit.
    fn concentrated(&self, kept: &[bool]) -> Option<(f64, Fit, Vec<bool>)> {
        let (own, blocks) = (self.rows.settings.robust_fit, self.ranges.len());
        let mut scores = vec![0.0; blocks];
        let (mut fit, mut logs) = (Fit::new(), Vec::new());
        for normals in &self.normals {
            let mut sum = Normal::zero(normals.first()?.width());
            normals.iter().zip(kept).filter(|(_, kept)| **kept).for_each(|(normal, _)| sum.add(normal));
            let theta = sum.solution()?;
            let errors: Vec<f64> =
                normals.iter().map(|normal| normal.squares(&theta) / normal.weight.max(f64::MIN_POSITIVE)).collect();
            let used = |block: &usize| kept[*block] && normals[*block].weight > 0.0;
            let level = median((0..blocks).filter(used).map(|block| errors[block]).collect()).max(f64::MIN_POSITIVE);
            for (score, error) in scores.iter_mut().zip(&errors) {
                *score += (error / level).min(own.max_block_error);
            }
            logs.push((errors, level));
            fit.push(theta);
        }
        // Any model fits a robot at rest. Blocks at rest are therefore not used for the selection, unless most of the
        // log is at rest.
        let moving = self.moving.iter().filter(|moving| **moving).count();
        if 4 * moving >= blocks {
            for (score, moving) in scores.iter_mut().zip(&self.moving) {
                *score += if *moving { 0.0 } else { 1e6 };
            }
        }
        let blocks = if 4 * moving >= blocks { moving } else { blocks };
        let mut order: Vec<usize> = (0..scores.len()).collect();
        order.sort_by(|a, b| scores[*a].total_cmp(&scores[*b]).then(a.cmp(b)));
        let count = ((own.kept_share * blocks as f64).ceil() as usize).clamp(1, blocks);
        let mut next = vec![false; scores.len()];
        order[..count].iter().for_each(|&block| next[block] = true);
        let mean = |errors: &[f64]| order[..count].iter().map(|&block| errors[block]).sum::<f64>() / count as f64;
        let objective = logs.iter().map(|(errors, _)| mean(errors).max(f64::MIN_POSITIVE).ln()).sum();
        Some((objective, fit, next))
    }
}

/// Residuals of all joints in all bins.
pub(crate) fn residuals(rows: &LogRows, fit: &Fit) -> Vec<Vec<f64>> {
    let of_joint = |joint: usize| -> Vec<f64> {
        let theta = fit[joint].as_slice();
        let predicted = |bin: usize| -> f64 { rows.row(joint, bin).iter().zip(theta).map(|(a, b)| a * b).sum() };
        (0..rows.len()).map(|bin| rows.tau[joint][bin] - predicted(bin)).collect()
    };
    (0..rows.joints()).map(of_joint).collect()
}

/// Dry friction of each joint in the fit, Nm (N), evaluated at the velocity of the wider of the two friction functions.
pub(crate) fn dry_friction(rows: &LogRows, fit: &Fit) -> Vec<f64> {
    fit.iter().enumerate().map(|(joint, theta)| dry_friction_of_joint(rows, joint, theta)).collect()
}

/// Dry friction of a joint with these parameters, Nm (N): the step of the torque at the wide step's velocity.
pub(crate) fn dry_friction_of_joint(rows: &LogRows, joint: usize, theta: &DVector<f64>) -> f64 {
    let drive = rows.width[joint] - DRIVE_COLUMNS;
    let value = |column: usize| {
        let scale = rows.drive_scale[joint][column];
        if scale > 1e-12 { theta[drive + column] / scale } else { 0.0 }
    };
    DRY_FRICTION.map(value).sum::<f64>().abs()
}
