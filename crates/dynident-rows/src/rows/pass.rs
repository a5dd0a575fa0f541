//! Passes over one recording, which send its rows to a consumer.

use super::RowConsumer;
use super::builder::RowBuilder;
use super::collector::ForwardingCollector;
use super::declared::require_declared;
use super::filter::{ParallelFilterSettings, motion_band_hz};
use super::kept_log::{BlockCache, KeptLog, MAX_KEPT_VALUES};
use super::mask::RowMask;
use super::panel_pipeline::pipelined_panels;
use super::row_store::{PassStatistics, RowStore};
use super::samples::SamplePanels;
use super::velocities::VelocityHistogram;
use crate::progress::Progress;
use crate::recording::{LogError, MotionRecord, Recording, Samples};
use crate::regressor_model::RegressorModel;
use core::borrow::Borrow;
use dynident_dynamics::Column;
use dynident_recording::{DecimationSettings, Finding, ImportReport, Level, MotionBlock, MotionSettings, MotionStream};
use std::sync::OnceLock;

/// Properties of a recording after a pass.
#[derive(Clone, Debug)]
pub struct LogStatistics {
    /// Report of the importer; `None` for a prepared motion.
    pub report: Option<ImportReport>,
    /// Cut-off of the differentiator in use, hertz.
    pub motion_cutoff_hz: Option<f64>,
    /// Rate of the filtered rows, hertz.
    pub filtered_rate_hz: f64,
    /// Half-gain frequency of the parallel filter, hertz; `None` without a filter.
    pub filter_cutoff_hz: Option<f64>,
    /// Number of filtered rows of each joint.
    pub filtered_rows: u64,
    /// Velocity histogram of each joint of the model.
    pub velocities: Vec<VelocityHistogram>,
}

/// Inputs of a pass over one recording, except the receiver of its rows.
#[derive(Clone, Copy)]
pub struct LogPass<'a> {
    /// Recording to read.
    pub recording: &'a Recording,
    /// Model that defines the rows.
    pub model: &'a RegressorModel,
    /// Motion settings with the cut-off that all logs share.
    pub motion: &'a MotionSettings,
    /// Parallel filter.
    pub filter: &'a ParallelFilterSettings,
    /// Cut-off from which the parallel filter is derived, hertz; `None` for the cut-off of the motion.
    pub torque_hz: Option<f64>,
    /// Whether a second thread reads the log, and whether stored rows are sent to the joints' consumers in parallel.
    pub reader_thread: bool,
    /// Approximate number of samples after which the pass ends; `None` for all samples.
    pub most_samples: Option<u64>,
    /// Receives the number of samples read.
    pub progress: &'a dyn Progress,
    /// Memory for the motion of the log, for later passes if it fits.
    pub kept: Option<&'a OnceLock<KeptLog>>,
}

impl core::fmt::Debug for LogPass<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("LogPass").field("recording", &self.recording.name).finish_non_exhaustive()
    }
}

enum Motion<'a> {
    Kept(&'a KeptLog),
    Stream(Box<MotionStream>),
    Record(&'a MotionRecord),
}

impl Motion<'_> {
    fn rate_hz(&self) -> f64 {
        match self {
            Self::Kept(kept) => kept.rate_hz,
            Self::Stream(stream) => stream.rate_hz(),
            Self::Record(record) => record.motion.rate_hz,
        }
    }
}

