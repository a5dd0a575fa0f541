//! Result of a design or check.

use super::forecast::named_forecast;
use super::limit_check::LimitCheck;
use super::limits_in_force::not_included;
use super::search::SearchResult;
use super::setup::{DesignSetup, MotionInformation};
use crate::error::Error;
use crate::pages::design as pictures;
use crate::pages::design_page::{SampledDesign, closest_pairs, design_page};
use crate::pages::robot::RobotAppearance;
use crate::result::{DESIGN_SCHEMA, DesignFile, Provenance, WindowedFile};
use crate::study::{FamilyChoice, StudyRobot};
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_excitation::criteria::{ConditionNumber, Criterion, DOptimal};
use dynident_excitation::families::SampledMotion;
use dynident_excitation::limits::Limits;
use dynident_excitation::optimisers::Generation;
use dynident_excitation::{Family, Motion};
use dynident_model::Model;
use nalgebra::DMatrix;

/// Sampling rate of plots for an arm of 1.2 m, Hz.
const PLOT_RATE_HZ: f64 = 100.0;

pub(super) struct MotionOrigin {
    motion: Box<dyn Family>,
    parameters: Vec<f64>,
    family: String,
    family_settings: Option<FamilyChoice>,
    given: Option<String>,
    start_posture: Vec<Option<f64>>,
    optimiser: String,
    criterion: String,
    figure: Option<f64>,
    windowed: Option<WindowedFile>,
    history: Vec<Generation>,
    evaluations: usize,
    seconds: f64,
}

impl MotionOrigin {
    pub(super) fn search(setup: &DesignSetup, found: SearchResult) -> Self {
        let section = &setup.section;
        let windowed = found.windowed.as_ref();
        Self {
            family: windowed.map_or(section.family.name(), |_| found.family.name()).to_owned(),
            family_settings: Some(section.family.clone()),
            given: None,
            optimiser: windowed.map_or(section.optimiser.name(), |file| &file.optimiser).to_owned(),
            criterion: windowed.map_or(setup.criterion(), |_| "windowed-condition").to_owned(),
            motion: found.family,
            parameters: found.parameters,
            start_posture: found.start_posture,
            figure: found.figure,
            windowed: found.windowed,
            history: found.history,
            evaluations: found.evaluations,
            seconds: found.seconds,
        }
    }

    /// Creates the result of the given trajectory or log with this name.
    pub(super) fn given(setup: &DesignSetup, name: String, motion: SampledMotion, known: &MotionInformation) -> Self {
        Self {
            family: "given".to_owned(),
            family_settings: None,
            given: Some(name),
            optimiser: "none".to_owned(),
            criterion: setup.criterion().to_owned(),
            motion: Box::new(motion),
            parameters: Vec::new(),
            start_posture: Vec::new(),
            figure: setup.figure(known),
            windowed: None,
            history: Vec::new(),
            evaluations: 0,
            seconds: setup.stopwatch.started.elapsed().as_secs_f64(),
        }
    }
}

pub(super) struct MotionReview {
    /// Duration, s; for a log with gaps, the sum of its pieces.
    pub(super) duration_s: f64,
    /// Rate of the samples used for the information, Hz.
    pub(super) rate_hz: f64,
    pub(super) information: MotionInformation,
    pub(super) check: LimitCheck,
}

/// A finished design.
#[derive(Debug)]
pub struct DesignOutcome {
    /// Content of `design.json`.
    pub file: DesignFile,
    /// The robot.
    pub robot: StudyRobot,
    /// Limits that apply: those of the robot description, with those of the study replacing them.
    pub limits: Limits,
    /// Generations of the search; empty for a search with gradients.
    pub history: Vec<Generation>,
    /// The robot with the payload of the motion.
    loaded: Model,
    family: Box<dyn Family>,
}

impl DesignOutcome {
    pub(super) fn new(mut setup: DesignSetup, origin: MotionOrigin, review: MotionReview) -> Self {
        setup.not_checked.extend(not_included(&setup.limits, &setup.robot, &review.check.reports));
        let MotionInformation { plain, weighted } = &review.information;
        let log_det = |information: &DMatrix<f64>| DOptimal.figure(information).map(|figure| -figure);
        let condition = |scaled| ConditionNumber { scaled, ..ConditionNumber::default() }.figure(plain);
        let all = setup.prior.as_ref().map(|prior| prior + weighted);
        let (forecast, worst_directions) = named_forecast(&setup.robot, weighted, all.as_ref());
        let file = DesignFile {
            schema: DESIGN_SCHEMA.to_owned(),
            name: setup.name,
            provenance: None,
            joints: setup.robot.parametric.joint_names(),
            family: origin.family,
            family_settings: origin.family_settings,
            given: origin.given,
            parameters: origin.parameters,
            start_posture: origin.start_posture,
            optimiser: origin.optimiser,
            criterion: origin.criterion,
            criterion_figure: origin.figure,
            condition_number: condition(false),
            condition_number_scaled: condition(true),
            log_det: log_det(plain),
            log_det_weighted: log_det(weighted),
            base_columns: setup.robot.base().count(),
            duration_s: review.duration_s,
            rate_hz: review.rate_hz,
            torque_std_nm: setup.torque_std_nm,
            feasible: review.check.is_kept(),
            check_rate_hz: review.check.rate_hz,
            check_of: review.check.of.to_owned(),
            limits: review.check.reports,
            forecast,
            worst_directions,
            windowed: origin.windowed,
            evaluations: origin.evaluations,
            cpu_s: setup.stopwatch.cpu_s(),
            seconds: origin.seconds,
            stopped: false,
            seed: setup.section.search.seed,
            diagnosis: review.check.diagnosis,
            assumed: setup.assumed,
            not_checked: setup.not_checked,
            notes: setup.notes,
        };
        let (robot, loaded, limits) = (setup.robot, setup.loaded, setup.limits);
        Self { file, robot, loaded, limits, history: origin.history, family: origin.motion }
    }

