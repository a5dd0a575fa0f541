//! Reads a trajectory table, for a check or as the task (predicted motion) of a design.

use crate::error::Error;
use dynident_excitation::Motion;
use dynident_excitation::families::SampledMotion;
use dynident_files::quoted;
use dynident_recording::{Derivatives, MotionSettings, cutoff};
use std::path::Path;

const MAX_ROWS: usize = 1_000_000;

/// Largest relative deviation of the time steps in a table without velocities and accelerations.
const MAX_RELATIVE_STEP_DEVIATION: f64 = 1e-3;

/// Accepted difference between positions and integrated velocities: relative to the largest step, and absolute, rad
/// (m).
const MAX_RELATIVE_DISAGREEMENT: f64 = 0.05;
const MIN_ALLOWED_DISAGREEMENT: f64 = 1e-3;

pub(crate) struct Trajectory {
    pub(crate) given: SampledMotion,
    /// Note about the method that computed velocity and acceleration, if the table does not contain them.
    pub(crate) note: Option<String>,
}

/// Reads `t_s`, `q1..` (or the joint names), and `dq1..`, `ddq1..` if the table has both. Otherwise the study's
/// differentiator computes velocities and accelerations.
pub(crate) fn trajectory(path: &Path, joints: &[String], settings: &MotionSettings) -> Result<Trajectory, Error> {
    let wrong = |line: u64, message: String| Error::States { path: path.to_owned(), line, message };
    let broken = |error: &csv::Error| wrong(error.position().map_or(1, csv::Position::line), error.to_string());
    let file = dynident_files::open(path).map_err(|source| Error::File { path: path.to_owned(), source })?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(file);
    let header = reader.headers().map_err(|error| broken(&error))?.clone();
    let columns = Columns::of(&header, joints).map_err(|message| wrong(1, message))?;

    // One list per joint and order of derivative.
    let (mut lines, mut times_s) = (Vec::new(), Vec::new());
    let mut groups = vec![vec![Vec::new(); joints.len()]; columns.groups.len()];
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| broken(&error))? {
        let line = record.position().map_or(0, csv::Position::line);
        let number = |place: usize| -> Result<f64, Error> {
            let field = record.get(place).unwrap_or("");
            let finite = field.parse::<f64>().ok().filter(|value| value.is_finite());
            finite.ok_or_else(|| {
                wrong(line, format!("column `{}`: `{}` is not a finite number", &header[place], quoted(field)))
            })
        };
        let time_s = number(columns.time)?;
        if let Some(before) = times_s.last().filter(|before| time_s <= **before) {
            return Err(wrong(line, format!("t_s = {time_s} after {before}: times must increase")));
        }
        if times_s.len() == MAX_ROWS {
            return Err(wrong(line, format!("more than {MAX_ROWS} rows: use a part of it, or a lower sample rate")));
        }
        times_s.push(time_s);
        lines.push(line);
        for (group, places) in groups.iter_mut().zip(&columns.groups) {
            for (values, &place) in group.iter_mut().zip(places) {
                values.push(number(place)?);
            }
        }
    }
    if times_s.len() < 2 {
        return Err(wrong(1, format!("{} rows: a motion needs two or more", times_s.len())));
    }

    // Velocities and accelerations of the table are compared with its positions.
    let mut motion = Motion { samples: times_s.len(), joints: joints.len(), ..Motion::default() };
    let note = if groups.len() == 3 {
        disagreement(&times_s, &groups, joints).map_or(Ok(()), |(row, message)| Err(wrong(lines[row], message)))?;
        None
    } else {
        Some(derive(&times_s, &mut groups, settings).map_err(|message| wrong(1, message))?)
    };
    let mut arrays = groups.into_iter().map(|group| group.concat());
    (motion.q, motion.dq, motion.ddq) =
        (arrays.next().unwrap_or_default(), arrays.next().unwrap_or_default(), arrays.next().unwrap_or_default());
    let given = SampledMotion::new(times_s, motion).map_err(|error| wrong(1, error.to_string()))?;
    Ok(Trajectory { given, note })
}

/// Column indices of q, and of dq and ddq if the table has both.
struct Columns {
    time: usize,
    groups: Vec<Vec<usize>>,
}

