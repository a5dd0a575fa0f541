//! Family from a user's motion function. Joints have separate parameters, the same number each.

use super::error::{FamilyError, require, require_frame};
use super::random_start::{grid, scale_and_shift};
use super::sampled_basis::{GridCache, SampledBasis};
use crate::family::{Family, check_shapes};
use crate::motion::{Motion, MotionAdjoint};
use core::fmt::Debug;
use dynident_model::sample::Random;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

const NAME: &str = "function";

/// Relative step of a parameter, as a share of `1 + |p|`, for finite differences of a nonlinear motion: the cube root
/// of the rounding.
const RELATIVE_STEP: f64 = 6e-6;
/// Largest deviation from linearity, as a share of the motion, that is attributed to rounding.
const LINEARITY_TOLERANCE: f64 = 1e-9;
/// Largest deviation from 1 of the motion that must be constant 1.
const CONSTANT_TOLERANCE: f64 = 1e-6;
const SEED: u64 = 33;
const MAX_PARAMETERS: usize = 1000;

/// Motion of all joints as a function of their parameters, for many instants at once.
///
/// Each joint depends only on its own parameters. Velocity, acceleration and jerk must be the derivatives of the
/// position.
pub trait MotionFunction: Debug + Send + Sync {
    /// Writes the motion at `times_s` into `out`, which already has its size; `parameters` are stored joint after
    /// joint.
    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion);
}

/// Settings of a [`FunctionFamily`].
#[derive(Clone, Debug, PartialEq)]
pub struct FunctionFamilySettings {
    /// Name of the function in results.
    pub function: String,
    /// Number of free parameters of each joint, 1 to 1000.
    pub parameters: usize,
    /// Whether the motion is linear in the parameters and zero if all parameters are zero. Gradients are then exact,
    /// and the function is called once for each parameter and grid of times. Otherwise the motion is differentiated
    /// numerically, with two calls for each parameter and step of the search. Default false.
    pub linear: bool,
}

/// Family of the motions of a user's [`MotionFunction`].
///
/// A random start draws every parameter from the standard normal distribution. If the family is linear and contains a
/// constant motion, the start is then scaled to a part of each joint's range and velocity limit and shifted into the
/// range. Otherwise the function must create reasonable motions from such parameters.
#[derive(Debug)]
pub struct FunctionFamily {
    function: Arc<dyn MotionFunction>,
    joints: usize,
    duration_s: f64,
    parameters: usize,
    linear: Option<Linear>,
}

#[derive(Debug)]
struct Linear {
    grids: GridCache,
    standing: Option<Vec<f64>>,
}

impl FunctionFamily {
    /// Creates the family for a number of joints and a duration (s).
    ///
    /// # Errors
    /// Invalid settings; a function that is declared linear but is not; a motion that is not finite.
    pub fn new(
        joints: usize,
        duration_s: f64,
        settings: &FunctionFamilySettings,
        function: Arc<dyn MotionFunction>,
    ) -> Result<Self, FamilyError> {
        require_frame(NAME, joints, duration_s)?;
        let parameters = settings.parameters;
        let is_sensible = (1..=MAX_PARAMETERS).contains(&parameters);
        require(is_sensible, NAME, "parameters", parameters as f64, "give 1 to 1000 per joint")?;
        let mut family = Self { function, joints, duration_s, parameters, linear: None };
        let wrong = |problem| FamilyError::Function { name: settings.function.clone(), problem };
        let times = grid(duration_s);
        let mut random = Random::new(SEED);
        let draws: Vec<f64> = (0..joints * parameters).map(|_| random.normal()).collect();
        let mut motion = Motion::default();
        family.motion(&draws, &times, &mut motion);
        let values = |motion: &Motion| motion.arrays().map(Clone::clone).concat();
        let tried = values(&motion);
        if tried.iter().any(|value| !value.is_finite()) {
            return Err(wrong("the motion is not finite for parameters of the standard normal distribution"));
        }
        if settings.linear {
            family.linear = Some(Linear { grids: GridCache::default(), standing: family.standing(&times) });
            family.motion(&draws, &times, &mut motion);
            let largest = tried.iter().fold(1e-300_f64, |most, value| most.max(value.abs()));
            let is_linear = values(&motion)
                .iter()
                .zip(&tried)
                .all(|(by_basis, own)| (by_basis - own).abs() <= LINEARITY_TOLERANCE * largest);
            if !is_linear {
                return Err(wrong(
                    "the motion is not linear in its parameters (or not zero at zero): omit linear = true",
                ));
            }
        }
        Ok(family)
    }

