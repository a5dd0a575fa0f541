//! The constants of a term's curve (width of a step, Stribeck velocity, ..) as coordinates that can be moved.

use super::candidates::{JointScale, STRIBECK_WIDTH};
use dynident_model::terms::{Coulomb, CoulombShape, DirectionalCoulomb, LoadFriction, Sigmoid, Stribeck, TorqueTerm};

/// The constants of a term as coordinates on one scale: a step of ln r is a change by the factor r. The width of a step
/// at rest comes first.
pub(super) fn coordinates(term: &TorqueTerm) -> Vec<f64> {
    let of_shape = |shape: &CoulombShape| match shape {
        CoulombShape::Smooth { width } => vec![width.ln()],
        CoulombShape::Sign { .. } => Vec::new(),
    };
    match term {
        TorqueTerm::Coulomb(term) => of_shape(&term.shape),
        TorqueTerm::DirectionalCoulomb(term) => of_shape(&term.shape),
        TorqueTerm::Load(term) => of_shape(&term.shape),
        TorqueTerm::Stribeck(term) => vec![term.speed.ln(), term.exponent.ln()],
        // The step's distance from rest in units of its width.
        TorqueTerm::Sigmoid(term) => vec![term.steepness.ln(), 0.5 * term.offset_speed * term.steepness],
        TorqueTerm::Viscous(_)
        | TorqueTerm::DirectionalViscous(_)
        | TorqueTerm::Power(_)
        | TorqueTerm::MaxwellSlip(_)
        | TorqueTerm::TemperatureViscous(_)
        | TorqueTerm::TemperatureCoulomb(_)
        | TorqueTerm::Offset(_)
        | TorqueTerm::DriveInertia(_)
        | TorqueTerm::Coupling(_)
        | TorqueTerm::Declared(_) => Vec::new(),
    }
}

/// Bounds of velocities, rad/s (m/s) of a usual arm, and of exponents.
const VELOCITIES: [f64; 2] = [1.0e-4, 10.0];
const EXPONENTS: [f64; 2] = [0.5, 3.0];
/// Furthest that a step is from rest, in units of its width.
const MOST_SHIFT: f64 = 2.0;

/// The constant of this logarithm, within its bounds.
fn within(logarithm: f64, range_s: [f64; 2]) -> f64 {
    let [least, most] = range_s;
    logarithm.clamp(least.ln(), most.ln()).exp()
}

/// The term of a joint with its constants at these coordinates.
pub(super) fn at(term: &TorqueTerm, coordinates: &[f64], scale: JointScale) -> TorqueTerm {
    let velocities = VELOCITIES.map(|usual| usual * scale.velocity);
    let shape = |shape: CoulombShape| match (shape, coordinates) {
        (CoulombShape::Smooth { .. }, [width, ..]) => CoulombShape::Smooth { width: within(*width, velocities) },
        _ => shape,
    };
    match (term, coordinates) {
        (TorqueTerm::Coulomb(own), _) => TorqueTerm::Coulomb(Coulomb { shape: shape(own.shape), ..*own }),
        (TorqueTerm::DirectionalCoulomb(own), _) => {
            TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { shape: shape(own.shape), ..*own })
        }
        (TorqueTerm::Load(own), _) => TorqueTerm::Load(LoadFriction { shape: shape(own.shape), ..*own }),
        (TorqueTerm::Stribeck(own), [speed, exponent]) => {
            let speed = within(*speed, velocities);
            let shape = match own.shape {
                CoulombShape::Smooth { .. } => CoulombShape::Smooth { width: STRIBECK_WIDTH * speed },
                dry @ CoulombShape::Sign { .. } => dry,
            };
            TorqueTerm::Stribeck(Stribeck { speed, exponent: within(*exponent, EXPONENTS), shape, ..*own })
        }
        (TorqueTerm::Sigmoid(own), [steepness, shift]) => {
            let steepness = 2.0 / within((2.0 / steepness.exp()).ln(), velocities);
            let offset_speed = 2.0 * shift.clamp(-MOST_SHIFT, MOST_SHIFT) / steepness;
            TorqueTerm::Sigmoid(Sigmoid { steepness, offset_speed, ..*own })
        }
        _ => term.clone(),
    }
}

/// The name of the constant behind a coordinate, and its value where the coordinates are these.
pub(super) fn value_at(term: &TorqueTerm, place: usize, coordinates: &[f64], scale: JointScale) -> (&'static str, f64) {
    match (at(term, coordinates, scale), place) {
        (TorqueTerm::Stribeck(own), 0) => ("speed", own.speed),
        (TorqueTerm::Stribeck(own), _) => ("exponent", own.exponent),
        (TorqueTerm::Sigmoid(own), 0) => ("steepness", own.steepness),
        (TorqueTerm::Sigmoid(own), _) => ("offset_speed", own.offset_speed),
        _ => ("width", coordinates[place].exp()),
    }
}

