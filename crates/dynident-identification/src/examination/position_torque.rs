//! Search for torque that depends on a joint's position and that the study does not state: a spring, a counterbalance,
//! a cable.
//!
//! The torque of each joint is fitted by three groups of columns: all columns w of its rows, columns l of further
//! friction laws and an inertia, and piecewise linear functions h of its position:
//!
//! ```text
//! min over θ, φ, f of  Σ (τ − w θ − l φ − h f)² + λ ‖f‖²
//! ```
//!
//! The weight λ is small. Because of it, torque that both groups can explain, for example of a weight, is attributed to
//! w and l. The function is reported if the residual without h is clearly larger. Friction that no law of the study
//! contains, and errors of other parameters, are explained by w and l, so they do not look like a spring.

use crate::examination_settings::ExaminationSettings;
use crate::friction::{FURTHER_LAWS, FurtherLaws};
use crate::lag::DELAY_SAMPLES;
use dynident_recording::{Finding, Level};
use dynident_rows::{JointRows, LogError, LogPass, Logs, RawSamples, RegressorModel, RowConsumer, Silent};
use nalgebra::{DMatrix, DVector};

/// Number of linear pieces of the function.
const PIECES: usize = 12;

/// Weight λ relative to the mean square of the functions h.
const RIDGE: f64 = 1e-3;

/// Regularisation of the other columns relative to their own squares, so that dependent columns do no harm.
const MIN_PIVOT: f64 = 1e-10;

/// Number of samples per second that are used; the position of a joint changes little between them.
const RATE_HZ: f64 = 50.0;

/// Extension of the function's range beyond the limits of the joint, relative to the range in the logs, so that rounded
/// positions remain inside.
const MARGIN: f64 = 0.1;

/// Velocity below which a sample is excluded, relative to the root mean square velocity of the joint. Friction at rest
/// can have any value up to the friction in motion, so rests at few positions would look like a function of the
/// position.
const REST_SHARE: f64 = 0.05;

/// Minimum number of samples per unknown.
const MIN_SAMPLES: usize = 5;

/// Unexplained torque of one joint as a function of its position.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionTorque {
    /// Name of the joint.
    pub name: String,
    /// Root mean square of the joint's torque that only the function explains, Nm (N).
    pub rms_nm: f64,
    /// Ratio of the unexplained torque with this function to that without it.
    pub left: f64,
    /// Root mean square of the measured torque, Nm (N).
    pub torque_nm: f64,
    /// Points of the function: position, rad (m), and torque, Nm (N), with ascending positions. The ends are beyond the
    /// limits of the joint.
    pub points: Vec<[f64; 2]>,
}

impl PositionTorque {
    /// Keys of a `[[torque]]` table for the study that describes this function.
    pub fn keys(&self) -> [String; 3] {
        let points: Vec<String> = self.points.iter().map(|[q, torque]| format!("[{q:.3}, {torque:.4}]")).collect();
        [
            format!("name = {:?}", format!("spring_{}", self.name)),
            format!("joint = {:?}", self.name),
            format!("table = [{}]", points.join(", ")),
        ]
    }

    /// The finding with its size, for a message.
    pub fn words(&self) -> String {
        format!(
            "a function of its position explains {:.0} % of its unexplained torque ({:.3} Nm (N) of {:.3}, root mean squares), as of a spring, \
             counterbalance or cable",
            100.0 * (1.0 - self.left),
            self.rms_nm,
            self.torque_nm
        )
    }
}

/// A warning for each joint.
pub fn position_torque_findings(found: &[PositionTorque]) -> impl Iterator<Item = Finding> {
    found.iter().map(|torque| Finding {
        code: "fit-position-torque".to_owned(),
        level: Level::Warning,
        channel: format!("torque {}", torque.name),
        message: format!("{}; `dynident check` prints the [[torque]] table for it", torque.words()),
    })
}

