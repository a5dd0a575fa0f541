//! How far a limit can be passed between two samples that keep it.

use super::kind::LimitKind;
use super::set::LimitSet;

impl LimitSet {
    /// For each row the most by which its value between samples can exceed the larger of the two beside it, on a grid
    /// of step `step_s` that holds both ends, **given that the limit on the next derivatives holds everywhere**; `None`
    /// where no such limit is set.
    ///
    /// A twice differentiable x leaves its chord by at most `h²/8 max |ẍ|`, so position is bounded by the acceleration
    /// limit and velocity by the jerk limit; acceleration passes its samples by at most `h/2 max |jerk|`. Torque, power
    /// and places have no such closed bound here: see [`peaks`](super::peaks).
    pub fn sampling_margins(&self, step_s: f64) -> Vec<Option<f64>> {
        let size = |kind: LimitKind, subject: &str| {
            let row = self.constraints().iter().find(|row| row.kind == kind && row.subject == subject);
            row.map(|row| row.size)
        };
        let margin = |row: &super::Constraint| {
            let (next, factor) = match row.kind {
                LimitKind::Position => (LimitKind::Acceleration, step_s * step_s / 8.0),
                LimitKind::Speed => (LimitKind::Jerk, step_s * step_s / 8.0),
                LimitKind::Acceleration => (LimitKind::Jerk, step_s / 2.0),
                _ => return None,
            };
            size(next, &row.subject).map(|largest| factor * largest / row.size)
        };
        self.constraints().iter().map(margin).collect()
    }
}
