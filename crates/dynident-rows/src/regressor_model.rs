//! A parametric model with the data that its regressor needs in addition to the motion.

use dynident_dynamics::{BaseParameters, Column, PanelLayout, ParametricModel};
use dynident_model::terms::TorqueTerm;
use dynident_model::{InertialParameters, Model};

/// Factors in the expressions of base parameters that are smaller than this value are rounding errors.
const MIN_REGROUPING_FACTOR: f64 = 1e-9;

/// A parametric model with results of earlier estimates: the bodies whose torque is the load in load-dependent
/// friction, and torque gains.
#[derive(Clone, Debug)]
pub struct RegressorModel {
    /// Model, torque terms, base parameters and layout.
    pub parametric: ParametricModel,
    /// Bodies of an earlier estimate, one value per column of the layout. Their torque is the load in load-dependent
    /// friction; without them, the columns of such friction are zero.
    pub load_parameters: Option<Vec<f64>>,
    /// Estimated factor on the logged torque of each joint; empty if no factor was estimated.
    pub torque_gains: Vec<f64>,
}

impl From<ParametricModel> for RegressorModel {
    fn from(parametric: ParametricModel) -> Self {
        Self { parametric, load_parameters: None, torque_gains: Vec::new() }
    }
}

impl RegressorModel {
    /// Links, joints and gravity.
    pub fn model(&self) -> &Model {
        self.parametric.model()
    }

    /// Torque terms in addition to the rigid bodies.
    pub fn terms(&self) -> &[TorqueTerm] {
        self.parametric.terms()
    }

    /// Base parameters of bodies and terms.
    pub fn base(&self) -> &BaseParameters {
        self.parametric.base()
    }

    /// Regressor columns of each joint.
    pub fn layout(&self) -> &PanelLayout {
        self.parametric.layout()
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.parametric.dof()
    }

    /// Names of the joints, base to tip.
    pub fn joint_names(&self) -> Vec<String> {
        self.parametric.joint_names()
    }

    /// Appends further terms to the base columns, linearly dependent or not. Different sets of terms can then be
    /// compared with one set of triangular factors.
    #[must_use]
    pub fn with_further_columns(&self, further: impl IntoIterator<Item = TorqueTerm>) -> Self {
        let mut wide = self.clone();
        wide.parametric = self.parametric.with_further_columns(further);
        let columns = wide.layout().columns().len();
        if let Some(parameters) = &mut wide.load_parameters {
            parameters.resize(columns, 0.0);
        }
        wide
    }

    /// Sets the bodies for load-dependent friction, if there is any, from an estimate of the model `other`. Drive
    /// inertia is subtracted from the bodies.
    #[must_use]
    pub fn with_load_of_estimate(self, other: &Self, values: &[f64]) -> Self {
        if self.needs_load() { self.with_load_of(other, &other.without_drives(values)) } else { self }
    }

    /// Removes drive inertia from the base parameters of bodies.
    ///
    /// The drive inertia of the first joints is only identifiable in a sum with the inertia of their bodies
    /// (`Izz1 + Ia1`), but it does not load the gear. The part of the sum that exceeds the body's value in the robot
    /// description (at most the whole sum) is attributed to the drive. Without a robot description the whole sum is
    /// attributed to the body.
    fn without_drives(&self, values: &[f64]) -> Vec<f64> {
        let mut bodies = values.to_vec();
        let (base, terms) = (self.base(), self.terms().len());
        let mut nominal = self.parametric.nominal().to_vec();
        if self.parametric.nominal_base().is_none() {
            return bodies;
        }
        // Friction in the robot description is not part of a body.
        let first_term = nominal.len() - terms;
        nominal[first_term..].fill(0.0);
        let of_bodies = base.values(&nominal);
        let is_drive = |column: usize| matches!(base.all_columns()[column], Column::Term(TorqueTerm::DriveInertia(_)));
        let regrouped = base.dependent().iter().zip(base.regrouping().column_iter());
        for (_, factors) in regrouped.filter(|(column, _)| is_drive(**column)) {
            for (place, _) in factors.iter().enumerate().filter(|(_, factor)| **factor > MIN_REGROUPING_FACTOR) {
                if matches!(base.all_columns()[base.independent()[place]], Column::Body { .. }) {
                    let beyond = (values[place] - of_bodies[place]).max(0.0);
                    bodies[place] = values[place] - beyond.min(values[place].max(0.0));
                }
            }
        }
        bodies
    }

    /// Sets the bodies for load-dependent friction, if there is any, from an estimate of the model `other`.
    #[must_use]
    pub fn with_load_of(mut self, other: &Self, values: &[f64]) -> Self {
        if self.needs_load() {
            let known = other.layout().columns();
            let value = |column: &Column| known.iter().position(|c| c == column).map_or(0.0, |place| values[place]);
            self.load_parameters = Some(self.layout().columns().iter().map(value).collect());
        }
        self
    }

    /// Inertial parameters of bodies whose rigid-body torque is the load in load-dependent friction: the load
    /// parameters at the places of their columns. The bodies need not be physically consistent. `None` without load
    /// parameters.
    pub fn load_bodies(&self) -> Option<Vec<InertialParameters>> {
        let parameters = self.load_parameters.as_ref()?;
        let mut bodies = vec![InertialParameters::ZERO; self.model().body_count()];
        for (column, &value) in self.layout().columns().iter().zip(parameters) {
            if let Column::Body { body, parameter } = *column {
                bodies[body].0[parameter] = value;
            }
        }
        Some(bodies)
    }

    /// Whether some friction depends on the torque that the joint carries.
    pub fn needs_load(&self) -> bool {
        self.layout().columns().iter().any(|column| matches!(column, Column::Term(term) if term.needs_load()))
    }

    /// First joint with temperature-dependent friction.
    pub fn joint_that_needs_temperature(&self) -> Option<usize> {
        let needing = self.layout().columns().iter().filter_map(|column| match column {
            Column::Term(term) if term.needs_temperature() => term.joints().first().copied(),
            _ => None,
        });
        needing.min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::terms::{DriveChoice, terms_per_joint};

    /// The drive inertia `Ia1` in the sum `Izz1 + Ia1` does not load the gear.
    #[test]
    fn drive_inertia_in_a_body_parameter_is_not_load() {
        let model =
            dynident_model::load_robot(concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf")).unwrap().model;
        let drives = terms_per_joint(&model, |_| DriveChoice { drive_inertia: true, ..DriveChoice::default() });
        let parametric = ParametricModel::new(model, drives).unwrap();
        let (mut truth, bodies) = (parametric.nominal().to_vec(), parametric.nominal_base().unwrap().to_vec());
        let first = truth.len() - parametric.terms().len();
        truth[first..].fill(3.0);
        let with_drives = parametric.base().values(&truth);
        let found = RegressorModel::from(parametric).without_drives(&with_drives);
        let is_held = |place: &usize| with_drives[*place] != bodies[*place] && found[*place] != with_drives[*place];
        assert!((0..bodies.len()).any(|place| is_held(&place)));
        for place in (0..bodies.len()).filter(is_held) {
            // Rounding of three digits, for values around ten.
            assert!((found[place] - bodies[place]).abs() < 1e-12 * 10.0, "{place}");
        }
    }
}
