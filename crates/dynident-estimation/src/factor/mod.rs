//! **Triangular factors**: logs reduced to factors of bounded size, and the problems assembled from them.
//!
//! A [`TriangularFactor`] R replaces the rows `[W | τ]` of regressor and torque in least squares: `RᵀR = [W | τ]ᵀ[W |
//! τ]`. The rows of one joint in one log go into a [`SegmentedFactor`], which keeps at most K factors of consecutive
//! time segments for covariances from segments. The factors of all joints and logs over one list of named columns
//! form a [`LinearProblem`] (an [`InstrumentedProblem`] with instruments), optionally with a [`Prior`].
//! [`RankSettings`] define when a column is excited, and a [`RankReport`] lists the decisions. [`unexcited_columns`]
//! compares columns with the noise of the motion. A [`RecursiveFactor`] takes samples one at a time.

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
pub(crate) use triangular::{MAX_MAGNITUDE, check_columns, check_weight};
pub use unexcited::Unexcited;
