//! A picture of the motion: per joint position, speed, acceleration and torque over time, limits dashed.

use super::svg::escaped;
use super::{ExportError, Sampled};
use crate::limits::{JointLimit, Limits};
use core::fmt::Write;

/// Width and height of one plot, and what stands around them, px.
const PLOT: [f64; 2] = [230.0, 84.0];
const GAP: [f64; 2] = [62.0, 22.0];
const LEFT: f64 = 62.0;
const TOP: f64 = 64.0;

/// A limit is drawn if it lies within so many times the span of the curve; else the curve would be a flat line.
const LIMIT_WITHIN: f64 = 4.0;

/// Most points of one curve: more than pixels tell nothing.
const MOST_POINTS: usize = 600;

/// What a picture shows beside the motion.
#[derive(Clone, Copy, Debug)]
pub struct Preview<'a> {
    /// The headline.
    pub title: &'a str,
    /// The limits in force.
    pub limits: &'a Limits,
    /// Torque, joint-major as the motion, Nm (N); none if it is not known.
    pub torque_nm: Option<&'a [f64]>,
}

/// An SVG picture, joints from top to bottom, q, q̇, q̈ and τ from left to right. A limit that is out of the picture is named in its corner.
///
/// # Errors
/// Names, times, motion and torque that do not belong together, and numbers that are not finite.
pub fn preview_svg(sampled: &Sampled<'_>, preview: &Preview<'_>) -> Result<String, ExportError> {
    sampled.check()?;
    let samples = sampled.motion.samples;
    let torque = preview.torque_nm.unwrap_or(&[]);
    let expected = sampled.joints.len() * samples;
    if preview.torque_nm.is_some() && torque.len() != expected {
        return Err(ExportError::Shape { what: "torques", expected, found: torque.len() });
    }
    let quantities = if preview.torque_nm.is_some() { 4 } else { 3 };
    let width = LEFT + f64::from(quantities) * (PLOT[0] + GAP[0]);
    let height = TOP + sampled.joints.len() as f64 * (PLOT[1] + GAP[1]) + 24.0;
    // Writing to a string cannot fail, here and below.
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"10\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"{LEFT}\" y=\"20\" font-size=\"14\">{}</text>\n",
        escaped(preview.title)
    );
    for (quantity, title) in ["position", "speed", "acceleration", "torque"][..quantities as usize].iter().enumerate() {
        let x = LEFT + quantity as f64 * (PLOT[0] + GAP[0]);
        let _ = writeln!(text, "<text x=\"{x}\" y=\"38\" font-size=\"12\" fill=\"#444\">{title} (SI)</text>");
    }
    let motion = sampled.motion;
    for (joint, name) in sampled.joints.iter().enumerate() {
        let y = TOP + joint as f64 * (PLOT[1] + GAP[1]);
        let _ = writeln!(text, "<text x=\"{LEFT}\" y=\"{}\" font-weight=\"bold\">{}</text>", y - 5.0, escaped(name));
        let none = JointLimit::default();
        let limit = preview.limits.of(name).unwrap_or(&none);
        let symmetric = |value: Option<f64>| value.map(|value| [-value, value]);
        let bands = [
            limit.position,
            symmetric(limit.speed),
            symmetric(limit.acceleration),
            symmetric(limit.torque.map(|torque| torque * (1.0 - limit.torque_margin))),
        ];
        let curves = [&motion.q[..], &motion.dq, &motion.ddq, torque];
        for (quantity, (band, curve)) in bands.into_iter().zip(curves).take(quantities as usize).enumerate() {
            let at = [LEFT + quantity as f64 * (PLOT[0] + GAP[0]), y];
            plot(&mut text, at, sampled.times_s, &curve[joint * samples..][..samples], band);
        }
    }
    let bottom = height - 8.0;
    let (first, last) = (sampled.times_s.first().unwrap_or(&0.0), sampled.times_s.last().unwrap_or(&0.0));
    let _ = writeln!(
        text,
        "<text x=\"{LEFT}\" y=\"{bottom}\" fill=\"#444\">time {first:.2} to {last:.2} s; dashed: limits</text>\n</svg>"
    );
    Ok(text)
}

