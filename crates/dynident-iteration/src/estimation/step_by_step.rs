//! Identification joint by joint: the tip joint first, then each joint towards the base, with the torque of known
//! parameters subtracted (*Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, Eqs. 9,
//! 10).

use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use dynident_estimation::{
    Estimate, LinearProblem, OrdinarySettings, SegmentedFactor, TriangularFactor, WeightedSettings,
    ordinary_least_squares, weighted_least_squares,
};
use dynident_identification::estimators::Estimator;
use dynident_identification::rows::{JointRows, RowConsumer};
use dynident_identification::{EstimationSettings, LogError, Logs, RegressorModel};
use nalgebra::DMatrix;

pub(crate) struct Steps {
    pub(crate) values: Vec<f64>,
    pub(crate) covariance: DMatrix<f64>,
    pub(crate) joint_sigma: Vec<f64>,
    pub(crate) found: Vec<bool>,
    pub(crate) rows: usize,
}

/// Estimates the parameters θ_k of each joint k by least squares on `τ_k - B θ_known = A θ_k`, with only the rows of
/// joint k. Earlier estimates contribute with their covariance, `∂θ_k/∂θ_known = -A⁺ B`. Rows of joint k of recording
/// ℓ are multiplied by `weights[ℓ][k]`.
pub(crate) fn step_by_step(
    task: &IterationTask,
    logs: &Logs<'_>,
    settings: &EstimationSettings,
    weights: &[Vec<f64>],
    names: &[String],
    joints: &[String],
    fallback: &[f64],
) -> Result<Steps, IterationError> {
    let count = fallback.len();
    let given = task.known_values();
    let mut steps = Steps {
        values: fallback.to_vec(),
        covariance: DMatrix::zeros(count, count),
        joint_sigma: vec![0.0; joints.len()],
        found: vec![false; count],
        rows: 0,
    };
    for joint in (0..joints.len()).rev() {
        let columns = task.robot.layout().joint_columns(joint);
        let is_known = |column: usize| given[column].is_some() || steps.found[column];
        let (known, unknown): (Vec<usize>, Vec<usize>) =
            (0..columns.len()).partition(|&place| is_known(columns[place]));
        let uncertain: Vec<usize> = known.iter().copied().filter(|&place| steps.found[columns[place]]).collect();
        if unknown.is_empty() {
            continue;
        }
        let places = Places { columns, known: &known, unknown: &unknown, uncertain: &uncertain };
        let Factors { factor, wide } = joint_factors(task, logs, weights, joint, &places, &steps.values)?;
        if factor.rows() == 0 {
            continue;
        }
        steps.rows += factor.rows();
        let own = |values: &dyn Fn(usize) -> String| unknown.iter().map(|&place| values(columns[place])).collect();
        let mut problem = LinearProblem::new(own(&|column| names[column].clone()), vec![joints[joint].clone()])
            .with_fallback(unknown.iter().map(|&place| fallback[columns[place]]).collect())?;
        problem.add("run", 0, (0..unknown.len()).collect(), factor)?;
        let estimate = least_squares(&problem, settings)?;
        steps.joint_sigma[joint] = estimate.joint_sigma[0];
        let fixed: Vec<usize> = estimate.rank.fixed.iter().map(|fixed| fixed.column).collect();
        let estimated: Vec<usize> = (0..unknown.len()).filter(|place| !fixed.contains(place)).collect();
        for &place in &estimated {
            steps.values[columns[unknown[place]]] = estimate.values[place];
        }
        let globals: Vec<usize> = unknown.iter().map(|&place| columns[place]).collect();
        let before: Vec<usize> = uncertain.iter().map(|&place| columns[place]).collect();
        propagate(&mut steps, &globals, &estimated, &before, &estimate, &wide);
        for &place in &estimated {
            steps.found[globals[place]] = true;
        }
    }
    for (column, value) in given.iter().enumerate() {
        if let Some(value) = value {
            steps.values[column] = *value;
        }
    }
    Ok(steps)
}

struct Places<'a> {
    columns: &'a [usize],
    /// Known columns: given in the study, or estimated at an outer joint.
    known: &'a [usize],
    unknown: &'a [usize],
    /// Known columns that were estimated at an outer joint.
    uncertain: &'a [usize],
}

