//! From an estimate to the bodies of a possible machine.

use crate::machine::Machine;
use crate::result::{PhysicalBodyResult, PhysicalFitResult};
use crate::standard_parameters::typical_length_m;
use dynident_estimation::physical::{
    BaseMap, PhysicalBody, PhysicalFit, PhysicalProblem, PhysicalScalar, PhysicalSettings, PhysicalStatus,
    physical_fit, rough_body,
};
use dynident_estimation::{Estimate, LinearProblem};
use dynident_model::laws::Law;

/// A joint's noise counts as at least this share of its torque's root mean square: no model is better, and with noise-free (simulated) torque the prior would
/// otherwise vanish beside the data in double precision.
const LEAST_RELATIVE_SIGMA: f64 = 1.0e-4;

/// Share of a rough body that is mixed into a description's: bodies drawn as rods or plates have no extent at all in some direction.
const ROUGH_SHARE: f64 = 1.0e-2;

/// The possible set of parameters that fits the logs best, from the factors that the estimate was made from; otherwise the reason why there is none.
pub(crate) fn possible_parameters(
    machine: &Machine,
    problem: &LinearProblem,
    estimate: &Estimate,
    prior: &[f64],
) -> Result<PhysicalFit, String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let mut squares = vec![0.0; problem.joints().len()];
    for equation in problem.equations() {
        squares[equation.joint] += equation.factor.total().torque_norm().powi(2);
    }
    let rows = problem.joint_rows();
    let weights: Vec<f64> = estimate
        .joint_sigma
        .iter()
        .zip(squares.iter().zip(&rows))
        .map(|(sigma, (square, &rows))| {
            let least = LEAST_RELATIVE_SIGMA * (square / rows.max(1) as f64).sqrt();
            let sigma = sigma.max(least);
            if sigma > 0.0 { 1.0 / sigma } else { 1.0 }
        })
        .collect();
    let factor = problem.combined(&weights).map_err(|error| said(&error))?;
    let (base, model) = (&machine.base, &machine.model);
    let map = BaseMap::from_regrouping(base.independent(), base.dependent(), base.regrouping())
        .map_err(|error| said(&error))?;
    let length = typical_length_m(model);
    let masses: Vec<f64> = (0..model.dof()).map(|body| prior[10 * body]).filter(|&mass| mass > 0.0).collect();
    let mean_mass = if masses.is_empty() { 1.0 } else { masses.iter().sum::<f64>() / masses.len() as f64 };
    let bodies = model.bodies().iter().enumerate().map(|(index, body)| {
        let own = &prior[10 * index..10 * index + 10];
        let possible = body.prior().is_some_and(|prior| {
            prior.mass_kg() > 0.0 && prior.pseudo_inertia().symmetric_eigenvalues().min() >= -1.0e-9 * prior.mass_kg()
        });
        let reference = if possible {
            let rough = rough_body(own[0], length);
            core::array::from_fn(|k| own[k] + ROUGH_SHARE * rough[k])
        } else {
            rough_body(mean_mass, length)
        };
        let name = body.name().to_owned();
        PhysicalBody { name, reference, known: None, mass_kg: None, com_box_m: None, inside: None }
    });
    let scalars = machine.laws.iter().zip(&prior[10 * model.dof()..]).map(|(law, &value)| {
        let bounded = law.is_nonnegative();
        let scale = if matches!(law, Law::DriveInertia(_)) { mean_mass * length * length } else { 1.0 };
        PhysicalScalar {
            name: law.symbol(),
            lower: bounded.then_some(0.0),
            upper: None,
            prior: if bounded { value.max(0.0) } else { value },
            scale,
        }
    });
    let problem =
        PhysicalProblem::new(map, bodies.collect(), scalars.collect(), &factor).map_err(|error| said(&error))?;
    physical_fit(&problem, &PhysicalSettings::default()).map_err(|error| said(&error))
}

/// The section of `result.json` about the fit.
pub(crate) fn physical_fit_result(fit: &PhysicalFit, estimate: &Estimate) -> PhysicalFitResult {
    PhysicalFitResult {
        status: match fit.status {
            PhysicalStatus::Solved => "solved",
            PhysicalStatus::Stalled => "stalled",
            PhysicalStatus::IterationLimit => "iteration-limit",
        },
        iterations: fit.iterations,
        stationarity: fit.stationarity,
        duality_gap: fit.duality_gap,
        moved_sigma: fit.moved_sigma,
        largest_move_std: fit
            .moves_in_std(&estimate.values, &estimate.std)
            .ok()
            .and_then(|moves| moves.into_iter().flatten().map(f64::abs).max_by(f64::total_cmp)),
        active: fit.active.clone(),
        bodies: fit
            .bodies
            .iter()
            .map(|body| PhysicalBodyResult {
                name: body.name.clone(),
                margin: body.least_whitened_eigenvalue,
                on_the_boundary: body.on_the_boundary,
            })
            .collect(),
    }
}
