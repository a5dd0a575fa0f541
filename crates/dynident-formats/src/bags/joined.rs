//! Combines the samples of several topics on the clock of the first one.

use std::collections::VecDeque;

const MAX_WAITING_ROWS: usize = 1 << 20;
/// Minimum length of a gap, in mean sampling intervals.
const MIN_GAP_STEPS: f64 = 5.0;
const MIN_STEPS_FOR_MEAN: u64 = 8;

/// Values of one topic with their time, ns.
type Stamped = (i64, Vec<f64>);

/// A topic that is interpolated at the times of the first one.
#[derive(Debug, Default)]
struct Side {
    samples: VecDeque<Stamped>,
    first_ns: i64,
    last_ns: i64,
    steps: u64,
    /// Times of the samples in the queue that follow a gap.
    holes: VecDeque<i64>,
}

enum Outcome {
    Ready(Vec<f64>),
    Early,
    Wait,
}

/// Rows of a first topic, joined with others by linear interpolation.
#[derive(Debug)]
pub(super) struct Joined {
    rows: VecDeque<Stamped>,
    sides: Vec<Side>,
    ended: bool,
}

impl Joined {
    pub(super) fn new(sides: usize) -> Self {
        let sides = (0..sides).map(|_| Side::default()).collect();
        Self { rows: VecDeque::new(), sides, ended: false }
    }

    /// Adds a row of the first topic.
    ///
    /// # Errors
    /// The index of the topic without messages for too long.
    pub(super) fn push_row(&mut self, at_ns: i64, values: Vec<f64>) -> Result<(), usize> {
        self.rows.push_back((at_ns, values));
        if self.rows.len() <= MAX_WAITING_ROWS {
            return Ok(());
        }
        let silent = self.sides.iter().position(|side| side.last_ns < at_ns);
        Err(silent.unwrap_or(0))
    }

    /// Adds a sample of another topic. A sample that is not later than the previous one is ignored.
    pub(super) fn push_side(&mut self, side: usize, at_ns: i64, values: Vec<f64>) {
        let side = &mut self.sides[side];
        if side.steps == 0 && side.samples.is_empty() {
            side.first_ns = at_ns;
        } else {
            if at_ns <= side.last_ns {
                return;
            }
            let mean = (side.last_ns - side.first_ns) as f64 / side.steps.max(1) as f64;
            if side.steps >= MIN_STEPS_FOR_MEAN && (at_ns - side.last_ns) as f64 > MIN_GAP_STEPS * mean {
                side.holes.push_back(at_ns);
            }
            side.steps += 1;
        }
        side.last_ns = at_ns;
        side.samples.push_back((at_ns, values));
    }

    pub(super) fn end(&mut self) {
        self.ended = true;
    }

    /// The next row: the values of the first topic, then of the others. `None` if more input is needed, or at the end.
    pub(super) fn next(&mut self) -> Option<Vec<f64>> {
        loop {
            let (at_ns, values) = self.rows.front()?;
            let (at_ns, mut row) = (*at_ns, values.clone());
            let mut outcome = Outcome::Ready(Vec::new());
            for side in &mut self.sides {
                match side.at(at_ns) {
                    Outcome::Ready(values) => row.extend(values),
                    other => {
                        outcome = other;
                        break;
                    }
                }
            }
            match outcome {
                Outcome::Ready(_) => {
                    self.rows.pop_front();
                    return Some(row);
                }
                Outcome::Wait if !self.ended => return None,
                // The time is before the first or after the last message of a topic.
                Outcome::Early | Outcome::Wait => {
                    self.rows.pop_front();
                }
            }
        }
    }
}

impl Side {
    /// The values of the topic at `at_ns`: linear between the neighbouring samples, NaN in a gap.
    fn at(&mut self, at_ns: i64) -> Outcome {
        while self.samples.get(1).is_some_and(|next| next.0 <= at_ns) {
            self.samples.pop_front();
        }
        let Some((from_ns, from)) = self.samples.front() else { return Outcome::Wait };
        if *from_ns == at_ns {
            return Outcome::Ready(from.clone());
        }
        if *from_ns > at_ns {
            return Outcome::Early;
        }
        let Some((to_ns, to)) = self.samples.get(1) else { return Outcome::Wait };
        while self.holes.front().is_some_and(|end| end <= from_ns) {
            self.holes.pop_front();
        }
        if self.holes.front() == Some(to_ns) {
            return Outcome::Ready(vec![f64::NAN; from.len()]);
        }
        let share = (at_ns - from_ns) as f64 / (to_ns - from_ns) as f64;
        Outcome::Ready(from.iter().zip(to).map(|(a, b)| a + (b - a) * share).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_interpolated_between_neighbours_or_left_out() {
        let mut joined = Joined::new(1);
        for at in [5, 10, 14, 20, 26] {
            joined.push_row(at, vec![at as f64]).unwrap();
        }
        assert_eq!(joined.next(), None);
        joined.push_side(0, 8, vec![1.0]);
        joined.push_side(0, 16, vec![3.0]);
        // A sample with an earlier time is ignored.
        joined.push_side(0, 12, vec![100.0]);
        assert_eq!(joined.next(), Some(vec![10.0, 1.5]));
        assert_eq!(joined.next(), Some(vec![14.0, 2.5]));
        assert_eq!(joined.next(), None);
        joined.push_side(0, 20, vec![-1.0]);
        assert_eq!(joined.next(), Some(vec![20.0, -1.0]));
        joined.end();
        assert_eq!(joined.next(), None);
        assert!(joined.rows.is_empty());
    }

    #[test]
    fn a_gap_of_the_other_topic_is_not_interpolated() {
        let mut joined = Joined::new(1);
        for at in (0..20).chain(60..64) {
            joined.push_side(0, 10 * at, vec![at as f64]);
        }
        for at in [95, 300, 605] {
            joined.push_row(at, vec![]).unwrap();
        }
        joined.end();
        assert_eq!(joined.next(), Some(vec![9.5]));
        assert!(joined.next().unwrap()[0].is_nan());
        assert_eq!(joined.next(), Some(vec![60.5]));
    }
}