/// One curve with its limits and the ends of its scale.
fn plot(text: &mut String, [left, top]: [f64; 2], times: &[f64], values: &[f64], band: Option<[f64; 2]>) {
    let [width, height] = PLOT;
    let (mut lower, mut upper) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    if values.is_empty() {
        (lower, upper) = (0.0, 0.0);
    }
    let span = (upper - lower).max(1e-9);
    let near = |limit: f64| (limit - lower).abs().min((limit - upper).abs()) <= LIMIT_WITHIN * span;
    let (mut drawn, mut beyond) = (Vec::new(), Vec::new());
    for limit in band.into_iter().flatten() {
        if near(limit) { drawn.push(limit) } else { beyond.push(format!("{limit:.3}")) }
    }
    for limit in &drawn {
        (lower, upper) = (lower.min(*limit), upper.max(*limit));
    }
    let margin = 0.06 * (upper - lower).max(1e-9);
    (lower, upper) = (lower - margin, upper + margin);
    let y_of = |value: f64| top + height * (upper - value) / (upper - lower);
    let _ = writeln!(
        text,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#bbb\"/>"
    );
    if lower < 0.0 && upper > 0.0 {
        let _ = writeln!(text, "<path d=\"M{left} {0:.1}h{width}\" stroke=\"#ddd\"/>", y_of(0.0));
    }
    for limit in drawn {
        let _ = writeln!(
            text,
            "<path class=\"limit\" d=\"M{left} {:.1}h{width}\" stroke=\"#c22\" stroke-dasharray=\"5 3\"/>",
            y_of(limit)
        );
    }
    let (start, end) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    let step = times.len().div_ceil(MOST_POINTS).max(1);
    let mut path = String::new();
    for sample in (0..times.len()).step_by(step).chain(times.len().checked_sub(1)) {
        let x = left + width * (times[sample] - start) / (end - start).max(1e-9);
        let _ = write!(path, "{}{x:.1} {:.1}", if path.is_empty() { "M" } else { "L" }, y_of(values[sample]));
    }
    let _ =
        writeln!(text, "<path class=\"curve\" d=\"{path}\" fill=\"none\" stroke=\"#1565a8\" stroke-width=\"1.2\"/>");
    for (value, y) in [(upper, top + 9.0), (lower, top + height - 1.0)] {
        let _ = writeln!(
            text,
            "<text x=\"{}\" y=\"{y:.1}\" text-anchor=\"end\" fill=\"#444\">{value:.2}</text>",
            left - 4.0
        );
    }
    if !beyond.is_empty() {
        let (x, y) = (left + width, top - 4.0);
        let _ = writeln!(
            text,
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"end\" fill=\"#c22\">limits beyond: {}</text>",
            beyond.join(", ")
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::tests::sampled;

    #[test]
    fn every_joint_has_its_curves_and_near_limits() {
        let (joints, times, motion) = sampled(2, 201);
        let speed = motion.dq[motion.of(0)].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let limit = JointLimit {
            joint: joints[0].clone(),
            speed: Some(1.1 * speed),
            acceleration: Some(1e6),
            ..JointLimit::default()
        };
        let limits = Limits { joints: vec![limit], ..Limits::default() };
        let preview = Preview { title: "a < b & c", limits: &limits, torque_nm: None };
        let sampled = Sampled { joints: &joints, times_s: &times, motion: &motion };
        let svg = preview_svg(&sampled, &preview).unwrap();
        assert_eq!(svg.matches("class=\"curve\"").count(), 6);
        // Both ends of the speed band are near; those of acceleration are named instead.
        assert_eq!(svg.matches("class=\"limit\"").count(), 2);
        assert!(svg.contains("limits beyond: -1000000.000, 1000000.000") && svg.contains("a &lt; b &amp; c"), "{svg}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        let torque = vec![0.0; 2 * 201];
        let svg = preview_svg(&sampled, &Preview { torque_nm: Some(&torque), ..preview }).unwrap();
        assert_eq!(svg.matches("class=\"curve\"").count(), 8);
        let error = preview_svg(&sampled, &Preview { torque_nm: Some(&torque[1..]), ..preview }).unwrap_err();
        assert_eq!(error, ExportError::Shape { what: "torques", expected: 402, found: 401 });
    }
}
