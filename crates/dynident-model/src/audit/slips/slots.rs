//! Moments in the wrong slot or with the wrong sign.

use super::{Search, SlipKind, is_possible, principal, shown};
use crate::urdf::StatedInertial;

struct Interpretation {
    kind: SlipKind,
    /// Corrected numbers; `None` if the file does not contain one of them.
    meant: Option<StatedInertial>,
    evidence: String,
}

/// Tests all interpretations for every impossible link. If several explain a link, the one that explains most links
/// of the file is used, if it is unique.
pub(super) fn find(search: &mut Search) {
    let broken: Vec<usize> = (0..search.now.len()).filter(|&place| !is_body(&search.now[place])).collect();
    let interpretations: Vec<Vec<Interpretation>> =
        broken.iter().map(|&place| interpretations(&search.now[place])).collect();
    let explained =
        |kind: SlipKind| interpretations.iter().filter(|ways| ways.iter().any(|way| way.kind == kind)).count();
    let mut of_kind: Vec<(SlipKind, Vec<(usize, &Interpretation)>)> = Vec::new();
    let mut open = Vec::new();
    for (&place, ways) in broken.iter().zip(&interpretations) {
        let mut ways: Vec<&Interpretation> = ways.iter().collect();
        let most = ways.iter().map(|way| explained(way.kind)).max().unwrap_or(0);
        if most > 1 && ways.iter().filter(|way| explained(way.kind) == most).count() == 1 {
            ways.retain(|way| explained(way.kind) == most);
        }
        match ways[..] {
            [way] => match of_kind.iter_mut().find(|(kind, _)| *kind == way.kind) {
                Some((_, members)) => members.push((place, way)),
                None => of_kind.push((way.kind, vec![(place, way)])),
            },
            _ => open.push((place, ways.iter().map(|way| way.kind.name()).collect::<Vec<_>>())),
        }
    }
    for (kind, members) in of_kind {
        note(search, kind, &members);
    }
    for (place, ways) in open {
        let stated = &search.now[place];
        let evidence =
            format!("principal moments {} kg m^2, mass {} kg", shown(principal(&stated.moments)), stated.mass_kg);
        let message = if ways.is_empty() {
            "impossible body, which no known mistake (signs, order of the numbers) explains: measure it, or delete <inertial>".to_owned()
        } else {
            format!(
                "impossible body, which several mistakes explain ({}): check the source of the numbers",
                ways.join(", ")
            )
        };
        search.note_uncorrected(SlipKind::Unexplained, &[place], message, evidence);
    }
}

fn is_body(stated: &StatedInertial) -> bool {
    let nothing = stated.mass_kg == 0.0 && stated.moments == [0.0; 6];
    nothing || stated.mass_kg > 0.0 && is_possible(&stated.moments)
}

fn note(search: &mut Search, kind: SlipKind, members: &[(usize, &Interpretation)]) {
    let places: Vec<usize> = members.iter().map(|(place, _)| *place).collect();
    let evidence: Vec<String> =
        members.iter().take(3).map(|(place, way)| format!("{}: {}", search.now[*place].link, way.evidence)).collect();
    let evidence = evidence.join("; ");
    let whose = search.names(&places);
    let message = match kind {
        SlipKind::NegatedMoments => format!("mass or moments of {whose} have the wrong sign: change it"),
        SlipKind::NegatedProducts => format!(
            "products of inertia of {whose} have the sign of the other convention (URDF has ixy = -∫ x y dm): change the signs of ixy, ixz and iyz"
        ),
        SlipKind::RowMajor => format!(
            "moments of {whose} are a 3 x 3 matrix read row by row into the slots ixx ixy ixz iyy iyz izz: iyy repeats ixy, iyz is iyy and izz is iyz; \
             the true izz is not in the file, take it from the source of the numbers"
        ),
        SlipKind::LowerTriangle => format!(
            "moments of {whose} are a lower triangle read row by row (xx, xy, yy, xz, yz, zz) into the slots of an upper one: exchange ixz and iyy"
        ),
        other => format!("{} of {whose}", other.name()),
    };
    let changed: Vec<(usize, StatedInertial)> =
        members.iter().filter_map(|(place, way)| Some((*place, way.meant.clone()?))).collect();
    if changed.is_empty() {
        search.note_uncorrected(kind, &places, message, evidence);
    } else {
        search.note(kind, message, evidence, changed);
    }
}

fn interpretations(stated: &StatedInertial) -> Vec<Interpretation> {
    let [xx, xy, xz, yy, yz, zz] = stated.moments;
    let before = shown(principal(&stated.moments));
    let with = |mass_kg: f64, moments: [f64; 6]| StatedInertial { mass_kg, moments, ..stated.clone() };
    let mut ways = Vec::new();
    let mut way = |kind, mass_kg: f64, moments: [f64; 6], known: bool| {
        let evidence =
            format!("principal moments {before} kg m^2 become {}, which is possible", shown(principal(&moments)));
        let meant = known.then(|| with(mass_kg, moments));
        ways.push(Interpretation { kind, meant, evidence });
    };
    let negated = stated.moments.map(|moment| if moment == 0.0 { moment } else { -moment });
    let all_negative = [xx, yy, zz].iter().all(|moment| *moment <= 0.0) && xx + yy + zz < 0.0;
    if all_negative && is_possible(&negated) {
        way(SlipKind::NegatedMoments, stated.mass_kg.abs(), negated, stated.mass_kg != 0.0);
    }
    if stated.mass_kg < 0.0 && is_possible(&stated.moments) && xx + yy + zz > 0.0 {
        way(SlipKind::NegatedMoments, -stated.mass_kg, stated.moments, true);
    }
    if stated.mass_kg <= 0.0 {
        return ways;
    }
    let products = [xx, -xy, -xz, yy, -yz, zz];
    if products.map(|x| x + 0.0) != stated.moments && is_possible(&products) {
        way(SlipKind::NegatedProducts, stated.mass_kg, products.map(|x| x + 0.0), true);
    }
    // In a matrix written row by row, ixy is repeated in the slot of iyy, and the true iyy (large) is in the slot of
    // iyz.
    if yy == xy && yz > 0.0 && yz.abs() > zz.abs() {
        // Any izz between |xx - yy| and xx + yy is possible if the upper left block is positive definite.
        let middle = (xx * xx + yz * yz).sqrt();
        let moments = [xx, xy, xz, yz, zz, middle];
        if is_possible(&moments) {
            let (least, most) = ((xx - yz).abs(), xx + yz);
            ways.push(Interpretation {
                kind: SlipKind::RowMajor,
                meant: None,
                evidence: format!("iyy = ixy = {xy}, and with iyy = {yz}, iyz = {zz} a possible izz is between {least:.3e} and {most:.3e}"),
            });
            return ways.into_iter().filter(|way| way.kind == SlipKind::RowMajor).collect();
        }
    }
    let lower = [xx, xy, yy, xz, yz, zz];
    if xz > 0.0 && xz != yy && is_possible(&lower) {
        let evidence =
            format!("principal moments {before} kg m^2 become {}, which is possible", shown(principal(&lower)));
        ways.push(Interpretation { kind: SlipKind::LowerTriangle, meant: Some(with(stated.mass_kg, lower)), evidence });
    }
    ways
}
