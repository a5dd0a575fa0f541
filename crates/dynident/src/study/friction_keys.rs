//! From torque terms back to the keys of a study that state them.

use super::friction::{FrictionChoice, FrictionLaw};
use super::{CoulombChoice, JointDrive};
use dynident_model::laws::{Coulomb, CoulombShape, Law};

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
        match term {
            Law::Viscous(_) => self.viscous = Some(true),
            Law::Coulomb(Coulomb { shape: CoulombShape::Sign { dead_band }, .. }) => {
                (self.coulomb, self.coulomb_dead_band) = (Some(CoulombChoice::Sign), Some(*dead_band));
            }
            Law::Coulomb(Coulomb { shape: CoulombShape::Smooth { width }, .. }) => {
                (self.coulomb, self.coulomb_width) = (Some(CoulombChoice::Smooth), Some(*width));
            }
            further => return FrictionLaw::stating(further),
        }
        None
    }
}
