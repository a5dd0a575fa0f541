//! Consistent parameters from the online factor equal those of a batch.

use dynident_dynamics::{Panels, ParametricModel, TermHistory, Workspace, regressor_panels_of_sample};
use dynident_estimation::{LinearProblem, SegmentSettings, SegmentedFactor};
use dynident_identification::consistent::{ConsistencySettings, consistent_parameters};
use dynident_model::load_robot;
use dynident_model::sample::Random;
use dynident_model::terms::{DriveChoice, JointMotion, terms_per_joint};
use dynident_online::{OnlineEstimator, OnlineSettings};
use dynident_testing::repository;

const STD: [f64; 2] = [0.3, 0.1];

#[test]
fn online_rows_give_consistent_bodies() {
    let model = load_robot(repository("robots/planar2r.urdf")).unwrap().model;
    let terms = terms_per_joint(&model, |_| DriveChoice { viscous: true, ..DriveChoice::default() });
    let robot = ParametricModel::new(model, terms).unwrap();
    let truth = robot.nominal_base().unwrap().to_vec();
    let mut online = OnlineEstimator::new(robot.clone(), OnlineSettings::new(STD.to_vec()), None).unwrap();
    let mut random = Random::new(2);
    let (mut workspace, mut panels) = (Workspace::new(robot.model()), Panels::default());
    let layout = robot.layout();
    // Rows of each joint, as in a batch.
    let mut rows: Vec<Vec<Vec<f64>>> =
        (0..2).map(|joint| vec![Vec::new(); layout.joint_columns(joint).len() + 1]).collect();
    for _ in 0..2000 {
        let mut draw = |size: f64| [random.uniform(-size, size), random.uniform(-size, size)];
        let (q, dq, ddq, noise) = (draw(3.0), draw(2.0), draw(6.0), draw(1.7));
        let motion = JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq };
        regressor_panels_of_sample(
            robot.model(),
            &mut workspace,
            layout,
            &motion,
            &mut TermHistory::default(),
            &mut panels,
        );
        let mut tau = [0.0; 2];
        for joint in 0..2 {
            let own = layout.joint_columns(joint);
            let entries = &panels.joint(joint)[..own.len()];
            tau[joint] = STD[joint] * noise[joint] + own.iter().zip(entries).map(|(&c, w)| truth[c] * w).sum::<f64>();
            for (column, value) in rows[joint].iter_mut().zip(entries.iter().chain([&tau[joint]])) {
                column.push(*value);
            }
        }
        online.add(&q, &dq, &ddq, &tau).unwrap();
    }
    let mut problem = LinearProblem::new(robot.base().expressions(), robot.joint_names());
    for (joint, columns) in rows.iter().enumerate() {
        let mut factor = SegmentedFactor::new(columns.len() - 1, SegmentSettings::for_rows(2000)).unwrap();
        factor.absorb(&columns.concat(), 2000).unwrap();
        problem.add("batch", joint, layout.joint_columns(joint).to_vec(), factor).unwrap();
    }
    let settings = ConsistencySettings::default();
    let batch = consistent_parameters(&robot, &problem, &STD, &settings).unwrap();
    let fit = online.consistent(&settings).unwrap();
    let covariance = online.covariance().unwrap();
    let (found, expected) = (robot.base().values(&fit.parameters), robot.base().values(&batch.parameters));
    for (place, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let std = covariance[(place, place)].sqrt();
        // The rows are equal; only the prior scales of friction differ, which have little influence.
        assert!((found - expected).abs() < 0.05 * std, "{place}: {found} and {expected}, standard deviation {std}");
        assert!(
            (found - truth[place]).abs() < 5.0 * std,
            "{place}: {found} and {}, standard deviation {std}",
            truth[place]
        );
    }
}
