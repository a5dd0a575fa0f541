//! Candidate friction of a joint: terms, and for each term a grid of its nonlinear constants with one column per grid
//! point.

use dynident_model::Model;
use dynident_model::terms::{
    CandidateJoint, CandidateLaw, CandidateRole, Coulomb, CoulombShape, GridPoint, TermClass, TorqueTerm,
};

pub(super) type FrictionKind = &'static CandidateLaw;

/// Whether only one grid point of this kind of friction is selected; otherwise all of its columns are used.
pub(super) fn takes_one(kind: FrictionKind) -> bool {
    kind.constants > 0
}

/// Sets of columns that are tried together: neighbours on the grid, or all columns of a kind without a grid.
pub(super) fn options(kind: FrictionKind, columns: &[CandidateColumn]) -> Vec<Vec<usize>> {
    let of_kind: Vec<usize> = (0..columns.len()).filter(|&place| columns[place].kind == kind).collect();
    if !takes_one(kind) {
        return vec![of_kind];
    }
    let (alone, of_grid): (Vec<usize>, Vec<usize>) =
        of_kind.into_iter().partition(|&place| columns[place].grid.is_none());
    let steps: Vec<&[usize]> = of_grid.chunk_by(|&a, &b| columns[a].grid == columns[b].grid).collect();
    let pairs = steps.windows(2).map(<[&[usize]]>::concat);
    let only = steps.first().filter(|_| steps.len() == 1).map(|only| only.to_vec());
    alone.into_iter().map(|place| vec![place]).chain(pairs).chain(only).collect()
}

#[derive(Clone, Debug)]
pub(crate) struct CandidateColumn {
    pub(crate) kind: FrictionKind,
    pub(crate) term: TorqueTerm,
    /// Terms that the model gets if this column is selected: the term, or both directions of a directional term.
    pub(crate) stated: Vec<TorqueTerm>,
    /// Index on the first axis of the grid, ascending; `None` for a single candidate.
    pub(crate) grid: Option<usize>,
    /// Whether the search may select this column; see [`FrictionSearch::laws`] and [`FrictionSearch::exportable`].
    pub(crate) is_permitted: bool,
}

/// Settings of the selection of a joint's friction from the training logs.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionSearch {
    /// Name of the joint.
    pub joint: String,
    /// Smoothed sign of the velocity in the stated Coulomb friction, which becomes a candidate. `None` by default.
    pub coulomb: Option<CoulombShape>,
    /// Velocity below which the sign function of Coulomb friction is zero, rad/s or m/s. 0 by default.
    pub dead_band: f64,
    /// Width of the smoothed sign in load-dependent friction if the logs do not determine a smoothed sign and none is
    /// stated, rad/s or m/s. By default [`CoulombShape::USUAL_WIDTH`] of an arm of usual size.
    pub width: Option<f64>,
    /// Whether rows near rest are used. If not, the smoothed sign has the stated or usual width, and terms that differ
    /// from others only near rest (Stribeck, sigmoid, cube root, elements with hysteresis) are not candidates. True by
    /// default.
    pub rows_near_rest: bool,
    /// Maximum variance inflation for Coulomb friction that differs by direction: `1 / (1 - R²)`, where R² is the share
    /// of the difference between both directions that gravity, offset and all other columns explain. If gravity is
    /// constant or the joint has an offset, only rows near rest determine this difference, and its error bar grows by
    /// the square root of the inflation. Unlimited by default. An iteration, which does not converge while a parameter
    /// is poorly determined, uses [`MOST_INFLATION`](Self::MOST_INFLATION).
    pub most_inflation: Option<f64>,
    /// Names of the laws that may be selected ([`CandidateLaw::name`]). Viscous and Coulomb friction are always
    /// permitted. All laws by default.
    pub laws: Option<Vec<String>>,
    /// Permits only laws that an export format of this class can contain without a loss. All laws by default.
    pub exportable: Option<TermClass>,
}

impl FrictionSearch {
    /// The usual limit of variance inflation in regression diagnostics.
    pub const MOST_INFLATION: f64 = 10.0;

    /// A search with default settings.
    pub fn of(joint: impl Into<String>) -> Self {
        Self {
            joint: joint.into(),
            coulomb: None,
            dead_band: 0.0,
            width: None,
            rows_near_rest: true,
            most_inflation: None,
            laws: None,
            exportable: None,
        }
    }

    fn permits(&self, kind: FrictionKind, term: &TorqueTerm) -> bool {
        let is_start = kind.role == CandidateRole::Base || kind.is_common_step();
        let is_named = self.laws.as_ref().is_none_or(|laws| laws.iter().any(|law| law == kind.name));
        (is_start || is_named) && self.exportable.is_none_or(|class| class.holds_friction(term))
    }
}

/// Velocity scale and position scale of a joint, relative to an arm of usual size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointScale {
    joint: usize,
    /// Scale of velocities; 1 for an arm of usual size.
    pub(crate) velocity: f64,
    /// Scale of positions; 1 for an arm of usual size.
    position: f64,
}

