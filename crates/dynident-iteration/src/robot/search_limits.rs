use super::envelope::EnvelopeSettings;
use super::workspace::{WatchedPoint, WorkspaceBox};
use dynident_excitation::limits::{BoxLimit, JointLimit, Limits, LinkPoint};
use dynident_model::Model;
use dynident_simulation::SimulationError;

/// Distance of the unbounded end of a range that the envelope limits on one side only, rad (m for an arm of 1.2 m):
/// no joint reaches it.
const UNREACHABLE_DISTANCE: f64 = 40.0;

impl EnvelopeSettings {
    /// Narrows `limits` so that a motion within them stays in this envelope, with a `margin` (0 to below 1) for the
    /// tracking error. Positions are narrowed by this share of the allowed tracking error, at most by half the range.
    /// Watched points are narrowed by this share of that error times the lever arm, at most by half the box. Velocity
    /// and torque limits given in the study are reduced by this share. Torque is limited only if the robot
    /// description has the inertials of all bodies.
    ///
    /// # Errors
    /// Same as for [`envelope`](Self::envelope).
    pub fn narrow(&self, mut limits: Limits, model: &Model, margin: f64) -> Result<Limits, SimulationError> {
        let envelope = self.envelope(model)?;
        let errors: Vec<f64> = envelope.tracking_error.iter().map(|error| margin * error.unwrap_or(0.0)).collect();
        let own = model.characteristic_scale();
        let known = model.bodies_without_prior().is_empty();
        // Defaults from the robot description already have a margin, the `LIMIT_FACTOR` of the envelope.
        let kept = |stated: bool| if stated { 1.0 - margin } else { 1.0 };
        for (place, joint) in model.joints().iter().enumerate() {
            let at = limits.joints.iter().position(|limit| limit.joint == joint.name).unwrap_or_else(|| {
                limits.joints.push(JointLimit { joint: joint.name.clone(), ..JointLimit::default() });
                limits.joints.len() - 1
            });
            let limit = &mut limits.joints[at];
            let far = if joint.is_rotary() { UNREACHABLE_DISTANCE } else { own.metres(UNREACHABLE_DISTANCE) };
            let range = match (envelope.lower[place], envelope.upper[place]) {
                (Some(lower), Some(upper)) => {
                    let room = errors[place].min(0.5 * margin * (upper - lower));
                    Some([lower + room, upper - room])
                }
                (Some(lower), None) => Some([lower + errors[place], lower + far]),
                (None, Some(upper)) => Some([upper - far, upper - errors[place]]),
                (None, None) => None,
            };
            limit.position = match (limit.position, range) {
                (Some(own), Some(range)) => Some([own[0].max(range[0]), own[1].min(range[1])]),
                (own, range) => own.or(range),
            };
            let speed = envelope.speed[place].map(|speed| speed * kept(self.speed.is_some()));
            limit.speed = limit.speed.into_iter().chain(speed).reduce(f64::min);
            let torque = envelope.torque[place].map(|torque| torque * kept(self.torque.is_some()));
            if let Some(torque) = torque.filter(|_| known)
                && limit.torque.is_none_or(|own| torque < own * (1.0 - limit.torque_margin))
            {
                (limit.torque, limit.torque_margin) = (Some(torque), 0.0);
            }
        }
        limits.boxes.extend(envelope.workspace.iter().filter_map(|own| own.limit(model, &errors, margin)));
        Ok(limits)
    }
}

impl WorkspaceBox {
    /// The box with the watched points, narrowed for each point by the effect of the tracking errors; `None` if no
    /// axis is bounded.
    fn limit(&self, model: &Model, errors: &[f64], margin: f64) -> Option<BoxLimit> {
        let far = model.characteristic_scale().metres(UNREACHABLE_DISTANCE);
        let bounds = (0..3).map(|axis| match (self.lower[axis], self.upper[axis]) {
            (Some(lower), Some(upper)) => Some([lower, upper]),
            (Some(lower), None) => Some([lower, lower.max(0.0) + far]),
            (None, Some(upper)) => Some([upper.min(0.0) - far, upper]),
            (None, None) => None,
        });
        let [x_m, y_m, z_m] = <[Option<[f64; 2]>; 3]>::try_from(bounds.collect::<Vec<_>>()).ok()?;
        let narrowest = [x_m, y_m, z_m].into_iter().flatten().map(|[lower, upper]| 0.5 * (upper - lower));
        let most = margin * narrowest.reduce(f64::min)?;
        let points = self.points.iter().filter_map(|point| {
            let mut own = point.place(model)?;
            own.radius_m = point.reach_of_errors(model, errors).min(most);
            Some(own)
        });
        Some(BoxLimit { x_m, y_m, z_m, points: points.collect() })
    }
}

