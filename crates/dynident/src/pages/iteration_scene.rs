//! The robot on the page of an iteration: measured motion of the first and the last run; the desired motion is drawn
//! as a pale arm.

use super::robot::RobotAppearance;
use super::run_trace::RunTrace;
use dynident_report::{Colouring, Gauge, HeatMap, Scene, SceneMotion};

/// Maximum number of samples of an animated run; the animation interpolates.
const MAX_SAMPLES: usize = 1000;
/// Number of parts of a motion in the plot of the tracking error by posture.
const PARTS: usize = 24;
/// Maximum number of runs in the plot of the tracking error by posture.
const MAX_RUNS: usize = 30;
/// Indices of the colours for zero error and for the largest error.
const BLUE: usize = 0;
const ORANGE: usize = 1;

/// The robot with the first and the last run of each trajectory. Its joints are coloured by their tracking error
/// relative to the largest error of all runs, so that the colours of two runs can be compared.
pub(super) fn scene(robot: &RobotAppearance, traces: &[RunTrace]) -> Option<Scene> {
    let mut scene = robot.scene("The robot, desired and measured");
    let shown = first_and_last(traces);
    scene.motions = shown.into_iter().filter_map(|trace| played(trace, traces)).collect();
    let start = scene.motions.first()?.q.iter().filter_map(|q| q.first().copied()).collect::<Vec<f64>>();
    if start.len() != scene.joints.len() {
        return None;
    }
    scene.posture = start;
    robot.place(&mut scene);
    let bodies = scene.bodies.len();
    scene.colourings = vec![Colouring {
        name: "tracking error along the motion".into(),
        classes: vec![("no error".into(), BLUE), ("largest error of all runs".into(), ORANGE)],
        of: vec![None; bodies],
        words: vec![String::new(); bodies],
        gauge: Some(0),
    }];
    scene.words = format!("the arm at the start of the motion; {} runs can be played", scene.motions.len());
    scene.note = "solid: measured; pale: desired".into();
    Some(scene)
}

/// Traces of the last and the first run of each trajectory.
fn first_and_last(traces: &[RunTrace]) -> Vec<&RunTrace> {
    let mut legs: Vec<Option<usize>> = traces.iter().map(|trace| trace.name.leg).collect();
    legs.sort_unstable();
    legs.dedup();
    let ends = legs.into_iter().flat_map(|leg| {
        let mut own = traces.iter().filter(move |trace| trace.name.leg == leg);
        let first = own.next();
        [own.next_back(), first]
    });
    ends.flatten().collect()
}

/// The recorded part of a run, for the animation; `None` without samples.
fn played(trace: &RunTrace, all: &[RunTrace]) -> Option<SceneMotion> {
    let recorded = trace.error.iter().map(|error| error.iter().take_while(|error| error.is_finite()).count());
    let samples = recorded.min().filter(|samples| *samples > 1)?;
    let step = samples.div_ceil(MAX_SAMPLES).max(1);
    let kept = |values: &[f64]| values[..samples].iter().copied().step_by(step).collect::<Vec<f64>>();
    let each = |lists: &[Vec<f64>]| lists.iter().map(|values| kept(values)).collect::<Vec<_>>();
    let measured: Vec<Vec<f64>> = trace
        .desired
        .iter()
        .zip(&trace.error)
        .map(|(desired, error)| desired.iter().zip(error).map(|(desired, error)| desired - error).collect())
        .collect();
    let largest = |joint: usize| {
        let errors = all.iter().filter_map(|trace| trace.error.get(joint)).flatten();
        let most = errors.filter(|error| error.is_finite()).fold(0.0_f64, |most, error| most.max(error.abs()));
        (most > 0.0).then_some([-most, most])
    };
    let gauges = vec![Gauge {
        name: "tracking error, rad (m)".into(),
        values: each(&trace.error),
        limits: (0..trace.error.len()).map(largest).collect(),
    }];
    let name = trace.name.leg.map_or_else(String::new, |leg| format!(", leg {leg}"));
    Some(SceneMotion {
        name: format!("run {}{name}", trace.name.run),
        times_s: kept(&trace.times_s),
        q: each(&measured),
        ghost: each(&trace.desired),
        gauges,
        pairs: Vec::new(),
    })
}