impl LogPass<'_> {
    /// Reads the recording and sends its filtered rows to `consumer`.
    ///
    /// # Errors
    /// The recording cannot be read, lacks a temperature that friction needs, leaves the domain of a declared torque,
    /// or has no rows after the filter. Errors of the consumer.
    pub fn run(&self, consumer: &mut dyn RowConsumer) -> Result<LogStatistics, LogError> {
        let Recording { name, samples, .. } = self.recording;
        if let Some(joint) = self.model.joint_that_needs_temperature().filter(|_| !self.recording.has_temperature()) {
            let joint = self.model.model().joints()[joint].name.clone();
            return Err(LogError::NoTemperature { log: name.clone(), joint });
        }
        let places = self.recording.joint_indices(self.model.model())?;
        let set;
        let mut motion = match (samples, self.kept.and_then(OnceLock::get)) {
            (Samples::Motion(record), _) => {
                set = record.as_set(self.motion);
                Motion::Record(&set)
            }
            (_, Some(kept)) => Motion::Kept(kept),
            _ => match self.recording.open(self.model.model(), self.motion)? {
                Some(stream) if self.reader_thread => Motion::Stream(Box::new(stream.read_beside())),
                Some(stream) => Motion::Stream(Box::new(stream)),
                None => return Err(LogError::NoSamples { log: name.clone() }),
            },
        };
        let rate_hz = motion.rate_hz();
        let filter = self.filter.decimation(rate_hz, self.torque_hz.or_else(|| motion_band_hz(self.motion)));
        if let (Motion::Kept(kept), Some(filter)) = (&motion, &filter)
            && self.may_keep_rows(filter, consumer)
            && RowStore::has_room(self.model, filter, kept.samples())
        {
            return self.kept_rows(kept, filter, &places, consumer);
        }
        let in_filter = |source| LogError::Filter { log: name.clone(), source };
        let mut builder = RowBuilder::new(self.model, &places, rate_hz, filter.as_ref()).map_err(in_filter)?;
        let factor = filter.as_ref().map_or(1, |settings| settings.factor);
        let mut made = None;
        if let Motion::Record(record) = &motion {
            let reach = builder.reach();
            builder = builder.with_mask(RowMask::of(record, reach, factor));
        }
        let mut report = None;
        match &mut motion {
            Motion::Record(record) => self.take(&record.motion, &mut builder, consumer)?,
            Motion::Kept(kept) => {
                self.take_all(&kept.blocks, &mut builder, consumer)?;
                report = Some(kept.report.clone());
            }
            Motion::Stream(stream) => {
                let keeps = self.kept.is_some() && filter.as_ref().is_some_and(|one| self.may_keep_rows(one, consumer));
                let blocks = if keeps {
                    let mut keeping = ForwardingCollector::new(consumer, self.model.dof());
                    let blocks = self.stream(stream, &mut builder, &mut keeping)?;
                    made = keeping.rows;
                    blocks
                } else {
                    self.stream(stream, &mut builder, consumer)?
                };
                report = Some(stream.report());
                if let (Some(kept), Some(blocks)) = (self.kept, blocks) {
                    // Another thread may have stored the same motion in the meantime.
                    let _ = kept.set(KeptLog::new(blocks, rate_hz, stream.report()));
                }
            }
        }
        let (rows, needed) = (builder.filtered_rows(), builder.needed());
        let passed = PassStatistics::from(builder);
        if let (Some(made), Some(kept), Some(filter)) = (made, self.kept.and_then(OnceLock::get), &filter) {
            kept.rows.keep(self.model, filter, made, passed.clone());
        }
        self.statistics(report, rate_hz, filter.as_ref(), rows, needed, passed)
    }

    fn statistics(
        &self,
        report: Option<ImportReport>,
        rate_hz: f64,
        filter: Option<&DecimationSettings>,
        filtered_rows: u64,
        needed: usize,
        passed: PassStatistics,
    ) -> Result<LogStatistics, LogError> {
        if filtered_rows == 0 {
            let log = self.recording.name.clone();
            // Jumps of a position lower the cut-off, so that the filter needs more samples.
            let mut findings = report.iter().flat_map(|report| &report.findings);
            let problem = findings.find(|finding| finding.level == Level::Problem);
            let cause = problem.map_or_else(String::new, |Finding { channel, message, .. }| {
                format!("; first correct this problem of the log: {channel}: {message}")
            });
            return Err(LogError::NothingLeft { log, rows: passed.samples, needed, cause });
        }
        let filtered_rate_hz = rate_hz / filter.map_or(1, |settings| settings.factor) as f64;
        Ok(LogStatistics {
            report,
            motion_cutoff_hz: self.motion.differentiator.cutoff_hz(),
            filtered_rate_hz,
            filter_cutoff_hz: filter.map(|settings| settings.cutoff_hz.unwrap_or(0.4 * filtered_rate_hz)),
            filtered_rows,
            velocities: passed.velocities,
        })
    }

    /// Whether this pass can use filtered rows of earlier passes, and store its own rows.
    fn may_keep_rows(&self, filter: &DecimationSettings, consumer: &dyn RowConsumer) -> bool {
        !consumer.reads_samples()
            && self.most_samples.is_none()
            && self.model.torque_gains.is_empty()
            && filter.factor > 1
    }

    /// Sends the rows of a log in memory to `consumer`. Only columns that are not stored yet are filtered.
    fn kept_rows(
        &self,
        kept: &KeptLog,
        filter: &DecimationSettings,
        places: &[usize],
        consumer: &mut dyn RowConsumer,
    ) -> Result<LogStatistics, LogError> {
        let name = &self.recording.name;
        let in_filter = |source| LogError::Filter { log: name.clone(), source };
        let mut needed = 0;
        let mut made = 0;
        let mut pass = |terms: Option<&[Column]>, consumer: &mut dyn RowConsumer| -> Result<PassStatistics, LogError> {
            let mut builder = match terms {
                None => RowBuilder::new(self.model, places, kept.rate_hz, Some(filter)),
                Some(terms) => RowBuilder::of_terms(self.model, terms, places, kept.rate_hz, Some(filter)),
            }
            .map_err(in_filter)?;
            self.take_all(&kept.blocks, &mut builder, consumer)?;
            (needed, made) = (builder.needed(), builder.samples());
            Ok(builder.into())
        };
        let rows = kept.rows.rows(self.model, filter, &mut pass)?;
        self.progress.advance(rows.samples() - made);
        rows.give(self.model, consumer, self.reader_thread)?;
        let passed = PassStatistics { samples: rows.samples(), velocities: rows.velocities().to_vec() };
        self.statistics(Some(kept.report.clone()), kept.rate_hz, Some(filter), rows.count(), needed, passed)
    }

    /// Passes the motion to `take` block by block, without computing the regressor, until the end or until
    /// `most_samples`. Uses the motion in memory, if there is one; otherwise reads the log and stores its motion if it
    /// fits. Returns the importer's report; `None` for a prepared motion.
    ///
    /// # Errors
    /// A log that cannot be read, and errors of `take`.
    pub fn each_block(
        &self,
        take: &mut dyn FnMut(&MotionBlock) -> Result<(), LogError>,
    ) -> Result<Option<ImportReport>, LogError> {
        let Recording { name, samples, .. } = self.recording;
        let mut passed = 0;
        let mut is_enough = |block: &MotionBlock| {
            passed += block.rows as u64;
            self.most_samples.is_some_and(|most| passed >= most)
        };
        match (samples, self.kept.and_then(OnceLock::get)) {
            (Samples::Motion(record), _) => take(&record.as_set(self.motion).motion).map(|()| None),
            (_, Some(kept)) => {
                for block in &kept.blocks {
                    take(block)?;
                    if is_enough(block) {
                        break;
                    }
                }
                Ok(Some(kept.report.clone()))
            }
            _ => {
                let stream = self.recording.open(self.model.model(), self.motion)?;
                let mut stream = stream.ok_or_else(|| LogError::NoSamples { log: name.clone() })?;
                if self.reader_thread && self.most_samples.is_none() {
                    stream = stream.read_beside();
                }
                let mut keeper = self.block_cache();
                let mut block = MotionBlock::default();
                while stream.next_block(&mut block).map_err(|source| LogError::recording(name, source))? {
                    take(&block)?;
                    self.progress.advance(block.rows as u64);
                    if is_enough(&block) {
                        break;
                    }
                    block = keeper.keep(block).unwrap_or_default();
                }
                let report = stream.report();
                if let (Some(kept), Some(blocks)) = (self.kept, keeper.blocks) {
                    let _ = kept.set(KeptLog::new(blocks, stream.rate_hz(), report.clone()));
                }
                Ok(Some(report))
            }
        }
    }

    /// Selects about `samples` samples of the motion, in pieces of at most `piece` samples with a separate segment
    /// number each. If the motion is in memory, the pieces are spread over the log; otherwise they are from its
    /// beginning. Empty for a prepared motion. The second value is the number of samples from which the pieces were
    /// selected.
    ///
    /// # Errors
    /// A log that cannot be read.
    pub fn some_pieces(&self, samples: usize, piece: usize) -> Result<(Vec<MotionBlock>, usize), LogError> {
        let piece = piece.max(1);
        let of = |blocks: &[MotionBlock]| {
            let mut pieces = Vec::new();
            for block in blocks {
                let count = block.rows.div_ceil(piece).max(1);
                let cut = |k: usize| (block, k * block.rows / count..(k + 1) * block.rows / count);
                pieces.extend((0..count).map(cut));
            }
            let wanted = samples.div_ceil(piece).clamp(1, pieces.len().max(1));
            let chosen = (0..wanted).filter_map(|k| pieces.get((2 * k + 1) * pieces.len() / (2 * wanted)));
            let cut = chosen.enumerate().map(|(k, (block, run))| MotionBlock { segment: k, ..block.part(run.clone()) });
            cut.collect::<Vec<_>>()
        };
        let rows = |blocks: &[MotionBlock]| blocks.iter().map(|block| block.rows).sum();
        let Recording { name, samples: source, .. } = self.recording;
        match (source, self.kept.and_then(OnceLock::get)) {
            (Samples::Motion(_), _) => Ok((Vec::new(), 0)),
            (_, Some(kept)) => Ok((of(&kept.blocks), rows(&kept.blocks))),
            _ => {
                let stream = self.recording.open(self.model.model(), self.motion)?;
                let mut stream = stream.ok_or_else(|| LogError::NoSamples { log: name.clone() })?;
                let mut blocks = Vec::new();
                while rows(&blocks) < samples {
                    let mut block = MotionBlock::default();
                    if !stream.next_block(&mut block).map_err(|source| LogError::recording(name, source))? {
                        break;
                    }
                    blocks.push(block);
                }
                Ok((of(&blocks), rows(&blocks)))
            }
        }
    }

    fn take(
        &self,
        block: &MotionBlock,
        builder: &mut RowBuilder<'_>,
        consumer: &mut dyn RowConsumer,
    ) -> Result<(), LogError> {
        require_declared(self.model, &self.recording.name, block, builder.places())?;
        builder.take(block, consumer)?;
        self.progress.advance(block.rows as u64);
        Ok(())
    }

    fn take_all(
        &self,
        blocks: &[MotionBlock],
        builder: &mut RowBuilder<'_>,
        consumer: &mut dyn RowConsumer,
    ) -> Result<(), LogError> {
        if self.reader_thread && self.most_samples.is_none() {
            let mut blocks = blocks.iter();
            return self.beside(builder, consumer, move |_| Ok(blocks.next()), |_| None);
        }
        for block in blocks {
            if self.is_enough(builder) {
                break;
            }
            self.take(block, builder, consumer)?;
        }
        Ok(())
    }

    /// Sends the rows of blocks to `consumer`. A second thread reads the blocks and computes their panels.
    fn beside<B: Borrow<MotionBlock> + Send>(
        &self,
        builder: &mut RowBuilder<'_>,
        consumer: &mut dyn RowConsumer,
        next: impl FnMut(Option<B>) -> Result<Option<B>, LogError> + Send,
        mut keep: impl FnMut(B) -> Option<B>,
    ) -> Result<(), LogError> {
        let (maker, filter) = builder.halves();
        let make = |block: &MotionBlock, from: usize, panels: &mut SamplePanels| {
            if from == 0 {
                require_declared(self.model, &self.recording.name, block, maker.places())?;
            }
            Ok(maker.make(block, from, panels))
        };
        let filter = |panels: &SamplePanels| filter.take(panels, consumer);
        pipelined_panels(next, make, filter, |block| {
            self.progress.advance(block.borrow().rows as u64);
            keep(block)
        })
    }

    fn is_enough(&self, builder: &RowBuilder<'_>) -> bool {
        self.most_samples.is_some_and(|most| builder.samples() >= most)
    }

    /// Cache for the blocks of a log, if the log is read completely and will probably fit.
    fn block_cache(&self) -> BlockCache {
        let rows = self.recording.estimated_rows().unwrap_or(0) as usize;
        let seems_to_fit = rows.saturating_mul(4 * self.model.dof()) <= MAX_KEPT_VALUES;
        let keeps = self.kept.is_some() && self.most_samples.is_none() && seems_to_fit;
        BlockCache::new(keeps)
    }

    /// Reads a log to its end or until `most_samples`; returns its blocks if it was read completely and they fit.
    fn stream(
        &self,
        stream: &mut MotionStream,
        builder: &mut RowBuilder<'_>,
        consumer: &mut dyn RowConsumer,
    ) -> Result<Option<Vec<MotionBlock>>, LogError> {
        let name = &self.recording.name;
        let mut keeper = self.block_cache();
        if self.reader_thread && self.most_samples.is_none() {
            let next = |block: Option<MotionBlock>| {
                let mut block = block.unwrap_or_default();
                let is_block = stream.next_block(&mut block).map_err(|source| LogError::recording(name, source))?;
                Ok(is_block.then_some(block))
            };
            self.beside(builder, consumer, next, |block| keeper.keep(block))?;
        } else {
            let mut block = MotionBlock::default();
            while !self.is_enough(builder)
                && stream.next_block(&mut block).map_err(|source| LogError::recording(name, source))?
            {
                self.take(&block, builder, consumer)?;
                block = keeper.keep(block).unwrap_or_default();
            }
        }
        Ok(keeper.blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_log::TestLog;
    use super::*;
    use dynident_dynamics::ParametricModel;

    #[test]
    fn a_pass_over_blocks_ends_after_most_samples() {
        let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
        let model = dynident_model::load_robot(robot).unwrap().model;
        let model = RegressorModel::from(ParametricModel::new(model, Vec::new()).unwrap());
        let log = TestLog::new(&model.joint_names());
        let blocks_of = |most_samples: Option<u64>| {
            let mut blocks = Vec::new();
            let pass = LogPass { most_samples, ..log.pass(&model) };
            pass.each_block(&mut |block| {
                blocks.push(block.rows);
                Ok(())
            })
            .unwrap();
            blocks
        };
        let some = blocks_of(Some(5_000));
        assert!(log.kept.get().is_none(), "a part of a log is not kept for the whole");
        let all = blocks_of(None);
        assert!(log.kept.get().is_some() && all.iter().sum::<usize>() > 18_000 && some.len() < all.len());
        assert_eq!(some, all[..some.len()]);
        let passed: usize = some.iter().sum();
        assert!(passed >= 5_000 && passed - some[some.len() - 1] < 5_000, "{some:?}");
        assert_eq!(blocks_of(Some(5_000)), some, "of what is kept the same part");
    }
}
