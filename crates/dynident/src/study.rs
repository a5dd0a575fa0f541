//! The study file: a robot, its drives, its logs and how to fit them, without code.

use crate::design::DesignSection;
use crate::error::Error;
use crate::friction_section::{FrictionChoice, FrictionLaw};
use crate::instruments::InstrumentSection;
use crate::iterate::IterationSection;
use crate::simulation::SimulationSection;
use dynident_estimation::{CovarianceMethod, EssentialSettings, RankSettings, SegmentSettings};
use dynident_experiment::ControllerSettings;
use dynident_model::line_and_column;
use dynident_recording::{LogFormat, MotionSettings, ReferenceSettings};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A study, as written in TOML. Unknown keys are errors, so that a slip of the pen does not silently change a fit.
///
/// ```
/// let study = dynident::Study::parse(
///     r#"
///     [robot]
///     file = "arm.urdf"
///
///     [format]
///     time = { column = "t_s" }
///     position = { columns = "q{1..6}_rad" }
///     torque = { columns = "tau{1..6}_Nm" }
///
///     [[log]]
///     file = "first.csv"
///
///     [[log]]
///     file = "second.csv"
///     role = "validate"
///     "#,
///     std::path::Path::new("study.toml"),
/// )
/// .unwrap();
/// assert_eq!(study.log.len(), 2);
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// What the study is called in reports; the file's name by default.
    #[serde(default)]
    pub name: Option<String>,
    /// Where the recordings can be had.
    #[serde(default)]
    pub source: Option<String>,
    /// Folder of the recordings, relative to the study file, used unless the command line names one.
    #[serde(default)]
    pub data: Option<PathBuf>,
    /// The machine.
    pub robot: RobotSection,
    /// Friction, offsets and drive inertia.
    #[serde(default)]
    pub drive: DriveSection,
    /// Drives that turn with two joints.
    #[serde(default)]
    pub coupling: Vec<CouplingSection>,
    /// How all logs are written; a log may have its own `format`.
    #[serde(default)]
    pub format: Option<LogFormat>,
    /// From positions to velocities and accelerations.
    #[serde(default)]
    pub motion: MotionSettings,
    /// The low-pass and decimation that torque and regressor go through alike.
    #[serde(default)]
    pub parallel_filter: ParallelFilterSection,
    /// The estimator.
    #[serde(default)]
    pub estimator: EstimatorSection,
    /// The excitation trajectory that `design` looks for.
    #[serde(default)]
    pub design: Option<DesignSection>,
    /// The controller of `simulate`, and of `iterate` once there is a model.
    #[serde(default)]
    pub controller: Option<ControllerSettings>,
    /// The robot that `simulate` and `iterate` simulate.
    #[serde(default)]
    pub simulation: Option<SimulationSection>,
    /// How `iterate` goes about it.
    #[serde(default)]
    pub iteration: Option<IterationSection>,
    /// The logs; only `design` needs none.
    #[serde(default)]
    pub log: Vec<LogSection>,
}

/// `[robot]`: which machine, and how it stands.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RobotSection {
    /// URDF, or D-H table in TOML.
    pub file: PathBuf,
    /// The joints that the log holds, in the order of its columns; every other joint is locked. By default all joints of the description
    /// that `lock` does not name, in the order of the tree.
    #[serde(default)]
    pub joints: Option<Vec<String>>,
    /// Joints that are held, and where (rad, m).
    #[serde(default)]
    pub lock: BTreeMap<String, f64>,
    /// Gravitational acceleration in the world, m/s²; (0, 0, -9.81), or the D-H table's own, by default.
    #[serde(default, deserialize_with = "exactly")]
    pub gravity_m_s2: Option<[f64; 3]>,
    /// How the base is mounted in the world: roll, pitch, yaw about fixed axes, rad.
    #[serde(default, deserialize_with = "exactly")]
    pub base_rpy_rad: Option<[f64; 3]>,
    /// The same in degrees; give one of the two.
    #[serde(default, deserialize_with = "exactly")]
    pub base_rpy_deg: Option<[f64; 3]>,
}

/// How a Coulomb step looks near zero speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CoulombChoice {
    /// No Coulomb friction.
    None,
    /// The sign of the speed.
    Sign,
    /// `tanh(speed / width)`.
    Smooth,
}

