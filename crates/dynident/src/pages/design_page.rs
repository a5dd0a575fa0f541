//! `report.html` of a design.

use super::robot::RobotAppearance;
use super::unit;
use crate::error::Error;
use crate::result::{DesignFile, ParameterForecast};
use dynident_estimation::HALF_WIDTH_95;
use dynident_excitation::Motion;
use dynident_excitation::limits::{JointLimit, LimitError, Limits, PairDistance, arm_length_m};
use dynident_model::Model;
use dynident_report::{
    BodyPair, Cell, Gauge, Heading, KeyFigures, LinePlot, Report, Scene, SceneMotion, Table, Text, Tone, short,
};

/// Maximum number of samples of the animated motion; the animation interpolates.
const MAX_SAMPLES: usize = 1500;

/// Number of pairs of links whose distance is shown.
const MAX_PAIRS: usize = 5;

/// Two links are near if their distance exceeds the minimum one by less than this, as a share of the arm's length.
const NEAR_SHARE: f64 = 0.1;

/// Percentage of a limit above which it is marked as nearly reached.
const NEARLY_REACHED_PERCENT: f64 = 95.0;

/// Times and samples of a designed motion with its torque (if known), Nm (N).
pub(crate) struct SampledDesign<'a> {
    pub(crate) times_s: &'a [f64],
    pub(crate) motion: &'a Motion,
    pub(crate) torque: Option<&'a [f64]>,
    /// The result of [`closest_pairs`].
    pub(crate) pairs: &'a [PairDistance],
}

/// Writes the page of a design: verdict, an animation of the robot with its limits, use of limits, forecast of the
/// error bars, curves of each joint.
///
/// # Errors
/// [`Error::Report`], which indicates a bug.
pub(crate) fn design_page(
    d: &DesignFile,
    limits: &Limits,
    robot: &RobotAppearance,
    sampled: &SampledDesign<'_>,
) -> Result<String, Error> {
    let mut page = Report::new(&d.name).subtitle(format!(
        "motion for identification: {} joints, {} base parameters, {}, {} s, {}",
        d.joints.len(),
        d.base_columns,
        d.family,
        short(d.duration_s, 4),
        d.criterion
    ));
    page.add(verdict(d));
    page.add(key_figures(d));
    page.add(scene(d, limits, robot, sampled));
    page.add(Heading::new("Limits"));
    page.add(limit_table(d));
    page.add(Heading::new("Forecast"));
    page.add(forecast(d));
    page.add(Heading::new("Motion"));
    curves(&mut page, d, limits, sampled);
    if !sampled.pairs.is_empty() {
        page.add(distances(sampled));
    }
    Ok(page.html()?)
}

fn verdict(d: &DesignFile) -> Text {
    let mut text = if d.feasible {
        Text::new("The motion keeps every limit that is known.")
            .point(Tone::Good, format!("checked at {} kHz", short(d.check_rate_hz / 1000.0, 3)))
    } else {
        Text::new("The motion breaks limits: do not run it.")
    };
    for sentence in &d.diagnosis {
        text = text.point(Tone::Bad, sentence);
    }
    for sentence in &d.not_checked {
        text = text.point(Tone::Warning, format!("not checked: {sentence}"));
    }
    for sentence in &d.assumed {
        text = text.point(Tone::Plain, format!("assumed: {sentence}"));
    }
    for note in &d.notes {
        text = text.point(Tone::Plain, note);
    }
    text
}

fn key_figures(d: &DesignFile) -> KeyFigures {
    let unexcited = d.forecast.iter().filter(|parameter| parameter.std.is_none()).count();
    let largest = d.limits.iter().max_by(|a, b| a.worst_ratio.total_cmp(&b.worst_ratio));
    let used = largest.map_or_else(|| "–".to_owned(), |limit| format!("{} %", short(100.0 * limit.worst_ratio, 3)));
    let of = largest
        .map_or_else(String::new, |limit| format!("{} of {} at {} s", limit.kind, limit.joint, short(limit.at_s, 4)));
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| short(value, 3));
    KeyFigures::new()
        .judged("most used limit", used, of, if d.feasible { Tone::Good } else { Tone::Bad })
        .judged(
            "parameters that the motion determines",
            format!("{} of {}", d.forecast.len() - unexcited, d.forecast.len()),
            "",
            if unexcited == 0 { Tone::Good } else { Tone::Warning },
        )
        .figure("condition number", number(d.condition_number_scaled), "columns of unit length")
        .figure("duration", format!("{} s", short(d.duration_s, 4)), "")
}

