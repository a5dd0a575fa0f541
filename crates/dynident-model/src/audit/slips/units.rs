//! Millimetres and grams.
//!
//! Three figures are compared with the distances between the joints (`L`, size of the link's body): radius of
//! gyration `√(½ tr I / m)` over L, mass over L³, and distance of the centre of mass over L. In published
//! descriptions of arms and humanoids, the median of the first is 0.26 to 0.44 (1.7 with many wheels and fingers), of
//! the second 10 to 500 kg/m³, and of the third at most 0.5. Single centres of mass are up to 4.5 L away.

use super::{Search, SlipKind, SlipSettings, scaled_by_power, trace};
use crate::urdf::StatedInertial;

/// A hypothesis about units, as powers of ten that convert to kg, m and kg m².
struct Units {
    what: &'static str,
    mass: i32,
    com: i32,
    moments: i32,
}

const CANDIDATES: [Units; 10] = [
    Units { what: "moments in kg mm^2", mass: 0, com: 0, moments: -6 },
    Units { what: "moments in g mm^2", mass: 0, com: 0, moments: -9 },
    Units { what: "moments in kg cm^2", mass: 0, com: 0, moments: -4 },
    Units { what: "moments in g m^2", mass: 0, com: 0, moments: -3 },
    Units { what: "masses in g", mass: -3, com: 0, moments: 0 },
    Units { what: "masses in g and moments in g m^2", mass: -3, com: 0, moments: -3 },
    Units { what: "masses in g and moments in g mm^2", mass: -3, com: 0, moments: -9 },
    Units { what: "centres of mass in mm", mass: 0, com: -3, moments: 0 },
    Units { what: "centres of mass in mm and moments in kg mm^2", mass: 0, com: -3, moments: -6 },
    Units { what: "masses in g, centres of mass in mm and moments in g mm^2", mass: -3, com: -3, moments: -9 },
];

impl Units {
    fn of(&self, stated: &StatedInertial) -> StatedInertial {
        StatedInertial {
            mass_kg: scaled_by_power(stated.mass_kg, self.mass),
            com_m: stated.com_m.map(|x| scaled_by_power(x, self.com)),
            moments: stated.moments.map(|moment| scaled_by_power(moment, self.moments)),
            ..stated.clone()
        }
    }
}

/// Tests all links together. If their figures are plausible, tests each link alone.
pub(super) fn find(search: &mut Search) {
    let Some(lengths) = search.lengths.clone() else { return };
    let is_tested = |place: &usize| search.moves[*place] && search.now[*place].moments != DEFAULT_MOMENTS;
    let places: Vec<usize> = search.with_mass().into_iter().filter(is_tested).collect();
    if places.len() >= 2 && explain(search, &places, &lengths, false) {
        return;
    }
    for place in places {
        // Links of sensors and frames often have an arbitrary mass for the simulator.
        let one = Figures::of(core::iter::once((search.now[place].clone(), lengths[place])));
        if one.density < search.settings.link_log10_density_range[0] {
            continue;
        }
        explain(search, &[place], &lengths, true);
    }
}

/// An exporter's default of 1 kg m², which is not a unit error.
const DEFAULT_MOMENTS: [f64; 6] = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];

/// Whether the figures of these links are implausible; if so, the matching units are recorded.
fn explain(search: &mut Search, places: &[usize], lengths: &[f64], single: bool) -> bool {
    let as_stated = Figures::of(places.iter().map(|&place| (search.now[place].clone(), lengths[place])));
    if as_stated.misfit(&search.settings, single, false).is_some() {
        return false;
    }
    let mut fits: Vec<(f64, &Units, Figures)> = CANDIDATES
        .iter()
        .filter_map(|units| {
            let figures = Figures::of(places.iter().map(|&place| (units.of(&search.now[place]), lengths[place])));
            Some((figures.misfit(&search.settings, single, units.com != 0)?, units, figures))
        })
        .collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whose = search.names(places);
    let stated = format!("in the file, {as_stated}");
    match &fits[..] {
        [(_, units, figures), rest @ ..]
            if rest.first().is_none_or(|next| next.0 > fits[0].0 + search.settings.min_misfit_margin) =>
        {
            let message = format!("{whose}: {}: write kg, m and kg m^2", units.what);
            let evidence = format!("{stated}; in kg, m and kg m^2, {figures}");
            // If all links are tested together, links without moments get the same units.
            let all: Vec<usize> = (0..search.now.len()).collect();
            let changed = if single { places } else { &all };
            let changed: Vec<(usize, StatedInertial)> = changed
                .iter()
                .filter(|&&place| search.now[place].moments != DEFAULT_MOMENTS)
                .map(|&place| (place, units.of(&search.now[place])))
                .filter(|(place, new)| search.now[*place] != *new)
                .collect();
            search.note(SlipKind::Units, message, evidence, changed);
        }
        [] => {
            let message = format!("{whose}: does not fit the distances between the joints in any known unit: check it");
            search.note_uncorrected(SlipKind::Unexplained, places, message, stated);
        }
        several => {
            let names: Vec<&str> = several.iter().map(|(_, units, _)| units.what).collect();
            let message = format!(
                "{whose}: not in kg, m and kg m^2; several units fit ({}): check the source of the numbers",
                names.join("; or ")
            );
            search.note_uncorrected(SlipKind::Unexplained, places, message, stated);
        }
    }
    true
}

/// The three figures of a set of links; decimal logarithms, except for the last figure.
struct Figures {
    gyration: f64,
    density: f64,
    com: f64,
}

impl Figures {
    fn of(links: impl Iterator<Item = (StatedInertial, f64)>) -> Self {
        let (mut gyrations, mut densities, mut distances) = (Vec::new(), Vec::new(), Vec::new());
        for (stated, length) in links {
            gyrations.push((0.5 * trace(&stated.moments) / stated.mass_kg).sqrt().log10() - length.log10());
            densities.push(stated.mass_kg.log10() - 3.0 * length.log10());
            let distance = stated.com_m.iter().map(|x| x * x).sum::<f64>().sqrt() / length;
            // Distances of zero are ignored: many links have their frame at the centre of mass.
            distances.extend((distance > 0.0).then_some(distance));
        }
        let com = if distances.is_empty() { 0.0 } else { median(distances) };
        Self { gyration: median(gyrations), density: median(densities), com }
    }

    /// Distance from the figures of published robots, decades; `None` outside the range of their figures.
    fn misfit(&self, settings: &SlipSettings, single: bool, com_changed: bool) -> Option<f64> {
        let (gyration_range, density_range) = if single {
            (settings.link_log10_gyration_range, settings.link_log10_density_range)
        } else {
            (settings.log10_gyration_range, settings.log10_density_range)
        };
        let within = |[least, most]: [f64; 2], value: f64| (least..=most).contains(&value);
        let fits = within(gyration_range, self.gyration)
            && within(density_range, self.density)
            && self.com <= settings.max_com_lengths
            && (!com_changed || self.com >= settings.min_corrected_com_lengths);
        // Masses vary more than radii of gyration.
        fits.then(|| {
            (self.gyration - settings.typical_log10_gyration).abs()
                + 0.3 * (self.density - settings.typical_log10_density).abs()
        })
    }
}

impl core::fmt::Display for Figures {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "radii of gyration are {:.2e} link lengths, masses {:.2e} kg per cubed link length in m, distances of centres of mass {:.2e} link lengths",
            10_f64.powf(self.gyration),
            10_f64.powf(self.density),
            self.com
        )
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
