//! **Is the model good, and is all of it needed?** Errors on data that were not used, and a look at the residuals.
//!
//! [`Validation`] sums up the errors of predicted torque; [`CrossValidation`] leaves out one part of the logs after the
//! other to compare sets of columns; [`left_out_ratios`] says how much worse such parts are predicted than the fit
//! promises. [`essential`] drops parameters that the data do not support, one by one.
//! [`Whiteness`], [`Normality`] and [`SpeedRanges`] are fed sample after sample and say whether residuals are white,
//! normal, or larger at reversals; their memory does not grow.

mod cross_validation;
mod essential;
mod left_out_blocks;
mod nonnegative;
mod normality;
mod speed_ranges;
mod validation;
mod whiteness;

pub use cross_validation::{CrossValidation, FoldErrors, JointFolds};
pub use essential::{
    CorrelatedPair, DroppedParameter, EssentialEnd, EssentialReport, EssentialSettings, essential,
    strongest_correlations,
};
pub use left_out_blocks::left_out_ratios;
pub use nonnegative::nonnegative_least_squares;
pub use normality::{Normality, NormalityReport};
pub use speed_ranges::{SpeedRangeFigures, SpeedRanges, SpeedRangesReport};
pub use validation::{JointValidation, Validation, ValidationReport};
pub use whiteness::{Whiteness, WhitenessReport};
