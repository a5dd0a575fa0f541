//! A basis of functions of time, sampled once on a grid, and the two products with it that a linear family needs.

use crate::motion::{Motion, MotionCotangent};
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use std::sync::{Arc, PoisonError, RwLock};

/// Samples in a block: the widest lanes.
const BLOCK: usize = 8;
/// Values of one column in one block: four derivatives (orders 0 to 3).
const CELL: usize = 4 * BLOCK;
/// Samples above which a grid is worked through in pieces that are not kept.
const LARGEST_KEPT: usize = 4096;
/// Grids kept per family: search, polish and check grids, and a spare.
const GRIDS_KEPT: usize = 4;

/// One set of columns on one grid; in a block, columns outside `[first, end)` vanish (local support of splines).
#[derive(Debug)]
struct Columns {
    supports: Vec<[usize; 2]>,
    values: Vec<f64>,
}

/// The basis functions of a family and their first three derivatives at given times.
#[derive(Debug)]
pub(crate) struct SampledBasis {
    times_s: Vec<f64>,
    columns: usize,
    /// One entry if all joints share the basis, else one a joint.
    sets: Vec<Columns>,
}

impl SampledBasis {
    /// Samples `columns` functions; `row(set, time, out)` gives value, first, second and third derivative of each into zeroed `out`.
    pub(crate) fn new(columns: usize, sets: usize, times_s: &[f64], row: impl Fn(usize, f64, &mut [[f64; 4]])) -> Self {
        let blocks = times_s.len().div_ceil(BLOCK);
        let mut buffer = vec![[0.0; 4]; columns];
        let sets = (0..sets)
            .map(|set| {
                let mut values = vec![0.0; blocks * columns * CELL];
                let mut supports = vec![[columns, 0]; blocks];
                for (sample, &time) in times_s.iter().enumerate() {
                    buffer.fill([0.0; 4]);
                    row(set, time, &mut buffer);
                    let (block, lane) = (sample / BLOCK, sample % BLOCK);
                    for (column, cell) in buffer.iter().enumerate() {
                        if cell.iter().any(|&value| value != 0.0) {
                            let [first, end] = &mut supports[block];
                            *first = (*first).min(column);
                            *end = (*end).max(column + 1);
                        }
                        for (order, &value) in cell.iter().enumerate() {
                            values[(block * columns + column) * CELL + order * BLOCK + lane] = value;
                        }
                    }
                }
                Columns { supports, values }
            })
            .collect();
        Self { times_s: times_s.to_vec(), columns, sets }
    }

    /// Writes Σ parameter · column and its derivatives for samples `[from, from + len)` of `out`, which is already sized.
    pub(crate) fn motion(&self, parameters: &[f64], from: usize, out: &mut Motion) {
        dispatch(Level::detect(), Forward { basis: self, parameters, from, out });
    }

    /// Adds the derivative of a cost by the parameters.
    pub(crate) fn pull_back(&self, from: usize, cotangent: &MotionCotangent, gradient: &mut [f64]) {
        dispatch(Level::detect(), Backward { basis: self, from, cotangent, gradient });
    }

    fn set(&self, joint: usize) -> &Columns {
        &self.sets[if self.sets.len() == 1 { 0 } else { joint }]
    }
}

struct Forward<'a> {
    basis: &'a SampledBasis,
    parameters: &'a [f64],
    from: usize,
    out: &'a mut Motion,
}

impl Kernel for Forward<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { basis, parameters, from, out } = self;
        let joints = out.joints;
        // Pairs share every load of a common basis: eight independent chains hide the multiply-add's latency.
        let paired = if basis.sets.len() == 1 { joints / 2 * 2 } else { 0 };
        let mut joint = 0;
        while joint < joints {
            let width = if joint < paired { 2 } else { 1 };
            let columns = basis.set(joint);
            for block in 0..columns.supports.len() {
                for start in (0..BLOCK).step_by(T::LANES) {
                    if width == 2 {
                        let sums = combine::<T, 2>(basis, columns, parameters, joint, block, start);
                        place(&sums, out, joint, from, block * BLOCK + start, basis.times_s.len());
                    } else {
                        let sums = combine::<T, 1>(basis, columns, parameters, joint, block, start);
                        place(&sums, out, joint, from, block * BLOCK + start, basis.times_s.len());
                    }
                }
            }
            joint += width;
        }
    }
}

