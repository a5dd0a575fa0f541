//! Identified masses are nearer to the truth than nominal masses.

use super::common::{Job, Motion, Random, Truth, header, repository, write_log};
use dynident::estimation::HALF_WIDTH_95;
use dynident::result::ValueSource;

/// Arms with masses up to 30 % from their descriptions, with friction; 20 s at 200 Hz with noise of 0.2 Nm and 1e-5
/// rad. The median mass error decreases, no error exceeds 1.2 times the nominal error plus three error bars, and the
/// first mass, of which only the inertia about its axis affects a torque, keeps its nominal value, with an error bar of
/// the size of the other differences.
#[test]
fn masses_come_nearer_to_the_truth() {
    let robots = ["robots/ur10.urdf", "robots/panda_arm7.urdf"];
    let (mut found_errors, mut described_errors) = (Vec::new(), Vec::new());
    let (mut told, mut held, mut all) = (Vec::new(), 0_usize, 0_usize);
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
            let bars = body.std.unwrap();
            let [found, described] = [body.mass_kg, described].map(|kg| (kg - mass).abs() / mass);
            let bar = bars[0] / mass;
            assert!(found < 1.2 * described + 3.0 * bar, "{case} {}: {found} for {described}, {bar}", body.name);
            let errors = (0..10).map(|k| (body.parameters[k] - truth.0[k], bars[k])).filter(|(_, bar)| *bar > 0.0);
            for (error, bar) in errors {
                all += 1;
                held += usize::from(error.abs() < HALF_WIDTH_95 * bar);
            }
            let sources = body.sources.unwrap();
            let measured = (0..10).filter(|&k| sources[k] == ValueSource::Measured);
            told.extend(measured.map(|k| ((body.parameters[k] - truth.0[k]) / bars[k]).powi(2)));
            found_errors.push(found);
            described_errors.push(described);
        }
        // Its inertia about the axis affects the mass only through the shape of the body: 0.001.
        let first = &found.result.bodies[0];
        let (described, source) = (first.prior.unwrap()[0], first.sources.unwrap()[0]);
        assert!((first.mass_kg / described - 1.0).abs() < 1e-3 && source == ValueSource::Nominal, "{first:?}");
        // The bar follows the differences of the other bodies: 17 % (standard deviation).
        let bar = first.std.unwrap()[0] / described;
        assert!((0.08..0.5).contains(&bar), "{bar} {first:?}");
    }
    let median = |errors: &mut Vec<f64>| {
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let (found, described) = (median(&mut found_errors), median(&mut described_errors));
    assert!(found < described, "{found} for {described}");
    assert!(held as f64 > 0.93 * all as f64, "{held} of {all} hold");
    // For identified values: the scatter of the mean square of a few dozen values.
    let mean = (told.iter().sum::<f64>() / told.len() as f64).sqrt();
    println!("{held} of {all} hold, {mean} of {}, masses {found} for {described}", told.len());
    assert!(told.len() > 20 && (0.5..1.5).contains(&mean), "{mean} of {}", told.len());
}
