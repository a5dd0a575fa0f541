//! Products of tall panels with small matrices: what a criterion costs besides the regressor itself.

use dynident_lanes::{Kernel, Lane, Level, dispatch};

/// Columns of a tile: sixteen sums stay in registers.
const TILE: usize = 4;

/// Adds `weight · Pᵀ P` to the square matrix `gram` (row-major, `size` wide) at rows and columns `columns`; `panel` holds the columns of `P` one after another, `rows` values each.
/// Both triangles are filled.
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

/// Four columns from `first`; past the end the last column repeats, and its sums are not used.
#[inline(always)]
fn column_tile(panel: &[f64], rows: usize, first: usize, count: usize) -> [&[f64]; TILE] {
    let of = |k: usize| {
        let column = (first + k).min(count - 1);
        &panel[column * rows..(column + 1) * rows]
    };
    [of(0), of(1), of(2), of(3)]
}

/// `out = factor · P G[columns, columns]`, in the shape of `P`; `matrix` is `G`, row-major, `size` wide.
#[allow(clippy::too_many_arguments, reason = "one product with its shapes")]
pub(crate) fn times_matrix(
    level: Level,
    panel: &[f64],
    rows: usize,
    columns: &[usize],
    matrix: &[f64],
    size: usize,
    factor: f64,
    out: &mut [f64],
) {
    dispatch(level, Times { panel, rows, columns, matrix, size, factor, out });
}

struct Times<'a> {
    panel: &'a [f64],
    rows: usize,
    columns: &'a [usize],
    matrix: &'a [f64],
    size: usize,
    factor: f64,
    out: &'a mut [f64],
}

impl Kernel for Times<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let (count, rows) = (self.columns.len(), self.rows);
        let whole = rows - rows % (2 * T::LANES);
        for j in (0..count).step_by(TILE) {
            let targets = TILE.min(count - j);
            let entry = |i: usize, k: usize| {
                let column = self.columns[(j + k).min(count - 1)];
                self.factor * self.matrix[self.columns[i] * self.size + column]
            };
            let mut at = 0;
            while at < whole {
                let mut sums = [[T::ZERO; 2]; TILE];
                for i in 0..count {
                    let source = &self.panel[i * rows + at..];
                    let (x, y) = (T::load(source), T::load(&source[T::LANES..]));
                    for k in 0..TILE {
                        let g = T::splat(entry(i, k));
                        sums[k][0] = x.mul_add(g, sums[k][0]);
                        sums[k][1] = y.mul_add(g, sums[k][1]);
                    }
                }
                for k in 0..targets {
                    let to = &mut self.out[(j + k) * rows + at..];
                    sums[k][0].store(to);
                    sums[k][1].store(&mut to[T::LANES..]);
                }
                at += 2 * T::LANES;
            }
            for k in 0..targets {
                for s in whole..rows {
                    self.out[(j + k) * rows + s] = (0..count).map(|i| self.panel[i * rows + s] * entry(i, k)).sum();
                }
            }
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
                times_matrix(level, &panel, rows, &columns, &matrix, size, 2.0, &mut out);
                for a in 0..count {
                    for b in 0..count {
                        let expected: f64 = (0..rows).map(|s| 0.5 * panel[a * rows + s] * panel[b * rows + s]).sum();
                        // Sums of at most 64 products below one.
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