/// Interval, in samples, between the samples of a motion that the animation contains.
fn step_of(motion: &Motion) -> usize {
    motion.samples.div_ceil(MAX_SAMPLES).max(1)
}

/// The pairs of links that come closest to their minimum distance, closest first.
///
/// # Errors
/// Invalid limits.
pub(crate) fn closest_pairs(limits: &Limits, model: &Model, motion: &Motion) -> Result<Vec<PairDistance>, LimitError> {
    let Some(limit) = &limits.self_collision else { return Ok(Vec::new()) };
    let mut pairs = limit.distances(model, motion, step_of(motion))?;
    pairs.sort_by(|a, b| (a.smallest_m() - a.clearance_m).total_cmp(&(b.smallest_m() - b.clearance_m)));
    pairs.truncate(MAX_PAIRS);
    Ok(pairs)
}

fn body_pair(pair: &PairDistance, robot: &RobotAppearance) -> BodyPair {
    BodyPair {
        name: pair.links.join(" and "),
        clearance_m: pair.clearance_m,
        near_m: pair.clearance_m + NEAR_SHARE * arm_length_m(robot.model()),
        distance_m: pair.distance_m.clone(),
        points_m: pair.points_m.clone(),
    }
}

fn scene(d: &DesignFile, limits: &Limits, robot: &RobotAppearance, sampled: &SampledDesign<'_>) -> Scene {
    let mut scene = robot.scene("The motion");
    let motion = sampled.motion;
    let step = step_of(motion);
    let kept = |values: &[f64]| values.iter().copied().step_by(step).collect::<Vec<f64>>();
    let of_joints =
        |values: &[f64]| (0..motion.joints).map(|joint| kept(&values[motion.of(joint)])).collect::<Vec<_>>();
    let none = JointLimit::default();
    let of = |name: &String| limits.of(name).unwrap_or(&none).clone();
    let symmetric = |value: Option<f64>| value.map(|value| [-value, value]);
    let gauge = |name: &str, values: &[f64], limit: &dyn Fn(JointLimit) -> Option<[f64; 2]>| Gauge {
        name: name.to_owned(),
        values: of_joints(values),
        limits: d.joints.iter().map(|joint| limit(of(joint))).collect(),
    };
    let mut gauges = vec![
        gauge("position, rad (m)", &motion.q, &|limit| limit.position),
        gauge("speed, rad/s (m/s)", &motion.dq, &|limit| symmetric(limit.speed)),
    ];
    if let Some(torque) = sampled.torque {
        gauges.push(gauge("torque, Nm (N)", torque, &|limit| {
            symmetric(limit.torque.map(|torque| torque * (1.0 - limit.torque_margin)))
        }));
    }
    scene.posture = (0..motion.joints).filter_map(|joint| motion.q[motion.of(joint)].first().copied()).collect();
    robot.place(&mut scene);
    scene.motions = vec![SceneMotion {
        name: "design".into(),
        times_s: kept(sampled.times_s),
        q: of_joints(&motion.q),
        gauges,
        pairs: sampled.pairs.iter().map(|pair| body_pair(pair, robot)).collect(),
        ..SceneMotion::default()
    }];
    scene.floor_m = limits.floor.as_ref().map(|floor| floor.height_m);
    scene.column_m = limits.column.as_ref().map(|column| [column.axis_xy_m[0], column.axis_xy_m[1], column.radius_m]);
    let open = |range: Option<[f64; 2]>| range.map_or([None; 2], |ends| ends.map(Some));
    scene.boxes_m = limits.boxes.iter().map(|own| [open(own.x_m), open(own.y_m), open(own.z_m)]).collect();
    scene.words = format!("the arm of {} joints at the start of the motion", d.joints.len());
    scene
}

