//! Several simulated robots side by side, one in each lane, of which every one does to the last bit what it does alone.
//!
//! Over lanes go robots whose equation of motion is the same arithmetic for all: bodies, drive inertia, viscous
//! friction, constant torques, and the integrators of fixed steps. What decides or remembers (dry friction, springs
//! that slip, declared torques, disturbances, locked joints, joints that follow others, steps of controlled length)
//! does not.

use super::factor_lanes::factor_and_solve;
use super::{Integrator, Plant};
use dynident_dynamics::{RobotLanes, share_tree};
use dynident_lanes::Lane;

/// A robot farther out than this is left to the loop by itself: near 1e5 rad sines are taken another way, for all lanes
/// at once.
pub(crate) const FARTHEST: f64 = 9e4;

/// Most lanes that a level has.
pub(crate) const MOST_LANES: usize = 8;

impl Plant {
    /// Whether the robot can be stepped beside others by this integrator.
    pub(crate) fn goes_over_lanes(&self, integrator: Integrator) -> bool {
        let equations = &self.equations;
        !matches!(integrator, Integrator::Adaptive { .. })
            && equations.drives.is_linear()
            && equations.disturbances.is_empty()
            && !equations.any_locked
            && equations.model.coupling().is_none()
    }

    /// Whether two robots that go over lanes can stand side by side: one tree, and terms that add to the same entries.
    pub(crate) fn stands_beside(&self, other: &Self) -> bool {
        let same = |one: &[(usize, usize, f64)], other: &[(usize, usize, f64)]| {
            one.iter().map(|entry| (entry.0, entry.1)).eq(other.iter().map(|entry| (entry.0, entry.1)))
        };
        let (own, others) = (&self.equations.drives, &other.equations.drives);
        same(&own.inertia, &others.inertia)
            && same(&own.viscous, &others.viscous)
            && share_tree(self.model(), other.model())
    }
}

/// Robots side by side, with their states.
pub(crate) struct PlantLanes<T: Lane> {
    robots: RobotLanes<T>,
    constant: Vec<T>,
    inertia: Vec<(usize, usize, T)>,
    viscous: Vec<(usize, usize, T)>,
    pub(crate) q: Vec<T>,
    pub(crate) dq: Vec<T>,
    /// Torques of the drives until the next sample.
    pub(crate) tau: Vec<T>,
    pub(crate) acceleration: Vec<T>,
    /// Length of a step, s.
    h: T,
    /// A sixth of it.
    sixth: T,
    stages: Stages<T>,
    /// Lanes whose motion cannot be continued here: their numbers have no meaning any more.
    lost: [bool; MOST_LANES],
    pub(crate) any_lost: bool,
}

/// Of the method of order 4.
struct Stages<T> {
    q: Vec<T>,
    dq: Vec<T>,
    speeds: [Vec<T>; 3],
    accelerations: [Vec<T>; 4],
}

impl<T: Lane> PlantLanes<T> {
    /// Lanes for robots like this one, all of them this one, at rest at zero; none where joints follow others.
    pub(crate) fn new(plant: &Plant) -> Option<Self> {
        let drives = &plant.equations.drives;
        let zeros = || vec![T::ZERO; plant.dof()];
        let entries = |of: &[(usize, usize, f64)]| of.iter().map(|&(a, b, value)| (a, b, T::splat(value))).collect();
        Some(Self {
            robots: RobotLanes::new(plant.model())?,
            constant: drives.constant.iter().map(|&value| T::splat(value)).collect(),
            inertia: entries(&drives.inertia),
            viscous: entries(&drives.viscous),
            q: zeros(),
            dq: zeros(),
            tau: zeros(),
            acceleration: zeros(),
            h: T::ONE,
            sixth: T::ONE,
            stages: Stages {
                q: zeros(),
                dq: zeros(),
                speeds: core::array::from_fn(|_| zeros()),
                accelerations: core::array::from_fn(|_| zeros()),
            },
            lost: [false; MOST_LANES],
            any_lost: false,
        })
    }

    /// Puts a robot into a lane, with the length of its steps.
    pub(crate) fn put(&mut self, lane: usize, plant: &Plant, h: f64) {
        let drives = &plant.equations.drives;
        self.robots.put(lane, plant.model());
        for (to, value) in self.constant.iter_mut().zip(&drives.constant) {
            *to = to.with_lane(lane, *value);
        }
        for (entries, of) in [(&mut self.inertia, &drives.inertia), (&mut self.viscous, &drives.viscous)] {
            for (to, entry) in entries.iter_mut().zip(of) {
                to.2 = to.2.with_lane(lane, entry.2);
            }
        }
        self.h = self.h.with_lane(lane, h);
        self.sixth = self.sixth.with_lane(lane, h / 6.0);
    }

    /// The lanes that were lost since this was last asked.
    pub(crate) fn take_lost(&mut self) -> [bool; MOST_LANES] {
        self.any_lost = false;
        core::mem::take(&mut self.lost)
    }

