//! Finds the mistake in a URDF that explains impossible or implausible inertials, and computes the intended numbers.
//!
//! Hypotheses are tested in a fixed order, because mistakes can occur together: slots and signs of the numbers
//! ([`NegatedMoments`](SlipKind::NegatedMoments) to [`LowerTriangle`](SlipKind::LowerTriangle)), units, reference
//! point of the moments, then comparison with other links and with a total mass in the file. Each hypothesis uses the
//! numbers corrected by the previous ones. A mistake is corrected only if exactly one hypothesis explains the
//! numbers. The corrected body must also have no finding of the audit that the original body does not have.

mod about_origin;
mod defaults;
mod settings;
mod slots;
mod take_back;
mod total_mass;
mod twins;
mod units;

pub use settings::SlipSettings;

use super::Lengths;
use crate::spatial::{Mat3, Vec3};
use crate::tree::Model;
use crate::urdf::{MOMENT_NAMES, StatedInertial, UrdfError, stated_inertials};
use nalgebra::Matrix3;

/// Kind of mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlipKind {
    /// All moments (or the mass) have the wrong sign.
    NegatedMoments,
    /// Products of inertia have the opposite sign convention, which makes the body impossible.
    NegatedProducts,
    /// A full 3 x 3 matrix, read row by row, was written into the six slots of the upper triangle.
    RowMajor,
    /// A lower triangle, read row by row, was written into the slots of the upper triangle.
    LowerTriangle,
    /// Millimetres or grams were used instead of metres and kilograms.
    Units,
    /// Moments are about the frame's origin instead of the centre of mass.
    AboutOrigin,
    /// An exporter wrote its default of 1.
    Defaults,
    /// Masses do not add up to the total mass in the file.
    TotalMass,
    /// A mirrored link has different values from its counterpart.
    Twins,
    /// An impossible body that none of these mistakes explains, or that several explain.
    Unexplained,
}

impl SlipKind {
    /// Name in reports and in JSON.
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

/// A mistake in a URDF, its evidence, and the corrected numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct DescriptionError {
    /// Kind of mistake.
    pub kind: SlipKind,
    /// Affected links.
    pub links: Vec<String>,
    /// Problem. If the file does not determine the correct numbers, also what to do.
    pub message: String,
    /// Evidence in numbers.
    pub evidence: String,
    /// Corrected numbers; empty if they are not known.
    pub corrections: Vec<Correction>,
}

/// Correction of one number of one `<inertial>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// Name of the link.
    pub link: String,
    /// `mass`; `x`, `y` or `z` of the centre of mass; or the name of a moment.
    pub number: &'static str,
    /// Value in the file.
    pub from: f64,
    /// Corrected value.
    pub to: f64,
}

/// Result of the search for mistakes in a URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct Slips {
    /// Mistakes, in the order of the search.
    pub found: Vec<DescriptionError>,
    /// Inertials in the file.
    pub stated: Vec<StatedInertial>,
    /// Inertials with all corrections.
    pub corrected: Vec<StatedInertial>,
}

/// Searches the inertials of a URDF, whose model is `model`, for mistakes. `total_kg` is the known total mass, if
/// available; a comment such as `total mass 12.3 kg` in the file is also used.
///
/// # Errors
/// Invalid URDF.
pub fn slips(text: &str, model: &Model, total_kg: Option<f64>) -> Result<Slips, UrdfError> {
    slips_with(text, model, total_kg, &SlipSettings::default())
}

/// Like [`slips`], with other thresholds, which must be [valid](SlipSettings::validate).
///
/// # Errors
/// Invalid URDF.
pub fn slips_with(
    text: &str,
    model: &Model,
    total_kg: Option<f64>,
    settings: &SlipSettings,
) -> Result<Slips, UrdfError> {
    let stated = stated_inertials(text)?;
    let lengths = body_lengths(&stated, model, settings.max_joint_offset_m);
    let moving = || model.bodies().iter().flat_map(|body| &body.links);
    let moves = stated.iter().map(|one| moving().any(|link| link.name == one.link)).collect();
    let mut search = Search { settings: settings.clone(), now: stated.clone(), lengths, moves, found: Vec::new() };
    slots::find(&mut search);
    defaults::find(&mut search);
    units::find(&mut search);
    about_origin::find(&mut search);
    twins::find(&mut search);
    total_mass::find(&mut search, text, total_kg);
    take_back::implausible(&mut search, &stated);
    Ok(Slips { found: search.found, stated, corrected: search.now })
}

struct Search {
    settings: SlipSettings,
    now: Vec<StatedInertial>,
    /// Size of each link's body, m; `None` if all joints are implausibly far apart, so that no length is available for
    /// comparison.
    lengths: Option<Vec<f64>>,
    /// Whether each link belongs to a moving body. The size of other links does not follow from the distances between
    /// joints.
    moves: Vec<bool>,
    found: Vec<DescriptionError>,
}