/// Largest tracking error of all joints in each part of the motion, run by run, for the runs of one trajectory.
pub(super) fn by_posture(traces: &[&RunTrace], title: String) -> Option<HeatMap> {
    let runs = &traces[..traces.len().min(MAX_RUNS)];
    let end_s = runs.first()?.times_s.last().copied().filter(|end| *end > 0.0)?;
    let worst = |trace: &RunTrace, part: usize| {
        let [from, to] = [part, part + 1].map(|edge| edge as f64 / PARTS as f64 * end_s);
        let inside = |time: f64| time >= from && time <= to;
        let errors = trace.error.iter().flat_map(|error| trace.times_s.iter().zip(error));
        let own = errors.filter(|(time, error)| inside(**time) && error.is_finite());
        own.map(|(_, error)| error.abs()).reduce(f64::max)
    };
    let values: Vec<Vec<Option<f64>>> =
        runs.iter().map(|trace| (0..PARTS).map(|part| worst(trace, part)).collect()).collect();
    let largest = values.iter().flatten().flatten().copied().fold(0.0_f64, f64::max);
    let order =
        |error: &Option<f64>| error.filter(|error| *error > 0.0).map_or(f64::NAN, |error| (error / largest).log10());
    let values = values.iter().map(|run| run.iter().map(order).collect()).collect();
    let middles = (0..PARTS).map(|part| format!("{:.1} s", (part as f64 + 0.5) / PARTS as f64 * end_s));
    let names = runs.iter().map(|trace| format!("run {}", trace.name.run));
    Some(HeatMap::new(title, names, middles, values).note(
        "power of ten of the largest error of all joints relative to the largest error of all runs, in each part of the \
         motion: -2 is a hundredth of it",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pages::run_trace::RunName;

    fn trace(run: usize, leg: Option<usize>, error: f64) -> RunTrace {
        let times_s: Vec<f64> = (0..5000).map(|k| f64::from(k) * 0.01).collect();
        let mut errors: Vec<f64> = times_s.iter().map(|time| error * time).collect();
        errors[4000..].fill(f64::NAN);
        RunTrace {
            name: RunName { run, leg, place: 0 },
            desired: vec![times_s.iter().map(|time| time.sin()).collect()],
            error: vec![errors],
            times_s,
        }
    }

    #[test]
    fn a_run_is_played_to_its_end_with_the_limits_of_all_runs() {
        let traces = [trace(1, None, 1e-2), trace(2, None, 1e-3), trace(3, None, 1e-4)];
        assert_eq!(first_and_last(&traces).iter().map(|own| own.name.run).collect::<Vec<_>>(), [3, 1]);
        let motion = played(&traces[2], &traces).unwrap();
        assert!(motion.times_s.len() <= MAX_SAMPLES && *motion.times_s.last().unwrap() < 40.0);
        let at = motion.times_s.len() - 1;
        let time = motion.times_s[at];
        assert!((motion.ghost[0][at] - motion.q[0][at] - 1e-4 * time).abs() < 1e-12);
        let [low, high] = motion.gauges[0].limits[0].unwrap();
        assert!((high - 1e-2 * 39.99).abs() < 1e-12 && low == -high);
        let none = RunTrace { error: vec![vec![f64::NAN; 5000]], ..trace(1, None, 0.0) };
        assert!(played(&none, &traces).is_none());
    }

    #[test]
    fn errors_by_posture_are_powers_of_ten_of_the_largest() {
        let traces = [trace(1, None, 1e-2), trace(2, None, 1e-4)];
        let map = by_posture(&traces.iter().collect::<Vec<_>>(), "t".into()).unwrap();
        let largest = 1e-2 * 39.99_f64;
        // The first of 24 parts ends at 2.083 s.
        assert!((map.values[1][0] - (1e-4 * 2.08 / largest).log10()).abs() < 1e-9, "{}", map.values[1][0]);
        assert!(map.values[0][23].is_nan() && map.values.len() == 2);
        assert!(by_posture(&[], "t".into()).is_none());
    }
}
