//! The friction that a joint may have when the data choose: terms, and for each term a grid of its constants, every one
//! a column.

use dynident_model::Model;
use dynident_model::terms::{
    Coulomb, CoulombShape, Direction, DirectionalCoulomb, DirectionalViscous, LoadFriction, MaxwellSlip, Power,
    PowerExponent, Sigmoid, Stribeck, TorqueTerm, Viscous,
};

/// Widths of the smooth Coulomb step, rad/s or m/s of a usual arm, as all velocities here; beside them the sign and
/// what the study states.
const WIDTHS: [f64; 7] = [NARROWEST, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2];
const NARROWEST: f64 = 0.002;
/// Stribeck velocities.
const STRIBECK_SPEEDS: [f64; 6] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.4];
const STRIBECK_EXPONENTS: [f64; 2] = [1.0, 2.0];
/// Width of the step under the Stribeck term as a share of its velocity, at most, while it is chosen: beyond
/// half its velocity the step is done.
pub(super) const STRIBECK_WIDTH: f64 = 0.25;
const SIGMOID_WIDTHS: [f64; 3] = [0.02, 0.05, 0.1];
/// Yield displacements of the Maxwell-slip elements, rad, or m of a usual arm.
const YIELDS: [f64; 6] = [3.0e-4, 1.0e-3, 3.0e-3, 1.0e-2, 3.0e-2, 1.0e-1];

/// What a candidate model is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FrictionKind {
    Viscous,
    AsymmetricViscous,
    Coulomb,
    AsymmetricCoulomb,
    Sigmoid,
    Stribeck,
    CubeRoot,
    Quadratic,
    Load,
    MaxwellSlip,
}

impl FrictionKind {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Viscous => "viscous",
            Self::AsymmetricViscous => "asymmetric viscous",
            Self::Coulomb => "coulomb",
            Self::AsymmetricCoulomb => "asymmetric coulomb",
            Self::Sigmoid => "sigmoid",
            Self::Stribeck => "stribeck",
            Self::CubeRoot => "cube-root",
            Self::Quadratic => "quadratic",
            Self::Load => "load",
            Self::MaxwellSlip => "maxwell-slip",
        }
    }

    /// Constants that are tuned for it: they count as parameters.
    pub(crate) fn constants(self) -> usize {
        match self {
            Self::Coulomb | Self::AsymmetricCoulomb => 1,
            Self::Sigmoid | Self::Stribeck => 2,
            Self::Viscous
            | Self::AsymmetricViscous
            | Self::CubeRoot
            | Self::Quadratic
            | Self::Load
            | Self::MaxwellSlip => 0,
        }
    }

    /// The candidate that a torque term belongs to; none where data do not choose it.
    pub(super) fn of(term: &TorqueTerm) -> Option<Self> {
        match term {
            TorqueTerm::Viscous(_) => Some(Self::Viscous),
            TorqueTerm::Coulomb(_) => Some(Self::Coulomb),
            TorqueTerm::DirectionalViscous(_) => Some(Self::AsymmetricViscous),
            TorqueTerm::DirectionalCoulomb(_) => Some(Self::AsymmetricCoulomb),
            TorqueTerm::Stribeck(_) => Some(Self::Stribeck),
            TorqueTerm::Sigmoid(_) => Some(Self::Sigmoid),
            TorqueTerm::Power(Power { exponent: PowerExponent::CubeRoot, .. }) => Some(Self::CubeRoot),
            TorqueTerm::Power(Power { exponent: PowerExponent::Quadratic, .. }) => Some(Self::Quadratic),
            TorqueTerm::Load(_) => Some(Self::Load),
            TorqueTerm::MaxwellSlip(_) => Some(Self::MaxwellSlip),
            TorqueTerm::TemperatureViscous(_)
            | TorqueTerm::TemperatureCoulomb(_)
            | TorqueTerm::Offset(_)
            | TorqueTerm::DriveInertia(_)
            | TorqueTerm::Coupling(_)
            | TorqueTerm::Declared(_) => None,
        }
    }

    /// True when it is tried in addition to the two models that a search begins with.
    pub(crate) fn is_addition(self) -> bool {
        match self {
            Self::Viscous | Self::Coulomb | Self::Sigmoid => false,
            Self::AsymmetricViscous
            | Self::AsymmetricCoulomb
            | Self::Stribeck
            | Self::CubeRoot
            | Self::Quadratic
            | Self::Load
            | Self::MaxwellSlip => true,
        }
    }

    /// The candidate in whose place it is tried; none for one that is tried beside all others.
    pub(crate) fn replaces(self) -> Option<Self> {
        match self {
            Self::AsymmetricViscous => Some(Self::Viscous),
            Self::AsymmetricCoulomb => Some(Self::Coulomb),
            Self::Viscous
            | Self::Coulomb
            | Self::Sigmoid
            | Self::Stribeck
            | Self::CubeRoot
            | Self::Quadratic
            | Self::Load
            | Self::MaxwellSlip => None,
        }
    }

    /// True when its constants are found on the grid; else all of its columns are taken.
    pub(crate) fn takes_one(self) -> bool {
        self.constants() > 0
    }

    /// True for what is told from other friction by rows near rest alone.
    fn is_of_rest(self) -> bool {
        match self {
            Self::Sigmoid | Self::Stribeck | Self::CubeRoot | Self::MaxwellSlip => true,
            Self::Viscous
            | Self::AsymmetricViscous
            | Self::Coulomb
            | Self::AsymmetricCoulomb
            | Self::Quadratic
            | Self::Load => false,
        }
    }

    /// True for the step at rest, whose width is found anew with every further term.
    pub(crate) fn is_step(self) -> bool {
        matches!(self, Self::Coulomb | Self::AsymmetricCoulomb)
    }

    /// Which of the columns are tried together: neighbours on the grid, all columns where there is no grid.
    pub(crate) fn options(self, columns: &[CandidateColumn]) -> Vec<Vec<usize>> {
        let of_kind: Vec<usize> = (0..columns.len()).filter(|&place| columns[place].kind == self).collect();
        if !self.takes_one() {
            return vec![of_kind];
        }
        let (alone, of_grid): (Vec<usize>, Vec<usize>) =
            of_kind.into_iter().partition(|&place| columns[place].grid.is_none());
        let steps: Vec<&[usize]> = of_grid.chunk_by(|&a, &b| columns[a].grid == columns[b].grid).collect();
        let pairs = steps.windows(2).map(<[&[usize]]>::concat);
        let only = steps.first().filter(|_| steps.len() == 1).map(|only| only.to_vec());
        alone.into_iter().map(|place| vec![place]).chain(pairs).chain(only).collect()
    }
}

