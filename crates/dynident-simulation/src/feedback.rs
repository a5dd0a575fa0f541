//! Measurements of the controller, sample by sample.

use crate::controllers::Measured;
use crate::plant::Plant;
use crate::sensors::{SensorSettings, VelocitySource};
use dynident_model::sample::Random;

/// Separates the random numbers of the feedback from those of the record.
const RANDOM_STREAM: u64 = 0x5eed_feed_bacc_0001;

#[derive(Debug)]
pub(crate) struct Feedback<'a> {
    settings: &'a SensorSettings,
    is_rotary: Vec<bool>,
    random: Random,
    /// Ring buffer of the last `delay + 1` sensor samples, joint after joint.
    q: Vec<f64>,
    dq: Vec<f64>,
    place: usize,
    slots: usize,
    /// Weight of a new velocity difference in the velocity filter; filtered velocity and previous position follow
    /// below.
    share: f64,
    filtered: Vec<f64>,
    last_q: Vec<f64>,
    rate_hz: f64,
    started: bool,
}

impl<'a> Feedback<'a> {
    pub(crate) fn new(settings: &'a SensorSettings, plant: &Plant, rate_hz: f64) -> Self {
        let joints = plant.dof();
        let slots = settings.feedback_delay_samples + 1;
        let share = match settings.speed {
            VelocitySource::True => 1.0,
            VelocitySource::Differences { cutoff_hz } => 1.0 - (-core::f64::consts::TAU * cutoff_hz / rate_hz).exp(),
        };
        Self {
            settings,
            is_rotary: plant.model().joints().iter().map(dynident_model::Joint::is_rotary).collect(),
            random: Random::new(settings.seed ^ RANDOM_STREAM),
            q: vec![0.0; joints * slots],
            dq: vec![0.0; joints * slots],
            place: 0,
            slots,
            share,
            filtered: vec![0.0; joints],
            last_q: vec![0.0; joints],
            rate_hz,
            started: false,
        }
    }

    /// Processes a new sensor sample; [`measured`](Self::measured) then returns the delayed sample for the
    /// controller.
    #[inline]
    pub(crate) fn read(&mut self, q: &[f64], dq: &[f64]) {
        let joints = q.len();
        self.place = self.after(self.place);
        let own = self.place * joints;
        for joint in 0..joints {
            let reading = self.settings.position(joint, q[joint], self.is_rotary[joint], &mut self.random);
            self.q[own + joint] = reading;
            self.dq[own + joint] = match self.settings.speed {
                VelocitySource::True => dq[joint],
                VelocitySource::Differences { .. } => {
                    if self.started {
                        let difference = (reading - self.last_q[joint]) * self.rate_hz;
                        self.filtered[joint] += self.share * (difference - self.filtered[joint]);
                    }
                    self.filtered[joint]
                }
            };
            self.last_q[joint] = reading;
        }
        if !self.started {
            self.started = true;
            // Before the run the robot is at rest in its start position.
            for slot in 0..self.slots {
                for joint in 0..joints {
                    self.q[slot * joints + joint] = self.last_q[joint];
                    self.dq[slot * joints + joint] = self.dq[own + joint];
                }
            }
        }
    }

    fn after(&self, place: usize) -> usize {
        if place + 1 == self.slots { 0 } else { place + 1 }
    }

    pub(crate) fn measured(&self) -> Measured<'_> {
        let joints = self.last_q.len();
        let oldest = self.after(self.place) * joints;
        Measured { q: &self.q[oldest..oldest + joints], dq: &self.dq[oldest..oldest + joints] }
    }
}
