//! The kinds of mistakes that `check` detects. Each kind has a file with its candidates, correction, free number, study
//! key and sentence. A new kind needs one file here, its `mod`, and one row of `mistake_kinds!`; no other code matches
//! over kinds.

pub mod compensated;
pub mod convention;
pub mod coupled;
pub mod differential;
pub mod gravity;
mod kind;
pub mod lag;
pub mod length;
mod numbers;
pub mod offset;
pub mod order;
pub mod position_unit;
pub mod sign;
mod study_keys;
pub mod time_unit;
pub mod torque_unit;

pub use study_keys::{KeyChange, StudyKeys};

pub(super) use kind::{Breadth, Proof, Setup, TorqueSource};
pub(super) use numbers::ternary_search;

use super::channels::Channels;
use super::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use kind::{Facts, MistakeKind};

macro_rules! mistake_kinds {
    ($($file:ident::$kind:ident,)*) => {
        /// One mistake of a study. Joints are indices in the order of the model.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Mistake {
            $(#[doc = concat!("See [`", stringify!($file), "::", stringify!($kind), "`].")] $kind($file::$kind),)*
        }

        $(impl From<$file::$kind> for Mistake {
            fn from(mistake: $file::$kind) -> Self {
                Self::$kind(mistake)
            }
        })*

        impl Mistake {
            /// Candidates of all kinds, in the order of the kinds.
            pub(super) fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
                let mut all = Vec::new();
                $(all.extend($file::$kind::candidates(setup, breadth).into_iter().map(Self::$kind));)*
                all
            }

            fn kind(&self) -> &dyn MistakeKind {
                match self { $(Self::$kind(mistake) => mistake,)* }
            }
        }
    };
}

// Candidates are tried in this order. If scores are equal, the first one is selected.
mistake_kinds! {
    position_unit::PositionUnit,
    torque_unit::TorqueUnit,
    time_unit::TimeUnit,
    sign::Sign,
    order::Order,
    offset::Offset,
    coupled::Coupled,
    differential::Differential,
    gravity::Gravity,
    convention::Convention,
    length::Length,
    compensated::Compensated,
    lag::Lag,
}

impl Mistake {
    /// `kind` of the finding in the JSON of `check`.
    pub fn key(&self) -> &'static str {
        self.facts().key
    }

    /// The mistake in a sentence with the names of the joints.
    pub fn sentence(&self, names: &[String]) -> String {
        self.kind().sentence(names)
    }

    /// Keys of the study that correct the mistake; empty if no key corrects it.
    pub fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        self.kind().changes(keys)
    }

    /// The range of factors that the logs do not distinguish from the factor of this mistake, as the end of a sentence;
    /// empty if the range is narrow or the mistake has no factor.
    pub fn other_factors(&self, range: [f64; 2]) -> String {
        self.kind().other_factors(range)
    }

    /// The rows after correction of this mistake. A lag does not change them, because it uses other instants.
    pub fn corrected(&self, robot: &ParametricModel, rows: &MotionRows) -> MotionRows {
        let mut rows = rows.clone();
        self.kind().correct(robot, &mut rows);
        rows
    }

    /// The robot after correction of this mistake; `None` if it does not change.
    pub fn corrected_robot(&self, robot: &ParametricModel) -> Option<ParametricModel> {
        self.kind().corrected_robot(robot)
    }

    /// The affected joints of a robot with `dof` joints.
    pub fn joints(&self, dof: usize) -> Vec<usize> {
        self.facts().joints.unwrap_or_else(|| (0..dof).collect())
    }

    pub(super) fn facts(&self) -> Facts {
        self.kind().facts()
    }

    /// Whether two mistakes are equal except for their numbers.
    pub(super) fn differs_only_in_number(&self, other: &Self) -> bool {
        let [own, other] = [self, other].map(|mistake| mistake.kind().subject().unwrap_or_else(|| mistake.clone()));
        own == other
    }

    /// The mistake with another number, if it has a number.
    pub(super) fn with_number(&self, number: f64) -> Self {
        self.kind().with_number(number).unwrap_or_else(|| self.clone())
    }

    /// The mistake with the number nearby that gives the smallest `value`; `None` without a free number.
    pub(super) fn with_best_number(&self, value: impl Fn(&Self) -> f64) -> Option<Self> {
        self.kind().with_best_number(&value)
    }

    /// The mistake with the exact unit nearest to its number; `None` if no unit is near.
    pub(super) fn nearest_unit(&self) -> Option<Self> {
        self.kind().nearest_unit()
    }

    pub(super) fn torques_alone(&self) -> Option<Vec<TorqueSource>> {
        let Facts { channels, torques, .. } = self.facts();
        (channels == Some(Channels::Torque) && !torques.is_empty()).then_some(torques)
    }

    /// The joint whose torque column in the study becomes the torque of `joint`.
    pub(super) fn torque_from(&self, joint: usize) -> usize {
        let Facts { channels, torques, .. } = self.facts();
        let source = torques.iter().find(|source| channels != Some(Channels::Position) && source.joint == joint);
        source.map_or(joint, |source| source.from)
    }

    /// The same mistake in the position instead of the torque, or in the torque instead of the position; logs hardly
    /// distinguish the two.
    pub(super) fn twin(&self) -> Option<Self> {
        self.kind().with_channels(self.facts().channels?.other()?)
    }

    /// The same mistake in the channels that are reported first.
    pub(super) fn likelier(&self) -> Option<Self> {
        self.kind().with_channels(self.facts().likelier_channels?)
    }
}