    fn called(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        out.reset(self.joints, times_s.len());
        self.function.motion(parameters, times_s, out);
    }

    fn columns(&self, times_s: &[f64]) -> Vec<Motion> {
        let of = |column: usize| {
            let mut one = vec![0.0; self.joints * self.parameters];
            one.iter_mut().skip(column).step_by(self.parameters).for_each(|value| *value = 1.0);
            let mut motion = Motion::default();
            self.called(&one, times_s, &mut motion);
            motion
        };
        (0..self.parameters).map(of).collect()
    }

    /// Parameters of the constant motion with value 1, by least squares; `None` if the family does not contain it.
    fn standing(&self, times_s: &[f64]) -> Option<Vec<f64>> {
        let columns = self.columns(times_s);
        let mut standing = Vec::new();
        for joint in 0..self.joints {
            let basis = DMatrix::from_fn(times_s.len(), self.parameters, |row, column| {
                let motion = &columns[column];
                motion.q[motion.of(joint)][row]
            });
            let one = DVector::from_element(times_s.len(), 1.0);
            let found = basis.clone().svd(true, true).solve(&one, 1e-12).ok()?;
            let worst = (&basis * &found - one).amax();
            if worst.is_nan() || worst >= CONSTANT_TOLERANCE {
                return None;
            }
            standing.extend(found.iter());
        }
        Some(standing)
    }

    /// Calls `with` for the basis on the grid, or for each of the grid's pieces with the index where the piece
    /// begins.
    fn on_grid(&self, linear: &Linear, times_s: &[f64], with: impl FnMut(&SampledBasis, usize)) {
        let sample = |times: &[f64]| {
            let columns = self.columns(times);
            let at = core::cell::Cell::new(0);
            // Samples are requested in order, joint by joint.
            SampledBasis::new(self.parameters, self.joints, times, |joint, _, out| {
                let sample = at.get() % times.len();
                at.set(at.get() + 1);
                for (to, motion) in out.iter_mut().zip(&columns) {
                    let place = joint * times.len() + sample;
                    *to = motion.arrays().map(|values| values[place]);
                }
            })
        };
        linear.grids.each(self.parameters * self.joints, times_s, sample, with);
    }
}

