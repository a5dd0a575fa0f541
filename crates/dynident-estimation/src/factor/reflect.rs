//! Householder reflections of a triangle stacked on a panel of rows: the hot loop of every fit.
//!
//! `[R; A] = Q·[R'; 0]` with R upper triangular (d×d) and A dense (m×d). Reflector k has the form `v = (ν e_k, a)`
//! with the current k-th column `a` of the panel, so it changes one row of R and the panel only: 2·m·d² operations in
//! all. Four reflectors are built, then applied together (compact WY form: Schreiber and Van Loan, SIAM J. Sci. Stat.
//! Comput. 10 (1989) 53), two target columns at a time, so that each loaded number is used in several multiplications.

use dynident_lanes::{Kernel, Lane};

/// Eight rows of one column. The alignment keeps every load within one cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Chunk(pub(crate) [f64; CHUNK_ROWS]);

impl Chunk {
    pub(crate) const ZERO: Self = Self([0.0; CHUNK_ROWS]);
}

/// Rows in a [`Chunk`].
pub(crate) const CHUNK_ROWS: usize = 8;

const REFLECTORS: usize = 4;

/// A column with a smaller squared norm is treated as zero, because its reciprocal would overflow. Its entries are
/// around 1e-145, far below any rounding error of a measurement.
pub(super) const NEGLIGIBLE_SQUARE: f64 = 1.0e-290;

/// Index of row `row` in a packed upper triangle of size `size`; entry (row, column) follows at `column - row`.
pub(crate) const fn row_start(size: usize, row: usize) -> usize {
    row * (2 * size + 1 - row) / 2
}

/// Absorbs a panel into a triangle. The panel is overwritten.
pub(crate) struct TriangleOnPanel<'a> {
    /// Packed upper triangle by rows, with a nonnegative diagonal.
    pub(crate) triangle: &'a mut [f64],
    pub(crate) size: usize,
    /// Columns of the panel one after another, each `chunks` long, padded with zero rows.
    pub(crate) panel: &'a mut [Chunk],
    pub(crate) chunks: usize,
    /// Chunks of each column up to its last nonzero number: see [`heights`].
    pub(crate) heights: &'a mut [usize],
}

/// Number of chunks of each column up to the last nonzero number. Triangular panels and rows with few columns need a
/// fraction of the work of full ones; the sums are bit-identical, because only products with zero are skipped.
pub(crate) fn heights(panel: &[Chunk], chunks: usize, out: &mut Vec<usize>) {
    // Compared by bits: a negative zero would change the result.
    let filled = |chunk: &Chunk| chunk.0.iter().any(|value| value.to_bits() != 0);
    out.clear();
    out.extend(panel.chunks_exact(chunks).map(|column| column.iter().rposition(filled).map_or(0, |last| last + 1)));
}

impl Kernel for TriangleOnPanel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { triangle, size, panel, chunks, heights } = self;
        let mut first = 0;
        while first < size {
            let width = (size - first).min(REFLECTORS);
            let (head, targets) = panel.split_at_mut((first + width) * chunks);
            let (own, others) = heights.split_at_mut(first + width);
            let mut height = 0;
            for own in &own[first..] {
                height = height.max(*own);
            }
            // The panel is zero in these columns, so their reflectors are the identity.
            if height > 0 {
                let block = Block { columns: &mut head[first * chunks..], chunks, height };
                match width {
                    4 => step::<T, 4>(triangle, size, first, block, targets, others),
                    3 => step::<T, 3>(triangle, size, first, block, targets, others),
                    2 => step::<T, 2>(triangle, size, first, block, targets, others),
                    _ => step::<T, 1>(triangle, size, first, block, targets, others),
                }
            }
            first += width;
        }
    }
}

/// Columns from which reflectors are made.
struct Block<'a> {
    columns: &'a mut [Chunk],
    /// Chunks from one column to the next.
    chunks: usize,
    /// Leading chunks that are not all zero.
    height: usize,
}

