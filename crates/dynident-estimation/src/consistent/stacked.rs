//! Newton systems as least squares on stacked rows, solved with orthogonal reflections instead of normal equations.
//!
//! A direction of a barrier method solves `GᵀG u = Gᵀh − g`, where G stacks the rows of the data, the priors and every
//! constraint in its own scaling. The matrix GᵀG loses everything below 1e-16 of its largest entry, and near the
//! cone's boundary constraint rows of size one are stacked on data rows of 1e10. G itself loses only the square root
//! of that. Each body's ten variables are represented in a frame (`Δx = J u`) in which the barrier's rows are the unit
//! matrix and need no reflection. The data rows are then reflected into the block triangle of these and the other rows
//! of the same body.
//!
//! The system is solved with the triangle and refined with the rows (corrected seminormal equations: Björck, Linear
//! Algebra Appl. 88 (1987) 31).

use super::coordinates::Matrix10;
use super::products::{add_transposed, solve_lower, solve_upper, subtract_product};
use crate::factor::{CHUNK_ROWS, Chunk, TriangleOnPanel, heights, row_start};
use dynident_lanes::{Level, dispatch};
use nalgebra::{DMatrix, DVector};

/// Rows `[.. C ..]` with consecutive variables only, in their frame.
#[derive(Clone, Debug)]
pub(super) struct LocalRows {
    pub(super) first: usize,
    pub(super) matrix: DMatrix<f64>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// Frames: `Δx[first..first + 10] = J u[first..first + 10]`; other variables have no frame.
    pub(super) frames: Vec<(usize, Matrix10)>,
    /// Rows of single bodies and scalars, in the frame.
    pub(super) local: Vec<LocalRows>,
    /// Rows that couple bodies, in the frame.
    pub(super) wide: Vec<DMatrix<f64>>,
}

#[derive(Clone, Debug)]
pub(super) struct Singles {
    /// Rows with one body or one variable only.
    local: Vec<usize>,
    /// Other rows, collected in one matrix.
    wide: Vec<usize>,
}

impl Singles {
    /// Appends their right-hand sides, one number per row.
    pub(super) fn append(&self, h: &[f64], local: &mut Vec<DVector<f64>>, wide: &mut Vec<DVector<f64>>) {
        local.extend(self.local.iter().map(|&row| DVector::from_element(1, h[row])));
        wide.push(DVector::from_iterator(self.wide.len(), self.wide.iter().map(|&row| h[row])));
    }
}

/// The triangle of a stack of rows.
#[derive(Clone, Debug)]
pub(super) struct StackedSystem {
    rows: Rows,
    triangle: Vec<f64>,
}

/// A right-hand side: one vector per set of rows, and a direct part.
#[derive(Clone, Debug)]
pub(super) struct RightSide {
    pub(super) local: Vec<DVector<f64>>,
    pub(super) wide: Vec<DVector<f64>>,
    /// −g, in the frame.
    pub(super) direct: DVector<f64>,
}

impl Rows {
    /// `Δx = J u`.
    pub(super) fn unframed(&self, u: &DVector<f64>) -> DVector<f64> {
        let mut x = u.clone();
        for (first, frame) in &self.frames {
            let part = frame * u.fixed_rows::<10>(*first);
            x.fixed_rows_mut::<10>(*first).copy_from(&part);
        }
        x
    }

    /// `Jᵀ g`.
    pub(super) fn framed_gradient(&self, gradient: &DVector<f64>) -> DVector<f64> {
        let mut framed = gradient.clone();
        for (first, frame) in &self.frames {
            let part = frame.tr_mul(&gradient.fixed_rows::<10>(*first));
            framed.fixed_rows_mut::<10>(*first).copy_from(&part);
        }
        framed
    }

    /// `A J`.
    pub(super) fn framed(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let mut framed = matrix.clone();
        for (first, frame) in &self.frames {
            let part = matrix.fixed_columns::<10>(*first) * frame;
            framed.fixed_columns_mut::<10>(*first).copy_from(&part);
        }
        framed
    }