/// `[drive]`: the laws of every joint, and exceptions by joint.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveSection {
    /// Inertia of rotor and gear as seen from the joint. Off by default: where torque is measured at the link it does not show.
    pub drive_inertia: bool,
    /// Viscous friction. On by default.
    pub viscous: bool,
    /// Coulomb friction. `"smooth"` by default.
    pub coulomb: CoulombChoice,
    /// Width of the smooth step, rad/s or m/s; 0.02 by default.
    pub coulomb_width: f64,
    /// Speed below which the sign counts as zero, rad/s or m/s; 0 by default.
    pub coulomb_dead_band: f64,
    /// A constant torque. On by default.
    pub offset: bool,
    /// Further laws of friction. None by default.
    pub laws: Vec<FrictionLaw>,
    /// Whether the keys above say which friction there is (`"stated"`, the default), or the training logs (`"auto"`).
    pub friction: FrictionChoice,
    /// Exceptions, by joint name.
    pub joints: BTreeMap<String, JointDrive>,
}

impl Default for DriveSection {
    fn default() -> Self {
        Self {
            drive_inertia: false,
            viscous: true,
            coulomb: CoulombChoice::Smooth,
            coulomb_width: 0.02,
            coulomb_dead_band: 0.0,
            offset: true,
            laws: Vec::new(),
            friction: FrictionChoice::Stated,
            joints: BTreeMap::new(),
        }
    }
}

/// What one joint has in place of `[drive]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointDrive {
    /// In place of `drive.drive_inertia`.
    pub drive_inertia: Option<bool>,
    /// In place of `drive.viscous`.
    pub viscous: Option<bool>,
    /// In place of `drive.coulomb`.
    pub coulomb: Option<CoulombChoice>,
    /// In place of `drive.coulomb_width`.
    pub coulomb_width: Option<f64>,
    /// In place of `drive.coulomb_dead_band`.
    pub coulomb_dead_band: Option<f64>,
    /// In place of `drive.offset`.
    pub offset: Option<bool>,
    /// In place of `drive.laws`.
    pub laws: Option<Vec<FrictionLaw>>,
    /// In place of `drive.friction`.
    pub friction: Option<FrictionChoice>,
}

/// `[[coupling]]`: a drive whose speed is `ratios[0] · q̇_first + ratios[1] · q̇_second`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingSection {
    /// Name of the drive in the parameters' symbols.
    pub name: String,
    /// The two joints.
    #[serde(deserialize_with = "two")]
    pub joints: [String; 2],
    /// Drive speed per joint speed; 1 and 1 by default.
    #[serde(default = "one_one", deserialize_with = "two")]
    pub ratios: [f64; 2],
    /// Cross inertia. On by default.
    #[serde(default = "yes")]
    pub inertia: bool,
    /// Cross viscous friction. On by default.
    #[serde(default = "yes")]
    pub viscous: bool,
    /// Coulomb friction on the drive's own speed; by default as `drive.coulomb`.
    #[serde(default)]
    pub coulomb: Option<CoulombChoice>,
}

fn one_one() -> [f64; 2] {
    [1.0, 1.0]
}

fn yes() -> bool {
    true
}

/// An array of `N` values and no more: serde by itself ignores what follows.
fn counted<T, const N: usize, E: serde::de::Error>(values: Vec<T>) -> Result<[T; N], E> {
    let found = values.len();
    values.try_into().map_err(|_| E::custom(format!("{found} values where {N} are expected")))
}

fn two<'de, T: Deserialize<'de>, D: serde::Deserializer<'de>>(deserializer: D) -> Result<[T; 2], D::Error> {
    counted(Vec::deserialize(deserializer)?)
}

fn exactly<'de, T: Deserialize<'de>, const N: usize, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<[T; N]>, D::Error> {
    counted(Vec::deserialize(deserializer)?).map(Some)
}

/// `[parallel_filter]`: torque and every regressor column pass the same zero-phase low-pass, then every n-th row is kept.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ParallelFilterSection {
    /// Off: every sample counts as it is. On by default.
    pub enabled: bool,
    /// Every how many samples one is kept. By default so many that the filter's cut-off lies at 0.7 of the motion's.
    pub factor: Option<usize>,
    /// Frequency at which the filter's gain is one half; by default 0.4 of the rate that remains.
    pub cutoff_hz: Option<f64>,
    /// Attenuation in the stop band, dB.
    pub stop_band_db: f64,
}

impl Default for ParallelFilterSection {
    fn default() -> Self {
        Self { enabled: true, factor: None, cutoff_hz: None, stop_band_db: 60.0 }
    }
}

