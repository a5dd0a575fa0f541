//! Automatically selected friction compared with the true friction laws: robots × motions × friction laws.
//!
//! Like in [`cutoffs`](crate::cutoffs), the error is that of the fitted model's torque on another random motion
//! without noise: RMS over joints, each relative to the standard deviation of its torque.

use crate::accuracy::BenchmarkError;
use crate::simulated_logs::{
    PANDA, PERIOD_S, SimulatedLog, SimulatedRobot, UR10, excitation, model_error, recording, rms, torque, truth,
    unexplained_torque,
};
use dynident_dynamics::ParametricModel;
use dynident_estimation::EstimationError;
use dynident_excitation::Motion;
use dynident_identification::friction::FrictionSearch;
use dynident_identification::{
    DiagnosisChoice, Execution, Identification, IdentificationError, IdentificationTask, Recording, RegressorModel,
    identify,
};
use dynident_model::terms::{
    Coulomb, CoulombShape, Direction, DirectionalCoulomb, DirectionalViscous, DriveChoice, LoadFriction, Offset,
    Sigmoid, Stribeck, TorqueTerm, Viscous, terms_per_joint,
};
use dynident_model::{Joint, Model};

/// True friction of every joint, in addition to an offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrictionTruth {
    /// Viscous and Coulomb friction.
    Plain,
    /// Viscous and Coulomb friction that depend on the direction: 30 and 40 % larger backward.
    Asymmetric,
    /// Viscous and Coulomb friction, with half of the Coulomb friction added near rest.
    Stribeck,
    /// Viscous friction and a sigmoid (smoothed step) centred at a nonzero velocity.
    Sigmoid,
    /// Viscous and Coulomb friction, and a tenth of the transmitted torque.
    Load,
}

/// Width of the true smoothed sign function, rad/s; different from the start values of the search.
const STEP_WIDTH_RAD_S: f64 = 0.015;
/// Stribeck velocity, rad/s, and exponent: between the candidates of the search.
const STRIBECK_VELOCITY_AND_EXPONENT: (f64, f64) = (0.07, 1.5);
/// Steepness of the sigmoid, s/rad, and the velocity of its centre, rad/s.
const SIGMOID_STEEPNESS_AND_VELOCITY: (f64, f64) = (50.0, 0.015);
/// Load-dependent friction relative to the transmitted torque.
const LOAD_SHARE: f64 = 0.1;
/// A term can be distinguished if it reduces the residual of the best fit by this many standard deviations of the
/// noise, over all samples together.
pub(crate) const MIN_DETECTABLE_STD: f64 = 10.0;

impl FrictionTruth {
    /// All laws.
    pub const ALL: [Self; 5] = [Self::Plain, Self::Asymmetric, Self::Stribeck, Self::Sigmoid, Self::Load];

    /// Name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Asymmetric => "asymmetric",
            Self::Stribeck => "Stribeck",
            Self::Sigmoid => "sigmoid",
            Self::Load => "load",
        }
    }

    pub(crate) fn terms(self, joint: usize) -> Vec<TorqueTerm> {
        self.terms_with_shares(joint).into_iter().map(|(term, _)| term).collect()
    }

    fn terms_with_shares(self, joint: usize) -> Vec<(TorqueTerm, f64)> {
        let shape = CoulombShape::Smooth { width: STEP_WIDTH_RAD_S };
        let viscous = (TorqueTerm::Viscous(Viscous { joint }), 1.0);
        let coulomb = (TorqueTerm::Coulomb(Coulomb { joint, shape }), 1.0);
        let mut terms = match self {
            Self::Plain => vec![viscous, coulomb],
            Self::Asymmetric => {
                let of_direction = |(direction, [of_viscous, of_coulomb]): (Direction, [f64; 2])| {
                    [
                        (TorqueTerm::DirectionalViscous(DirectionalViscous { joint, direction }), of_viscous),
                        (TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint, direction, shape }), of_coulomb),
                    ]
                };
                [(Direction::Forward, [1.0, 1.0]), (Direction::Backward, [1.3, 1.4])].map(of_direction).concat()
            }
            Self::Stribeck => {
                let (speed, exponent) = STRIBECK_VELOCITY_AND_EXPONENT;
                vec![viscous, coulomb, (TorqueTerm::Stribeck(Stribeck { joint, speed, exponent, shape }), 0.5)]
            }
            Self::Sigmoid => {
                let (steepness, offset_speed) = SIGMOID_STEEPNESS_AND_VELOCITY;
                vec![viscous, (TorqueTerm::Sigmoid(Sigmoid { joint, steepness, offset_speed }), 1.0)]
            }
            Self::Load => vec![viscous, coulomb, (TorqueTerm::Load(LoadFriction { joint, shape }), LOAD_SHARE)],
        };
        terms.push((TorqueTerm::Offset(Offset { joint }), 1.0));
        terms
    }

    /// Ratio of a parameter of this law to its typical value.
    pub(crate) fn share(self, term: &TorqueTerm) -> f64 {
        let mut own = term.own_joint().into_iter().flat_map(|joint| self.terms_with_shares(joint));
        own.find(|(own, _)| own == term).map_or(1.0, |(_, share)| share)
    }

    /// Whether the term distinguishes this law from viscous and Coulomb friction. If the law is only these two, its
    /// Coulomb friction distinguishes it from viscous friction.
    pub(crate) fn is_distinguished_by(self, term: &TorqueTerm) -> bool {
        let Some(law) = term.candidate() else { return false };
        let has_law = |truth: Self| truth.terms(0).iter().any(|own| own.candidate() == Some(law));
        if self == Self::Plain { law.is_common_step() } else { has_law(self) && !has_law(Self::Plain) }
    }
}

