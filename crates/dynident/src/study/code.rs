//! Code that stands in a study in memory: what a caller tries out in place of what the study file offers.

use dynident_excitation::families::{FamilyError, FunctionFamily, FunctionFamilySettings, MotionFunction};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Code of a section that names it, or none where the study was read from a file. Equal to itself and its clones alone,
/// and never written.
pub struct Code<T: ?Sized>(pub Option<Arc<T>>);

impl<T: ?Sized> Default for Code<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: ?Sized> Clone for Code<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T: ?Sized> From<Arc<T>> for Code<T> {
    fn from(code: Arc<T>) -> Self {
        Self(Some(code))
    }
}

impl<T: ?Sized> PartialEq for Code<T> {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (None, None) => true,
            _ => false,
        }
    }
}

impl<T: ?Sized> core::fmt::Debug for Code<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(if self.0.is_some() { "Code(..)" } else { "Code(none)" })
    }
}

/// `family = { kind = "function", .. }`: a family that is a caller's own code.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FunctionChoice {
    /// What the function is called; the code itself is given by the program that has it.
    pub function: String,
    /// Free parameters of each joint, 1 to 1000.
    pub parameters: usize,
    /// Whether the motion is linear in the parameters, zero at zero, so that gradients are exact; false by default.
    #[serde(default)]
    pub linear: bool,
    /// The code.
    #[serde(skip)]
    pub code: Code<dyn MotionFunction>,
}

impl FunctionChoice {
    pub(super) fn family(&self, joints: usize, duration_s: f64) -> Result<FunctionFamily, FamilyError> {
        let Some(code) = &self.code.0 else {
            let problem = "no file holds code: give it from the program that has it";
            return Err(FamilyError::Function { name: self.function.clone(), problem });
        };
        let Self { parameters, linear, .. } = *self;
        let settings = FunctionFamilySettings { function: self.function.clone(), parameters, linear };
        FunctionFamily::new(joints, duration_s, &settings, Arc::clone(code))
    }
}
