//! Band of a held-out torque that the model does not determine: at rest, and after a change of the robot.

use crate::common::{Job, Motion, Random, Truth, format, header, plain, repository, write_log};
use dynident::dynamics::Workspace;
use std::fmt::Write;
use std::path::Path;

const NOISE_NM: f64 = 0.1;

fn identified(folder: &Path) -> dynident::IdentificationOutcome {
    let robot = repository("robots/planar2r.urdf");
    let text = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}, {{ file = \"other.csv\", role = \"validate\" }}]\n{}\n\
         [parallel_filter]\nenabled = false",
        robot.display().to_string(),
        format(2)
    );
    Job::new(folder, &text).identify()
}

fn noisy(random: &mut Random, q: &[f64], tau: &[f64]) -> Vec<f64> {
    let noisy: Vec<f64> = tau.iter().map(|tau| tau + NOISE_NM * random.normal()).collect();
    plain(q, &noisy)
}

/// Alternating 2 s of motion and 2 s of rest; at rest the drives hold any part of the Coulomb friction.
fn write_stop_and_go(path: &Path, truth: &Truth, motion: &Motion, seed: u64) {
    let (rate_hz, seconds, turn_s) = (200.0, 40.0, 4.0);
    let (mut random, mut workspace) = (Random(seed), Workspace::new(&truth.model));
    let mut text = header(2);
    let mut held = [0.0; 2];
    for k in 0..(rate_hz * seconds) as usize {
        let t = k as f64 / rate_hz;
        let (turns, within) = ((t / turn_s).floor(), t % turn_s);
        // Path coordinate with a varying speed, one second per turn on average.
        let w = core::f64::consts::TAU / (0.5 * turn_s);
        let rests = within >= 0.5 * turn_s;
        let (way, speed, change) = if rests {
            (2.0 * (turns + 1.0), 0.0, 0.0)
        } else {
            let (sin, cos) = (w * within).sin_cos();
            (2.0 * turns + within - sin / w, 1.0 - cos, w * sin)
        };
        let [q, along, bend] = motion.at(way);
        let dq: Vec<f64> = along.iter().map(|dq| dq * speed).collect();
        let ddq: Vec<f64> = bend.iter().zip(&along).map(|(ddq, dq)| ddq * speed * speed + dq * change).collect();
        let mut tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        if within == 0.5 * turn_s {
            held = core::array::from_fn(|joint| truth.drive[joint][2] * random.next());
        }
        if rests {
            tau.iter_mut().zip(held).for_each(|(tau, held)| *tau += held);
        }
        write!(text, "\n{t}").unwrap();
        for value in noisy(&mut random, &q, &tau) {
            write!(text, ",{value}").unwrap();
        }
    }
    std::fs::write(path, text + "\n").unwrap();
}

/// Positions do not determine the torque at rest within Coulomb friction: ten times the noise here, for more than half
/// of the test.
#[test]
fn the_band_holds_at_rest() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Truth::near(&repository("robots/planar2r.urdf"), 0.05, false);
    let mut random = Random(3);
    let moving = Motion::new(2, 1);
    write_log(&folder.path().join("log.csv"), &truth, &moving, (200.0, 30.0), &header(2), |q, tau| {
        noisy(&mut random, q, tau)
    });
    write_stop_and_go(&folder.path().join("other.csv"), &truth, &Motion::new(2, 2), 4);
    let found = identified(folder.path());
    assert_eq!(found.result.torque_band.len(), 2);
    for (band, residuals) in found.result.torque_band.iter().zip(&found.result.validation[0].residuals) {
        // At rest the torque differs from the prediction.
        let regimes = residuals.regimes.unwrap();
        assert!(regimes.at_rest.rmse_nm.unwrap() > 3.0 * NOISE_NM, "{regimes:?}");
        assert!(regimes.at_rest.samples > 3000, "{regimes:?}");
        // 95 % of half of the rows and nearly all of the others, which the friction limit covers.
        assert!(band.coverage_percent > 95.0, "{band:?}");
        // Not wider than needed: at rest by the friction up to 0.1 rad/s of a 1.2 m arm, which is at most 0.15 rad/s
        // here, and by 10 % elsewhere.
        let [_, viscous, coulomb, _] = truth.drive[usize::from(band.joint == "joint2")];
        let share = regimes.at_rest.samples as f64 / found.result.validation[0].model.samples as f64;
        let widest = share * (coulomb + 0.15 * viscous) + 1.1 * 1.96 * NOISE_NM;
        assert!(band.half_width_nm < widest, "{band:?}, {widest}");
    }
}

/// Drift within the training logs widens the band of future torque.
#[test]
fn the_band_is_wider_after_training_that_drifts() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Truth::near(&repository("robots/planar2r.urdf"), 0.05, false);
    let widths = [0.0, 1.5].map(|drift_nm| {
        for (file, seed, seconds) in [("log.csv", 1, 30.0), ("other.csv", 2, 30.0)] {
            let (mut random, mut sample) = (Random(seed), 0.0);
            let motion = Motion::new(2, seed);
            write_log(&folder.path().join(file), &truth, &motion, (200.0, seconds), &header(2), |q, tau| {
                sample += 1.0 / (200.0 * seconds);
                let warmer: Vec<f64> = tau.iter().map(|tau| tau + drift_nm * (sample - 0.5)).collect();
                noisy(&mut random, q, &warmer)
            });
        }
        let found = identified(folder.path());
        // Compared with the band from training residuals.
        let bands = found.result.torque_band.iter().zip(&found.result.training.joints);
        bands.map(|(band, fit)| band.half_width_nm / (1.96 * fit.rmse_nm)).collect::<Vec<f64>>()
    });
    for joint in 0..2 {
        let [steady, drifting] = [widths[0][joint], widths[1][joint]];
        // Reversals add friction in the few rows near rest.
        assert!((0.95..1.2).contains(&steady) && drifting > 1.1 * steady, "{widths:?}");
    }
}