/// A robot, the settings of its recordings, and its friction.
#[derive(Clone, Copy, Debug)]
pub struct FrictionCell {
    /// The robot.
    pub robot: SimulatedRobot,
    /// Settings of the robot's recordings.
    pub log: SimulatedLog,
    /// True friction of its joints.
    pub truth: FrictionTruth,
}

const MOTIONS: [(SimulatedRobot, SimulatedLog); 3] =
    [(UR10, log(5, 10.0, 500.0, 1e-5)), (UR10, log(5, 30.0, 500.0, 1e-4)), (PANDA, log(5, 30.0, 1000.0, 1e-5))];

const fn log(harmonics: usize, duration_s: f64, rate_hz: f64, position_noise_rad: f64) -> SimulatedLog {
    SimulatedLog { harmonics, duration_s, rate_hz, position_noise_rad, torque_noise: 0.01 }
}

/// The registry: every motion with every friction law.
pub fn friction_cells() -> Vec<FrictionCell> {
    let with = |(robot, log)| FrictionTruth::ALL.map(|truth| FrictionCell { robot, log, truth });
    MOTIONS.into_iter().flat_map(with).collect()
}

/// Torque errors of one cell, RMS over its runs, relative to the standard deviation of the torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionFigures {
    /// Number of joints, over all runs, whose friction law can be distinguished with these recordings.
    pub tellable: usize,
    /// Number of these joints for which the true law was selected.
    pub told: usize,
    /// Error with automatically selected friction.
    pub of_choice: f64,
    /// Error with the true friction laws.
    pub of_truth: f64,
    /// Error with viscous and Coulomb friction.
    pub of_plain: f64,
}

/// Fits `runs` recordings of a cell with selected friction, with true friction, and with viscous and Coulomb
/// friction.
///
/// # Errors
/// A robot, motion or recording that cannot be created, a fit that fails.
pub fn friction_figures(cell: &FrictionCell, runs: u64) -> Result<FrictionFigures, BenchmarkError> {
    let failed = |reason: String| BenchmarkError::Excitation { robot: cell.robot.name.to_owned(), reason };
    let model = cell.robot.model().map_err(failed)?;
    let with_terms = |terms| ParametricModel::new(model.clone(), terms).map_err(|source| failed(source.to_string()));
    let plain = with_terms(terms_per_joint(&model, |joint| usual_drive(&model, joint)))?;
    let exact = with_terms((0..model.dof()).flat_map(|joint| cell.truth.terms(joint)).collect())?;
    let mut figures = FrictionFigures::default();
    for run in 0..runs {
        let made = Made::new(cell, &model, &exact, run).map_err(failed)?;
        let without = plain_without(&plain, cell.truth);
        let tellable =
            made.tellable(without.as_ref().unwrap_or(&plain)).map_err(|source| failed(source.to_string()))?;
        let choice = made.fit(&plain, true)?;
        for (joint, name) in model.joints().iter().enumerate() {
            let found = choice.training.friction_choice.iter().find(|one| one.joint == name.name);
            let terms = found.and_then(|one| one.terms.as_ref());
            if tellable[joint] {
                figures.tellable += 1;
                figures.told +=
                    usize::from(terms.is_some_and(|terms| terms.iter().any(|t| cell.truth.is_distinguished_by(t))));
            }
        }
        let add = |to: &mut f64, found: &Identification| *to += made.error(found).powi(2) / runs as f64;
        add(&mut figures.of_choice, &choice);
        add(&mut figures.of_truth, &made.fit(&exact, false)?);
        add(&mut figures.of_plain, &made.fit(&plain, false)?);
    }
    for square in [&mut figures.of_choice, &mut figures.of_truth, &mut figures.of_plain] {
        *square = square.sqrt();
    }
    Ok(figures)
}