/// One column that a joint may have.
#[derive(Clone, Debug)]
pub(crate) struct CandidateColumn {
    pub(crate) kind: FrictionKind,
    pub(crate) term: TorqueTerm,
    /// What is stated when this column is chosen: itself, or both directions of a term that has two.
    pub(crate) stated: Vec<TorqueTerm>,
    /// Number of its step on the first axis of the grid, in ascending order; none for one that is tried alone.
    pub(crate) grid: Option<usize>,
}

/// A joint whose friction the training logs choose, and where the search begins.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionSearch {
    /// The joint.
    pub joint: String,
    /// Its stated Coulomb step: one of the candidates. None by default.
    pub coulomb: Option<CoulombShape>,
    /// Velocity below which the sign step counts as zero, rad/s or m/s. 0 by default.
    pub dead_band: f64,
    /// Width of the step of load-dependent friction where the logs show no smooth step and none is stated, rad/s or
    /// m/s. By default [`CoulombShape::USUAL_WIDTH`] of a usual arm.
    pub width: Option<f64>,
    /// Whether rows near rest count. Where they do not the step is as wide as stated or usual, and what differs from
    /// other friction near rest alone (Stribeck, sigmoid, cube root, elements with hysteresis) is no candidate. True by
    /// default.
    pub rows_near_rest: bool,
    /// Largest variance inflation with which Coulomb friction may differ by direction: `1 / (1 - R²)`, R² the share of
    /// the difference that gravity, offset and all other columns explain. Where gravity is constant or the joint has an
    /// offset, only the rows near rest distinguish the difference from them, and its error bar is wider by the square
    /// root of the inflation. Without a limit by default; an iteration, which does not
    /// converge while a parameter is hardly known, takes [`MOST_INFLATION`](Self::MOST_INFLATION).
    pub most_inflation: Option<f64>,
}

impl FrictionSearch {
    /// The usual bound of a variance inflation in regression diagnostics.
    pub const MOST_INFLATION: f64 = 10.0;

    /// The search for a joint's friction with the defaults.
    pub fn of(joint: impl Into<String>) -> Self {
        Self {
            joint: joint.into(),
            coulomb: None,
            dead_band: 0.0,
            width: None,
            rows_near_rest: true,
            most_inflation: None,
        }
    }
}

/// What velocities and positions of a usual arm are to one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointScale {
    joint: usize,
    /// A rad/s (m/s).
    pub(crate) velocity: f64,
    /// A rad (m).
    position: f64,
}

impl JointScale {
    #[cfg(test)]
    pub(super) const fn usual(joint: usize) -> Self {
        Self { joint, velocity: 1.0, position: 1.0 }
    }

    /// The narrowest step that is looked for beside the sign, rad/s (m/s).
    pub(super) fn narrowest_width(self) -> f64 {
        NARROWEST * self.velocity
    }

    pub(crate) fn of(model: &Model, joint: usize) -> Self {
        let (own, turns) = (model.own_scale(), model.joints()[joint].turns());
        Self { joint, velocity: own.velocity(turns, 1.0), position: own.position(turns, 1.0) }
    }
}

