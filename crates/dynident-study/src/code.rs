//! Code of the calling program in a study that is in memory.

use dynident_excitation::families::{FamilyError, FunctionFamily, FunctionFamilySettings, MotionFunction};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Code of the calling program for a section; `None` in a study that was read from a file. It is equal only to itself
/// and its clones, and is never serialised.
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

/// `family = { kind = "function", .. }`: a trajectory family defined by code of the calling program.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FunctionChoice {
    /// Name of the function; the calling program provides its code.
    pub function: String,
    /// Number of free parameters of each joint, 1 to 1000.
    pub parameters: usize,
    /// Whether the motion is linear in the parameters and zero if all parameters are zero; gradients are then exact.
    /// False by default.
    #[serde(default)]
    pub linear: bool,
    /// The code.
    #[serde(skip)]
    pub code: Code<dyn MotionFunction>,
}

impl FunctionChoice {
    pub(super) fn family(&self, joints: usize, duration_s: f64) -> Result<FunctionFamily, FamilyError> {
        let Some(code) = &self.code.0 else {
            let problem = "no file holds code: set it in the calling program";
            return Err(FamilyError::Function { name: self.function.clone(), problem });
        };
        let Self { parameters, linear, .. } = *self;
        let settings = FunctionFamilySettings { function: self.function.clone(), parameters, linear };
        FunctionFamily::new(joints, duration_s, &settings, Arc::clone(code))
    }
}
