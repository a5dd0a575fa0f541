//! Storage of the columns of the composite-rigid-body algorithm: each joint has one wrench, and a bundle holds
//! several.
//!
//! The columns of a run of joints without branches are adjacent, in joint order. Every run starts a new bundle and is
//! followed by the runs of its child branches, so the columns of a joint's subtree fill consecutive bundles. Lanes of
//! inner joints, whose columns do not exist yet, are zero.

use dynident_lanes::Lane;
use dynident_model::{Model, Vec3};

#[derive(Debug)]
pub(crate) struct ColumnScratch<T: Lane> {
    /// Bundle, and place in it, of each joint's column.
    pub(crate) place: Vec<(usize, usize)>,
    /// One past the last bundle of each joint's subtree; the first bundle is the joint's own.
    pub(crate) end: Vec<usize>,
    pub(crate) force: Vec<Vec3<T::Bundle>>,
    pub(crate) moment: Vec<Vec3<T::Bundle>>,
    /// Products of the columns of each joint's subtree with its axis: one row of bundles per joint.
    pub(crate) rows: Vec<f64>,
    /// For every pair of a joint and an ancestor: index of the product in `rows`, and the two entries of the matrix.
    pub(crate) entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) work: usize,
    pub(crate) upper: usize,
    pub(crate) lower: usize,
}

impl<T: Lane> ColumnScratch<T> {
    pub(crate) fn new(model: &Model) -> Self {
        let joints = model.body_count();
        let parents: Vec<Option<usize>> = model.maps().iter().map(|map| map.parent).collect();
        let children = |of: Option<usize>| (0..joints).filter(|&joint| parents[joint] == of).collect::<Vec<_>>();
        let (mut place, mut bundles) = (vec![(0, 0); joints], 0);
        let mut runs = children(None);
        runs.reverse();
        while let Some(start) = runs.pop() {
            let (mut joint, mut count) = (start, 0);
            loop {
                place[joint] = (bundles + count / T::PER_BUNDLE, count % T::PER_BUNDLE);
                count += 1;
                let next = children(Some(joint));
                if let [only] = next[..] {
                    joint = only;
                } else {
                    runs.extend(next.into_iter().rev());
                    break;
                }
            }
            bundles += count.div_ceil(T::PER_BUNDLE);
        }
        let mut end: Vec<usize> = place.iter().map(|place| place.0 + 1).collect();
        for joint in (0..joints).rev() {
            if let Some(parent) = parents[joint] {
                end[parent] = end[parent].max(end[joint]);
            }
        }
        let lanes = <T::Bundle as Lane>::LANES;
        let mut entries = Vec::new();
        for joint in 0..joints {
            let (bundle, at) = place[joint];
            entries.extend(model.path(joint).into_iter().map(|row| Entry {
                work: (row * bundles + bundle) * lanes + at * T::LANES,
                upper: row * joints + joint,
                lower: joint * joints + row,
            }));
        }
        Self {
            place,
            end,
            force: vec![Vec3::ZERO; bundles],
            moment: vec![Vec3::ZERO; bundles],
            rows: vec![0.0; joints * bundles * lanes],
            entries,
        }
    }
}
