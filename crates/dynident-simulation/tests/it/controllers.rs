//! Controllers against theory, and against the simulation in the paper's reading notes.

use dynident_dynamics::{BaseParameterSettings, BaseParameters, Workspace, inverse_dynamics, mass_matrix};
use dynident_excitation::Motion;
use dynident_excitation::families::{SplicedLogistic, SplicedLogisticSettings};
use dynident_model::sample::{Random, planar_2r, random_tree};
use dynident_model::terms::{Coulomb, CoulombShape, DriveInertia, Offset, TorqueTerm, Viscous};
use dynident_model::{InertialParameters, Mat3, Model, Vec3};
use dynident_simulation::controllers::{
    ComputedTorqueSettings, FiniteTimeSettings, JointPdSettings, JointPidSettings, Measured, SlotineLi,
    SlotineLiSettings, Target,
};
use dynident_simulation::{
    Controller, ControllerModel, ControllerSettings, FrictionCompensation, Integrator, LoopSettings, Plant, Reference,
    Run, Start, closed_loop,
};

fn paper_arm() -> Model {
    let point = InertialParameters::from_centre_of_mass(1.0, Vec3([1.0, 0.0, 0.0]), &Mat3::ZERO);
    planar_2r(1.0, point, point)
}

fn terms() -> (Vec<TorqueTerm>, Vec<f64>) {
    let joints = |term: fn(usize) -> TorqueTerm| (0..2).map(term);
    let terms: Vec<TorqueTerm> = joints(|joint| TorqueTerm::Viscous(Viscous { joint }))
        .chain(joints(|joint| TorqueTerm::DriveInertia(DriveInertia { joint })))
        .chain(joints(|joint| TorqueTerm::Offset(Offset { joint })))
        .chain(joints(|joint| TorqueTerm::Coulomb(Coulomb { joint, shape: CoulombShape::Smooth { width: 0.05 } })))
        .collect();
    (terms, vec![0.5, 0.4, 0.3, 0.2, 0.1, -0.1, 0.6, 0.5])
}

fn sines(rate_hz: f64, duration_s: f64) -> Reference {
    let samples = (rate_hz * duration_s) as usize + 1;
    let mut motion = Motion::default();
    motion.reset(2, samples);
    for (joint, (amplitude, omega)) in [(0.5, 1.3), (0.8, 2.1)].into_iter().enumerate() {
        for sample in 0..samples {
            let (sine, cosine) = (omega * sample as f64 / rate_hz).sin_cos();
            let at = joint * samples + sample;
            motion.q[at] = amplitude * sine;
            motion.dq[at] = amplitude * omega * cosine;
            motion.ddq[at] = -amplitude * omega * omega * sine;
        }
    }
    Reference::new(rate_hz, motion).unwrap()
}

fn run(plant: &mut Plant, controller: &mut dyn Controller, reference: &Reference, start: Start) -> Run {
    let settings =
        LoopSettings { integrator: Integrator::Rk4 { steps_per_sample: 1 }, start, ..LoopSettings::default() };
    closed_loop(plant, controller, reference, &settings).unwrap()
}

/// With an exact model the error satisfies `ë + K_d ė + K_p e = 0`; critically damped from (e₀, 0): `e = e₀ (1 + λt)
/// e^(-λt)`. The sampled loop has a delay of half a sample, so at 10 kHz the error can deviate by λ dt/2 of e₀.
#[test]
fn computed_torque_is_linear_in_the_error() {
    let (terms, values) = terms();
    let mut plant = Plant::new(&paper_arm(), &terms, &values).unwrap();
    let model = ControllerModel::new(&paper_arm(), &terms, &values).unwrap();
    let settings = ControllerSettings::ComputedTorque(ComputedTorqueSettings {
        kp: 100.0.into(),
        kd: 20.0.into(),
        friction: FrictionCompensation::Measured,
    });
    let mut controller = settings.build(2, Some(&model)).unwrap();
    let reference = sines(10_000.0, 1.0);
    let start = Start::At { q: vec![-0.05, 0.05], dq: vec![0.5 * 1.3, 0.8 * 2.1] };
    let own = run(&mut plant, controller.as_mut(), &reference, start);
    assert!(own.status.is_done());
    for (joint, e0) in [(0, 0.05), (1, -0.05)] {
        for (sample, error) in own.tracking_error(joint).enumerate() {
            let t = own.time_s(sample);
            let expected = e0 * (1.0 + 10.0 * t) * (-10.0 * t).exp();
            assert!((error - expected).abs() < 1e-3 * 0.05 + 1e-4, "{joint} {t}: {error} {expected}");
        }
    }
}

