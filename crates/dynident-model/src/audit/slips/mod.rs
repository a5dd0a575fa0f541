//! Which slip of the pen, or of an exporter, explains inertials that no body has or that no robot of this size has; and
//! the numbers that were meant.
//!
//! Hypotheses are tried in the order in which slips pile up: what stands in which slot and with which sign
//! ([`Slots`](SlipKind::NegatedMoments) and its kin), units, the point that moments are about, then what only other
//! links or a stated total can show. Each works on the numbers that those before it have mended. A slip has new numbers
//! only where one hypothesis alone explains what is there.

mod about_origin;
mod defaults;
mod slots;
mod total_mass;
mod twins;
mod units;

use super::Lengths;
use crate::spatial::{Mat3, Vec3};
use crate::tree::Model;
use crate::urdf::{MOMENT_NAMES, StatedInertial, UrdfError, stated_inertials};
use nalgebra::Matrix3;

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlipKind {
    /// All moments (or the mass) have the wrong sign.
    NegatedMoments,
    /// Products of inertia have the other convention's sign, so that no body has them.
    NegatedProducts,
    /// A matrix of nine, read row by row, stands in the six slots of the upper triangle.
    RowMajor,
    /// A lower triangle, read row by row, stands in the slots of the upper one.
    LowerTriangle,
    /// Millimetres or grams stand where metres and kilograms are meant.
    Units,
    /// Moments about the frame's origin stand where those about the centre of mass are meant.
    AboutOrigin,
    /// An exporter's default of 1.
    Defaults,
    /// Masses do not add up to the stated total.
    TotalMass,
    /// A mirrored link has other values than its twin.
    Twins,
    /// No body is like that, and none of these slips explains it, or several do.
    Unexplained,
}

impl SlipKind {
    /// The name in reports and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::NegatedMoments => "negated-moments",
            Self::NegatedProducts => "negated-products",
            Self::RowMajor => "row-major",
            Self::LowerTriangle => "lower-triangle",
            Self::Units => "units",
            Self::AboutOrigin => "about-origin",
            Self::Defaults => "defaults",
            Self::TotalMass => "total-mass",
            Self::Twins => "twins",
            Self::Unexplained => "unexplained",
        }
    }
}

/// A slip, its evidence, and the numbers that were meant.
#[derive(Clone, Debug, PartialEq)]
pub struct Slip {
    /// What went wrong.
    pub kind: SlipKind,
    /// The links it concerns.
    pub links: Vec<String>,
    /// What it is and, where the numbers cannot be had from the file, what to do.
    pub message: String,
    /// Why it is believed, in numbers.
    pub evidence: String,
    /// The numbers that were meant; empty where they cannot be known.
    pub corrections: Vec<Correction>,
}

/// One number of one `<inertial>`, as it stands and as it was meant.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// The link.
    pub link: String,
    /// `mass`, `x`, `y`, `z` of the centre of mass, or a moment's name.
    pub number: &'static str,
    /// As it stands.
    pub from: f64,
    /// As it was meant.
    pub to: f64,
}

/// What was found in a URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct Slips {
    /// The slips, in the order in which they were looked for.
    pub found: Vec<Slip>,
    /// The inertials as they stand.
    pub stated: Vec<StatedInertial>,
    /// The same with all corrections made.
    pub corrected: Vec<StatedInertial>,
}

/// Looks for slips in the inertials of a URDF, whose model is `model`; `total_kg` is what its masses should add up to,
/// where somebody has said so (a comment of the file that says `total mass 12.3 kg` counts as well).
///
/// # Errors
/// If the text is no URDF.
pub fn slips(text: &str, model: &Model, total_kg: Option<f64>) -> Result<Slips, UrdfError> {
    let stated = stated_inertials(text)?;
    let lengths = lengths_of(&stated, model);
    let mut search = Search { now: stated.clone(), lengths, found: Vec::new() };
    slots::look(&mut search);
    defaults::look(&mut search);
    units::look(&mut search);
    about_origin::look(&mut search);
    twins::look(&mut search);
    total_mass::look(&mut search, text, total_kg);
    Ok(Slips { found: search.found, stated, corrected: search.now })
}

/// The numbers so far, and what was found.
struct Search {
    now: Vec<StatedInertial>,
    /// Size of the body that each link belongs to, m; none if all joints stand further apart than any robot's, so that
    /// there is nothing to compare with.
    lengths: Option<Vec<f64>>,
    found: Vec<Slip>,
}

impl Search {
    /// Notes a slip and makes its changes: link by link its place and new numbers.
    fn note(&mut self, kind: SlipKind, message: String, evidence: String, changed: Vec<(usize, StatedInertial)>) {
        let links = changed.iter().map(|(place, _)| self.now[*place].link.clone()).collect();
        let mut corrections = Vec::new();
        for (place, new) in changed {
            corrections.extend(differences(&self.now[place], &new));
            self.now[place] = new;
        }
        self.found.push(Slip { kind, links, message, evidence, corrections });
    }

    /// Notes a slip whose numbers cannot be known.
    fn name(&mut self, kind: SlipKind, places: &[usize], message: String, evidence: String) {
        let links = places.iter().map(|&place| self.now[place].link.clone()).collect();
        self.found.push(Slip { kind, links, message, evidence, corrections: Vec::new() });
    }

