//! Torque prediction of a model along a motion.

use crate::error::Error;
use crate::result::{LogSummary, ResultFile};
use crate::study::{Study, StudyFile};
use dynident_dynamics::{BatchWorkspace, Panels, TermHistory, regressor_panels_following};
use dynident_estimation::student_half_width;
use dynident_identification::RegressorModel;
use dynident_model::terms::JointMotion;
use dynident_online::{OnlineError, StartingPoint, Watch, WatchSettings};
use nalgebra::{DMatrix, DMatrixView};
use std::path::Path;

/// Number of samples per block: enough for full SIMD lanes, few enough for the cache.
const BLOCK_SAMPLES: usize = 128;

/// Predicts torques with the model of a result.
///
/// The prediction for joint j in one sample is `τ̂_j = W_j θ` with the regressor row W_j and the base parameters θ,
/// which are those of the physically consistent model if the result has one. The 95 % band `± t √(W_j V W_jᵀ + σ_j²)`
/// is valid for torque that is filtered as in the fit. V is the covariance of the estimate, σ_j the standard
/// deviation of the joint's filtered residual. V contains no variance of base parameters that the logs do not excite,
/// so the band is invalid for motion that needs them.
#[derive(Clone, Debug)]
pub struct TorquePredictor {
    model: RegressorModel,
    theta: Vec<f64>,
    covariance: DMatrix<f64>,
    joint_sigma: Vec<f64>,
    width: f64,
    /// Lowest cut-off frequency of the filters that were applied to the residuals, Hz.
    band_hz: Option<f64>,
}

/// Torques along a motion, joint-major, Nm (N).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PredictedTorque {
    /// Predicted torque.
    pub tau: Vec<f64>,
    /// Half-width of the 95 % band.
    pub half_width_95: Vec<f64>,
}

impl TorquePredictor {
    /// Builds the predictor from a result; `result_path` is the name of the result in messages. `study` is the study
    /// of the result; the robot file is also searched in the folder `data`.
    ///
    /// # Errors
    /// If the result does not belong to the study's robot, or contains values that are not finite.
    pub fn new(
        stored: &ResultFile,
        result_path: &Path,
        study: &Study,
        study_path: &Path,
        data: Option<&Path>,
    ) -> Result<Self, Error> {
        let study = StudyFile::new(study, study_path);
        let wrong = |message: &str| Error::Result { path: result_path.to_owned(), message: message.to_owned() };
        let fitted = stored.as_fitted(&study);
        let study = study.with_study(&fitted);
        let robot = study.robot_in(&study.folders(data))?;
        let free = stored.base_values(result_path, &robot.parametric)?;
        let model = stored.regressor_model(result_path, &robot.parametric)?;
        let theta = stored.consistent_values(result_path)?.unwrap_or(free);
        let (rows, n) = (&stored.base_parameter_covariance, theta.len());
        if rows.len() != n || rows.iter().any(|row| row.len() != n || row.iter().any(|value| !value.is_finite())) {
            return Err(wrong(
                "base_parameter_covariance does not contain one finite number per pair of base parameters",
            ));
        }
        let joint_sigma: Vec<f64> = stored.joints.iter().map(|joint| joint.residual_std_nm).collect();
        if joint_sigma.len() != model.dof() || joint_sigma.iter().any(|sigma| !sigma.is_finite()) {
            return Err(wrong("residual_std_nm does not contain one finite number per joint"));
        }
        let own = |log: &LogSummary| log.filter_cutoff_hz.unwrap_or(0.5 * log.filtered_rate_hz);
        let band_hz = stored.logs.iter().map(own).filter(|hz| *hz > 0.0).reduce(f64::min);
        let equations = stored.training.samples * model.dof();
        Ok(Self {
            covariance: DMatrix::from_fn(n, n, |row, column| rows[row][column]),
            width: student_half_width(0.95, equations.saturating_sub(n).max(1) as f64),
            model,
            theta,
            joint_sigma,
            band_hz,
        })
    }

