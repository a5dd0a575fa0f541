//! An exporter's default of 1 kg m² about every axis.

use super::{Search, SlipKind};

pub(super) fn find(search: &mut Search) {
    let is_default = |place: &usize| search.now[*place].moments == [1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    let places: Vec<usize> = (0..search.now.len()).filter(is_default).collect();
    if places.is_empty() {
        return;
    }
    let whole = places.iter().filter(|&&place| search.now[place].mass_kg == 1.0).count();
    let evidence = format!(
        "{} of {} inertials have 1 kg m^2 about every axis, {whole} of them also 1 kg",
        places.len(),
        search.now.len()
    );
    let message = format!(
        "moments of {} are an exporter's default, and the file does not contain the true ones: measure them, or delete <inertial> so that the link is treated as unknown",
        search.names(&places)
    );
    search.note_uncorrected(SlipKind::Defaults, &places, message, evidence);
}