    /// Adds single rows, in the frame, after all others.
    pub(super) fn add_singles(&mut self, rows: &[DVector<f64>]) -> Singles {
        let mut singles = Singles { local: Vec::new(), wide: Vec::new() };
        for (index, row) in rows.iter().enumerate() {
            let mut seen = row.iter().enumerate().filter(|(_, value)| **value != 0.0).map(|(column, _)| column);
            let least = seen.next().unwrap_or(0);
            let greatest = seen.next_back().unwrap_or(least);
            let (first, width) = self.group_of(least);
            if greatest < first + width {
                let matrix = DMatrix::from_iterator(1, width, row.rows(first, width).iter().copied());
                self.local.push(LocalRows { first, matrix });
                singles.local.push(index);
            } else {
                singles.wide.push(index);
            }
        }
        let columns = rows.first().map_or(0, DVector::len);
        self.wide.push(DMatrix::from_fn(singles.wide.len(), columns, |i, j| rows[singles.wide[i]][j]));
        singles
    }

    fn group_of(&self, variable: usize) -> (usize, usize) {
        let holds = |first: usize| first <= variable && variable < first + 10;
        self.frames.iter().find(|(first, _)| holds(*first)).map_or((variable, 1), |(first, _)| (*first, 10))
    }

    /// `C J` for columns from `first` to the end of that body or variable.
    pub(super) fn framed_part(&self, first: usize, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let frame = self.frames.iter().find(|(at, _)| *at == first && matrix.ncols() == 10);
        frame.map_or_else(|| matrix.clone(), |(_, frame)| matrix * DMatrix::from_column_slice(10, 10, frame.as_slice()))
    }

    /// `Gᵀ h` of a right-hand side, with its direct part.
    pub(super) fn transposed(&self, right: &RightSide) -> DVector<f64> {
        let mut sum = right.direct.clone();
        for (rows, h) in self.local.iter().zip(&right.local) {
            let place = &mut sum.as_mut_slice()[rows.first..rows.first + rows.matrix.ncols()];
            add_transposed(&rows.matrix, h.as_slice(), place);
        }
        for (rows, h) in self.wide.iter().zip(&right.wide) {
            add_transposed(rows, h.as_slice(), sum.as_mut_slice());
        }
        sum
    }

    /// `h − G u`.
    fn rest(&self, right: &RightSide, u: &DVector<f64>) -> RightSide {
        let mut rest = right.clone();
        for (rows, h) in self.local.iter().zip(&mut rest.local) {
            let own = &u.as_slice()[rows.first..rows.first + rows.matrix.ncols()];
            subtract_product(&rows.matrix, own, h.as_mut_slice());
        }
        for (rows, h) in self.wide.iter().zip(&mut rest.wide) {
            subtract_product(rows, u.as_slice(), h.as_mut_slice());
        }
        rest
    }
}

const MIN_PIVOT_SHARE: f64 = 1.0e-15;

impl StackedSystem {
    /// Reduces the rows over `size` variables. If rounding cancels the rows of a variable, the smallest sufficient row
    /// is added. `None` if that fails or an entry is not finite.
    pub(super) fn new(size: usize, rows: Rows) -> Option<Self> {
        let mut squares = vec![0.0; size];
        for part in &rows.local {
            for (column, square) in part.matrix.column_iter().zip(&mut squares[part.first..]) {
                *square += column.norm_squared();
            }
        }
        for part in rows.wide.iter().filter(|part| part.nrows() > 0) {
            for (column, square) in part.column_iter().zip(&mut squares) {
                *square += column.norm_squared();
            }
        }
        if !squares.iter().all(|square| *square > 0.0 && square.is_finite()) {
            return None;
        }
        let mut added = 0.0;
        loop {
            let triangle = reduced(size, &rows, &squares, added);
            let usable = (0..size).all(|k| triangle[row_start(size, k)] > MIN_PIVOT_SHARE * squares[k].sqrt());
            if usable {
                return Some(Self { rows, triangle });
            }
            added = if added == 0.0 { 1.0e-13 } else { 100.0 * added };
            if added > 1.0e-6 {
                return None;
            }
        }
    }

    pub(super) fn rows(&self) -> &Rows {
        &self.rows
    }

