//! Unknowns in addition to the arm's base parameters (payloads and offsets of single logs), and their effect on each
//! log.
//!
//! A payload with parameters π in the frame of its link adds `A π` to the ten parameters of its body. With the matrix B
//! of the base parameters (`θ = B π_all`), it adds `M π` with `M = B_body A` to the base parameters θ. Therefore every
//! log has the same regressor columns, those of the arm. The base parameters of log ℓ are `θ_ℓ = T_ℓ x + c_ℓ`, where x
//! contains all unknowns and c_ℓ is the effect of a known payload.

use super::error::PayloadError;
use super::refit::Refit;
use crate::settings::{GainChoice, IdentificationSettings, OffsetChoice};
use dynident_dynamics::{Column, independent_columns};
use dynident_estimation::{Estimate, EstimationError, LinearProblem, SegmentedFactor};
use dynident_model::terms::{Offset, TorqueTerm};
use dynident_model::{INERTIAL_NAMES, InertialParameters};
use dynident_rows::{Recording, RegressorModel, Role, of_role};
use nalgebra::{DMatrix, DVector};

/// Relative tolerance below which a parameter of a payload is treated as a combination of earlier parameters; the
/// structure is accurate to about 1e-9.
const DEPENDENCE_TOLERANCE: f64 = 1.0e-6;
/// Minimum coefficient with which an omitted parameter is listed in a sum.
const MIN_COEFFICIENT: f64 = 1.0e-9;