impl WatchedPoint {
    /// The point in the frame of a link of its body.
    fn place(&self, model: &Model) -> Option<LinkPoint> {
        let link = model.bodies()[self.body].links.first()?;
        let to_link = link.placement.inverse();
        let at = to_link.point(dynident_model::Vec3(self.offset_m));
        Some(LinkPoint { link: link.name.clone(), at_m: at.0, radius_m: 0.0 })
    }

    /// Displacement of the point by the tracking errors of the joints that move it, m: root of the sum of squares of
    /// each error times the lever arm from its joint to the point.
    fn reach_of_errors(&self, model: &Model, errors: &[f64]) -> f64 {
        let mut length_m = dynident_model::Vec3(self.offset_m).norm();
        let (mut square, mut body) = (0.0, Some(self.body));
        while let Some(at) = body {
            let joint = &model.tree_joints()[at];
            let lever = if joint.is_rotary() { length_m } else { 1.0 };
            let error: f64 = model.drivers(at).map(|(driver, share)| (share * errors[driver]).abs()).sum();
            square += (error * lever).powi(2);
            length_m += joint.placement.translation.norm();
            body = joint.parent;
        }
        square.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use crate::robot::{EnvelopeSettings, WorkspaceSettings};
    use dynident_excitation::limits::{JointLimit, Limits};
    use dynident_model::sample::{Random, planar_2r};

    #[test]
    fn the_tighter_of_both_limits_with_room() {
        let mut random = Random::new(1);
        let model = planar_2r(1.0, random.body(), random.body());
        let own = JointLimit {
            joint: "joint1".to_owned(),
            position: Some([-0.5, 4.0]),
            speed: Some(1.0),
            torque: Some(10.0),
            torque_margin: 0.5,
            ..JointLimit::default()
        };
        let limits = Limits { joints: vec![own], ..Limits::default() };
        let mut bounds = WorkspaceSettings::default();
        (bounds.lower[2], bounds.tool) = (-0.3, Some([0.2, 0.0, 0.0]));
        let envelope = EnvelopeSettings {
            lower: Some((-1.0).into()),
            upper: Some(2.0.into()),
            speed: Some(2.0.into()),
            torque: Some(8.0.into()),
            tracking_error: Some(0.2.into()),
            workspace: Some(bounds),
            ..EnvelopeSettings::default()
        };
        let found = envelope.narrow(limits.clone(), &model, 0.1).unwrap();
        let [first, second] = [&found.joints[0], &found.joints[1]];
        // 0.1 · 0.2 rad of margin at the upper end; the study's lower end, speed and torque are tighter.
        assert_eq!(first.position, Some([-0.5, 2.0 - 0.1 * 0.2]));
        assert_eq!((first.speed, first.torque, first.torque_margin), (Some(1.0), Some(10.0), 0.5));
        assert_eq!(second.position, Some([-1.0 + 0.1 * 0.2, 2.0 - 0.1 * 0.2]));
        assert_eq!((second.speed, second.torque), (Some(2.0 * 0.9), Some(8.0 * 0.9)));
        let boxed = &found.boxes[0];
        assert!(boxed.x_m.is_none() && boxed.y_m.is_none() && boxed.z_m.unwrap()[0] == -0.3);
        // The tool turns about both joints: 0.2 m from the second, 1.2 m from the first.
        let tool = boxed.points.last().unwrap();
        assert!((tool.radius_m - 0.02 * (0.2_f64.powi(2) + 1.2_f64.powi(2)).sqrt()).abs() < 1e-12, "{tool:?}");
        assert!(found.validate(&model).is_ok());
        // Without a margin it equals the envelope.
        let exact = envelope.narrow(limits, &model, 0.0).unwrap();
        assert_eq!(exact.joints[1].position, Some([-1.0, 2.0]));
        assert!(exact.boxes[0].points.iter().all(|point| point.radius_m == 0.0));
        let percent = EnvelopeSettings { search_margin_percent: Some(95.0), ..envelope };
        assert!(percent.narrow(Limits::default(), &model, 0.1).is_err());
    }
}
