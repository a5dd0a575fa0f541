//! From torque terms back to the keys of a study that state them.

use super::friction::{FrictionChoice, FrictionTerm};
use super::{CoulombChoice, JointDrive};
use dynident_model::terms::{Coulomb, CoulombShape, TorqueTerm};

impl JointDrive {
    /// The keys of `[drive.joints.NAME]` that state these terms of a joint's friction, and no others. Drive inertia and
    /// offset are left to the other keys.
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
            // Elements are one law with a list.
            if let (
                Some(FrictionTerm::MaxwellSlip { yield_displacements }),
                FrictionTerm::MaxwellSlip { yield_displacements: more },
            ) = (further.last_mut(), &key)
            {
                yield_displacements.extend(more);
            } else if !further.contains(&key) {
                further.push(key);
            }
        }
        drive.terms = Some(further);
        drive
    }

    /// Sets the basic keys of a term, or returns its entry under `laws`.
    fn basic_or_further(&mut self, term: &TorqueTerm) -> Option<FrictionTerm> {
        match term {
            TorqueTerm::Viscous(_) => self.viscous = Some(true),
            TorqueTerm::Coulomb(Coulomb { shape: CoulombShape::Sign { dead_band }, .. }) => {
                (self.coulomb, self.coulomb_dead_band) = (Some(CoulombChoice::Sign), Some(*dead_band));
            }
            TorqueTerm::Coulomb(Coulomb { shape: CoulombShape::Smooth { width }, .. }) => {
                (self.coulomb, self.coulomb_width) = (Some(CoulombChoice::Smooth), Some(*width));
            }
            further => return FrictionTerm::stating(further),
        }
        None
    }
}
