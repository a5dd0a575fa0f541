//! Checks whether the inertials of the moving links are physically consistent and plausible.

use super::AuditLevel::{Info, Problem, Warning};
use super::{AuditLevel, AuditSettings, Findings, Lengths};
use crate::inertial::InertialParameters;
use crate::spatial::{Mat3, Vec3};
use crate::tree::{Link, Model};
use nalgebra::Matrix3;

/// Density of osmium, the densest metal, kg/m³. A solid sphere of osmium has nearly the smallest inertia that is
/// possible for its mass.
const OSMIUM_DENSITY_KG_M3: f64 = 22590.0;
/// Rounding error of the eigenvalues relative to the inertia about the frame's origin.
const EIGENVALUE_ROUNDING: f64 = 1e-9;

pub(super) fn check(model: &Model, lengths: &Lengths, settings: &AuditSettings, findings: &mut Findings) {
    for (index, body) in model.bodies().iter().enumerate() {
        for link in &body.links {
            if let Some(inertial) = &link.inertial {
                check_consistent(&link.name, inertial, settings, findings);
                check_plausible(&link.name, inertial, lengths.bodies[index], settings, findings);
            }
        }
        report_unknown(model, index, findings);
    }
    report_massless(model, findings);
    report_equal(model, findings);
}

/// Checks that give a warning or problem for the inertial of one link on a body of `length_m`, with their level.
pub(super) fn findings_of_link(
    link: &str,
    inertial: &InertialParameters,
    length_m: f64,
) -> Vec<(AuditLevel, &'static str)> {
    let (settings, mut findings) = (AuditSettings::default(), Findings(Vec::new()));
    check_consistent(link, inertial, &settings, &mut findings);
    check_plausible(link, inertial, length_m, &settings, &mut findings);
    let told = findings.0.into_iter().filter(|finding| finding.level > Info);
    told.map(|finding| (finding.level, finding.check)).collect()
}

fn check_consistent(link: &str, inertial: &InertialParameters, settings: &AuditSettings, findings: &mut Findings) {
    let place = || format!("link {link}");
    let mass = inertial.mass_kg();
    if *inertial == InertialParameters::ZERO {
        let message = "is given as massless; delete its <inertial> if it is not known".to_owned();
        findings.add(Info, "mass-not-positive", place(), message);
        return;
    }
    let Some(moments) = inertial.principal_moments().filter(|_| mass > 0.0) else {
        let message = format!("has mass {mass} kg but nonzero moments, which is impossible: weigh the link");
        findings.add(Problem, "mass-not-positive", place(), message);
        return;
    };
    let [least, middle, most] = moments;
    // The moments about the centre of mass are computed as a difference from the inertia about the frame's origin,
    // and have its rounding error.
    let rounding = EIGENVALUE_ROUNDING * trace(&inertial.inertia_at_origin()).abs();
    if least < -rounding {
        let message = format!(
            "has principal moments of inertia {least:.4e}, {middle:.4e}, {most:.4e} kg m^2 about its centre of mass: negative moments are impossible; \
             check signs, products of inertia, and the point that the inertia is about"
        );
        findings.add(Problem, "inertia-not-positive", place(), message);
    } else if least + middle < most - rounding {
        let excess = (most - least - middle) / most;
        let level = if excess < settings.moment_rounding { Warning } else { Problem };
        let message = format!(
            "has principal moments of inertia {least:.4e}, {middle:.4e}, {most:.4e} kg m^2: the largest may not exceed the sum of the others \
             (by {:.2} % here), which is impossible: check the moments",
            100.0 * excess
        );
        findings.add(level, "triangle-inequality", place(), message);
    }
}