    /// Puts the robot of a lane somewhere.
    pub(crate) fn set_state(&mut self, lane: usize, q: &[f64], dq: &[f64]) {
        for joint in 0..self.q.len() {
            self.q[joint] = self.q[joint].with_lane(lane, q[joint]);
            self.dq[joint] = self.dq[joint].with_lane(lane, dq[joint]);
        }
    }

    /// Puts the robot of a lane to rest at zero, without torque: what it does from here on is nobody's motion.
    pub(crate) fn park(&mut self, lane: usize) {
        for values in [&mut self.q, &mut self.dq, &mut self.tau] {
            for value in values {
                *value = value.with_lane(lane, 0.0);
            }
        }
    }

    /// Accelerations at the present state and torques.
    #[inline(always)]
    pub(crate) fn accelerate(&mut self) {
        self.go(Purpose::Acceleration);
    }

    /// One step of every lane.
    #[inline(always)]
    pub(crate) fn step(&mut self, is_euler: bool) {
        self.go(if is_euler { Purpose::Euler } else { Purpose::Rk4 });
    }

    /// Evaluates the equation of motion as often as `purpose` asks: in one place, since it is compiled into it.
    #[inline(always)]
    fn go(&mut self, purpose: Purpose) {
        let n = self.q.len();
        let implicit = if matches!(purpose, Purpose::Euler) { self.h } else { T::ZERO };
        let mut stage = 0;
        loop {
            let at_start = stage == 0;
            // Lanes that are too far out, or no numbers any more, must not be seen by the others.
            let (q, dq) = if at_start { (&self.q, &self.dq) } else { (&self.stages.q, &self.stages.dq) };
            let mut near = true;
            for q in q {
                near &= q.abs().all_at_most(T::splat(FARTHEST));
            }
            if !near {
                let far = far_lanes(q);
                self.lose(far);
                stage = 0;
                continue;
            }
            let (matrix, bias) = self.robots.matrix_and_bias(q, dq);
            for j in 0..n {
                self.acceleration[j] = self.tau[j] - bias[j] - self.constant[j];
            }
            for &(row, column, value) in &self.inertia {
                matrix[row * n + column] += value;
            }
            for &(row, column, value) in &self.viscous {
                matrix[row * n + column] += implicit * value;
                self.acceleration[row] -= value * dq[column];
            }
            if !factor_and_solve(matrix, n, &mut self.acceleration, &mut self.lost) {
                self.any_lost = true;
            }
            match purpose {
                Purpose::Acceleration => return,
                Purpose::Euler => {
                    for j in 0..n {
                        self.dq[j] += self.h * self.acceleration[j];
                        self.q[j] += self.h * self.dq[j];
                    }
                    return;
                }
                Purpose::Rk4 => {
                    if stage == 3 {
                        self.finish_rk4();
                        return;
                    }
                    self.prepare_stage(stage);
                    stage += 1;
                }
            }
        }
    }

    /// The state of the next stage of the method of order 4.
    #[inline(always)]
    fn prepare_stage(&mut self, stage: usize) {
        let n = self.q.len();
        let Stages { q, dq, speeds, accelerations } = &mut self.stages;
        let share = if stage == 2 { T::ONE } else { T::splat(0.5) } * self.h;
        for j in 0..n {
            let before = if stage == 0 { self.dq[j] } else { speeds[stage - 1][j] };
            let acceleration = self.acceleration[j];
            accelerations[stage][j] = acceleration;
            q[j] = self.q[j] + share * before;
            dq[j] = self.dq[j] + share * acceleration;
            speeds[stage][j] = dq[j];
        }
    }

    #[inline(always)]
    fn finish_rk4(&mut self) {
        let Stages { speeds: [a, b, c], accelerations: [e, f, g, _], .. } = &self.stages;
        let two = T::splat(2.0);
        for j in 0..self.q.len() {
            self.q[j] += self.sixth * (self.dq[j] + two * (a[j] + b[j]) + c[j]);
            self.dq[j] += self.sixth * (e[j] + two * (f[j] + g[j]) + self.acceleration[j]);
        }
    }

    #[cold]
    #[inline(never)]
    fn lose(&mut self, lanes: [bool; MOST_LANES]) {
        for lane in 0..T::LANES {
            if lanes[lane] {
                (self.lost[lane], self.any_lost) = (true, true);
                self.park(lane);
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Purpose {
    Acceleration,
    Euler,
    Rk4,
}

/// Lanes with a position beyond [`FARTHEST`], or one that is no number.
#[cold]
#[inline(never)]
fn far_lanes<T: Lane>(q: &[T]) -> [bool; MOST_LANES] {
    let mut far = [false; MOST_LANES];
    for q in q {
        let mut lanes = [0.0; MOST_LANES];
        q.store(&mut lanes);
        for (far, q) in far.iter_mut().zip(lanes) {
            *far |= q.is_nan() || q.abs() > FARTHEST;
        }
    }
    far
}
