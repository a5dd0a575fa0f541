//! Semi-implicit Euler method: positions are integrated with the new velocities.
//!
//! `(M + h F_v)(q̇' - q̇)/h = τ - h(q, q̇) - F_v q̇ - Cᵀ f`, `q' = q + h q̇'` with step length h. Viscous friction
//! F_v is implicit as in MuJoCo's Euler integrator. All other friction f is implicit too: it satisfies the friction
//! law at the velocities after the step. Dry friction therefore neither chatters nor creates energy, for any step
//! length.

use super::equations::{Equations, StateView};
use super::{PlantFault, State};

pub(super) fn step(equations: &mut Equations, state: &mut State, tau: &[f64], h: f64) -> Result<(), PlantFault> {
    let State { time_s, q, dq, .. } = state;
    equations.assemble(StateView { time_s: *time_s, q, dq, tau }, h);
    equations.factor_and_solve()?;
    let has_friction = !equations.drives.units.is_empty();
    if has_friction {
        equations.choose(|_, _| true);
        equations.apply_friction(Some(dq), h, false);
    }
    let mut finite = true;
    for (dq, a) in dq.iter_mut().zip(&equations.acceleration) {
        *dq += h * a;
        finite &= dq.is_finite();
    }
    if has_friction {
        equations.for_each_chosen(|unit, mode, speed| {
            // Held joints are exactly at rest.
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
