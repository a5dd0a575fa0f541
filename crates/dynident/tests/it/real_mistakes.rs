//! Mistakes in studies of real logs are reported with the key that corrects them.

use super::common::{Job, recordings, repository};
use dynident::result::CheckFinding;
use dynident::{RunOptions, Silent, check};
use dynident_recording::Level;

/// An example: joints, column names with the first number, and end of its torque line.
struct Real {
    example: &'static str,
    joints: usize,
    position: &'static str,
    torque: &'static str,
    first: usize,
    torque_sign: f64,
}

const UR10: Real =
    Real { example: "ur10", joints: 6, position: "q#_rad", torque: "tau#_Nm", first: 1, torque_sign: 1.0 };
const PANDA: Real = Real { example: "panda", joints: 7, ..UR10 };
const LWR4PLUS: Real = Real { example: "lwr4plus_23_to_1", joints: 7, ..UR10 };
const MED7: Real =
    Real { example: "lbr_med7", joints: 7, position: "q_#", torque: "tau_#", first: 0, torque_sign: -1.0 };

impl Real {
    /// The study with modified keys of position and torque, column orders and text.
    fn study(&self, [q, tau]: [&str; 2], orders: [&[usize]; 2], [from, to]: [&str; 2]) -> String {
        let text = std::fs::read_to_string(repository(&format!("examples/{}.toml", self.example))).unwrap();
        let names = |pattern: &str, order: &[usize]| {
            let name = |&joint: &usize| format!("{:?}", pattern.replace('#', &(joint + self.first).to_string()));
            order.iter().map(name).collect::<Vec<_>>().join(", ")
        };
        let line = |line: &str| {
            // Velocity and acceleration would reveal the mistake.
            if line.starts_with("velocity") || line.starts_with("acceleration") {
                String::new()
            } else if line.starts_with("position") {
                format!("position = {{ columns = [{}]{q} }}\n", names(self.position, orders[0]))
            } else if line.starts_with("torque") {
                format!("torque = {{ columns = [{}]{tau} }}\n", names(self.torque, orders[1]))
            } else {
                format!("{line}\n")
            }
        };
        let data = format!("data = {:?}", recordings().unwrap().display().to_string());
        text.lines().map(line).collect::<String>().replace("data = \"../../shared/data\"", &data).replace(from, to)
    }

    fn only(&self, joint: usize, value: &str, others: &str) -> String {
        let values = (0..self.joints).map(|j| if j == joint { value } else { others });
        format!("[{}]", values.collect::<Vec<_>>().join(", "))
    }

    /// Name, study, kind of finding, and part of a line to write.
    fn cases(&self) -> Vec<(&'static str, String, &'static str, &'static str)> {
        let straight: Vec<usize> = (0..self.joints).collect();
        let mut swapped = straight.clone();
        swapped.swap(1, 2);
        let backwards: Vec<usize> = straight.iter().rev().copied().collect();
        let sign = format!(", sign = {:?}", self.torque_sign);
        let (s, same) = (&straight[..], ["", ""]);
        let offset = format!(", offset = {}", self.only(1, "1.5707963267948966", "0.0"));
        let position_sign = |joint: usize| format!(", sign = {}", self.only(joint, "-1.0", "1.0"));
        let gravity = |g: &'static str| ["[robot]", g];
        let time = if self.example == "lbr_med7" {
            ["rate_hz = 100.0", "rate_hz = 100000.0"]
        } else {
            ["column = \"t_s\"", "column = \"t_s\", unit = \"ms\""]
        };
        vec![
            ("degrees", self.study([", scale = 57.29577951308232", &sign], [s, s], same), "unit", "\"deg\""),
            ("torques 2-3", self.study(["", &sign], [s, &swapped], same), "order", "columns"),
            ("joints 2-3", self.study(["", &sign], [&swapped, &swapped], same), "order", "columns"),
            ("from the tip", self.study(["", &sign], [&backwards, &backwards], same), "order", "columns"),
            ("zero of joint 2", self.study([&offset, &sign], [s, s], same), "offset", "offset = [0.0, 0.0, 0.0"),
            (
                "wall",
                self.study(["", &sign], [s, s], gravity("[robot]\ngravity_m_s2 = [9.81, 0.0, 0.0]")),
                "mounting",
                "-9.",
            ),
            (
                "ceiling",
                self.study(["", &sign], [s, s], gravity("[robot]\ngravity_m_s2 = [0.0, 0.0, 9.81]")),
                "mounting",
                "-9.",
            ),
            ("position of joint 2", self.study([&position_sign(1), &sign], [s, s], same), "sign", "sign = 1"),
            ("position of joint 4", self.study([&position_sign(3), &sign], [s, s], same), "sign", "sign = 1"),
            (
                "all torques",
                self.study(["", &format!(", sign = {:?}", -self.torque_sign)], [s, s], same),
                "sign",
                "sign = ",
            ),
            (
                "gain of joint 2",
                self.study(["", &format!("{sign}, scale = {}", self.only(1, "0.7", "1.0"))], [s, s], same),
                "unit",
                "scale = [1.0, ",
            ),
            (
                "lag",
                self.study(["", &sign], [s, s], ["[format]", "[motion]\ntorque_lag_s = -0.5\n\n[format]"]),
                "lag",
                "torque_lag_s = ",
            ),
            ("time", self.study(["", &sign], [s, s], time), "unit", ""),
        ]
    }
}

