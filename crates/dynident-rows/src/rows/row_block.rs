//! Rows of one joint, gathered until they are a block.

use dynident_estimation::factor::BLOCK_ROWS;

/// Takes a joint's rows as they leave a filter, some at a time, and gives them on in blocks of [`BLOCK_ROWS`]: a factor
/// takes in a large block in a fraction of the time of its parts, and its numbers do not depend on how they come.
#[derive(Clone, Debug)]
pub struct RowBlock {
    /// Column by column, with room for a whole block in each.
    values: Vec<f64>,
    columns: usize,
    rows: usize,
}

impl RowBlock {
    /// No rows yet of so many columns, the torque among them.
    pub fn new(columns: usize) -> Self {
        Self { values: vec![0.0; columns * BLOCK_ROWS], columns, rows: 0 }
    }

    /// Takes `rows` rows, column by column; whole blocks go to `take`.
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

    /// Gives the rest to `take`.
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
    fn blocks_are_the_same_however_rows_come() {
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
