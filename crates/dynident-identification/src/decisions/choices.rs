//! Choices made so far (drive inertia, cut-off, lag, friction), with the evidence for each.

use crate::bandwidth::CutoffByError;
use crate::chosen_friction::{ChosenFriction, GridFriction};
use crate::drive_inertia::DriveInertiaChoice;
use crate::lag::LagRounds;
use crate::settings::LagCandidates;
use dynident_dynamics::ParametricModel;

#[derive(Clone)]
pub(crate) struct Drives {
    pub(crate) robot: ParametricModel,
    /// Evidence for the choice; `None` if the study states the drive inertia.
    pub(crate) choice: Option<DriveInertiaChoice>,
}

#[derive(Clone)]
pub(super) struct CutoffChoice {
    /// Comparison of cut-offs; `None` if the study states the cut-off or the logs are too short.
    pub(super) by_error: Option<CutoffByError>,
}

#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "there is one value for each identification")]
pub(super) enum FrictionChoice {
    Open,
    /// Friction terms with constants on a grid, which is enough to estimate a lag.
    Grid(GridFriction),
    /// Friction that was selected from an excerpt of the logs; its constants must still be adjusted to all rows.
    OfExcerpt(ChosenFriction),
    Made(ChosenFriction),
}

/// Choices that must be made again if the lag is revised.
#[allow(clippy::large_enum_variant, reason = "there is one value for each identification")]
#[derive(Clone)]
enum Origin {
    /// All other choices, because they were made from rows with the previous lag.
    TheseLogs,
    /// Only the friction constants, because all other choices were made from an excerpt.
    Excerpt(ChosenFriction),
    Final,
}

/// Choices made so far. `None` and [`FrictionChoice::Open`] are choices that are still open.
#[derive(Clone)]
pub(crate) struct Choices {
    /// The compensated lag and the number of its revisions.
    pub(super) lag: LagRounds,
    pub(super) drives: Option<Drives>,
    pub(super) cutoff: Option<CutoffChoice>,
    pub(super) grid: Option<GridFriction>,
    pub(super) friction: FrictionChoice,
    /// Cut-off at which friction was selected, hertz; `None` if the study states the cut-off.
    pub(super) friction_hz: Option<f64>,
    pub(super) cutoff_with_friction: Option<CutoffByError>,
    /// Whether drive inertia was tested with the selected friction. Then a revision of the lag does not change it.
    pub(super) has_drives_with_friction: bool,
    /// Whether the lag that is compensated before friction is selected was decided.
    pub(super) has_lag_before_friction: bool,
    /// Whether friction was selected again at another cut-off.
    pub(super) has_cutoff_of_friction: bool,
    origin: Origin,
}

impl Choices {
    /// No choices yet; `candidates` are the lags that may be compensated.
    pub(super) fn open(candidates: LagCandidates) -> Self {
        Self {
            lag: LagRounds::of(candidates),
            drives: None,
            cutoff: None,
            grid: None,
            friction: FrictionChoice::Open,
            friction_hz: None,
            cutoff_with_friction: None,
            has_drives_with_friction: false,
            has_lag_before_friction: false,
            has_cutoff_of_friction: false,
            origin: Origin::TheseLogs,
        }
    }

    pub(crate) fn cutoff(&self) -> Option<&CutoffByError> {
        let before = self.cutoff.as_ref().and_then(|cutoff| cutoff.by_error.as_ref());
        self.cutoff_with_friction.as_ref().or(before)
    }

    /// Cut-off at which friction is selected, hertz: the highest one whose predicted parameter error is nearly the
    /// smallest, because fast changes of friction at reversals are above the frequency band of the motion.
    pub(super) fn friction_cutoff_hz(&self) -> Option<f64> {
        self.cutoff().map(CutoffByError::highest_alike_hz)
    }

    pub(crate) fn drives(&self) -> Option<&Drives> {
        self.drives.as_ref()
    }

    pub(crate) fn friction(&self) -> Option<ChosenFriction> {
        match &self.friction {
            FrictionChoice::Open => None,
            FrictionChoice::Grid(grid) => Some(grid.as_chosen()),
            FrictionChoice::OfExcerpt(friction) | FrictionChoice::Made(friction) => Some(friction.clone()),
        }
    }

    pub(crate) fn lag(&self) -> &LagRounds {
        &self.lag
    }

    #[must_use]
    pub(super) fn with_open_friction(&self) -> Self {
        Self { friction: FrictionChoice::Open, ..self.clone() }
    }

    #[must_use]
    pub(super) fn with_lag(self, lag: LagRounds) -> Self {
        Self { lag, ..self }
    }

    /// Marks all other choices as final: a revision of the lag does not change them.
    pub(super) fn finish(&mut self) {
        self.origin = Origin::Final;
    }

    /// Opens the cut-off and friction again, because drive inertia or the lag changed.
    pub(super) fn reopen_friction(&mut self) {
        (self.cutoff, self.grid) = (None, None);
        (self.friction, self.friction_hz, self.cutoff_with_friction) = (FrictionChoice::Open, None, None);
    }

    pub(super) fn reopen(&mut self) {
        match &self.origin {
            Origin::TheseLogs => {
                if !self.has_drives_with_friction {
                    self.drives = None;
                }
                self.reopen_friction();
            }
            Origin::Excerpt(friction) => self.friction = FrictionChoice::OfExcerpt(friction.clone()),
            Origin::Final => {}
        }
    }

    /// Takes the choices from an excerpt as a start for all rows. The lag and the friction constants are revised, the
    /// rest is kept. `candidates` are the lags that may be compensated with all rows.
    #[must_use]
    pub(crate) fn of_excerpt(self, candidates: LagCandidates) -> Self {
        let cutoff = CutoffChoice { by_error: self.cutoff().cloned() };
        let lag = LagRounds::of(candidates).after(self.lag.clone().choice());
        let (friction, origin) = match self.friction() {
            Some(friction) => (FrictionChoice::OfExcerpt(friction.clone()), Origin::Excerpt(friction)),
            None => (FrictionChoice::Open, Origin::TheseLogs),
        };
        Self {
            lag,
            cutoff: Some(cutoff),
            grid: None,
            friction,
            friction_hz: None,
            cutoff_with_friction: None,
            has_lag_before_friction: true,
            has_cutoff_of_friction: true,
            origin,
            ..self
        }
    }
}
