//! Comparison of the defaults with the best possible choice: uses the real defaults, and does not depend on the number
//! of threads.

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

/// The experiment must use the defaults of a study.
#[test]
fn default_equals_a_study_of_files_and_columns_only() -> Result<(), Box<dyn Error>> {
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

/// The fastest case, a planar arm. The best possible fit cannot be much worse than the default (except for the
/// sampling error of two recordings). Lag estimation must not make a fit worse than plain least squares. The friction
/// step is passed within two samples, so its width is hard to determine; sampling error of two recordings: a factor of
/// two.
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
    // Missed goals are reported.
    assert!(goals(&[one]).iter().any(|goal| goal.ends_with("MISSED")));
    Ok(())
}

/// A lag of 8 ms at all joints and Stribeck friction: friction that is selected before the lag is compensated would
/// absorb part of it, with different lags per joint. So the common lag is compensated first; its error is some tenths
/// of a millisecond.
#[test]
fn common_lag_and_friction_law_are_found_together() -> Result<(), Box<dyn Error>> {
    let is_it =
        |case: &&DefaultCase| case.robot.name == "UR10" && case.friction.name() == "Stribeck" && case.lag_s == 8e-3;
    let case = DEFAULT_CASES.iter().find(is_it).ok_or("no such case")?;
    let found = case_figures(case, 0..1, false)?;
    assert!(found.lag_found_s.is_some_and(|lag_s| (lag_s - 8e-3).abs() < 1e-3), "{found:?}");
    assert_eq!(found.tellable, found.told, "{found:?}");
    Ok(())
}

/// Position noise of 1e-3 rad: a step of 0.015 rad/s must not be mistaken for a discontinuous one, or a smeared step
/// for additional terms. Sampling error of two recordings: a factor of two; estimated constants add some error.
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

/// The motion must repeat after its first period, for estimators of periodic motion.
#[test]
fn estimators_for_repeated_motion_receive_it() -> Result<(), Box<dyn Error>> {
    let is_it = |case: &&DefaultCase| case.robot.name == "planar 2R" && case.friction.name() == "asymmetric";
    let case = DEFAULT_CASES.iter().find(is_it).ok_or("no such case")?;
    let found = case_figures(case, 0..1, true)?;
    let settled = |estimator: NamedEstimator| {
        let place = NamedEstimator::ALL.iter().position(|one| *one == estimator);
        place.and_then(|place| found.by_name[place]).is_some_and(|named| named.settled == 1)
    };
    assert!(settled(NamedEstimator::SimultaneousSeries), "{found:?}");
    Ok(())
}