#[test]
fn mistakes_in_studies_of_real_logs_are_named() {
    if recordings().is_none() {
        return;
    }
    let all = [LWR4PLUS, UR10, PANDA, MED7];
    for real in &all[..dynident_testing::count(1, all.len())] {
        for (name, study, kind, named) in real.cases() {
            let folder = tempfile::tempdir().unwrap();
            let job = Job::new(folder.path(), &study);
            let options = RunOptions { data: None, threads: 2, progress: &Silent };
            let findings = check(&job.study, &job.path, &options).unwrap().check.findings;
            let problems: Vec<&CheckFinding> = findings.iter().filter(|one| one.level == Level::Problem).collect();
            let is_named =
                |one: &&CheckFinding| one.kind == kind && one.write.iter().any(|key| key.line.contains(named));
            assert!(problems.len() == 1 && problems.iter().any(is_named), "{} {name}: {problems:?}", real.example);
        }
    }
}

/// Torques that are 30 ms late are not a mistake of the study: the fit compensates the lag. Wrists must not be reported
/// as coupled.
#[test]
fn a_lag_of_a_slow_bus_is_no_coupled_wrist() {
    const ROWS_LATE: usize = 6; // of 200 a second
    let Some(data) = recordings() else { return };
    let folder = tempfile::tempdir().unwrap();
    let logs = folder.path().join("kuka_lwr4plus");
    std::fs::create_dir(&logs).unwrap();
    for name in ["traj1.csv", "traj2.csv", "traj3.csv"] {
        let text = std::fs::read_to_string(data.join("kuka_lwr4plus").join(name)).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        let first = rows[0].iter().position(|column| *column == "tau1_Nm").unwrap();
        let mut late = rows.clone();
        late.drain(1..=ROWS_LATE);
        for (to, from) in late[1..].iter_mut().zip(&rows[1..]) {
            to[first..first + 7].copy_from_slice(&from[first..first + 7]);
        }
        let lines: Vec<String> = late.iter().map(|row| row.join(",")).collect();
        std::fs::write(logs.join(name), lines.join("\n") + "\n").unwrap();
    }
    std::fs::copy(data.join("kuka_lwr4plus/kuka_lwr4.urdf"), logs.join("kuka_lwr4.urdf")).unwrap();
    let text = std::fs::read_to_string(repository("examples/lwr4plus_23_to_1.toml")).unwrap();
    let job = Job::new(folder.path(), &text.replace("\"../../shared/data\"", &format!("{:?}", folder.path())));
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let findings = check(&job.study, &job.path, &options).unwrap().check.findings;
    let problems: Vec<&CheckFinding> = findings.iter().filter(|one| one.level == Level::Problem).collect();
    assert!(problems.is_empty(), "{problems:?}");
}
