//! The friction that a joint may have when the data choose: terms, and for each term a grid of its constants, every one a column.

use crate::machine::{Machine, drive_choice};
use crate::study::friction::{FrictionChoice, FrictionLaw};
use crate::study::{CoulombChoice, JointDrive, Study};
use dynident_model::laws::{Coulomb, CoulombShape, Law, Viscous};

/// Widths of the smooth Coulomb step, rad/s or m/s; beside them the sign and what the study states.
const WIDTHS: [f64; 7] = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2];
/// Stribeck speeds, rad/s or m/s.
const STRIBECK_SPEEDS: [f64; 6] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.4];
const STRIBECK_EXPONENTS: [f64; 2] = [1.0, 2.0];
/// Width of the step under the Stribeck term as a share of its speed: beyond half its speed the step is done.
const STRIBECK_WIDTH: f64 = 0.25;
const SIGMOID_WIDTHS: [f64; 3] = [0.02, 0.05, 0.1];
/// Yield displacements of the Maxwell-slip elements, rad or m.
const YIELDS: [f64; 6] = [3.0e-4, 1.0e-3, 3.0e-3, 1.0e-2, 3.0e-2, 1.0e-1];

/// What a candidate model is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Term {
    Viscous,
    AsymmetricViscous,
    Coulomb,
    Sigmoid,
    Stribeck,
    CubeRoot,
    Quadratic,
    Load,
    MaxwellSlip,
}

impl Term {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Viscous => "viscous",
            Self::AsymmetricViscous => "asymmetric viscous",
            Self::Coulomb => "coulomb",
            Self::Sigmoid => "sigmoid",
            Self::Stribeck => "stribeck",
            Self::CubeRoot => "cube-root",
            Self::Quadratic => "quadratic",
            Self::Load => "load",
            Self::MaxwellSlip => "maxwell-slip",
        }
    }

    /// Constants that are tuned for it: they count as parameters.
    pub(crate) fn constants(self) -> usize {
        match self {
            Self::Coulomb => 1,
            Self::Sigmoid | Self::Stribeck => 2,
            _ => 0,
        }
    }

    /// True when one column of its grid is taken; else all are.
    pub(crate) fn takes_one(self) -> bool {
        self.constants() > 0
    }
}

/// One column that a joint may have.
#[derive(Clone, Debug)]
pub(crate) struct CandidateColumn {
    pub(crate) term: Term,
    pub(crate) law: Law,
    /// Its key under `drive.laws`, where it has one.
    pub(crate) key: Option<FrictionLaw>,
}

/// The joints whose friction is to be chosen.
pub(crate) fn joints_to_choose(study: &Study, machine: &Machine) -> Vec<usize> {
    let of_joint = |name: &str| {
        let own = study.drive.joints.get(name).and_then(|own| own.friction);
        own.unwrap_or(study.drive.friction) == FrictionChoice::Auto
    };
    let joints = machine.model().joints();
    (0..joints.len()).filter(|&joint| of_joint(&joints[joint].name)).collect()
}

/// For each joint to choose, the columns to choose from; a term's columns stand together, in the order of its grid.
pub(crate) fn candidate_columns(study: &Study, machine: &Machine, choose: &[usize]) -> Vec<Vec<CandidateColumn>> {
    let of_joint = |&joint: &usize| columns_of(study, &machine.model().joints()[joint].name, joint);
    choose.iter().map(of_joint).collect()
}

fn columns_of(study: &Study, name: &str, joint: usize) -> Vec<CandidateColumn> {
    let stated = drive_choice(study, name).coulomb;
    let sign = CoulombShape::Sign { dead_band: study.drive.coulomb_dead_band };
    let mut shapes = vec![sign];
    shapes.extend(WIDTHS.map(|width| CoulombShape::Smooth { width }));
    if let Some(stated) = stated.filter(|stated| !shapes.contains(stated)) {
        shapes.push(stated);
    }
    let load_width = match stated {
        Some(CoulombShape::Smooth { width }) => width,
        _ => study.drive.coulomb_width,
    };
    let mut columns = vec![CandidateColumn { term: Term::Viscous, law: Law::Viscous(Viscous { joint }), key: None }];
    columns.extend(shapes.into_iter().map(|shape| {
        let law = Law::Coulomb(Coulomb { joint, shape });
        CandidateColumn { term: Term::Coulomb, law, key: None }
    }));
    let mut add = |term, key: FrictionLaw| {
        let laws = key.laws(joint, sign);
        columns.extend(laws.into_iter().map(|law| CandidateColumn { term, law, key: Some(key.clone()) }));
    };
    add(Term::AsymmetricViscous, FrictionLaw::AsymmetricViscous {});
    for width in SIGMOID_WIDTHS {
        for offset_speed in [-0.5 * width, 0.5 * width] {
            add(Term::Sigmoid, FrictionLaw::Sigmoid { steepness: 2.0 / width, offset_speed });
        }
    }
    for speed in STRIBECK_SPEEDS {
        for exponent in STRIBECK_EXPONENTS {
            let width = Some(STRIBECK_WIDTH * speed);
            add(Term::Stribeck, FrictionLaw::Stribeck { speed, exponent, width });
        }
    }
    add(Term::CubeRoot, FrictionLaw::CubeRoot {});
    add(Term::Quadratic, FrictionLaw::Quadratic {});
    add(Term::Load, FrictionLaw::Load { width: Some(load_width) });
    for value in YIELDS {
        add(Term::MaxwellSlip, FrictionLaw::MaxwellSlip { yield_displacements: vec![value] });
    }
    columns
}

/// The keys of a study under `[drive.joints.NAME]` that state the given columns.
pub(crate) fn stated(columns: &[&CandidateColumn]) -> JointDrive {
    let mut drive = JointDrive {
        viscous: Some(false),
        coulomb: Some(CoulombChoice::None),
        friction: Some(FrictionChoice::Stated),
        ..JointDrive::default()
    };
    let mut laws: Vec<FrictionLaw> = Vec::new();
    for column in columns {
        match (&column.law, &column.key) {
            (Law::Viscous(_), _) => drive.viscous = Some(true),
            (Law::Coulomb(Coulomb { shape: CoulombShape::Sign { dead_band }, .. }), _) => {
                (drive.coulomb, drive.coulomb_dead_band) = (Some(CoulombChoice::Sign), Some(*dead_band));
            }
            (Law::Coulomb(Coulomb { shape: CoulombShape::Smooth { width }, .. }), _) => {
                (drive.coulomb, drive.coulomb_width) = (Some(CoulombChoice::Smooth), Some(*width));
            }
            (_, Some(FrictionLaw::MaxwellSlip { yield_displacements: more })) => {
                let known = laws.iter_mut().find_map(|law| match law {
                    FrictionLaw::MaxwellSlip { yield_displacements } => Some(yield_displacements),
                    _ => None,
                });
                match known {
                    Some(known) => known.extend(more),
                    None => laws.push(FrictionLaw::MaxwellSlip { yield_displacements: more.clone() }),
                }
            }
            (_, Some(key)) if !laws.contains(key) => laws.push(key.clone()),
            _ => {}
        }
    }
    drive.laws = Some(laws);
    drive
}
