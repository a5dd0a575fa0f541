//! Storage of filtered rows for later passes.
//!
//! Passes over the same motion differ in few columns: friction with other constants, candidate terms, friction terms
//! for another load. All other columns are identical, so they are stored, and a pass filters only the missing columns.
//! The results are bit-identical to results without storage.

use super::builder::RowBuilder;
use super::collector::{CollectedJoint, Collector, MAX_STORED_VALUES};
use super::velocities::VelocityHistogram;
use super::{JointRows, RowConsumer};
use crate::recording::LogError;
use crate::regressor_model::RegressorModel;
use dynident_dynamics::Column;
use dynident_model::Model;
use dynident_recording::DecimationSettings;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

type Filtered = Arc<Vec<f64>>;

/// Filters the columns of a model, or only some of its terms, and sends the rows to a consumer.
pub(super) type FilterPass<'p> =
    dyn FnMut(Option<&[Column]>, &mut dyn RowConsumer) -> Result<PassStatistics, LogError> + 'p;

/// Filtered rows of one log, one entry for each filter.
#[derive(Debug, Default)]
pub(super) struct RowStore(Mutex<Vec<Arc<FilteredRows>>>);

/// Rows of one log after one filter, valid for any model with the same bodies.
#[derive(Clone, Debug)]
pub(super) struct FilteredRows {
    filter: DecimationSettings,
    model: Model,
    /// Number of rows per panel of samples, as sent to a consumer.
    pieces: Vec<usize>,
    joints: Vec<FilteredJoint>,
    samples: u64,
    velocities: Vec<VelocityHistogram>,
}

#[derive(Clone, Debug, Default)]
struct FilteredJoint {
    columns: Vec<(Column, Filtered)>,
    torque: Filtered,
    /// Share of the filter's weight on valid samples, for each row; 1 if all samples are valid.
    coverage: Filtered,
}

impl RowStore {
    /// Whether the filtered rows of `samples` samples fit into memory.
    pub(super) fn has_room(model: &RegressorModel, filter: &DecimationSettings, samples: usize) -> bool {
        let columns: usize = (0..model.dof()).map(|joint| model.layout().joint_columns(joint).len() + 2).sum();
        samples / filter.factor * columns <= MAX_STORED_VALUES
    }

    /// Rows of `model` after `filter`. Missing columns are computed with `pass`.
    pub(super) fn rows(
        &self,
        model: &RegressorModel,
        filter: &DecimationSettings,
        pass: &mut FilterPass<'_>,
    ) -> Result<Arc<FilteredRows>, LogError> {
        let kept = self.lock().iter().find(|kept| kept.is_of(model.model(), filter)).cloned();
        let missing = kept.as_ref().and_then(|kept| kept.missing_terms(model));
        let rows = match (kept, missing) {
            (Some(kept), Some(missing)) if missing.is_empty() => return Ok(kept),
            (Some(kept), Some(missing)) => {
                let mut made = Collector::new(model.dof());
                pass(Some(&missing), &mut made)?;
                kept.with_terms(&missing, made)
            }
            _ => {
                let mut made = Collector::new(model.dof());
                let passed = pass(None, &mut made)?;
                FilteredRows::new(model, filter, made, passed)
            }
        };
        self.put(rows.without_rarely_used(model));
        Ok(Arc::new(rows))
    }

    pub(super) fn keep(
        &self,
        model: &RegressorModel,
        filter: &DecimationSettings,
        made: Collector,
        passed: PassStatistics,
    ) {
        self.put(FilteredRows::new(model, filter, made, passed).without_rarely_used(model));
    }

