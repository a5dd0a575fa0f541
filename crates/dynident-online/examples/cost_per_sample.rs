//! Measures the time per sample for seven joints with 64 base parameters: regressor and update of the triangle
//! separately.
//!
//! ```text
//! cargo run --release -p dynident-online --example cost_per_sample [SAMPLES]
//! ```
//!
//! Prints the median and the 99.9th percentile of single samples, and the mean of all.

#![allow(clippy::print_stdout, reason = "a program that prints a table")]

use dynident_dynamics::{
    Panels, ParametricModel, TermHistory, Workspace, inverse_dynamics, regressor_panels_of_sample,
};
use dynident_model::load_robot;
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, DriveChoice, JointMotion, terms_per_joint};
use dynident_online::Residuals;
use dynident_online::{
    ContactMonitor, ContactSettings, DelayedDerivatives, OnlineError, OnlineEstimator, OnlineSettings,
};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let samples: usize = std::env::args().nth(1).map_or(Ok(20_000), |text| text.parse())?;
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/panda_arm7.urdf");
    let model = load_robot(file)?.model;
    let coulomb = Some(CoulombShape::Smooth { width: 0.02 });
    let choice = DriveChoice { coulomb, viscous: true, offset: true, drive_inertia: true };
    // Uses a model with exactly 64 base parameters, as promised in the documentation.
    let terms = terms_per_joint(&model, |_| choice);
    let robot = (0..terms.len())
        .rev()
        .filter_map(|count| ParametricModel::new(model.clone(), terms[..count].to_vec()).ok())
        .find(|robot| robot.layout().columns().len() <= 64)
        .ok_or("no robot of 64 columns")?;
    let (dof, columns) = (robot.dof(), robot.layout().columns().len());
    println!("{dof} joints, {columns} base parameters, {samples} samples");

    let mut random = Random::new(1);
    let mut draw = |size: f64| -> Vec<f64> { (0..dof).map(|_| random.uniform(-size, size)).collect() };
    let states: Vec<[Vec<f64>; 4]> = (0..1000).map(|_| [draw(2.5), draw(2.0), draw(6.0), draw(20.0)]).collect();

    let mut workspace = Workspace::new(&model);
    let mut history = TermHistory::default();
    let mut panels = Panels::default();
    measure("regressor alone", samples, |sample| {
        let [q, dq, ddq, _] = &states[sample % states.len()];
        let motion = JointMotion { samples: 1, q, dq, ddq };
        regressor_panels_of_sample(&model, &mut workspace, robot.layout(), &motion, &mut history, &mut panels);
        Ok(())
    })?;
    for (name, half_life_samples) in [("regressor and update", None), ("the same, with forgetting", Some(10_000.0))] {
        let settings = OnlineSettings { half_life_samples, ..OnlineSettings::new(vec![1.0; dof]) };
        let mut estimator = OnlineEstimator::new(robot.clone(), settings, None)?;
        measure(name, samples, |sample| {
            let [q, dq, ddq, tau] = &states[sample % states.len()];
            estimator.add(q, dq, ddq, tau)
        })?;
        let mut values = vec![0.0; columns];
        if half_life_samples.is_none() {
            measure("base parameters, on request", samples, |_| {
                estimator.values(&mut values);
                Ok(())
            })?;
        }
    }
    let mut derivatives = DelayedDerivatives::new(dof, 1000.0, 10)?;
    measure("derivatives over 21 samples", samples, |sample| {
        let [q, _, _, tau] = &states[sample % states.len()];
        derivatives.add(q, tau).map(drop)
    })?;
    let mut dynamics = Workspace::new(&model);
    let calibration =
        Residuals { joints: (0..dof).map(|_| (0..30_000).map(|_| random.uniform(-1.0, 1.0)).collect()).collect() };
    let mut monitor = ContactMonitor::new(ContactSettings::new(1000.0), &calibration)?;
    let mut residuals = vec![0.0; dof];
    measure("predicted torque and contact", samples, |sample| {
        let [q, dq, ddq, tau] = &states[sample % states.len()];
        let predicted = inverse_dynamics(&model, &mut dynamics, q, dq, ddq);
        for ((residual, tau), predicted) in residuals.iter_mut().zip(tau).zip(predicted) {
            *residual = tau - predicted;
        }
        monitor.add(&residuals).map(drop)
    })?;
    Ok(())
}

/// Runs a task for consecutive samples and prints the time per sample; the first tenth is a warm-up.
fn measure(
    name: &str,
    samples: usize,
    mut task: impl FnMut(usize) -> Result<(), OnlineError>,
) -> Result<(), OnlineError> {
    let mut took_ns = Vec::with_capacity(samples);
    for sample in 0..samples + samples / 10 {
        let start = Instant::now();
        task(sample)?;
        if sample >= samples / 10 {
            took_ns.push(start.elapsed().as_nanos() as f64);
        }
    }
    took_ns.sort_by(f64::total_cmp);
    let at = |share: f64| took_ns[((took_ns.len() - 1) as f64 * share) as usize] / 1e3;
    let mean = took_ns.iter().sum::<f64>() / took_ns.len() as f64 / 1e3;
    println!("{name:30} median {:7.2} us, mean {mean:7.2} us, 99.9 % below {:7.2} us", at(0.5), at(0.999));
    Ok(())
}
