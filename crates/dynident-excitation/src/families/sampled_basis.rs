//! Basis functions sampled once on a grid, and the two products that linear families need.

use crate::motion::{Motion, MotionAdjoint};
use dynident_lanes::{AlignedBuffer, Kernel, Lane, Level, dispatch};
use nalgebra::DMatrix;
use std::sync::{Arc, PoisonError, RwLock};

/// Number of samples in a block, equal to the widest SIMD register.
const BLOCK: usize = 8;
/// Number of values of one column in one block: four derivatives (orders 0 to 3).
const CELL: usize = 4 * BLOCK;
/// Number of samples above which a grid is processed in pieces that are not stored.
const MAX_STORED_SAMPLES: usize = 4096;
/// Maximum number of functions times samples in a table of a grid or piece: 32 MiB.
const MAX_TABLE_VALUES: usize = 1 << 20;
/// Number of stored grids per family: search, polish and check grids, and one more.
const MAX_STORED_GRIDS: usize = 4;

/// One set of columns on one grid. In each block, only the columns in `[first, end)` can be nonzero (local support of
/// splines).
#[derive(Debug)]
struct Columns {
    supports: Vec<[usize; 2]>,
    values: AlignedBuffer,
}

impl Columns {
    #[inline(always)]
    fn cells(&self, columns: usize, block: usize) -> &[f64] {
        &self.values.as_slice()[block * columns * CELL..(block + 1) * columns * CELL]
    }
}

#[derive(Debug)]
pub(crate) struct SampledBasis {
    times_s: Vec<f64>,
    columns: usize,
    sets: Vec<Columns>,
}