/// Finds joints whose torque in the training logs `chosen` contains an unexplained function of the joint position. The
/// number of samples of all logs together is limited to the number that the estimation of one log's lag uses.
///
/// # Errors
/// An unreadable recording.
pub fn position_torques(
    logs: &Logs<'_>,
    model: &RegressorModel,
    chosen: &[usize],
    settings: &ExaminationSettings,
) -> Result<Vec<PositionTorque>, LogError> {
    let most_samples = Some((DELAY_SAMPLES / chosen.len().max(1)) as u64);
    let one = |&index: &usize| {
        let mut samples = AllJoints::new(model);
        LogPass { most_samples, progress: &Silent, ..logs.pass(model, index) }.run(&mut samples)?;
        Ok::<_, LogError>(samples.joints)
    };
    let of_logs = logs.execution.try_map(chosen, one)?;
    let joint = |joint: usize| {
        let parts: Vec<&JointSamples> = of_logs.iter().map(|log| &log[joint]).collect();
        JointFit::new(model, joint, &parts)?.judged(settings)
    };
    Ok((0..model.dof()).filter_map(joint).collect())
}

/// Samples of one joint: regressor columns followed by the torque, row by row, and the motion.
#[derive(Default)]
struct JointSamples {
    rows: Vec<f64>,
    motion: Vec<[f64; 3]>,
}

struct AllJoints<'a> {
    model: &'a RegressorModel,
    joints: Vec<JointSamples>,
}

impl<'a> AllJoints<'a> {
    fn new(model: &'a RegressorModel) -> Self {
        Self { model, joints: (0..model.dof()).map(|_| JointSamples::default()).collect() }
    }
}

impl RowConsumer for AllJoints<'_> {
    fn filtered(&mut self, _: &JointRows<'_>) -> Result<(), LogError> {
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
        let rows = samples.panels.samples();
        let step = ((samples.rate_hz / RATE_HZ).round() as usize).max(1);
        for (joint, to) in self.joints.iter_mut().enumerate() {
            let columns = self.model.layout().joint_columns(joint).len();
            let panel = samples.panels.joint(joint);
            let is_valid = |row: usize| samples.set_aside.get(joint).is_none_or(|ignored| !ignored[row]);
            for row in samples.settled.clone().step_by(step).filter(|&row| is_valid(row)) {
                to.rows.extend((0..=columns).map(|column| panel[column * rows + row]));
                to.motion.push([0, 1, 2].map(|of: usize| samples.motion[of][joint * rows + row]));
            }
        }
        Ok(())
    }
}

/// Normal equations of one joint: columns of the model, of further friction laws and an inertia, and of the functions
/// of the position.
struct JointFit<'a> {
    model: &'a RegressorModel,
    joint: usize,
    range: [f64; 2],
    gram: DMatrix<f64>,
    right: DVector<f64>,
    squares: f64,
    samples: usize,
}

impl<'a> JointFit<'a> {
    /// Computes the normal equations; `None` without motion or with too few samples.
    fn new(model: &'a RegressorModel, joint: usize, parts: &[&JointSamples]) -> Option<Self> {
        let columns = model.layout().joint_columns(joint).len();
        let others = columns + FURTHER_LAWS + 1;
        let unknowns = others + PIECES + 1;
        let all = || parts.iter().flat_map(|part| &part.motion);
        let squares: f64 = all().map(|[_, dq, _]| dq * dq).sum();
        let rest_below = REST_SHARE * (squares / all().count().max(1) as f64).sqrt();
        let moves = |[_, dq, _]: &[f64; 3]| dq.abs() > rest_below;
        let motion = || all().filter(|sample| moves(sample));
        let from = motion().map(|[q, ..]| *q).fold(f64::INFINITY, f64::min);
        let to = motion().map(|[q, ..]| *q).fold(f64::NEG_INFINITY, f64::max);
        let samples = motion().count();
        if !(to - from).is_finite() || to <= from || samples < MIN_SAMPLES * unknowns {
            return None;
        }
        let laws = FurtherLaws::of(&model.parametric, joint);
        let mut fit = Self {
            model,
            joint,
            range: [from, to],
            gram: DMatrix::zeros(unknowns, unknowns),
            right: DVector::zeros(unknowns),
            squares: 0.0,
            samples,
        };
        let mut row = DVector::zeros(unknowns);
        for part in parts {
            let samples = part.rows.chunks_exact(columns + 1).zip(&part.motion);
            for (own, &[q, dq, ddq]) in samples.filter(|(_, sample)| moves(sample)) {
                let torque = own[columns];
                row.fill(0.0);
                row.as_mut_slice()[..columns].copy_from_slice(&own[..columns]);
                row.as_mut_slice()[columns..others - 1].copy_from_slice(&laws.row(dq, torque));
                row[others - 1] = ddq;
                let (piece, share) = fit.piece(q);
                row[others + piece] = 1.0 - share;
                row[others + piece + 1] = share;
                fit.gram.ger(1.0, &row, &row, 1.0);
                fit.right.axpy(torque, &row, 1.0);
                fit.squares += torque * torque;
            }
        }
        Some(fit)
    }