/// With an exact model the finite-time law reduces the error to the linear range in finite time. The literal law
/// diverges, and the loop reports it with finite numbers.
#[test]
fn the_papers_law_converges_and_its_print_does_not() {
    let mut plant = Plant::new(&paper_arm(), &[], &[]).unwrap();
    let model = ControllerModel::new(&paper_arm(), &[], &[]).unwrap();
    let gains = FiniteTimeSettings::with_gains(vec![8.0, 8.0], vec![6.0, 6.0]);
    let reference = sines(1000.0, 8.0);
    let start = || Start::At { q: vec![-0.1, 0.1], dq: vec![0.0, 0.0] };
    let mut controller = ControllerSettings::FiniteTime(gains.clone()).build(2, Some(&model)).unwrap();
    let own = run(&mut plant, controller.as_mut(), &reference, start());
    for joint in 0..2 {
        let late = own.tracking_error(joint).skip(6000).fold(0.0_f64, |m, e| m.max(e.abs()));
        assert!(late < 1e-3, "joint {joint}: {late}");
    }
    let mut literal = ControllerSettings::FiniteTimeLiteral(gains).build(2, Some(&model)).unwrap();
    assert_eq!(literal.name(), "finite-time-literal");
    let own = run(&mut plant, literal.as_mut(), &reference, start());
    let grown = own.max_error[0].max(own.max_error[1]);
    assert!(grown > 1.0, "{grown}");
    assert!(own.q.iter().chain(&own.dq).chain(&own.tau).all(|x| x.is_finite()));
}

/// Without the linear range the sampled law ends in a limit cycle; with it the torque is smooth.
#[test]
fn the_blend_ends_the_chatter() {
    let mut plant = Plant::new(&paper_arm(), &[], &[]).unwrap();
    let model = ControllerModel::new(&paper_arm(), &[], &[]).unwrap();
    let reference = Reference::standing(&[0.3, 0.4], 1000.0, 3.0).unwrap();
    let mut ripple = |blend: f64| {
        let gains = FiniteTimeSettings {
            alpha: 0.3,
            blend_position: blend,
            blend_speed: 10.0 * blend,
            ..FiniteTimeSettings::with_gains(50.0, 20.0)
        };
        let mut controller = ControllerSettings::FiniteTime(gains).build(2, Some(&model)).unwrap();
        let own = run(&mut plant, controller.as_mut(), &reference, Start::At { q: vec![0.29, 0.41], dq: vec![0.0; 2] });
        let torque = &own.tau[own.of(1)];
        torque[2000..].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
    };
    let (raw, blended) = (ripple(0.0), ripple(1e-2));
    assert!(raw > 1e-2 && blended < 1e-9, "{raw:e} {blended:e}");
}

