//! All that is known of a motion in the end.

use super::forecast::named_forecast;
use super::limit_check::LimitCheck;
use super::limits_in_force::not_included;
use super::search::SearchResult;
use super::setup::{DesignSetup, MotionInformation};
use crate::error::Error;
use crate::pages::design as pictures;
use crate::result::{DESIGN_SCHEMA, DesignFile, Provenance, WindowedFile};
use crate::study::{FamilyChoice, StudyRobot};
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_excitation::criteria::{ConditionNumber, Criterion, DOptimal};
use dynident_excitation::families::Given;
use dynident_excitation::limits::Limits;
use dynident_excitation::optimisers::Generation;
use dynident_excitation::{Family, Motion};
use dynident_model::Model;
use nalgebra::DMatrix;

/// Rate of the pictures, Hz of a usual arm.
const PICTURES_HZ: f64 = 100.0;

/// A motion and where it comes from: a search, or somebody who brings it.
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
    /// The best motion of a search.
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

    /// The trajectory or log called `name`.
    pub(super) fn given(setup: &DesignSetup, name: String, motion: Given, known: &MotionInformation) -> Self {
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

/// What a look at a motion shows.
pub(super) struct MotionReview {
    /// Seconds from its start to its end; of a log with gaps, of all its pieces.
    pub(super) duration_s: f64,
    /// Rate of the samples that count for the information, Hz.
    pub(super) rate_hz: f64,
    /// What the motion says about the parameters.
    pub(super) information: MotionInformation,
    /// The limits.
    pub(super) check: LimitCheck,
}

/// A finished design.
#[derive(Debug)]
pub struct DesignOutcome {
    /// What `design.json` holds.
    pub file: DesignFile,
    /// The robot.
    pub robot: StudyRobot,
    /// The limits in force: the description's with the study's laid over them.
    pub limits: Limits,
    /// The search by generations, for optimisers that have them; empty for gradients.
    pub history: Vec<Generation>,
    /// The robot with the payload that the motion carries.
    loaded: Model,
    family: Box<dyn Family>,
}

impl DesignOutcome {
    /// All of it together.
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
            feasible: review.check.kept(),
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

    /// The outcome with what it comes from.
    pub(super) fn with_provenance(mut self, provenance: Provenance) -> Self {
        self.file.provenance = Some(provenance);
        self
    }

    /// The family of the motion; its parameters are the file's.
    pub fn family(&self) -> &dyn Family {
        &*self.family
    }

    fn pictures_hz(&self) -> f64 {
        self.robot.model().own_scale().round_hertz(PICTURES_HZ)
    }

    /// The times `0, 1/rate, ..` up to the end, which stands last even if the rate does not divide the duration, and
    /// the motion there; of a log with gaps that of its longest piece.
    pub fn sampled(&self, rate_hz: f64) -> (Vec<f64>, Motion) {
        let duration_s = self.family.duration_s();
        let steps = (duration_s * rate_hz - 1e-9).ceil().max(1.0) as usize;
        let times: Vec<f64> = (0..=steps).map(|k| (k as f64 / rate_hz).min(duration_s)).collect();
        let mut motion = Motion::default();
        self.family.motion(&self.file.parameters, &times, &mut motion);
        (times, motion)
    }

    /// Torque along a motion by the prior inertial parameters and the known torque of friction and drives (at rest the
    /// middle of what friction may hold), joint-major as the motion, Nm (N); `None` while a body's
    /// inertial is unknown.
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

    /// `preview.svg`: position, velocity, acceleration and, where the inertials are known, torque of every joint over
    /// time, limits dashed.
    ///
    /// # Errors
    /// A motion that cannot be drawn.
    pub fn preview_svg(&self) -> Result<String, Error> {
        let (times_s, motion) = self.sampled(self.pictures_hz());
        pictures::preview(&self.file, &self.limits, &times_s, &motion, self.torque_nm(&motion).as_deref())
    }

    /// `path.svg`: the tool's path and some poses of the arm in the base frame, from above and from the side, with
    /// floor, column and boxes. The tool is the frame farthest out on every last body.
    ///
    /// # Errors
    /// A motion that cannot be drawn.
    pub fn path_svg(&self) -> Result<String, Error> {
        pictures::path(&self.file, &self.limits, self.robot.model(), &self.sampled(self.pictures_hz()).1)
    }

    /// `fitness.svg`: best and mean fitness by generation (the paper's Fig. 7); none for a search without generations.
    ///
    /// # Errors
    /// A curve that cannot be drawn.
    pub fn fitness_svg(&self) -> Result<Option<String>, Error> {
        pictures::fitness(&self.file, &self.history)
    }
}
