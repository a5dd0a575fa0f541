use crate::evidence::run_evidence::Prediction;
use dynident_identification::rows::{JointRows, RowConsumer, predicted_torque};
use dynident_identification::{LogError, Logs, RegressorModel};
use nalgebra::DMatrix;

/// Half-width of a 95 % interval in standard deviations; runs have far more rows than parameters, so this is the
/// normal value.
pub(crate) const HALF_WIDTH_95_SIGMAS: f64 = 1.96;

/// Matrix L with `Lᵀ L` equal to the covariance of some columns. It is computed by eigenvalues, because covariances
/// from few segments are singular.
pub(crate) fn covariance_root(covariance: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
    let eigen = covariance.select_rows(columns).select_columns(columns).symmetric_eigen();
    let root = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose()
}

pub(crate) struct Known<'a> {
    pub(crate) theta: &'a [f64],
    pub(crate) covariance: &'a [Vec<f64>],
    pub(crate) joint_sigma: &'a [f64],
}

/// Compares the measured torque of the recordings `indices` with the prediction by `known`, joint by joint; `None`
/// for a joint without rows.
pub(crate) fn predictions(
    logs: &Logs<'_>,
    model: &RegressorModel,
    indices: &[usize],
    known: &Known<'_>,
) -> Result<Vec<Option<Prediction>>, LogError> {
    let count = known.theta.len();
    let covariance = DMatrix::from_fn(count, count, |row, column| known.covariance[row][column]);
    let joints = (0..model.dof()).map(|joint| {
        let columns = model.layout().joint_columns(joint);
        JointSums {
            root: covariance_root(&covariance, columns),
            sigma: known.joint_sigma[joint],
            ..JointSums::default()
        }
    });
    let mut sums =
        Sums { model, theta: known.theta, joints: joints.collect(), counted: Vec::new(), buffer: Vec::new() };
    for &index in indices {
        logs.pass(model, index).run(&mut sums)?;
    }
    Ok(sums.joints.iter().map(JointSums::prediction).collect())
}

#[derive(Default)]
struct JointSums {
    root: DMatrix<f64>,
    sigma: f64,
    rows: usize,
    inside: usize,
    square: f64,
    widths: f64,
}

impl JointSums {
    fn prediction(&self) -> Option<Prediction> {
        let rows = self.rows as f64;
        (self.rows > 0).then(|| Prediction {
            rows: self.rows,
            inside: self.inside as f64 / rows,
            rms_error: (self.square / rows).sqrt(),
            half_width: self.widths / rows,
        })
    }
}

struct Sums<'a> {
    model: &'a RegressorModel,
    theta: &'a [f64],
    joints: Vec<JointSums>,
    counted: Vec<f64>,
    buffer: Vec<f64>,
}

impl RowConsumer for Sums<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        let mut counted = core::mem::take(&mut self.counted);
        let JointRows { joint, rows, panel, .. } = rows.counted(&mut counted);
        let columns = self.model.layout().joint_columns(joint);
        predicted_torque(panel, rows, columns, self.theta, &mut self.buffer);
        let sums = &mut self.joints[joint];
        for row in 0..rows {
            let error = panel[columns.len() * rows + row] - self.buffer[row];
            let of_direction = |direction: usize| -> f64 {
                (0..columns.len()).map(|place| sums.root[(direction, place)] * panel[place * rows + row]).sum()
            };
            let variance: f64 = (0..sums.root.nrows()).map(|direction| of_direction(direction).powi(2)).sum();
            let half = HALF_WIDTH_95_SIGMAS * (variance + sums.sigma * sums.sigma).sqrt();
            sums.rows += 1;
            sums.inside += usize::from(error.abs() <= half);
            sums.square += error * error;
            sums.widths += half;
        }
        self.counted = counted;
        Ok(())
    }
}
