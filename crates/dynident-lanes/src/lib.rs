//! **Vectorisation**: a small scalar trait, the types that implement it, and the run-time choice between them.
//!
//! Every algorithm of the dynamics core is written once over [`Scalar`] and runs
//! * on one sample ([`dispatch_single`]),
//! * on four or eight samples side by side ([`dispatch()`]: AVX2, AVX-512 or the build target's own instructions,
//!   chosen at run time, so that one portable binary is fast everywhere),
//! * on dual numbers ([`Dual`]: exact derivatives, and the oracle for hand-written ones).
//!
//! Friction laws use more functions and are written over [`Real`].
//!
//! The only crate of the core with `unsafe` code, in one file: `x86.rs`.

#![deny(unsafe_code)]

mod aligned;
mod dispatch;
mod dual;
mod exponential;
mod kernel;
mod lanes;
mod many_values;
mod portable;
mod real;
mod register;
mod scalar;
mod sin_cos;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use aligned::AlignedBuffer;
pub use dispatch::{Level, dispatch, dispatch_single};
pub use dual::Dual;
pub use kernel::Kernel;
pub use lanes::Lane;
pub use many_values::{LaneFunction, map_all};
pub use real::Real;
pub use scalar::Scalar;
