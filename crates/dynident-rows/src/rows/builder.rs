//! Rows of regressor and torque from blocks of a motion.

use super::RowConsumer;
use super::joint_filters::JointFilters;
use super::mask::RowMask;
use super::samples::{PanelMaker, SamplePanels};
use super::velocities::VelocityHistogram;
use crate::recording::LogError;
use crate::regressor_model::RegressorModel;
use dynident_dynamics::Column;
use dynident_recording::{DecimationSettings, FilterError, MotionBlock};

/// Converts blocks of a motion into filtered rows of regressor and torque.
#[derive(Debug)]
pub struct RowBuilder<'a> {
    maker: PanelMaker<'a>,
    filter: PanelFilter<'a>,
    panels: SamplePanels,
}

#[derive(Debug)]
pub(super) struct PanelFilter<'a> {
    /// For each joint the number of leading columns that are not filtered: columns of bodies that are only used to
    /// compute the load of load-dependent friction.
    unfiltered: Vec<usize>,
    filters: JointFilters,
    mask: Option<RowMask<'a>>,
    segment: usize,
    filtered_rows: u64,
}

impl<'a> RowBuilder<'a> {
    /// Creates a builder for samples at `rate_hz`; joint `j` of the model has index `places[j]` in the motion.
    ///
    /// # Errors
    /// The filter is impossible at this rate.
    pub fn new(
        model: &'a RegressorModel,
        places: &[usize],
        rate_hz: f64,
        filter: Option<&DecimationSettings>,
    ) -> Result<Self, FilterError> {
        Self::of(PanelMaker::new(model, places), vec![0; model.dof()], rate_hz, filter)
    }

    /// Creates a builder for only some `terms` of the model. A row of a joint contains the terms that act on this
    /// joint, in order, and the torque.
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

    /// Adds a mask of rows of the regression; rows that it marks as invalid are not used.
    pub fn with_mask(mut self, mask: Option<RowMask<'a>>) -> Self {
        self.filter.mask = mask;
        self
    }

    /// Indices of the model's joints in the motion.
    pub fn places(&self) -> &[usize] {
        self.maker.places()
    }

    /// Number of samples before and after a filtered row that the filter uses.
    pub fn reach(&self) -> usize {
        self.filter.filters.reach()
    }

    /// Number of samples that the first filtered row needs.
    pub fn needed(&self) -> usize {
        self.filter.filters.needed()
    }

    /// Number of rows of each joint that left the filter so far, including rows that the mask excludes.
    pub fn filtered_rows(&self) -> u64 {
        self.filter.filtered_rows
    }

    /// Number of samples so far.
    pub fn samples(&self) -> u64 {
        self.maker.samples()
    }

    /// Velocity histograms of the joints.
    pub fn into_velocities(self) -> Vec<VelocityHistogram> {
        self.maker.into_velocities()
    }

    /// The two stages of the builder: samples to panels, and panels to filtered rows.
    pub(super) fn halves(&mut self) -> (&mut PanelMaker<'a>, &mut PanelFilter<'a>) {
        (&mut self.maker, &mut self.filter)
    }

    /// Processes the next samples.
    ///
    /// # Errors
    /// Errors of the consumer.
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
    pub(super) fn take(&mut self, samples: &SamplePanels, consumer: &mut dyn RowConsumer) -> Result<(), LogError> {
        let raw = samples.as_raw(self.filters.reach());
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
