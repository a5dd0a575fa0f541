//! The parameters of a study beside the arm's: payloads and offsets of single logs, and what each log sees of them.
//!
//! A payload with parameters π in the frame of its link adds `A π` to the ten parameters of the body that it is fixed to, and so `M π` with `M = B_body A` to the base parameters
//! (`θ = B π_all`). No log needs other columns than the arm's: log ℓ is explained by the base vector `θ_ℓ = T_ℓ x + c_ℓ`, with x all that is to be estimated and c a known payload.

use crate::error::Error;
use crate::job::{joint_names, of_role};
use crate::machine::Machine;
use crate::study::{EstimatorMethod, GainChoice, OffsetChoice, Refit, Role, Study};
use dynident_dynamics::{Column, independent_columns};
use dynident_estimation::{Estimate, EstimationError, LinearProblem, SegmentedFactor};
use dynident_model::laws::{Law, Offset};
use dynident_model::{INERTIAL_NAMES, InertialParameters};
use nalgebra::{DMatrix, DVector};
use std::path::Path;

/// A payload's parameter is a sum of earlier ones when the part of its change that they do not make is below this share: the structure is known to 1e-9 or so.
const DEPENDENT: f64 = 1.0e-6;
/// Share of a dropped parameter below which it does not stand in a sum.
const IN_SUM: f64 = 1.0e-9;

/// Columns of one payload to estimate.
#[derive(Clone, Debug)]
pub(crate) struct PayloadColumns {
    /// Its number among the study's payloads.
    pub(crate) payload: usize,
    /// Its first column.
    pub(crate) first: usize,
    /// Which of the ten parameters have columns.
    pub(crate) kept: Vec<usize>,
    /// The others.
    pub(crate) dropped: Vec<usize>,
    /// How often a kept one holds a dropped one, shape (kept, dropped).
    pub(crate) regrouping: DMatrix<f64>,
    /// What the kept ones add to the base parameters, shape (base, kept).
    pub(crate) change: DMatrix<f64>,
}

/// Columns of a problem: the arm's base parameters, then payloads, then offsets of single logs.
#[derive(Clone, Debug)]
pub(crate) struct LoadColumns {
    base: usize,
    /// Symbols of all further columns.
    symbols: Vec<String>,
    pub(crate) payloads: Vec<PayloadColumns>,
    /// (log, joint, column) of the offsets that are columns of their own.
    pub(crate) offsets: Vec<(usize, usize, usize)>,
    /// For every log of the study `T_ℓ`, (base, columns), and `c_ℓ`; none where the log sees the arm alone.
    logs: Vec<Option<(DMatrix<f64>, Vec<f64>)>>,
}

