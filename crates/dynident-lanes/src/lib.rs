//! **On how many numbers at once?** The bottom room of Dynident: one small scalar trait, the types that
//! implement it, and the run-time choice between them.
//!
//! Every algorithm of the dynamics core is written once over [`Scalar`] and runs
//! * on one sample ([`F64x1`]),
//! * on four or eight samples side by side ([`F64x4`], [`F64x8`]: AVX2, AVX-512, NEON, chosen by [`dispatch`] at run time,
//!   so that one portable binary is fast everywhere),
//! * on dual numbers ([`Dual`]: exact derivatives, and the oracle for hand-written ones).
//!
//! This is the only crate of the core that contains `unsafe`, in one place: [`dispatch`](mod@dispatch).

mod dispatch;
mod dual;
mod lanes;
mod scalar;
mod sin_cos;

pub use dispatch::{Kernel, Level, dispatch, dispatch_single};
pub use dual::Dual;
pub use lanes::{F64x1, F64x4, F64x8, Lane};
pub use scalar::Scalar;
