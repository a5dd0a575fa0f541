/// Computing time of the stages of an identification, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Time for reducing the logs to triangular factors.
    pub logs_s: f64,
    /// Time for computing the parameters from the factors.
    pub estimation_s: f64,
    /// Time for lags, torque over time and held-out recordings.
    pub examination_s: f64,
}
