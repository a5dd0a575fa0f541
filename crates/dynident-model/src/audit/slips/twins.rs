//! Mirrored links with different values.

use super::{Search, SlipKind, is_possible, principal, trace};
use crate::urdf::{MOMENT_NAMES, StatedInertial};
use std::collections::HashMap;

const SIDES: [[&str; 2]; 6] = [["left", "right"], ["l", "r"], ["fl", "fr"], ["rl", "rr"], ["hl", "hr"], ["bl", "br"]];

/// Reports pairs of left and right links with different masses, distances of the centre of mass or principal moments.
pub(super) fn find(search: &mut Search) {
    let tolerance = search.settings.twin_tolerance;
    for (left, right) in pairs(&search.now) {
        let [a, b] = [left, right].map(|place| search.now[place].clone());
        if are_equal(&a, &b, tolerance) {
            continue;
        }
        let (signs, differing) = mirror(&a, &b, tolerance);
        let list: Vec<String> =
            differing.iter().map(|&k| format!("{} {} and {}", NAMES[k], numbers(&a)[k], numbers(&b)[k])).collect();
        let evidence = format!("{} and {}: {}", a.link, b.link, list.join(", "));
        let bodies = [is_body(&a), is_body(&b)];
        if differing.len() > search.settings.max_differing_values || bodies[0] == bodies[1] {
            let message = format!(
                "{} and {} are mirror images by name, but their numbers differ: compare both with the drawing",
                a.link, b.link
            );
            search.note_uncorrected(SlipKind::Twins, &[left, right], message, evidence);
            continue;
        }
        // If one of the two bodies is possible, its values are used for the other.
        let (good, wrong, place) = if bodies[0] { (&a, &b, right) } else { (&b, &a, left) };
        let mut meant = numbers(wrong);
        for &k in &differing {
            meant[k] = signs[k] * numbers(good)[k] + 0.0;
        }
        let message = format!(
            "{} is impossible and differs from its mirror image {}: use the numbers of the mirror image",
            wrong.link, good.link
        );
        let new = with_numbers(wrong, meant);
        // This explains the link, so its earlier `Unexplained` entry is removed.
        search.found.retain(|slip| !(slip.kind == SlipKind::Unexplained && slip.links == [wrong.link.clone()]));
        search.note(SlipKind::Twins, message, evidence, vec![(place, new)]);
    }
}

fn is_body(stated: &StatedInertial) -> bool {
    stated.mass_kg > 0.0 && is_possible(&stated.moments)
}

fn pairs(stated: &[StatedInertial]) -> Vec<(usize, usize)> {
    let places: HashMap<String, usize> =
        stated.iter().enumerate().map(|(place, one)| (one.link.to_lowercase(), place)).collect();
    let mut pairs = Vec::new();
    for (place, one) in stated.iter().enumerate() {
        let name = one.link.to_lowercase();
        let twin = SIDES.iter().find_map(|[left, right]| places.get(&replaced(&name, left, right)?).copied());
        pairs.extend(twin.map(|twin| (place, twin)));
    }
    pairs
}

/// `name` with the word `left` replaced by `right`; `None` if `left` does not occur as a word. Long words are also
/// found inside other words.
fn replaced(name: &str, left: &str, right: &str) -> Option<String> {
    if left.len() > 2 {
        return name.contains(left).then(|| name.replace(left, right));
    }
    let words: Vec<&str> = name.split('_').collect();
    let at = words.iter().position(|word| *word == left)?;
    Some(words.iter().enumerate().map(|(k, word)| if k == at { right } else { *word }).collect::<Vec<_>>().join("_"))
}

/// Whether two links have equal mass, centre-of-mass distance and principal moments, in any frame.
fn are_equal(a: &StatedInertial, b: &StatedInertial, tolerance: f64) -> bool {
    let near = |x: f64, y: f64, scale: f64| (x - y).abs() <= tolerance * scale;
    let distance = |one: &StatedInertial| one.com_m.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (of_a, of_b) = (principal(&a.moments), principal(&b.moments));
    let size = of_a.iter().chain(&of_b).fold(0.0_f64, |most, moment| most.max(moment.abs()));
    near(a.mass_kg, b.mass_kg, a.mass_kg.abs().max(b.mass_kg.abs()))
        // Differences below 0.1 mm are ignored.
        && (distance(a) - distance(b)).abs() <= tolerance * distance(a).max(distance(b)) + 1e-4
        && of_a.iter().zip(&of_b).all(|(a, b)| near(*a, *b, size))
}

const NAMES: [&str; 10] = ["mass", "x", "y", "z", "ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

fn numbers(of: &StatedInertial) -> [f64; 10] {
    let ([x, y, z], [a, b, c, d, e, f]) = (of.com_m, of.moments);
    [of.mass_kg, x, y, z, a, b, c, d, e, f]
}

fn with_numbers(of: &StatedInertial, numbers: [f64; 10]) -> StatedInertial {
    let [mass_kg, x, y, z, a, b, c, d, e, f] = numbers;
    debug_assert_eq!(MOMENT_NAMES.len() + 4, NAMES.len());
    StatedInertial { mass_kg, com_m: [x, y, z], moments: [a, b, c, d, e, f], ..of.clone() }
}

/// The reflection (signs of the axes) with the fewest differing numbers: sign of each number, and indices of the
/// differing numbers.
fn mirror(a: &StatedInertial, b: &StatedInertial, tolerance: f64) -> ([f64; 10], Vec<usize>) {
    let (of_a, of_b) = (numbers(a), numbers(b));
    let size = trace(&a.moments).abs().max(trace(&b.moments).abs());
    let length = of_a[1..4].iter().chain(&of_b[1..4]).fold(0.0_f64, |most, x| most.max(x.abs()));
    let mut best: Option<([f64; 10], Vec<usize>)> = None;
    // The most common cases first: copy, and reflection in the xz plane.
    for [x, y, z] in [
        [1.0, 1.0, 1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
        [-1.0, 1.0, -1.0],
        [1.0, -1.0, -1.0],
        [-1.0; 3],
    ] {
        let signs = [1.0, x, y, z, 1.0, x * y, x * z, 1.0, y * z, 1.0];
        let differs = |k: usize| {
            let scale = match k {
                0 => of_a[0].abs().max(of_b[0].abs()),
                1..=3 => length + 0.005,
                _ => size,
            };
            (signs[k] * of_a[k] - of_b[k]).abs() > tolerance * scale
        };
        let differing: Vec<usize> = (0..10).filter(|&k| differs(k)).collect();
        if best.as_ref().is_none_or(|(_, least)| differing.len() < least.len()) {
            best = Some((signs, differing));
        }
    }
    best.unwrap_or(([1.0; 10], Vec::new()))
}