    /// Replaces the rows of the same filter. If there is no room, drops the oldest rows of other filters.
    fn put(&self, rows: FilteredRows) {
        let mut all = self.lock();
        all.retain(|kept| !kept.is_of(&rows.model, &rows.filter));
        all.push(Arc::new(rows));
        while all.len() > 1 && all.iter().map(|kept| kept.numbers()).sum::<usize>() > MAX_STORED_VALUES {
            all.remove(0);
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Arc<FilteredRows>>> {
        // The stored rows are valid even if another thread panicked.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Clone)]
pub(super) struct PassStatistics {
    pub(super) samples: u64,
    pub(super) velocities: Vec<VelocityHistogram>,
}

impl From<RowBuilder<'_>> for PassStatistics {
    fn from(builder: RowBuilder<'_>) -> Self {
        Self { samples: builder.samples(), velocities: builder.into_velocities() }
    }
}

impl FilteredRows {
    fn new(model: &RegressorModel, filter: &DecimationSettings, made: Collector, passed: PassStatistics) -> Self {
        let layout = model.layout();
        let of_joint = |(joint, made): (usize, CollectedJoint)| {
            let columns = layout.joint_columns(joint).iter().map(|&column| layout.columns()[column].clone());
            let (mut values, coverage) = (made.columns, Arc::new(made.coverage));
            let torque = Arc::new(values.pop().unwrap_or_default());
            FilteredJoint { columns: columns.zip(values.into_iter().map(Arc::new)).collect(), torque, coverage }
        };
        Self {
            filter: filter.clone(),
            model: model.model().clone(),
            pieces: made.pieces,
            joints: made.joints.into_iter().enumerate().map(of_joint).collect(),
            samples: passed.samples,
            velocities: passed.velocities,
        }
    }

    fn is_of(&self, model: &Model, filter: &DecimationSettings) -> bool {
        self.filter == *filter && self.model == *model
    }

    /// Terms of the model whose columns are not stored, in order; `None` if columns of a body are missing.
    fn missing_terms(&self, model: &RegressorModel) -> Option<Vec<Column>> {
        let layout = model.layout();
        let mut missing = vec![false; layout.columns().len()];
        for (joint, kept) in self.joints.iter().enumerate() {
            for &column in layout.joint_columns(joint) {
                missing[column] |= kept.values(&layout.columns()[column]).is_none();
            }
        }
        let missing = layout.columns().iter().zip(missing).filter(|(_, missing)| *missing);
        let missing: Vec<Column> = missing.map(|(column, _)| column.clone()).collect();
        missing.iter().all(|column| matches!(column, Column::Term(_))).then_some(missing)
    }

    /// Adds the columns of these terms, in the order of the collector.
    fn with_terms(&self, terms: &[Column], made: Collector) -> Self {
        let mut all = self.clone();
        for (joint, (kept, made)) in all.joints.iter_mut().zip(made.joints).enumerate() {
            let feels = |column: &&Column| matches!(column, Column::Term(term) if term.joints().contains(&joint));
            let own = terms.iter().filter(feels).cloned();
            kept.columns.extend(own.zip(made.columns.into_iter().map(Arc::new)));
        }
        all
    }

    /// Drops columns of load-dependent friction, because the load changes with every fit. If the rest does not fit,
    /// also drops columns that this model does not use.
    fn without_rarely_used(&self, model: &RegressorModel) -> Self {
        let layout = model.layout();
        let mut without_rarely_used = self.clone();
        for kept in &mut without_rarely_used.joints {
            kept.columns.retain(|(column, _)| !matches!(column, Column::Term(term) if term.needs_load()));
        }
        if without_rarely_used.numbers() > MAX_STORED_VALUES {
            for kept in &mut without_rarely_used.joints {
                kept.columns.retain(|(column, _)| layout.columns().contains(column));
            }
        }
        without_rarely_used
    }

    fn numbers(&self) -> usize {
        let rows: usize = self.pieces.iter().sum();
        rows * self.joints.iter().map(|joint| joint.columns.len() + 2).sum::<usize>()
    }

    pub(super) fn count(&self) -> u64 {
        self.pieces.iter().sum::<usize>() as u64
    }

    pub(super) fn samples(&self) -> u64 {
        self.samples
    }

    pub(super) fn velocities(&self) -> &[VelocityHistogram] {
        &self.velocities
    }

    /// Sends the rows of the model to a consumer in the same pieces as a pass over samples. Joints are processed in
    /// parallel if `beside` is set and the consumer supports this.
    pub(super) fn give(
        &self,
        model: &RegressorModel,
        consumer: &mut dyn RowConsumer,
        beside: bool,
    ) -> Result<(), LogError> {
        let joints: Vec<JointPieces<'_>> =
            self.joints.iter().enumerate().map(|(joint, kept)| JointPieces::new(model, joint, kept)).collect();
        if let Some(consumers) = consumer.joints().filter(|_| beside) {
            return joints.par_iter().zip(consumers).try_for_each(|(joint, consumer)| {
                let (mut from, mut panel) = (0, Vec::new());
                for &rows in &self.pieces {
                    consumer.filtered(&joint.piece(from, rows, &mut panel))?;
                    from += rows;
                }
                Ok(())
            });
        }
        let (mut from, mut panel) = (0, Vec::new());
        for &rows in &self.pieces {
            for joint in &joints {
                consumer.filtered(&joint.piece(from, rows, &mut panel))?;
            }
            from += rows;
        }
        Ok(())
    }
}

/// Columns of a joint in the order of a model; the torque is the last column.
struct JointPieces<'k> {
    joint: usize,
    columns: Vec<&'k [f64]>,
    coverage: &'k [f64],
}

impl<'k> JointPieces<'k> {
    fn new(model: &RegressorModel, joint: usize, kept: &'k FilteredJoint) -> Self {
        let layout = model.layout();
        let found = layout.joint_columns(joint).iter().filter_map(|&column| kept.values(&layout.columns()[column]));
        let columns = found.chain([&kept.torque]).map(|values| values.as_slice()).collect();
        Self { joint, columns, coverage: &kept.coverage }
    }

    fn piece<'p>(&'p self, from: usize, rows: usize, panel: &'p mut Vec<f64>) -> JointRows<'p> {
        panel.clear();
        for column in &self.columns {
            panel.extend_from_slice(&column[from..from + rows]);
        }
        let coverage = &self.coverage[from..from + rows];
        let coverage = if coverage.iter().all(|share| *share == 1.0) { &[] } else { coverage };
        JointRows { joint: self.joint, rows, panel, coverage }
    }
}

impl FilteredJoint {
    fn values(&self, wanted: &Column) -> Option<&Filtered> {
        self.columns.iter().find(|(column, _)| column == wanted).map(|(_, values)| values)
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_log::TestLog;
    use super::super::{LogPass, LogStatistics, RawSamples};
    use super::*;
    use dynident_dynamics::ParametricModel;
    use dynident_model::terms::{
        Coulomb, CoulombShape, DriveChoice, LoadFriction, MaxwellSlip, Stribeck, TorqueTerm, terms_per_joint,
    };

    /// Bits of all rows. A consumer that reads samples makes the pass compute every column.
    #[derive(Default)]
    struct Bits {
        rows: Vec<(usize, usize, Vec<u64>, Vec<u64>)>,
        samples: usize,
        reads_samples: bool,
    }

    impl RowConsumer for Bits {
        fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            // An empty coverage is equivalent to ones.
            let covered = if rows.coverage.is_empty() { &vec![1.0; rows.rows][..] } else { rows.coverage };
            self.rows.push((rows.joint, rows.rows, bits(rows.panel), bits(covered)));
            Ok(())
        }

        fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), LogError> {
            self.samples += samples.panels.samples();
            Ok(())
        }

        fn reads_samples(&self) -> bool {
            self.reads_samples
        }
    }

    struct ByJoint(Vec<Bits>);

    impl RowConsumer for ByJoint {
        fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
            self.0[rows.joint].filtered(rows)
        }

        fn reads_samples(&self) -> bool {
            false
        }

        fn joints(&mut self) -> Option<Vec<&mut (dyn RowConsumer + Send)>> {
            Some(self.0.iter_mut().map(|joint| joint as &mut (dyn RowConsumer + Send)).collect())
        }
    }

