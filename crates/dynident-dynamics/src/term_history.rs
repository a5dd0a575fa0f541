//! State of terms between blocks: hysteresis of earlier blocks, parameters for the transmitted torque, and
//! temperature.

use dynident_model::terms::HysteresisState;

/// State that is passed from block to block of one uninterrupted recording with
/// [`regressor_panels_following`](crate::regressor_panels_following).
#[derive(Clone, Debug, Default)]
pub struct TermHistory {
    /// Hysteresis state of each column of the layout, once a term with hysteresis occurred.
    pub(crate) memories: Vec<HysteresisState>,
    /// One value per column of the layout; the values of body columns determine the transmitted torque.
    pub(crate) load_parameters: Option<Vec<f64>>,
    pub(crate) load: Vec<f64>,
    /// Temperatures of the next block, joint-major, °C; may be empty.
    pub(crate) temperature_c: Vec<f64>,
}

impl TermHistory {
    /// Starts a recording. `load_parameters`, one value per column of the layout, come from an earlier estimate. They
    /// determine the transmitted torque of load-dependent friction at joint j, the torque of the bodies, `τ_load =
    /// Σ_body columns W_j θ`, Nm (N). Values at the terms' columns are not read. Without `load_parameters`, the
    /// columns of load-dependent friction are zero.
    pub fn new(load_parameters: Option<Vec<f64>>) -> Self {
        Self { load_parameters, ..Self::default() }
    }

    /// Sets the joint temperatures of the next block, °C, joint-major. Without them, the columns of
    /// temperature-dependent terms are zero.
    pub fn set_temperature(&mut self, temperature_c: &[f64]) {
        self.temperature_c.clear();
        self.temperature_c.extend_from_slice(temperature_c);
    }

    /// The hysteresis state of each column of the layout, for storage; empty before a term with hysteresis occurred.
    pub fn memories(&self) -> &[HysteresisState] {
        &self.memories
    }

    /// Continues from stored [`memories`](Self::memories).
    pub fn set_memories(&mut self, memories: Vec<HysteresisState>) {
        self.memories = memories;
    }

    /// Clears the hysteresis state: the next block starts a recording.
    pub fn restart(&mut self) {
        self.memories.iter_mut().for_each(HysteresisState::restart);
    }
}