/// A payload at a link of the robot. A [`Recording`] refers to it by name.
#[derive(Clone, Debug, PartialEq)]
pub struct Payload {
    /// Name by which recordings refer to the payload.
    pub name: String,
    /// Link to which the payload is fixed; its parameters are in the frame of this link.
    pub link: String,
    /// Ten inertial parameters of the payload if they are known; otherwise they are estimated.
    pub known: Option<InertialParameters>,
    /// Mass of the payload if only the mass is known; the other parameters are estimated.
    pub known_mass_kg: Option<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct PayloadColumns {
    pub(crate) payload: usize,
    pub(crate) first: usize,
    pub(crate) kept: Vec<usize>,
    pub(crate) dropped: Vec<usize>,
    /// Coefficients with which dependent (omitted) parameters are added to the kept ones, shape (kept, omitted).
    pub(crate) regrouping: DMatrix<f64>,
    /// Effect of the kept parameters on the base parameters, shape (base, kept).
    pub(crate) change: DMatrix<f64>,
    /// Known mass, and the effect of this mass at the link's origin on the base parameters.
    pub(crate) mass: Option<(f64, DVector<f64>)>,
}

/// Rows of one joint in one log, `W (T x + c)`, expressed in the columns of the problem: regressor W, unknowns x, and
/// known payload c.
pub(crate) struct SeenColumns {
    pub(crate) columns: Vec<usize>,
    /// Rows of the matrix T for the base columns of the joint.
    pub(crate) map: DMatrix<f64>,
    /// Elements of c (known payload) for the base columns of the joint.
    pub(crate) known: DVector<f64>,
}

impl SeenColumns {
    pub(crate) fn of_base(own: &[usize]) -> Self {
        let count = own.len();
        Self { columns: own.to_vec(), map: DMatrix::identity(count, count), known: DVector::zeros(count) }
    }
}

/// Columns of a least-squares problem: base parameters of the arm, then payloads, then offsets of single logs.
#[derive(Clone, Debug)]
pub struct LoadColumns {
    base: usize,
    symbols: Vec<String>,
    pub(crate) payloads: Vec<PayloadColumns>,
    /// Separate offsets as (log, joint, column).
    pub offsets: Vec<(usize, usize, usize)>,
    /// For every log, the matrix `T_ℓ` with shape (base, columns) and the vector `c_ℓ`; `None` for a log with the arm
    /// alone.
    logs: Vec<Option<(DMatrix<f64>, Vec<f64>)>>,
}

impl LoadColumns {
    /// Determines the columns for a task, based on the columns of the model's layout. If `known_arm` is given, the
    /// arm's parameters are fixed, except those that it states to be fitted again.
    ///
    /// # Errors
    /// A payload or its link is missing, or settings are incompatible with payloads.
    pub fn new(
        settings: &IdentificationSettings,
        recordings: &[Recording],
        described: &[Payload],
        model: &RegressorModel,
        known_arm: Option<Refit>,
    ) -> Result<Self, PayloadError> {
        let base = model.layout().columns().len();
        check(settings, recordings, described, model, known_arm)?;
        let mut symbols = Vec::new();
        let (mut payloads, mut known) = (Vec::new(), vec![None; described.len()]);
        let training = of_role(recordings, Role::Identify);
        for (number, section) in described.iter().enumerate() {
            let mut matrix = change_of_base(model, &section.link)?;
            if let Some(parameters) = section.known {
                known[number] = Some((&matrix * DVector::from_column_slice(&parameters.0)).as_slice().to_vec());
                continue;
            }
            let carries = |log: usize| recordings[log].payload.as_ref() == Some(&section.name);
            if !training.iter().any(|&log| carries(log)) {
                if (0..recordings.len()).any(carries) {
                    return Err(PayloadError::NotTrained { name: section.name.clone() });
                }
                continue;
            }
            // A known mass has no column; its torque is subtracted.
            let mass = section.known_mass_kg.map(|mass| (mass, matrix.column(0) * mass));
            if let Some((_, added)) = &mass {
                known[number] = Some(added.as_slice().to_vec());
                matrix.column_mut(0).fill(0.0);
            }
            let norms: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
            let unit = |k: usize| if norms[k] > 0.0 { norms[k] } else { 1.0 };
            let scaled = DMatrix::from_fn(matrix.nrows(), 10, |row, k| matrix[(row, k)] / unit(k));
            let split = independent_columns(&scaled, DEPENDENCE_TOLERANCE);
            let (kept, dropped) = (split.independent, split.dependent);
            let regrouping = DMatrix::from_fn(kept.len(), dropped.len(), |row, column| {
                split.regrouping[(row, column)] * unit(dropped[column]) / unit(kept[row])
            });
            let columns = PayloadColumns {
                payload: number,
                first: base + symbols.len(),
                change: matrix.select_columns(&kept),
                mass,
                kept,
                dropped,
                regrouping,
            };
            symbols.extend(columns.expressions().iter().map(|expression| format!("{}: {expression}", section.name)));
            payloads.push(columns);
        }
        let mut offsets = Vec::new();
        if per_log(settings) {
            let joints = model.joint_names();
            let with_offset = |joint: &usize| model.terms().contains(&TorqueTerm::Offset(Offset { joint: *joint }));
            // The offsets of the last log are minus the sum of the others, so that the base parameters contain the
            // mean.
            for &log in training.split_last().map_or(&[][..], |(_, rest)| rest) {
                for joint in (0..model.model().dof()).filter(with_offset) {
                    offsets.push((log, joint, base + symbols.len()));
                    symbols.push(format!("offset of {} in {}", joints[joint], recordings[log].name));
                }
            }
        }
        let mut columns = Self { base, symbols, payloads, offsets, logs: Vec::new() };
        let of_log = |log| columns.of_log(recordings, described, model, &training, &known, log);
        columns.logs = (0..recordings.len()).map(of_log).collect();
        Ok(columns)
    }

    /// The part of an estimate that belongs to the arm: base parameters only.
    pub fn arm_estimate(&self, estimate: &Estimate) -> Estimate {
        let mut arm = estimate.clone();
        let base = self.base;
        for values in
            [&mut arm.values, &mut arm.std, &mut arm.noise_std, &mut arm.std_degrees_of_freedom, &mut arm.half_width_95]
        {
            values.truncate(base);
        }
        arm.names.truncate(base);
        arm.relative_std_percent.truncate(base);
        arm.covariance = estimate.covariance.view((0, 0), (base, base)).into_owned();
        arm.covariance_white = estimate.covariance_white.view((0, 0), (base, base)).into_owned();
        arm
    }

