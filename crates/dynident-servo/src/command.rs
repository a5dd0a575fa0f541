//! The command as the drive sees it: held between stamps, and late.

/// Commands of one joint at rising times, each held until the next.
#[derive(Debug)]
pub(crate) struct HeldCommand<'a> {
    times_s: &'a [f64],
    values: &'a [f64],
    /// Index of the command at the end of the last step.
    at: usize,
}

impl<'a> HeldCommand<'a> {
    pub(crate) fn held(times_s: &'a [f64], values: &'a [f64]) -> Self {
        Self { times_s, values, at: 0 }
    }

    /// Mean command over `start_s` to `end_s`, exact for held values, and its derivative by a shift of both times.
    /// Before the first stamp the first command holds. Calls must have rising times.
    pub(crate) fn mean(&mut self, start_s: f64, end_s: f64) -> (f64, f64) {
        while self.at + 1 < self.times_s.len() && self.times_s[self.at + 1] <= start_s {
            self.at += 1;
        }
        let first = self.values[self.at];
        let (mut at, mut from, mut sum) = (self.at, start_s, 0.0);
        while at + 1 < self.times_s.len() && self.times_s[at + 1] < end_s {
            sum += self.values[at] * (self.times_s[at + 1] - from);
            at += 1;
            from = self.times_s[at];
        }
        sum += self.values[at] * (end_s - from);
        let span = end_s - start_s;
        (sum / span, (self.values[at] - first) / span)
    }
}
