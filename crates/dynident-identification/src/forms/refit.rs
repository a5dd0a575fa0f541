//! Refit of the torque terms of a class to the training recordings, with the bodies of the identified model.

use super::test::tested_forms;
use crate::error::IdentificationError;
use crate::log_factors::{LogFactors, log_factors};
use crate::settings::IdentificationSettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::{ValidationReport, nonnegative_least_squares};
use dynident_model::terms::{JointMotion, JointProperty, TermClass, TorqueTerm, sort_terms};
use dynident_rows::{Logs, RegressorModel, Role};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The identified model restricted to the torque terms of a class.
#[derive(Clone, Debug)]
pub struct FormFit {
    /// The class of terms.
    pub class: TermClass,
    /// Torque terms of this class.
    pub terms: Vec<TorqueTerm>,
    /// Value of each term, N m, N m s/rad, kg m² (N, N s/m, kg) per unit of the term.
    pub values: Vec<f64>,
    /// Whether the class lacks some terms of the identified model, so that the values of the remaining terms were
    /// fitted again.
    pub is_refitted: bool,
    /// Errors of the predicted torque on each held-out recording: the index of the recording and the report. The
    /// frequency band is that of the identified model's own test.
    pub held_out: Vec<(usize, ValidationReport)>,
}

/// Fits the terms of every class to the training recordings `training` and tests them on the held-out recordings.
/// `parameters` contains all parameters of the identified model `robot`: ten for each body and one for each term. The
/// bodies and the load of load-dependent friction are kept. For each joint `j`, the values `x_j` of the joint's own
/// terms are
///
/// ```text
/// min_x Σ ‖τ_j − W_j θ_bodies − A_j x_j‖²,    x_j ≥ 0 where the term cannot be negative
/// ```
///
/// over the filtered rows. Terms that a class cannot contain are omitted from the prediction. Recordings with a payload
/// are not used. The joints in `resting` do not move in the recordings; their terms approximate the friction of the
/// identified model.
///
/// # Errors
/// Recordings that cannot be read.
pub fn form_fits(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    robot: &RegressorModel,
    parameters: &[f64],
    training: &[usize],
    resting: &[usize],
) -> Result<Vec<FormFit>, IdentificationError> {
    let is_bare = |index: &usize| logs.recordings[*index].payload.is_none();
    let training: Vec<usize> = training.iter().copied().filter(is_bare).collect();
    let held_out: Vec<usize> = logs.of_role(Role::Validate).into_iter().filter(is_bare).collect();
    let wide = WideModel::new(robot, parameters)?;
    let factors: Vec<LogFactors> = if training.is_empty() {
        Vec::new()
    } else {
        logs.begin("forms of the model", &training);
        let one = |&index: &usize| log_factors(logs, settings, &wide.model, index, training.len() == 1);
        let factors: Result<Vec<LogFactors>, _> = training.par_iter().map(one).collect();
        logs.end();
        factors?
    };
    let fits: Vec<(FormFit, Vec<f64>)> =
        TermClass::ALL.iter().map(|&class| wide.fit(class, &factors, resting)).collect();
    let sets: Vec<&[f64]> = fits.iter().map(|(_, theta)| &theta[..]).collect();
    let mut reports = tested_forms(logs, &wide.model, &sets, &held_out)?;
    let mut found: Vec<FormFit> = fits.iter().map(|(fit, _)| fit.clone()).collect();
    for (index, reports) in held_out.iter().zip(&mut reports) {
        for (fit, report) in found.iter_mut().zip(reports.drain(..)) {
            fit.held_out.push((*index, report));
        }
    }
    Ok(found)
}

/// Largest velocity at which the friction of a resting joint is approximated, rad/s or m/s of an arm of usual size.
const TYPICAL_VELOCITY: f64 = 1.0;
/// Number of speeds in each direction at which this friction is approximated.
const SPEEDS: usize = 50;

/// The robot with the terms of all classes as columns.
struct WideModel<'a> {
    robot: &'a ParametricModel,
    /// Parameters of the identified model.
    parameters: &'a [f64],
    model: RegressorModel,
    /// Base parameters of its bodies, with all friction and drive terms zero.
    theta_bodies: Vec<f64>,
}

