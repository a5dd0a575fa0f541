//! Closed loops side by side: sample by sample what [`closed_loop()`](crate::closed_loop()) does, a loop in each lane.

use super::tape::{BLOCK, LaneRows};
use super::{Placed, is_plain};
use crate::closed_loop::{Beginning, verdict};
use crate::controllers::Target;
use crate::feedback::Feedback;
use crate::plant::{FARTHEST, Integrator, MOST_LANES, PlantLanes};
use crate::run::{Run, RunStatus};
use dynident_lanes::{AlignedBuffer, Kernel, Lane};

/// Runs loops that can stand side by side. `ended(place, index, run)` gets every one that has ended, without a run
/// where it must be run by itself.
pub(super) struct LaneLoops<'k, 's, 'a> {
    pub(super) loops: &'k mut [Placed<'s, 'a>],
    pub(super) ended: &'k mut dyn FnMut(usize, usize, Option<Run>),
}

impl Kernel for LaneLoops<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { loops, ended } = self;
        let Some(mut lanes) = Lanes::<T>::new(loops) else {
            loops.iter().enumerate().for_each(|(place, (index, _))| ended(place, *index, None));
            return;
        };
        lanes.refill(loops);
        while let Some(rows) = lanes.rows() {
            lanes.read_references(loops, rows);
            for row in 0..rows {
                lanes.sample(loops, row);
            }
            lanes.close_block(loops, rows, ended);
            lanes.refill(loops);
        }
    }
}

/// How a loop left its lane before its reference's end.
enum Leave {
    /// With this status, after so many rows of the block.
    Status(RunStatus, usize),
    /// To be run by itself.
    Alone,
}

/// The loop in a lane.
struct Slot<'a> {
    /// Its place among the loops.
    place: usize,
    /// The sample at the block's first row.
    first: usize,
    /// Samples of its reference.
    samples: usize,
    beginning: Beginning,
    run: Run,
    feedback: Feedback<'a>,
    leave: Option<Leave>,
}

/// What is the same number of times in all loops: see [`super::stand_beside`].
#[derive(Clone, Copy)]
struct Common {
    joints: usize,
    is_euler: bool,
    steps_per_sample: usize,
    accelerations: bool,
    /// Whether controllers and sensors go over lanes.
    is_plain: bool,
}

struct Lanes<'a, T: Lane> {
    common: Common,
    plant: PlantLanes<T>,
    slots: [Option<Slot<'a>>; MOST_LANES],
    /// The next loop that has no lane yet.
    next: usize,
    kp: Vec<T>,
    kd: Vec<T>,
    /// Largest torques; lowest and highest positions, velocities, distances from the reference.
    torque: Vec<T>,
    lower: Vec<T>,
    upper: Vec<T>,
    speed: Vec<T>,
    error: Vec<T>,
    max_error: Vec<T>,
    sum_of_squares: Vec<T>,
    references: LaneRows,
    /// q, q̇, τ, then what was asked for of measured q, measured q̇, q̈.
    record: LaneRows,
    /// For what is called loop by loop: states and torques of all lanes, then state, target and torque of one.
    scratch: AlignedBuffer,
}

impl<'a, T: Lane> Lanes<'a, T> {
    fn new(loops: &[Placed<'_, 'a>]) -> Option<Self> {
        let (_, one) = loops.first()?;
        let joints = one.plant.dof();
        let (is_euler, steps_per_sample) = match one.settings.integrator {
            Integrator::SemiImplicitEuler { steps_per_sample } => (true, steps_per_sample),
            Integrator::Rk4 { steps_per_sample } => (false, steps_per_sample),
            Integrator::Adaptive { .. } => return None,
        };
        let accelerations = one.settings.accelerations;
        let common = Common { joints, is_euler, steps_per_sample, accelerations, is_plain: is_plain(one) };
        let zeros = || vec![T::ZERO; joints];
        let mut scratch = AlignedBuffer::new();
        scratch.resize((3 * T::LANES + 6) * joints);
        Some(Self {
            scratch,
            plant: PlantLanes::new(one.plant)?,
            slots: core::array::from_fn(|_| None),
            next: 0,
            kp: zeros(),
            kd: zeros(),
            torque: zeros(),
            lower: zeros(),
            upper: zeros(),
            speed: zeros(),
            error: zeros(),
            max_error: zeros(),
            sum_of_squares: zeros(),
            references: LaneRows::new(if common.is_plain { 2 } else { 3 } * joints, T::LANES),
            record: LaneRows::new(
                (if common.is_plain { 3 } else { 5 } + usize::from(accelerations)) * joints,
                T::LANES,
            ),
            common,
        })
    }

