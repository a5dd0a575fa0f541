//! Paths of static pictures.

use core::fmt::Write;

pub(crate) fn tenth(x: f64) -> f64 {
    (10.0 * x).round() / 10.0
}

/// Draws a path through points, px; a point that is not finite gives a gap.
#[derive(Default)]
pub(crate) struct Pen {
    text: String,
    down: bool,
}

impl Pen {
    pub(crate) fn to(&mut self, point: [f64; 2]) {
        let [x, y] = point;
        let drawn = x.is_finite() && y.is_finite();
        if drawn {
            let command = if self.down { 'L' } else { 'M' };
            // Writing to a string cannot fail.
            let _ = write!(self.text, "{command}{x:.1} {y:.1}");
        }
        self.down = drawn;
    }

    pub(crate) fn path(self) -> String {
        self.text
    }
}