    /// Places of the links that say something: neither all zero nor without a centre of mass.
    fn with_mass(&self) -> Vec<usize> {
        let says = |stated: &StatedInertial| stated.mass_kg > 0.0 && trace(&stated.moments) > 0.0;
        (0..self.now.len()).filter(|&place| says(&self.now[place])).collect()
    }

    /// `a, b, c and 4 more` of the links at these places.
    fn names(&self, places: &[usize]) -> String {
        const SHOWN: usize = 4;
        let shown: Vec<&str> = places.iter().take(SHOWN).map(|&place| self.now[place].link.as_str()).collect();
        let more = places.len().saturating_sub(SHOWN);
        if more > 0 { format!("{} and {more} more", shown.join(", ")) } else { shown.join(", ") }
    }
}

fn differences(old: &StatedInertial, new: &StatedInertial) -> Vec<Correction> {
    let numbers = |of: &StatedInertial| -> Vec<(&'static str, f64)> {
        let com = ["x", "y", "z"].into_iter().zip(of.com_m);
        core::iter::once(("mass", of.mass_kg)).chain(com).chain(MOMENT_NAMES.into_iter().zip(of.moments)).collect()
    };
    let pairs = numbers(old).into_iter().zip(numbers(new)).filter(|((_, from), (_, to))| from != to);
    pairs.map(|((number, from), (_, to))| Correction { link: old.link.clone(), number, from, to }).collect()
}

/// No common robot has two joints further apart, m.
const LARGEST_OFFSET_M: f64 = 10.0;

fn lengths_of(stated: &[StatedInertial], model: &Model) -> Option<Vec<f64>> {
    if model.tree_joints().iter().any(|joint| joint.placement.translation.norm() > LARGEST_OFFSET_M) {
        return None;
    }
    let lengths = Lengths::of(model);
    let of_body: std::collections::HashMap<&str, f64> = model
        .bodies()
        .iter()
        .zip(&lengths.bodies)
        .flat_map(|(body, length)| body.links.iter().map(move |link| (link.name.as_str(), *length)))
        .collect();
    // The base is about as large as what stands on it is far.
    let on_base = model.tree_joints().iter().filter(|joint| joint.parent.is_none());
    let base = on_base.map(|joint| joint.placement.translation.norm()).fold(0.1, f64::max);
    Some(stated.iter().map(|one| of_body.get(one.link.as_str()).copied().unwrap_or(base)).collect())
}

/// A violation of the triangle inequality by less than this share is rounding in the file.
const ROUNDING: f64 = 1e-2;

/// Whether a body can have these moments about its centre of mass: none negative, none above the sum of the others.
fn possible(moments: &[f64; 6]) -> bool {
    let [least, middle, most] = principal(moments);
    least >= -1e-9 * trace(moments).abs() && most - least - middle <= ROUNDING * most
}

/// Principal moments, ascending.
fn principal(inertia: &[f64; 6]) -> [f64; 3] {
    let [xx, xy, xz, yy, yz, zz] = inertia;
    let matrix = Matrix3::new(*xx, *xy, *xz, *xy, *yy, *yz, *xz, *yz, *zz);
    let mut moments: [f64; 3] = matrix.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    moments
}

fn trace(moments: &[f64; 6]) -> f64 {
    moments[0] + moments[3] + moments[5]
}

fn shown(moments: [f64; 3]) -> String {
    moments.map(|moment| format!("{moment:.3e}")).join(", ")
}

/// The six moments of a matrix.
fn six(m: &Mat3) -> [f64; 6] {
    [m.0[0][0], m.0[0][1], m.0[0][2], m.0[1][1], m.0[1][2], m.0[2][2]]
}

/// `m (rᵀr 1 - r rᵀ)`: what moving the moments from the centre of mass to the frame's origin adds, in the axes of
/// `<origin>`.
fn parallel_axis(stated: &StatedInertial) -> Mat3 {
    let com = stated.axes.transpose_mul_vec(Vec3(stated.com_m));
    (Mat3::IDENTITY.scale(com.dot(com)) - Mat3::outer(com, com)).scale(stated.mass_kg)
}

/// `value · 10^power` as its decimal digits shifted, so that 12.3 and -3 give 0.0123.
fn shifted(value: f64, power: i32) -> f64 {
    let text = format!("{value:e}");
    let exact = text.split_once('e').and_then(|(digits, exponent)| {
        format!("{digits}e{}", exponent.parse::<i32>().ok()? + power).parse::<f64>().ok()
    });
    exact.unwrap_or_else(|| value * 10_f64.powi(power))
}

#[cfg(test)]
mod tests {
    use super::{possible, shifted};

    #[test]
    fn digits_are_kept() {
        assert_eq!(
            [shifted(12.3, -3), shifted(-0.7, -6), shifted(0.0, 9), shifted(1e-3, 3)],
            [0.0123, -7e-7, 0.0, 1.0]
        );
    }

    #[test]
    fn bodies_are_possible() {
        assert!(possible(&[1.0, 0.0, 0.0, 1.0, 0.0, 2.0]) && possible(&[0.0; 6]));
        assert!(!possible(&[1.0, 0.0, 0.0, 1.0, 0.0, 2.1]) && !possible(&[1.0, 2.0, 0.0, 1.0, 0.0, 1.0]));
    }
}
