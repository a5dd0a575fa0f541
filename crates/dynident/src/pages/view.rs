//! Page of a robot with motions.

use super::robot::{RobotAppearance, ellipsoid};
use crate::error::Error;
use dynident_excitation::families::SampledMotion;
use dynident_model::{JointKind, Model};
use dynident_report::{Cell, Gauge, Heading, Report, SceneMotion, Table, short};

/// Maximum number of samples of a motion; the animation interpolates between them.
const MAX_SAMPLES: usize = 3000;

/// A motion in continuous pieces, which are animated one after the other.
pub(crate) struct ViewedMotion {
    pub(crate) name: String,
    pub(crate) pieces: Vec<SampledMotion>,
}

/// Writes the page: the robot with its motions, joints with limits, bodies with masses.
///
/// # Errors
/// [`Error::Report`], which indicates a bug.
pub(crate) fn view_page(
    title: &str,
    model: &Model,
    robot: &RobotAppearance,
    motions: &[ViewedMotion],
) -> Result<String, Error> {
    let subtitle = format!("{}: {} joints, {} bodies", model.name(), model.dof(), model.body_count());
    let mut page = Report::new(title).subtitle(subtitle);
    let mut scene = robot.scene("Robot");
    scene.words = format!("the arm of {} joints", model.dof());
    for (body, inertial) in scene.bodies.iter_mut().skip(1).zip(model.inertials()) {
        body.ellipsoids.extend(ellipsoid(&inertial.0, true));
    }
    scene.motions = motions.iter().map(|motion| played(motion, model)).collect();
    page.add(scene);
    page.add(Heading::new("Joints"));
    page.add(joints(model));
    page.add(Heading::new("Bodies"));
    page.add(bodies(model));
    Ok(page.html()?)
}

fn played(motion: &ViewedMotion, model: &Model) -> SceneMotion {
    let total: usize = motion.pieces.iter().map(|piece| piece.times_s().len()).sum();
    let step = total.div_ceil(MAX_SAMPLES).max(1);
    let mut times_s: Vec<f64> = Vec::new();
    let mut lists = [(); 2].map(|()| vec![Vec::new(); model.dof()]);
    for piece in &motion.pieces {
        let (times, samples) = (piece.times_s(), piece.samples());
        // The first sample of a piece comes after the last sample of the previous piece.
        let start = times_s.last().map_or(0.0, |last| last + (times[1] - times[0]));
        times_s.extend(times.iter().step_by(step).map(|time| start + time - times[0]));
        for (list, values) in lists.iter_mut().zip([&samples.q, &samples.dq]) {
            for (joint, kept) in list.iter_mut().enumerate() {
                kept.extend(values[samples.of(joint)].iter().step_by(step));
            }
        }
    }
    let [q, dq] = lists;
    let limits = model.joints().iter().map(|joint| joint.limits);
    let gauges = vec![
        Gauge {
            name: "position, rad (m)".into(),
            values: q.clone(),
            limits: limits.clone().map(|limits| Some([limits.lower?, limits.upper?])).collect(),
        },
        Gauge {
            name: "speed, rad/s (m/s)".into(),
            values: dq,
            limits: limits.map(|limits| limits.velocity.map(|speed| [-speed, speed])).collect(),
        },
    ];
    SceneMotion { name: motion.name.clone(), times_s, q, gauges, ..SceneMotion::default() }
}

fn joints(model: &Model) -> Table {
    let number = |value: Option<f64>| Cell::from(value.map_or_else(|| "–".to_owned(), |value| short(value, 4)));
    let rows = model.joints().iter().map(|joint| {
        let limits = joint.limits;
        let mut row = vec![Cell::from(&joint.name), Cell::from(joint.kind.name())];
        row.extend([limits.lower, limits.upper, limits.velocity, limits.effort].map(number));
        row.push(Cell::from(if joint.kind == JointKind::Prismatic { "m, m/s, N" } else { "rad, rad/s, Nm" }));
        row
    });
    Table::new("Joints and limits", ["joint", "type", "lowest", "highest", "speed", "torque", "units"]).rows(rows)
}

fn bodies(model: &Model) -> Table {
    let rows = model.bodies().iter().zip(model.inertials()).map(|(body, inertial)| {
        let mass = inertial.mass_kg();
        let centre = (mass > 0.0).then(|| inertial.first_moment().scale(1.0 / mass).0);
        let mut row =
            vec![Cell::from(body.name()), Cell::from(if body.prior().is_some() { short(mass, 4) } else { "–".into() })];
        row.extend(
            (0..3).map(|axis| Cell::from(centre.map_or_else(|| "–".to_owned(), |centre| short(centre[axis], 4)))),
        );
        row
    });
    Table::new("Masses and centres of mass", ["body", "mass, kg", "x, m", "y, m", "z, m"])
        .note("centre of mass in the frame of the body's joint; links that move together are one body")
        .rows(rows)
}
