//! A step of an excitation design: cost, limits and exact gradient of a trajectory.

use super::clock::Report;
use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
use dynident_excitation::criteria::{Criterion, DOptimal};
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::limits::{LimitSet, Limits};
use dynident_excitation::{Family, Information, Motion, grid};
use dynident_model::Model;
use dynident_model::sample::Random;
use std::hint::black_box;

const SAMPLES: usize = 256;

/// Times the D-criterion of a random Fourier trajectory (5 harmonics, 10 s, base columns) with position, speed and
/// torque limits, and its gradient by the trajectory's parameters, at the best level of this processor.
pub(crate) fn time_all(model: &Model, report: &Report<'_>) {
    let settings = FourierSettings::default();
    let (Ok(family), Ok(limits)) =
        (Fourier::new(model.dof(), 10.0, &settings), LimitSet::new(&Limits::from_model(model), model))
    else {
        return;
    };
    let base = BaseParameters::new(model, &[], &BaseParameterSettings::default());
    let layout = PanelLayout::new(model, base.base_columns());
    let mut information = Information::new(model, &layout, &vec![1.0; model.dof()], None);
    let joints = model.joints();
    let ranges: Vec<[f64; 2]> = joints
        .iter()
        .map(|joint| [joint.limits.lower.unwrap_or(-3.0).max(-3.0), joint.limits.upper.unwrap_or(3.0).min(3.0)])
        .collect();
    let speeds: Vec<f64> = joints.iter().map(|joint| joint.limits.velocity.unwrap_or(2.0)).collect();
    let parameters = family.random(&ranges, &speeds, &mut Random::new(1));
    let times = grid(10.0, SAMPLES);
    let (mut motion, mut adjoint) = (Motion::default(), Motion::default());
    let (mut workspace, mut values) = (limits.workspace(), Vec::new());
    let mut gradient = vec![0.0; family.parameters()];
    report.time("design_gradient_256", 1, || {
        family.motion(&parameters, &times, &mut motion);
        limits.values(&mut workspace, &motion, &mut values);
        let d = information.of(&motion, 1.0);
        if let Some((_, by_information)) = DOptimal.value_and_derivative(&d) {
            adjoint.reset(motion.joints, motion.samples);
            // As in a search: only violated limits have a weight.
            let weights: Vec<f64> = values.iter().map(|value| value.max(0.0)).collect();
            limits.apply_adjoint(&mut workspace, &motion, &weights, &mut adjoint);
            information.apply_adjoint(&motion, 1.0, &by_information, &mut adjoint);
            gradient.fill(0.0);
            family.apply_adjoint(&parameters, &times, &adjoint, &mut gradient);
        }
        black_box(&gradient);
    });
}
