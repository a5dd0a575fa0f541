use super::Figure;
use super::data::Data;
use crate::error::Error;
use crate::pages::unit;
use crate::result::{ResultFile, StoredModel, TermResult};
use dynident_export::{RobotModel, own_friction};
use dynident_identification::rows::VelocityHistogram;
use dynident_model::JointKind;
use dynident_report::{Cell, LinePlot, PrintPanel, Table, short};
use std::path::Path;

/// Number of points on each side of a friction curve, enough for a smooth line.
const POINTS: usize = 150;
/// Largest velocity of a curve if there are neither recorded velocities nor a limit, rad/s (m/s).
const DEFAULT_VELOCITY: f64 = 1.0;

impl Figure {
    /// Plots friction and constant torque of each joint against its velocity, in the range of the recorded
    /// velocities. Terms that depend on transmitted torque or temperature are omitted. Friction with hysteresis has
    /// its value after a long motion in one direction.
    ///
    /// # Errors
    /// A result without its robot (of an older version, or of a payload on a known arm).
    pub fn friction(r: &ResultFile, path: &Path) -> Result<Self, Error> {
        let Some(stored) = &r.model else {
            let message = "does not contain the robot with its friction: identify again with this version (a payload \
                           on a known arm has no friction)";
            return Err(Error::Result { path: path.to_owned(), message: message.to_owned() });
        };
        let cannot = |source| Error::Export { path: path.to_owned(), source: Box::new(source) };
        let robot = StoredModel::robot(stored).map_err(cannot)?;
        let mut data = Data::new(["joint", "velocity", "friction", "velocity_unit", "friction_unit"]);
        let mut panels = Vec::new();
        for (joint, own) in robot.model().joints().iter().enumerate() {
            let [velocity_unit, torque_unit] =
                if own.kind == JointKind::Prismatic { ["m/s", "N"] } else { ["rad/s", "Nm"] };
            let largest = largest_velocity(r, &robot, joint);
            let side = |sign: f64| (1..=POINTS).map(move |k| sign * largest * k as f64 / POINTS as f64);
            // The curve has a gap at zero velocity, where friction is discontinuous.
            let velocities: Vec<f64> =
                side(-1.0).collect::<Vec<_>>().into_iter().rev().chain([0.0]).chain(side(1.0)).collect();
            let torque = |velocity: &f64| {
                if *velocity == 0.0 { f64::NAN } else { own_friction(&robot, joint, *velocity) }
            };
            let friction: Vec<f64> = velocities.iter().map(torque).collect();
            for (velocity, friction) in velocities.iter().zip(&friction).filter(|(_, friction)| friction.is_finite()) {
                data.add([
                    (&own.name).into(),
                    (*velocity).into(),
                    (*friction).into(),
                    velocity_unit.into(),
                    torque_unit.into(),
                ]);
            }
            let (x, y) = (format!("velocity, {velocity_unit}"), format!("friction, {torque_unit}"));
            panels.push(PrintPanel::Lines(LinePlot::new(&own.name, x, y, velocities).line("identified", friction)));
        }
        Ok(Self::new(format!("Friction of {}", r.name), panels, data, table(r)))
    }
}

/// Largest recorded velocity of a joint, otherwise its limit.
fn largest_velocity(r: &ResultFile, robot: &RobotModel, joint: usize) -> f64 {
    let histograms = r.logs.iter().filter_map(|log| log.velocities.get(joint));
    let recorded = histograms.flat_map(VelocityHistogram::moving).map(|(velocity, _)| velocity.abs());
    let limit = || robot.model().joints()[joint].limits.velocity;
    let known = recorded.reduce(f64::max).or_else(limit);
    known.filter(|velocity| velocity.is_finite() && *velocity > 0.0).unwrap_or(DEFAULT_VELOCITY)
}

/// The terms of every joint.
fn table(r: &ResultFile) -> Table {
    let bar = |term: &TermResult| {
        let base = r.base_parameters.iter().find(|own| Some(&own.expression) == term.base_parameter.as_ref());
        base.filter(|own| term.std.is_some() && own.excited)
            .map_or_else(|| "–".to_owned(), |own| short(own.bar_95(), 2))
    };
    let rows = r.joints.iter().flat_map(|joint| {
        let row = |term: &TermResult| {
            let cells = [joint.name.clone(), term.symbol.clone(), short(term.value, 4), bar(term), unit(&term.unit)];
            cells.map(Cell::from).into()
        };
        joint.terms.iter().map(row).collect::<Vec<Vec<Cell>>>()
    });
    Table::new(format!("Friction and drives of {}", r.name), ["joint", "parameter", "value", "± (95 %)", "unit"])
        .note("–: not a separate base parameter")
        .rows(rows)
}
