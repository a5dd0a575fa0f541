//! Parts of identified servo drives that files for simulators cannot represent, and the resulting error of the motion.

use serde::{Deserialize, Serialize};

/// Identified servo drives in one export format, with the error of the motion that is simulated with them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoForm {
    /// Export format: `isaac-lab-implicit`, `isaac-lab-delayed` or `mjcf`.
    pub form: String,
    /// Time step of the simulation for these errors, s: the physics step of Isaac Lab.
    pub step_s: f64,
    /// Delay of each joint in simulation steps; empty if the format has no delay, or states it in seconds.
    #[serde(default)]
    pub delay_steps: Vec<u32>,
    /// Properties of the drives that the format lacks or represents by another law, in words.
    pub lost: Vec<String>,
    /// The errors on each log.
    pub logs: Vec<ServoFormLog>,
}

/// Error of an export format on one log. The simulation starts at the first measured position and is not reset later.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoFormLog {
    /// Name of the log.
    pub name: String,
    /// Whether the log was held out of the fit.
    pub held_out: bool,
    /// Root mean square error of the simulated position of each joint, rad (m); null if the simulation fails.
    pub errors: Option<Vec<f64>>,
    /// Root mean square position error of each joint with the identified drives, rad (m).
    pub model_errors: Vec<f64>,
}

impl ServoForm {
    /// Missing properties and errors in sentences, for these joints; `what` is the name of the format in a sentence.
    pub fn sentences(&self, what: &str, joints: &[String], rotary: &[bool]) -> Vec<String> {
        let mut all: Vec<String> = self.lost.iter().map(|lost| format!("{what}: {lost}.")).collect();
        let held_out = self.logs.iter().any(|log| log.held_out);
        let logs: Vec<&ServoFormLog> = self.logs.iter().filter(|log| log.held_out == held_out).collect();
        let role = if held_out { "held-out" } else { "training" };
        let failed: Vec<&str> = logs.iter().filter(|log| log.errors.is_none()).map(|log| log.name.as_str()).collect();
        if !failed.is_empty() {
            all.push(format!(
                "{what}: PROBLEM: the simulation of {} fails with steps of {} ms; use shorter physics steps.",
                failed.join(", "),
                1e3 * self.step_s
            ));
        }
        let simulated: Vec<(&[f64], &[f64])> =
            logs.iter().filter_map(|log| Some((&log.errors.as_ref()?[..], &log.model_errors[..]))).collect();
        if simulated.is_empty() {
            return all;
        }
        let count = simulated.len() as f64;
        let of_joint = |(joint, name): (usize, &String)| {
            let unit = if rotary[joint] { "mrad" } else { "mm" };
            let own = 1e3 * simulated.iter().map(|(own, _)| own[joint]).sum::<f64>() / count;
            let model = 1e3 * simulated.iter().map(|(_, model)| model[joint]).sum::<f64>() / count;
            format!("{name} {own:.1} {unit} ({model:.1})")
        };
        let joints: Vec<String> = joints.iter().enumerate().map(of_joint).collect();
        all.push(format!(
            "{what}: error of the motion simulated by Dynident with these drives and steps of {} ms, in brackets that of \
             the identified drives; RMS, mean over {} {role} logs: {}.",
            1e3 * self.step_s,
            simulated.len(),
            joints.join(", ")
        ));
        all
    }

    /// Mean over joints and held-out logs (training logs without them) of the form's errors and of the identified
    /// drives' errors, rad (m); `None` if a simulation fails.
    pub fn mean_errors(&self) -> Option<[f64; 2]> {
        let held_out = self.logs.iter().any(|log| log.held_out);
        let logs = || self.logs.iter().filter(|log| log.held_out == held_out);
        let own: Vec<&Vec<f64>> = logs().map(|log| log.errors.as_ref()).collect::<Option<_>>()?;
        let mean = |all: Vec<f64>| all.iter().sum::<f64>() / all.len().max(1) as f64;
        let own = mean(own.into_iter().flatten().copied().collect());
        Some([own, mean(logs().flat_map(|log| log.model_errors.iter().copied()).collect())])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(held_out: bool, errors: Option<[f64; 2]>) -> ServoFormLog {
        let errors = errors.map(Vec::from);
        ServoFormLog { name: "log".into(), held_out, errors, model_errors: vec![0.001, 0.002] }
    }

    #[test]
    fn sentences_have_the_mean_of_the_held_out_logs_with_units() {
        let logs = vec![log(false, Some([9.0, 9.0])), log(true, Some([0.004, 0.01])), log(true, Some([0.002, 0.02]))];
        let form = ServoForm { step_s: 0.005, lost: vec!["no delay".into()], logs, ..ServoForm::default() };
        let sentences = form.sentences("implicit", &["pan".into(), "slide".into()], &[true, false]);
        assert_eq!(sentences[0], "implicit: no delay.");
        assert!(sentences[1].ends_with("mean over 2 held-out logs: pan 3.0 mrad (1.0), slide 15.0 mm (2.0)."));
        let [own, model] = form.mean_errors().unwrap();
        assert!((own - 0.009).abs() < 1e-15 && (model - 0.0015).abs() < 1e-15);
    }

    #[test]
    fn a_simulation_that_fails_is_a_problem() {
        let form = ServoForm { step_s: 0.02, logs: vec![log(true, None)], ..ServoForm::default() };
        let sentences = form.sentences("implicit", &["pan".into(), "slide".into()], &[true, false]);
        assert!(sentences.len() == 1 && sentences[0].contains("PROBLEM") && sentences[0].contains("20 ms"));
        assert_eq!(form.mean_errors(), None);
    }
}
