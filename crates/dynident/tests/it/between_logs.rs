//! Error bars that are valid on another day: they include the variation between logs.
use crate::common::{Job, Motion, Random, Truth, format, header, repository, write_log};

/// Mean χ² per friction parameter of a fit to three logs, evaluated on a fourth day, and the detected difference
/// between logs; the friction of each log deviates from its mean by `spread` (relative standard deviation).
fn of_another_day(spread: f64, runs: u64) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("examples/robots/paper_2r.toml");
    let mean = Truth::near(&description, 0.3, false);
    let logs: Vec<String> = (0..3).map(|log| format!("{{ file = \"{log}.csv\" }}")).collect();
    let study = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{}]\nestimator.physical = false\n\
         parallel_filter.factor = 2\n{}",
        description.display().to_string(),
        logs.join(", "),
        format(2).replace("[motion]", "[motion]\ntorque_lag_s = 0.0")
    );
    let job = Job::new(folder.path(), &study);
    let robot = job.robot();
    let mut random = Random(11);
    let (mut squares, mut count, mut differing) = (0.0, 0_usize, 0.0);
    for run in 0..runs {
        let mut day = || {
            let mut truth = mean.clone();
            let viscous_coulomb_offset = truth.drive.iter_mut().flat_map(|drive| &mut drive[1..]);
            viscous_coulomb_offset.for_each(|value| *value *= 1.0 + spread * random.normal());
            truth
        };
        let days: Vec<Truth> = (0..3).map(|_| day()).collect();
        let another = day().base_values(&robot);
        for (log, truth) in days.iter().enumerate() {
            let path = folder.path().join(format!("{log}.csv"));
            let motion = Motion::new(2, 10 * run + log as u64);
            write_log(&path, truth, &motion, (100.0, 30.0), &header(2), |q, tau| {
                let noisy = tau.iter().map(|tau| tau + 0.3 * random.normal());
                q.iter().copied().chain(noisy).collect()
            });
        }
        let result = job.identify().result;
        let mut largest = Vec::new();
        for own in result.base_parameters.iter().filter(|own| !own.error_terms.is_empty()) {
            let terms = own.error_terms.iter().filter(|term| term.name() != "nominal values");
            let variance: f64 = terms.map(|term| term.std * term.std).sum();
            assert!((variance.sqrt() - own.std).abs() <= 1e-9 * own.std, "run {run}: {own:?}");
            largest.extend(own.largest_error().map(|(term, _)| term.name()));
        }
        assert!(spread == 0.0 || largest.contains(&"differences between logs"), "run {run}: {largest:?}");
        // The drives have no inertia, and friction that varies daily must not be mistaken for it.
        let drives = result.drive_inertia_choice.as_ref().unwrap();
        assert!(!drives.seen && drives.standard_deviations.is_some(), "run {run}: {}", drives.sentence());
        differing += result.method.between_logs.unwrap().friction.unwrap() / runs as f64;
        for (found, truth) in result.base_parameters.iter().zip(&another) {
            if ["fv", "fc", "off"].iter().any(|symbol| found.expression.starts_with(symbol)) {
                squares += ((found.value - truth) / found.std).powi(2);
                count += 1;
            }
        }
    }
    (squares / count as f64, differing)
}

#[test]
fn friction_of_another_day_is_inside_its_bars() {
    // About 80 squares with a factor k from 18 differences each: the mean is 1 within about 0.3; a k that is too small
    // by chance increases it.
    let (chi_square, differing) = of_another_day(0.1, 14);
    assert!((0.6..=1.8).contains(&chi_square) && differing > 2.0, "{chi_square} {differing}");
    // With constant friction, k is 1 within chance and the error bars include only noise.
    let (chi_square, differing) = of_another_day(0.0, 8);
    assert!((0.4..=1.5).contains(&chi_square) && (0.7..=1.3).contains(&differing), "{chi_square} {differing}");
}
