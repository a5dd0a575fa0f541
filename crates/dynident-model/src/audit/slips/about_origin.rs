//! Moments about the frame's origin where those about the centre of mass are meant.
//!
//! Of moments about the origin the parallel-axis term can be taken away and a body remains. Of moments about the centre
//! of mass it can hardly ever: of the 190 links of published descriptions whose term is at least 0.3 of the trace, 14
//! leave a body, none of them above 0.61.

use super::{Search, SlipKind, parallel_axis, possible, six, trace};
use crate::urdf::StatedInertial;

/// Share of the trace from which on a link tells something.
const TELLING: f64 = 0.3;
/// Share from which on one link tells enough: more than any published body has.
const ENOUGH: f64 = 0.7;

/// All links that tell something, if every one of them leaves a body and there are two; else those that tell enough.
pub(super) fn look(search: &mut Search) {
    let shares: Vec<(usize, f64, Option<StatedInertial>)> = search
        .with_mass()
        .into_iter()
        .filter_map(|place| {
            let stated = &search.now[place];
            let shift = parallel_axis(stated);
            let share = trace(&six(&shift)) / trace(&stated.moments);
            let rest = six(&(stated.inertia() - shift));
            let leaves = share < 1.0 && possible(&rest) && possible(&stated.moments);
            (share > 0.0).then(|| (place, share, leaves.then(|| StatedInertial { moments: rest, ..stated.clone() })))
        })
        .collect();
    let telling = shares.iter().filter(|(_, share, _)| *share >= TELLING);
    let (leave, of) = telling.fold((0, 0), |(leave, of), (_, _, rest)| (leave + usize::from(rest.is_some()), of + 1));
    // Then the links that tell little are of the same making.
    let all = leave >= 2 && leave == of;
    let members: Vec<&(usize, f64, Option<StatedInertial>)> =
        shares.iter().filter(|(_, share, rest)| rest.is_some() && (all || *share >= ENOUGH)).collect();
    if members.is_empty() {
        return;
    }
    let places: Vec<usize> = members.iter().map(|(place, ..)| *place).collect();
    let least = if all { TELLING } else { ENOUGH };
    let evidence = format!(
        "without the parallel-axis term m (r^2 1 - r r^T), which is {:.0} % of the moments or more, a body remains on {} of {} links where the term is large; \
         of moments about the centre of mass it hardly ever does",
        100.0 * least,
        leave,
        of
    );
    let message = format!(
        "moments of {} are about the link's origin, but a URDF means those about the centre of mass: take the parallel-axis term away",
        search.names(&places)
    );
    let changed = members.into_iter().filter_map(|(place, _, rest)| Some((*place, rest.clone()?))).collect();
    search.note(SlipKind::AboutOrigin, message, evidence, changed);
}