/// Estimators that are linear in the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorMethod {
    /// Ordinary least squares: every joint's newton metre counts alike.
    Ordinary,
    /// Weighted least squares: every joint counts by its own noise.
    #[default]
    Weighted,
    /// Generalised least squares: errors of the joints at one instant are correlated.
    Generalized,
    /// Iteratively reweighted with Huber's weights: rows far off count less.
    Huber,
    /// Iteratively reweighted with Tukey's weights: rows far off do not count.
    Tukey,
    /// Instrumental variables: noise in the regressor does not bias the estimate.
    Instrumental,
}

impl EstimatorMethod {
    /// The name in the study file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ordinary => "ordinary",
            Self::Weighted => "weighted",
            Self::Generalized => "generalized",
            Self::Huber => "huber",
            Self::Tukey => "tukey",
            Self::Instrumental => "instrumental",
        }
    }
}

/// `[estimator]`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct EstimatorSection {
    /// The method; weighted by default.
    pub method: EstimatorMethod,
    /// The covariance that error bars come from; `"jackknife"`, which accounts for coloured residuals and judges each time segment by the fit without it, by default.
    pub covariance: CovarianceMethod,
    /// Whether the bodies, friction and drives written are those of a possible machine that fit the logs best (true by default), or the set nearest to the
    /// description that has exactly the estimated base parameters.
    pub physical: bool,
    /// When a column counts as excited.
    pub rank: RankSettings,
    /// How logs are cut into segments for the covariance.
    pub segments: SegmentSettings,
    /// Hold parameters that the data hardly tell at zero; not by default.
    pub essential: Option<EssentialSettings>,
    /// Instruments for `method = "instrumental"`. With another method they only test whether noise in the regressor biases it.
    pub instruments: Option<InstrumentSection>,
}

impl Default for EstimatorSection {
    fn default() -> Self {
        Self {
            method: EstimatorMethod::default(),
            covariance: CovarianceMethod::default(),
            physical: true,
            rank: RankSettings::default(),
            segments: SegmentSettings::default(),
            essential: None,
            instruments: None,
        }
    }
}

/// What a log is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The model is fitted to it.
    #[default]
    Identify,
    /// The model is tested on it.
    Validate,
}

/// `[[log]]`: one recording, or a part of one.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LogSection {
    /// The main file.
    pub file: PathBuf,
    /// What it is called in reports; the file's name by default.
    #[serde(default)]
    pub name: Option<String>,
    /// What it is for; to identify by default.
    #[serde(default)]
    pub role: Role,
    /// Its own format, in place of the study's.
    #[serde(default)]
    pub format: Option<LogFormat>,
    /// The motion that was commanded, in place of the differentiator's own; for differentiators that need it.
    #[serde(default)]
    pub reference: Option<ReferenceSettings>,
    /// In place of the format's `rows`.
    #[serde(default, deserialize_with = "exactly")]
    pub rows: Option<[u64; 2]>,
    /// In place of the format's `fraction`.
    #[serde(default, deserialize_with = "exactly")]
    pub fraction: Option<[f64; 2]>,
    /// In place of the format's `time_range_s`.
    #[serde(default, deserialize_with = "exactly")]
    pub time_range_s: Option<[f64; 2]>,
}

/// Largest component of gravity: beyond it the unit must be wrong, and numbers run away.
const MAX_GRAVITY_M_S2: f64 = 1000.0;

/// Largest study file, bytes.
const MAX_STUDY_BYTES: u64 = 4 << 20;