    fn of_log(
        &self,
        recordings: &[Recording],
        described: &[Payload],
        model: &RegressorModel,
        training: &[usize],
        known: &[Option<Vec<f64>>],
        log: usize,
    ) -> Option<(DMatrix<f64>, Vec<f64>)> {
        let carried = recordings[log].payload.as_ref();
        let number = carried.and_then(|name| described.iter().position(|payload| payload.name == *name));
        let last = training.last() == Some(&log);
        let own: Vec<(usize, usize, f64)> = self
            .offsets
            .iter()
            .filter(|(of, _, _)| training.contains(&log) && (last || *of == log))
            .map(|&(_, joint, column)| (joint, column, if last { -1.0 } else { 1.0 }))
            .collect();
        if number.is_none() && own.is_empty() {
            return None;
        }
        let mut map = DMatrix::zeros(self.base, self.count());
        map.view_mut((0, 0), (self.base, self.base)).fill_with_identity();
        if let Some(payload) = self.payloads.iter().find(|payload| Some(payload.payload) == number) {
            map.view_mut((0, payload.first), (self.base, payload.kept.len())).copy_from(&payload.change);
        }
        let all = model.base().all_columns();
        for (joint, column, sign) in own {
            let offset = Column::Term(TorqueTerm::Offset(Offset { joint }));
            if let Some(place) = all.iter().position(|column| *column == offset) {
                map.set_column(column, &(base_column(model, place, self.base) * sign));
            }
        }
        let known = number.and_then(|number| known[number].clone()).unwrap_or_else(|| vec![0.0; self.base]);
        Some((map, known))
    }

    /// Whether all logs contain the arm without payloads and separate offsets.
    pub fn is_plain(&self) -> bool {
        self.logs.iter().all(Option::is_none)
    }

    /// Whether these logs contain the arm without payloads and separate offsets.
    pub fn are_plain(&self, logs: &[usize]) -> bool {
        logs.iter().all(|&log| self.logs[log].is_none())
    }

    /// Number of base parameters of the arm.
    pub fn base(&self) -> usize {
        self.base
    }

    /// Number of all columns.
    pub fn count(&self) -> usize {
        self.base + self.symbols.len()
    }

    pub(crate) fn symbols(&self, model: &RegressorModel) -> Vec<String> {
        model.layout().columns().iter().map(Column::symbol).chain(self.symbols.iter().cloned()).collect()
    }

    /// Base parameters of a log, `θ_ℓ = T_ℓ x + c_ℓ`.
    pub fn base_values(&self, log: usize, x: &[f64]) -> Vec<f64> {
        match &self.logs[log] {
            None => x[..self.base].to_vec(),
            Some((map, known)) => (map * DVector::from_column_slice(&x[..self.count()])
                + DVector::from_column_slice(known))
            .as_slice()
            .to_vec(),
        }
    }

    /// Covariance of [`base_values`](Self::base_values).
    pub fn base_covariance(&self, log: usize, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        let all = covariance.view((0, 0), (self.count(), self.count()));
        match &self.logs[log] {
            None => all.view((0, 0), (self.base, self.base)).into_owned(),
            Some((map, _)) => map * all * map.transpose(),
        }
    }

    /// Effect c_ℓ of a known payload, over all columns.
    pub(crate) fn known(&self, log: usize) -> Vec<f64> {
        let mut known = self.logs[log].as_ref().map_or_else(|| vec![0.0; self.base], |(_, known)| known.clone());
        known.resize(self.count(), 0.0);
        known
    }

    /// Columns of the problem that act on a joint in log `index` through the joint's base columns `own`.
    pub(crate) fn seen(&self, index: usize, own: &[usize]) -> SeenColumns {
        let Some((map, known)) = &self.logs[index] else { return SeenColumns::of_base(own) };
        // Only additional columns that act on the joint; others would be zero.
        let further = (self.base..self.count()).filter(|&column| own.iter().any(|&row| map[(row, column)] != 0.0));
        let columns: Vec<usize> = own.iter().copied().chain(further).collect();
        let known = DVector::from_iterator(own.len(), own.iter().map(|&global| known[global]));
        SeenColumns { map: map.select_rows(own).select_columns(&columns), columns, known }
    }

