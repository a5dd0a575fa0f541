//! Which base parameters are poorly known: kinds, and links or joints.

use super::{BaseParameterResult, ResultFile};
use dynident_model::terms::TorqueTerm;

/// A parameter is poorly known if its 95 % error bar exceeds this percentage of its value.
pub const POORLY_KNOWN_PERCENT: f64 = 30.0;

/// Maximum number of names in [`PoorlyKnown::words`].
const MAX_NAMES: usize = 2;

/// Kind of a base parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParameterKind {
    /// Mass of a link.
    Mass,
    /// Mass times a coordinate of the centre of mass.
    FirstMoment,
    /// Inertia of a link.
    Inertia,
    /// Inertia of a drive.
    DriveInertia,
    /// Friction of a joint.
    Friction,
    /// Offsets, declared torques, payloads.
    Other,
}

impl ParameterKind {
    const ALL: [Self; 6] =
        [Self::Mass, Self::FirstMoment, Self::Inertia, Self::DriveInertia, Self::Friction, Self::Other];

    /// The kind in the plural.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mass => "masses",
            Self::FirstMoment => "first moments",
            Self::Inertia => "inertia",
            Self::DriveInertia => "drive inertia",
            Self::Friction => "friction",
            Self::Other => "offsets and others",
        }
    }
}

/// The poorly known parameters of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PoorlyKnown {
    /// The kind.
    pub kind: ParameterKind,
    /// Number of poorly known parameters.
    pub count: usize,
    /// Number of all parameters of this kind.
    pub all: usize,
    /// Names of links or joints with such a parameter, in the order of the robot; three or more neighbours are one
    /// entry, `first to last`.
    pub of: Vec<String>,
}

impl PoorlyKnown {
    /// Kind, counts and names: `inertia 33 of 36 (arm_1 to arm_7)`, or `inertia all 36`.
    pub fn words(&self) -> String {
        let Self { kind, count, all, of } = self;
        let shown = of[..of.len().min(MAX_NAMES)].join(", ");
        match of.len() {
            _ if count == all => format!("{} all {all}", kind.name()),
            0 => format!("{} {count} of {all}", kind.name()),
            few if few <= MAX_NAMES => format!("{} {count} of {all} ({shown})", kind.name()),
            many => format!("{} {count} of {all} ({shown} and {} more)", kind.name(), many - MAX_NAMES),
        }
    }
}

impl BaseParameterResult {
    /// Whether the error bar exceeds [`POORLY_KNOWN_PERCENT`] of the value, or the logs do not excite the parameter.
    pub fn is_poorly_known(&self) -> bool {
        self.relative_half_width_percent().is_none_or(|bar| bar > POORLY_KNOWN_PERCENT)
    }
}

impl ResultFile {
    /// The poorly known base parameters by kind.
    pub fn poorly_known(&self) -> Vec<PoorlyKnown> {
        let placed: Vec<_> = self.base_parameters.iter().map(|p| (p, self.place_of(p))).collect();
        let of_kind = |kind: ParameterKind| {
            let own = || placed.iter().filter(move |(_, place)| place.kind == kind);
            let poor = || own().filter(|(p, _)| p.is_poorly_known());
            let mut owners: Vec<usize> = poor().filter_map(|(_, place)| place.owner).collect();
            owners.sort_unstable();
            owners.dedup();
            // Offsets and declared torques are listed without names.
            if kind == ParameterKind::Other {
                owners.clear();
            }
            let is_link = matches!(kind, ParameterKind::Mass | ParameterKind::FirstMoment | ParameterKind::Inertia);
            let name = |owner: &usize| {
                let body = || self.bodies.get(*owner).map(|body| body.name.clone());
                if is_link { body() } else { self.robot.joints.get(*owner).cloned() }
            };
            PoorlyKnown { kind, count: poor().count(), all: own().count(), of: neighbours(&owners, name) }
        };
        ParameterKind::ALL.into_iter().map(of_kind).filter(|found| found.count > 0).collect()
    }

    fn place_of(&self, parameter: &BaseParameterResult) -> ParameterPlace {
        let symbol = &parameter.symbol;
        let number = |name: &String| symbol.strip_prefix(name.as_str())?.parse::<usize>().ok()?.checked_sub(1);
        let mut inertial = self.robot.parameter_order.iter().enumerate();
        if let Some((k, body)) = inertial.find_map(|(k, name)| Some((k, number(name)?))) {
            let kind = match k {
                0 => ParameterKind::Mass,
                1..=3 => ParameterKind::FirstMoment,
                _ => ParameterKind::Inertia,
            };
            return ParameterPlace { kind, owner: Some(body) };
        }
        let terms = self.model.iter().flat_map(|model| &model.terms);
        let term = terms.map(|own| (&own.symbol, &own.term)).find(|(own, _)| *own == symbol).map(|(_, term)| term);
        let kind = match term {
            Some(term) if term.is_friction() => ParameterKind::Friction,
            Some(term) if term.is_drive_inertia() => ParameterKind::DriveInertia,
            _ => ParameterKind::Other,
        };
        ParameterPlace { kind, owner: term.and_then(TorqueTerm::own_joint) }
    }
}

/// Kind and place of a parameter.
struct ParameterPlace {
    kind: ParameterKind,
    /// Index of the body or joint; `None` for a parameter of several joints.
    owner: Option<usize>,
}

/// Names of sorted indices; three or more neighbours become one entry.
fn neighbours(indices: &[usize], name: impl Fn(&usize) -> Option<String>) -> Vec<String> {
    let mut names = Vec::new();
    for run in indices.chunk_by(|a, b| a + 1 == *b) {
        match (run, run.first().and_then(&name), run.last().and_then(&name)) {
            ([_, _, _, ..], Some(first), Some(last)) => names.push(format!("{first} to {last}")),
            _ => names.extend(run.iter().filter_map(&name)),
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_become_one_entry() {
        let name = |index: &usize| Some(format!("link_{index}"));
        assert_eq!(neighbours(&[0, 1, 2, 4, 6, 7], name), ["link_0 to link_2", "link_4", "link_6", "link_7"]);
        let of = neighbours(&[0, 1, 3, 5], name);
        let found = PoorlyKnown { kind: ParameterKind::Inertia, count: 9, all: 12, of };
        assert_eq!(found.words(), "inertia 9 of 12 (link_0, link_1 and 2 more)");
        assert_eq!(PoorlyKnown { count: 12, ..found }.words(), "inertia all 12");
    }
}