    /// Gives empty lanes the loops that come next, and puts those that stay empty to rest.
    fn refill(&mut self, loops: &mut [Placed<'_, 'a>]) {
        for lane in 0..T::LANES {
            if self.slots[lane].is_some() {
                continue;
            }
            let place = self.next;
            self.next += 1;
            // The settings were found good before.
            let beginning = loops.get(place).and_then(|(_, one)| {
                Beginning::of(one.plant, one.controller, one.reference, one.settings).ok().map(|begin| (one, begin))
            });
            let Some((one, beginning)) = beginning else {
                self.next = place;
                self.free(lane);
                continue;
            };
            let h = 1.0 / one.reference.rate_hz() / self.common.steps_per_sample as f64;
            self.plant.put(lane, one.plant, h);
            self.plant.set_state(lane, &beginning.q, &beginning.dq);
            let limits = &beginning.limits;
            let nearest = |a: f64, b: f64| if a < b { a } else { b };
            for joint in 0..self.common.joints {
                let [kp, kd] = one.controller.joint_gains().map_or([0.0; 2], |[kp, kd]| [kp[joint], kd[joint]]);
                for (to, value) in [
                    (&mut self.kp, kp),
                    (&mut self.kd, kd),
                    (&mut self.torque, nearest(limits.torque[joint], f64::MAX)),
                    (&mut self.lower, -nearest(-limits.lower[joint], FARTHEST)),
                    (&mut self.upper, nearest(limits.upper[joint], FARTHEST)),
                    (&mut self.speed, nearest(limits.speed[joint], limits.beyond[joint])),
                    (&mut self.error, limits.error[joint]),
                    (&mut self.max_error, 0.0),
                    (&mut self.sum_of_squares, 0.0),
                ] {
                    to[joint] = to[joint].with_lane(lane, value);
                }
            }
            let mut run = Run::begin(one.plant, one.reference, self.common.accelerations);
            if !self.common.is_plain {
                (run.measured_q, run.measured_dq) = (vec![0.0; run.q.len()], vec![0.0; run.q.len()]);
            }
            let feedback = Feedback::new(&one.settings.sensors, one.plant, one.reference.rate_hz());
            let samples = one.reference.samples();
            self.slots[lane] = Some(Slot { place, first: 0, samples, beginning, run, feedback, leave: None });
            loops[place].1.controller.reset();
        }
    }

    /// A lane without a loop: nothing it does can break a limit.
    fn free(&mut self, lane: usize) {
        self.plant.park(lane);
        for joint in 0..self.common.joints {
            for (to, value) in [
                (&mut self.kp, 0.0),
                (&mut self.kd, 0.0),
                (&mut self.torque, f64::MAX),
                (&mut self.lower, -FARTHEST),
                (&mut self.upper, FARTHEST),
                (&mut self.speed, f64::INFINITY),
                (&mut self.error, f64::INFINITY),
            ] {
                to[joint] = to[joint].with_lane(lane, value);
            }
        }
    }

    /// Samples in the next block: none if no lane has a loop.
    fn rows(&self) -> Option<usize> {
        self.slots.iter().flatten().map(|slot| slot.samples - slot.first).min().map(|rest| rest.min(BLOCK))
    }

    fn read_references(&mut self, loops: &[Placed<'_, 'a>], rows: usize) {
        for (lane, slot) in self.slots.iter().enumerate() {
            if let Some(slot) = slot {
                self.references.take_reference(lane, loops[slot.place].1.reference, slot.first, rows);
            }
        }
    }