    /// Adds the rows of one joint in a log to a problem with all columns. The torque of a known payload is subtracted,
    /// unless the torque gain of the joint is unknown.
    pub(crate) fn add(
        &self,
        problem: &mut LinearProblem,
        (index, log): (usize, &str),
        joint: usize,
        (own, factor): (&[usize], &SegmentedFactor),
        keep_known: bool,
    ) -> Result<(), EstimationError> {
        if self.logs[index].is_none() {
            return problem.add(log, joint, own.to_vec(), factor.clone());
        }
        let SeenColumns { columns, map, known } = self.seen(index, own);
        let mut local = DMatrix::zeros(own.len() + 1, columns.len() + 1);
        local.view_mut((0, 0), map.shape()).copy_from(&map);
        if !keep_known {
            local.view_mut((0, columns.len()), (own.len(), 1)).copy_from(&-known);
        }
        local[(own.len(), columns.len())] = 1.0;
        problem.add(log, joint, columns, factor.mapped(&local)?)
    }

    /// Rows for the arm alone: the torque of all other columns, at their estimated values, is subtracted.
    ///
    /// # Errors
    /// A problem with other columns.
    pub fn arm_problem(&self, problem: &LinearProblem, x: &[f64]) -> Result<LinearProblem, EstimationError> {
        let mut arm = LinearProblem::new(problem.columns()[..self.base].to_vec(), problem.joints().to_vec())
            .with_fallback(problem.fallback()[..self.base].to_vec())?
            .with_unexcited(problem.unexcited().renumbered(|column| (column < self.base).then_some(column)))?;
        for equation in problem.equations() {
            let columns: Vec<usize> = equation.columns.iter().copied().filter(|&column| column < self.base).collect();
            let mut map = DMatrix::zeros(equation.columns.len() + 1, columns.len() + 1);
            let mut next = 0;
            for (row, &column) in equation.columns.iter().enumerate() {
                if column < self.base {
                    map[(row, next)] = 1.0;
                    next += 1;
                } else {
                    map[(row, columns.len())] = -x[column];
                }
            }
            map[(equation.columns.len(), columns.len())] = 1.0;
            arm.add(&problem.logs()[equation.log], equation.joint, columns, equation.factor.mapped(&map)?)?;
        }
        Ok(arm)
    }
}

impl PayloadColumns {
    /// Expressions of the columns, in the frame of the payload's link: single parameters or sums, for example
    /// `Ixx + Iyy`.
    pub(crate) fn expressions(&self) -> Vec<String> {
        let of_row = |(row, &kept): (usize, &usize)| {
            let further = self.dropped.iter().enumerate().filter_map(|(column, &dropped)| {
                let share = self.regrouping[(row, column)];
                let sign = if share < 0.0 { "-" } else { "+" };
                (share.abs() > MIN_COEFFICIENT)
                    .then(|| format!(" {sign} {:.4} {}", share.abs(), INERTIAL_NAMES[dropped]))
            });
            format!("{}{}", INERTIAL_NAMES[kept], further.collect::<String>())
        };
        self.kept.iter().enumerate().map(of_row).collect()
    }