/// PD with gravity compensation holds a posture without error, PD alone deviates by g/K_p, and the integral removes the
/// deviation.
#[test]
fn gravity_and_integrals_remove_the_sag() {
    let mut plant = Plant::new(&paper_arm(), &[], &[]).unwrap();
    let model = ControllerModel::new(&paper_arm(), &[], &[]).unwrap();
    let reference = Reference::standing(&[0.3, 0.4], 1000.0, 12.0).unwrap();
    let pd = || JointPdSettings { kp: 400.0.into(), kd: 120.0.into() };
    let pid = JointPidSettings { kp: 400.0.into(), ki: 400.0.into(), kd: 120.0.into(), integral_limit: None };
    let mut last = |settings: &ControllerSettings| {
        let mut controller = settings.build(2, Some(&model)).unwrap();
        let own = run(&mut plant, controller.as_mut(), &reference, Start::Reference);
        own.tracking_error(0).last().unwrap()
    };
    let sag = last(&ControllerSettings::JointPd(pd()));
    assert!((sag - 9.8 * (2.0 * 0.3_f64.cos() + 0.7_f64.cos()) / 400.0).abs() < 0.1 * sag);
    assert!(last(&ControllerSettings::PdGravity(pd())).abs() < 1e-9);
    assert!(last(&ControllerSettings::JointPid(pid)).abs() < 1e-4);
}

/// C of Slotine and Li: `C(q, q̇) q̇` is the centrifugal torque, `C(q, u) v = C(q, v) u`, and `vᵀ (Ṁ - 2C) v = 0`, with
/// Ṁ by central differences of the mass matrix (step 1e-6: error 1e-8).
#[test]
fn slotine_li_has_the_skew_matrix() {
    let dof = 5;
    let model = random_tree(12, dof);
    let mut workspace = Workspace::new(&model);
    let mut random = Random::new(3);
    let mut vector = || (0..dof).map(|_| random.uniform(-1.0, 1.0)).collect::<Vec<f64>>();
    let (q, u, v, w) = (vector(), vector(), vector(), vector());
    let settings =
        SlotineLiSettings { lambda: 0.0.into(), kd: 0.0.into(), gamma: 0.0, friction: FrictionCompensation::None };
    let mut controller = SlotineLi::new(ControllerModel::new(&model, &[], &[]).unwrap(), &settings).unwrap();
    let mut torque = |measured: &[f64], reference: &[f64], acceleration: &[f64]| {
        let mut tau = vec![0.0; dof];
        let target = Target { q: &q, dq: reference, ddq: acceleration };
        controller.torque(0.0, target, Measured { q: &q, dq: measured }, &mut tau);
        tau
    };
    let zero = vec![0.0; dof];
    let gravity = torque(&zero, &zero, &zero);
    let own = torque(&u, &u, &w);
    for (a, b) in own.iter().zip(inverse_dynamics(&model, &mut workspace, &q, &u, &w)) {
        assert!((a - b).abs() < 1e-10);
    }
    let centrifugal = |tau: Vec<f64>| tau.iter().zip(&gravity).map(|(a, b)| a - b).collect::<Vec<f64>>();
    let (uv, vu) = (centrifugal(torque(&u, &v, &zero)), centrifugal(torque(&v, &u, &zero)));
    assert!(uv.iter().zip(&vu).all(|(a, b)| (a - b).abs() < 1e-10));
    let mut form = |sign: f64| {
        let moved: Vec<f64> = q.iter().zip(&u).map(|(q, u)| q + sign * 1e-6 * u).collect();
        let m = mass_matrix(&model, &mut workspace, &moved);
        (0..dof * dof).map(|at| v[at / dof] * m[at] * v[at % dof]).sum::<f64>()
    };
    let rate = (form(1.0) - form(-1.0)) / 2e-6;
    let twice: f64 = 2.0 * v.iter().zip(&uv).map(|(v, c)| v * c).sum::<f64>();
    assert!((rate - twice).abs() < 1e-6, "{rate} {twice}");
}