impl<'a> WideModel<'a> {
    fn new(identified: &'a RegressorModel, parameters: &'a [f64]) -> Result<Self, IdentificationError> {
        let robot = &identified.parametric;
        let mut terms: Vec<TorqueTerm> = robot.terms().to_vec();
        for class in TermClass::ALL {
            let of_joints = (0..robot.dof())
                .flat_map(|joint| class.terms_of_joint(robot.model(), robot.terms(), joint).into_iter().flatten());
            let shared = robot.terms().iter().filter(|term| term.own_joint().is_none());
            for term in of_joints.chain(shared.map(|term| class.in_form(robot.model(), term))) {
                if !terms.contains(&term) {
                    terms.push(term);
                }
            }
        }
        terms.retain(|term| !term.needs_temperature());
        sort_terms(&mut terms);
        let parametric = robot.with_terms(terms)?;
        let bodies = parameters.len() - robot.terms().len();
        let mut rigid = parameters[..bodies].to_vec();
        rigid.resize(bodies + parametric.terms().len(), 0.0);
        let theta_bodies = parametric.base().values(&rigid);
        let model = match &identified.load_parameters {
            Some(load) => RegressorModel::from(parametric).with_load_of(identified, load),
            None => RegressorModel::from(parametric),
        };
        Ok(Self { robot, parameters, model, theta_bodies })
    }

    /// Value of a term in the identified model, where the term may have another velocity scale; zero if the model has
    /// no such term.
    fn value(&self, term: &TorqueTerm) -> f64 {
        let bodies = self.parameters.len() - self.robot.terms().len();
        let place = self.robot.terms().iter().position(|own| own.symbol() == term.symbol());
        place.map_or(0.0, |place| self.parameters[bodies + place])
    }

    /// Base parameters that correspond to one unit of a term.
    fn unit(&self, term: &TorqueTerm) -> Vec<f64> {
        let parametric = &self.model.parametric;
        let bodies = parametric.base().all_columns().len() - parametric.terms().len();
        let mut unit = vec![0.0; parametric.base().all_columns().len()];
        if let Some(place) = parametric.terms().iter().position(|own| own == term) {
            unit[bodies + place] = 1.0;
        }
        parametric.base().values(&unit)
    }

    /// Adds a term with this value to base parameters.
    fn add(&self, theta: &mut [f64], term: &TorqueTerm, value: f64) {
        theta.iter_mut().zip(self.unit(term)).for_each(|(theta, unit)| *theta += value * unit);
    }

    /// The terms of a class with their values, and the corresponding base parameters of the wide model.
    fn fit(&self, class: TermClass, factors: &[LogFactors], resting: &[usize]) -> (FormFit, Vec<f64>) {
        let mut fit =
            FormFit { class, terms: Vec::new(), values: Vec::new(), is_refitted: false, held_out: Vec::new() };
        let mut theta = self.theta_bodies.clone();
        // Couplings and springs keep the values of the identified model.
        let is_held = |term: &&TorqueTerm| term.own_joint().is_none() || is_spring(term);
        for term in self.robot.terms().iter().filter(is_held) {
            if class.holds(term) {
                let (value, held) = (self.value(term), class.in_form(self.robot.model(), term));
                self.add(&mut theta, &held, value);
                fit.is_refitted |= held != *term;
                fit.terms.push(held);
                fit.values.push(value);
            } else {
                fit.is_refitted = true;
            }
        }
        let known = theta.clone();
        for joint in 0..self.robot.dof() {
            let own: Vec<&TorqueTerm> =
                self.robot.terms().iter().filter(|term| term.own_joint() == Some(joint) && !is_spring(term)).collect();
            let lists = class.terms_of_joint(self.robot.model(), self.robot.terms(), joint);
            let is_same = lists.len() == 1 && own.len() == lists[0].len() && own.iter().all(|t| lists[0].contains(t));
            let first = || lists.first().cloned().unwrap_or_default();
            let (terms, values) = if is_same {
                (first(), first().iter().map(|term| self.value(term)).collect())
            } else if factors.is_empty() || resting.contains(&joint) {
                fit.is_refitted = true;
                (first(), self.approximated(joint, &first()))
            } else {
                fit.is_refitted = true;
                self.best_list(joint, lists, &known, factors)
            };
            for (term, value) in terms.into_iter().zip(values) {
                self.add(&mut theta, &term, value);
                fit.terms.push(term);
                fit.values.push(value);
            }
        }
        (fit, theta)
    }

