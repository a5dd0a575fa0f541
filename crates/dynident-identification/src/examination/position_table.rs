//! A table of torque by position for a joint whose unexplained torque is a function of its position.
//!
//! The residual of a fit is not the function, because the fit has explained a part of it by other parameters. So the
//! torque of the joint is fitted by all columns w of its own rows together with piecewise linear functions h over the
//! range of its position:
//!
//! ```text
//! min over θ, f of  Σ (τ − w θ − h f)² + λ ‖f‖²
//! ```
//!
//! λ is small. It moves what both explain, for example a weight, to the columns.

use super::position_torque::PositionTorque;
use crate::lag::DELAY_SAMPLES;
use dynident_rows::{JointRows, LogError, LogPass, Logs, RawSamples, RegressorModel, RowConsumer, Silent};
use nalgebra::{DMatrix, DVector};

/// Number of pieces of the function.
const PIECES: usize = 12;

/// λ relative to the mean square of the functions.
const RIDGE: f64 = 1e-3;

/// Smallest weight of a column of the model relative to its own square, so that dependent columns do no harm.
const MIN_PIVOT: f64 = 1e-10;

/// Samples per second: many more than a joint has positions in that time.
const RATE_HZ: f64 = 50.0;

/// Extension beyond the limits of the joint, relative to the range of the logs, so that rounded positions stay inside.
const MARGIN: f64 = 0.1;

/// A joint with the table of its torque.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionTable {
    /// The unexplained torque.
    pub torque: PositionTorque,
    /// Position, rad (m), and torque, Nm (N), in ascending order. The ends are beyond the limits of the joint.
    pub points: Vec<[f64; 2]>,
}

impl PositionTable {
    /// The keys of a `[[torque]]` with this table.
    pub fn keys(&self) -> [String; 3] {
        let name = &self.torque.name;
        let points: Vec<String> = self.points.iter().map(|[q, torque]| format!("[{q:.3}, {torque:.4}]")).collect();
        [
            format!("name = {:?}", format!("spring_{name}")),
            format!("joint = {name:?}"),
            format!("table = [{}]", points.join(", ")),
        ]
    }
}

/// Normal equations of one joint.
struct JointFit<'a> {
    model: &'a RegressorModel,
    torque: &'a PositionTorque,
    gram: DMatrix<f64>,
    right: DVector<f64>,
}

impl RowConsumer for JointFit<'_> {
    fn filtered(&mut self, _: &JointRows<'_>) -> Result<(), LogError> {
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        let joint = self.torque.joint;
        let columns = self.model.layout().joint_columns(joint).len();
        let (panel, rows) = (samples.panels.joint(joint), samples.panels.samples());
        let position = &samples.motion[0][joint * rows..][..rows];
        let is_valid = |row: usize| samples.set_aside.get(joint).is_none_or(|ignored| !ignored[row]);
        let step = ((samples.rate_hz / RATE_HZ).round() as usize).max(1);
        for row in samples.settled.clone().step_by(step).filter(|&row| is_valid(row)) {
            let mut all = DVector::zeros(self.right.len());
            for column in 0..columns {
                all[column] = panel[column * rows + row];
            }
            let (piece, part) = self.piece(position[row]);
            all[columns + piece] = 1.0 - part;
            all[columns + piece + 1] = part;
            self.gram.ger(1.0, &all, &all, 1.0);
            self.right.axpy(panel[columns * rows + row], &all, 1.0);
        }
        Ok(())
    }
}

impl JointFit<'_> {
    /// Number of the piece at a position, and the position in it from 0 to 1.
    fn piece(&self, q: f64) -> (usize, f64) {
        let [from, to] = self.torque.range;
        let place = ((q - from) / (to - from) * PIECES as f64).clamp(0.0, PIECES as f64);
        let piece = (place as usize).min(PIECES - 1);
        (piece, place - piece as f64)
    }

    /// Torque at the ends of all pieces, without its mean; `None` if the equations are singular.
    fn values(mut self) -> Option<Vec<f64>> {
        let first = self.right.len() - PIECES - 1;
        let mean = (first..self.right.len()).map(|k| self.gram[(k, k)]).sum::<f64>() / (PIECES + 1) as f64;
        for k in 0..self.right.len() {
            let own = self.gram[(k, k)];
            // A column that is zero in the logs gets the value zero.
            self.gram[(k, k)] +=
                if k < first { MIN_PIVOT * own + f64::from(u8::from(own == 0.0)) } else { RIDGE * mean };
        }
        let scale = self.gram.diagonal().map(|own| own.sqrt().recip());
        let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, k| scale[i] * self.gram[(i, k)] * scale[k]);
        let solved = scaled.cholesky()?.solve(&self.right.component_mul(&scale)).component_mul(&scale);
        let values = solved.rows(first, PIECES + 1);
        let centre = values.mean();
        Some(values.iter().map(|value| value - centre).collect())
    }
}

/// The table of one joint from the first samples of the training logs `chosen`; `None` if they do not determine it.
pub(crate) fn position_table(
    logs: &Logs<'_>,
    model: &RegressorModel,
    chosen: &[usize],
    torque: &PositionTorque,
) -> Result<Option<PositionTable>, LogError> {
    let unknowns = model.layout().joint_columns(torque.joint).len() + PIECES + 1;
    let (gram, right) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
    let mut fit = JointFit { model, torque, gram, right };
    for &index in chosen {
        LogPass { most_samples: Some(DELAY_SAMPLES as u64), progress: &Silent, ..logs.pass(model, index) }
            .run(&mut fit)?;
    }
    Ok(fit.values().map(|values| PositionTable { torque: torque.clone(), points: points(model, torque, &values) }))
}

/// Points at the ends of all pieces. The first and the last piece continue for their length beyond the logs; from there
/// to the limits of the joint the torque is constant.
fn points(model: &RegressorModel, torque: &PositionTorque, values: &[f64]) -> Vec<[f64; 2]> {
    let ([from, to], limits) = (torque.range, model.model().joints()[torque.joint].limits);
    let length = (to - from) / PIECES as f64;
    let last = values.len() - 1;
    let mut points = vec![[from - length, 2.0 * values[0] - values[1]]];
    points.extend(values.iter().enumerate().map(|(k, torque)| [from + length * k as f64, *torque]));
    points.push([to + length, 2.0 * values[last] - values[last - 1]]);
    let margin = MARGIN * (to - from);
    let (before, behind) = (limits.lower.map(|lower| lower - margin), limits.upper.map(|upper| upper + margin));
    if let Some(before) = before.filter(|before| *before < points[0][0]) {
        points.insert(0, [before, points[0][1]]);
    }
    if let Some([q, torque]) = points.last().copied()
        && let Some(behind) = behind.filter(|behind| *behind > q)
    {
        points.push([behind, torque]);
    }
    points
}
