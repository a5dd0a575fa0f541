//! From torque terms back to the keys of a study that state them.

use super::friction::{FrictionChoice, FrictionLaw};
use super::{CoulombChoice, JointDrive};
use dynident_model::laws::{Coulomb, CoulombShape, Law, Power, PowerExponent};

impl JointDrive {
    /// The keys of `[drive.joints.NAME]` that state these terms of a joint's friction, and no others. Drive inertia and offset are left to the other keys.
    pub fn stating(terms: &[Law]) -> Self {
        let mut drive = Self {
            viscous: Some(false),
            coulomb: Some(CoulombChoice::None),
            friction: Some(FrictionChoice::Stated),
            ..Self::default()
        };
        let mut laws: Vec<FrictionLaw> = Vec::new();
        for term in terms {
            let Some(key) = drive.basic_or_further(term) else { continue };
            // Elements are one law with a list.
            if let (
                Some(FrictionLaw::MaxwellSlip { yield_displacements }),
                FrictionLaw::MaxwellSlip { yield_displacements: more },
            ) = (laws.last_mut(), &key)
            {
                yield_displacements.extend(more);
            } else if !laws.contains(&key) {
                laws.push(key);
            }
        }
        drive.laws = Some(laws);
        drive
    }

    /// Sets the basic keys of a term, or returns its entry under `laws`.
    fn basic_or_further(&mut self, term: &Law) -> Option<FrictionLaw> {
        let width = |shape: CoulombShape| match shape {
            CoulombShape::Sign { .. } => None,
            CoulombShape::Smooth { width } => Some(width),
        };
        match term {
            Law::Viscous(_) => self.viscous = Some(true),
            Law::Coulomb(Coulomb { shape: CoulombShape::Sign { dead_band }, .. }) => {
                (self.coulomb, self.coulomb_dead_band) = (Some(CoulombChoice::Sign), Some(*dead_band));
            }
            Law::Coulomb(Coulomb { shape: CoulombShape::Smooth { width }, .. }) => {
                (self.coulomb, self.coulomb_width) = (Some(CoulombChoice::Smooth), Some(*width));
            }
            Law::DirectionalViscous(_) => return Some(FrictionLaw::AsymmetricViscous {}),
            Law::DirectionalCoulomb(_) => return Some(FrictionLaw::AsymmetricCoulomb {}),
            Law::Stribeck(law) => {
                let (speed, exponent, width) = (law.speed, law.exponent, width(law.shape));
                return Some(FrictionLaw::Stribeck { speed, exponent, width });
            }
            Law::Sigmoid(law) => {
                let (steepness, offset_speed) = (law.steepness, law.offset_speed);
                return Some(FrictionLaw::Sigmoid { steepness, offset_speed });
            }
            Law::Power(Power { exponent: PowerExponent::CubeRoot, .. }) => return Some(FrictionLaw::CubeRoot {}),
            Law::Power(Power { exponent: PowerExponent::Quadratic, .. }) => return Some(FrictionLaw::Quadratic {}),
            Law::Load(law) => return Some(FrictionLaw::Load { width: width(law.shape) }),
            Law::MaxwellSlip(law) => {
                return Some(FrictionLaw::MaxwellSlip { yield_displacements: vec![law.yield_displacement] });
            }
            Law::TemperatureViscous(law) => {
                let reference_c = law.reference_c;
                return Some(FrictionLaw::Temperature { reference_c, viscous: true, coulomb: false });
            }
            Law::TemperatureCoulomb(law) => {
                let reference_c = law.reference_c;
                return Some(FrictionLaw::Temperature { reference_c, viscous: false, coulomb: true });
            }
            Law::Offset(_) | Law::DriveInertia(_) | Law::Coupling(_) => {}
        }
        None
    }
}
