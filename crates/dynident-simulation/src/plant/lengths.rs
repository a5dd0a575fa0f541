//! Robots with link lengths that differ from the robot description.

use crate::error::{SimulationError, require};
use dynident_model::sample::Random;
use dynident_model::{Joint, Mat3, Model, Transform};

/// The same robot with other joint placements: `change(joint, placement)` returns the new `parent_from_child` of each.
///
/// # Errors
/// A placement that is not finite.
pub fn with_placements(
    model: &Model,
    mut change: impl FnMut(usize, Transform) -> Transform,
) -> Result<Model, SimulationError> {
    let joints: Vec<Joint> = model
        .tree_joints()
        .iter()
        .enumerate()
        .map(|(index, joint)| Joint { placement: change(index, joint.placement), ..joint.clone() })
        .collect();
    let changed = Model::new(model.name(), model.base().clone(), joints, model.bodies().to_vec())?;
    Ok(changed.with_gravity(model.gravity())?)
}

/// A robot with manufacturing errors: each joint's placement has a normally distributed position error with standard
/// deviation `length_std_m` along every axis, and a rotation about a random axis with standard deviation
/// `angle_std_rad`. The same seed results in the same robot.
///
/// # Errors
/// A standard deviation that is negative or not finite.
pub fn with_length_errors(
    model: &Model,
    length_std_m: f64,
    angle_std_rad: f64,
    seed: u64,
) -> Result<Model, SimulationError> {
    for (what, value) in [("length_std_m", length_std_m), ("angle_std_rad", angle_std_rad)] {
        require(value >= 0.0 && value.is_finite(), what, value, "give zero or a finite positive number")?;
    }
    let mut random = Random::new(seed);
    with_placements(model, |_, mut placement| {
        for x in &mut placement.translation.0 {
            *x += length_std_m * random.normal();
        }
        let turn = Mat3::from_axis_angle(random.direction(), angle_std_rad * random.normal());
        placement.rotation = turn.mul_mat(&placement.rotation);
        placement
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::random_tree;

    #[test]
    fn lengths_change_and_nothing_else() {
        let model = random_tree(3, 5);
        let same = with_length_errors(&model, 0.0, 0.0, 1).unwrap();
        assert_eq!(same.gravity(), model.gravity());
        assert_eq!(same.inertials(), model.inertials());
        let off = with_length_errors(&model, 1e-3, 1e-3, 1).unwrap();
        assert_eq!(off, with_length_errors(&model, 1e-3, 1e-3, 1).unwrap());
        for (a, b) in off.joints().iter().zip(model.joints()) {
            let moved = (a.placement.translation + -b.placement.translation).norm();
            assert!(moved > 0.0 && moved < 6.0 * 3.0_f64.sqrt() * 1e-3);
        }
        assert!(with_length_errors(&model, -1.0, 0.0, 1).is_err());
        assert!(with_length_errors(&model, 0.0, f64::NAN, 1).is_err());
    }
}