/// `V` reflectors `I - β v vᵀ` under construction. Their parts `ν` are in different rows of the triangle, so the
/// inner product of two reflectors is that of their panel columns.
struct Reflectors<const V: usize> {
    /// Part ν of each reflector in its row of the triangle.
    nu: [f64; V],
    /// Upper triangle T of `I - V T Vᵀ`, `t[l][i]` for l ≤ i, with β on the diagonal.
    t: [[f64; V]; V],
}

impl<const V: usize> Reflectors<V> {
    /// Amounts of the first `count` reflectors to subtract from a target with these inner products.
    #[inline(always)]
    fn amounts(&self, count: usize, products: [f64; V]) -> [f64; V] {
        let mut amounts = [0.0; V];
        for i in 0..count {
            for l in 0..=i {
                amounts[i] += self.t[l][i] * products[l];
            }
        }
        amounts
    }
}

#[inline(always)]
fn step<T: Lane, const V: usize>(
    triangle: &mut [f64],
    size: usize,
    first: usize,
    Block { columns: block, chunks, height }: Block<'_>,
    targets: &mut [Chunk],
    heights: &mut [usize],
) {
    let mut reflectors = Reflectors::<V> { nu: [0.0; V], t: [[0.0; V]; V] };
    for i in 0..V {
        let (done, rest) = block.split_at_mut(i * chunks);
        let column = &mut rest[..height];
        match i {
            0 => reflect_column::<T, V, 0>(triangle, size, first, done, chunks, column, &mut reflectors),
            1 => reflect_column::<T, V, 1>(triangle, size, first, done, chunks, column, &mut reflectors),
            2 => reflect_column::<T, V, 2>(triangle, size, first, done, chunks, column, &mut reflectors),
            _ => reflect_column::<T, V, 3>(triangle, size, first, done, chunks, column, &mut reflectors),
        }
    }
    let columns = columns::<V>(block, chunks, height);
    let mut index = first + V;
    let mut pairs = targets.chunks_exact_mut(2 * chunks);
    for pair in &mut pairs {
        let mut idle = [false; 2];
        for x in 0..2 {
            idle[x] = heights[index + x - first - V] == 0 && is_zero::<V>(triangle, size, first, index + x);
        }
        if !(idle[0] && idle[1]) {
            let (left, right) = pair.split_at_mut(chunks);
            let targets = [&mut left[..height], &mut right[..height]];
            apply::<T, V, 2>(triangle, size, first, index, &columns, targets, &reflectors);
            for x in 0..2 {
                let own = &mut heights[index + x - first - V];
                *own = if idle[x] { 0 } else { height.max(*own) };
            }
        }
        index += 2;
    }
    let last = pairs.into_remainder();
    if !last.is_empty() {
        apply::<T, V, 1>(triangle, size, first, index, &columns, [&mut last[..height]], &reflectors);
        let own = &mut heights[index - first - V];
        *own = height.max(*own);
    }
}

/// Whether column `column` of the triangle is zero in the rows of `V` reflectors.
#[inline(always)]
fn is_zero<const V: usize>(triangle: &[f64], size: usize, first: usize, column: usize) -> bool {
    let mut bits = 0;
    for l in 0..V {
        bits |= triangle[row_start(size, first + l) + column - first - l].to_bits();
    }
    bits == 0
}

#[inline(always)]
fn columns<const N: usize>(block: &[Chunk], chunks: usize, height: usize) -> [&[Chunk]; N] {
    // No `array::from_fn`: its closure is not inlined into the function of the processor level.
    let mut columns: [&[Chunk]; N] = [&[]; N];
    for (i, column) in columns.iter_mut().enumerate() {
        *column = &block[i * chunks..i * chunks + height];
    }
    columns
}

