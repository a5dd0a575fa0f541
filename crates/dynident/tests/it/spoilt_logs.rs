//! What recorders do to a log must not reach the parameters: outliers and held torque.
use crate::common::{Job, Motion, Random, Truth, header, repository, write_log};
use dynident::IdentificationOutcome;
use std::fmt::Write;
use std::path::Path;

const RATE_HZ: f64 = 500.0;
const SECONDS: f64 = 16.0;
const SIGMA_NM: f64 = 0.1;

fn arm() -> std::path::PathBuf {
    repository("robots/planar2r.urdf")
}

/// The rows of a log: t, q1, q2, tau1, tau2.
fn rows(folder: &Path) -> Vec<Vec<f64>> {
    let (truth, mut random) = (Truth::near(&arm(), 0.1, false), Random(7));
    let file = folder.join("clean.csv");
    write_log(&file, &truth, &Motion::new(2, 3), (RATE_HZ, SECONDS), &header(2), |q, tau| {
        let noisy = tau.iter().map(|torque| torque + SIGMA_NM * random.normal()).collect::<Vec<f64>>();
        q.iter().map(|q| q + 1e-6 * random.normal()).chain(noisy).collect()
    });
    let text = std::fs::read_to_string(file).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect()
}

fn fitted(folder: &Path, rows: &[Vec<f64>], further: &str) -> IdentificationOutcome {
    let mut text = header(2) + "\n";
    for row in rows {
        let fields: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(text, "{}", fields.join(",")).unwrap();
    }
    std::fs::write(folder.join("log.csv"), text).unwrap();
    let study = format!(
        r#"
        robot.file = {:?}
        {further}
        [format]
        time = {{ column = "t" }}
        position = {{ columns = "q{{1..2}}" }}
        torque = {{ columns = "tau{{1..2}}" }}
        [[log]]
        file = "log.csv"
        "#,
        arm().display().to_string(),
    );
    Job::new(folder, &study).identify()
}

/// By how many of the clean fit's standard deviations another differs (RMS over the parameters).
fn moved(clean: &IdentificationOutcome, other: &IdentificationOutcome) -> f64 {
    let pairs = clean.estimate.values.iter().zip(&other.estimate.values).zip(&clean.estimate.std);
    let squares: Vec<f64> = pairs.filter(|(_, std)| **std > 0.0).map(|((a, b), std)| ((a - b) / std).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn outliers_and_held_torque_do_not_reach_the_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let clean = rows(folder.path());
    let reference = fitted(folder.path(), &clean, "");
    let mut random = Random(31);
    let mut outliers = clean.clone();
    for row in &mut outliers {
        for torque in &mut row[3..] {
            if random.next().abs() < 0.05 {
                *torque += 20.0 * SIGMA_NM * if random.normal() > 0.0 { 1.0 } else { -1.0 };
            }
        }
    }
    let mut held = clean.clone();
    for (joint, from) in [(3, 1200), (3, 5000), (4, 2500), (4, 6600)] {
        let value = held[from][joint];
        held[from..from + 100].iter_mut().for_each(|row| row[joint] = value);
    }
    for (name, rows) in [("outliers", outliers), ("held", held)] {
        let found = fitted(folder.path(), &rows, "");
        let aside = moved(&reference, &found);
        let kept = moved(&reference, &fitted(folder.path(), &rows, "motion.keep_outliers = true"));
        // Those beside a reversal of friction hide behind its step: a sixteenth of the variance may stay.
        assert!(aside < 0.25 * kept && kept > 1.0, "{name}: {aside}, kept {kept}");
        let findings = serde_json::to_string(&found.result.logs[0].import).unwrap();
        assert!(findings.contains("left out of torque and regressor alike"), "{name}: {findings}");
    }
}
