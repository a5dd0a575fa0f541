//! **Rows in, triangles out.** What remains of a log of any length, and the problems that are assembled from it.
//!
//! A [`TriangularFactor`] holds all that least squares needs from rows `[W | τ]`: `RᵀR = [W | τ]ᵀ[W | τ]`. Rows of one
//! joint in one log go into a [`SegmentedFactor`], which keeps at most K factors of consecutive time segments, so that
//! a covariance can later ask how the segments differ. The factors of all joints and logs over one list of named
//! columns make a [`LinearProblem`] (an [`InstrumentedProblem`] where instruments stand beside the regressor), with a
//! [`Prior`] where there is one. [`RankSettings`] say when a column counts as excited, a [`RankReport`] what was
//! decided; [`unexcited_columns`] holds columns against the noise of the motion. Where samples come one at a time, a
//! [`RecursiveFactor`] takes them.

mod excitation;
mod instrumented;
mod problem;
mod rank;
mod recursive;
mod reflect;
mod segmented;
mod sparse_map;
mod stored;
mod triangular;
mod unexcited;

pub use excitation::unexcited_columns;
pub use instrumented::InstrumentedProblem;
pub(crate) use problem::StackedProblem;
pub use problem::{JointRows, LinearProblem, Prior};
pub use rank::{FixedColumn, RankReport, RankSettings};
pub(crate) use rank::{Solution, SolvedValues, Split, report, solve, solved_values, split};
pub use recursive::RecursiveFactor;
pub(crate) use reflect::{CHUNK_ROWS, Chunk, TriangleOnPanel, heights, row_start};
pub(crate) use segmented::ReducedRows;
pub use segmented::{SegmentSettings, SegmentedFactor};
pub use stored::{FactorShape, SegmentShape};
pub use triangular::{BLOCK_ROWS, FactorWorkspace, TriangularFactor};
pub(crate) use triangular::{check_columns, check_weight};
pub use unexcited::Unexcited;
