//! Mistakes of one column, or of two related columns.

use super::{Case, SAME, TAU, all_are_named, each};

#[test]
fn units_of_one_joint_are_named() {
    all_are_named(&[
        Case {
            name: "degrees of the elbow",
            rows: |rows| each(rows, |row| row[3] = row[3].to_degrees()),
            study: SAME,
            kind: "unit",
            named: &["scale = [1.0, 1.0, 0.0174532925, 1.0, 1.0, 1.0]"],
        },
        Case {
            name: "degrees of the last wrist",
            rows: |rows| each(rows, |row| row[6] = row[6].to_degrees()),
            study: SAME,
            kind: "unit",
            named: &["scale = [1.0, 1.0, 1.0, 1.0, 1.0, 0.0174532925]"],
        },
        Case {
            name: "the lift's motor",
            rows: |rows| each(rows, |row| row[2] *= 101.0),
            study: SAME,
            kind: "unit",
            // 1/101 within 3 %.
            named: &["scale = [1.0, 0.0102", "scale = [1.0, 0.0101", "scale = [1.0, 0.0100", "scale = [1.0, 0.0099"],
        },
        Case {
            name: "half of the positions of the lift",
            rows: |rows| each(rows, |row| row[2] *= 0.5),
            study: SAME,
            kind: "unit",
            named: &["scale = [1.0, 2.0"],
        },
        Case {
            name: "the elbow's torque twice",
            rows: |rows| each(rows, |row| row[9] *= 2.0),
            study: SAME,
            kind: "unit",
            named: &["scale = [1.0, 1.0, 0.5"],
        },
        Case {
            name: "millinewton metres of a wrist",
            rows: |rows| each(rows, |row| row[11] *= 1e3),
            study: SAME,
            kind: "unit",
            named: &["scale = [1.0, 1.0, 1.0, 1.0, 0.00"],
        },
        Case {
            name: "percent of the rated torque",
            rows: |rows| {
                let rated = [330.0, 330.0, 150.0, 56.0, 56.0, 56.0];
                each(rows, |row| row[7..].iter_mut().zip(rated).for_each(|(tau, rated)| *tau *= 100.0 / rated));
            },
            study: SAME,
            kind: "unit",
            named: &["scale = [3.3", "scale = [3.2", "scale = [3.4"],
        },
    ]);
}

#[test]
fn columns_that_belong_together_are_named() {
    all_are_named(&[
        Case {
            name: "the elbow's angle against the ground",
            rows: |rows| each(rows, |row| row[3] += row[2]),
            study: SAME,
            kind: "coupling",
            named: &["matrix = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, -1.0, 1.0"],
        },
        Case {
            name: "a parallelogram's motors",
            rows: |rows| each(rows, |row| (row[3], row[8]) = (row[3] + row[2], row[8] - row[9])),
            study: SAME,
            kind: "coupling",
            named: &["position and torque"],
        },
        Case {
            name: "the motors of a differential wrist",
            rows: |rows| {
                each(rows, |row| {
                    [row[5], row[6]] = [row[5] + row[6], row[5] - row[6]];
                    [row[11], row[12]] = [row[11] + row[12], row[11] - row[12]].map(|sum| 0.5 * sum);
                });
            },
            study: SAME,
            kind: "coupling",
            // The inertia of the last joint is too small to distinguish the sign of its motion, so that the sentence
            // lists the other matrices too.
            named: &[
                "[0.0, 0.0, 0.0, 0.0, 0.5, 0.5], [0.0, 0.0, 0.0, 0.0, 0.5, -0.5]]`; in [format.torque] write `matrix",
                "[0.0, 0.0, 0.0, 0.0, 0.5, 0.5], [0.0, 0.0, 0.0, 0.0, 0.5, -0.5]], [format.torque] matrix",
            ],
        },
        Case {
            name: "the positions of these motors with torques of the joints",
            rows: |rows| each(rows, |row| [row[5], row[6]] = [row[5] + row[6], row[5] - row[6]]),
            study: SAME,
            kind: "coupling",
            named: &["[0.0, 0.0, 0.0, 0.0, 0.5, 0.5], [0.0, 0.0, 0.0, 0.0, 0.5, -0.5]]"],
        },
        Case {
            name: "one torque for two joints",
            rows: |rows| each(rows, |row| row[9] = row[8]),
            study: SAME,
            kind: "order",
            named: &["the torque of joints `shoulder_lift_joint` and `elbow_joint` is the same column"],
        },
        Case {
            name: "one position for two joints, as revolutions",
            rows: |rows| each(rows, |row| row[3] = row[2] / TAU),
            study: SAME,
            kind: "order",
            named: &["the position of joints `shoulder_lift_joint` and `elbow_joint` is the same column"],
        },
        Case {
            name: "magnitudes of the torques",
            rows: |rows| each(rows, |row| row[7..].iter_mut().for_each(|tau| *tau = tau.abs())),
            study: SAME,
            kind: "sign",
            named: &["magnitudes"],
        },
    ]);
}