    /// Number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.model.dof()
    }

    /// Names of the joints, in the order of the motion.
    pub fn joint_names(&self) -> Vec<String> {
        self.model.joint_names()
    }

    /// Creates a monitor of the robot with this model. The reference is θ with the covariance of the estimate.
    /// Residuals are filtered as in the fit (`band_hz`, unless the settings contain it).
    ///
    /// # Errors
    /// Same as for [`Watch::new`].
    pub fn watch(&self, settings: &WatchSettings) -> Result<Watch, OnlineError> {
        let reference = StartingPoint { values: self.theta.clone(), covariance: self.covariance.clone() };
        let settings = WatchSettings { band_hz: settings.band_hz.or(self.band_hz), ..settings.clone() };
        Watch::new(self.model.clone(), reference, &self.joint_sigma, &settings)
    }

    /// Predicts the torque along `motion` with its band. The samples must be consecutive; friction with hysteresis
    /// starts without deflection.
    ///
    /// # Panics
    /// If the motion does not have [`dof`](Self::dof) joints.
    pub fn predict(&self, motion: &JointMotion<'_>) -> PredictedTorque {
        let samples = motion.samples;
        let mut half_width_95 = vec![0.0; self.dof() * samples];
        // Covariance of each joint's columns.
        let layout = self.model.layout();
        let of_joint = |joint| self.covariance.select_columns(layout.joint_columns(joint));
        let own: Vec<DMatrix<f64>> =
            (0..self.dof()).map(|joint| of_joint(joint).select_rows(layout.joint_columns(joint))).collect();
        let tau = self.predicted(motion, |joint, from, panel| {
            let (covariance, sigma) = (&own[joint], self.joint_sigma[joint]);
            let rows = DMatrixView::from_slice(panel, panel.len() / covariance.nrows().max(1), covariance.nrows());
            let spread = rows * covariance;
            for sample in 0..rows.nrows() {
                let variance = spread.row(sample).dot(&rows.row(sample)).max(0.0);
                half_width_95[joint * samples + from + sample] = self.width * (variance + sigma * sigma).sqrt();
            }
        });
        PredictedTorque { tau, half_width_95 }
    }

    /// Computes only the torque of [`predict`](Self::predict), joint-major, Nm (N), in a fraction of the time.
    ///
    /// # Panics
    /// As [`predict`](Self::predict).
    pub fn torque(&self, motion: &JointMotion<'_>) -> Vec<f64> {
        self.predicted(motion, |_, _, _| {})
    }

    /// Computes the torque along a motion. `each` receives a joint, the index of a first sample, and the joint's
    /// regressor columns for the samples from there on.
    fn predicted(&self, motion: &JointMotion<'_>, mut each: impl FnMut(usize, usize, &[f64])) -> Vec<f64> {
        let (dof, samples, layout) = (self.dof(), motion.samples, self.model.layout());
        assert_eq!(motion.q.len(), dof * samples, "the motion needs {dof} joints");
        let mut workspace = BatchWorkspace::new(self.model.model());
        let mut history = TermHistory::new(self.model.load_parameters.clone());
        let mut panels = Panels::default();
        let mut all = vec![0.0; dof * samples];
        for from in (0..samples).step_by(BLOCK_SAMPLES) {
            let count = BLOCK_SAMPLES.min(samples - from);
            let part = |all: &[f64]| -> Vec<f64> {
                all.chunks_exact(samples).flat_map(|joint| &joint[from..from + count]).copied().collect()
            };
            let (q, dq, ddq) = (part(motion.q), part(motion.dq), part(motion.ddq));
            let block = JointMotion { samples: count, q: &q, dq: &dq, ddq: &ddq };
            regressor_panels_following(self.model.model(), &mut workspace, layout, &block, &mut history, &mut panels);
            for joint in 0..dof {
                let columns = layout.joint_columns(joint);
                let panel = &panels.joint(joint)[..columns.len() * count];
                let tau = &mut all[joint * samples + from..][..count];
                for (column, entries) in columns.iter().zip(panel.chunks_exact(count)) {
                    let theta = self.theta[*column];
                    tau.iter_mut().zip(entries).for_each(|(tau, entry)| *tau += theta * entry);
                }
                each(joint, from, panel);
            }
        }
        all
    }
}
