//! Runs the small commands on a folder with one mutated file: study, robot, log, states or result.

use super::Run;
use dynident::{Quantity, ResultFile, RunOptions, Silent, Study, check, identify, inspect, validate};
use std::io;
use std::path::Path;
use tempfile::TempDir;

/// The files of the folder; each is a seed.
const FILES: [&str; 5] = ["arm.urdf", "log.csv", "result.json", "states.csv", "study.toml"];

struct Jobs {
    folder: TempDir,
}

/// A folder of valid files.
pub(crate) fn jobs() -> io::Result<Box<dyn Run>> {
    let folder = tempfile::tempdir()?;
    for file in FILES {
        std::fs::copy(seed(file), folder.path().join(file))?;
    }
    Ok(Box::new(Jobs { folder }))
}

fn seed(file: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus/jobs").join(file)
}

impl Run for Jobs {
    fn run(&mut self, file: &str, input: &[u8]) -> bool {
        let at = |name: &str| self.folder.path().join(name);
        if std::fs::write(at(file), input).is_err() {
            return false;
        }
        let accepted = commands(&at);
        // Restore the valid files for the next input.
        let _ = std::fs::copy(seed(file), at(file));
        accepted
    }
}

/// Runs inspect, evaluate, validate, check and identify.
fn commands(at: &dyn Fn(&str) -> std::path::PathBuf) -> bool {
    let mut accepted = true;
    let mut heard = |outcome: Result<(), dynident::Error>| {
        if let Err(error) = outcome {
            assert!(!error.to_string().trim().is_empty(), "an empty message");
            accepted = false;
        }
    };
    heard(inspect(&at("arm.urdf")).map(|inspection| {
        // All numbers in the output are finite.
        let text = serde_json::to_string(&inspection.base_parameters).unwrap_or_default();
        assert!(!text.contains("null"), "{text}");
    }));
    if let Ok(robot) = dynident::model::load_robot(at("arm.urdf")) {
        let evaluated = dynident::evaluate(&robot.model, &at("states.csv"), Quantity::ForwardDynamics, &mut io::sink());
        heard(evaluated.map(|_| ()));
    }
    let path = at("study.toml");
    match Study::load(&path) {
        Ok(study) => {
            let options = RunOptions { data: None, threads: 1, progress: &Silent };
            heard(validate(&at("result.json"), &study, &path, &options).map(|_| ()));
            heard(check(&study, &path, &options).map(|_| ()));
            heard(identify(&study, &path, &options).map(|found| {
                let finite = found.result.base_parameters.iter().all(|parameter| parameter.value.is_finite());
                assert!(finite, "a parameter is not finite");
            }));
        }
        Err(error) => heard(Err(error.into())),
    }
    heard(ResultFile::read(&at("result.json")).map(|_| ()).map_err(Into::into));
    accepted
}
