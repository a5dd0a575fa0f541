//! Batches give the results of single samples at every processor level.

use crate::invariants::cases;
use dynident_dynamics::{
    BatchWorkspace, JointMatrices, Workspace, inverse_dynamics_derivative_matrices, inverse_dynamics_derivatives,
    mass_matrices, mass_matrix,
};
use dynident_lanes::Level;
use dynident_model::terms::JointMotion;

/// The same recursion with another order of roundings, over about ten bodies.
const ROUNDING: f64 = 1e-12;

/// Not a multiple of any number of lanes, and fewer than any.
const SAMPLES: [usize; 2] = [21, 3];

#[test]
fn batched_matrices_equal_those_of_single_samples() {
    for case in cases().step_by(3) {
        let (model, dof) = (&case.model, case.model.dof());
        for (level, samples) in Level::available().into_iter().flat_map(|level| SAMPLES.map(|samples| (level, samples)))
        {
            let mut workspace = Workspace::with_level(model, level);
            let mut batch = BatchWorkspace::with_level(model, level);
            // Every sample is another state, so that mixed-up entries are detected.
            let spread = |vector: &[f64]| -> Vec<f64> {
                vector.iter().flat_map(|x| (0..samples).map(move |s| x + 0.1 * s as f64)).collect()
            };
            let [q, dq, ddq] = [&case.q, &case.dq, &case.ddq].map(|vector| spread(vector));
            let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
            let mut mass = JointMatrices::new(model);
            let mut derivatives = [(); 3].map(|()| JointMatrices::new(model));
            mass_matrices(model, &mut batch, &q, samples, &mut mass);
            inverse_dynamics_derivative_matrices(model, &mut batch, &motion, &mut derivatives);
            let [by_q, by_dq, by_ddq] = &derivatives;
            for sample in 0..samples {
                let at = |array: &[f64]| (0..dof).map(|joint| array[joint * samples + sample]).collect::<Vec<f64>>();
                let (q, dq, ddq) = (at(&q), at(&dq), at(&ddq));
                let single = mass_matrix(model, &mut workspace, &q).to_vec();
                let varied = inverse_dynamics_derivatives(model, &mut workspace, &q, &dq, &ddq);
                let expected = [&single[..], varied.by_position, varied.by_velocity, varied.by_acceleration];
                for (name, (found, expected)) in
                    ["M", "dq", "ddq", "dddq"].iter().zip([&mass, by_q, by_dq, by_ddq].into_iter().zip(expected))
                {
                    let scale = expected.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
                    for (entry, expected) in expected.iter().enumerate() {
                        let found = found.entry(entry / dof, entry % dof)[sample];
                        assert!(
                            (found - expected).abs() <= ROUNDING * scale,
                            "{name}, {}, sample {sample} of {samples}, entry {entry}: {found} against {expected}",
                            level.name()
                        );
                    }
                }
            }
        }
    }
}
