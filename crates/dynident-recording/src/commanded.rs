//! Samples of a log with commanded positions, as recorded: without filter, interpolation or derivatives.

use crate::error::{FormatError, RecordingError};
use crate::log::{Log, LogReader, RawBlock};
use crate::quantisation::quantisation_step;

/// Resolution of the clock of recorders, s: times that differ by less are equal.
const CLOCK_RESOLUTION_S: f64 = 1.0e-6;

/// Commanded and measured positions of one log, at the recorded times.
///
/// ```
/// use dynident_recording::JointSamples;
///
/// let time_s = vec![0.0, 0.02, 0.041];
/// let samples = JointSamples {
///     command: vec![vec![0.0, 0.1, 0.1]],
///     ..JointSamples::at_times(time_s, vec![vec![0.0, 0.0, 0.05]], Vec::new())
/// };
/// let motion = samples.into_log("step", &["elbow".to_owned()])?.commanded_motion()?;
/// assert_eq!((motion.samples(), motion.joint(&motion.commands, 0).nth(1)), (3, Some(0.1)));
/// # Ok::<(), dynident_recording::RecordingError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CommandedMotion {
    /// Name of the log in messages.
    pub name: String,
    /// Names of the joints, n.
    pub joints: Vec<String>,
    /// Time of each sample, s after the first data row of the file. Where rows were omitted, the step is longer than
    /// one period.
    pub times_s: Vec<f64>,
    /// Measured positions (rad, m): sample i of joint j is entry `i * n + j`.
    pub positions: Vec<f64>,
    /// Commanded positions (rad, m), in the same order.
    pub commands: Vec<f64>,
    /// Data row in the file of each sample, from 0.
    pub rows: Vec<u64>,
}

impl CommandedMotion {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.times_s.len()
    }

    /// The values of joint `joint` in `values`, which are [`positions`](Self::positions) or
    /// [`commands`](Self::commands).
    pub fn joint<'a>(&self, values: &'a [f64], joint: usize) -> impl Iterator<Item = f64> + use<'a> {
        values.iter().skip(joint).step_by(self.joints.len().max(1)).copied()
    }

    /// Encoder resolution of each joint (rad, m), estimated from the measured positions; `None` if they are not
    /// quantised, or change fewer than 20 times.
    ///
    /// The estimate is the step size of which 90 % of the differences between successive positions are multiples.
    pub fn encoder_counts(&self) -> Vec<Option<f64>> {
        (0..self.joints.len())
            .map(|joint| quantisation_step(&self.joint(&self.positions, joint).collect::<Vec<_>>()))
            .collect()
    }

    /// Whether commands have the steps of an encoder and positions do not, for each joint, or the reverse; `None` if
    /// both or neither have them.
    pub(crate) fn are_commands_counted(&self, joint: usize) -> Option<bool> {
        let is_counted = |values: &[f64]| quantisation_step(&self.joint(values, joint).collect::<Vec<_>>()).is_some();
        let [commands, positions] = [&self.commands, &self.positions].map(|values| is_counted(values));
        (commands != positions).then_some(commands)
    }

    /// Uses each command `late_s` seconds before its stamp. A command holds until the next; the last one remains.
    fn advance_commands(&mut self, late_s: f64) {
        if late_s <= 0.0 {
            return;
        }
        let joints = self.joints.len();
        let mut later = 0;
        for sample in 0..self.samples() {
            let until_s = self.times_s[sample] + late_s + CLOCK_RESOLUTION_S;
            while later + 1 < self.samples() && self.times_s[later + 1] <= until_s {
                later += 1;
            }
            self.commands.copy_within(later * joints..(later + 1) * joints, sample * joints);
        }
    }
}

