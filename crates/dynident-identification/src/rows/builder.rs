//! Blocks of a motion into rows of regressor and torque.

use super::coverage::set_aside;
use super::joint_filters::JointFilters;
use super::mask::RowMask;
use super::velocities::VelocityHistogram;
use super::{PANEL_SAMPLES, RawSamples, RowConsumer};
use crate::recording::LogError;
use crate::regressor_model::RegressorModel;
use dynident_dynamics::{BatchWorkspace, Panels, TermHistory, regressor_panels_following};
use dynident_model::terms::JointMotion;
use dynident_recording::{DecimationSettings, FilterError, MotionBlock};

/// Some samples of a block's positions, velocities and accelerations, joints in the model's order.
pub(crate) fn in_model_order(
    block: &MotionBlock,
    places: &[usize],
    from: usize,
    samples: usize,
    motion: &mut [Vec<f64>; 3],
) {
    for (to, source) in motion.iter_mut().zip([&block.q, &block.dq, &block.ddq]) {
        to.clear();
        for &place in places {
            to.extend_from_slice(&block.joint(source, place)[from..from + samples]);
        }
    }
}

/// Turns blocks of a motion into rows of regressor and torque, filtered alike.
#[derive(Debug)]
pub struct RowBuilder<'a> {
    model: &'a RegressorModel,
    places: Vec<usize>,
    workspace: BatchWorkspace,
    panels: Panels,
    history: TermHistory,
    filters: JointFilters,
    mask: Option<RowMask<'a>>,
    set_aside: Vec<Vec<bool>>,
    temperature_c: Vec<f64>,
    segment: usize,
    motion: [Vec<f64>; 3],
    velocities: Vec<VelocityHistogram>,
    filtered_rows: u64,
    samples: u64,
}

impl<'a> RowBuilder<'a> {
    /// For samples at `rate_hz`, joint `j` of the model standing at place `places[j]` of the motion.
    ///
    /// # Errors
    /// A filter that does not exist at this rate.
    pub fn new(
        model: &'a RegressorModel,
        places: &[usize],
        rate_hz: f64,
        filter: Option<&DecimationSettings>,
    ) -> Result<Self, FilterError> {
        let layout = model.layout();
        let columns: Vec<usize> = (0..model.dof()).map(|joint| layout.joint_columns(joint).len() + 1).collect();
        Ok(Self {
            model,
            places: places.to_vec(),
            workspace: BatchWorkspace::new(model.model()),
            panels: Panels::default(),
            history: TermHistory::new(model.load_parameters.clone()),
            filters: JointFilters::new(&columns, rate_hz, filter)?,
            mask: None,
            set_aside: Vec::new(),
            temperature_c: Vec::new(),
            segment: 0,
            motion: [Vec::new(), Vec::new(), Vec::new()],
            velocities: vec![VelocityHistogram::default(); places.len()],
            filtered_rows: 0,
            samples: 0,
        })
    }

    /// The same that leaves out rows that do not count.
    pub(crate) fn with_mask(mut self, mask: Option<RowMask<'a>>) -> Self {
        self.mask = mask;
        self
    }

    /// Where the model's joints stand in the motion.
    pub(crate) fn places(&self) -> &[usize] {
        &self.places
    }

    /// Samples to either side of a filtered row that it is made from.
    pub(crate) fn reach(&self) -> usize {
        self.filters.reach()
    }

    /// Samples that the first filtered row needs.
    pub(crate) fn needed(&self) -> usize {
        self.filters.needed()
    }

    /// Filtered rows of each joint so far, whether they counted or not.
    pub(crate) fn filtered_rows(&self) -> u64 {
        self.filtered_rows
    }

    /// Samples so far.
    pub(crate) fn samples(&self) -> u64 {
        self.samples
    }

    /// How often each joint moved at which velocity so far.
    pub(crate) fn into_velocities(self) -> Vec<VelocityHistogram> {
        self.velocities
    }

    /// Makes the rows of the next samples.
    ///
    /// # Errors
    /// What the consumer returns.
    pub fn take(&mut self, block: &MotionBlock, consumer: &mut dyn RowConsumer) -> Result<(), LogError> {
        if block.segment != self.segment {
            self.segment = block.segment;
            self.history.restart();
            self.filters.restart();
        }
        let (model, layout) = (self.model.model(), self.model.layout());
        for from in (0..block.rows).step_by(PANEL_SAMPLES) {
            let samples = PANEL_SAMPLES.min(block.rows - from);
            in_model_order(block, &self.places, from, samples, &mut self.motion);
            let [q, dq, ddq] = &self.motion;
            let motion = JointMotion { samples, q, dq, ddq };
            let known = settled(block, from, samples);
            for (velocities, dq) in self.velocities.iter_mut().zip(dq.chunks_exact(samples)) {
                velocities.add(&dq[known.clone()]);
            }
            if !block.temperature_c.is_empty() {
                self.temperature_c.clear();
                for &place in &self.places {
                    let temperature = block.joint(&block.temperature_c, place);
                    self.temperature_c.extend_from_slice(&temperature[from..from + samples]);
                }
                self.history.set_temperature(&self.temperature_c);
            }
            regressor_panels_following(
                model,
                &mut self.workspace,
                layout,
                &motion,
                &mut self.history,
                &mut self.panels,
            );
            for (joint, &place) in self.places.iter().enumerate() {
                let tau = &block.joint(block.fitted_tau(), place)[from..from + samples];
                let torque = self.panels.torque_mut(joint);
                torque.copy_from_slice(tau);
                if let Some(gain) = self.model.torque_gains.get(joint) {
                    for torque in torque {
                        *torque *= gain;
                    }
                }
            }
            self.set_aside.clear();
            if !block.set_aside.is_empty() {
                let of_joints = self.places.iter().map(|&place| set_aside(block, place, from, samples).to_vec());
                self.set_aside.extend(of_joints);
            }
            consumer.raw(&RawSamples {
                segment: block.segment,
                rate_hz: block.rate_hz,
                panels: &self.panels,
                set_aside: &self.set_aside,
                settled: known,
            })?;
            let mut rows = samples;
            for joint in 0..model.dof() {
                let left_out = self.set_aside.get(joint).map_or(&[][..], Vec::as_slice);
                let all = self.filters.push(joint, self.panels.joint(joint), samples, left_out);
                rows = all.rows;
                let counted = match &mut self.mask {
                    Some(mask) if rows > 0 => mask.apply(&all),
                    _ => all,
                };
                if counted.rows > 0 {
                    consumer.filtered(&counted)?;
                }
            }
            self.filters.advance(samples);
            self.filtered_rows += rows as u64;
            self.samples += samples as u64;
        }
        Ok(())
    }
}

/// The samples of a panel whose motion does not rest on samples invented at the ends of a piece.
fn settled(block: &MotionBlock, from: usize, samples: usize) -> core::ops::Range<usize> {
    let [begin, end] = block.unsettled;
    let inside = begin..block.rows.saturating_sub(end);
    let clamped = |row: usize| row.clamp(from, from + samples) - from;
    clamped(inside.start)..clamped(inside.end).max(clamped(inside.start))
}