impl SampledBasis {
    /// Samples `columns` functions; `row(set, time, out)` writes the value and the first three derivatives of each into
    /// `out`, which is initialised to zero.
    pub(crate) fn new(columns: usize, sets: usize, times_s: &[f64], row: impl Fn(usize, f64, &mut [[f64; 4]])) -> Self {
        let blocks = times_s.len().div_ceil(BLOCK);
        let mut buffer = vec![[0.0; 4]; columns];
        let sets = (0..sets)
            .map(|set| {
                let mut values = AlignedBuffer::new();
                values.resize(blocks * columns * CELL);
                let cells = values.as_mut_slice();
                cells.fill(0.0);
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
                            cells[(block * columns + column) * CELL + order * BLOCK + lane] = value;
                        }
                    }
                }
                Columns { supports, values }
            })
            .collect();
        Self { times_s: times_s.to_vec(), columns, sets }
    }

    /// Writes Σ parameter · column and its derivatives for samples `[from, from + len)` of `out`, which already has its
    /// size.
    pub(crate) fn motion(&self, parameters: &[f64], from: usize, out: &mut Motion) {
        dispatch(Level::detect(), Forward { basis: self, parameters, from, out });
    }

    pub(crate) fn apply_adjoint(&self, from: usize, adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        dispatch(Level::detect(), Backward { basis: self, from, adjoint, gradient });
    }

    /// Adds Σ weight · column columnᵀ of one joint over samples and orders. Most weights are zero.
    pub(crate) fn curvature(&self, from: usize, joint: usize, weights: &Motion, out: &mut DMatrix<f64>) {
        let columns = self.set(joint);
        let start = joint * weights.samples + from;
        for (order, weights) in weights.arrays().into_iter().enumerate() {
            for (sample, weight) in weights[start..start + self.times_s.len()].iter().enumerate() {
                if *weight == 0.0 {
                    continue;
                }
                let (block, lane) = (sample / BLOCK, sample % BLOCK);
                let [first, end] = columns.supports[block];
                let cells = columns.cells(self.columns, block);
                let value = |column: usize| cells[column * CELL + order * BLOCK + lane];
                for a in first..end {
                    let scaled = weight * value(a);
                    for b in first..end {
                        out[(b, a)] += scaled * value(b);
                    }
                }
            }
        }
    }

    #[inline(always)]
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
        // Two joints share every load of a common basis: eight independent sums hide the latency of multiply-add.
        let paired = if basis.sets.len() == 1 { joints / 2 * 2 } else { 0 };
        let blocks = basis.times_s.len().div_ceil(BLOCK);
        for joint in (0..paired).step_by(2) {
            for block in 0..blocks {
                for start in (0..BLOCK).step_by(T::LANES) {
                    let sums = combine::<T, 2>(basis, basis.set(joint), parameters, joint, block, start);
                    place(&sums, out, joint, from, block * BLOCK + start, basis.times_s.len());
                }
            }
        }
        for joint in paired..joints {
            for block in 0..blocks {
                for start in (0..BLOCK).step_by(T::LANES) {
                    let sums = combine::<T, 1>(basis, basis.set(joint), parameters, joint, block, start);
                    place(&sums, out, joint, from, block * BLOCK + start, basis.times_s.len());
                }
            }
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
    let cells = columns.cells(basis.columns, block);
    let weights: [&[f64]; J] = core::array::from_fn(|ahead| &parameters[(joint + ahead) * basis.columns..][..end]);
    for column in first..end {
        let cell = &cells[column * CELL..(column + 1) * CELL];
        let mut splats = [T::ZERO; J];
        for ahead in 0..J {
            splats[ahead] = T::splat(weights[ahead][column]);
        }
        for order in 0..4 {
            let function = T::load(&cell[order * BLOCK + start..order * BLOCK + start + T::LANES]);
            for ahead in 0..J {
                sums[ahead][order] = function.mul_add(splats[ahead], sums[ahead][order]);
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
    for ahead in 0..J {
        let at = (joint + ahead) * out.samples + from + sample;
        let sum = sums[ahead];
        store_some(sum[0], &mut out.q, at, count);
        store_some(sum[1], &mut out.dq, at, count);
        store_some(sum[2], &mut out.ddq, at, count);
        store_some(sum[3], &mut out.dddq, at, count);
    }
}

#[inline(always)]
pub(crate) fn store_some<T: Lane>(value: T, array: &mut [f64], at: usize, count: usize) {
    if count == T::LANES {
        value.store(&mut array[at..at + T::LANES]);
    } else if count > 0 {
        let mut values = [0.0; BLOCK];
        value.store(&mut values);
        array[at..at + count].copy_from_slice(&values[..count]);
    }
}

struct Backward<'a> {
    basis: &'a SampledBasis,
    from: usize,
    adjoint: &'a MotionAdjoint,
    gradient: &'a mut [f64],
}

impl Kernel for Backward<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { basis, from, adjoint, gradient } = self;
        let samples = basis.times_s.len();
        let each = basis.columns;
        let mut sums = vec![T::ZERO; each * adjoint.joints];
        for block in 0..samples.div_ceil(BLOCK) {
            for start in (0..BLOCK).step_by(T::LANES) {
                let sample = block * BLOCK + start;
                let count = T::LANES.min(samples.saturating_sub(sample));
                for (joint, sums) in sums.chunks_mut(each).enumerate() {
                    let columns = basis.set(joint);
                    let [first, end] = columns.supports[block];
                    let cells = columns.cells(each, block);
                    let at = joint * adjoint.samples + from + sample;
                    let pulls: [T; 4] = [
                        load_some(&adjoint.q, at, count),
                        load_some(&adjoint.dq, at, count),
                        load_some(&adjoint.ddq, at, count),
                        load_some(&adjoint.dddq, at, count),
                    ];
                    for column in first..end {
                        let cell = &cells[column * CELL..(column + 1) * CELL];
                        let mut sum = sums[column];
                        for order in 0..4 {
                            let lanes = order * BLOCK + start..order * BLOCK + start + T::LANES;
                            sum = T::load(&cell[lanes]).mul_add(pulls[order], sum);
                        }
                        sums[column] = sum;
                    }
                }
            }
        }
        for (out, sum) in gradient.iter_mut().zip(&sums) {
            *out += sum.sum();
        }
    }
}

/// Loads at most one register of values of `array` from `at`; missing values are zero.
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

/// The last few sampled grids of a family. The cache affects only the speed.
#[derive(Debug, Default)]
pub(crate) struct GridCache(RwLock<Vec<Arc<SampledBasis>>>);