fn check_plausible(
    link: &str,
    inertial: &InertialParameters,
    length_m: f64,
    settings: &AuditSettings,
    findings: &mut Findings,
) {
    let place = || format!("link {link}");
    let mass = inertial.mass_kg();
    let (Some(com), Some(inertia)) = (inertial.com_m(), inertial.inertia_at_com()) else { return };
    if mass > settings.max_link_mass_kg {
        let message = format!("has mass {mass} kg: if that is grams, divide by 1000");
        findings.add(Warning, "mass-absurd", place(), message);
    }
    if mass <= 0.0 {
        return;
    }
    let distance = com.norm();
    if distance > settings.max_distance_lengths * length_m {
        let absurd = distance > settings.problem_distance_lengths * length_m;
        let fix = if absurd { "; if that is millimetres, divide by 1000" } else { ": check its frame and unit" };
        let message =
            format!("has its centre of mass {distance:.4} m from its frame, on a body of about {length_m:.3} m{fix}");
        findings.add(if absurd { Problem } else { Warning }, "centre-of-mass-outside", place(), message);
    }
    // Mean square distance of the mass from the centre of mass: `½ tr(I) / m`.
    let square = 0.5 * trace(&inertia) / mass;
    if square > (settings.max_distance_lengths * length_m).powi(2) {
        findings.add(
            if square > (settings.problem_distance_lengths * length_m).powi(2) { Problem } else { Warning },
            "inertia-too-large",
            place(),
            format!(
                "has a radius of gyration of {:.3} m with its {mass} kg, on a body of about {length_m:.3} m: check \
                 its unit (kg mm^2: divide by 1e6, g mm^2: by 1e9)",
                square.sqrt()
            ),
        );
    }
    let ball_radius = (3.0 * mass / (4.0 * core::f64::consts::PI * OSMIUM_DENSITY_KG_M3)).cbrt();
    if square >= 0.0 && square < 0.6 * ball_radius.powi(2) {
        let message = format!(
            "has less inertia than a ball of osmium of its {mass} kg ({:.2e} kg m^2): point mass, placeholder or wrong unit; check the moments",
            0.4 * mass * ball_radius.powi(2)
        );
        findings.add(Warning, "inertia-too-small", place(), message);
    }
    check_reference_point(link, inertial, settings.max_parallel_axis_share, findings);
    let d = [inertia.0[0][0], inertia.0[1][1], inertia.0[2][2]];
    let products = [inertia.0[0][1], inertia.0[0][2], inertia.0[1][2]];
    let power_of_ten = |x: f64| x > 0.0 && (x.log10() - x.log10().round()).abs() < 1e-9;
    if com == Vec3::ZERO && products == [0.0; 3] && d[0] == d[1] && d[1] == d[2] && power_of_ten(d[0]) {
        let message = format!(
            "has the inertia {} kg m^2 about all axes and its centre of mass at the frame, probably a placeholder: measure it",
            d[0]
        );
        findings.add(Warning, "placeholder", place(), message);
    }
}

/// Reports an inertia that was computed about the link's origin but written as if about the centre of mass. Such an
/// inertia consists mostly of the parallel-axis term, and a consistent body remains after subtracting this term.
fn check_reference_point(link: &str, inertial: &InertialParameters, max_share: f64, findings: &mut Findings) {
    let (Some(com), Some(inertia)) = (inertial.com_m(), inertial.inertia_at_com()) else { return };
    let mass = inertial.mass_kg();
    let shift = (Mat3::IDENTITY.scale(com.dot(com)) - Mat3::outer(com, com)).scale(mass);
    let share = trace(&shift) / trace(&inertia);
    if !(max_share..1.0).contains(&share) {
        return;
    }
    let rest = inertia - shift;
    let mut moments: [f64; 3] = Matrix3::from_fn(|a, b| rest.0[a][b]).symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    if moments[0] > 0.0 && moments[0] + moments[1] >= moments[2] {
        let message = format!(
            "has an inertia that could contain {:.0} % parallel-axis term m r^2 of its centre of mass: if it was computed about the link's \
             origin, move it to the centre of mass",
            100.0 * share
        );
        findings.add(Warning, "inertia-at-origin", format!("link {link}"), message);
    }
}

fn report_unknown(model: &Model, index: usize, findings: &mut Findings) {
    let body = &model.bodies()[index];
    let place = || format!("link {}", body.name());
    if body.prior().is_none() {
        let message =
            "moves but has no inertial (nor a link fixed to it): its prior is unknown and is zero in predictions"
                .to_owned();
        findings.add(Warning, "inertial-unknown", place(), message);
    } else {
        let names: Vec<&str> =
            body.links.iter().filter(|link| link.inertial.is_none()).map(|link| link.name.as_str()).collect();
        if !names.is_empty() {
            let message =
                format!("has no inertial on {} (frames, or unknown parts): {}", count(names.len()), names.join(", "));
            findings.add(Info, "inertial-unknown", place(), message);
        }
    }
}

fn report_massless(model: &Model, findings: &mut Findings) {
    let known: Vec<bool> = model.inertials().iter().map(|inertial| *inertial != InertialParameters::ZERO).collect();
    let moves_mass = |joint: usize| (0..known.len()).any(|body| known[body] && model.moves(joint, body));
    for (_, joint) in model.joints().iter().enumerate().filter(|(index, _)| !moves_mass(*index)) {
        let message =
            "moves no known mass, so that the mass matrix is singular: give an inertial, or lock the joint".to_owned();
        findings.add(Problem, "massless-subtree", format!("joint {}", joint.name), message);
    }
}

fn report_equal(model: &Model, findings: &mut Findings) {
    let known: Vec<(&Link, &InertialParameters)> = model
        .bodies()
        .iter()
        .filter_map(|body| Some((&body.links[0], body.links[0].inertial.as_ref()?)))
        .filter(|(_, inertial)| **inertial != InertialParameters::ZERO)
        .collect();
    if known.len() >= 3 && known.iter().all(|(_, inertial)| *inertial == known[0].1) {
        let message = format!("all {} inertials are equal, probably placeholders: measure them", known.len());
        findings.add(Warning, "equal-inertials", "model".to_owned(), message);
    }
}

fn count(links: usize) -> String {
    if links == 1 { "one of its links".to_owned() } else { format!("{links} of its links") }
}

fn trace(m: &Mat3) -> f64 {
    m.0[0][0] + m.0[1][1] + m.0[2][2]
}
