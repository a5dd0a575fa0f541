//! **Model validation**: errors on held-out data and residual diagnostics.
//!
//! [`Validation`] accumulates the errors of predicted torque; [`CrossValidation`] compares sets of columns on left-out
//! parts of the logs; [`left_out_ratios`] compares the prediction error on such parts with the one that the fit
//! predicts. [`essential`] drops parameters that the data do not determine. [`Whiteness`], [`Normality`] and
//! [`SpeedRanges`] take residuals sample by sample, in constant memory, and test whether they are white, normal or
//! larger at reversals.

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