    /// One sample of all lanes: verdict, control law, record, and on to the next.
    #[inline(always)]
    fn sample(&mut self, loops: &mut [Placed<'_, 'a>], row: usize) {
        let n = self.common.joints;
        let target_q = &self.references.row(row)[..n * T::LANES];
        let mut within = true;
        for j in 0..n {
            let (q, dq) = (self.plant.q[j], self.plant.dq[j]);
            let error = (T::load(&target_q[j * T::LANES..]) - q).abs();
            within &= q.all_at_most(self.upper[j]) & self.lower[j].all_at_most(q);
            within &= dq.abs().all_at_most(self.speed[j]) & error.all_at_most(self.error[j]);
        }
        if !within {
            self.judge(row);
        }
        if self.common.is_plain {
            let (target_q, target_dq) = self.references.row(row)[..2 * n * T::LANES].split_at(n * T::LANES);
            for j in 0..n {
                let position = T::load(&target_q[j * T::LANES..]) - self.plant.q[j];
                let speed = T::load(&target_dq[j * T::LANES..]) - self.plant.dq[j];
                self.plant.tau[j] = self.kp[j] * position + self.kd[j] * speed;
            }
        } else {
            self.call_controllers(loops, row);
        }
        let mut within = true;
        for j in 0..n {
            within &= self.plant.tau[j].abs().all_at_most(self.torque[j]);
        }
        if !within {
            self.cut_torques();
        }
        let target_q = &self.references.row(row)[..n * T::LANES];
        for j in 0..n {
            let error = (T::load(&target_q[j * T::LANES..]) - self.plant.q[j]).abs();
            self.max_error[j] = self.max_error[j].max(error);
            self.sum_of_squares[j] += error * error;
        }
        self.record.put(row, 0, &self.plant.q);
        self.record.put(row, n, &self.plant.dq);
        self.record.put(row, 2 * n, &self.plant.tau);
        if self.common.accelerations {
            self.plant.accelerate();
            let from = if self.common.is_plain { 3 } else { 5 } * n;
            self.record.put(row, from, &self.plant.acceleration);
        }
        for _ in 0..self.common.steps_per_sample {
            self.plant.step(self.common.is_euler);
        }
        if self.plant.any_lost {
            self.let_lost_go();
        }
    }
    /// The rare end of a sample's first look: which loops are beyond what, and may not go on.
    #[cold]
    #[inline(never)]
    fn judge(&mut self, row: usize) {
        let n = self.common.joints;
        let mut state = vec![0.0; 3 * n];
        for lane in 0..T::LANES {
            let Some(Slot { first, beginning, run, leave: None, .. }) = &self.slots[lane] else { continue };
            let target = self.references.row(row);
            for j in 0..n {
                state[j] = self.plant.q[j].lane(lane);
                state[n + j] = self.plant.dq[j].lane(lane);
                state[2 * n + j] = target[j * T::LANES + lane];
            }
            let (q, dq, target) = (&state[..n], &state[n..2 * n], &state[2 * n..]);
            if !q.iter().all(|q| q.abs() <= FARTHEST) || !dq.iter().all(|dq| dq.is_finite()) {
                self.leave(lane, Leave::Alone);
            } else if let Some(status) = verdict(q, dq, &beginning.limits, target, run.time_s(first + row), &run.joints)
            {
                self.leave(lane, Leave::Status(status, row));
            }
        }
    }

    /// Torques beyond their limits are cut, and counted; with one that is no number a loop may not go on here.
    #[cold]
    #[inline(never)]
    fn cut_torques(&mut self) {
        let n = self.common.joints;
        for lane in 0..T::LANES {
            let Some(Slot { beginning, run, leave: None, .. }) = &mut self.slots[lane] else { continue };
            let mut finite = true;
            for j in 0..n {
                let (tau, limit) = (self.plant.tau[j].lane(lane), beginning.limits.torque[j]);
                finite &= tau.is_finite();
                if tau.abs() > limit {
                    self.plant.tau[j] = self.plant.tau[j].with_lane(lane, limit.copysign(tau));
                    run.saturated[j] += 1;
                }
            }
            if !finite {
                self.leave(lane, Leave::Alone);
            }
        }
    }

    /// Loops whose robots could not be stepped.
    #[cold]
    #[inline(never)]
    fn let_lost_go(&mut self) {
        let lost = self.plant.take_lost();
        for lane in 0..T::LANES {
            if lost[lane] {
                self.leave(lane, Leave::Alone);
            }
        }
    }

