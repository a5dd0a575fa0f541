//! Friction in the study file: laws beyond viscous, Coulomb and offset, and whether the data choose them.

use crate::error::{Expected, StudyError};
use dynident_model::Model;
use dynident_model::terms::{
    CoulombShape, Direction, DirectionalCoulomb, DirectionalViscous, LoadFriction, MaxwellSlip, Power, PowerExponent,
    Sigmoid, Stribeck, TemperatureCoulomb, TemperatureViscous, TorqueTerm,
};
use serde::{Deserialize, Serialize};

/// Who says which friction a joint has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum FrictionChoice {
    /// The study's keys.
    #[default]
    Stated,
    /// Cross-validation inside the training logs. The keys `offset` and `drive_inertia` stay in force; what else is
    /// stated is one of the candidates.
    Auto,
}

/// A law of `drive.laws`, beside `viscous`, `coulomb` and `offset`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "law", rename_all = "kebab-case", deny_unknown_fields)]
pub enum FrictionTerm {
    /// Viscous friction by direction, in place of `viscous`.
    AsymmetricViscous {},
    /// Coulomb friction by direction, in place of `coulomb`; with a sign it says the same as `offset`, so switch one
    /// off.
    AsymmetricCoulomb {},
    /// `e^{-|dq/speed|^exponent}` times the step.
    Stribeck {
        /// rad/s or m/s.
        speed: f64,
        /// 1 to 2.8 are usual.
        exponent: f64,
        /// Width of its smooth step, rad/s or m/s; by default the step is the joint's Coulomb step.
        #[serde(default)]
        width: Option<f64>,
    },
    /// A shifted smooth step, in place of `coulomb`.
    Sigmoid {
        /// s/rad or s/m.
        steepness: f64,
        /// rad/s or m/s.
        #[serde(default)]
        offset_speed: f64,
    },
    /// Torque by the cube root of the velocity.
    CubeRoot {},
    /// Torque by the square of the velocity.
    Quadratic {},
    /// Torque in proportion to the load, against the motion.
    Load {
        /// As for `stribeck`.
        #[serde(default)]
        width: Option<f64>,
    },
    /// Viscous and Coulomb friction change with the joint's temperature, beside `viscous` and `coulomb`; logs need a
    /// `temperature`.
    Temperature {
        /// The temperature at which friction is what `viscous` and `coulomb` say, °C; 25 by default.
        #[serde(default = "room_temperature")]
        reference_c: f64,
        /// Whether viscous friction changes. True by default.
        #[serde(default = "yes")]
        viscous: bool,
        /// Whether Coulomb friction changes. True by default.
        #[serde(default = "yes")]
        coulomb: bool,
    },
    /// Springs that slip, one per yield displacement.
    MaxwellSlip {
        /// rad or m.
        yield_displacements: Vec<f64>,
    },
}

fn room_temperature() -> f64 {
    25.0
}

fn yes() -> bool {
    true
}

/// Elements of one joint: each is a column.
const MOST_ELEMENTS: f64 = 50.0;