impl Clone for GridCache {
    /// A clone starts empty.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl GridCache {
    /// Calls `with(basis, from)` for the whole grid if its table is small (sampled once, then stored), otherwise for
    /// one piece after another.
    pub(crate) fn each(
        &self,
        functions: usize,
        times_s: &[f64],
        sample: impl Fn(&[f64]) -> SampledBasis,
        mut with: impl FnMut(&SampledBasis, usize),
    ) {
        let most = (MAX_TABLE_VALUES / functions.max(1)).clamp(BLOCK, MAX_STORED_SAMPLES);
        if times_s.len() > most {
            for (piece, times) in times_s.chunks(most).enumerate() {
                with(&sample(times), piece * most);
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
            kept.truncate(MAX_STORED_GRIDS);
            made
        });
        with(&basis, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    /// Four different functions per set, the third only in the first half: (t + set)^n with derivatives.
    fn row(set: usize, time: f64, out: &mut [[f64; 4]]) {
        let x = time + set as f64;
        *out.first_mut().unwrap() = [1.0, 0.0, 0.0, 0.0];
        out[1] = [x, 1.0, 0.0, 0.0];
        if time < 0.5 {
            out[2] = [x * x * x, 3.0 * x * x, 6.0 * x, 6.0];
        }
        out[3] = [x.sin(), x.cos(), -x.sin(), -x.cos()];
    }

    /// Compares with plain sums, for joints in pairs and alone, shared and separate functions, and every remainder of a
    /// block; 1e-13 for sums of four terms below 5.
    #[test]
    fn both_products_are_the_plain_sums() {
        let mut random = Random::new(4);
        for (joints, sets, samples) in [(1, 1, 1), (2, 1, 8), (3, 1, 13), (7, 1, 37), (3, 3, 20), (2, 2, 7)] {
            let times: Vec<f64> = (0..samples).map(|_| random.uniform(0.0, 1.0)).collect();
            let parameters: Vec<f64> = (0..4 * joints).map(|_| random.normal()).collect();
            let basis = SampledBasis::new(4, sets, &times, row);
            let (mut motion, mut adjoint) = (Motion::default(), Motion::default());
            motion.reset(joints, samples);
            adjoint.reset(joints, samples);
            for values in adjoint.arrays_mut() {
                for value in values.iter_mut() {
                    *value = random.normal();
                }
            }
            basis.motion(&parameters, 0, &mut motion);
            let mut gradient = vec![0.5; parameters.len()];
            basis.apply_adjoint(0, &adjoint, &mut gradient);
            let mut expected = vec![0.5; parameters.len()];
            for joint in 0..joints {
                for (sample, &time) in times.iter().enumerate() {
                    let mut functions = [[0.0; 4]; 4];
                    row(if sets == 1 { 0 } else { joint }, time, &mut functions);
                    let at = joint * samples + sample;
                    let got = motion.arrays().map(|values| values[at]);
                    let pull = adjoint.arrays().map(|values| values[at]);
                    for order in 0..4 {
                        let sum: f64 = (0..4).map(|c| parameters[4 * joint + c] * functions[c][order]).sum();
                        assert!((sum - got[order]).abs() < 1e-13);
                        for column in 0..4 {
                            expected[4 * joint + column] += pull[order] * functions[column][order];
                        }
                    }
                }
            }
            for (got, expected) in gradient.iter().zip(&expected) {
                assert!((got - expected).abs() < 1e-12, "{joints} {sets} {samples}");
            }
        }
    }

    /// A grid that is too long is processed in pieces with the same result, and a stored one is reused.
    #[test]
    fn pieces_join_and_grids_are_kept() {
        let times: Vec<f64> = (0..MAX_STORED_SAMPLES + 5).map(|s| s as f64 / 5000.0).collect();
        let parameters = [0.3, -1.0, 2.0, 0.7];
        let sampled = std::cell::Cell::new(0);
        let sample = |times: &[f64]| {
            sampled.set(sampled.get() + 1);
            SampledBasis::new(4, 1, times, row)
        };
        let cache = GridCache::default();
        let motion = |times: &[f64]| {
            let mut out = Motion::default();
            out.reset(1, times.len());
            cache.each(4, times, sample, |basis, from| basis.motion(&parameters, from, &mut out));
            out
        };
        let (long, short) = (motion(&times), motion(&times[MAX_STORED_SAMPLES..]));
        assert_eq!(sampled.get(), 3);
        assert_eq!(long.q[MAX_STORED_SAMPLES..], short.q[..]);
        assert_eq!(motion(&times[MAX_STORED_SAMPLES..]), short);
        assert_eq!(sampled.get(), 3);
        assert_eq!(motion(&times[..7]).q[..], long.q[..7]);
        assert_eq!(sampled.get(), 4);
    }
}
