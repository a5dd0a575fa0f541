//! Products of tall panels with small matrices.

use dynident_lanes::{Kernel, Lane, Level, dispatch};

/// Columns of a tile, chosen so that sixteen sums stay in registers.
const TILE: usize = 4;

/// Adds `weight · Pᵀ P` to both triangles of the square matrix `gram` (row-major, `size` wide) at rows and columns
/// `columns`. `panel` contains the columns of `P` one after another, `rows` values each.
pub(crate) fn add_gram(
    level: Level,
    panel: &[f64],
    rows: usize,
    columns: &[usize],
    weight: f64,
    gram: &mut [f64],
    size: usize,
) {
    dispatch(level, Gram { panel, rows, columns, weight, out: gram, size });
}

struct Gram<'a> {
    panel: &'a [f64],
    rows: usize,
    columns: &'a [usize],
    weight: f64,
    out: &'a mut [f64],
    size: usize,
}

impl Kernel for Gram<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let count = self.columns.len();
        for i in (0..count).step_by(TILE) {
            for j in (i..count).step_by(TILE) {
                let left: [&[f64]; TILE] = column_tile(self.panel, self.rows, i, count);
                let right: [&[f64]; TILE] = column_tile(self.panel, self.rows, j, count);
                let mut sums = [[T::ZERO; TILE]; TILE];
                let whole = self.rows - self.rows % T::LANES;
                let mut at = 0;
                while at < whole {
                    let l = [
                        T::load(&left[0][at..]),
                        T::load(&left[1][at..]),
                        T::load(&left[2][at..]),
                        T::load(&left[3][at..]),
                    ];
                    let r = [
                        T::load(&right[0][at..]),
                        T::load(&right[1][at..]),
                        T::load(&right[2][at..]),
                        T::load(&right[3][at..]),
                    ];
                    for a in 0..TILE {
                        for b in 0..TILE {
                            sums[a][b] = l[a].mul_add(r[b], sums[a][b]);
                        }
                    }
                    at += T::LANES;
                }
                for a in 0..TILE.min(count - i) {
                    for b in 0..TILE.min(count - j) {
                        if j + b < i + a {
                            continue;
                        }
                        let mut sum = sums[a][b].sum();
                        for s in whole..self.rows {
                            sum += left[a][s] * right[b][s];
                        }
                        let (row, column) = (self.columns[i + a], self.columns[j + b]);
                        self.out[row * self.size + column] += self.weight * sum;
                        if row != column {
                            self.out[column * self.size + row] += self.weight * sum;
                        }
                    }
                }
            }
        }
    }
}

/// Four columns starting at `first`. Past the end the last column repeats, and its sums are not used.
#[inline(always)]
fn column_tile(panel: &[f64], rows: usize, first: usize, count: usize) -> [&[f64]; TILE] {
    let of = |k: usize| {
        let column = (first + k).min(count - 1);
        &panel[column * rows..(column + 1) * rows]
    };
    [of(0), of(1), of(2), of(3)]
}

/// Computes `out = factor · P G[columns, columns]` in the shape of `P`. `matrix` is `G`, row-major, `size` wide;
/// `packed` is scratch.
#[allow(clippy::too_many_arguments, reason = "one product with its shapes")]
pub(crate) fn times_matrix(
    level: Level,
    panel: &[f64],
    rows: usize,
    columns: &[usize],
    matrix: &[f64],
    size: usize,
    factor: f64,
    packed: &mut Vec<f64>,
    out: &mut [f64],
) {
    let count = columns.len();
    packed.clear();
    for first in (0..count).step_by(TILE) {
        for &row in columns {
            packed.extend(
                (first..first + TILE)
                    .map(|k| columns.get(k).map_or(0.0, |column| factor * matrix[row * size + column])),
            );
        }
    }
    dispatch(level, Times { panel, rows, count, packed, out });
}

struct Times<'a> {
    panel: &'a [f64],
    rows: usize,
    count: usize,
    /// Scaled matrix entries of these columns: one tile of four target columns after another, the source columns in
    /// order within each tile.
    packed: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Times<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { panel, rows, count, packed, out } = self;
        for (tile, factors) in packed.chunks_exact(TILE * count).enumerate() {
            let first = tile * TILE;
            let targets = TILE.min(count - first);
            let mut at = 0;
            while at + 4 * T::LANES <= rows {
                strip::<T, 4>(panel, rows, at, factors, &mut out[first * rows..], targets);
                at += 4 * T::LANES;
            }
            while at + T::LANES <= rows {
                strip::<T, 1>(panel, rows, at, factors, &mut out[first * rows..], targets);
                at += T::LANES;
            }
            for s in at..rows {
                for k in 0..targets {
                    let products = (0..count).map(|i| panel[i * rows + s] * factors[i * TILE + k]);
                    out[(first + k) * rows + s] = products.sum();
                }
            }
        }
    }
}

#[inline(always)]
fn strip<T: Lane, const W: usize>(
    panel: &[f64],
    rows: usize,
    at: usize,
    factors: &[f64],
    out: &mut [f64],
    targets: usize,
) {
    let mut sums = [[T::ZERO; W]; TILE];
    for (i, factors) in factors.chunks_exact(TILE).enumerate() {
        let source = &panel[i * rows + at..][..W * T::LANES];
        for k in 0..TILE {
            let factor = T::splat(factors[k]);
            for w in 0..W {
                sums[k][w] = T::load(&source[w * T::LANES..]).mul_add(factor, sums[k][w]);
            }
        }
    }
    for (k, sums) in sums.iter().enumerate().take(targets) {
        let to = &mut out[k * rows + at..][..W * T::LANES];
        for (w, sum) in sums.iter().enumerate() {
            sum.store(&mut to[w * T::LANES..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    #[test]
    fn products_equal_the_plain_sums() {
        let mut random = Random::new(3);
        for (rows, count) in [(1, 1), (7, 3), (16, 4), (37, 9), (64, 13)] {
            let panel: Vec<f64> = (0..rows * count).map(|_| random.uniform(-1.0, 1.0)).collect();
            let columns: Vec<usize> = (0..count).map(|c| 2 * c).collect();
            let size = 2 * count;
            let matrix: Vec<f64> = (0..size * size).map(|_| random.uniform(-1.0, 1.0)).collect();
            for level in Level::available() {
                let mut gram = vec![0.0; size * size];
                add_gram(level, &panel, rows, &columns, 0.5, &mut gram, size);
                let mut out = vec![0.0; rows * count];
                times_matrix(level, &panel, rows, &columns, &matrix, size, 2.0, &mut Vec::new(), &mut out);
                for a in 0..count {
                    for b in 0..count {
                        let expected: f64 = (0..rows).map(|s| 0.5 * panel[a * rows + s] * panel[b * rows + s]).sum();
                        assert!((gram[columns[a] * size + columns[b]] - expected).abs() < 1e-13);
                    }
                    for s in 0..rows {
                        let expected: f64 = (0..count)
                            .map(|i| 2.0 * panel[i * rows + s] * matrix[columns[i] * size + columns[a]])
                            .sum();
                        assert!((out[a * rows + s] - expected).abs() < 1e-13);
                    }
                }
            }
        }
    }
}