    pub(super) fn with_provenance(mut self, provenance: Provenance) -> Self {
        self.file.provenance = Some(provenance);
        self
    }

    /// The family of the motion; its parameters are in `file`.
    pub fn family(&self) -> &dyn Family {
        &*self.family
    }

    fn plot_rate_hz(&self) -> f64 {
        self.robot.model().characteristic_scale().round_hertz(PLOT_RATE_HZ)
    }

    /// Samples the motion at `0, 1/rate, ..` and at its end; for a log with gaps, only its longest piece.
    pub fn sampled(&self, rate_hz: f64) -> (Vec<f64>, Motion) {
        let duration_s = self.family.duration_s();
        let steps = (duration_s * rate_hz - 1e-9).ceil().max(1.0) as usize;
        let times: Vec<f64> = (0..=steps).map(|k| (k as f64 / rate_hz).min(duration_s)).collect();
        let mut motion = Motion::default();
        self.family.motion(&self.file.parameters, &times, &mut motion);
        (times, motion)
    }

    /// Torque along a motion from nominal inertials and known friction and drives (at rest the middle of the friction
    /// range), joint-major like the motion, Nm (N); `None` if the inertials of a body are unknown.
    pub fn torque_nm(&self, motion: &Motion) -> Option<Vec<f64>> {
        let model = &self.loaded;
        if !model.bodies_without_prior().is_empty() {
            return None;
        }
        let mut workspace = Workspace::new(model);
        let mut torque = vec![0.0; motion.joints * motion.samples];
        let [mut low, mut high] = [(); 2].map(|()| vec![0.0; motion.joints]);
        for sample in 0..motion.samples {
            let state = |values: &[f64]| -> Vec<f64> {
                (0..motion.joints).map(|joint| values[joint * motion.samples + sample]).collect()
            };
            let (q, dq, ddq) = (state(&motion.q), state(&motion.dq), state(&motion.ddq));
            let rigid = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq);
            self.limits.known_torque.range(rigid, [&q, &dq, &ddq], &mut low, &mut high);
            for joint in 0..motion.joints {
                torque[joint * motion.samples + sample] = f64::midpoint(low[joint], high[joint]);
            }
        }
        Some(torque)
    }

    /// Writes `report.html`: verdict, an animation of the robot, limits, expected error bars, curves.
    ///
    /// # Errors
    /// [`Error::Report`], which indicates a bug.
    pub fn report(&self) -> Result<String, Error> {
        let (times_s, motion) = self.sampled(self.plot_rate_hz());
        let robot = RobotAppearance::new(self.robot.model(), &self.robot.robot.path);
        let torque = self.torque_nm(&motion);
        let in_limits = Error::section(&self.robot.robot.path, "design.limits");
        let pairs = closest_pairs(&self.limits, self.robot.model(), &motion).map_err(in_limits)?;
        let sampled = SampledDesign { times_s: &times_s, motion: &motion, torque: torque.as_deref(), pairs: &pairs };
        design_page(&self.file, &self.limits, &robot, &sampled)
    }

    /// Writes `preview.svg`: position, velocity, acceleration and, with known inertials, torque of every joint over
    /// time, with limits as dashed lines.
    ///
    /// # Errors
    /// A motion that cannot be plotted.
    pub fn preview_svg(&self) -> Result<String, Error> {
        let (times_s, motion) = self.sampled(self.plot_rate_hz());
        pictures::preview(&self.file, &self.limits, &times_s, &motion, self.torque_nm(&motion).as_deref())
    }

    /// Writes `path.svg`: path of the tool and some poses of the arm in the base frame, from above and from the side,
    /// with floor, column and boxes. The tool is the outermost frame on every last body.
    ///
    /// # Errors
    /// A motion that cannot be plotted.
    pub fn path_svg(&self) -> Result<String, Error> {
        pictures::path(&self.file, &self.limits, self.robot.model(), &self.sampled(self.plot_rate_hz()).1)
    }

    /// Writes `fitness.svg`: best and mean fitness per generation; `None` for a search without generations.
    ///
    /// # Errors
    /// A curve that cannot be plotted.
    pub fn fitness_svg(&self) -> Result<Option<String>, Error> {
        pictures::fitness(&self.file, &self.history)
    }
}
