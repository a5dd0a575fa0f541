//! Steps of the closed loop do not allocate: a run twice as long has the same number of allocations.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]
#![allow(clippy::unwrap_used, reason = "tests")]

use dynident_model::sample::random_tree;
use dynident_model::terms::{Coulomb, CoulombShape, DriveInertia, MaxwellSlip, Stribeck, TorqueTerm, Viscous};
use dynident_simulation::controllers::{
    ComputedTorqueSettings, FiniteTimeSettings, JointPdSettings, SlotineLiSettings,
};
use dynident_simulation::{
    ControllerModel, ControllerSettings, FrictionCompensation, Integrator, LoopSettings, Plant, Reference,
    SensorSettings, closed_loop,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Allocations of this thread only, because the test harness has other threads.
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// Sound: every request is passed unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        unsafe { System.alloc(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        unsafe { System.realloc(pointer, layout, size) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn longer_runs_allocate_no_more_often() {
    let model = random_tree(3, 4);
    let shape = CoulombShape::Sign { dead_band: 0.0 };
    let terms = [
        TorqueTerm::Coulomb(Coulomb { joint: 0, shape }),
        TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.1, exponent: 2.0, shape }),
        TorqueTerm::Coulomb(Coulomb { joint: 1, shape: CoulombShape::Smooth { width: 0.01 } }),
        TorqueTerm::Viscous(Viscous { joint: 2 }),
        TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 3, yield_displacement: 0.01 }),
        TorqueTerm::DriveInertia(DriveInertia { joint: 3 }),
    ];
    let values = [0.5, 0.2, 0.3, 0.4, 0.1, 0.2];
    let mut plant = Plant::new(&model, &terms, &values).unwrap();
    let believed = ControllerModel::new(&model, &terms, &values).unwrap();
    let friction = FrictionCompensation::Reference;
    let controllers = [
        ControllerSettings::JointPd(JointPdSettings { kp: 50.0.into(), kd: 20.0.into() }),
        ControllerSettings::ComputedTorque(ComputedTorqueSettings { kp: 50.0.into(), kd: 10.0.into(), friction }),
        ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(5.0, 5.0)),
        ControllerSettings::SlotineLi(SlotineLiSettings { lambda: 3.0.into(), kd: 9.0.into(), gamma: 0.1, friction }),
    ];
    let sensors = SensorSettings { position_std: 1e-5.into(), feedback_delay_samples: 2, ..SensorSettings::default() };
    for controller in &controllers {
        let mut controller = controller.build(4, Some(&believed)).unwrap();
        for integrator in
            [Integrator::SemiImplicitEuler { steps_per_sample: 1 }, Integrator::Rk4 { steps_per_sample: 1 }]
        {
            let settings =
                LoopSettings { integrator, sensors: sensors.clone(), accelerations: true, ..LoopSettings::default() };
            let mut requests = |duration_s: f64| {
                let reference = Reference::standing(&[0.1, 0.2, 0.3, 0.4], 1000.0, duration_s).unwrap();
                let before = REQUESTS.get();
                let run = closed_loop(&mut plant, controller.as_mut(), &reference, &settings).unwrap();
                assert!(run.status.is_done(), "{} {integrator:?} {}", controller.name(), run.status);
                REQUESTS.get() - before
            };
            assert_eq!(requests(0.2), requests(0.4), "{integrator:?}");
        }
    }
}