    /// Whether the kept parameter `row` is a single parameter and not a sum.
    pub(crate) fn alone(&self, row: usize) -> bool {
        self.regrouping.row(row).iter().all(|share| share.abs() <= MIN_COEFFICIENT)
    }
}

fn per_log(settings: &IdentificationSettings) -> bool {
    settings.offsets == OffsetChoice::PerLog
}

/// Checks for settings that are incompatible with payloads.
fn check(
    settings: &IdentificationSettings,
    recordings: &[Recording],
    payloads: &[Payload],
    model: &RegressorModel,
    known_arm: Option<Refit>,
) -> Result<(), PayloadError> {
    let known = |name: &String| payloads.iter().find(|payload| payload.name == *name);
    for name in recordings.iter().filter_map(|recording| recording.payload.as_ref()) {
        if known(name).is_none() {
            let known = payloads.iter().map(|payload| payload.name.clone()).collect();
            return Err(PayloadError::UnknownPayload { name: name.clone(), known });
        }
    }
    let loaded = recordings.iter().any(|recording| recording.payload.is_some());
    let unknown_gains = settings.gains == GainChoice::Unknown;
    if !(loaded || per_log(settings) || known_arm.is_some() || unknown_gains) {
        return Ok(());
    }
    if let Some(refit) = known_arm {
        let to_estimate = |name: &String| known(name).is_some_and(|payload| payload.known.is_none());
        let mut training = recordings.iter().filter(|recording| recording.role == Role::Identify);
        let carried = training.any(|recording| recording.payload.as_ref().is_some_and(to_estimate));
        if !carried && refit == Refit::Nothing && !per_log(settings) {
            return Err(PayloadError::NothingToEstimate);
        }
        if unknown_gains {
            return Err(PayloadError::GainsOfKnownArm);
        }
    }
    let estimation = &settings.estimation;
    if !estimation.estimator.is_plain() || estimation.exogeneity_test.is_some() || estimation.essential.is_some() {
        return Err(PayloadError::Estimator);
    }
    if loaded && model.terms().iter().any(TorqueTerm::needs_load) {
        return Err(PayloadError::LoadFriction);
    }
    Ok(())
}

/// Column `place` of the matrix B of the base parameters, with zeros for columns of the layout that are not base
/// parameters.
pub(crate) fn base_column(model: &RegressorModel, place: usize, rows: usize) -> DVector<f64> {
    let base = model.base();
    let mut column = DVector::zeros(rows);
    if let Some(b) = base.independent().iter().position(|&index| index == place) {
        column[b] = 1.0;
    } else if let Some(d) = base.dependent().iter().position(|&index| index == place) {
        column.rows_mut(0, base.count()).copy_from(&base.regrouping().column(d));
    }
    column
}

/// Matrix M: effect of ten inertial parameters in the frame of `link` on the base parameters.
fn change_of_base(model: &RegressorModel, link: &str) -> Result<DMatrix<f64>, PayloadError> {
    let bodies = model.model().bodies().iter().enumerate();
    let found = bodies.flat_map(|(body, b)| b.links.iter().map(move |link| (body, link))).find(|(_, l)| l.name == link);
    let Some((body, link)) = found else {
        let links = model.model().bodies().iter().flat_map(|body| &body.links);
        let known = links.map(|link| link.name.clone()).collect();
        return Err(PayloadError::UnknownLink { link: link.to_owned(), known });
    };
    let rows = model.layout().columns().len();
    let mut matrix = DMatrix::zeros(rows, 10);
    for k in 0..10 {
        let unit = InertialParameters(core::array::from_fn(|i| f64::from(u8::from(i == k))));
        let in_body = unit.expressed_in(&link.placement);
        for (parameter, &share) in in_body.0.iter().enumerate() {
            if share != 0.0 {
                let column = base_column(model, 10 * body + parameter, rows) * share;
                matrix.set_column(k, &(matrix.column(k) + column));
            }
        }
    }
    Ok(matrix)
}

/// Effect of every known payload on the base parameters, by name.
///
/// # Errors
/// A link is missing.
pub fn known_payloads(payloads: &[Payload], model: &RegressorModel) -> Result<Vec<(String, Vec<f64>)>, PayloadError> {
    let mut known = Vec::new();
    for payload in payloads {
        let matrix = change_of_base(model, &payload.link)?;
        if let Some(parameters) = &payload.known {
            let added = matrix * DVector::from_column_slice(&parameters.0);
            known.push((payload.name.clone(), added.as_slice().to_vec()));
        }
    }
    Ok(known)
}
