//! Colours and motions of the robot in the report of an identification.

use super::robot::{RobotAppearance, ellipsoid};
use crate::result::{BodyResult, DescriptionComparison, ResultFile, ValueSource};
use dynident_estimation::HALF_WIDTH_95;
use dynident_identification::Role;
use dynident_identification::examination::LogTrace;
use dynident_report::{Colouring, Gauge, Scene, SceneMotion, short};

/// Indices of colours in the page's palette.
const BLUE: usize = 0;
const ORANGE: usize = 1;
const GREEN: usize = 2;
const YELLOW: usize = 4;
const VIOLET: usize = 6;

/// A body with more than this number of measured values (of ten) is shown as measured; with more nominal values, as
/// nominal.
const MOST_VALUES: usize = 5;

/// The robot of a result: how well each body is determined, its change from the description, and torque errors along
/// the logs.
pub(super) fn scene(robot: &RobotAppearance, r: &ResultFile, traces: &[LogTrace]) -> Scene {
    let mut scene = robot.scene("The robot");
    scene.is_low = true;
    let of = |name: &str| r.bodies.iter().find(|body| body.name == name);
    let bodies: Vec<Option<&BodyResult>> = scene.bodies.iter().map(|body| of(&body.name)).collect();
    for (body, result) in scene.bodies.iter_mut().zip(&bodies).skip(1) {
        let Some(result) = result else { continue };
        body.ellipsoids.extend(result.prior.as_ref().and_then(|prior| ellipsoid(prior, true)));
        body.ellipsoids.extend(ellipsoid(&result.parameters, false));
    }
    scene.colourings = vec![known(&bodies), changed(&bodies)];
    scene.colourings.extend(r.description_differences.as_ref().map(|found| differing(&bodies, found)));
    for trace in traces.iter().rev().filter(|trace| trace.motion.times_s.len() > 1) {
        scene.motions.push(motion(trace, r.common_torque_unit()));
    }
    if !scene.motions.is_empty() {
        scene.colourings.push(Colouring {
            name: "torque error along the motion".into(),
            classes: vec![("no error".into(), BLUE), ("error as large as the torque".into(), ORANGE)],
            of: vec![None; bodies.len()],
            words: vec![String::new(); bodies.len()],
            gauge: Some(1),
        });
    }
    let counts = scene.colourings[0].classes.iter().enumerate().map(|(class, (words, _))| {
        let count = scene.colourings[0].of.iter().filter(|own| **own == Some(class)).count();
        format!("{count} {words}")
    });
    scene.words = format!("{}: bodies {}", r.robot.name, counts.collect::<Vec<_>>().join(", "));
    scene
}

/// Colours for the probability that a body changed, with the lowest probability of each class.
const CHANGE_CLASSES: [(f64, &str, usize); 3] =
    [(0.5, "probably changed", ORANGE), (0.05, "possibly changed", YELLOW), (0.0, "not changed", GREEN)];

/// Colouring by the probability that each body changed, with a text for each; `None` for a body without colour.
pub(super) fn change_colouring(name: &str, bodies: &[Option<(f64, String)>]) -> Colouring {
    let class = |probability: f64| CHANGE_CLASSES.iter().position(|(least, ..)| probability >= *least);
    Colouring {
        name: name.into(),
        classes: CHANGE_CLASSES.iter().map(|(_, words, colour)| ((*words).to_owned(), *colour)).collect(),
        of: bodies.iter().map(|body| body.as_ref().and_then(|(probability, _)| class(*probability))).collect(),
        words: bodies.iter().map(|body| body.as_ref().map_or_else(String::new, |(_, words)| words.clone())).collect(),
        gauge: None,
    }
}

/// Probability that each body differs from the description, with the change of its mass.
fn differing(bodies: &[Option<&BodyResult>], found: &DescriptionComparison) -> Colouring {
    let of = |body: &BodyResult| {
        let probability = found.bodies.iter().find(|own| own.name == body.name)?.probability;
        let bar = body.std.map_or_else(String::new, |std| format!(" ± {}", short(HALF_WIDTH_95 * std[0], 2)));
        let change = body.mass_kg - body.prior?[0];
        let sign = if change < 0.0 { "" } else { "+" };
        Some((probability, format!("{:.0} %; mass {sign}{}{bar} kg", 100.0 * probability, short(change, 3))))
    };
    let bodies: Vec<_> = bodies.iter().map(|body| body.and_then(of)).collect();
    change_colouring("probability that a body differs from the description", &bodies)
}

