//! Differences between logs (payloads, offsets, gains), and payloads on a known arm.

mod body;
mod columns;
mod error;
mod free_gains;
mod gain_error;
mod gains;
mod known_arm;
mod measured;
mod refit;
mod result;
mod round_body;

pub use columns::{LoadColumns, Payload, known_payloads};
pub use error::PayloadError;
pub use free_gains::with_free_gains;
pub use gains::DriveGain;
pub use known_arm::KnownArm;
pub use measured::Measured;
pub use refit::Refit;
pub use result::{ConsistentPayload, PayloadParameter, PayloadResult, payload_results};
pub use round_body::{ControllerPayload, ControllerValue};

pub(crate) use columns::{SeenColumns, base_column};
pub(crate) use free_gains::free_gains;
pub(crate) use gain_error::gain_error;
pub(crate) use gains::{Gains, drive_gains, known_loads};