/// Applies the `P` previous reflectors to the block's next column, then makes the reflector of that column.
#[inline(always)]
fn reflect_column<T: Lane, const V: usize, const P: usize>(
    triangle: &mut [f64],
    size: usize,
    first: usize,
    done: &[Chunk],
    chunks: usize,
    column: &mut [Chunk],
    reflectors: &mut Reflectors<V>,
) {
    let done = columns::<P>(done, chunks, column.len());
    let index = first + P;
    if P > 0 {
        let [dots] = inner_products::<T, P, 1>(&done, &[&*column]);
        let mut products = [0.0; V];
        for l in 0..P {
            products[l] = reflectors.nu[l] * triangle[row_start(size, first + l) + index - first - l] + dots[l];
        }
        let amounts = reflectors.amounts(P, products);
        for l in 0..P {
            triangle[row_start(size, first + l) + index - first - l] -= reflectors.nu[l] * amounts[l];
        }
        let mut first_amounts = [[0.0; P]];
        first_amounts[0].copy_from_slice(&amounts[..P]);
        subtract::<T, P, 1>(&done, &mut [&mut *column], &first_amounts);
    }
    let [[square]] = inner_products::<T, 1, 1>(&[&*column], &[&*column]);
    if square < NEGLIGIBLE_SQUARE {
        // Identity reflector: ν and its column of T stay zero.
        return;
    }
    let [products] = inner_products::<T, P, 1>(&done, &[&*column]);
    let diagonal = &mut triangle[row_start(size, index)];
    let old = *diagonal;
    let norm = (old * old + square).sqrt();
    *diagonal = norm;
    // old - norm without cancellation (old is not negative), which keeps the diagonal positive: Parlett, SIAM Review
    // 13 (1971) 197.
    reflectors.nu[P] = -square / (old + norm);
    // At most 2/square, which is finite; norm · square may underflow.
    let beta = (old + norm) / norm / square;
    let mut sums = [0.0; P];
    for l in 0..P {
        for m in l..P {
            sums[l] += reflectors.t[l][m] * products[m];
        }
    }
    for l in 0..P {
        reflectors.t[l][P] = -beta * sums[l];
    }
    reflectors.t[P][P] = beta;
}

/// Applies the reflectors to the target columns from `index` on.
#[inline(always)]
fn apply<T: Lane, const V: usize, const X: usize>(
    triangle: &mut [f64],
    size: usize,
    first: usize,
    index: usize,
    columns: &[&[Chunk]; V],
    mut targets: [&mut [Chunk]; X],
    reflectors: &Reflectors<V>,
) {
    let mut shared: [&[Chunk]; X] = [&[]; X];
    for (shared, target) in shared.iter_mut().zip(&targets) {
        *shared = target;
    }
    let dots = inner_products::<T, V, X>(columns, &shared);
    let mut amounts = [[0.0; V]; X];
    for x in 0..X {
        let mut products = [0.0; V];
        for l in 0..V {
            products[l] = reflectors.nu[l] * triangle[row_start(size, first + l) + index + x - first - l] + dots[x][l];
        }
        amounts[x] = reflectors.amounts(V, products);
        for l in 0..V {
            triangle[row_start(size, first + l) + index + x - first - l] -= reflectors.nu[l] * amounts[x][l];
        }
    }
    subtract::<T, V, X>(columns, &mut targets, &amounts);
}

/// `targets[x]ᵀ columns[l]`.
#[inline(always)]
fn inner_products<T: Lane, const V: usize, const X: usize>(
    columns: &[&[Chunk]; V],
    targets: &[&[Chunk]; X],
) -> [[f64; V]; X] {
    let chunks = targets[0].len();
    let mut sums = [[T::ZERO; V]; X];
    for c in 0..chunks {
        for part in 0..CHUNK_ROWS / T::LANES {
            let at = part * T::LANES;
            let mut v = [T::ZERO; V];
            for l in 0..V {
                v[l] = T::load(&columns[l][c].0[at..]);
            }
            for x in 0..X {
                let target = T::load(&targets[x][c].0[at..]);
                for l in 0..V {
                    sums[x][l] = v[l].mul_add(target, sums[x][l]);
                }
            }
        }
    }
    // black_box: if the compiler sees the loop and the lane sums together, it chooses a layout with shuffles in every
    // iteration (half the speed).
    let sums = core::hint::black_box(sums);
    let mut products = [[0.0; V]; X];
    for x in 0..X {
        for l in 0..V {
            products[x][l] = halving_sum(sums[x][l]);
        }
    }
    products
}

