//! The kinds of mistakes that `check` knows: one file each, with its candidates, its correction, its number, its key
//! and its words. A new kind is one file here, its `mod`, and one row of `mistake_kinds!`: nothing else matches over
//! kinds. The words are here too, so that one file states all of a kind; only [`StudyKeys`] comes from the study.

pub mod compensated;
pub mod convention;
pub mod coupled;
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
pub(super) use numbers::least_by_thirds;

use super::channels::Channels;
use super::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;
use kind::{Facts, MistakeKind};

macro_rules! mistake_kinds {
    ($($file:ident::$kind:ident,)*) => {
        /// One mistake of a study. Joints are numbers in the model's order.
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
            /// Mistakes to try, in the order of the kinds.
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

// Candidates are tried in this order, which decides between equal scores.
mistake_kinds! {
    position_unit::PositionUnit,
    torque_unit::TorqueUnit,
    time_unit::TimeUnit,
    sign::Sign,
    order::Order,
    offset::Offset,
    coupled::Coupled,
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

    /// Keys that correct the study; none where no key does.
    pub fn changes(&self, keys: &StudyKeys) -> Vec<KeyChange> {
        self.kind().changes(keys)
    }

    /// The range of factors that the logs do not distinguish from its own, as the end of a sentence; empty where the
    /// range is narrow, or the mistake has no such factor.
    pub fn other_factors(&self, range: [f64; 2]) -> String {
        self.kind().other_factors(range)
    }

    /// The motion of a robot without this mistake. Rows of a lag are not changed: its instants are chosen anew.
    pub fn corrected(&self, robot: &ParametricModel, rows: &MotionRows) -> MotionRows {
        let mut rows = rows.clone();
        self.kind().correct(robot, &mut rows);
        rows
    }

    /// The robot without this mistake; `None` where it is the same.
    pub fn corrected_robot(&self, robot: &ParametricModel) -> Option<ParametricModel> {
        self.kind().corrected_robot(robot)
    }

    /// The joints that it is about, of `dof`.
    pub fn joints(&self, dof: usize) -> Vec<usize> {
        self.facts().joints.unwrap_or_else(|| (0..dof).collect())
    }

    /// The properties of its kind.
    pub(super) fn facts(&self) -> Facts {
        self.kind().facts()
    }

    /// Whether two mistakes are about the same, their numbers aside.
    pub(super) fn is_alike(&self, other: &Self) -> bool {
        let [own, other] = [self, other].map(|mistake| mistake.kind().subject().unwrap_or_else(|| mistake.clone()));
        own == other
    }

    /// The same with another number; itself where it has none.
    pub(super) fn with_number(&self, number: f64) -> Self {
        self.kind().with_number(number).unwrap_or_else(|| self.clone())
    }

    /// The same with the number near its own at which `value` is least; none where it has no free number.
    pub(super) fn between(&self, value: impl Fn(&Self) -> f64) -> Option<Self> {
        self.kind().between(&value)
    }

    /// The torque columns that change, if nothing else does.
    pub(super) fn torques_alone(&self) -> Option<Vec<TorqueSource>> {
        let Facts { channels, torques, .. } = self.facts();
        (channels == Some(Channels::Torque) && !torques.is_empty()).then_some(torques)
    }

    /// The joint whose torque column a joint gets by the correction.
    pub(super) fn torque_from(&self, joint: usize) -> usize {
        let Facts { channels, torques, .. } = self.facts();
        let source = torques.iter().find(|source| channels != Some(Channels::Position) && source.joint == joint);
        source.map_or(joint, |source| source.from)
    }

    /// The same mistake of the other one of position and torque, which is hard to distinguish.
    pub(super) fn twin(&self) -> Option<Self> {
        self.kind().with_channels(self.facts().channels?.other()?)
    }

    /// The mistake that is named first of those that logs hardly distinguish from it.
    pub(super) fn likelier(&self) -> Option<Self> {
        self.kind().with_channels(self.facts().likelier_channels?)
    }
}
