//! A step of the closed loop: controller, arm without friction, recording.

use super::clock::Report;
use dynident_dynamics::{Workspace, mass_matrix};
use dynident_excitation::Motion;
use dynident_model::Model;
use dynident_model::sample::Random;
use dynident_model::terms::{Coulomb, CoulombShape, TorqueTerm};
use dynident_simulation::controllers::{FiniteTimeSettings, JointPdSettings};
use dynident_simulation::{
    ControllerModel, ControllerSettings, Integrator, LoopSettings, Plant, Reference, SimulationError, Start,
    closed_loop,
};
use std::hint::black_box;

/// Samples of a timed run: as in `bench_mujoco.c`.
const SAMPLES: usize = 5000;
const EULER: Integrator = Integrator::SemiImplicitEuler { steps_per_sample: 1 };
const RK4: Integrator = Integrator::Rk4 { steps_per_sample: 1 };

/// Times one step of 1 ms with joint PD control to zero positions (gains: 100 and 20 times the diagonal of the mass
/// matrix at zero) for both fixed-step integrators; the same with dry friction; and 10 s of the finite-time
/// controller of the paper *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function* at 1 kHz
/// along sines. It uses the best instruction set of this processor.
pub(crate) fn time_all(model: &Model, report: &Report<'_>) -> Result<(), SimulationError> {
    let dof = model.dof();
    let zeros = vec![0.0; dof];
    let mut workspace = Workspace::new(model);
    let matrix = mass_matrix(model, &mut workspace, &zeros);
    let scaled = |factor: f64| (0..dof).map(|joint| factor * matrix[joint * dof + joint]).collect::<Vec<f64>>();
    let gains = JointPdSettings { kp: scaled(100.0).into(), kd: scaled(20.0).into() };
    let mut controller = ControllerSettings::JointPd(gains.clone()).build(dof, None)?;
    let mut plant = Plant::new(model, &[], &[])?;
    let reference = Reference::standing(&zeros, 1000.0, (SAMPLES - 1) as f64 / 1000.0)?;
    let mut random = Random::new(1);
    let start = Start::At { q: (0..dof).map(|_| random.uniform(-0.3, 0.3)).collect(), dq: zeros.clone() };
    for (quantity, integrator) in [("pd_step_euler", EULER), ("pd_step_rk4", RK4)] {
        let settings = LoopSettings { integrator, start: start.clone(), ..LoopSettings::default() };
        // The first run only reports errors; it is not timed.
        closed_loop(&mut plant, controller.as_mut(), &reference, &settings)?;
        report.time(quantity, SAMPLES, || {
            let _ = black_box(closed_loop(&mut plant, controller.as_mut(), &reference, &settings));
        });
    }
    // Dry friction in every joint, in Nm equal to the diagonal of the mass matrix at zero in kg m², so that some
    // joints stick and some slide.
    let shape = CoulombShape::Sign { dead_band: 0.0 };
    let terms: Vec<TorqueTerm> = (0..dof).map(|joint| TorqueTerm::Coulomb(Coulomb { joint, shape })).collect();
    let mut rough = Plant::new(model, &terms, &scaled(1.0))?;
    let settings = LoopSettings { integrator: EULER, start, ..LoopSettings::default() };
    closed_loop(&mut rough, controller.as_mut(), &reference, &settings)?;
    report.time("pd_step_euler_friction", SAMPLES, || {
        let _ = black_box(closed_loop(&mut rough, controller.as_mut(), &reference, &settings));
    });
    let mut motion = Motion::default();
    motion.reset(dof, 10_001);
    for joint in 0..dof {
        for sample in 0..10_001 {
            let (sine, cosine) = (0.5 * sample as f64 / 1000.0).sin_cos();
            let at = joint * motion.samples + sample;
            (motion.q[at], motion.dq[at], motion.ddq[at]) = (sine, 0.5 * cosine, -0.25 * sine);
        }
    }
    let reference = Reference::new(1000.0, motion)?;
    let believed = ControllerModel::new(model, &[], &[])?;
    let settings = ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(4.0, 4.0));
    let mut controller = settings.build(dof, Some(&believed))?;
    let settings = LoopSettings { integrator: RK4, ..LoopSettings::default() };
    closed_loop(&mut plant, controller.as_mut(), &reference, &settings)?;
    report.time("finite_time_10s", 1, || {
        let _ = black_box(closed_loop(&mut plant, controller.as_mut(), &reference, &settings));
    });
    Ok(())
}