    #[test]
    fn stored_rows_are_bit_identical_to_filtered_samples() {
        let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
        let model = dynident_model::load_robot(robot).unwrap().model;
        let smooth = CoulombShape::Smooth { width: 0.02 };
        let choice = DriveChoice { viscous: true, coulomb: Some(smooth), offset: true, ..DriveChoice::default() };
        let plain =
            RegressorModel::from(ParametricModel::new(model.clone(), terms_per_joint(&model, |_| choice)).unwrap());
        let coulomb = |width: f64| {
            (0..6).map(move |joint| TorqueTerm::Coulomb(Coulomb { joint, shape: CoulombShape::Smooth { width } }))
        };
        let stribeck = |joint| TorqueTerm::Stribeck(Stribeck { joint, speed: 0.1, exponent: 2.0, shape: smooth });
        let slip = |joint| TorqueTerm::MaxwellSlip(MaxwellSlip { joint, yield_displacement: 0.01 });
        let load = |joint| TorqueTerm::Load(LoadFriction { joint, shape: smooth });
        let loaded = |values: f64| {
            let wide = plain.with_further_columns([2, 4].map(load).into_iter().chain([slip(1)]));
            let of_bodies: Vec<f64> = (0..plain.layout().columns().len()).map(|k| values + 0.1 * k as f64).collect();
            wide.with_load_of(&plain, &of_bodies)
        };
        // In sequence: storage grows, loads change, and columns recur.
        let models = [
            plain.clone(),
            plain.with_further_columns(coulomb(0.05).chain([stribeck(0), slip(3)])),
            loaded(1.0),
            loaded(-2.0),
            plain.with_further_columns([slip(3)].into_iter().chain(coulomb(0.07))),
            plain.with_further_columns([2, 4].map(load)),
            plain.clone(),
        ];

        let log = TestLog::new(&plain.joint_names());
        let pass = |model: &RegressorModel, reader_thread: bool, consumer: &mut dyn RowConsumer| -> LogStatistics {
            LogPass { reader_thread, ..log.pass(model) }.run(consumer).unwrap()
        };
        for (number, model) in models.iter().enumerate() {
            for threads in [false, true] {
                let (mut found, mut plain) = (Bits::default(), Bits { reads_samples: true, ..Bits::default() });
                let of_kept = pass(model, threads, &mut found);
                let of_samples = pass(model, threads, &mut plain);
                assert!(plain.samples > 18_000 && !plain.rows.is_empty());
                assert!(plain.rows.iter().any(|rows| rows.3.iter().any(|share| *share != 1.0_f64.to_bits())));
                assert_eq!(found.samples, 0, "rows come without their samples");
                assert!(found.rows == plain.rows, "model {number}, threads {threads}");
                assert_eq!(of_kept.filtered_rows, of_samples.filtered_rows);
                assert_eq!(of_kept.velocities, of_samples.velocities);

                let mut side_by_side = ByJoint((0..6).map(|_| Bits::default()).collect());
                pass(model, threads, &mut side_by_side);
                for (joint, own) in side_by_side.0.iter().enumerate() {
                    assert!(own.rows.iter().eq(plain.rows.iter().filter(|rows| rows.0 == joint)), "joint {joint}");
                }
            }
        }
        assert!(
            log.kept.get().unwrap().rows.lock().iter().map(|rows| rows.numbers()).sum::<usize>() <= MAX_STORED_VALUES
        );
    }
}