/// The step of a term that changes its sign at rest.
pub(super) fn step_of(term: &TorqueTerm) -> Option<CoulombShape> {
    match term {
        TorqueTerm::Coulomb(own) => Some(own.shape),
        TorqueTerm::DirectionalCoulomb(own) => Some(own.shape),
        TorqueTerm::Load(own) => Some(own.shape),
        TorqueTerm::Stribeck(own) => Some(own.shape),
        _ => None,
    }
}

/// Width of the smooth step of a term that changes its sign at rest, rad/s (m/s).
pub(crate) fn smooth_width(term: &TorqueTerm) -> Option<f64> {
    match step_of(term)? {
        CoulombShape::Smooth { width } => Some(width),
        CoulombShape::Sign { .. } => None,
    }
}

/// The terms of a joint with one step at rest, that of Coulomb friction: they are one friction,
/// `(F_c + F_s e^{-|q̇/v_s|^δ} + μ |τ|) s(q̇)`. Stribeck friction beside a smooth step keeps its own: where real joints
/// creep before they break loose, the data tell the two apart.
pub(super) fn with_one_step(mut terms: Vec<TorqueTerm>) -> Vec<TorqueTerm> {
    let of_coulomb = |term: &TorqueTerm| match term {
        TorqueTerm::Coulomb(_) | TorqueTerm::DirectionalCoulomb(_) => step_of(term),
        _ => None,
    };
    if let Some(step) = terms.iter().find_map(of_coulomb) {
        for term in &mut terms {
            match (term, step) {
                (TorqueTerm::Stribeck(own), CoulombShape::Sign { .. }) => own.shape = step,
                (TorqueTerm::Load(own), CoulombShape::Smooth { .. }) => own.shape = step,
                _ => {}
            }
        }
    }
    terms
}

/// One term in place of several that differ in their constants: at the mean of their coordinates, by their weights.
///
/// # Panics
/// If there is no term.
pub(super) fn mean_term(weighted: &[(&TorqueTerm, f64)], scale: JointScale) -> TorqueTerm {
    let total: f64 = weighted.iter().map(|(_, weight)| weight).sum();
    let mut mean = coordinates(weighted[0].0);
    for (place, value) in mean.iter_mut().enumerate() {
        let sum: f64 = weighted
            .iter()
            .map(|(term, weight)| weight * coordinates(term).get(place).copied().unwrap_or(*value))
            .sum();
        *value = sum / total;
    }
    at(weighted[0].0, &mean, scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMOOTH: CoulombShape = CoulombShape::Smooth { width: 0.03 };
    const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };
    const USUAL: JointScale = JointScale::usual(0);

    fn stribeck(shape: CoulombShape) -> TorqueTerm {
        TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.1, exponent: 1.5, shape })
    }

    #[test]
    fn a_joint_has_one_step_at_rest() {
        let narrow = CoulombShape::Smooth { width: 0.01 };
        let load = |shape| TorqueTerm::Load(LoadFriction { joint: 0, shape });
        for step in [SMOOTH, SIGN] {
            let coulomb = TorqueTerm::Coulomb(Coulomb { joint: 0, shape: step });
            let found = with_one_step(vec![coulomb.clone(), stribeck(narrow), load(narrow)]);
            let [of_stribeck, of_load] = if step == SIGN { [SIGN, narrow] } else { [narrow, SMOOTH] };
            assert_eq!(found, [coulomb, stribeck(of_stribeck), load(of_load)]);
        }
        // Without Coulomb friction everything has its own.
        assert_eq!(with_one_step(vec![stribeck(narrow)]), [stribeck(narrow)]);
    }

    #[test]
    fn a_term_is_where_its_coordinates_say() {
        let sigmoid = TorqueTerm::Sigmoid(Sigmoid { joint: 0, steepness: 40.0, offset_speed: 0.01 });
        let coulomb = TorqueTerm::Coulomb(Coulomb { joint: 0, shape: SMOOTH });
        for term in [stribeck(SMOOTH), stribeck(SIGN), sigmoid, coulomb] {
            let own = coordinates(&term);
            let back = coordinates(&at(&term, &own, USUAL));
            // Logarithms and back: a few roundings.
            assert!(own.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-12) && own.len() == back.len(), "{term:?}");
        }
        // A change of one coordinate is a change of the constant that it names, and of no other.
        let names = ["speed", "exponent"];
        let own = coordinates(&stribeck(SMOOTH));
        for (place, name) in names.into_iter().enumerate() {
            let mut moved = own.clone();
            moved[place] += 0.5;
            let values: Vec<_> = (0..2).map(|place| value_at(&stribeck(SMOOTH), place, &moved, USUAL)).collect();
            assert!(values.iter().map(|(name, _)| *name).eq(names), "{values:?}");
            let ratio = values[place].1 / value_at(&stribeck(SMOOTH), place, &own, USUAL).1;
            assert!((ratio - 0.5_f64.exp()).abs() < 1e-12, "{name}: {ratio}");
        }
    }
}
