//! One sample at a time.

use super::clock::Report;
use super::motion::{Motion, STATES};
use dynident_dynamics::{
    Workspace, coriolis_matrix, forward_dynamics, forward_dynamics_derivatives, gravity_torque_derivative,
    inverse_dynamics, inverse_dynamics_derivatives, mass_matrix, torque_regressor,
};
use dynident_model::Model;
use std::hint::black_box;

/// One call at `q`, `dq` and `ddq` (or torque), with one number of its result.
type Call<'a> = dyn FnMut(&mut Workspace, &[f64], &[f64], &[f64]) -> f64 + 'a;

pub(crate) fn time_all(model: &Model, report: &Report<'_>) {
    let states = Motion::random(model, STATES).by_sample();
    let mut workspace = Workspace::with_level(model, report.level);
    let mut time = |quantity: &str, call: &mut Call<'_>| {
        report.time(quantity, STATES, || {
            for [q, dq, ddq] in &states {
                black_box(call(&mut workspace, q, dq, ddq));
            }
        });
    };
    time("rnea", &mut |w, q, dq, ddq| inverse_dynamics(model, w, q, dq, ddq)[0]);
    time("crba", &mut |w, q, _, _| mass_matrix(model, w, q)[0]);
    // Accelerations of one in place of torques, as in the compared program; the code path is the same.
    time("aba", &mut |w, q, dq, tau| forward_dynamics(model, w, q, dq, tau)[0]);
    time("joint_torque_regressor", &mut |w, q, dq, ddq| torque_regressor(model, w, q, dq, ddq)[0]);
    time("aba_derivatives", &mut |w, q, dq, tau| forward_dynamics_derivatives(model, w, q, dq, tau).by_position[0]);
    time("rnea_derivatives", &mut |w, q, dq, ddq| inverse_dynamics_derivatives(model, w, q, dq, ddq).by_position[0]);
    time("coriolis", &mut |w, q, dq, _| coriolis_matrix(model, w, q, dq)[0]);
    time("gravity_derivatives", &mut |w, q, _, _| gravity_torque_derivative(model, w, q)[0]);
}
