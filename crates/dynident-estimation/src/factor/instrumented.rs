//! Rows with instrumental variables: `[Z | W | τ]` of instruments Z, regressor W and torque τ. Z has the columns of
//! W, computed from a motion that does not contain the noise of W.

use super::problem::LinearProblem;
use super::segmented::SegmentedFactor;
use super::unexcited::Unexcited;
use crate::error::EstimationError;
use nalgebra::DMatrix;

/// `τ_j = W_j θ + noise` with instruments `Z_j`, one column of Z for every column of W, stored as factors of `[Z_j |
/// W_j
/// | τ_j]`.
///
/// Z is the regressor of another estimate of the same motion: simulated with the current model, smoothed more
/// strongly, averaged over periods or taken from a repeated run. It must be correlated with W and uncorrelated with
/// the noise of W and τ.
///
/// ```
/// use dynident_estimation::{InstrumentedProblem, SegmentSettings, SegmentedFactor, instrumental_variables};
/// // τ = 2 x with x measured as w = x ± 1: the instrument is x itself.
/// let x: Vec<f64> = (0..64).map(|k| f64::from(k % 8) - 3.5).collect();
/// let w: Vec<f64> = (0..64).map(|k| x[k] + if (k / 8) % 2 == 0 { 1.0 } else { -1.0 }).collect();
/// let tau: Vec<f64> = x.iter().map(|x| 2.0 * x).collect();
/// let mut rows = SegmentedFactor::new(2, SegmentSettings { max_segments: 4, first_length_rows: 16 })?;
/// rows.absorb(&[x, w, tau].concat(), 64)?; // instrument, regressor, torque
/// let mut problem = InstrumentedProblem::new(vec!["gain".into()], vec!["joint1".into()]);
/// problem.add("run", 0, &[0], rows)?;
/// let found = instrumental_variables(&problem, &Default::default())?;
/// assert!((found.estimate.values[0] - 2.0).abs() < 1e-9);
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
#[derive(Clone, Debug)]
pub struct InstrumentedProblem {
    names: Vec<String>,
    fallback: Vec<f64>,
    unexcited: Unexcited,
    /// Columns of Z, then those of W.
    pub(crate) rows: LinearProblem,
}

impl InstrumentedProblem {
    /// Creates a problem without data from the names of the columns (parameters) and joints.
    pub fn new(columns: Vec<String>, joints: Vec<String>) -> Self {
        let both = columns.iter().map(|name| format!("instrument of {name}")).chain(columns.iter().cloned()).collect();
        Self {
            fallback: vec![0.0; columns.len()],
            unexcited: Unexcited::default(),
            names: columns,
            rows: LinearProblem::new(both, joints),
        }
    }

    /// Adds the rows of joint number `joint` in the log called `log`. Columns of the factor: one instrument for each
    /// of `columns`, then the regressor in the same order, then the torque.
    ///
    /// # Errors
    /// Same as for [`LinearProblem::add`]; the factor must have twice as many columns as `columns` names.
    pub fn add(
        &mut self,
        log: &str,
        joint: usize,
        columns: &[usize],
        factor: SegmentedFactor,
    ) -> Result<(), EstimationError> {
        let count = self.names.len();
        if let Some(&column) = columns.iter().find(|column| **column >= count) {
            let joint = self.joints().get(joint).cloned().unwrap_or_default();
            return Err(EstimationError::Column { log: log.into(), joint, column, columns: count });
        }
        let both = columns.iter().copied().chain(columns.iter().map(|column| column + count)).collect();
        self.rows.add(log, joint, both, factor)
    }

    /// Sets the values of columns that the instruments do not distinguish; zero by default.
    ///
    /// # Errors
    /// Same as for [`LinearProblem::with_fallback`].
    pub fn with_fallback(mut self, values: Vec<f64>) -> Result<Self, EstimationError> {
        let both = values.iter().chain(&values).copied().collect();
        crate::error::expect("fallback values", self.names.len(), values.len())?;
        self.rows = self.rows.with_fallback(both)?;
        self.fallback = values;
        Ok(self)
    }

    /// Sets columns to hold at their fallback values, like [`LinearProblem::with_unexcited`].
    ///
    /// # Errors
    /// Same as for [`LinearProblem::with_unexcited`].
    pub fn with_unexcited(mut self, unexcited: Unexcited) -> Result<Self, EstimationError> {
        let checked = LinearProblem::new(self.names.clone(), Vec::new()).with_unexcited(unexcited)?;
        self.unexcited = checked.unexcited().clone();
        Ok(self)
    }

    /// Columns held at their fallback values.
    pub fn unexcited(&self) -> &Unexcited {
        &self.unexcited
    }

    /// Names of the regressor's columns.
    pub fn columns(&self) -> &[String] {
        &self.names
    }

    /// Names of the joints.
    pub fn joints(&self) -> &[String] {
        self.rows.joints()
    }

    /// Fallback values of columns that are not estimated.
    pub fn fallback(&self) -> &[f64] {
        &self.fallback
    }

    /// The rows of regressor and torque without the instruments, for least squares in place of instrumental variables.
    ///
    /// # Errors
    /// None in practice: construction already checks all conditions.
    pub fn regressors(&self) -> Result<LinearProblem, EstimationError> {
        let mut problem = LinearProblem::new(self.names.clone(), self.joints().to_vec())
            .with_fallback(self.fallback.clone())?
            .with_unexcited(self.unexcited.clone())?;
        for equation in self.rows.equations() {
            let count = equation.columns.len() / 2;
            let mut choice = DMatrix::zeros(2 * count + 1, count + 1);
            choice.view_mut((count, 0), (count + 1, count + 1)).fill_with_identity();
            let factor = equation.factor.transformed(&[choice]);
            let columns = equation.columns[..count].to_vec();
            problem.add(&self.rows.logs()[equation.log], equation.joint, columns, factor)?;
        }
        Ok(problem)
    }

    /// Vector over instruments and regressor, with θ in the columns of the regressor and zeros for the instruments.
    pub(crate) fn over_both(&self, theta: &[f64]) -> Vec<f64> {
        let mut both = vec![0.0; self.names.len()];
        both.extend_from_slice(theta);
        both
    }

    /// A problem over other columns of the same rows. `combination` maps an equation's local columns `[Z | W | τ]` to
    /// the new rows, shape (local columns + 1, names + 1).
    pub(crate) fn combined(
        &self,
        names: Vec<String>,
        fallback: Vec<f64>,
        combination: impl Fn(&[usize]) -> DMatrix<f64>,
    ) -> Result<LinearProblem, EstimationError> {
        let count = names.len();
        let mut problem = LinearProblem::new(names, self.joints().to_vec()).with_fallback(fallback)?;
        for equation in self.rows.equations() {
            let local = &equation.columns[..equation.columns.len() / 2];
            let factor = equation.factor.transformed(&[combination(local)]);
            problem.add(&self.rows.logs()[equation.log], equation.joint, (0..count).collect(), factor)?;
        }
        Ok(problem)
    }
}
