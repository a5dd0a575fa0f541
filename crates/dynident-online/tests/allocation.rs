//! Functions for the control loop do not allocate, including the first sample: counted by a global allocator.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

use dynident_dynamics::ParametricModel;
use dynident_model::load_robot;
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, DriveChoice, terms_per_joint};
use dynident_online::{
    ContactMonitor, ContactSettings, DelayedDerivatives, OnlineEstimator, OnlineSettings, Residuals,
};
use dynident_testing::repository;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Requests of this thread only, because the test harness has other threads.
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// Safe: every request is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        REQUESTS.set(REQUESTS.get() + 1);
        unsafe { System.alloc_zeroed(layout) }
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

/// Number of allocations of a call, and its result.
fn requests<T>(call: impl FnOnce() -> T) -> (usize, T) {
    let before = REQUESTS.get();
    let result = call();
    (REQUESTS.get() - before, result)
}

#[test]
fn the_counter_counts() {
    assert_eq!(requests(|| std::hint::black_box(Box::new(1.0_f64))).0, 1);
}

#[test]
fn nothing_is_allocated_from_the_first_sample_on() {
    let model = load_robot(repository("robots/panda_arm7.urdf")).unwrap().model;
    let coulomb = Some(CoulombShape::Smooth { width: 0.02 });
    let choice = DriveChoice { coulomb, viscous: true, offset: false, drive_inertia: true };
    let robot = ParametricModel::new(model.clone(), terms_per_joint(&model, |_| choice)).unwrap();
    let (dof, columns) = (robot.dof(), robot.layout().columns().len());
    let mut random = Random::new(1);
    let mut draw = |count: usize| -> Vec<f64> { (0..count).map(|_| random.uniform(-1.0, 1.0)).collect() };
    // With a short half-life the samples include a rescaling of all rows.
    let settings = OnlineSettings { half_life_samples: Some(2.0), ..OnlineSettings::new(vec![1.0; dof]) };
    let mut estimator = OnlineEstimator::new(robot, settings, None).unwrap();
    let mut derivatives = DelayedDerivatives::new(dof, 1000.0, 10).unwrap();
    let calibration = Residuals { joints: (0..dof).map(|_| draw(30_000)).collect() };
    let mut monitor = ContactMonitor::new(ContactSettings::new(1000.0), &calibration).unwrap();
    let (mut values, mut predicted) = (vec![0.0; columns], vec![0.0; dof]);
    let mut determined = 0;
    for sample in 0..1000 {
        let [q, dq, ddq, tau] = [draw(dof), draw(dof), draw(dof), draw(dof)];
        let (requested, ()) = requests(|| {
            derivatives.add(&q, &tau).unwrap();
            estimator.add(&q, &dq, &ddq, &tau).unwrap();
            determined += usize::from(estimator.values(&mut values));
            estimator.torque(&values, &mut predicted);
            monitor.add(&predicted).unwrap();
        });
        assert_eq!(requested, 0, "sample {sample}");
    }
    assert!(determined > 900, "{determined}");
    // Rejected samples do not allocate either.
    let bad = vec![f64::NAN; dof];
    assert_eq!(requests(|| estimator.add(&bad, &bad, &bad, &bad).is_err()), (0, true));
}
