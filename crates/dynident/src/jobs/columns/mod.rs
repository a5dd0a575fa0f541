//! Interprets the names of a recording's columns: quantities, joints, units, times.

mod families;
mod meaning;
mod quantity;
mod spelling;
mod units;

pub(in crate::jobs) use families::{
    Basis, Family, best, best_command, best_next_to, best_torque, equal_choice, families, families_by_order,
    families_without_quantity, is_unsigned,
};
pub(in crate::jobs) use meaning::{JointKey, Source, is_quantity, meaning, words};
pub(in crate::jobs) use quantity::Quantity;
pub(in crate::jobs) use spelling::{column_list, joint_pattern, shown};
pub(in crate::jobs) use units::{time_as_toml, time_unit_s, unit, with_unit};