impl Log {
    /// Reads all samples of a log with commanded positions. The selection of rows and the rule for missing values apply
    /// as for every log.
    ///
    /// # Errors
    /// If the format has no `command` columns, or the log cannot be read.
    pub fn commanded_motion(&self) -> Result<CommandedMotion, RecordingError> {
        if self.format.command.is_none() {
            let fix = "add command = { columns = [...] }: the position that was sent to each joint";
            return Err(FormatError::new("command", "this method needs commanded positions", fix).into());
        }
        let mut reader = LogReader::open(self)?;
        let mut motion = CommandedMotion {
            name: reader.label().to_owned(),
            joints: self.joints.clone(),
            ..CommandedMotion::default()
        };
        let mut block = RawBlock::default();
        while reader.next_block(&mut block)? {
            motion.rows.extend_from_slice(&block.row);
            motion.times_s.extend_from_slice(&block.time_s);
            for row in 0..block.rows() {
                motion.positions.extend(block.q.iter().map(|values| values[row]));
                motion.commands.extend(block.command.iter().map(|values| values[row]));
            }
        }
        motion.advance_commands(self.format.command_late_s.unwrap_or(0.0));
        Ok(motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::LogFormat;

    fn log(text: &str, format: &str) -> (tempfile::TempDir, Log) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log.csv");
        std::fs::write(&file, text).unwrap();
        let format: LogFormat = toml::from_str(format).unwrap();
        let log = Log::file(&file, format, &["pan", "gripper"].map(str::to_owned));
        (folder, log)
    }

    const TEXT: &str = "t_ms,q1,q2,c1,c2\n0,1,90,1.5,0\n20,1,91,1.5,0.5\n41,2,92,1.5,1\n";
    const FORMAT: &str = r#"
        time = { column = "t_ms", unit = "ms" }
        position = { columns = "q{1..2}", unit = "deg" }
        command = { columns = "c{1..2}", unit = "rad", scale = [1.0, 2.0], sign = [-1, 1], offset = [0.0, -0.25] }
    "#;

    #[test]
    fn commands_are_converted_as_positions_and_times_are_kept() {
        let (_folder, log) = log(TEXT, FORMAT);
        let motion = log.commanded_motion().unwrap();
        assert_eq!(motion.times_s, [0.0, 20.0 * 1e-3, 41.0 * 1e-3]);
        assert_eq!(motion.commands, [-1.5, -0.25, -1.5, 0.75, -1.5, 1.75]);
        let degree = core::f64::consts::PI / 180.0;
        assert_eq!(motion.positions, [1.0, 90.0, 1.0, 91.0, 2.0, 92.0].map(|q| q * degree));
        assert_eq!(motion.joint(&motion.commands, 1).collect::<Vec<_>>(), [-0.25, 0.75, 1.75]);
        assert_eq!((motion.samples(), &motion.rows[..]), (3, &[0, 1, 2][..]));
    }

    /// Times of 50 Hz are not exact sums of binary numbers; each command still belongs to the row five periods before.
    #[test]
    fn rounded_times_shift_all_commands_equally() {
        let rows: Vec<String> = (0..400).map(|k| format!("{},0,0,0,{k}", 20 * k)).collect();
        let header = TEXT.lines().next().unwrap();
        let (_folder, log) = log(&format!("{header}\n{}\n", rows.join("\n")), &format!("{FORMAT}command_late_s = 0.1"));
        let motion = log.commanded_motion().unwrap();
        let commands: Vec<f64> = motion.joint(&motion.commands, 1).collect();
        assert!(
            commands.windows(2).take(390).all(|two| (two[1] - two[0] - (commands[1] - commands[0])).abs() < 1e-9),
            "{commands:?}"
        );
    }

    /// A command that a recorder stamps 20 ms late belongs to the row before.
    #[test]
    fn late_commands_are_used_earlier() {
        for (late, expected) in [("0.0", [0.0, 0.5, 1.0]), ("0.02", [0.5, 0.5, 1.0]), ("0.021", [0.5, 1.0, 1.0])] {
            let (_folder, log) = log(&TEXT.replace(",1.5,", ",0,"), &format!("{FORMAT}command_late_s = {late}"));
            let motion = log.commanded_motion().unwrap();
            let found: Vec<f64> = motion.joint(&motion.commands, 1).map(|c| 0.5 * (c + 0.25)).collect();
            assert_eq!(found, expected, "{late}");
        }
        let (_folder, log) = log(TEXT, &format!("{FORMAT}command_late_s = -0.1"));
        let refused = log.commanded_motion().unwrap_err().to_string();
        assert!(refused.contains("command_late_s"), "{refused}");
    }

    #[test]
    fn a_log_without_torque_needs_commands_and_gives_no_torque_motion() {
        let (_folder, mut log) = log(TEXT, FORMAT);
        let settings = crate::MotionSettings::default();
        let refused = crate::MotionStream::new(&log, &settings).unwrap_err().to_string();
        assert!(refused.contains("`torque`") && refused.contains("[drive.servo]"), "{refused}");
        let command = log.format.command.take();
        for refused in [log.commanded_motion().map(|_| ()), crate::MotionStream::new(&log, &settings).map(|_| ())]
            .map(|result| result.unwrap_err().to_string())
        {
            assert!(refused.contains("command = {") || refused.contains("torque = {"), "{refused}");
        }
        let neither = log.format.validate(&log.joints).unwrap_err().to_string();
        assert!(neither.contains("neither torque nor command"), "{neither}");
        // Both are allowed; commands do not change the motion.
        log.format.torque = command.clone().map(|group| crate::log::ChannelGroup { unit: None, ..group });
        log.format.command = command;
        log.format.validate(&log.joints).unwrap();
        assert_eq!(log.commanded_motion().unwrap().samples(), 3);
    }

    #[test]
    fn the_encoder_count_of_each_joint_is_found() {
        let count = core::f64::consts::TAU / 4096.0;
        let time_s: Vec<f64> = (0..600).map(|i| f64::from(i) * 0.02).collect();
        let smooth: Vec<f64> = time_s.iter().map(|t| (1.3 * t).sin()).collect();
        let counted = smooth.iter().map(|q| (q / count).round() * count).collect();
        let samples = crate::JointSamples {
            command: vec![smooth.clone(), smooth.clone()],
            ..crate::JointSamples::at_times(time_s, vec![counted, smooth], Vec::new())
        };
        let log = samples.into_log("log", &["pan", "gripper"].map(str::to_owned)).unwrap();
        let counts = log.commanded_motion().unwrap().encoder_counts();
        assert!((counts[0].unwrap() / count - 1.0).abs() < 1e-6 && counts[1].is_none(), "{counts:?}");
    }
}
