//! How a long job says where it is.

/// Hears how far a job has come. Calls may come from several threads.
pub trait Progress: Sync {
    /// A stage begins; `total` is its size in rows where known.
    fn begin(&self, stage: &str, total: Option<u64>);
    /// `rows` more rows are done.
    fn advance(&self, rows: u64);
    /// The stage is over.
    fn end(&self);
}

/// Reports to nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: Option<u64>) {}
    fn advance(&self, _rows: u64) {}
    fn end(&self) {}
}