#[inline(always)]
fn combine<T: Lane, const J: usize>(
    basis: &SampledBasis,
    columns: &Columns,
    parameters: &[f64],
    joint: usize,
    block: usize,
    start: usize,
) -> [[T; 4]; J] {
    let mut sums = [[T::ZERO; 4]; J];
    let [first, end] = columns.supports[block];
    for column in first..end {
        let cell = &columns.values[(block * basis.columns + column) * CELL..][..CELL];
        let functions: [T; 4] = core::array::from_fn(|order| T::load(&cell[order * BLOCK + start..]));
        for (ahead, sum) in sums.iter_mut().enumerate() {
            let weight = T::splat(parameters[(joint + ahead) * basis.columns + column]);
            for (value, function) in sum.iter_mut().zip(functions) {
                *value = function.mul_add(weight, *value);
            }
        }
    }
    sums
}

#[inline(always)]
fn place<T: Lane, const J: usize>(
    sums: &[[T; 4]; J],
    out: &mut Motion,
    joint: usize,
    from: usize,
    sample: usize,
    samples: usize,
) {
    let count = T::LANES.min(samples.saturating_sub(sample));
    let arrays = [&mut out.q, &mut out.dq, &mut out.ddq, &mut out.dddq];
    for (order, array) in arrays.into_iter().enumerate() {
        for (ahead, sum) in sums.iter().enumerate() {
            let at = (joint + ahead) * out.samples + from + sample;
            if count == T::LANES {
                sum[order].store(&mut array[at..at + T::LANES]);
            } else {
                let mut values = [0.0; BLOCK];
                sum[order].store(&mut values);
                array[at..at + count].copy_from_slice(&values[..count]);
            }
        }
    }
}

struct Backward<'a> {
    basis: &'a SampledBasis,
    from: usize,
    cotangent: &'a MotionCotangent,
    gradient: &'a mut [f64],
}

impl Kernel for Backward<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { basis, from, cotangent, gradient } = self;
        let samples = basis.times_s.len();
        let mut sums = vec![T::ZERO; basis.columns];
        for joint in 0..cotangent.joints {
            sums.fill(T::ZERO);
            let columns = basis.set(joint);
            for (block, &[first, end]) in columns.supports.iter().enumerate() {
                for start in (0..BLOCK).step_by(T::LANES) {
                    let sample = block * BLOCK + start;
                    let count = T::LANES.min(samples.saturating_sub(sample));
                    let at = joint * cotangent.samples + from + sample;
                    let arrays = [&cotangent.q, &cotangent.dq, &cotangent.ddq, &cotangent.dddq];
                    let pulls: [T; 4] = arrays.map(|array| load_some(array, at, count));
                    for column in first..end {
                        let cell = &columns.values[(block * basis.columns + column) * CELL..][..CELL];
                        let mut sum = sums[column];
                        for (order, pull) in pulls.into_iter().enumerate() {
                            sum = T::load(&cell[order * BLOCK + start..]).mul_add(pull, sum);
                        }
                        sums[column] = sum;
                    }
                }
            }
            for (out, sum) in gradient[joint * basis.columns..].iter_mut().zip(&sums) {
                *out += sum.sum();
            }
        }
    }
}

/// Up to a register's lanes of `array` from `at`; the rest is zero.
#[inline(always)]
pub(crate) fn load_some<T: Lane>(array: &[f64], at: usize, count: usize) -> T {
    if count == T::LANES {
        T::load(&array[at..at + T::LANES])
    } else {
        let mut values = [0.0; BLOCK];
        if count > 0 {
            values[..count].copy_from_slice(&array[at..at + count]);
        }
        T::load(&values)
    }
}

/// The last few grids on which a family was asked for its motion. Only speed depends on it, no result does.
#[derive(Debug, Default)]
pub(crate) struct GridCache(RwLock<Vec<Arc<SampledBasis>>>);

impl Clone for GridCache {
    /// A clone starts empty.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl GridCache {
    /// Calls `with(basis, from)` for the whole grid if it is short (sampled once, then kept), else piece by piece.
    pub(crate) fn each(
        &self,
        times_s: &[f64],
        sample: impl Fn(&[f64]) -> SampledBasis,
        mut with: impl FnMut(&SampledBasis, usize),
    ) {
        if times_s.len() > LARGEST_KEPT {
            for (piece, times) in times_s.chunks(LARGEST_KEPT).enumerate() {
                with(&sample(times), piece * LARGEST_KEPT);
            }
            return;
        }
        let kept = self.0.read().unwrap_or_else(PoisonError::into_inner);
        let found = kept.iter().find(|basis| basis.times_s == times_s).cloned();
        drop(kept);
        let basis = found.unwrap_or_else(|| {
            let made = Arc::new(sample(times_s));
            let mut kept = self.0.write().unwrap_or_else(PoisonError::into_inner);
            kept.insert(0, Arc::clone(&made));
            kept.truncate(GRIDS_KEPT);
            made
        });
        with(&basis, 0);
    }
}
