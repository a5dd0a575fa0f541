//! The default against the truth in hand: that the experiment is one of the default, and the same for any number of
//! threads.

use dynident::{Folders, Study, StudyRobot};
use dynident_benchmark::default_study::{
    CaseFigures, DEFAULT_CASES, DefaultCase, NamedEstimator, TABLE_HEADER, case_figures, csv_header, csv_line,
    default_settings, goals, table_line,
};
use std::error::Error;

fn figures(case: &DefaultCase, threads: usize) -> Result<CaseFigures, Box<dyn Error>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    Ok(pool.install(|| case_figures(case, 0..2, false))?)
}

/// Whatever becomes the default of a study becomes that of the experiment, or this fails.
#[test]
fn the_default_is_that_of_a_study_of_files_and_columns_alone() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("log.csv"), "t,q1,q2,tau1,tau2\n0,0,0,0,0\n0.01,0,0,0,0\n")?;
    std::fs::write(folder.path().join("arm.urdf"), include_str!("../../robots/planar2r.urdf"))?;
    let path = folder.path().join("study.toml");
    let text = r#"
        [robot]
        file = "arm.urdf"
        [format]
        time = { column = "t" }
        position = { columns = "q{1..2}" }
        torque = { columns = "tau{1..2}" }
        [[log]]
        file = "log.csv"
    "#;
    let study = Study::parse(text, &path)?;
    let folders = Folders::new(&study, &path, None);
    let robot = StudyRobot::new(&study, &path, &folders)?;
    let task = study.task(&path, &robot, &folders)?;
    let own = default_settings(&robot.parametric);
    assert_eq!(format!("{:?}", task.settings), format!("{own:?}"));
    Ok(())
}

/// The cheapest case, a planar arm. An expert who knows the truth cannot be much worse than the default (chance of two
/// recordings aside). A lag that is looked for does not make a fit worse than plain least squares. The step of friction
/// is passed within two samples: behind a low-pass that follows the motion the rows did not tell its width, and the
/// default had fifteen times the error of the true law; two recordings make a factor of two by chance.
#[test]
fn figures_do_not_depend_on_threads_and_are_in_order() -> Result<(), Box<dyn Error>> {
    let case = &DEFAULT_CASES[0];
    let one = figures(case, 1)?;
    let line = csv_line(case, &one);
    assert_eq!(line, csv_line(case, &figures(case, 3)?));
    assert_eq!(line.split(',').count(), csv_header().split(',').count());
    let header = TABLE_HEADER.lines().next().ok_or("no header")?;
    assert_eq!(table_line(case, &one).split('|').count(), header.split('|').count());
    assert!(one.over_best() > 0.9 && one.laws_stated_over_best() > 0.9, "{one:?}");
    assert!(one.of_plain.is_some_and(|plain| one.of_laws_stated < plain && one.of_default < plain), "{one:?}");
    assert!(one.of_default < 2.0 * one.of_laws_stated, "{one:?}");
    assert!(one.lag_found_s.is_some_and(|lag_s| lag_s.abs() < 1e-3), "{one:?}");
    assert_eq!((one.told, one.tellable, one.bodies.all), (4, 4, 12));
    // What is missed is said.
    assert!(goals(&[one]).iter().any(|goal| goal.ends_with("MISSED")));
    Ok(())
}

/// A lag of 8 ms at all joints, friction with a bump near rest: friction that is chosen while the lag is in the rows
/// makes up for a part of it, at each joint for another, and joints were given lags of their own (4 to 8 ms) that were
/// never put right. A lag that all joints share is taken off first. Its error is some tenths of a millisecond.
#[test]
fn a_lag_that_all_joints_share_is_found_beside_chosen_friction() -> Result<(), Box<dyn Error>> {
    let is_it =
        |case: &&DefaultCase| case.robot.name == "UR10" && case.friction.name() == "Stribeck" && case.lag_s == 8e-3;
    let case = DEFAULT_CASES.iter().find(is_it).ok_or("no such case")?;
    let found = case_figures(case, 0..1, false)?;
    assert!(found.lag_found_s.is_some_and(|lag_s| (lag_s - 8e-3).abs() < 1e-3), "{found:?}");
    assert_eq!(found.tellable, found.told, "{found:?}");
    Ok(())
}

/// Noise of the positions of 1e-3 rad: a step of 0.015 rad/s looked dry at a joint (6.7 times the error with the laws
/// stated), and terms that nobody has made up for a smeared one (3.6 times). Two recordings make a factor of two by
/// chance; constants that have to be found as well cost something.
#[test]
fn noise_of_the_positions_does_not_spoil_friction() -> Result<(), Box<dyn Error>> {
    let is_it = |case: &&&DefaultCase| case.noise.position_rad >= 1e-3 && case.motion.duration_s <= 10.0;
    for case in DEFAULT_CASES.iter().filter(|case| is_it(&case)) {
        let found = case_figures(case, 0..2, false)?;
        assert!(found.over_laws_stated() < 2.5, "{}: {found:?}", case.label());
        assert_eq!(found.tellable, found.told, "{found:?}");
    }
    Ok(())
}

/// Estimators that need a motion that repeats were refused in all cases, because it stood still after its first period.
#[test]
fn estimators_of_repeated_motion_are_given_one() -> Result<(), Box<dyn Error>> {
    let is_it = |case: &&DefaultCase| case.robot.name == "planar 2R" && case.friction.name() == "asymmetric";
    let case = DEFAULT_CASES.iter().find(is_it).ok_or("no such case")?;
    let found = case_figures(case, 0..1, true)?;
    let settled = |estimator: NamedEstimator| {
        let place = NamedEstimator::ALL.iter().position(|one| *one == estimator);
        place.and_then(|place| found.by_name[place]).is_some_and(|named| named.settled == 1)
    };
    assert!(settled(NamedEstimator::MaximumLikelihood), "{found:?}");
    assert!(settled(NamedEstimator::SimultaneousSeries), "{found:?}");
    Ok(())
}