impl LoadColumns {
    /// The columns of a study, in terms of the columns of `machine.layout()`.
    ///
    /// # Errors
    /// If a payload or its link is not there, or the study asks for something that does not go together with payloads.
    pub(crate) fn new(study: &Study, path: &Path, machine: &Machine) -> Result<Self, Error> {
        let base = machine.layout().columns().len();
        check(study, machine).map_err(|message| Error::study(path, message))?;
        let mut symbols = Vec::new();
        let (mut payloads, mut known) = (Vec::new(), vec![None; study.payload.len()]);
        let training = of_role(study, Role::Identify);
        for (number, section) in study.payload.iter().enumerate() {
            let matrix = change_of_base(machine, &section.link).map_err(|message| Error::study(path, message))?;
            if let Some(parameters) = section.known() {
                known[number] = Some((&matrix * DVector::from_column_slice(&parameters.0)).as_slice().to_vec());
                continue;
            }
            let carries = |log: usize| study.log[log].payload.as_ref() == Some(&section.name);
            if !training.iter().any(|&log| carries(log)) {
                if (0..study.log.len()).any(carries) {
                    let message = format!(
                        "payload `{}` is unknown, and no log to fit to carries it: give its mass_kg and com_m, or a [[log]] with the role \"identify\"",
                        section.name
                    );
                    return Err(Error::study(path, message));
                }
                continue;
            }
            let norms: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
            let unit = |k: usize| if norms[k] > 0.0 { norms[k] } else { 1.0 };
            let scaled = DMatrix::from_fn(matrix.nrows(), 10, |row, k| matrix[(row, k)] / unit(k));
            let split = independent_columns(&scaled, DEPENDENT);
            let (kept, dropped) = (split.independent, split.dependent);
            let regrouping = DMatrix::from_fn(kept.len(), dropped.len(), |row, column| {
                split.regrouping[(row, column)] * unit(dropped[column]) / unit(kept[row])
            });
            let columns = PayloadColumns {
                payload: number,
                first: base + symbols.len(),
                change: matrix.select_columns(&kept),
                kept,
                dropped,
                regrouping,
            };
            symbols.extend(columns.expressions().iter().map(|expression| format!("{}: {expression}", section.name)));
            payloads.push(columns);
        }
        let mut offsets = Vec::new();
        if per_log(study) {
            let joints = joint_names(machine);
            let with_offset = |joint: &usize| machine.laws().contains(&Law::Offset(Offset { joint: *joint }));
            // The last log's are the others' with the opposite sign: the base parameters hold the mean.
            for &log in training.split_last().map_or(&[][..], |(_, rest)| rest) {
                for joint in (0..machine.model().dof()).filter(with_offset) {
                    offsets.push((log, joint, base + symbols.len()));
                    symbols.push(format!("offset of {} in {}", joints[joint], study.log_name(log)));
                }
            }
        }
        let mut columns = Self { base, symbols, payloads, offsets, logs: Vec::new() };
        columns.logs = (0..study.log.len()).map(|log| columns.of_log(study, machine, &training, &known, log)).collect();
        Ok(columns)
    }

