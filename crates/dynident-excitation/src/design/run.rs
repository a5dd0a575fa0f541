//! Data that all phases of a design share.

use super::assess::{Assessment, assess};
use super::interruption::Interruption;
use super::{DesignSettings, DesignTask, DesignWatch, grid};
use crate::criteria::Criterion;
use crate::optimisers::OptimiserError;

pub(super) struct DesignRun<'a> {
    pub(super) task: &'a DesignTask<'a>,
    pub(super) settings: &'a DesignSettings,
    /// Last criterion; it ranks the results.
    pub(super) criterion: &'a dyn Criterion,
    pub(super) coarse: Vec<f64>,
    pub(super) fine: Vec<f64>,
    pub(super) logged: Vec<f64>,
    pub(super) interruption: Interruption<'a>,
}

impl<'a> DesignRun<'a> {
    pub(super) fn new(
        task: &'a DesignTask<'a>,
        settings: &'a DesignSettings,
        watch: &'a DesignWatch<'a>,
        elapsed_s: &'a (dyn Fn() -> f64 + Sync),
    ) -> Result<Self, OptimiserError> {
        let criterion = *task.criteria.last().ok_or(OptimiserError::Start)?;
        let duration_s = task.family.duration_s();
        let coarse = grid(duration_s, settings.search_grid(task));
        Ok(Self {
            task,
            settings,
            criterion,
            fine: grid(duration_s, 2 * coarse.len() - 1),
            coarse,
            logged: grid(duration_s, (duration_s * settings.rate_hz).round() as usize + 1),
            interruption: Interruption::new(watch, elapsed_s, settings),
        })
    }

    pub(super) fn no_margins(&self) -> Vec<f64> {
        vec![0.0; self.task.limits.constraints().len()]
    }

    pub(super) fn assess(&self, parameters: Vec<f64>) -> Assessment {
        assess(self.task, self.criterion, parameters, &self.fine, &self.logged)
    }
}