/// `targets[x] -= Σ_l amounts[x][l] columns[l]`.
#[inline(always)]
fn subtract<T: Lane, const V: usize, const X: usize>(
    columns: &[&[Chunk]; V],
    targets: &mut [&mut [Chunk]; X],
    amounts: &[[f64; V]; X],
) {
    let chunks = targets[0].len();
    let mut factors = [[T::ZERO; V]; X];
    for x in 0..X {
        for l in 0..V {
            factors[x][l] = T::splat(-amounts[x][l]);
        }
    }
    for c in 0..chunks {
        for part in 0..CHUNK_ROWS / T::LANES {
            let at = part * T::LANES;
            let mut v = [T::ZERO; V];
            for l in 0..V {
                v[l] = T::load(&columns[l][c].0[at..]);
            }
            for x in 0..X {
                let mut target = T::load(&targets[x][c].0[at..]);
                for l in 0..V {
                    target = v[l].mul_add(factors[x][l], target);
                }
                target.store(&mut targets[x][c].0[at..]);
            }
        }
    }
}

/// Sum over the lanes by halving: three dependent additions for eight lanes instead of seven.
#[inline(always)]
fn halving_sum<T: Lane>(lanes: T) -> f64 {
    let mut values = [0.0; CHUNK_ROWS];
    lanes.store(&mut values);
    let mut half = T::LANES / 2;
    while half > 0 {
        for i in 0..half {
            values[i] += values[i + half];
        }
        half /= 2;
    }
    values[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_lanes::{Level, dispatch};

    /// A triangle and a panel whose column `c` ends after `ends(c)` rows.
    fn stack(size: usize, chunks: usize, ends: impl Fn(usize) -> usize) -> (Vec<f64>, Vec<Chunk>) {
        let number = |k: usize| (1.7 * k as f64 * k as f64 + 0.3).sin();
        let mut triangle: Vec<f64> = (0..row_start(size, size)).map(number).collect();
        for row in 0..size {
            triangle[row_start(size, row)] = triangle[row_start(size, row)].abs();
            // The second last column is zero in the first half of the rows.
            if row + 2 < size && row < size / 2 {
                triangle[row_start(size, row) + size - 2 - row] = 0.0;
            }
        }
        let mut panel = vec![Chunk::ZERO; size * chunks];
        for column in 0..size {
            for row in 0..ends(column) {
                panel[column * chunks + row / CHUNK_ROWS].0[row % CHUNK_ROWS] = number(7 * column + 31 * row);
            }
        }
        (triangle, panel)
    }

    #[test]
    fn skipped_zeros_change_no_bit() {
        let (size, chunks) = (23, 4);
        let triangular = |column: usize| column + 1;
        let few = |column: usize| if column.is_multiple_of(3) || column == size - 2 { 0 } else { 13 };
        let late = |column: usize| if column < 9 { 0 } else { 30 };
        let shapes: [&dyn Fn(usize) -> usize; 3] = [&triangular, &few, &late];
        for (level, ends) in Level::available().into_iter().flat_map(|level| shapes.map(|ends| (level, ends))) {
            let absorbed = |whole: bool| {
                let (mut triangle, mut panel) = stack(size, chunks, ends);
                let mut filled = Vec::new();
                heights(&panel, chunks, &mut filled);
                if whole {
                    filled.fill(chunks);
                }
                let (panel, heights) = (&mut panel[..], &mut filled[..]);
                dispatch(level, TriangleOnPanel { triangle: &mut triangle, size, panel, chunks, heights });
                triangle.into_iter().map(f64::to_bits).collect::<Vec<_>>()
            };
            assert_eq!(absorbed(false), absorbed(true), "{}", level.name());
        }
    }
}