    /// The arm's part of an estimate: its base parameters alone.
    pub(crate) fn arm_estimate(&self, estimate: &Estimate) -> Estimate {
        let mut arm = estimate.clone();
        let base = self.base;
        for values in [&mut arm.values, &mut arm.std, &mut arm.std_freedom, &mut arm.half_width_95] {
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
        study: &Study,
        machine: &Machine,
        training: &[usize],
        known: &[Option<Vec<f64>>],
        log: usize,
    ) -> Option<(DMatrix<f64>, Vec<f64>)> {
        let carried = study.log[log].payload.as_ref();
        let number = carried.and_then(|name| study.payload.iter().position(|payload| payload.name == *name));
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
        let all = machine.base().all_columns();
        for (joint, column, sign) in own {
            let offset = Column::Law(Law::Offset(Offset { joint }));
            if let Some(place) = all.iter().position(|column| *column == offset) {
                map.set_column(column, &(base_column(machine, place, self.base) * sign));
            }
        }
        let known = number.and_then(|number| known[number].clone()).unwrap_or_else(|| vec![0.0; self.base]);
        Some((map, known))
    }

    /// True when all logs see the arm alone.
    pub(crate) fn is_plain(&self) -> bool {
        self.logs.iter().all(Option::is_none)
    }

    /// The arm's base parameters.
    pub(crate) fn base(&self) -> usize {
        self.base
    }

    /// All columns.
    pub(crate) fn count(&self) -> usize {
        self.base + self.symbols.len()
    }

    /// Symbols of all columns.
    pub(crate) fn symbols(&self, machine: &Machine) -> Vec<String> {
        machine.layout().columns().iter().map(Column::symbol).chain(self.symbols.iter().cloned()).collect()
    }

    /// `θ_ℓ = T_ℓ x + c_ℓ`: the base parameters that explain a log.
    pub(crate) fn base_values(&self, log: usize, x: &[f64]) -> Vec<f64> {
        match &self.logs[log] {
            None => x[..self.base].to_vec(),
            Some((map, known)) => (map * DVector::from_column_slice(&x[..self.count()])
                + DVector::from_column_slice(known))
            .as_slice()
            .to_vec(),
        }
    }

    /// Covariance of those.
    pub(crate) fn base_covariance(&self, log: usize, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        let all = covariance.view((0, 0), (self.count(), self.count()));
        match &self.logs[log] {
            None => all.view((0, 0), (self.base, self.base)).into_owned(),
            Some((map, _)) => map * all * map.transpose(),
        }
    }

    /// `c_ℓ` over all columns: a known payload.
    pub(crate) fn known(&self, log: usize) -> Vec<f64> {
        let mut known = self.logs[log].as_ref().map_or_else(|| vec![0.0; self.base], |(_, known)| known.clone());
        known.resize(self.count(), 0.0);
        known
    }

    /// Adds one joint's rows of a log to a problem over all columns; the known payload's torque is taken off unless the gain of the joint is not known yet.
    pub(crate) fn add(
        &self,
        problem: &mut LinearProblem,
        (index, log): (usize, &str),
        joint: usize,
        (own, factor): (&[usize], &SegmentedFactor),
        keep_known: bool,
    ) -> Result<(), EstimationError> {
        let Some((map, known)) = &self.logs[index] else {
            return problem.add(log, joint, own.to_vec(), factor.clone());
        };
        // Further columns that the joint does not feel would only be zeros.
        let further = (self.base..self.count()).filter(|&column| own.iter().any(|&row| map[(row, column)] != 0.0));
        let columns: Vec<usize> = own.iter().copied().chain(further).collect();
        let mut local = DMatrix::zeros(own.len() + 1, columns.len() + 1);
        for (row, &global) in own.iter().enumerate() {
            for (to, &column) in columns.iter().enumerate() {
                local[(row, to)] = map[(global, column)];
            }
            local[(row, columns.len())] = if keep_known { 0.0 } else { -known[global] };
        }
        local[(own.len(), columns.len())] = 1.0;
        problem.add(log, joint, columns, factor.mapped(&local)?)
    }

    /// The rows as they are for the arm alone once all that differs from log to log stands at its estimate.
    pub(crate) fn arm_problem(&self, problem: &LinearProblem, x: &[f64]) -> Result<LinearProblem, EstimationError> {
        let mut arm = LinearProblem::new(problem.columns()[..self.base].to_vec(), problem.joints().to_vec())
            .with_fallback(problem.fallback()[..self.base].to_vec())?;
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
    /// What each column sums: `Ixx + Iyy`, in the frame of the payload's link.
    pub(crate) fn expressions(&self) -> Vec<String> {
        let of_row = |(row, &kept): (usize, &usize)| {
            let further = self.dropped.iter().enumerate().filter_map(|(column, &dropped)| {
                let share = self.regrouping[(row, column)];
                let sign = if share < 0.0 { "-" } else { "+" };
                (share.abs() > IN_SUM).then(|| format!(" {sign} {:.4} {}", share.abs(), INERTIAL_NAMES[dropped]))
            });
            format!("{}{}", INERTIAL_NAMES[kept], further.collect::<String>())
        };
        self.kept.iter().enumerate().map(of_row).collect()
    }

    /// Whether kept parameter number `row` stands for itself alone.
    pub(crate) fn alone(&self, row: usize) -> bool {
        self.regrouping.row(row).iter().all(|share| share.abs() <= IN_SUM)
    }
}

fn per_log(study: &Study) -> bool {
    study.drive.offsets == OffsetChoice::PerLog
}

/// What the study asks for and payloads cannot be with.
fn check(study: &Study, machine: &Machine) -> Result<(), String> {
    for log in &study.log {
        if let Some(name) = &log.payload
            && study.payload.iter().all(|payload| payload.name != *name)
        {
            let known: Vec<&str> = study.payload.iter().map(|payload| &payload.name[..]).collect();
            return Err(format!(
                "a [[log]] carries payload `{name}`, but the [[payload]]s are: {}; name one of them or describe it",
                if known.is_empty() { "none".to_owned() } else { known.join(", ") }
            ));
        }
    }
    let loaded = study.log.iter().any(|log| log.payload.is_some());
    let unknown_gains = study.drive.gains == GainChoice::Unknown;
    let special = loaded || per_log(study) || study.arm.is_some() || unknown_gains;
    if !special {
        return Ok(());
    }
    if let Some(arm) = &study.arm {
        let to_estimate = |name: &String| study.payload.iter().any(|p| p.name == *name && p.mass_kg.is_none());
        let carried =
            study.log.iter().any(|log| log.role == Role::Identify && log.payload.as_ref().is_some_and(to_estimate));
        if !carried && arm.refit == Refit::Nothing && !per_log(study) {
            return Err("[arm]: the arm is held and nothing is left to estimate: describe a [[payload]] without mass_kg and let a [[log]] carry it, or say what to `refit`".to_owned());
        }
        if unknown_gains {
            return Err("[arm] and drive.gains = \"unknown\": with a known arm the gains are known; state them as torque.scale of the format".to_owned());
        }
    }
    let section = &study.estimator;
    let linear = matches!(section.method, EstimatorMethod::Ordinary | EstimatorMethod::Weighted);
    if !linear || section.instruments.is_some() || section.essential.is_some() {
        return Err("payloads, offsets per log, a known arm and unknown gains go with estimator.method = \"weighted\" or \"ordinary\", without instruments and without essential: \
             leave those out"
            .to_owned());
    }
    if !crate::identify::friction_candidates::joints_to_choose(study, machine).is_empty() {
        return Err("friction = \"auto\" does not go with payloads, offsets per log, a known arm or unknown gains: let the unloaded logs choose friction in a study of their own, and state what \
             they chose (friction_choice of its result.json), or hold the arm by [arm]"
            .to_owned());
    }
    if loaded && machine.laws().iter().any(|law| matches!(law, Law::Load(_))) {
        return Err("load-dependent friction does not go with payloads, for its load is the bare arm's: leave out the law `load`".to_owned());
    }
    Ok(())
}

/// Column `place` of B, with zeros for columns of the layout that are no base parameters.
fn base_column(machine: &Machine, place: usize, rows: usize) -> DVector<f64> {
    let base = machine.base();
    let mut column = DVector::zeros(rows);
    if let Some(b) = base.independent().iter().position(|&index| index == place) {
        column[b] = 1.0;
    } else if let Some(d) = base.dependent().iter().position(|&index| index == place) {
        column.rows_mut(0, base.count()).copy_from(&base.regrouping().column(d));
    }
    column
}

/// M: what ten parameters in the frame of `link` add to the base parameters.
fn change_of_base(machine: &Machine, link: &str) -> Result<DMatrix<f64>, String> {
    let bodies = machine.model().bodies().iter().enumerate();
    let found = bodies.flat_map(|(body, b)| b.links.iter().map(move |link| (body, link))).find(|(_, l)| l.name == link);
    let Some((body, link)) = found else {
        let names: Vec<&str> =
            machine.model().bodies().iter().flat_map(|body| body.links.iter().map(|link| &link.name[..])).collect();
        return Err(format!("payload at link `{link}`: no moving link has that name; they are {}", names.join(", ")));
    };
    let rows = machine.layout().columns().len();
    let mut matrix = DMatrix::zeros(rows, 10);
    for k in 0..10 {
        let unit = InertialParameters(core::array::from_fn(|i| f64::from(u8::from(i == k))));
        let in_body = unit.expressed_in(&link.placement);
        for (parameter, &share) in in_body.0.iter().enumerate() {
            if share != 0.0 {
                let column = base_column(machine, 10 * body + parameter, rows) * share;
                matrix.set_column(k, &(matrix.column(k) + column));
            }
        }
    }
    Ok(matrix)
}

/// What every payload that the study knows adds to the base parameters, by name.
///
/// # Errors
/// If its link is not there.
pub(crate) fn known_payloads(study: &Study, path: &Path, machine: &Machine) -> Result<Vec<(String, Vec<f64>)>, Error> {
    let mut known = Vec::new();
    for section in &study.payload {
        let matrix = change_of_base(machine, &section.link).map_err(|message| Error::study(path, message))?;
        if let Some(parameters) = section.known() {
            let added = matrix * DVector::from_column_slice(&parameters.0);
            known.push((section.name.clone(), added.as_slice().to_vec()));
        }
    }
    Ok(known)
}