/// Distances of the closest links over time.
fn distances(sampled: &SampledDesign<'_>) -> LinePlot {
    let pairs = sampled.pairs;
    let times_s: Vec<f64> = sampled.times_s.iter().copied().step_by(step_of(sampled.motion)).collect();
    let samples = times_s.len();
    let mut clearances: Vec<f64> = pairs.iter().map(|pair| pair.clearance_m).collect();
    clearances.sort_by(f64::total_cmp);
    clearances.dedup();
    let plot = LinePlot::new("Distances of links", "t, s", "distance, m", times_s)
        .note("the pairs of links that come closest, between their surfaces");
    let plot = pairs.iter().fold(plot, |plot, pair| plot.line(pair.links.join(" and "), pair.distance_m.clone()));
    clearances.into_iter().fold(plot, |plot, clearance| {
        plot.dashed(format!("at least {} m", short(clearance, 3)), vec![clearance; samples])
    })
}

fn limit_table(d: &DesignFile) -> Table {
    let mut limits: Vec<_> = d.limits.iter().collect();
    limits.sort_by(|a, b| b.worst_ratio.total_cmp(&a.worst_ratio));
    let rows = limits.into_iter().map(|limit| {
        let percent = 100.0 * limit.worst_ratio;
        let tone = match () {
            () if limit.violated => Tone::Bad,
            () if percent > NEARLY_REACHED_PERCENT => Tone::Warning,
            () => Tone::Plain,
        };
        vec![
            Cell::from(limit.kind.to_string()),
            Cell::from(&limit.joint),
            Cell::judged(short(percent, 4), tone),
            short(limit.at_s, 4).into(),
        ]
    });
    Table::new("Use of each limit", ["limit", "of", "used, %", "at, s"]).note("100 % is on the limit").rows(rows)
}

fn forecast(d: &DesignFile) -> Table {
    let number = |value: Option<f64>| Cell::from(value.map_or_else(String::new, |value| short(value, 3)));
    let bar = |value: Option<f64>| number(value.map(|std| HALF_WIDTH_95 * std));
    let row = |p: &ParameterForecast| {
        let relative = p.relative_std_percent.map(|percent| HALF_WIDTH_95 * percent);
        let tone = if relative.is_some_and(|relative| relative > 30.0) { Tone::Warning } else { Tone::Plain };
        vec![
            Cell::from(&p.expression),
            if p.std.is_none() { Cell::judged("not excited", Tone::Bad) } else { bar(p.std) },
            Cell::judged(relative.map_or_else(String::new, |value| short(value, 3)), tone),
            bar(p.std_with_prior),
            number(p.prior),
            Cell::from(unit(&p.unit)),
        ]
    };
    Table::new(
        "Expected error bars",
        ["base parameter", "± (95 %)", "± in %", "± with prior", "robot description", "unit"],
    )
    .note("for torque noise without correlation in time, as stated in the study; relative to the robot description")
    .rows(d.forecast.iter().map(row))
}

fn curves(page: &mut Report, d: &DesignFile, limits: &Limits, sampled: &SampledDesign<'_>) {
    let SampledDesign { times_s, motion, torque, .. } = *sampled;
    let none = JointLimit::default();
    for (joint, name) in d.joints.iter().enumerate() {
        let limit = limits.of(name).unwrap_or(&none);
        let symmetric = |value: Option<f64>| value.map(|value| [-value, value]);
        let all = [
            ("position", "rad (m)", Some(&motion.q[..]), limit.position),
            ("speed", "rad/s (m/s)", Some(&motion.dq[..]), symmetric(limit.speed)),
            ("torque", "Nm (N)", torque, symmetric(limit.torque.map(|torque| torque * (1.0 - limit.torque_margin)))),
        ];
        for (what, unit, values, ends) in all {
            let Some(values) = values else { continue };
            let mut plot =
                LinePlot::new(format!("{name}: {what}"), "t, s", format!("{what}, {unit}"), times_s.to_vec())
                    .of_joint(name)
                    .line(what, values[motion.of(joint)].to_vec());
            for (end, limit) in ["lower limit", "upper limit"].into_iter().zip(ends.into_iter().flatten()) {
                plot = plot.dashed(end, vec![limit; times_s.len()]);
            }
            page.add(plot);
        }
    }
}
