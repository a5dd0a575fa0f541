//! Are the written masses nearer to the truth than the description's?

use super::common::{Job, Motion, Random, Truth, header, repository, write_log};
use dynident::result::ValueSource;

/// Arms whose masses are up to 30 % from their descriptions, with friction; twenty seconds at 200 Hz with noise of
/// 0.2 Nm and 1e-5 rad. The median mass is nearer to the truth than the description's, none gets
/// much worse, and the first one, of which only the inertia about its axis is in any torque, is the description's.
#[test]
fn masses_come_nearer_to_the_truth() {
    let robots = ["robots/ur10.urdf", "robots/panda_arm7.urdf"];
    let (mut found_errors, mut described_errors) = (Vec::new(), Vec::new());
    for case in 0..dynident_testing::count(6, 40) {
        let description = repository(robots[case % robots.len()]);
        let mut random = Random(100 + case as u64);
        let truth = Truth::other(&description, &mut random);
        let dof = truth.drive.len();
        let folder = tempfile::tempdir().unwrap();
        let motion = Motion::new(dof, 500 + case as u64);
        write_log(&folder.path().join("log.csv"), &truth, &motion, (200.0, 20.0), &header(dof), |q, tau| {
            let q: Vec<f64> = q.iter().map(|q| q + 1e-5 * random.normal()).collect();
            let tau: Vec<f64> = tau.iter().map(|tau| tau + 0.2 * random.normal()).collect();
            [q, tau].concat()
        });
        let study = format!(
            "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}]\ndrive.offset = true\n[format]\ntime = {{ column = \"t\" }}\n\
             position = {{ columns = \"q{{1..{dof}}}\" }}\ntorque = {{ columns = \"tau{{1..{dof}}}\" }}\n",
            description.display().to_string(),
        );
        let found = Job::new(folder.path(), &study).identify();
        for (body, truth) in found.result.bodies.iter().zip(truth.model.inertials()) {
            let (mass, described) = (truth.mass_kg(), body.prior.unwrap()[0]);
            let [found, described] = [body.mass_kg, described].map(|kg| (kg - mass).abs() / mass);
            // A tenth of the mass is a third of what the description is believed to.
            assert!(found < 1.2 * described + 0.1, "{case} {}: {found} for {described}", body.name);
            found_errors.push(found);
            described_errors.push(described);
        }
        // Its inertia about the axis pulls at the mass only through the shape of the body: a thousandth.
        let first = &found.result.bodies[0];
        let (described, source) = (first.prior.unwrap()[0], first.sources.unwrap()[0]);
        assert!((first.mass_kg / described - 1.0).abs() < 1e-3 && source == ValueSource::Nominal, "{first:?}");
    }
    let median = |errors: &mut Vec<f64>| {
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let (found, described) = (median(&mut found_errors), median(&mut described_errors));
    assert!(found < described, "{found} for {described}");
}