/// One joint's rows, with the torque of the known columns subtracted.
struct Factors {
    /// Rows over the unknown columns.
    factor: SegmentedFactor,
    /// Rows over the unknown columns and the uncertain known columns.
    wide: TriangularFactor,
}

fn joint_factors(
    task: &IterationTask,
    logs: &Logs<'_>,
    weights: &[Vec<f64>],
    joint: usize,
    places: &Places<'_>,
    values: &[f64],
) -> Result<Factors, IterationError> {
    let Places { columns, known, unknown, uncertain } = *places;
    let given = task.known_values();
    let mut factor = SegmentedFactor::new(unknown.len(), dynident_estimation::SegmentSettings::default())?;
    let mut wide = TriangularFactor::new(unknown.len() + uncertain.len());
    let (mut narrow_panel, mut wide_panel) = (Vec::new(), Vec::new());
    let model = RegressorModel::from(task.robot.clone());
    for (index, weights) in weights.iter().enumerate() {
        let visit = |JointRows { joint: of, rows, panel, .. }: &JointRows<'_>| {
            let rows = *rows;
            if *of != joint {
                return Ok(());
            }
            let column = |place: usize| &panel[place * rows..(place + 1) * rows];
            let mut torque = column(columns.len()).to_vec();
            for &place in known {
                let value = given[columns[place]].unwrap_or(values[columns[place]]);
                torque.iter_mut().zip(column(place)).for_each(|(torque, w)| *torque -= value * w);
            }
            narrow_panel.clear();
            wide_panel.clear();
            for &place in unknown {
                narrow_panel.extend_from_slice(column(place));
            }
            wide_panel.extend_from_slice(&narrow_panel);
            for &place in uncertain {
                wide_panel.extend_from_slice(column(place));
            }
            narrow_panel.extend_from_slice(&torque);
            wide_panel.extend_from_slice(&torque);
            for value in narrow_panel.iter_mut().chain(&mut wide_panel) {
                *value *= weights[joint];
            }
            factor.absorb(&narrow_panel, rows)?;
            wide.absorb(&wide_panel, rows)?;
            Ok(())
        };
        logs.pass(&model, index).run(&mut Visit(visit))?;
    }
    Ok(Factors { factor, wide })
}

fn propagate(
    steps: &mut Steps,
    globals: &[usize],
    estimated: &[usize],
    before: &[usize],
    estimate: &Estimate,
    wide: &TriangularFactor,
) {
    let own = |place: usize| globals[estimated[place]];
    for a in 0..estimated.len() {
        for b in 0..estimated.len() {
            steps.covariance[(own(a), own(b))] = estimate.covariance[(estimated[a], estimated[b])];
        }
    }
    if before.is_empty() {
        return;
    }
    let triangle = wide.regressor_triangle();
    let left = DMatrix::from_fn(triangle.nrows(), estimated.len(), |row, place| triangle[(row, estimated[place])]);
    let right = triangle.columns(globals.len(), before.len()).into_owned();
    let Ok(inverse) = left.pseudo_inverse(1e-12) else { return };
    let sensitivity = -(inverse * right);
    let count = steps.values.len();
    let earlier = DMatrix::from_fn(before.len(), count, |row, column| steps.covariance[(before[row], column)]);
    let cross = &sensitivity * &earlier;
    let inherited = &sensitivity
        * DMatrix::from_fn(before.len(), before.len(), |a, b| earlier[(a, before[b])])
        * sensitivity.transpose();
    for a in 0..estimated.len() {
        for column in 0..count {
            if steps.found[column] {
                steps.covariance[(own(a), column)] = cross[(a, column)];
                steps.covariance[(column, own(a))] = cross[(a, column)];
            }
        }
        for b in 0..estimated.len() {
            steps.covariance[(own(a), own(b))] += inherited[(a, b)];
        }
    }
}

fn least_squares(problem: &LinearProblem, settings: &EstimationSettings) -> Result<Estimate, IterationError> {
    let (rank, covariance) = (settings.rank, settings.covariance);
    Ok(match settings.estimator {
        Estimator::Ordinary => ordinary_least_squares(problem, &OrdinarySettings { rank, covariance })?,
        _ => weighted_least_squares(problem, &WeightedSettings { rank, covariance, ..WeightedSettings::default() })?,
    })
}

struct Visit<F>(F);

impl<F: FnMut(&JointRows<'_>) -> Result<(), LogError>> RowConsumer for Visit<F> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        (self.0)(rows)
    }
}
