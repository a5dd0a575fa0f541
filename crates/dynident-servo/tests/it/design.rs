//! Designed commands determine a simulated arm better than a chirp, and their forecast is that of a fit.

use crate::arm;
use dynident_servo::{
    CommandRange, DesignedCommands, Run, ServoDesignSettings, ServoError, ServoSettings, ServoValue, design_commands,
    search, simulate, unknowns, values,
};
use rayon::ThreadPoolBuilder;
use std::sync::atomic::{AtomicU64, Ordering};

const COUNT: f64 = core::f64::consts::TAU / 4096.0;
const RANGES: [CommandRange; 2] = [CommandRange { least: -1.5, greatest: 1.5, speed: 3.0 }; 2];

fn settings() -> ServoDesignSettings {
    ServoDesignSettings { duration_s: 24.0, candidates: 16, exchanges: 1, ..ServoDesignSettings::default() }
}

fn designed(settings: &ServoDesignSettings, is_permitted: &dyn Fn(&[Vec<f64>]) -> bool) -> DesignedCommands {
    let (robot, fit) = (arm(), ServoSettings::default());
    let parameters = unknowns(&robot, &fit);
    design_commands(&robot, &parameters, (&RANGES, &[0.3, -0.4]), (&fit, settings), is_permitted, &|_| {}).unwrap()
}

/// Geometric mean of the error bars of the commands, divided by that of the chirp, of all values that one of both
/// determines: their error bars are at most half of those before the fit.
fn ratio(found: &DesignedCommands) -> f64 {
    let pairs = found.forecast.values.iter().zip(&found.chirp.values);
    let is_determined =
        |(own, chirp): &(&ServoValue, &ServoValue)| own.std_at_scale.min(chirp.std_at_scale) < 0.5 * own.prior_std;
    let logs: Vec<f64> =
        pairs.filter(is_determined).map(|(own, chirp)| (own.std_at_scale / chirp.std_at_scale).ln()).collect();
    (logs.iter().sum::<f64>() / logs.len() as f64).exp()
}

#[test]
fn designed_commands_keep_limits_and_determine_more_than_a_chirp() {
    let fast = 3.0;
    let rate_hz = settings().rate_hz;
    let is_slow = |positions: &[Vec<f64>]| {
        positions.iter().flat_map(|joint| joint.windows(2)).all(|pair| (pair[1] - pair[0]).abs() * rate_hz < fast)
    };
    let effort = ServoDesignSettings { candidates: 40, exchanges: 2, ..settings() };
    let found = designed(&effort, &is_slow);
    assert!(found.is_permitted && is_slow(&found.positions));
    assert_eq!(found.times_s.len(), 1200);
    for (joint, commands) in found.commands.iter().enumerate() {
        assert!(commands.iter().all(|command| (-1.5..=1.5).contains(command)));
        // It ends where it began.
        assert_eq!((commands[0], commands[1199]), ([0.3, -0.4][joint], [0.3, -0.4][joint]));
    }
    assert!(found.forecast.log_det > found.chirp.log_det);
    assert!(ratio(&found) < 0.8, "{}", ratio(&found));
}

/// With errors of the encoder alone, the forecast equals the error bars of a fit to a simulated log.
#[test]
fn the_forecast_is_that_of_a_fit() {
    let rounding = COUNT / 12.0_f64.sqrt();
    let known = ServoDesignSettings { error: rounding, correlation_s: 0.0, exchanges: 0, ..settings() };
    let found = designed(&known, &|_| true);
    let robot = arm();
    let fit = ServoSettings { least_error: 1e-9, ..ServoSettings::default() };
    let mut run = Run {
        name: "designed".to_owned(),
        times_s: found.times_s.clone(),
        positions: found.positions.clone(),
        commands: found.commands.clone(),
        payloads: Vec::new(),
        gains: Vec::new(),
    };
    let positions = simulate(&robot, &run, fit.step_s).unwrap().unwrap();
    run.positions = positions.iter().map(|q| q.iter().map(|q| (q / COUNT).round() * COUNT).collect()).collect();
    run.positions.iter_mut().zip([0.3, -0.4]).for_each(|(q, start)| q[0] = start);
    let parameters = unknowns(&robot, &fit);
    let end = search(&robot, &parameters, &vec![0.0; parameters.len()], &[run], &fit).unwrap();
    let (fitted, _) = values(&robot, &parameters, &end).unwrap();
    let mut logs: Vec<f64> = found
        .forecast
        .values
        .iter()
        .zip(&fitted)
        .map(|(forecast, fitted)| (fitted.std_at_scale / forecast.std_at_scale).ln())
        .collect();
    logs.sort_by(f64::total_cmp);
    // The fit estimates correlation from 12 periods, so single bars scatter.
    let median = logs[logs.len() / 2].exp();
    assert!((0.5..2.0).contains(&median), "{median}");
}

#[test]
fn the_design_does_not_depend_on_threads_and_reports_each_candidate() {
    let small = ServoDesignSettings { duration_s: 12.0, candidates: 6, ..settings() };
    let (robot, fit) = (arm(), ServoSettings::default());
    let parameters = unknowns(&robot, &fit);
    let made = [1, 3].map(|threads| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let done = AtomicU64::new(0);
        let advance = |count| {
            done.fetch_add(count, Ordering::Relaxed);
        };
        // A permitted motion is checked on the thread of the caller.
        let found = pool.install(|| {
            let start: &[f64] = &[0.3, -0.4];
            design_commands(&robot, &parameters, (&RANGES, start), (&fit, &small), &|_| true, &advance).unwrap()
        });
        assert_eq!(done.into_inner() as usize, small.evaluations());
        found.commands
    });
    assert_eq!(made[0], made[1]);
    let other = ServoDesignSettings { seed: 2, ..small };
    let start: &[f64] = &[0.3, -0.4];
    let found = design_commands(&robot, &parameters, (&RANGES, start), (&fit, &other), &|_| true, &|_| {}).unwrap();
    assert_ne!(found.commands, made[0]);
}

#[test]
fn impossible_designs_are_refused() {
    let (robot, fit) = (arm(), ServoSettings::default());
    let parameters = unknowns(&robot, &fit);
    let made = |settings: &ServoDesignSettings, check: &dyn Fn(&[Vec<f64>]) -> bool| {
        let start: &[f64] = &[0.3, -0.4];
        design_commands(&robot, &parameters, (&RANGES, start), (&fit, settings), check, &|_| {}).unwrap_err()
    };
    let small = ServoDesignSettings { duration_s: 6.0, candidates: 2, ..settings() };
    assert!(matches!(made(&small, &|_| false), ServoError::NoMotion { .. }));
    let invalid = [
        ServoDesignSettings { duration_s: f64::NAN, ..settings() },
        ServoDesignSettings { segment_s: 0.1, ..settings() },
        ServoDesignSettings { highest_hz: 30.0, ..settings() },
        ServoDesignSettings { candidates: 0, ..settings() },
        ServoDesignSettings { error: 0.0, ..settings() },
    ];
    for settings in invalid {
        assert!(matches!(made(&settings, &|_| true), ServoError::DesignSetting { .. }), "{settings:?}");
    }
}
