//! Residual diagnostics and the 95 % band of each joint on a held-out log.

use super::stiction::Stiction;
use dynident_dynamics::Column;
use dynident_estimation::{
    Estimate, Normality, NormalityReport, SpeedRanges, SpeedRangesReport, Whiteness, WhitenessReport,
    student_half_width,
};
use dynident_model::terms::{JointProperty, TorqueTerm};
use dynident_rows::RegressorModel;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Diagnostics of one joint's filtered residual on a log.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointResiduals {
    /// The joint.
    pub name: String,
    /// Ljung-Box test; `None` for a short log.
    pub whiteness: Option<WhitenessReport>,
    /// Jarque-Bera test; `None` for a short log.
    pub normality: Option<NormalityReport>,
    /// Residual for several ranges of velocity; `None` if the model has no viscous friction, because the rows then do
    /// not contain the velocity.
    pub regimes: Option<SpeedRangesReport>,
    /// Root mean square residual that neither friction at rest nor the low-pass of the positions explains, Nm (N): of
    /// `|r| − |d| − F` where this is positive, with the residual r, and d and F as in [`TorqueBand`]. `None` without
    /// rows.
    #[serde(default)]
    pub rmse_in_motion_nm: Option<f64>,
    /// The 95 % band of the predicted torque; `None` without a covariance. It is written as `torque_band` of a result
    /// and not here, because the test of an existing model has no band.
    #[serde(skip)]
    pub band: Option<TorqueBand>,
}

/// Coverage of the predicted 95 % band for the torque of one joint on a held-out log. The band is
/// `τ̂ ± (t κ √(w V wᵀ + σ²) + |d| + F)`: predicted torque τ̂, row w of the regressor, covariance V of the parameters,
/// noise σ of the joint, quantile t of Student's distribution, and a factor κ from blocks of the training logs that
/// were left out of the fit. d is the change of the prediction if the cut-off of the differentiator is four times as
/// high; it accounts for motion above the cut-off and for blurred reversals and pauses. Without a cut-off, d is zero. F
/// is the largest torque that friction at rest adds to the filtered row (speed below 0.005 rad/s for an arm of usual
/// size); it is zero in motion.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueBand {
    /// The log.
    pub log: String,
    /// The joint.
    pub joint: String,
    /// Share of the filtered torque inside the band, percent.
    pub coverage_percent: f64,
    /// Mean half-width of the band, Nm (N).
    pub half_width_nm: f64,
}

/// Uncertainty of an estimate, from which the band of the predicted torque is computed.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    covariance: DMatrix<f64>,
    joint_sigma: Vec<f64>,
    /// Factors on the band of each joint; see [`left_out_ratios`](dynident_estimation::left_out_ratios).
    ratios: Vec<f64>,
    width: f64,
}

impl Uncertainty {
    /// The same uncertainty with another covariance.
    pub(crate) fn with_covariance(&self, covariance: DMatrix<f64>) -> Self {
        Self { covariance, ..self.clone() }
    }

    /// Covariance of the base parameters.
    pub(crate) fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Creates the uncertainty for base parameters with the given covariance. `ratios` are factors κ on the band of
    /// each joint, from blocks of the training logs that were left out of the fit
    /// ([`left_out_ratios`](dynident_estimation::left_out_ratios)), or ones.
    pub fn of(estimate: &Estimate, covariance: DMatrix<f64>, ratios: &[f64]) -> Self {
        let degrees_of_freedom = estimate.degrees_of_freedom as f64;
        Self {
            covariance,
            joint_sigma: estimate.joint_sigma.clone(),
            ratios: ratios.to_vec(),
            width: student_half_width(0.95, degrees_of_freedom),
        }
    }
}

/// Accumulates one joint's residuals.
pub(crate) struct ResidualAccumulator {
    /// Matrix square root of the covariance of the joint's columns.
    own: DMatrix<f64>,
    /// Noise standard deviation of the joint, and the factor `t κ` on the band.
    sigma: Option<(f64, f64)>,
    stiction: Stiction,
    /// Columns of the panel whose sum is the velocity: the column of viscous friction, or its columns for both
    /// directions.
    speed: Vec<usize>,
    /// Velocity of the joint that corresponds to 1 rad/s (m/s) of an arm of usual size.
    usual_speed: f64,
    whiteness: Whiteness,
    normality: Normality,
    regimes: SpeedRanges,
    inside: usize,
    samples: usize,
    widths: f64,
    /// Number of columns of the joint.
    columns: usize,
    /// Sum of the squared residuals that friction at rest and the low-pass of the positions do not explain, N² m² (N²).
    moving_squares: f64,
}

