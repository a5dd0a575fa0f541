//! The pages that people look at: what stands in each `report.html`.

pub(crate) mod identification;
mod payloads;