/// Drive terms of a study without friction keys; the width of the smoothed sign function is that of a typical arm,
/// scaled to the robot.
pub(crate) fn usual_drive(model: &Model, joint: usize) -> DriveChoice {
    let width = model.characteristic_scale().velocity(model.joints()[joint].is_rotary(), CoulombShape::USUAL_WIDTH);
    let coulomb = Some(CoulombShape::Smooth { width });
    DriveChoice { viscous: true, coulomb, offset: true, ..DriveChoice::default() }
}

/// Friction search of a study without friction keys, by joint.
pub(crate) fn usual_searches(model: &Model) -> Vec<FrictionSearch> {
    let search = |(joint, description): (usize, &Joint)| {
        let coulomb = usual_drive(model, joint).coulomb;
        FrictionSearch { coulomb, ..FrictionSearch::of(&description.name) }
    };
    model.joints().iter().enumerate().map(search).collect()
}

/// If the true friction is viscous and Coulomb friction, the robot without its Coulomb friction; otherwise `None`.
fn plain_without(plain: &ParametricModel, truth: FrictionTruth) -> Option<ParametricModel> {
    if truth != FrictionTruth::Plain {
        return None;
    }
    let rest = plain.terms().iter().filter(|term| !truth.is_distinguished_by(term)).cloned().collect();
    plain.with_terms(rest).ok()
}

struct Made {
    log: dynident_recording::Log,
    motion: Motion,
    exact: Vec<f64>,
    torque_noise: f64,
    other: Motion,
    other_exact: Vec<f64>,
}

impl Made {
    fn new(cell: &FrictionCell, model: &Model, robot: &ParametricModel, run: u64) -> Result<Self, String> {
        let made = &cell.log;
        let motion = excitation(model, made.harmonics, made.duration_s, made.rate_hz, 10 + run)?;
        let other = excitation(model, made.harmonics, PERIOD_S, 100.0, 1000 + run)?;
        let regressor = RegressorModel::from(robot.clone());
        let mut bodies = model.parameter_vector();
        bodies.resize(bodies.len() + robot.terms().len(), 0.0);
        let regressor = regressor.clone().with_load_of(&regressor, &robot.base().values(&bodies));
        let theta = truth(&regressor, &motion, |term| cell.truth.share(term));
        let exact = torque(&regressor, &motion, &theta);
        let (log, _) = recording(made, model, &motion, &exact, 77 + run)?;
        let other_exact = torque(&regressor, &other, &theta);
        Ok(Self { log, motion, exact, torque_noise: made.torque_noise, other, other_exact })
    }

    /// Joints whose exact torque differs from the best fit of `without` by more than the noise.
    fn tellable(&self, without: &ParametricModel) -> Result<Vec<bool>, EstimationError> {
        let left = unexplained_torque(&RegressorModel::from(without.clone()), &self.motion, &self.exact)?;
        let noise = |joint: usize| self.torque_noise * rms(&self.exact[self.motion.of(joint)]);
        Ok(left.into_iter().enumerate().map(|(joint, left)| left > MIN_DETECTABLE_STD * noise(joint)).collect())
    }

    fn fit(&self, robot: &ParametricModel, chosen: bool) -> Result<Identification, IdentificationError> {
        let mut task = IdentificationTask::new(robot.clone(), vec![Recording::training("run", self.log.clone())]);
        task.settings.diagnosis = DiagnosisChoice::Never;
        task.settings.consistency = None;
        if chosen {
            task.settings.friction = usual_searches(robot.model()).into();
        }
        identify(&task, Execution::default())
    }

    fn error(&self, found: &Identification) -> f64 {
        model_error(&self.other, &self.other_exact, &torque(found.model(), &self.other, found.base_values()))
    }
}
