//! The keys of a D-H table in the file.

use crate::dh_convention::DhConvention;
use crate::joint::JointKind;
use serde::Deserialize;
use toml::Spanned;

pub(super) type Number = Option<Spanned<f64>>;

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Kind {
    #[default]
    Revolute,
    Continuous,
    Prismatic,
}

impl From<Kind> for JointKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Revolute => Self::Revolute,
            Kind::Continuous => Self::Continuous,
            Kind::Prismatic => Self::Prismatic,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    #[serde(default = "default_name")]
    pub(super) name: String,
    pub(super) convention: DhConvention,
    pub(super) gravity_m_s2: Option<Spanned<[f64; 3]>>,
    #[serde(default)]
    pub(super) base: Base,
    #[serde(default, rename = "joint")]
    pub(super) joints: Vec<Spanned<Row>>,
}

fn default_name() -> String {
    "robot".to_owned()
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Base {
    pub(super) link: Option<Spanned<String>>,
    pub(super) xyz_m: Option<Spanned<[f64; 3]>>,
    pub(super) rpy_rad: Option<Spanned<[f64; 3]>>,
    pub(super) rpy_deg: Option<Spanned<[f64; 3]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    pub(super) name: Spanned<String>,
    pub(super) link: Option<Spanned<String>>,
    pub(super) parent: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) kind: Kind,
    pub(super) a_m: Number,
    pub(super) alpha_rad: Number,
    pub(super) alpha_deg: Number,
    pub(super) d_m: Number,
    pub(super) theta_rad: Number,
    pub(super) theta_deg: Number,
    pub(super) sign: Number,
    #[serde(default)]
    pub(super) limits: Limits,
    #[serde(default)]
    pub(super) dynamics: Dynamics,
    pub(super) inertial: Option<Spanned<Inertial>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Limits {
    pub(super) lower_rad: Number,
    pub(super) lower_deg: Number,
    pub(super) lower_m: Number,
    pub(super) upper_rad: Number,
    pub(super) upper_deg: Number,
    pub(super) upper_m: Number,
    pub(super) velocity_rad_s: Number,
    pub(super) velocity_deg_s: Number,
    pub(super) velocity_m_s: Number,
    pub(super) effort_nm: Number,
    pub(super) effort_n: Number,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Dynamics {
    pub(super) damping: Number,
    pub(super) friction: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Inertial {
    pub(super) mass_kg: Number,
    pub(super) com_m: Option<Spanned<[f64; 3]>>,
    pub(super) inertia_at_com: Option<Spanned<[f64; 6]>>,
    pub(super) inertia_at_origin: Option<Spanned<[f64; 6]>>,
    pub(super) parameters: Option<Spanned<[f64; 10]>>,
}