    /// A loop leaves its lane, which is free at the block's end.
    fn leave(&mut self, lane: usize, how: Leave) {
        self.take_errors(lane);
        self.free(lane);
        if let Some(slot) = &mut self.slots[lane] {
            slot.leave.get_or_insert(how);
        }
    }

    /// Errors of a lane into its run.
    fn take_errors(&mut self, lane: usize) {
        let Some(Slot { run, leave: None, .. }) = &mut self.slots[lane] else { return };
        for j in 0..self.common.joints {
            run.max_error[j] = self.max_error[j].lane(lane);
            run.rms_error[j] = self.sum_of_squares[j].lane(lane);
        }
    }

    /// Sensors and control laws, loop by loop.
    #[inline(never)]
    fn call_controllers(&mut self, loops: &mut [Placed<'_, 'a>], row: usize) {
        let (n, lanes) = (self.common.joints, T::LANES);
        let room = self.scratch.as_mut_slice();
        let (state, room) = room.split_at_mut(2 * n * lanes);
        let (torques, own) = room.split_at_mut(n * lanes);
        for j in 0..n {
            self.plant.q[j].store(&mut state[j * lanes..]);
            self.plant.dq[j].store(&mut state[(n + j) * lanes..]);
        }
        torques.fill(0.0);
        let (own, tau) = own.split_at_mut(5 * n);
        for lane in 0..lanes {
            let Some(Slot { place, first, run, feedback, leave: None, .. }) = &mut self.slots[lane] else { continue };
            let target = self.references.row(row);
            for j in 0..2 * n {
                own[j] = state[j * lanes + lane];
            }
            for j in 0..3 * n {
                own[2 * n + j] = target[j * lanes + lane];
            }
            let (q, dq, target) = (&own[..n], &own[n..2 * n], &own[2 * n..]);
            feedback.read(q, dq);
            let measured = feedback.measured();
            let target = Target { q: &target[..n], dq: &target[n..2 * n], ddq: &target[2 * n..] };
            loops[*place].1.controller.torque(run.time_s(*first + row), target, measured, tau);
            for j in 0..n {
                torques[j * lanes + lane] = tau[j];
                self.record.put_one(row, 3 * n + j, lane, measured.q[j]);
                self.record.put_one(row, 4 * n + j, lane, measured.dq[j]);
            }
        }
        for j in 0..n {
            self.plant.tau[j] = T::load(&torques[j * lanes..]);
        }
    }

    /// Writes a block into the runs and lets those go that have ended.
    fn close_block(&mut self, loops: &[Placed<'_, 'a>], rows: usize, ended: &mut dyn FnMut(usize, usize, Option<Run>)) {
        let n = self.common.joints;
        for lane in 0..T::LANES {
            let Some(slot) = &mut self.slots[lane] else { continue };
            let kept = match &slot.leave {
                None => rows,
                Some(Leave::Status(_, kept)) => *kept,
                Some(Leave::Alone) => 0,
            };
            let Slot { first, samples, run, .. } = slot;
            let measured = if self.common.is_plain {
                [None, None]
            } else {
                [Some(&mut run.measured_q), Some(&mut run.measured_dq)]
            };
            let [measured_q, measured_dq] = measured;
            let ddq = self.common.accelerations.then_some(&mut run.ddq);
            let arrays = [Some(&mut run.q), Some(&mut run.dq), Some(&mut run.tau), measured_q, measured_dq, ddq];
            for (place, array) in arrays.into_iter().flatten().enumerate() {
                for joint in 0..n {
                    let to = &mut array[joint * *samples + *first..][..kept];
                    self.record.take_column(place * n + joint, lane, to);
                }
            }
            *first += kept;
            if slot.leave.is_none() && slot.first < slot.samples {
                continue;
            }
            self.take_errors(lane);
            let Some(Slot { place, first, mut run, leave, .. }) = self.slots[lane].take() else { continue };
            let index = loops[place].0;
            match leave {
                Some(Leave::Alone) => {
                    ended(place, index, None);
                    continue;
                }
                Some(Leave::Status(status, _)) => run.status = status,
                None => {}
            }
            if self.common.is_plain {
                (run.measured_q, run.measured_dq) = (run.q.clone(), run.dq.clone());
            }
            run.end(first);
            ended(place, index, Some(run));
        }
    }
}