/// Adaptation without a model reduces the error of the second half to a small part of that without adaptation.
#[test]
fn slotine_li_adapts() {
    let (terms, values) = terms();
    let mut plant = Plant::new(&paper_arm(), &terms, &values).unwrap();
    let nothing = ControllerModel::from_parameters(&paper_arm(), &terms, &[0.0; 28]).unwrap();
    let reference = sines(1000.0, 20.0);
    let mut late = |gamma: f64| {
        let settings =
            SlotineLiSettings { lambda: 5.0.into(), kd: 20.0.into(), gamma, friction: FrictionCompensation::Reference };
        let mut controller = ControllerSettings::SlotineLi(settings).build(2, Some(&nothing)).unwrap();
        let own = run(&mut plant, controller.as_mut(), &reference, Start::Reference);
        assert!(own.status.is_done());
        own.tracking_error(0).skip(15_000).fold(0.0_f64, |m, e| m.max(e.abs()))
    };
    let (fixed, adapted) = (late(0.0), late(3.0));
    assert!(adapted < 0.1 * fixed, "{fixed} {adapted}");
    // With the exact model only the sampling error remains.
    let exact = ControllerModel::new(&paper_arm(), &terms, &values).unwrap();
    let settings =
        SlotineLiSettings { lambda: 5.0.into(), kd: 20.0.into(), gamma: 0.0, friction: FrictionCompensation::Measured };
    let mut controller = ControllerSettings::SlotineLi(settings).build(2, Some(&exact)).unwrap();
    let own = run(&mut plant, controller.as_mut(), &reference, Start::Reference);
    assert!(own.max_error[0] < 2e-3, "{}", own.max_error[0]);
}

/// Base parameters alone result in the same controller as the whole model, because torques are linear in them.
#[test]
fn base_parameters_are_enough() {
    let (terms, values) = terms();
    let model = random_tree(4, 2);
    let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
    let all: Vec<f64> = model.parameter_vector().into_iter().chain(values.iter().copied()).collect();
    let whole = ControllerModel::new(&model, &terms, &values).unwrap();
    let few = ControllerModel::from_columns(&model, &base.base_columns(), &base.values(&all)).unwrap();
    for settings in [
        ControllerSettings::ComputedTorque(ComputedTorqueSettings {
            kp: 9.0.into(),
            kd: 6.0.into(),
            friction: FrictionCompensation::Reference,
        }),
        ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(2.0, 3.0)),
        ControllerSettings::PdGravity(JointPdSettings { kp: 9.0.into(), kd: 6.0.into() }),
        ControllerSettings::SlotineLi(SlotineLiSettings {
            lambda: 2.0.into(),
            kd: 3.0.into(),
            gamma: 0.0,
            friction: FrictionCompensation::Reference,
        }),
    ] {
        let torque = |model: &ControllerModel| {
            let mut controller = settings.build(2, Some(model)).unwrap();
            let mut tau = [0.0; 2];
            let target = Target { q: &[0.3, 0.4], dq: &[0.5, -0.6], ddq: &[0.7, 0.8] };
            controller.torque(0.0, target, Measured { q: &[0.1, 0.5], dq: &[-0.2, 0.3] }, &mut tau);
            tau
        };
        let (a, b) = (torque(&whole), torque(&few));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-10), "{}: {a:?} {b:?}", settings.name());
    }
}

