//! Progress of long jobs.

/// Receives the progress of a job. Several threads may call it.
pub trait Progress: Sync {
    /// A stage begins; `total` is its number of rows, if known.
    fn begin(&self, stage: &str, total: Option<u64>);
    /// `rows` more rows are finished.
    fn advance(&self, rows: u64);
    /// The stage is finished.
    fn end(&self);
}

/// Ignores progress.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: Option<u64>) {}
    fn advance(&self, _rows: u64) {}
    fn end(&self) {}
}
