//! Evenly spaced pieces of a stream of rows, within a maximum number of rows.

/// Divisor of the maximum number of rows that gives the length of a piece. Few long pieces lose few rows to end
/// effects.
const PIECES_PER_EXCERPT: usize = 8;

/// Kept rows: every `stride`-th piece, all of equal length except before interruptions.
///
/// The length of a stream is unknown until its end. Therefore all pieces are kept until the maximum number of rows is
/// reached. Then every other piece is dropped and the stride doubles. At the end the kept pieces are equally spaced and
/// contain at least about half of the maximum number of rows.
pub(super) struct Pieces {
    /// Maximum number of rows in total, and number of rows in a piece.
    most: usize,
    length: usize,
    stride: usize,
    begun: usize,
    kept: Vec<Piece>,
    /// Whether the current piece is kept, and the number of its rows so far.
    keeping: bool,
    rows: usize,
}

struct Piece {
    number: usize,
    time_s: Vec<f64>,
    values: Vec<f64>,
    width: usize,
}

impl Pieces {
    /// Storage for about `most` rows in pieces of at least `least` rows, and for at least two pieces.
    pub(super) fn new(most: usize, least: usize) -> Self {
        let length = (most / PIECES_PER_EXCERPT).max(least).max(1);
        Self { most, length, stride: 1, begun: 0, kept: Vec::new(), keeping: false, rows: length }
    }

    /// Starts a new piece after an interruption.
    pub(super) fn begin(&mut self) {
        self.rows = self.length;
    }

    pub(super) fn push(&mut self, time_s: f64, values: impl Iterator<Item = f64>) {
        if self.rows >= self.length {
            self.next();
        }
        self.rows += 1;
        if let (true, Some(piece)) = (self.keeping, self.kept.last_mut()) {
            piece.time_s.push(time_s);
            piece.values.extend(values);
            piece.width = piece.values.len() / piece.time_s.len();
        }
    }

    fn next(&mut self) {
        let number = self.begun;
        self.begun += 1;
        self.rows = 0;
        self.keeping = number.is_multiple_of(self.stride);
        if !self.keeping {
            return;
        }
        while self.kept.len() > 1 && self.kept_rows() + self.length > self.most {
            self.stride *= 2;
            self.kept.retain(|piece| piece.number.is_multiple_of(self.stride));
            self.keeping = number.is_multiple_of(self.stride);
        }
        if self.keeping {
            self.kept.push(Piece { number, time_s: Vec::new(), values: Vec::new(), width: 0 });
        }
    }

    fn kept_rows(&self) -> usize {
        self.kept.iter().map(|piece| piece.time_s.len()).sum()
    }

    /// Times of all kept rows, and their values column by column.
    pub(super) fn columns(self) -> (Vec<f64>, Vec<Vec<f64>>) {
        let width = self.kept.iter().map(|piece| piece.width).max().unwrap_or(0);
        let of_column = |column: usize| -> Vec<f64> {
            let rows = self.kept.iter().flat_map(|piece| piece.values.chunks_exact(piece.width.max(1)));
            rows.map(|row| row[column]).collect()
        };
        let columns = (0..width).map(of_column).collect();
        (self.kept.iter().flat_map(|piece| piece.time_s.iter().copied()).collect(), columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_streams_are_kept_whole_and_long_ones_in_even_pieces() {
        for (rows, stride) in [(1, 1), (800, 1), (801, 2), (1_600, 2), (50_000, 64)] {
            let mut pieces = Pieces::new(800, 0);
            for row in 0..rows {
                pieces.push(f64::from(row), [f64::from(row), -f64::from(row)].into_iter());
            }
            let (time_s, columns) = pieces.columns();
            let expected: Vec<f64> = (0..rows).filter(|row| (row / 100) % stride == 0).map(f64::from).collect();
            assert_eq!(time_s, expected, "{rows} rows");
            assert_eq!(columns[0], expected);
            assert!(columns[1].iter().zip(&expected).all(|(a, b)| *a == -b));
            assert!(time_s.len() <= 800);
            assert!(rows <= 800 || time_s.len() >= 400);
        }
    }

    #[test]
    fn pieces_have_the_minimum_length() {
        let mut pieces = Pieces::new(800, 500);
        (0..5_000).for_each(|row| pieces.push(f64::from(row), core::iter::empty()));
        assert_eq!(pieces.columns().0, (0..500).chain(4_000..4_500).map(f64::from).collect::<Vec<_>>());
    }

    #[test]
    fn an_interruption_ends_a_piece() {
        let mut pieces = Pieces::new(80, 0);
        for row in 0..400 {
            if row == 5 {
                pieces.begin();
            }
            pieces.push(f64::from(row), core::iter::once(0.0));
        }
        // The pieces have 10 rows, except the first, which has 5 rows. Of these 41 pieces, every eighth is kept.
        let expected: Vec<f64> =
            (0..400).filter(|row| if *row < 5 { true } else { ((row - 5) / 10 + 1) % 8 == 0 }).map(f64::from).collect();
        assert_eq!(pieces.columns().0, expected);
    }
}
