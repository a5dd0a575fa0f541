//! Blocks of a joint's rows.

use dynident_estimation::factor::BLOCK_ROWS;

/// Collects rows of a joint into blocks of [`BLOCK_ROWS`]. A triangular factor absorbs a large block much faster than
/// its parts, and the result does not depend on the sizes in which rows arrive.
#[derive(Clone, Debug)]
pub struct RowBlock {
    /// Column-major, with room for a whole block per column.
    values: Vec<f64>,
    columns: usize,
    rows: usize,
}

impl RowBlock {
    /// Empty block with this number of columns, including the torque.
    pub fn new(columns: usize) -> Self {
        Self { values: vec![0.0; columns * BLOCK_ROWS], columns, rows: 0 }
    }

    /// Adds `rows` rows (column-major); complete blocks go to `take`.
    ///
    /// # Errors
    /// Errors of `take`.
    pub fn push<E>(
        &mut self,
        panel: &[f64],
        rows: usize,
        mut take: impl FnMut(&[f64], usize) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut from = 0;
        while from < rows {
            let to = rows.min(from + BLOCK_ROWS - self.rows);
            for (column, values) in panel.chunks_exact(rows).zip(self.values.chunks_exact_mut(BLOCK_ROWS)) {
                values[self.rows..self.rows + to - from].copy_from_slice(&column[from..to]);
            }
            self.rows += to - from;
            from = to;
            if self.rows == BLOCK_ROWS {
                self.rows = 0;
                take(&self.values, BLOCK_ROWS)?;
            }
        }
        Ok(())
    }

    /// Passes the remaining rows to `take`.
    ///
    /// # Errors
    /// Errors of `take`.
    pub fn finish<E>(mut self, take: impl FnOnce(&[f64], usize) -> Result<(), E>) -> Result<(), E> {
        if self.rows == 0 {
            return Ok(());
        }
        for column in 1..self.columns {
            self.values.copy_within(column * BLOCK_ROWS..column * BLOCK_ROWS + self.rows, column * self.rows);
        }
        take(&self.values[..self.columns * self.rows], self.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_do_not_depend_on_the_arrival_of_rows() {
        let count = 2 * BLOCK_ROWS + 77;
        let value = |column: usize, row: usize| (1000 * column + row) as f64;
        for pieces in [1, 5, BLOCK_ROWS, BLOCK_ROWS + 3, count] {
            let (mut block, mut found, mut from) = (RowBlock::new(3), Vec::new(), 0);
            let mut take = |panel: &[f64], rows: usize| -> Result<(), ()> {
                found.push((panel.to_vec(), rows));
                Ok(())
            };
            while from < count {
                let rows = pieces.min(count - from);
                let panel: Vec<f64> = (0..3).flat_map(|c| (from..from + rows).map(move |row| value(c, row))).collect();
                block.push(&panel, rows, &mut take).unwrap();
                from += rows;
            }
            block.finish(&mut take).unwrap();
            let sizes: Vec<usize> = found.iter().map(|(_, rows)| *rows).collect();
            assert_eq!(sizes, [BLOCK_ROWS, BLOCK_ROWS, 77], "pieces of {pieces}");
            let mut first = 0;
            for (panel, rows) in found {
                let wanted: Vec<f64> =
                    (0..3).flat_map(|c| (first..first + rows).map(move |row| value(c, row))).collect();
                assert_eq!(panel, wanted);
                first += rows;
            }
        }
        RowBlock::new(2).finish(|_, _| Err("there is nothing")).unwrap();
    }
}
