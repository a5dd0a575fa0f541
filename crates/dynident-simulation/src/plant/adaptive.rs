//! Adaptive integration between two controller samples: Dormand and Prince's method of order 8(5,3) with error control,
//! from the crate `differential-equations`.
//!
//! Friction is treated as in the fixed Runge-Kutta method: the integration stops where a sliding unit (a joint with
//! dry friction, or joints coupled by it) comes to rest, and restarts there. The dense output of the method gives the
//! instant.

use super::equations::{Equations, StateView};
use super::runge_kutta::{min_sliding_speed, set_at_rest};
use super::{PlantFault, State, euler};
use core::cell::{Cell, RefCell};
use differential_equations::methods::ExplicitRungeKutta;
use differential_equations::ode::{ODE, solve_ode};
use differential_equations::prelude::{ControlFlag, Interpolation, Solout, Solution};

/// Maximum number of stops between two samples; after them an implicit step integrates the rest.
const MAX_STOPS: usize = 64;

/// Right-hand side for `y = [q, q̇]`, with the time since the sample.
struct Field<'a> {
    equations: &'a RefCell<&'a mut Equations>,
    start_s: f64,
    tau: &'a [f64],
    fault: Cell<Option<PlantFault>>,
}

impl ODE<f64, Vec<f64>> for Field<'_> {
    fn diff(&self, t: f64, y: &Vec<f64>, dydt: &mut Vec<f64>) {
        let (q, dq) = y.split_at(self.tau.len());
        let mut equations = self.equations.borrow_mut();
        let (speeds, accelerations) = dydt.split_at_mut(self.tau.len());
        speeds.copy_from_slice(dq);
        match equations.in_modes(StateView { time_s: self.start_s + t, q, dq, tau: self.tau }) {
            Ok(()) => accelerations.copy_from_slice(&equations.acceleration),
            Err(fault) => {
                self.fault.set(Some(fault));
                accelerations.fill(f64::NAN);
            }
        }
    }
}

/// Stores the last state, and stops where a unit comes to rest.
struct Watch<'a> {
    equations: &'a RefCell<&'a mut Equations>,
    dof: usize,
    last: (f64, Vec<f64>),
    stopped: bool,
}

impl Solout<f64, Vec<f64>> for Watch<'_> {
    fn solout<I: Interpolation<f64, Vec<f64>> + ?Sized>(
        &mut self,
        t_curr: f64,
        t_prev: f64,
        y_curr: &Vec<f64>,
        _y_prev: &Vec<f64>,
        interpolator: &mut I,
        _solution: &mut Solution<f64, Vec<f64>>,
    ) -> ControlFlag<f64, Vec<f64>> {
        let equations = self.equations.borrow();
        let of = |y: &[f64]| min_sliding_speed(&equations, &y[self.dof..]);
        self.last.0 = t_curr;
        self.last.1.copy_from_slice(y_curr);
        // A unit that starts from rest has a margin of zero; a crossing requires a positive margin before.
        if of(y_curr) >= 0.0 || t_curr <= t_prev {
            return ControlFlag::Continue;
        }
        self.stopped = true;
        let (mut low, mut high) = (t_prev, t_curr);
        while high - low > 1e-15 {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            match interpolator.interpolate(middle) {
                Ok(y) if of(&y) >= 0.0 => {
                    low = middle;
                    self.last = (middle, y);
                }
                Ok(_) => high = middle,
                Err(_) => break,
            }
        }
        if low == t_prev {
            self.last.0 = t_prev;
        }
        ControlFlag::Terminate
    }
}

pub(super) fn advance(
    equations: &mut Equations,
    state: &mut State,
    tau: &[f64],
    duration_s: f64,
    relative: f64,
    absolute: f64,
) -> Result<(), PlantFault> {
    let dof = tau.len();
    let mut left = duration_s;
    for _ in 0..MAX_STOPS {
        let at = StateView { time_s: state.time_s, q: &state.q, dq: &state.dq, tau };
        equations.decide(at)?;
        let y = [&state.q[..], &state.dq].concat();
        let shared = RefCell::new(&mut *equations);
        let field = Field { equations: &shared, start_s: state.time_s, tau, fault: Cell::new(None) };
        let mut watch = Watch { equations: &shared, dof, last: (0.0, y.clone()), stopped: false };
        let mut method = ExplicitRungeKutta::dop853().rtol(relative).atol(absolute);
        let result = solve_ode(&mut method, &field, 0.0, left, &y, &mut watch);
        if let Some(fault) = field.fault.take() {
            return Err(fault);
        }
        if result.is_err() {
            return Err(PlantFault::StepSize);
        }
        let (done, y) = watch.last;
        let stopped = watch.stopped;
        if stopped && done <= 0.0 {
            // A unit that began at rest reversed immediately.
            return euler::step(equations, state, tau, left);
        }
        state.q.copy_from_slice(&y[..dof]);
        state.dq.copy_from_slice(&y[dof..]);
        state.time_s += done;
        equations.drives.follow(&state.q);
        if !state.is_finite() {
            return Err(PlantFault::NotFinite);
        }
        if !stopped {
            return Ok(());
        }
        let zero_speed = min_sliding_speed(equations, &state.dq).max(0.0);
        set_at_rest(equations, &mut state.dq, zero_speed);
        left -= done;
        if left <= 1e-14 {
            return Ok(());
        }
    }
    euler::step(equations, state, tau, left)
}