impl Family for FunctionFamily {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.joints
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn parameters(&self) -> usize {
        self.joints * self.parameters
    }

    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        let mut parameters: Vec<f64> = (0..Family::parameters(self)).map(|_| random.normal()).collect();
        let Some(standing) = self.linear.as_ref().and_then(|linear| linear.standing.as_ref()) else {
            return parameters;
        };
        let mut motion = Motion::default();
        self.motion(&parameters, &grid(self.duration_s), &mut motion);
        let joints = parameters.chunks_mut(self.parameters).zip(standing.chunks(self.parameters)).enumerate();
        for (joint, (own, standing)) in joints {
            let span = motion.of(joint);
            let [scale, shift] =
                scale_and_shift(&motion.q[span.clone()], &motion.dq[span], ranges[joint], speeds[joint], random);
            for (value, one) in own.iter_mut().zip(standing) {
                *value = scale * *value + shift * one;
            }
        }
        parameters
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        assert_eq!(parameters.len(), Family::parameters(self), "parameters of {NAME}");
        let Some(linear) = &self.linear else { return self.called(parameters, times_s, out) };
        out.reset(self.joints, times_s.len());
        self.on_grid(linear, times_s, |basis, from| basis.motion(parameters, from, out));
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        check_shapes(self, parameters, times_s, adjoint, gradient);
        if let Some(linear) = &self.linear {
            return self.on_grid(linear, times_s, |basis, from| basis.apply_adjoint(from, adjoint, gradient));
        }
        // One parameter of every joint is changed at a time, because joints are independent.
        let mut moved = parameters.to_vec();
        let mut sides = [Motion::default(), Motion::default()];
        for column in 0..self.parameters {
            let own = || (column..parameters.len()).step_by(self.parameters);
            for (side, sign) in sides.iter_mut().zip([-1.0, 1.0]) {
                own().for_each(|at| moved[at] = parameters[at] + sign * RELATIVE_STEP * (1.0 + parameters[at].abs()));
                self.called(&moved, times_s, side);
            }
            own().for_each(|at| moved[at] = parameters[at]);
            let [below, above] = &sides;
            for (joint, at) in own().enumerate() {
                let span = adjoint.of(joint);
                let sides = below.arrays().into_iter().zip(above.arrays());
                let pulled: f64 = adjoint
                    .arrays()
                    .into_iter()
                    .zip(sides)
                    .map(|(pull, (below, above))| -> f64 {
                        let changes = below[span.clone()].iter().zip(&above[span.clone()]);
                        let pulls = pull[span.clone()].iter().zip(changes).filter(|(pull, _)| **pull != 0.0);
                        pulls.map(|(pull, (below, above))| pull * (above - below)).sum()
                    })
                    .sum();
                gradient[at] += pulled / (2.0 * RELATIVE_STEP * (1.0 + parameters[at].abs()));
            }
        }
    }

    fn is_linear(&self) -> bool {
        self.linear.is_some()
    }

    fn curvature(
        &self,
        _parameters: &[f64],
        times_s: &[f64],
        joint: usize,
        weights: &MotionAdjoint,
        out: &mut DMatrix<f64>,
    ) -> bool {
        let Some(linear) = &self.linear else { return false };
        assert_eq!(out.shape(), (self.parameters, self.parameters), "curvature of {NAME}");
        assert_eq!((weights.joints, weights.samples), (self.joints, times_s.len()), "weights of {NAME}");
        self.on_grid(linear, times_s, |basis, from| basis.curvature(from, joint, weights, out));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::{Fourier, FourierSettings, check};

    #[derive(Debug)]
    struct Series(Fourier);

    impl MotionFunction for Series {
        fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
            self.0.motion(parameters, times_s, out);
        }
    }

    fn families() -> (Fourier, FunctionFamily, FunctionFamily) {
        let fourier = || Fourier::new(3, 7.0, &FourierSettings::default()).unwrap();
        let settings = FunctionFamilySettings { function: "series".to_owned(), parameters: 9, linear: true };
        let linear = FunctionFamily::new(3, 7.0, &settings, Arc::new(Series(fourier()))).unwrap();
        let settings = FunctionFamilySettings { linear: false, ..settings };
        (fourier(), linear, FunctionFamily::new(3, 7.0, &settings, Arc::new(Series(fourier()))).unwrap())
    }

    /// Same motion, starts and gradients as the built-in family: up to rounding if linear; numerically differentiated
    /// gradients have an error of about 1e-10, relative to the largest.
    #[test]
    fn the_series_as_code_is_the_series() {
        let (fourier, linear, differentiated) = families();
        let ranges = [[-2.0, 1.0]; 3];
        let start = |family: &dyn Family| family.random(&ranges, &[3.0; 3], &mut Random::new(8));
        let parameters = start(&fourier);
        assert!(parameters.iter().zip(start(&linear)).all(|(a, b)| (a - b).abs() < 1e-12));
        let times: Vec<f64> = (0..50).map(|k| 0.14 * f64::from(k)).collect();
        let mut adjoint = Motion::default();
        adjoint.reset(3, 50);
        let mut random = Random::new(9);
        for values in adjoint.arrays_mut() {
            values.fill_with(|| random.normal());
        }
        let gradient = |family: &dyn Family| {
            let mut gradient = vec![0.0; 27];
            family.apply_adjoint(&parameters, &times, &adjoint, &mut gradient);
            gradient
        };
        let expected = gradient(&fourier);
        let largest = expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        for (family, tolerance) in [(&linear, 1e-12), (&differentiated, 1e-8)] {
            let found = gradient(family);
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < tolerance * largest));
            let (mut own, mut built_in) = (Motion::default(), Motion::default());
            family.motion(&parameters, &times, &mut own);
            fourier.motion(&parameters, &times, &mut built_in);
            assert!(own.dddq.iter().zip(&built_in.dddq).all(|(a, b)| (a - b).abs() < 1e-11));
        }
        check::curvature(&linear, 3);
    }

    #[test]
    fn nonlinear_functions_are_detected() {
        #[derive(Debug)]
        struct Shifted;
        impl MotionFunction for Shifted {
            fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
                for joint in 0..out.joints {
                    for (sample, time) in times_s.iter().enumerate() {
                        out.q[joint * out.samples + sample] = 1.0 + parameters[joint] * time.sin();
                    }
                }
            }
        }
        let settings = FunctionFamilySettings { function: "shifted".to_owned(), parameters: 1, linear: true };
        let made = FunctionFamily::new(2, 5.0, &settings, Arc::new(Shifted));
        assert!(matches!(made, Err(FamilyError::Function { .. })));
        let settings = FunctionFamilySettings { linear: false, ..settings };
        assert!(FunctionFamily::new(2, 5.0, &settings, Arc::new(Shifted)).is_ok());
        let settings = FunctionFamilySettings { parameters: 0, ..settings };
        assert!(FunctionFamily::new(2, 5.0, &settings, Arc::new(Shifted)).is_err());
    }
}