impl Study {
    /// Reads a study from a file.
    ///
    /// # Errors
    /// If the file cannot be read, or as [`parse`](Study::parse).
    pub fn load(path: &Path) -> Result<Self, Error> {
        let cannot = |source| Error::File { path: path.to_owned(), source };
        let size = std::fs::metadata(path).map_err(cannot)?.len();
        if size > MAX_STUDY_BYTES {
            return Err(Error::study(path, format!("larger than {} MiB: name a study file", MAX_STUDY_BYTES >> 20)));
        }
        let bytes = std::fs::read(path).map_err(cannot)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let good = error.utf8_error().valid_up_to();
            let before = String::from_utf8_lossy(&error.as_bytes()[..good]).into_owned();
            let (line, column) = line_and_column(&before, before.len());
            Error::StudyAt {
                path: path.to_owned(),
                line,
                column,
                message: "not UTF-8 text: save the study as UTF-8".to_owned(),
            }
        })?;
        Self::parse(&text, path)
    }

    /// Reads a study from its text; `path` is only named in messages.
    ///
    /// # Errors
    /// If the text is no TOML, a key is unknown or of the wrong kind, or sections contradict each other; the message names file, line and column.
    pub fn parse(text: &str, path: &Path) -> Result<Self, Error> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if text.trim().is_empty() {
            return Err(Error::study(
                path,
                "the file is empty: a study needs at least [robot] and, to identify, one [[log]]".to_owned(),
            ));
        }
        let study: Self = toml::from_str(text).map_err(|error| {
            let (line, column) = error.span().map_or((1, 1), |span| line_and_column(text, span.start));
            let message = format!("{}; docs/src/study.md lists every key", error.message().trim().replace('\n', " "));
            Error::StudyAt { path: path.to_owned(), line, column, message }
        })?;
        study.check().map_err(|message| Error::study(path, message))?;
        Ok(study)
    }

    /// That there is a log, as fitting and testing need; a study for `design` may have none.
    pub(crate) fn require_log(&self, path: &Path) -> Result<(), Error> {
        if self.log.is_empty() {
            return Err(Error::study(path, "no [[log]]: name at least one log with `file = \"...\"`".to_owned()));
        }
        Ok(())
    }

    /// That there is a log to fit to.
    pub(crate) fn require_training_log(&self, path: &Path) -> Result<(), Error> {
        self.require_log(path)?;
        if !self.log.iter().any(|log| log.role == Role::Identify) {
            let message = "no log has the role \"identify\": there is nothing to fit to".to_owned();
            return Err(Error::study(path, message));
        }
        Ok(())
    }

    fn check(&self) -> Result<(), String> {
        for (index, log) in self.log.iter().enumerate() {
            if log.format.is_none() && self.format.is_none() {
                return Err(format!("[[log]] number {}: neither the log nor the study has a [format]", index + 1));
            }
            if let Some(reference) = &log.reference {
                reference.validate().map_err(|error| format!("[[log]] number {}: reference: {error}", index + 1))?;
            }
            let ranges = [log.rows.is_some(), log.fraction.is_some(), log.time_range_s.is_some()];
            if ranges.into_iter().filter(|given| *given).count() > 1 {
                return Err(format!(
                    "[[log]] number {}: give one of rows, fraction and time_range_s, not several",
                    index + 1
                ));
            }
        }
        let positive = |value: f64, key: &str| {
            if value.is_finite() && value > 0.0 {
                Ok(())
            } else {
                Err(format!("{key} = {value}: give a positive speed"))
            }
        };
        let not_negative = |value: f64, key: &str| {
            if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(format!("{key} = {value}: give 0 or more")) }
        };
        positive(self.drive.coulomb_width, "drive.coulomb_width")?;
        not_negative(self.drive.coulomb_dead_band, "drive.coulomb_dead_band")?;
        for (index, law) in self.drive.laws.iter().enumerate() {
            law.validate(&format!("drive.laws number {}", index + 1))?;
        }
        for (joint, drive) in &self.drive.joints {
            for (index, law) in drive.laws.iter().flatten().enumerate() {
                law.validate(&format!("drive.joints.{joint}.laws number {}", index + 1))?;
            }
            if let Some(width) = drive.coulomb_width {
                positive(width, &format!("drive.joints.{joint}.coulomb_width"))?;
            }
            if let Some(band) = drive.coulomb_dead_band {
                not_negative(band, &format!("drive.joints.{joint}.coulomb_dead_band"))?;
            }
        }
        for (index, coupling) in self.coupling.iter().enumerate() {
            if self.coupling[..index].iter().any(|other| other.name == coupling.name) {
                return Err(format!("coupling `{}` stands twice: give each drive a name of its own", coupling.name));
            }
            if coupling.ratios.iter().any(|ratio| !ratio.is_finite() || *ratio == 0.0) {
                return Err(format!("coupling `{}`: ratios must be finite and not zero", coupling.name));
            }
            if coupling.joints[0] == coupling.joints[1] {
                return Err(format!("coupling `{}`: name two different joints", coupling.name));
            }
        }
        if let Some(gravity) = self.robot.gravity_m_s2
            && gravity.iter().any(|g| g.abs().is_nan() || g.abs() > MAX_GRAVITY_M_S2)
        {
            return Err(format!(
                "robot.gravity_m_s2 = {gravity:?}: give finite numbers in m/s^2, at most {MAX_GRAVITY_M_S2} in size"
            ));
        }
        if self.robot.base_rpy_rad.is_some() && self.robot.base_rpy_deg.is_some() {
            return Err("robot.base_rpy_rad and robot.base_rpy_deg are both given: keep one".to_owned());
        }
        if self.parallel_filter.factor == Some(0) {
            return Err("parallel_filter.factor = 0: give 1 or more".to_owned());
        }
        if let Some(design) = &self.design {
            design.validate().map_err(|error| format!("[design]: {error}"))?;
        }
        self.motion.validate().map_err(|error| format!("[motion]: {error}"))?;
        self.estimator.rank.validate().map_err(|error| format!("[estimator.rank]: {error}"))?;
        let instruments = self.estimator.instruments.clone().unwrap_or_default();
        crate::fit::instrumental_settings(&self.estimator, &instruments)
            .validate()
            .map_err(|error| format!("[estimator.instruments]: {error}"))?;
        crate::fit::hausman_settings(&self.estimator, &instruments)
            .validate()
            .map_err(|error| format!("[estimator.instruments], test_level: {error}"))?;
        if let Some(cutoff) = instruments.cutoff_hz {
            positive(cutoff, "estimator.instruments.cutoff_hz").map_err(|_| {
                format!(
                    "estimator.instruments.cutoff_hz = {cutoff}: give a positive frequency, below the motion's cut-off"
                )
            })?;
        }
        self.estimator.segments.validate().map_err(|error| format!("[estimator.segments]: {error}"))?;
        if let Some(essential) = &self.estimator.essential {
            essential.validate().map_err(|error| format!("[estimator.essential]: {error}"))?;
        }
        Ok(())
    }

    /// The format of log number `index`, with its own range in force.
    ///
    /// # Panics
    /// If there is no such log. That every log has a format was checked when the study was read.
    pub fn format_of(&self, index: usize) -> LogFormat {
        let log = &self.log[index];
        let mut format = log.format.clone().or_else(|| self.format.clone()).expect("checked when the study was read");
        if log.rows.is_some() || log.fraction.is_some() || log.time_range_s.is_some() {
            (format.rows, format.fraction, format.time_range_s) = (log.rows, log.fraction, log.time_range_s);
        }
        format
    }

    /// What log number `index` is called: its name, or its file's, with its range so that two parts of one file can be told apart.
    ///
    /// # Panics
    /// If there is no such log.
    pub fn log_name(&self, index: usize) -> String {
        let log = &self.log[index];
        if let Some(name) = &log.name {
            return name.clone();
        }
        let file =
            log.file.file_stem().map_or_else(|| log.file.display().to_string(), |s| s.to_string_lossy().into_owned());
        if let Some([from, to]) = log.fraction {
            format!("{file} [{:.0} % .. {:.0} %]", 100.0 * from, 100.0 * to)
        } else if let Some([from, to]) = log.rows {
            format!("{file} [rows {from} .. {to}]")
        } else if let Some([from, to]) = log.time_range_s {
            format!("{file} [{from} s .. {to} s]")
        } else {
            file
        }
    }
}

/// Where a study's files lie: the folder that the user named, then the study file's own, then the study's `data`.
#[derive(Clone, Debug)]
pub struct Folders {
    candidates: Vec<PathBuf>,
}

impl Folders {
    /// The folders of the study in `study_path`; `data` is what the user named on the command line.
    pub fn new(study: &Study, study_path: &Path, data: Option<&Path>) -> Self {
        let own = study_path.parent().map_or_else(PathBuf::new, Path::to_owned);
        let mut candidates: Vec<PathBuf> = data.map(Path::to_owned).into_iter().collect();
        candidates.push(own.clone());
        candidates.extend(study.data.as_ref().map(|data| own.join(data)));
        Self { candidates }
    }

    /// The first folder that holds `file`.
    ///
    /// # Errors
    /// If none does; the message names all that were tried, and the study's source if it says one.
    pub fn find(&self, file: &Path, source: Option<&str>) -> Result<PathBuf, Error> {
        let tried: Vec<PathBuf> = self.candidates.iter().map(|folder| folder.join(file)).collect();
        tried.iter().find(|path| path.is_file()).cloned().ok_or_else(|| Error::Missing {
            file: file.to_owned(),
            tried,
            source_of_data: source.map(str::to_owned),
        })
    }
}