impl JointScale {
    #[cfg(test)]
    pub(super) const fn usual(joint: usize) -> Self {
        Self { joint, velocity: 1.0, position: 1.0 }
    }

    /// Narrowest smoothed sign on the grid, rad/s (m/s).
    pub(super) fn narrowest_width(self) -> f64 {
        Coulomb::WIDTHS[0] * self.velocity
    }

    pub(crate) fn of(model: &Model, joint: usize) -> Self {
        let (own, is_rotary) = (model.characteristic_scale(), model.joints()[joint].is_rotary());
        Self { joint, velocity: own.velocity(is_rotary, 1.0), position: own.position(is_rotary, 1.0) }
    }
}

/// Columns of viscous and Coulomb friction, which determine the width of the smoothed sign before other terms are
/// selected.
pub(crate) fn step_columns(search: &FrictionSearch, joint: JointScale) -> Vec<CandidateColumn> {
    let is_step = |column: &CandidateColumn| column.kind.role == CandidateRole::Base || column.kind.is_common_step();
    candidate_columns(search, joint, None).into_iter().filter(is_step).collect()
}

/// Candidate columns of a joint. Columns of a term are adjacent and in the order of its grid. `width` is the
/// approximate width of the smoothed sign, if known. It is added to the grid, because a width between two grid points
/// would look like an additional term.
pub(crate) fn candidate_columns(
    search: &FrictionSearch,
    JointScale { joint, velocity, position }: JointScale,
    width: Option<f64>,
) -> Vec<CandidateColumn> {
    let sign = CoulombShape::Sign { dead_band: search.dead_band };
    let mut widths = Coulomb::WIDTHS.map(|width| width * velocity).to_vec();
    let mut alone = vec![sign];
    match search.coulomb {
        Some(CoulombShape::Smooth { width }) if !widths.contains(&width) => widths.push(width),
        Some(stated @ CoulombShape::Sign { .. }) if stated != sign => alone.push(stated),
        _ => {}
    }
    widths.extend(width.filter(|width| !widths.contains(width)));
    widths.sort_by(f64::total_cmp);
    let load_width = match (width, search.coulomb) {
        (Some(width), _) | (None, Some(CoulombShape::Smooth { width })) => width,
        _ => search.width.unwrap_or(CoulombShape::USUAL_WIDTH * velocity),
    };
    if !search.rows_near_rest {
        (widths, alone) = match search.coulomb {
            Some(CoulombShape::Smooth { width }) => (vec![width], Vec::new()),
            Some(stated @ CoulombShape::Sign { .. }) => (vec![load_width], vec![stated]),
            None => (vec![load_width], Vec::new()),
        };
    }
    let own = CandidateJoint { joint, velocity, position, alone, widths, width: load_width };
    let columns_at = |kind: FrictionKind, GridPoint { terms: stated, step: grid }: GridPoint| {
        let column = |term: &TorqueTerm| CandidateColumn {
            kind,
            term: term.clone(),
            stated: stated.clone(),
            grid,
            is_permitted: search.permits(kind, term),
        };
        stated.iter().map(column).collect::<Vec<_>>()
    };
    TorqueTerm::candidates()
        .filter(|kind| search.rows_near_rest || !kind.is_near_rest)
        .flat_map(|kind| (kind.grid)(&own).into_iter().flat_map(move |point| columns_at(kind, point)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without rows near rest, there is one smoothed sign with the stated width, and no terms that need rows near rest.
    #[test]
    fn terms_near_rest_are_no_candidates_without_rows_near_rest() {
        let scale = JointScale::usual(0);
        let kinds = |search: &FrictionSearch| -> Vec<FrictionKind> {
            let mut kinds: Vec<_> = candidate_columns(search, scale, None).iter().map(|column| column.kind).collect();
            kinds.sort_by_key(|kind| kind.rank());
            kinds.dedup();
            kinds
        };
        let all = FrictionSearch::of("joint1");
        let coulomb = Some(CoulombShape::Smooth { width: 0.03 });
        let far = FrictionSearch { rows_near_rest: false, coulomb, ..all.clone() };
        assert_eq!(kinds(&all).len(), 10);
        let names: Vec<_> = kinds(&far).into_iter().map(|kind| kind.name).collect();
        assert_eq!(names, ["viscous", "asymmetric viscous", "coulomb", "asymmetric coulomb", "quadratic", "load"]);
        // The single smoothed sign is a separate choice without neighbours on a grid.
        let columns = candidate_columns(&far, scale, None);
        let options = options(kinds(&far)[2], &columns);
        assert_eq!(options.len(), 1, "{options:?}");
        let step = CoulombShape::Smooth { width: 0.03 };
        let stated = TorqueTerm::Coulomb(Coulomb { joint: 0, shape: step });
        assert_eq!(columns[options[0][0]].term, stated);
    }
}
