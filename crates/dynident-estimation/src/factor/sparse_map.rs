//! Sparse matrix C that combines columns, `[W | τ] C`.

use nalgebra::DMatrix;

/// Nonzero entries of C by column. C selects, adds and scales columns, so most entries are zero.
pub(super) struct SparseMap {
    /// Number of rows of C: old columns and the torque.
    size: usize,
    /// For every new column the old columns with their weights; the torque last.
    of_columns: Vec<Vec<(usize, f64)>>,
}

impl SparseMap {
    /// The nonzero entries of `map`, shape (old columns + 1, new columns + 1).
    pub(super) fn new(map: &DMatrix<f64>) -> Self {
        let entries = |column: usize| {
            let values = map.column(column);
            let entries = values.iter().copied().enumerate();
            entries.filter(|(_, weight)| *weight != 0.0).collect()
        };
        Self { size: map.nrows(), of_columns: (0..map.ncols()).map(entries).collect() }
    }

    /// Number of old columns plus the torque.
    pub(super) fn size(&self) -> usize {
        self.size
    }

    pub(super) fn columns(&self) -> usize {
        self.of_columns.len() - 1
    }

    pub(super) fn of_columns(&self) -> &[Vec<(usize, f64)>] {
        &self.of_columns
    }

    pub(super) fn of_row<'r>(&'r self, row: &'r [f64]) -> impl Iterator<Item = f64> + 'r {
        self.of_columns.iter().map(|entries| entries.iter().map(|&(from, weight)| weight * row[from]).sum())
    }
}