    /// Selects among several lists of terms for a joint the one with the smallest residual, and returns it with its
    /// values.
    fn best_list(
        &self,
        joint: usize,
        lists: Vec<Vec<TorqueTerm>>,
        known: &[f64],
        factors: &[LogFactors],
    ) -> (Vec<TorqueTerm>, Vec<f64>) {
        let fitted = lists.into_iter().map(|terms| {
            let (values, squares) = self.least_squares(joint, &terms, known, factors);
            (squares, terms, values)
        });
        let best = fitted.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(Default::default, |(_, terms, values)| (terms, values))
    }

    /// Values of the terms of a resting joint that approximate the friction of the identified model best, at velocities
    /// up to that of a typical motion. Other terms keep their values.
    fn approximated(&self, joint: usize, terms: &[TorqueTerm]) -> Vec<f64> {
        let model = self.robot.model();
        let most = model.characteristic_scale().velocity(model.joints()[joint].is_rotary(), TYPICAL_VELOCITY);
        let zeros = vec![0.0; model.dof()];
        let torque = |term: &TorqueTerm, dq: f64| {
            let mut velocities = zeros.clone();
            velocities[joint] = dq;
            let motion = JointMotion { samples: 1, q: &zeros, dq: &velocities, ddq: &zeros };
            let mut column = [dq.signum()];
            if !term.has_memory() && !term.needs_load() {
                term.column(joint, &motion, &mut column);
            }
            column[0]
        };
        // Friction that both models contain and that depends on more than the velocity keeps its value.
        let is_kept = |term: &TorqueTerm| {
            (term.has_memory() || term.needs_load()) && terms.iter().any(|kept| kept.symbol() == term.symbol())
        };
        let is_fitted =
            |term: &&TorqueTerm| term.own_joint() == Some(joint) && term.is_joint_friction() && !is_kept(term);
        let fitted: Vec<&TorqueTerm> = terms.iter().filter(is_fitted).collect();
        let own: Vec<&TorqueTerm> =
            self.robot.terms().iter().filter(is_fitted).filter(|term| !term.needs_temperature()).collect();
        let speeds = (1..=SPEEDS).map(|k| most * k as f64 / SPEEDS as f64).flat_map(|dq| [dq, -dq]);
        let (mut gram, mut right) = (DMatrix::zeros(fitted.len(), fitted.len()), DVector::zeros(fitted.len()));
        for dq in speeds {
            let row = DVector::from_iterator(fitted.len(), fitted.iter().map(|term| torque(term, dq)));
            let tau: f64 = own.iter().map(|term| self.value(term) * torque(term, dq)).sum();
            right += tau * &row;
            gram += &row * row.transpose();
        }
        let nonnegative: Vec<bool> = fitted.iter().map(|term| term.is_nonnegative()).collect();
        let x = nonnegative_least_squares(&gram, &right, &nonnegative);
        let place = |term: &TorqueTerm| fitted.iter().position(|one| *one == term);
        terms.iter().map(|term| place(term).map_or_else(|| self.value(term), |place| x[place])).collect()
    }

    /// Values of the terms of a joint that fit its rows best, and minus the sum of squares that the terms explain.
    fn least_squares(
        &self,
        joint: usize,
        terms: &[TorqueTerm],
        known: &[f64],
        factors: &[LogFactors],
    ) -> (Vec<f64>, f64) {
        let columns = self.model.layout().joint_columns(joint);
        let local = |theta: &[f64]| DVector::from_iterator(columns.len(), columns.iter().map(|&column| theta[column]));
        let units: Vec<DVector<f64>> = terms.iter().map(|term| local(&self.unit(term))).collect();
        let (known, count) = (local(known), terms.len());
        let (mut gram, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        for log in factors.iter().filter(|log| log.factors[joint].rows() > 0) {
            let total = log.factors[joint].total();
            let triangle = total.regressor_triangle();
            let rest = total.rotated_torque() - &triangle * &known;
            let a = DMatrix::from_columns(&units.iter().map(|unit| &triangle * unit).collect::<Vec<_>>());
            gram += a.tr_mul(&a);
            right += a.tr_mul(&rest);
        }
        let nonnegative: Vec<bool> = terms.iter().map(TorqueTerm::is_nonnegative).collect();
        let x = nonnegative_least_squares(&gram, &right, &nonnegative);
        let squares = x.dot(&(&gram * &x)) - 2.0 * x.dot(&right);
        (x.iter().copied().collect(), squares)
    }
}

fn is_spring(term: &TorqueTerm) -> bool {
    term.property() == Some(JointProperty::Stiffness)
}
