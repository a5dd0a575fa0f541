//! **What torque does a motion need?** Rigid-body algorithms, the torque regressor and base parameters.

mod independent_columns;

pub use independent_columns::{IndependentColumns, independent_columns};
