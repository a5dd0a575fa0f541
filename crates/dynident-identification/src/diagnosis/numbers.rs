//! The number of a mistake between those that are tried: an angle, a factor, a direction at which some value is least.

use super::mistake::Mistake;
use super::units::{is_unit_of_position, is_unit_of_time};

/// Places at which a number is tried before it is narrowed down: what is left has several valleys between a gear and
/// another.
const PLACES: usize = 17;
/// Logarithm of how far from a factor that is tried gears and counts of encoders are looked for, and in how many
/// valleys.
pub(super) const REACH_OF_UNITS: f64 = 2.0;
const MOST_VALLEYS: usize = 4;

/// Mistakes of the same kind whose numbers have less `value` than those around them; of all but positions' units the
/// one with the least.
pub(super) fn valleys(mistake: &Mistake, value: impl Fn(&Mistake) -> f64) -> Vec<Mistake> {
    match mistake {
        Mistake::PositionUnit { joints, factor } if !is_unit_of_position(*factor) => {
            let with = |log: f64| Mistake::PositionUnit { joints: joints.clone(), factor: factor * log.exp() };
            valleys_in(0.0, REACH_OF_UNITS, |log| value(&with(log))).take(MOST_VALLEYS).map(with).collect()
        }
        _ => between_those_tried(mistake, value).into_iter().collect(),
    }
}

/// The mistake of the same kind whose number has the least `value`, near the one of `mistake`; `None` where it has no
/// number, or a unit's.
pub(super) fn between_those_tried(mistake: &Mistake, value: impl Fn(&Mistake) -> f64) -> Option<Mistake> {
    // A factor, within e^±reach.
    let scaled =
        |reach: f64, with: &dyn Fn(f64) -> Mistake| with(least_in(0.0, reach, |log| value(&with(log.exp()))).exp());
    match mistake {
        Mistake::Offset { joint, offset_rad } => {
            let at = |offset_rad: f64| Mistake::Offset { joint: *joint, offset_rad };
            Some(at(least_in(*offset_rad, 0.5, |offset| value(&at(offset)))))
        }
        Mistake::Gravity { gravity_m_s2 } => {
            let mut gravity = *gravity_m_s2;
            if gravity == [0.0; 3] {
                return None;
            }
            // Turned about two axes across it, twice over.
            for round in 0..2 {
                for axis in across(gravity) {
                    let start = gravity;
                    let reach = if round == 0 { 0.5 } else { 0.1 };
                    let turn = least_in(0.0, reach, |angle| {
                        value(&Mistake::Gravity { gravity_m_s2: turned(start, axis, angle) })
                    });
                    gravity = turned(start, axis, turn);
                }
            }
            Some(Mistake::Gravity { gravity_m_s2: gravity })
        }
        Mistake::PositionUnit { joints, factor } => {
            // A gear ratio may be near a unit.
            let with = |times: f64| Mistake::PositionUnit { joints: joints.clone(), factor: factor * times };
            let found = scaled(REACH_OF_UNITS, &with);
            if !is_unit_of_position(*factor) {
                return Some(found);
            }
            let is_a_unit =
                matches!(&found, Mistake::PositionUnit { factor: found, .. } if (found / factor).ln().abs() < 0.1);
            (!is_a_unit).then_some(found)
        }
        Mistake::TorqueUnit { joint, factor } => {
            Some(scaled(1.2, &|times| Mistake::TorqueUnit { joint: *joint, factor: factor * times }))
        }
        Mistake::Length { joint, factor } => {
            Some(scaled(0.7, &|times| Mistake::Length { joint: *joint, factor: factor * times }))
        }
        Mistake::TimeUnit { factor } if !is_unit_of_time(*factor) => {
            Some(scaled(0.4, &|times| Mistake::TimeUnit { factor: factor * times }))
        }
        Mistake::Sign { .. }
        | Mistake::Order { .. }
        | Mistake::TimeUnit { .. }
        | Mistake::Coupled { .. }
        | Mistake::Convention { .. }
        | Mistake::Compensated
        | Mistake::Lag { .. } => None,
    }
}

/// Where `value` is least within `reach` of `centre`, to a hundredth of the reach.
fn least_in(centre: f64, reach: f64, value: impl Fn(f64) -> f64) -> f64 {
    valleys_in(centre, reach, value).next().unwrap_or(centre)
}

/// Where `value` is less than around it within `reach` of `centre`, the deepest first: of [`PLACES`] places those with
/// less than their neighbours, then by thirds around each, to a hundredth of the reach.
fn valleys_in(centre: f64, reach: f64, value: impl Fn(f64) -> f64) -> impl Iterator<Item = f64> {
    let spacing = 2.0 * reach / (PLACES - 1) as f64;
    let place = move |k: usize| centre - reach + spacing * k as f64;
    let values: Vec<f64> = (0..PLACES).map(|k| value(place(k))).collect();
    let around = |k: usize| [k.saturating_sub(1), (k + 1).min(PLACES - 1)];
    let is_valley = |k: &usize| around(*k).iter().all(|&other| values[*k] <= values[other]);
    let mut deepest: Vec<usize> = (0..PLACES).filter(is_valley).collect();
    deepest.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    deepest.into_iter().map(move |k| least_by_thirds(around(k).map(place), 0.02 * reach, &value))
}

/// Where `value`, which has one valley between two places, is least, to within `width`.
pub(super) fn least_by_thirds([mut low, mut high]: [f64; 2], width: f64, value: impl Fn(f64) -> f64) -> f64 {
    while high - low > width {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if value(a) < value(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}

/// Two unit vectors across `v`.
fn across(v: [f64; 3]) -> [[f64; 3]; 2] {
    let least = (0..3).min_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let first = unit(cross(v, other));
    [first, unit(cross(v, first))]
}

/// `v` turned about the unit vector `axis`, across it, by `angle` rad.
fn turned(v: [f64; 3], axis: [f64; 3], angle: f64) -> [f64; 3] {
    let side = cross(axis, v);
    core::array::from_fn(|k| v[k] * angle.cos() + side[k] * angle.sin())
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}
