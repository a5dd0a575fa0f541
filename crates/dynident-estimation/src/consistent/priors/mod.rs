//! Priors of a body: three distances from a prior body, each in its own file.
//!
//! Lee, Wensing and Park, "Geometric robot dynamic identification: a convex programming approach", IEEE T-RO 36 (2020)
//! 348, compare them. All are convex in the parameters and scaled by the prior's mass and size.

mod entropic;
mod euclidean;
mod pullback;

use super::conic::Program;
use super::coordinates::Whitening;
use serde::{Deserialize, Serialize};

/// Distance measure from the prior body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PhysicalPrior {
    /// `tr(P0⁻¹P) − ln det(P0⁻¹P) − 4`: the log-det Bregman divergence, four times the Kullback-Leibler divergence
    /// between the bodies' Gaussians. Infinite on the cone's boundary, so bodies without data stay well inside.
    #[default]
    Entropic,
    /// `½ tr[(P0⁻¹(P − P0))²]`: the affine-invariant metric at the prior, held constant.
    #[serde(alias = "constant-pullback")]
    Pullback,
    /// `½ Σ_k ((π_k − π0_k)/u_k)²`, by parameter, in units of the prior's mass m, m ℓ and m ℓ², `ℓ = √(tr Σ/m)`.
    Euclidean,
}

impl PhysicalPrior {
    /// Adds the prior of one body, whose ten whitened coordinates start at `first`, with a weight; returns the
    /// constant that the program does not include.
    pub(super) fn add_to(self, program: &mut Program, first: usize, body: &PriorBody<'_>, weight: f64) -> f64 {
        match self {
            Self::Entropic => entropic::add_to(program, first, body, weight),
            Self::Pullback => pullback::add_to(program, first, weight),
            Self::Euclidean => euclidean::add_to(program, first, body, weight),
        }
    }
}

pub(super) struct PriorBody<'a> {
    pub(super) reference: &'a [f64; 10],
    pub(super) whitening: &'a Whitening,
    pub(super) label: usize,
}
