//! Sizes of differences that all bodies have.

use dynident_dynamics::ParametricModel;
use nalgebra::{DMatrix, DVector};

/// Assumed size of the differences between all bodies and their description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Relative standard deviation of a body in each independent direction: of its mass, of its inertia, and of its
    /// centre of mass in units of the extent of the body.
    pub shape: f64,
    /// Relative standard deviation of a common factor on all ten values of a body. A wrong density causes such a
    /// factor.
    pub scale: f64,
}

impl Spread {
    /// The larger of both standard deviations.
    pub fn largest(self) -> f64 {
        self.shape.max(self.scale)
    }

    /// Whether this is a small difference of all bodies
    /// ([`max_small_share`](crate::DescriptionThresholds::max_small_share)).
    pub(super) fn is_small(self, max_small_share: f64) -> bool {
        self.largest() <= max_small_share
    }

    /// Share of this size in the prior probability of all small (or all large) sizes in [`SPREADS`]; these have equal
    /// shares.
    pub(super) fn share(self, max_small_share: f64) -> f64 {
        let is_small = |own: &Self| own.is_small(max_small_share);
        1.0 / SPREADS.iter().filter(|own| is_small(own) == is_small(&self)).count() as f64
    }
}

/// Compared sizes of the differences of all bodies: rounding of a description, tolerances of manufacturing, wrong
/// densities, and rough descriptions. The common factor may be large while the shape is exact. Otherwise densities that
/// are wrong in all bodies would be attributed to single bodies. Neighbouring large sizes have a ratio of 1.7, which is
/// less than the uncertainty of a standard deviation that seven bodies determine. With a ratio of 3, error bars were
/// too narrow or too wide for sizes in between.
pub const SPREADS: [Spread; 22] = [
    Spread { shape: 0.003, scale: 0.003 },
    Spread { shape: 0.003, scale: 0.01 },
    Spread { shape: 0.003, scale: 0.03 },
    Spread { shape: 0.01, scale: 0.01 },
    Spread { shape: 0.01, scale: 0.03 },
    Spread { shape: 0.03, scale: 0.03 },
    Spread { shape: 0.003, scale: 0.1 },
    Spread { shape: 0.003, scale: 0.3 },
    Spread { shape: 0.01, scale: 0.1 },
    Spread { shape: 0.01, scale: 0.3 },
    Spread { shape: 0.03, scale: 0.1 },
    Spread { shape: 0.03, scale: 0.17 },
    Spread { shape: 0.03, scale: 0.3 },
    Spread { shape: 0.06, scale: 0.17 },
    Spread { shape: 0.06, scale: 0.3 },
    Spread { shape: 0.1, scale: 0.1 },
    Spread { shape: 0.1, scale: 0.17 },
    Spread { shape: 0.1, scale: 0.3 },
    Spread { shape: 0.1, scale: 1.0 },
    Spread { shape: 0.17, scale: 0.17 },
    Spread { shape: 0.17, scale: 0.3 },
    Spread { shape: 0.3, scale: 0.3 },
];

/// The ten nominal values of a body.
pub(super) fn nominal_values(robot: &ParametricModel, body: usize) -> DVector<f64> {
    DVector::from_column_slice(&robot.nominal()[10 * body..10 * body + 10])
}

/// Covariance of all inertial parameters for each size. `spread` contains the changes of the parameters in independent
/// directions.
pub(super) fn covariances_of(spread: &DMatrix<f64>, robot: &ParametricModel, sizes: &[Spread]) -> Vec<DMatrix<f64>> {
    let inertial = robot.model().inertial_count();
    let of_shape = spread * spread.transpose();
    let mut of_scale = DMatrix::zeros(inertial, inertial);
    for body in 0..robot.model().body_count() {
        let own = nominal_values(robot, body);
        of_scale.view_mut((10 * body, 10 * body), (10, 10)).copy_from(&(&own * own.transpose()));
    }
    sizes.iter().map(|own| &of_shape * (own.shape * own.shape) + &of_scale * (own.scale * own.scale)).collect()
}
