//! What terms need beyond the motion of a block: their memory of earlier blocks, and the load that joints carry.

use dynident_model::terms::HysteresisState;

/// Goes from block to block of one uninterrupted recording with
/// [`regressor_panels_following`](crate::regressor_panels_following).
#[derive(Clone, Debug, Default)]
pub struct TermHistory {
    /// One per column of the layout, once a term with memory was met.
    pub(crate) memories: Vec<HysteresisState>,
    /// One value per column of the layout; those of bodies make the load.
    pub(crate) load_parameters: Option<Vec<f64>>,
    /// The load of one joint.
    pub(crate) load: Vec<f64>,
    /// Temperatures of the next block, joint-major, °C; empty without.
    pub(crate) temperature_c: Vec<f64>,
}

impl TermHistory {
    /// The start of a recording. `load_parameters`, one value per column of the layout, say what the bodies are by an
    /// earlier estimate: joint j's load is the torque that they ask of it, `τ_load = Σ_body columns W_j θ`, Nm (N).
    /// Values at the terms' columns are not read. Without them, load-dependent friction has a column of zeros.
    pub fn new(load_parameters: Option<Vec<f64>>) -> Self {
        Self { load_parameters, ..Self::default() }
    }

    /// Says how warm the joints are in the next block, °C, joint-major like its motion; without it terms that depend on
    /// the temperature have columns of zeros.
    pub fn set_temperature(&mut self, temperature_c: &[f64]) {
        self.temperature_c.clear();
        self.temperature_c.extend_from_slice(temperature_c);
    }

    /// Forgets the motion so far: the next block starts a recording.
    pub fn restart(&mut self) {
        self.memories.iter_mut().for_each(HysteresisState::restart);
    }
}