/// Reading notes, 2: joint 2 of the paper's arm with T = 40/ω, 100 Hz, g = 9.8, window ±2.46 s around the middle of
/// each stroke. First PD with K_p = 16, K_d = 8, then the paper's law with the estimate of the previous run. The
/// simulation in the notes had largest tracking errors of 0.62, 0.12 and 0.001 rad (Fig. 12 of the paper: 0.6, 0.15, 0)
/// and θ4 = 0.369, 1.094, 0.996.
#[test]
fn the_papers_three_runs() {
    let (amplitude, omega) = (2.094, 0.996);
    let period = 40.0 / omega;
    let settings = SplicedLogisticSettings { offsets: Some(vec![0.0, 0.0]), ..SplicedLogisticSettings::default() };
    let family = SplicedLogistic::new(2, period, &settings).unwrap();
    let parameters = [1.0, omega, amplitude, omega];
    let reference = Reference::of_family(&family, &parameters, 100.0, None).unwrap().with_joint_held(0, 0.0).unwrap();
    let mut plant = Plant::new(&paper_arm(), &[], &[]).unwrap().with_locked(&["joint1".to_owned()]).unwrap();
    let pd = ControllerSettings::JointPd(JointPdSettings { kp: 16.0.into(), kd: 8.0.into() });
    let mut controller = pd.build(2, None).unwrap();
    for (error, digit, theta_4, near) in
        [(0.62, 0.005, 0.369, 0.03), (0.12, 0.005, 1.094, 0.03), (0.001, 0.0005, 0.996, 0.001)]
    {
        let own = run(&mut plant, controller.as_mut(), &reference, Start::Reference);
        assert!(own.status.is_done());
        let mut rows = Vec::new();
        for sample in 0..own.samples {
            let t = own.time_s(sample);
            let from_middle = (t % (0.5 * period) - 0.25 * period).abs();
            let at = own.samples + sample;
            if from_middle <= 2.46 {
                let (gone, left) = (own.q[at], amplitude - own.q[at]);
                let ddq = (omega / amplitude).powi(2) * gone * left * (left - gone);
                let (sine, cosine) = own.q[at].sin_cos();
                rows.push([ddq, 9.8 * cosine, -9.8 * sine, own.tau[at]]);
            }
        }
        let theta = least_squares(&rows);
        assert!((own.max_error[1] - error).abs() < digit, "{} {error}", own.max_error[1]);
        assert!((theta[0] - theta_4).abs() < near, "{theta:?} {theta_4}");
        let mut parameters = [0.0; 20];
        (parameters[19], parameters[11], parameters[12]) = (theta[0], theta[1], theta[2]);
        let model = ControllerModel::from_parameters(&paper_arm(), &[], &parameters).unwrap();
        let term = ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(4.0, 4.0));
        controller = term.build(2, Some(&model)).unwrap();
    }
}

/// Three unknowns from rows of three coefficients and a right-hand side.
fn least_squares(rows: &[[f64; 4]]) -> [f64; 3] {
    let mut a = [[0.0; 4]; 3];
    for row in rows {
        for i in 0..3 {
            for k in 0..4 {
                a[i][k] += row[i] * row[k];
            }
        }
    }
    for i in 0..3 {
        for j in 0..3 {
            if i != j {
                let factor = a[j][i] / a[i][i];
                for k in 0..4 {
                    a[j][k] -= factor * a[i][k];
                }
            }
        }
    }
    core::array::from_fn(|i| a[i][3] / a[i][i])
}

#[test]
fn invalid_controllers_are_rejected() {
    let read = |text: &str| toml::from_str::<ControllerSettings>(text);
    assert!(read("kind = \"joint-pd\"\nkp = 1.0").is_err());
    assert!(read("kind = \"joint-pd\"\nkp = 1.0\nkd = 1.0\nki = 1.0").is_err());
    assert!(read("kind = \"magic\"").is_err());
    let pd = |kp: f64| ControllerSettings::JointPd(JointPdSettings { kp: kp.into(), kd: 1.0.into() });
    assert!(pd(f64::NAN).build(2, None).is_err() && pd(-1.0).build(2, None).is_err());
    let finite = ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(1.0, 1.0));
    assert!(finite.build(2, None).unwrap_err().to_string().contains("needs a model"));
    let model = ControllerModel::new(&paper_arm(), &[], &[]).unwrap();
    assert!(finite.build(3, Some(&model)).is_err());
    let steep = FiniteTimeSettings { alpha: 0.0, ..FiniteTimeSettings::with_gains(1.0, 1.0) };
    assert!(ControllerSettings::FiniteTime(steep).build(2, Some(&model)).is_err());
    // All names can be read back.
    for settings in [pd(2.0), finite] {
        let text = toml::to_string(&settings).unwrap();
        assert_eq!(read(&text).unwrap(), settings);
        assert!(text.contains(settings.name()));
    }
}
