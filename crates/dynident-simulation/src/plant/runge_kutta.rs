//! Classical Runge-Kutta method of order 4 that stops where a joint comes to rest.
//!
//! During a step every friction unit slides in one direction or is held. If the velocity of a sliding unit crosses
//! zero, the step ends there (found by false position on the step length) with the unit exactly at rest. Then the
//! method determines again whether friction holds the unit. Breakaway of a held unit is tested at the beginning of a
//! step.

use super::equations::{Equations, Mode, StateView};
use super::{PlantFault, State, euler};

/// Maximum number of stops in one step; the rest is integrated by the implicit step.
const MAX_STOPS: usize = 16;

#[derive(Clone, Debug, Default)]
pub(super) struct Stages {
    q: Vec<f64>,
    dq: Vec<f64>,
    speeds: [Vec<f64>; 3],
    accelerations: [Vec<f64>; 4],
    q_next: Vec<f64>,
    dq_next: Vec<f64>,
}

impl Stages {
    pub(super) fn new(dof: usize) -> Self {
        let zeros = || vec![0.0; dof];
        Self {
            q: zeros(),
            dq: zeros(),
            speeds: core::array::from_fn(|_| zeros()),
            accelerations: core::array::from_fn(|_| zeros()),
            q_next: zeros(),
            dq_next: zeros(),
        }
    }
}

pub(super) fn step(
    equations: &mut Equations,
    stages: &mut Stages,
    state: &mut State,
    tau: &[f64],
    h: f64,
) -> Result<(), PlantFault> {
    let mut left_s = h;
    for _ in 0..MAX_STOPS {
        let at = StateView { time_s: state.time_s, q: &state.q, dq: &state.dq, tau };
        let may_stop = equations.decide(at)?;
        try_step(equations, stages, at, left_s)?;
        if !may_stop || min_sliding_speed(equations, &stages.dq_next) >= 0.0 {
            return commit(equations, stages, state, left_s);
        }
        let Some(done) = shortened_to_stop(equations, stages, at, left_s)? else { break };
        commit(equations, stages, state, done)?;
        left_s -= done;
        if left_s <= 0.0 {
            return Ok(());
        }
    }
    euler::step(equations, state, tau, left_s)
}

/// One step of length `h` with the given mode (sliding or held) of every unit, into the next state of `stages`.
fn try_step(equations: &mut Equations, stages: &mut Stages, at: StateView<'_>, h: f64) -> Result<(), PlantFault> {
    let Stages { q, dq, speeds, accelerations, q_next, dq_next } = stages;
    equations.in_modes(at)?;
    accelerations[0].copy_from_slice(&equations.acceleration);
    for (stage, share) in [0.5, 0.5, 1.0].into_iter().enumerate() {
        let before = if stage == 0 { at.dq } else { &speeds[stage - 1] };
        for joint in 0..q.len() {
            q[joint] = at.q[joint] + share * h * before[joint];
            dq[joint] = at.dq[joint] + share * h * accelerations[stage][joint];
        }
        equations.in_modes(StateView { time_s: at.time_s + share * h, q, dq, tau: at.tau })?;
        speeds[stage].copy_from_slice(dq);
        accelerations[stage + 1].copy_from_slice(&equations.acceleration);
    }
    let [a, b, c] = &*speeds;
    let [e, f, g, i] = &*accelerations;
    for j in 0..q.len() {
        q_next[j] = at.q[j] + h / 6.0 * (at.dq[j] + 2.0 * (a[j] + b[j]) + c[j]);
        dq_next[j] = at.dq[j] + h / 6.0 * (e[j] + 2.0 * (f[j] + g[j]) + i[j]);
    }
    Ok(())
}

/// Smallest velocity of a sliding unit in its direction; negative after a zero crossing.
pub(super) fn min_sliding_speed(equations: &Equations, dq: &[f64]) -> f64 {
    let units = equations.drives.units.iter().zip(&equations.modes).filter(|(unit, _)| unit.holds());
    units.fold(f64::INFINITY, |least, (unit, mode)| match mode {
        Mode::Forward => least.min(unit.speed(dq)),
        Mode::Backward => least.min(-unit.speed(dq)),
        Mode::Held => least,
    })
}

/// Shortens the step to the time when the first sliding unit comes to rest, and sets that unit at rest. `None` if the
/// units that cross zero began at rest.
fn shortened_to_stop(
    equations: &mut Equations,
    stages: &mut Stages,
    at: StateView<'_>,
    h: f64,
) -> Result<Option<f64>, PlantFault> {
    let (mut low, mut at_low) = (0.0, min_sliding_speed(equations, at.dq));
    let (mut high, mut at_high) = (h, min_sliding_speed(equations, &stages.dq_next));
    if at_low <= 0.0 {
        return Ok(None);
    }
    // Velocities below this are treated as zero: rounding of the velocities at the start of the step.
    let zero_speed = 1e-13 * at_low.max(-at_high);
    let mut last_side = 0;
    for _ in 0..60 {
        let length = low + (high - low) * at_low / (at_low - at_high);
        try_step(equations, stages, at, length)?;
        let found = min_sliding_speed(equations, &stages.dq_next);
        if found.abs() <= zero_speed || (high - low) <= 1e-15 * h {
            (low, at_low) = (length, found);
            break;
        }
        // False position that halves the weight of a repeated end (Illinois method).
        if found > 0.0 {
            (low, at_low) = (length, found);
            at_high *= if last_side == 1 { 0.5 } else { 1.0 };
            last_side = 1;
        } else {
            (high, at_high) = (length, found);
            at_low *= if last_side == -1 { 0.5 } else { 1.0 };
            last_side = -1;
        }
    }
    try_step(equations, stages, at, low)?;
    set_at_rest(equations, &mut stages.dq_next, zero_speed.max(at_low.abs()));
    Ok(Some(low))
}

/// Sets units at rest if their velocity in sliding direction is at most `zero_speed`.
pub(super) fn set_at_rest(equations: &mut Equations, dq: &mut [f64], zero_speed: f64) {
    for (unit, mode) in equations.drives.units.iter().zip(&mut equations.modes) {
        let speed = unit.speed(dq);
        let along = if *mode == Mode::Backward { -speed } else { speed };
        if *mode != Mode::Held && unit.holds() && along <= zero_speed {
            let square: f64 = unit.joints.iter().map(|(_, ratio)| ratio * ratio).sum();
            for &(joint, ratio) in &unit.joints {
                dq[joint] -= ratio * speed / square;
            }
            *mode = Mode::Held;
        }
    }
}

fn commit(equations: &mut Equations, stages: &Stages, state: &mut State, h: f64) -> Result<(), PlantFault> {
    state.q.copy_from_slice(&stages.q_next);
    state.dq.copy_from_slice(&stages.dq_next);
    for (unit, mode) in equations.drives.units.iter().zip(&equations.modes) {
        if *mode == Mode::Held
            && let [(joint, _)] = unit.joints[..]
        {
            state.dq[joint] = 0.0;
        }
    }
    state.time_s += h;
    equations.drives.follow(&state.q);
    if state.is_finite() { Ok(()) } else { Err(PlantFault::NotFinite) }
}
