//! Figs. 16, 17: torques on another motion (Eq. 25), predicted by both models.

use crate::arm::{Arm, TRUTH};
use crate::base_parameters::COLUMNS;
use crate::piece::PaperFigure;
use dynident_dynamics::{BaseParameterSettings, BaseParameters, Workspace, torque_regressor};
use dynident_excitation::grid;
use dynident_report::LinePlot;

/// Seconds of the motion, and its samples.
const DURATION_S: f64 = 10.0;
const SAMPLES: usize = 1001;

/// Driving torques along q1 = sin t, q2 = sin(-t), and those predicted from the six parameters by either method.
pub(crate) fn figures_16_and_17(arm: &Arm, logistic: &[f64; 6], fourier: &[f64; 6]) -> Vec<PaperFigure> {
    let times = grid(DURATION_S, SAMPLES);
    let base = BaseParameters::new(&arm.model, &[], &BaseParameterSettings::default());
    let mut workspace = Workspace::new(&arm.model);
    let width = 10 * arm.model.dof();
    // By joint: driving torque, and the torque by each model.
    let mut torque = vec![[Vec::new(), Vec::new(), Vec::new()]; 2];
    for t in &times {
        let (sin, cos) = t.sin_cos();
        let regressor = torque_regressor(&arm.model, &mut workspace, &[sin, -sin], &[cos, -cos], &[-sin, sin]);
        for (joint, of_joint) in torque.iter_mut().enumerate() {
            let row = &regressor[joint * width..(joint + 1) * width];
            for (values, theta) in of_joint.iter_mut().zip([&TRUTH, logistic, fourier]) {
                let terms = theta.iter().zip(COLUMNS).map(|(theta, column)| theta * row[base.independent()[column]]);
                values.push(terms.sum::<f64>());
            }
        }
    }
    (16..)
        .zip(torque)
        .enumerate()
        .map(|(joint, (number, [driving, logistic, fourier]))| {
            let largest =
                |predicted: &[f64]| predicted.iter().zip(&driving).map(|(p, d)| (p - d).abs()).fold(0.0_f64, f64::max);
            let (by_logistic, by_fourier) = (largest(&logistic), largest(&fourier));
            let title = format!("Predicted and driving torques of joint {}", joint + 1);
            let plot = LinePlot::new(title, "t, s", "torque, Nm", times.clone())
                .line("driving", driving)
                .dashed("predicted, logistic function", logistic)
                .dashed("predicted, Fourier series", fourier);
            PaperFigure::new(number, plot, "Eq. 25 itself breaks (18): its speed is 1 rad/s")
                .value("largest_deviation_logistic_nm", by_logistic)
                .value("largest_deviation_fourier_nm", by_fourier)
        })
        .collect()
}