impl Columns {
    fn of(header: &csv::StringRecord, joints: &[String]) -> Result<Self, String> {
        let place = |name: &str| header.iter().position(|column| column == name);
        let has = header.iter().collect::<Vec<_>>().join(", ");
        let time = place("t_s").ok_or_else(|| format!("no column `t_s` (time, s); the table has {has}"))?;
        let numbered = |group: &str| header.iter().any(|column| number_of(column, group).is_some());
        let group = |group: &str| -> Result<Vec<usize>, String> {
            let count = joints.len();
            if let Some(beyond) =
                header.iter().find(|column| number_of(column, group).is_some_and(|n| n == 0 || n > count))
            {
                return Err(format!(
                    "column `{beyond}`, but the robot has {count} joints ({}): is the table of this robot?",
                    joints.join(", ")
                ));
            }
            (1..=count)
                .map(|joint| {
                    let name = format!("{group}{joint}");
                    place(&name).ok_or_else(|| {
                        format!(
                            "no column `{name}`: the robot has {count} joints ({}); the table has {has}",
                            joints.join(", ")
                        )
                    })
                })
                .collect()
        };
        let q = if numbered("q") || !joints.iter().any(|joint| place(joint).is_some()) {
            group("q")?
        } else {
            let by_name =
                |joint: &String| place(joint).ok_or_else(|| format!("no column `{joint}`; the table has {has}"));
            joints.iter().map(by_name).collect::<Result<_, _>>()?
        };
        let mut groups = vec![q];
        if numbered("dq") && numbered("ddq") {
            groups.extend([group("dq")?, group("ddq")?]);
        }
        Ok(Self { time, groups })
    }
}

/// The number n in a column name such as `q<n>`.
fn number_of(column: &str, group: &str) -> Option<usize> {
    let digits = column.strip_prefix(group)?;
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
}

/// Finds a row whose positions do not agree with velocities and accelerations, with a message. Over a step h, `q₁ -
/// q₀` equals `h (q̇₀ + q̇₁) / 2 - h² (q̈₁ - q̈₀) / 12` up to `h⁵ q⁽⁵⁾ / 720`.
fn disagreement(times_s: &[f64], groups: &[Vec<Vec<f64>>], joints: &[String]) -> Option<(usize, String)> {
    joints.iter().enumerate().find_map(|(joint, name)| {
        let [q, dq, ddq] = [&groups[0][joint], &groups[1][joint], &groups[2][joint]];
        let largest = q.windows(2).fold(0.0_f64, |largest, pair| largest.max((pair[1] - pair[0]).abs()));
        let allowed = (MAX_RELATIVE_DISAGREEMENT * largest).max(MIN_ALLOWED_DISAGREEMENT);
        let row = (1..q.len()).find(|&k| {
            let h = times_s[k] - times_s[k - 1];
            let step = h * (dq[k - 1] + dq[k]) / 2.0 - h * h * (ddq[k] - ddq[k - 1]) / 12.0;
            ((q[k] - q[k - 1]) - step).abs() > allowed
        })?;
        let message = format!(
            "dq{0} and ddq{0} (joint `{name}`) are not the derivatives of q{0}: from t_s = {1} to {2} the position moves by {3:.4}; check units (rad, rad/s, rad/s^2), or remove dq and ddq",
            joint + 1,
            times_s[row - 1],
            times_s[row],
            q[row] - q[row - 1]
        );
        Some((row, message))
    })
}

/// Computes velocities and accelerations with the study's differentiator.
fn derive(times_s: &[f64], groups: &mut Vec<Vec<Vec<f64>>>, settings: &MotionSettings) -> Result<String, String> {
    let step = (times_s[times_s.len() - 1] - times_s[0]) / (times_s.len() - 1) as f64;
    if let Some(pair) =
        times_s.windows(2).find(|pair| (pair[1] - pair[0] - step).abs() > MAX_RELATIVE_STEP_DEVIATION * step)
    {
        return Err(format!(
            "without dq and ddq the times must be even to {} %: the step at t_s = {} is {} s, the mean {step} s; give dq1.. and ddq1.., or even times",
            100.0 * MAX_RELATIVE_STEP_DEVIATION,
            pair[0],
            pair[1] - pair[0]
        ));
    }
    let rate_hz = step.recip();
    let choice = cutoff(&groups[0], rate_hz);
    let differentiator = settings.differentiator.build(choice.cutoff_hz).map_err(|error| error.to_string())?;
    let samples = times_s.len();
    let [mut filtered, mut speeds, mut accelerations] = [Vec::new(), Vec::new(), Vec::new()];
    for q in &groups[0] {
        let mut out = [vec![0.0; samples], vec![0.0; samples], vec![0.0; samples]];
        let [to_q, dq, ddq] = &mut out;
        let derivatives = Derivatives { q: to_q, dq, ddq };
        differentiator.differentiate(rate_hz, q, derivatives).map_err(|error| error.to_string())?;
        let [to_q, dq, ddq] = out;
        filtered.push(to_q);
        speeds.push(dq);
        accelerations.push(ddq);
    }
    *groups = vec![filtered, speeds, accelerations];
    let cut = if settings.differentiator.wants_cutoff() {
        format!(", cut-off {:.2} Hz", choice.cutoff_hz)
    } else {
        String::new()
    };
    Ok(format!("velocity and acceleration are derived from the positions ({}{cut})", differentiator.name()))
}