/// Viscous friction with a Coulomb step: the columns that tell how wide the step is before anything else is chosen.
pub(crate) fn step_columns(search: &FrictionSearch, joint: JointScale) -> Vec<CandidateColumn> {
    let is_step = |column: &CandidateColumn| matches!(column.kind, FrictionKind::Viscous | FrictionKind::Coulomb);
    candidate_columns(search, joint, None).into_iter().filter(is_step).collect()
}

/// The columns to choose from at a joint; a term's columns stand together, in the order of its grid. `width` is about
/// that of the step at rest, if that is known: a point of the grid, for what lies between two points looks like a
/// further term.
pub(crate) fn candidate_columns(
    search: &FrictionSearch,
    JointScale { joint, velocity, position }: JointScale,
    width: Option<f64>,
) -> Vec<CandidateColumn> {
    let sign = CoulombShape::Sign { dead_band: search.dead_band };
    let mut widths = WIDTHS.map(|width| width * velocity).to_vec();
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
    let mut columns = Vec::new();
    let mut add = |terms: Vec<TorqueTerm>, grid: Option<usize>| {
        let column = |term: &TorqueTerm| {
            Some(CandidateColumn { kind: FrictionKind::of(term)?, term: term.clone(), stated: terms.clone(), grid })
        };
        columns.extend(terms.iter().filter_map(column));
    };
    add(vec![TorqueTerm::Viscous(Viscous { joint })], None);
    for shape in alone {
        add(vec![TorqueTerm::Coulomb(Coulomb { joint, shape })], None);
    }
    for (step, &width) in widths.iter().enumerate() {
        add(vec![TorqueTerm::Coulomb(Coulomb { joint, shape: CoulombShape::Smooth { width } })], Some(step));
    }
    let both = [Direction::Forward, Direction::Backward];
    let directions = both.map(|direction| TorqueTerm::DirectionalViscous(DirectionalViscous { joint, direction }));
    add(directions.to_vec(), None);
    for (step, &width) in widths.iter().enumerate() {
        let shape = CoulombShape::Smooth { width };
        let of = |direction| TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint, direction, shape });
        add(both.map(of).to_vec(), Some(step));
    }
    for (step, width) in SIGMOID_WIDTHS.map(|width| width * velocity).into_iter().enumerate() {
        for offset_speed in [-0.5 * width, 0.5 * width] {
            add(vec![TorqueTerm::Sigmoid(Sigmoid { joint, steepness: 2.0 / width, offset_speed })], Some(step));
        }
    }
    for (step, speed) in STRIBECK_SPEEDS.map(|speed| speed * velocity).into_iter().enumerate() {
        for exponent in STRIBECK_EXPONENTS {
            let shape = CoulombShape::Smooth { width: STRIBECK_WIDTH * speed };
            add(vec![TorqueTerm::Stribeck(Stribeck { joint, speed, exponent, shape })], Some(step));
        }
    }
    for exponent in [PowerExponent::CubeRoot, PowerExponent::Quadratic] {
        add(vec![TorqueTerm::Power(Power { joint, exponent, rounding: Power::ROUNDING * velocity })], None);
    }
    add(vec![TorqueTerm::Load(LoadFriction { joint, shape: CoulombShape::Smooth { width: load_width } })], None);
    for yield_displacement in YIELDS.map(|displacement| displacement * position) {
        add(vec![TorqueTerm::MaxwellSlip(MaxwellSlip { joint, yield_displacement })], None);
    }
    columns.retain(|column: &CandidateColumn| search.rows_near_rest || !column.kind.is_of_rest());
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without rows near rest: one step, as wide as stated, and no friction that is told by them alone.
    #[test]
    fn what_rows_near_rest_alone_show_is_no_candidate_without_them() {
        use FrictionKind::{AsymmetricCoulomb, AsymmetricViscous, Coulomb, Load, Quadratic, Viscous};
        let scale = JointScale::usual(0);
        let kinds = |search: &FrictionSearch| -> Vec<FrictionKind> {
            let mut kinds: Vec<_> = candidate_columns(search, scale, None).iter().map(|column| column.kind).collect();
            kinds.sort();
            kinds.dedup();
            kinds
        };
        let all = FrictionSearch::of("joint1");
        let coulomb = Some(CoulombShape::Smooth { width: 0.03 });
        let far = FrictionSearch { rows_near_rest: false, coulomb, ..all.clone() };
        assert_eq!(kinds(&all).len(), 10);
        assert_eq!(kinds(&far), [Viscous, AsymmetricViscous, Coulomb, AsymmetricCoulomb, Quadratic, Load]);
        // The one step is a choice of its own, though it has no neighbour on a grid.
        let columns = candidate_columns(&far, scale, None);
        let options = Coulomb.options(&columns);
        assert_eq!(options.len(), 1, "{options:?}");
        let step = CoulombShape::Smooth { width: 0.03 };
        let stated = TorqueTerm::Coulomb(dynident_model::terms::Coulomb { joint: 0, shape: step });
        assert_eq!(columns[options[0][0]].term, stated);
    }
}