impl FrictionTerm {
    /// The parameters of this law at `joint` of `model`, whose Coulomb step is `step`.
    pub(crate) fn terms(&self, model: &Model, joint: usize, step: CoulombShape) -> Vec<TorqueTerm> {
        let rounding = model.own_scale().velocity(model.joints()[joint].turns(), Power::ROUNDING);
        let both = [Direction::Forward, Direction::Backward];
        let power = |exponent| vec![TorqueTerm::Power(Power { joint, exponent, rounding })];
        match self {
            Self::AsymmetricViscous {} => {
                both.map(|direction| TorqueTerm::DirectionalViscous(DirectionalViscous { joint, direction })).to_vec()
            }
            Self::AsymmetricCoulomb {} => both
                .map(|direction| TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint, direction, shape: step }))
                .to_vec(),
            &Self::Stribeck { speed, exponent, width } => {
                let shape = width.map_or(step, |width| CoulombShape::Smooth { width });
                vec![TorqueTerm::Stribeck(Stribeck { joint, speed, exponent, shape })]
            }
            &Self::Sigmoid { steepness, offset_speed } => {
                vec![TorqueTerm::Sigmoid(Sigmoid { joint, steepness, offset_speed })]
            }
            Self::CubeRoot {} => power(PowerExponent::CubeRoot),
            Self::Quadratic {} => power(PowerExponent::Quadratic),
            &Self::Load { width } => {
                let shape = width.map_or(step, |width| CoulombShape::Smooth { width });
                vec![TorqueTerm::Load(LoadFriction { joint, shape })]
            }
            &Self::Temperature { reference_c, viscous, coulomb } => {
                let changes = [
                    viscous.then_some(TorqueTerm::TemperatureViscous(TemperatureViscous { joint, reference_c })),
                    coulomb.then_some(TorqueTerm::TemperatureCoulomb(TemperatureCoulomb {
                        joint,
                        reference_c,
                        shape: step,
                    })),
                ];
                changes.into_iter().flatten().collect()
            }
            Self::MaxwellSlip { yield_displacements } => {
                let element = |&yield_displacement| TorqueTerm::MaxwellSlip(MaxwellSlip { joint, yield_displacement });
                yield_displacements.iter().map(element).collect()
            }
        }
    }

    /// The key that states `law`; none for what has keys of its own beside `laws`. One of several laws of a key gives
    /// the key with that law alone.
    pub(crate) fn stating(term: &TorqueTerm) -> Option<Self> {
        let width = |shape: CoulombShape| match shape {
            CoulombShape::Sign { .. } => None,
            CoulombShape::Smooth { width } => Some(width),
        };
        match *term {
            TorqueTerm::Viscous(_)
            | TorqueTerm::Coulomb(_)
            | TorqueTerm::Offset(_)
            | TorqueTerm::DriveInertia(_)
            | TorqueTerm::Coupling(_)
            | TorqueTerm::Declared(_) => None,
            TorqueTerm::DirectionalViscous(_) => Some(Self::AsymmetricViscous {}),
            TorqueTerm::DirectionalCoulomb(_) => Some(Self::AsymmetricCoulomb {}),
            TorqueTerm::Stribeck(Stribeck { speed, exponent, shape, .. }) => {
                Some(Self::Stribeck { speed, exponent, width: width(shape) })
            }
            TorqueTerm::Sigmoid(Sigmoid { steepness, offset_speed, .. }) => {
                Some(Self::Sigmoid { steepness, offset_speed })
            }
            TorqueTerm::Power(Power { exponent: PowerExponent::CubeRoot, .. }) => Some(Self::CubeRoot {}),
            TorqueTerm::Power(Power { exponent: PowerExponent::Quadratic, .. }) => Some(Self::Quadratic {}),
            TorqueTerm::Load(LoadFriction { shape, .. }) => Some(Self::Load { width: width(shape) }),
            TorqueTerm::MaxwellSlip(MaxwellSlip { yield_displacement, .. }) => {
                Some(Self::MaxwellSlip { yield_displacements: vec![yield_displacement] })
            }
            TorqueTerm::TemperatureViscous(TemperatureViscous { reference_c, .. }) => {
                Some(Self::Temperature { reference_c, viscous: true, coulomb: false })
            }
            TorqueTerm::TemperatureCoulomb(TemperatureCoulomb { reference_c, .. }) => {
                Some(Self::Temperature { reference_c, viscous: false, coulomb: true })
            }
        }
    }

    /// Checks its constants.
    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        let within = |name: &str, value: f64, from: f64, to: f64| Expected::Range(from, to).check(name, value);
        match self {
            Self::Stribeck { speed, exponent, width } => {
                within("speed", *speed, 1.0e-9, 1.0e6)?;
                within("exponent", *exponent, 0.1, 10.0)?;
                width.map_or(Ok(()), |width| within("width", width, 1.0e-9, 1.0e6))
            }
            Self::Sigmoid { steepness, offset_speed } => {
                within("steepness", *steepness, 1.0e-6, 1.0e9)?;
                within("offset_speed", *offset_speed, -1.0e6, 1.0e6)
            }
            Self::Temperature { reference_c, viscous, coulomb } => {
                if !viscous && !coulomb {
                    return Err(StudyError::conflict("neither viscous nor coulomb changes", "leave the law out"));
                }
                within("reference_c", *reference_c, -273.15, 1.0e3)
            }
            Self::Load { width } => width.map_or(Ok(()), |width| within("width", width, 1.0e-9, 1.0e6)),
            Self::MaxwellSlip { yield_displacements } => {
                within("number of yield_displacements", yield_displacements.len() as f64, 1.0, MOST_ELEMENTS)?;
                for (place, value) in yield_displacements.iter().enumerate() {
                    within("yield_displacements", *value, 1.0e-7, 100.0)?;
                    if yield_displacements[..place].contains(value) {
                        let (what, name) = ("yield_displacements".to_owned(), value.to_string());
                        return Err(StudyError::Twice { what, name, fix: "give it once" });
                    }
                }
                Ok(())
            }
            Self::AsymmetricViscous {} | Self::AsymmetricCoulomb {} | Self::CubeRoot {} | Self::Quadratic {} => Ok(()),
        }
    }
}
