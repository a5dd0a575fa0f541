//! The paper's position map exactly as printed, for demonstration; studies use `position-map`.

use dynident_recording::{Derivatives, Differentiator, FilterError, LogisticPath, Place, SampleRanges};

/// Eqs. 15 and 16 exactly as printed, for the stroke of each joint: the branch changes at half a period even if the
/// joint lags, and positions outside the stroke are mapped to velocities of the wrong sign.
#[derive(Clone, Debug)]
pub(crate) struct LiteralMap {
    pub(crate) paths: Vec<LogisticPath>,
}

impl Differentiator for LiteralMap {
    fn name(&self) -> &'static str {
        "literal-map"
    }

    fn minimum_samples(&self) -> usize {
        1
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let Some(path) = self.paths.get(place.joint) else {
            let problem = format!("the log has more joints than the {} strokes", self.paths.len());
            return Err(FilterError::Reference { problem });
        };
        for (i, &q) in q.iter().enumerate() {
            out.q[i] = q;
            [out.dq[i], out.ddq[i]] = rates_as_written(path, q, place.time_s(i));
        }
        Ok(Vec::new())
    }
}

/// Velocity and acceleration at any position, also outside the stroke; zero for a joint at rest (A = 0).
fn rates_as_written(path: &LogisticPath, q: f64, time_s: f64) -> [f64; 2] {
    let LogisticPath { amplitude, omega, offset, .. } = *path;
    if amplitude == 0.0 {
        return [0.0; 2];
    }
    let (gone, left) = (q - offset, amplitude - (q - offset));
    let dq = omega / amplitude * gone * left;
    let ddq = omega * omega / (amplitude * amplitude) * gone * left * (left - gone);
    [if path.goes_there(time_s) { dq } else { -dq }, ddq]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_the_stroke_it_is_the_map_and_outside_the_sign_is_wrong() {
        let path = LogisticPath { amplitude: 2.0, omega: 1.0, offset: 0.0, period_s: 40.0, repetitions: 1 };
        for time in [5.0, 9.0, 12.0, 31.0] {
            let [q, dq, ddq] = path.at(time);
            let [map_dq, map_ddq] = rates_as_written(&path, q, time);
            // Rounding of a product of four factors of order one.
            assert!((map_dq - dq).abs() < 1e-14 && (map_ddq - ddq).abs() < 1e-14, "{time}");
        }
        assert!(rates_as_written(&path, 2.1, 9.0)[0] < 0.0);
    }
}