    /// u with `GᵀG u = Gᵀh + direct`, refined as long as this reduces the error.
    pub(super) fn solve(&self, right: &RightSide) -> DVector<f64> {
        let mut u = self.solve_once(self.rows.transposed(right));
        let mut size = f64::INFINITY;
        for _ in 0..4 {
            let rest = self.rows.transposed(&self.rows.rest(right, &u));
            let half = self.solve_lower(rest);
            // Error in the system's metric.
            let norm = half.norm();
            if norm.is_nan() || norm >= 0.3 * size {
                break;
            }
            size = norm;
            u += self.solve_upper(half);
        }
        u
    }

    fn solve_once(&self, right: DVector<f64>) -> DVector<f64> {
        self.solve_upper(self.solve_lower(right))
    }

    fn solve_lower(&self, mut b: DVector<f64>) -> DVector<f64> {
        solve_lower(&self.triangle, b.as_mut_slice());
        b
    }

    fn solve_upper(&self, mut y: DVector<f64>) -> DVector<f64> {
        solve_upper(&self.triangle, y.as_mut_slice());
        y
    }
}

/// Packed triangle of all rows and of `added √squares` on the diagonal.
fn reduced(size: usize, rows: &Rows, squares: &[f64], added: f64) -> Vec<f64> {
    let mut triangle = vec![0.0; row_start(size, size)];
    let mut small = [0.0; row_start(10, 10)];
    let (mut own, mut filled) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < size {
        let (_, width) = rows.group_of(at);
        let mine = || rows.local.iter().filter(|part| part.first == at && part.matrix.ncols() <= width);
        small.fill(0.0);
        for k in 0..width {
            small[row_start(width, k)] = added * squares[at + k].sqrt();
        }
        let chunks = mine().map(|part| part.matrix.nrows()).sum::<usize>().div_ceil(CHUNK_ROWS);
        if chunks > 0 {
            let mut panel = Panel::new(width, chunks, &mut own);
            for part in mine() {
                panel.place(0, &part.matrix);
            }
            panel.absorbed(&mut small[..row_start(width, width)], &mut filled);
        }
        for k in 0..width {
            let (from, to) = (row_start(width, k), row_start(size, at + k));
            triangle[to..to + width - k].copy_from_slice(&small[from..from + width - k]);
        }
        at += width;
    }
    let fits = |part: &LocalRows| part.matrix.ncols() <= rows.group_of(part.first).1;
    let others: Vec<&LocalRows> = rows.local.iter().filter(|part| !fits(part)).collect();
    let height =
        rows.wide.iter().map(DMatrix::nrows).sum::<usize>() + others.iter().map(|p| p.matrix.nrows()).sum::<usize>();
    let chunks = height.div_ceil(CHUNK_ROWS);
    if chunks == 0 {
        return triangle;
    }
    let mut panel = Panel::new(size, chunks, &mut own);
    for part in &rows.wide {
        panel.place(0, part);
    }
    for part in others {
        panel.place(part.first, &part.matrix);
    }
    panel.absorbed(&mut triangle, &mut filled);
    triangle
}

/// Rows to be reduced into a triangle.
struct Panel<'a> {
    size: usize,
    chunks: usize,
    values: &'a mut [Chunk],
    rows: usize,
}

impl<'a> Panel<'a> {
    /// Memory for rows over `size` columns; `memory` is reused.
    fn new(size: usize, chunks: usize, memory: &'a mut Vec<Chunk>) -> Self {
        memory.clear();
        memory.resize(size * chunks, Chunk::ZERO);
        Self { size, chunks, values: memory, rows: 0 }
    }

    /// Adds rows whose columns begin at `first`.
    fn place(&mut self, first: usize, part: &DMatrix<f64>) {
        if part.nrows() == 0 {
            return;
        }
        for (k, column) in part.as_slice().chunks_exact(part.nrows()).enumerate() {
            let mut chunks = self.values[(first + k) * self.chunks..(first + k + 1) * self.chunks].iter_mut();
            // First the partly filled chunk, then whole ones.
            let begun = self.rows % CHUNK_ROWS;
            let (head, rest) = column.split_at((CHUNK_ROWS - begun).min(column.len()));
            let mut chunks = chunks.by_ref().skip(self.rows / CHUNK_ROWS);
            if let Some(chunk) = chunks.next() {
                chunk.0[begun..begun + head.len()].copy_from_slice(head);
            }
            for (chunk, values) in chunks.zip(rest.chunks(CHUNK_ROWS)) {
                chunk.0[..values.len()].copy_from_slice(values);
            }
        }
        self.rows += part.nrows();
    }