impl Search {
    /// Records a mistake and applies its corrections, which are given as index and new numbers of each link.
    fn note(&mut self, kind: SlipKind, message: String, evidence: String, changed: Vec<(usize, StatedInertial)>) {
        let links = changed.iter().map(|(place, _)| self.now[*place].link.clone()).collect();
        let mut corrections = Vec::new();
        for (place, new) in changed {
            corrections.extend(differences(&self.now[place], &new));
            self.now[place] = new;
        }
        self.found.push(DescriptionError { kind, links, message, evidence, corrections });
    }

    fn note_uncorrected(&mut self, kind: SlipKind, places: &[usize], message: String, evidence: String) {
        let links = places.iter().map(|&place| self.now[place].link.clone()).collect();
        self.found.push(DescriptionError { kind, links, message, evidence, corrections: Vec::new() });
    }

    /// Indices of the links with a nonzero inertial and a centre of mass.
    fn with_mass(&self) -> Vec<usize> {
        let is_stated = |stated: &StatedInertial| stated.mass_kg > 0.0 && trace(&stated.moments) > 0.0;
        (0..self.now.len()).filter(|&place| is_stated(&self.now[place])).collect()
    }

    /// Names of these links: `a, b, c, d and 4 more`.
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

fn body_lengths(stated: &[StatedInertial], model: &Model, max_joint_offset_m: f64) -> Option<Vec<f64>> {
    if model.tree_joints().iter().any(|joint| joint.placement.translation.norm() > max_joint_offset_m) {
        return None;
    }
    let lengths = Lengths::of(model);
    let of_body: std::collections::HashMap<&str, f64> = model
        .bodies()
        .iter()
        .zip(&lengths.bodies)
        .flat_map(|(body, length)| body.links.iter().map(move |link| (link.name.as_str(), *length)))
        .collect();
    // The size of the base is estimated by the distance of the joints mounted on it.
    let on_base = model.tree_joints().iter().filter(|joint| joint.parent.is_none());
    let base = on_base.map(|joint| joint.placement.translation.norm()).fold(0.1, f64::max);
    Some(stated.iter().map(|one| of_body.get(one.link.as_str()).copied().unwrap_or(base)).collect())
}

/// Tolerance of the triangle inequality, relative: rounding in the file.
const TRIANGLE_TOLERANCE: f64 = 1e-2;

/// Whether a body can have these moments about its centre of mass: none negative, none above the sum of the other two.
fn is_possible(moments: &[f64; 6]) -> bool {
    let [least, middle, most] = principal(moments);
    least >= -1e-9 * trace(moments).abs() && most - least - middle <= TRIANGLE_TOLERANCE * most
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

fn upper_triangle(m: &Mat3) -> [f64; 6] {
    [m.0[0][0], m.0[0][1], m.0[0][2], m.0[1][1], m.0[1][2], m.0[2][2]]
}

/// Parallel-axis term `m (rᵀr 1 - r rᵀ)` from the centre of mass to the frame's origin, in the axes of `<origin>`.
fn parallel_axis(stated: &StatedInertial) -> Mat3 {
    let com = stated.axes.transpose_mul_vec(Vec3(stated.com_m));
    (Mat3::IDENTITY.scale(com.dot(com)) - Mat3::outer(com, com)).scale(stated.mass_kg)
}

/// Computes `value · 10^power` on decimal digits, so that 12.3 and -3 give exactly 0.0123.
fn scaled_by_power(value: f64, power: i32) -> f64 {
    let text = format!("{value:e}");
    let exact = text.split_once('e').and_then(|(digits, exponent)| {
        format!("{digits}e{}", exponent.parse::<i32>().ok()? + power).parse::<f64>().ok()
    });
    exact.unwrap_or_else(|| value * 10_f64.powi(power))
}

#[cfg(test)]
mod tests {
    use super::{is_possible, scaled_by_power};

    #[test]
    fn digits_are_kept() {
        assert_eq!(
            [scaled_by_power(12.3, -3), scaled_by_power(-0.7, -6), scaled_by_power(0.0, 9), scaled_by_power(1e-3, 3)],
            [0.0123, -7e-7, 0.0, 1.0]
        );
    }

    #[test]
    fn bodies_are_possible() {
        assert!(is_possible(&[1.0, 0.0, 0.0, 1.0, 0.0, 2.0]) && is_possible(&[0.0; 6]));
        assert!(!is_possible(&[1.0, 0.0, 0.0, 1.0, 0.0, 2.1]) && !is_possible(&[1.0, 2.0, 0.0, 1.0, 0.0, 1.0]));
    }
}
