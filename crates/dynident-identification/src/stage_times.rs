/// Time of the stages of an identification, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// From logs to factors.
    pub logs_s: f64,
    /// From factors to parameters.
    pub estimation_s: f64,
    /// Delays, traces and held-out recordings.
    pub examination_s: f64,
}