impl ResidualAccumulator {
    pub(crate) fn new(model: &RegressorModel, theta: &[f64], joint: usize, uncertainty: Option<&Uncertainty>) -> Self {
        let layout = model.layout();
        let columns = layout.joint_columns(joint);
        let all = layout.columns();
        let places = |is: &dyn Fn(&TorqueTerm) -> bool| -> Vec<usize> {
            let own = columns.iter().enumerate();
            own.filter(|(_, column)| matches!(&all[**column], Column::Term(term) if is(term)))
                .map(|(place, _)| place)
                .collect()
        };
        let is_own = |term: &TorqueTerm| term.own_joint() == Some(joint);
        let viscous = places(&|term| is_own(term) && term.property() == Some(JointProperty::Damping));
        let halves = columns.iter().find_map(|&column| match &all[column] {
            Column::Term(term) if is_own(term) => {
                let [other, of_both] = term.kind().both_directions()?;
                (of_both.property() == Some(JointProperty::Damping)).then(|| [term.clone(), other])
            }
            _ => None,
        });
        let directions = halves.map_or_else(Vec::new, |halves| places(&|term| halves.contains(term)));
        let speed = if viscous.is_empty() && directions.len() == 2 { directions } else { viscous };
        // With the covariance V = L Lᵀ, the variance of a prediction with the row w is ‖Lᵀ w‖². L is computed from
        // eigenvalues, because covariances from few segments are singular.
        let own = uncertainty.map_or_else(
            || DMatrix::zeros(0, columns.len()),
            |uncertainty| {
                let own = uncertainty.covariance.select_rows(columns).select_columns(columns);
                let eigen = own.symmetric_eigen();
                let root = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
                DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose()
            },
        );
        Self {
            own,
            sigma: uncertainty.map(|uncertainty| {
                let ratio = uncertainty.ratios.get(joint).copied().unwrap_or(1.0);
                (uncertainty.joint_sigma[joint], uncertainty.width * ratio)
            }),
            stiction: Stiction::of(model, joint, theta),
            speed,
            usual_speed: model.model().characteristic_scale().velocity(model.model().joints()[joint].is_rotary(), 1.0),
            whiteness: Whiteness::default(),
            normality: Normality::default(),
            regimes: SpeedRanges::default(),
            inside: 0,
            samples: 0,
            widths: 0.0,
            columns: columns.len(),
            moving_squares: 0.0,
        }
    }

    /// Adds rows of the joint: regressor columns and torque (`panel`), and the predicted torque. For each row, `finer`
    /// contains the prediction from positions with a higher cut-off and the largest torque of friction at rest; it is
    /// empty if these are unknown.
    pub(crate) fn add(&mut self, panel: &[f64], rows: usize, predicted: &[f64], finer: &[[f64; 2]]) {
        let columns = self.columns;
        for row in 0..rows {
            let residual = panel[columns * rows + row] - predicted[row];
            self.samples += 1;
            self.whiteness.add(residual);
            self.normality.add(residual);
            let mut rests = false;
            if !self.speed.is_empty() {
                let speed: f64 = self.speed.iter().map(|column| panel[column * rows + row]).sum();
                self.regimes.add(speed / self.usual_speed, residual);
                rests = speed.abs() < SpeedRanges::REST_BELOW * self.usual_speed;
            }
            // The torque that friction at rest and the low-pass of the positions explain.
            let explained = match finer.get(row) {
                Some([finer, held]) => held + (finer - predicted[row]).abs(),
                None if rests => self.stiction.level(panel, rows, row, predicted[row]),
                None => 0.0,
            };
            self.moving_squares += (residual.abs() - explained).max(0.0).powi(2);
            if let Some((sigma, width)) = self.sigma {
                let variance: f64 = (0..self.own.nrows())
                    .map(|k| (0..columns).map(|c| self.own[(k, c)] * panel[c * rows + row]).sum::<f64>().powi(2))
                    .sum();
                let half = width * (variance + sigma * sigma).sqrt() + explained;
                self.widths += half;
                self.inside += usize::from(residual.abs() <= half);
            }
        }
    }

    pub(crate) fn report(&self, log: &str, name: &str) -> JointResiduals {
        let counted = self.sigma.is_some() && self.samples > 0;
        let samples = self.samples as f64;
        JointResiduals {
            name: name.to_owned(),
            whiteness: self.whiteness.report(),
            normality: self.normality.report(),
            regimes: (!self.speed.is_empty()).then(|| self.regimes.report()),
            rmse_in_motion_nm: (self.samples > 0).then(|| (self.moving_squares / samples).sqrt()),
            band: counted.then(|| TorqueBand {
                log: log.to_owned(),
                joint: name.to_owned(),
                coverage_percent: 100.0 * self.inside as f64 / samples,
                half_width_nm: self.widths / samples,
            }),
        }
    }
}
