//! A differentiator that the caller implements, as a part of the settings. It is shared and not serialised.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use crate::error::FilterError;
use std::sync::Arc;

/// A caller's [`Differentiator`]; empty if the settings were read from a file. It is equal only to itself and its
/// clones.
#[derive(Clone, Debug, Default)]
pub struct DifferentiatorCode(Option<Arc<dyn Differentiator>>);

impl From<Arc<dyn Differentiator>> for DifferentiatorCode {
    fn from(code: Arc<dyn Differentiator>) -> Self {
        Self(Some(code))
    }
}

impl PartialEq for DifferentiatorCode {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (None, None) => true,
            _ => false,
        }
    }
}

impl DifferentiatorCode {
    pub(super) fn build(&self) -> Option<Box<dyn Differentiator>> {
        let code = self.0.clone()?;
        Some(Box::new(Shared(code)))
    }
}

#[derive(Debug)]
struct Shared(Arc<dyn Differentiator>);

impl Differentiator for Shared {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn minimum_samples(&self) -> usize {
        self.0.minimum_samples()
    }

    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        self.0.context_samples(rate_hz)
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        self.0.differentiate_at(place, q, out)
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        self.0.smooth(rate_hz, signal, out)
    }
}