fn known(bodies: &[Option<&BodyResult>]) -> Colouring {
    let class = |body: &BodyResult| {
        let sources = body.sources.as_ref()?;
        let count = |wanted: ValueSource| sources.iter().filter(|source| **source == wanted).count();
        let (measured, nominal) = (count(ValueSource::Measured), count(ValueSource::Nominal));
        Some(if nominal > MOST_VALUES { 2 } else { usize::from(measured <= MOST_VALUES) })
    };
    let words = |body: &BodyResult| {
        let bar = body.std.map_or_else(String::new, |std| format!(" ± {}", short(HALF_WIDTH_95 * std[0], 2)));
        let counts = body.sources.as_ref().map_or_else(String::new, |sources| {
            let count = |wanted: ValueSource| sources.iter().filter(|source| **source == wanted).count();
            format!(
                "; of ten values {} measured, {} in sums, {} of the description",
                count(ValueSource::Measured),
                count(ValueSource::Partly),
                count(ValueSource::Nominal)
            )
        });
        format!("{}{bar} kg{counts}", short(body.mass_kg, 3))
    };
    Colouring {
        name: "how well each body is known".into(),
        classes: vec![
            ("measured: most values from the logs".into(), GREEN),
            ("partly: most values only in sums with other bodies".into(), BLUE),
            ("nominal: most values of the robot description".into(), ORANGE),
        ],
        of: bodies.iter().map(|body| body.and_then(class)).collect(),
        words: bodies.iter().map(|body| body.map_or_else(String::new, words)).collect(),
        gauge: None,
    }
}

/// Colouring by the change of the mass from the description.
fn changed(bodies: &[Option<&BodyResult>]) -> Colouring {
    let percent = |body: &BodyResult| {
        let prior = body.prior.filter(|prior| prior[0] > 0.0)?;
        Some(100.0 * (body.mass_kg / prior[0] - 1.0))
    };
    let class = |body: &BodyResult| {
        Some(match percent(body)? {
            change if change.abs() <= 10.0 => 0,
            change if change > 0.0 => 1,
            _ => 2,
        })
    };
    let words = |body: &BodyResult| {
        let (Some(prior), Some(change)) = (body.prior, percent(body)) else { return "not described".to_owned() };
        format!("{} kg instead of {} kg ({change:+.0} %)", short(body.mass_kg, 3), short(prior[0], 3))
    };
    Colouring {
        name: "change of mass from the description".into(),
        classes: vec![
            ("at most 10 %".into(), GREEN),
            ("heavier than described".into(), ORANGE),
            ("lighter than described".into(), VIOLET),
        ],
        of: bodies.iter().map(|body| body.and_then(class)).collect(),
        words: bodies.iter().map(|body| body.map_or_else(String::new, words)).collect(),
        gauge: None,
    }
}

/// The motion of a log with torque and torque error. The colour range of the error is the root mean square of the
/// torque.
fn motion(trace: &LogTrace, unit: &str) -> SceneMotion {
    let (measured, predicted) = (&trace.motion.measured_nm, &trace.motion.predicted_nm);
    let error = |(measured, predicted): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
        measured.iter().zip(predicted).map(|(measured, predicted)| measured - predicted).collect()
    };
    let errors: Vec<Vec<f64>> = measured.iter().zip(predicted).map(error).collect();
    let rms = |values: &Vec<f64>| {
        let finite = values.iter().filter(|value| value.is_finite());
        let size = (finite.clone().map(|x| x * x).sum::<f64>() / finite.count().max(1) as f64).sqrt();
        (size > 0.0).then_some([-size, size])
    };
    let role = if trace.role == Role::Validate { "held out" } else { "training" };
    SceneMotion {
        name: format!("{} ({role})", trace.log),
        times_s: trace.motion.times_s.clone(),
        q: trace.motion.q.clone(),
        gauges: vec![
            Gauge { name: format!("torque, {unit}"), values: measured.clone(), limits: vec![None; measured.len()] },
            Gauge { name: format!("torque error, {unit}"), values: errors, limits: measured.iter().map(rms).collect() },
        ],
        ..SceneMotion::default()
    }
}
