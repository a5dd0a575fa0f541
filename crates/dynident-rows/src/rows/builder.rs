//! Blocks of a motion into rows of regressor and torque, filtered alike.

use super::RowConsumer;
use super::joint_filters::JointFilters;
use super::mask::RowMask;
use super::samples::{PanelMaker, SamplePanels};
use super::velocities::VelocityHistogram;
use crate::recording::LogError;
use crate::regressor_model::RegressorModel;
use dynident_dynamics::Column;
use dynident_recording::{DecimationSettings, FilterError, MotionBlock};

/// Turns blocks of a motion into rows of regressor and torque, filtered alike.
#[derive(Debug)]
pub struct RowBuilder<'a> {
    maker: PanelMaker<'a>,
    filter: PanelFilter<'a>,
    panels: SamplePanels,
}

/// Makes panels of samples into rows.
#[derive(Debug)]
pub(super) struct PanelFilter<'a> {
    /// Of every joint the first columns that are not made into rows: bodies that only tell the load.
    unfiltered: Vec<usize>,
    filters: JointFilters,
    mask: Option<RowMask<'a>>,
    segment: usize,
    filtered_rows: u64,
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
        Self::of(PanelMaker::new(model, places), vec![0; model.dof()], rate_hz, filter)
    }

    /// The same of nothing but some `terms` of the model: each joint's rows have those that it feels, in their order,
    /// and its torque.
    pub(super) fn of_terms(
        model: &'a RegressorModel,
        terms: &[Column],
        places: &[usize],
        rate_hz: f64,
        filter: Option<&DecimationSettings>,
    ) -> Result<Self, FilterError> {
        let maker = PanelMaker::of_terms(model, terms, places);
        let layout = maker.layout();
        let is_body = |&&column: &&usize| matches!(layout.columns()[column], Column::Body { .. });
        let bodies_of = |joint: usize| layout.joint_columns(joint).iter().filter(is_body).count();
        let unfiltered = (0..model.dof()).map(bodies_of).collect();
        Self::of(maker, unfiltered, rate_hz, filter)
    }

    fn of(
        maker: PanelMaker<'a>,
        unfiltered: Vec<usize>,
        rate_hz: f64,
        filter: Option<&DecimationSettings>,
    ) -> Result<Self, FilterError> {
        let layout = maker.layout();
        let of_joint = |(joint, unfiltered): (usize, &usize)| layout.joint_columns(joint).len() + 1 - unfiltered;
        let columns: Vec<usize> = unfiltered.iter().enumerate().map(of_joint).collect();
        let filters = JointFilters::new(&columns, rate_hz, filter)?;
        let filter = PanelFilter { unfiltered, filters, mask: None, segment: 0, filtered_rows: 0 };
        Ok(Self { maker, filter, panels: SamplePanels::default() })
    }

    /// The same that leaves out rows that do not count.
    pub fn with_mask(mut self, mask: Option<RowMask<'a>>) -> Self {
        self.filter.mask = mask;
        self
    }

    /// Where the model's joints stand in the motion.
    pub fn places(&self) -> &[usize] {
        self.maker.places()
    }

    /// Samples to either side of a filtered row that it is made from.
    pub fn reach(&self) -> usize {
        self.filter.filters.reach()
    }

    /// Samples that the first filtered row needs.
    pub fn needed(&self) -> usize {
        self.filter.filters.needed()
    }

    /// Filtered rows of each joint so far, whether they counted or not.
    pub fn filtered_rows(&self) -> u64 {
        self.filter.filtered_rows
    }

    /// Samples so far.
    pub fn samples(&self) -> u64 {
        self.maker.samples()
    }

    /// How often each joint moved at which velocity so far.
    pub fn into_velocities(self) -> Vec<VelocityHistogram> {
        self.maker.into_velocities()
    }

    /// What makes panels of samples, and what makes rows of panels.
    pub(super) fn halves(&mut self) -> (&mut PanelMaker<'a>, &mut PanelFilter<'a>) {
        (&mut self.maker, &mut self.filter)
    }

    /// Makes the rows of the next samples.
    ///
    /// # Errors
    /// What the consumer returns.
    pub fn take(&mut self, block: &MotionBlock, consumer: &mut dyn RowConsumer) -> Result<(), LogError> {
        let Self { maker, filter, panels } = self;
        let mut from = 0;
        while from < block.rows {
            from = maker.make(block, from, panels);
            filter.take(panels, consumer)?;
        }
        Ok(())
    }
}

impl PanelFilter<'_> {
    /// Makes the rows of the next panels.
    pub(super) fn take(&mut self, samples: &SamplePanels, consumer: &mut dyn RowConsumer) -> Result<(), LogError> {
        let raw = samples.as_raw();
        if raw.segment != self.segment {
            self.segment = raw.segment;
            self.filters.restart();
        }
        consumer.raw(&raw)?;
        let (samples, mut rows) = (raw.panels.samples(), 0);
        for (joint, unfiltered) in self.unfiltered.iter().enumerate() {
            let left_out = raw.set_aside.get(joint).map_or(&[][..], Vec::as_slice);
            let panel = &raw.panels.joint(joint)[unfiltered * samples..];
            let all = self.filters.push(joint, panel, samples, left_out);
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
        Ok(())
    }
}
