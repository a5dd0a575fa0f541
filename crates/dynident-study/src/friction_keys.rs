//! Converts torque terms to the study keys that describe them.

use super::friction::{FrictionChoice, FrictionTerm};
use super::{CoulombChoice, JointDrive};
use dynident_model::terms::{CoulombShape, JointProperty, StepRole, TorqueTerm};

impl JointDrive {
    /// The keys of `[drive.joints.NAME]` that describe exactly these friction terms. Drive inertia and offset have
    /// separate keys.
    pub fn stating(terms: &[TorqueTerm]) -> Self {
        let mut drive = Self {
            viscous: Some(false),
            coulomb: Some(CoulombChoice::None),
            friction: Some(FrictionChoice::Stated),
            ..Self::default()
        };
        let mut further: Vec<FrictionTerm> = Vec::new();
        for term in terms {
            let Some(key) = drive.basic_or_further(term) else { continue };
            let is_joined = further.last_mut().is_some_and(|last| last.law_mut().join(&key));
            if !is_joined && !further.contains(&key) {
                further.push(key);
            }
        }
        drive.terms = Some(further);
        drive
    }

    /// Sets the basic keys of a term, or returns its entry for `laws`.
    fn basic_or_further(&mut self, term: &TorqueTerm) -> Option<FrictionTerm> {
        match (term.property(), term.step()) {
            (Some(JointProperty::Damping), _) => self.viscous = Some(true),
            (Some(JointProperty::Friction), Some(CoulombShape::Sign { dead_band })) => {
                (self.coulomb, self.coulomb_dead_band) = (Some(CoulombChoice::Sign), Some(dead_band));
            }
            (Some(JointProperty::Friction), Some(CoulombShape::Smooth { width })) => {
                (self.coulomb, self.coulomb_width) = (Some(CoulombChoice::Smooth), Some(width));
            }
            // The width of the directional sign function is set by the joint's key `coulomb_width`.
            (_, Some(CoulombShape::Smooth { width })) if term.kind().step_role() == StepRole::Joint => {
                self.coulomb_width = Some(width);
            }
            _ => {}
        }
        term.kind().stated()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DriveSection;
    use crate::friction::ExportableForm;
    use crate::robot_model::torque_terms;
    use dynident_model::load_robot;
    use dynident_model::terms::{
        Coulomb, Direction, DirectionalCoulomb, DirectionalViscous, LoadFriction, MaxwellSlip, Power, PowerExponent,
        Sigmoid, Stribeck, Viscous,
    };
    use std::path::Path;

    #[test]
    fn keys_state_the_terms_that_they_came_from() {
        let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/ur10.urdf");
        let model = load_robot(&robot).unwrap().model;
        let joint = 1;
        let both = [Direction::Forward, Direction::Backward];
        let shape = CoulombShape::Smooth { width: 0.0123 };
        let viscous = vec![TorqueTerm::Viscous(Viscous { joint })];
        let coulomb = |shape| vec![TorqueTerm::Coulomb(Coulomb { joint, shape })];
        let by_direction = both
            .map(|direction| TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint, direction, shape }))
            .to_vec();
        let viscous_by_direction =
            both.map(|direction| TorqueTerm::DirectionalViscous(DirectionalViscous { joint, direction })).to_vec();
        let wide = CoulombShape::Smooth { width: 0.07 };
        let stribeck = vec![TorqueTerm::Stribeck(Stribeck { joint, speed: 0.28, exponent: 2.0, shape: wide })];
        let sigmoid = vec![TorqueTerm::Sigmoid(Sigmoid { joint, steepness: 21.0, offset_speed: 0.03 })];
        let rounding = model.characteristic_scale().velocity(true, Power::ROUNDING);
        let powers = [PowerExponent::CubeRoot, PowerExponent::Quadratic]
            .map(|exponent| TorqueTerm::Power(Power { joint, exponent, rounding }))
            .to_vec();
        let load = vec![TorqueTerm::Load(LoadFriction { joint, shape: wide })];
        let slip = [0.001, 0.03]
            .map(|yield_displacement| TorqueTerm::MaxwellSlip(MaxwellSlip { joint, yield_displacement }))
            .to_vec();
        let laws: [Vec<Vec<TorqueTerm>>; 8] = [
            vec![viscous.clone(), coulomb(shape)],
            vec![viscous.clone(), coulomb(CoulombShape::Sign { dead_band: 0.004 })],
            vec![viscous.clone(), by_direction.clone()],
            vec![viscous_by_direction, by_direction.clone(), stribeck.clone()],
            vec![viscous.clone(), coulomb(shape), stribeck, powers],
            vec![viscous.clone(), sigmoid],
            vec![viscous.clone(), by_direction, load],
            vec![viscous, slip],
        ];
        for law in laws {
            let terms = law.concat();
            let mut drive = DriveSection { viscous: false, coulomb: CoulombChoice::None, ..DriveSection::default() };
            drive.offset = Some(false);
            drive.joints.insert(model.joints()[joint].name.clone(), JointDrive::stating(&terms));
            assert_eq!(torque_terms(&drive, &[], &model).unwrap(), terms);
        }
    }

    /// With `exportable` the model has no term that the export format cannot contain, unless the study gives it.
    #[test]
    fn models_for_a_form_have_its_terms() {
        let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/ur10.urdf");
        let model = load_robot(&robot).unwrap().model;
        let terms = |exportable, offset, drive_inertia| {
            let drive = DriveSection { drive_inertia, offset, exportable, ..DriveSection::default() };
            torque_terms(&drive, &[], &model).unwrap()
        };
        let has_offset = |terms: &[TorqueTerm]| terms.iter().any(|term| matches!(term, TorqueTerm::Offset(_)));
        assert!(has_offset(&terms(None, None, None)) && has_offset(&terms(Some(ExportableForm::Code), None, None)));
        for form in [ExportableForm::Urdf, ExportableForm::Mjcf] {
            assert!(!has_offset(&terms(Some(form), None, None)) && has_offset(&terms(Some(form), Some(true), None)));
        }
        // Not tested by `identify`, because the form answers the question.
        let drive = DriveSection { exportable: Some(ExportableForm::Urdf), ..DriveSection::default() };
        assert_eq!(drive.drive_inertia_of(&model.joints()[0].name), Some(false));
        assert_eq!(DriveSection::default().drive_inertia_of(&model.joints()[0].name), None);
    }
}