    /// Index of the linear piece at a position, and the relative position within the piece from 0 to 1.
    fn piece(&self, q: f64) -> (usize, f64) {
        let [from, to] = self.range;
        let place = ((q - from) / (to - from) * PIECES as f64).clamp(0.0, PIECES as f64);
        let piece = (place as usize).min(PIECES - 1);
        (piece, place - piece as f64)
    }

    fn judged(&self, settings: &ExaminationSettings) -> Option<PositionTorque> {
        let unknowns = self.right.len();
        let others = unknowns - PIECES - 1;
        let (_, without) = self.solved(others)?;
        let (values, with) = self.solved(unknowns)?;
        let mean_square = |squares: f64| squares / self.samples as f64;
        let (rms_nm, torque_nm) = (mean_square(without - with).max(0.0).sqrt(), mean_square(self.squares).sqrt());
        let left = (with / without).sqrt();
        if !(left <= settings.max_left_by_position && rms_nm >= settings.min_position_ratio * torque_nm) {
            return None;
        }
        let function: Vec<f64> = values.iter().skip(others).copied().collect();
        let mean = function.iter().sum::<f64>() / function.len() as f64;
        let centred: Vec<f64> = function.iter().map(|value| value - mean).collect();
        let name = self.model.model().joints()[self.joint].name.clone();
        Some(PositionTorque { name, rms_nm, left, torque_nm, points: self.points(&centred) })
    }

    /// Values of the first `count` unknowns and the sum of the squared residuals; `None` for singular equations.
    fn solved(&self, count: usize) -> Option<(DVector<f64>, f64)> {
        let others = self.right.len() - PIECES - 1;
        let mut gram = self.gram.view((0, 0), (count, count)).into_owned();
        let right = self.right.rows(0, count).into_owned();
        let functions = (others..self.right.len()).map(|k| self.gram[(k, k)]).sum::<f64>() / (PIECES + 1) as f64;
        for k in 0..count {
            let own = gram[(k, k)];
            // A column that is zero in the logs gets the value zero.
            let weight = if k < others { MIN_PIVOT * own + f64::from(u8::from(own == 0.0)) } else { RIDGE * functions };
            gram[(k, k)] += weight;
        }
        let scale = gram.diagonal().map(|own| own.sqrt().recip());
        let scaled = DMatrix::from_fn(count, count, |i, k| scale[i] * gram[(i, k)] * scale[k]);
        let values = scaled.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
        let explained = 2.0 * values.dot(&right) - values.dot(&(self.gram.view((0, 0), (count, count)) * &values));
        // A sum of squares cannot be smaller than its rounding error.
        Some((values, (self.squares - explained).max(1e-12 * self.squares)))
    }

    /// Points of the function at the ends of all pieces. The first and the last piece are extended by their own length
    /// beyond the positions in the logs; from there to the limits of the joint, the torque is constant.
    fn points(&self, values: &[f64]) -> Vec<[f64; 2]> {
        let ([from, to], limits) = (self.range, self.model.model().joints()[self.joint].limits);
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
}
