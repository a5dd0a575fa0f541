use crate::estimation::estimate::RunEstimate;
use crate::estimation::run_logs::RunLog;
use crate::policy::record::RunRecord;
use crate::setup::leg::Leg;
use crate::signals::rests::StictionBand;
use dynident_recording::DifferentiatorSettings;
use dynident_simulation::Record;

#[derive(Clone, Debug)]
pub(crate) struct GoodLog {
    run: usize,
    legs: Vec<Leg>,
    records: Vec<Record>,
    joint_sigma: Vec<f64>,
    differentiator: Option<DifferentiatorSettings>,
    rest_margins: Vec<StictionBand>,
}

impl GoodLog {
    pub(crate) fn new(record: &RunRecord, legs: Vec<Leg>, records: Vec<Record>) -> Self {
        let joint_sigma = record.estimate.as_ref().map(|estimate| estimate.joint_sigma.clone()).unwrap_or_default();
        let way = record.estimate.as_ref().and_then(|estimate| estimate.differentiator.as_ref());
        let differentiator = way.map(|way| way.taken.clone());
        let rest_margins = record.estimate.as_ref().map(RunEstimate::rest_margins).unwrap_or_default();
        Self { run: record.run, legs, records, joint_sigma, differentiator, rest_margins }
    }

    pub(crate) fn run(&self) -> usize {
        self.run
    }

    pub(crate) fn as_run(&self) -> RunLog<'_> {
        let differentiator = self.differentiator.as_ref();
        RunLog {
            run: self.run,
            legs: &self.legs,
            records: &self.records,
            joint_sigma: &self.joint_sigma,
            differentiator,
            rest_margins: &self.rest_margins,
        }
    }
}
