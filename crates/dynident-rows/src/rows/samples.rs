//! Panels of regressor and torque before any filter.

use super::mask_of_block::{set_aside, settled};
use super::velocities::VelocityHistogram;
use super::{PANEL_SAMPLES, RawSamples};
use crate::regressor_model::RegressorModel;
use core::ops::Range;
use dynident_dynamics::{
    BatchWorkspace, Column, PanelLayout, Panels, TermHistory, regressor_panels_following, term_panels_following,
};
use dynident_model::terms::JointMotion;
use dynident_recording::MotionBlock;
use std::borrow::Cow;

/// Positions, velocities and accelerations of some samples of a block, joints in the order of the model.
pub fn in_model_order(block: &MotionBlock, places: &[usize], from: usize, samples: usize, motion: &mut [Vec<f64>; 3]) {
    for (to, source) in motion.iter_mut().zip([&block.q, &block.dq, &block.ddq]) {
        to.clear();
        for &place in places {
            to.extend_from_slice(&block.joint(source, place)[from..from + samples]);
        }
    }
}

/// Computes the panels of a motion, [`PANEL_SAMPLES`] samples at a time.
#[derive(Debug)]
pub(super) struct PanelMaker<'a> {
    model: &'a RegressorModel,
    layout: Cow<'a, PanelLayout>,
    /// Whether the columns of bodies are computed; some passes use only terms that do not need them.
    has_bodies: bool,
    places: Vec<usize>,
    workspace: BatchWorkspace,
    history: TermHistory,
    temperature_c: Vec<f64>,
    segment: usize,
    motion: [Vec<f64>; 3],
    velocities: Vec<VelocityHistogram>,
    samples: u64,
}

/// Panels of all joints, with the logged torque.
#[derive(Debug, Default)]
pub(super) struct SamplePanels {
    panels: Panels,
    motion: [Vec<f64>; 3],
    segment: usize,
    rate_hz: f64,
    first_time_s: f64,
    set_aside: Vec<Vec<bool>>,
    settled: Range<usize>,
}

impl SamplePanels {
    /// Unfiltered samples, for a filter that uses `reach` samples on each side of a row.
    pub(super) fn as_raw(&self, reach: usize) -> RawSamples<'_> {
        RawSamples {
            segment: self.segment,
            rate_hz: self.rate_hz,
            first_time_s: self.first_time_s,
            reach,
            panels: &self.panels,
            motion: &self.motion,
            set_aside: &self.set_aside,
            settled: self.settled.clone(),
        }
    }
}

impl<'a> PanelMaker<'a> {
    /// Computes all columns of a model; joint `j` has index `places[j]` in the motion.
    pub(super) fn new(model: &'a RegressorModel, places: &[usize]) -> Self {
        let (layout, load) = (Cow::Borrowed(model.layout()), model.load_parameters.clone());
        Self::of_layout(model, layout, true, load, places)
    }

    /// Computes only some `terms` of the model, after the columns of the bodies if a term depends on the load.
    pub(super) fn of_terms(model: &'a RegressorModel, terms: &[Column], places: &[usize]) -> Self {
        let needs_load = terms.iter().any(|column| matches!(column, Column::Term(term) if term.needs_load()));
        let known = model.layout().columns();
        let bodies = known.iter().filter(|column| needs_load && matches!(column, Column::Body { .. }));
        let columns: Vec<Column> = bodies.chain(terms).cloned().collect();
        let load = model.load_parameters.as_ref().filter(|_| needs_load).map(|parameters| {
            // One value per column; values of terms are not used.
            let of_column =
                |column: &Column| known.iter().position(|known| known == column).map_or(0.0, |place| parameters[place]);
            columns.iter().map(of_column).collect()
        });
        let layout = PanelLayout::new(model.model(), columns);
        Self::of_layout(model, Cow::Owned(layout), needs_load, load, places)
    }

    fn of_layout(
        model: &'a RegressorModel,
        layout: Cow<'a, PanelLayout>,
        has_bodies: bool,
        load: Option<Vec<f64>>,
        places: &[usize],
    ) -> Self {
        Self {
            model,
            layout,
            has_bodies,
            places: places.to_vec(),
            workspace: BatchWorkspace::new(model.model()),
            history: TermHistory::new(load),
            temperature_c: Vec::new(),
            segment: 0,
            motion: [Vec::new(), Vec::new(), Vec::new()],
            velocities: vec![VelocityHistogram::default(); places.len()],
            samples: 0,
        }
    }

    pub(super) fn layout(&self) -> &PanelLayout {
        &self.layout
    }

    pub(super) fn places(&self) -> &[usize] {
        &self.places
    }

    pub(super) fn samples(&self) -> u64 {
        self.samples
    }

    pub(super) fn into_velocities(self) -> Vec<VelocityHistogram> {
        self.velocities
    }

    /// Computes one panel, which begins at sample `from` of the block; returns the first sample of the next panel.
    pub(super) fn make(&mut self, block: &MotionBlock, from: usize, out: &mut SamplePanels) -> usize {
        if block.segment != self.segment {
            self.segment = block.segment;
            self.history.restart();
        }
        let samples = PANEL_SAMPLES.min(block.rows - from);
        in_model_order(block, &self.places, from, samples, &mut self.motion);
        let [q, dq, ddq] = &self.motion;
        let motion = JointMotion { samples, q, dq, ddq };
        let settled = settled(block, from, samples);
        for (velocities, dq) in self.velocities.iter_mut().zip(dq.chunks_exact(samples)) {
            velocities.add(&dq[settled.clone()]);
        }
        if !block.temperature_c.is_empty() {
            self.temperature_c.clear();
            for &place in &self.places {
                let temperature = block.joint(&block.temperature_c, place);
                self.temperature_c.extend_from_slice(&temperature[from..from + samples]);
            }
            self.history.set_temperature(&self.temperature_c);
        }
        let Self { workspace, layout, history, .. } = self;
        if self.has_bodies {
            regressor_panels_following(self.model.model(), workspace, layout, &motion, history, &mut out.panels);
        } else {
            term_panels_following(layout, &motion, history, &mut out.panels);
        }
        for (joint, &place) in self.places.iter().enumerate() {
            let torque = out.panels.torque_mut(joint);
            torque.copy_from_slice(&block.joint(block.fitted_tau(), place)[from..from + samples]);
            if let Some(gain) = self.model.torque_gains.get(joint) {
                for torque in torque {
                    *torque *= gain;
                }
            }
        }
        out.motion.clone_from(&self.motion);
        out.set_aside.clear();
        if !block.set_aside.is_empty() || settled.len() < samples {
            let of_joints = self.places.iter().map(|&place| set_aside(block, place, from, samples).into_owned());
            out.set_aside.extend(of_joints);
        }
        (out.segment, out.rate_hz, out.settled) = (block.segment, block.rate_hz, settled);
        out.first_time_s = block.first_time_s + from as f64 / block.rate_hz;
        self.samples += samples as u64;
        from + samples
    }
}
