//! Moments about the frame's origin instead of the centre of mass.
//!
//! If moments are about the origin, a consistent body remains after subtracting the parallel-axis term. If they are
//! about the centre of mass, this is rare. Of 190 links of published descriptions whose parallel-axis term is at
//! least 0.3 of the trace, 14 remain consistent, all with a term of at most 0.61 of the trace.

use super::{Search, SlipKind, is_possible, parallel_axis, trace, upper_triangle};
use crate::urdf::StatedInertial;

/// Reports the mistake if all tested links, at least two, remain consistent bodies. Otherwise it is reported only for
/// links with a large share of the parallel-axis term.
pub(super) fn find(search: &mut Search) {
    let shares: Vec<(usize, f64, Option<StatedInertial>)> = search
        .with_mass()
        .into_iter()
        .filter_map(|place| {
            let stated = &search.now[place];
            let shift = parallel_axis(stated);
            let share = trace(&upper_triangle(&shift)) / trace(&stated.moments);
            let rest = upper_triangle(&(stated.inertia() - shift));
            let leaves = share < 1.0 && is_possible(&rest) && is_possible(&stated.moments);
            (share > 0.0).then(|| (place, share, leaves.then(|| StatedInertial { moments: rest, ..stated.clone() })))
        })
        .collect();
    let tested = shares.iter().filter(|(_, share, _)| *share >= search.settings.min_parallel_axis_share);
    let (leave, of) = tested.fold((0, 0), |(leave, of), (_, _, rest)| (leave + usize::from(rest.is_some()), of + 1));
    // Links with a small parallel-axis term are included, because they come from the same exporter.
    let all = leave >= 2 && leave == of;
    let members: Vec<&(usize, f64, Option<StatedInertial>)> = shares
        .iter()
        .filter(|(_, share, rest)| rest.is_some() && (all || *share >= search.settings.sufficient_parallel_axis_share))
        .collect();
    if members.is_empty() {
        return;
    }
    let places: Vec<usize> = members.iter().map(|(place, ..)| *place).collect();
    let least =
        if all { search.settings.min_parallel_axis_share } else { search.settings.sufficient_parallel_axis_share };
    let evidence = format!(
        "without the parallel-axis term m (r^2 1 - r r^T), which is {:.0} % of the moments or more, {} of {} links with a large term remain possible bodies; \
         this is rare for moments about the centre of mass",
        100.0 * least,
        leave,
        of
    );
    let message = format!(
        "moments of {} are about the link's origin, but URDF requires moments about the centre of mass: subtract the parallel-axis term",
        search.names(&places)
    );
    let changed = members.into_iter().filter_map(|(place, _, rest)| Some((*place, rest.clone()?))).collect();
    search.note(SlipKind::AboutOrigin, message, evidence, changed);
}