    /// Reflects all rows into a packed triangle; `filled` is reused memory.
    fn absorbed(self, triangle: &mut [f64], filled: &mut Vec<usize>) {
        let Self { size, chunks, values: panel, .. } = self;
        heights(panel, chunks, filled);
        dispatch(Level::detect(), TriangleOnPanel { triangle, size, panel, chunks, heights: filled });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(rows: usize, columns: usize, seed: f64) -> DMatrix<f64> {
        // Full rank: the phase is not a sum of a row and a column term.
        DMatrix::from_fn(rows, columns, |i, j| ((i * i * 5 + j * 3 + i * j * j * 2) as f64 * 0.37 + seed).sin())
    }

    #[test]
    fn solves_rows_that_normal_equations_would_lose() {
        // Data rows of half the rank and 1e9 times the unit rows: the weak directions come from the unit rows only,
        // which are below 1e-16 · 1e18.
        let (size, scale) = (14, 1.0e9);
        let frame = Matrix10::identity();
        let wide = matrix(6, size, 0.4) * scale;
        let local = LocalRows { first: 0, matrix: DMatrix::identity(10, 10) };
        let singles = (10..size).map(|first| LocalRows { first, matrix: DMatrix::identity(1, 1) });
        let rows = Rows {
            frames: vec![(0, frame)],
            local: std::iter::once(local).chain(singles).collect(),
            wide: vec![wide.clone()],
        };
        let system = StackedSystem::new(size, rows).unwrap();
        // With h = (A v, v) the solution is v.
        let v = DVector::from_fn(size, |i, _| (i as f64).cos());
        let right = RightSide {
            local: std::iter::once(v.rows(0, 10).into_owned())
                .chain((10..size).map(|k| v.rows(k, 1).into_owned()))
                .collect(),
            wide: vec![&wide * &v],
            direct: DVector::zeros(size),
        };
        // Condition number 1e10 times rounding.
        assert!((system.solve(&right) - v).amax() < 1e-5);
    }

    #[test]
    fn frames_and_direct_part_equal_the_normal_equations() {
        let size = 12;
        let frame = Matrix10::from_fn(|i, j| f64::from(i == j) + 0.1 * ((i * 3 + j) as f64).sin());
        let mut rows = Rows { frames: vec![(1, frame)], ..Rows::default() };
        let data = matrix(20, size, 0.1);
        rows.wide.push(rows.framed(&data));
        rows.local.push(LocalRows { first: 1, matrix: matrix(4, 10, 0.7) });
        let system = StackedSystem::new(size, rows).unwrap();
        let gradient = DVector::from_fn(size, |i, _| (i as f64 * 0.9).sin());
        let framed = system.rows().framed_gradient(&gradient);
        let right =
            RightSide { local: vec![DVector::zeros(4)], wide: vec![DVector::zeros(20)], direct: framed.clone() };
        let u = system.solve(&right);
        let mut g = DMatrix::zeros(24, size);
        g.rows_mut(0, 20).copy_from(&system.rows().wide[0]);
        g.view_mut((20, 1), (4, 10)).copy_from(&matrix(4, 10, 0.7));
        assert!((g.tr_mul(&(&g * &u)) - framed).amax() < 1e-10);
        let x = system.rows().unframed(&u);
        assert!((data * x - &system.rows().wide[0] * &u).amax() < 1e-10);
    }

    #[test]
    fn variables_without_rows_or_with_nan_give_none() {
        let rows = |value: f64| Rows { wide: vec![DMatrix::from_row_slice(1, 2, &[1.0, value])], ..Rows::default() };
        assert!(StackedSystem::new(2, rows(0.0)).is_none());
        assert!(StackedSystem::new(2, rows(f64::NAN)).is_none());
    }
}
