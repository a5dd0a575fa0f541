//! Semi-implicit Euler: the new velocities move the joints.
//!
//! `(M + h F_v)(q̇' - q̇)/h = τ - h(q, q̇) - F_v q̇ - Cᵀ f`, `q' = q + h q̇'`: viscous friction implicit as in MuJoCo's
//! Euler integrator, and all other friction implicit as well, `f` in the map of the velocities after the step. Dry
//! friction then neither chatters nor creates energy at any step.

use super::equations::{Equations, StateView};
use super::{PlantFault, State};

pub(super) fn step(equations: &mut Equations, state: &mut State, tau: &[f64], h: f64) -> Result<(), PlantFault> {
    let State { time_s, q, dq, .. } = state;
    equations.assemble(StateView { time_s: *time_s, q, dq, tau }, h);
    equations.factor_and_solve()?;
    let rubs = !equations.drives.units.is_empty();
    if rubs {
        equations.choose(|_, _| true);
        equations.rub(Some(dq), h, false);
    }
    let mut finite = true;
    for (dq, a) in dq.iter_mut().zip(&equations.acceleration) {
        *dq += h * a;
        finite &= dq.is_finite();
    }
    if rubs {
        equations.after_rubbing(|unit, mode, speed| {
            // What is held rests exactly.
            if speed == 0.0
                && unit.holds()
                && let [(joint, _)] = unit.joints[..]
            {
                dq[joint] = 0.0;
            }
            *mode = super::equations::Mode::Forward;
        });
    }
    for (q, dq) in q.iter_mut().zip(dq.iter()) {
        *q += h * dq;
        finite &= q.is_finite();
    }
    *time_s += h;
    equations.drives.follow(q);
    if finite { Ok(()) } else { Err(PlantFault::NotFinite) }
}
