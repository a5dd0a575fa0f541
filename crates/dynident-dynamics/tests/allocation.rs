//! Functions with a workspace do not allocate after their first call; a global allocator counts.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

use dynident_dynamics::{
    BatchWorkspace, JointMatrices, PanelLayout, Panels, Workspace, all_columns, body_placements, coriolis_matrix,
    forward_dynamics, forward_dynamics_derivatives, gravity_torque, gravity_torque_derivative, inverse_dynamics,
    inverse_dynamics_batch, inverse_dynamics_derivative_matrices, inverse_dynamics_derivatives, kinetic_energy,
    mass_matrices, mass_matrix, mass_matrix_and_bias, potential_energy, regressor_panels, torque_regressor,
};
use dynident_lanes::Level;
use dynident_model::sample::random_tree;
use dynident_model::terms::{
    CoulombShape, Coupling, CouplingEffect, DriveChoice, JointMotion, TorqueTerm, terms_per_joint,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

thread_local! {
    /// Allocations of this thread only, because the test harness has its own threads.
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// Sound: every request is passed on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        unsafe { System.realloc(pointer, layout, size) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count() {
    REQUESTS.set(REQUESTS.get() + 1);
}

fn requests_when_warm(mut call: impl FnMut()) -> usize {
    call();
    let before = REQUESTS.get();
    call();
    REQUESTS.get() - before
}

/// Prevents the compiler from removing a call with an unused result.
fn use_up<T>(value: T) {
    black_box(value);
}

#[test]
fn the_counter_counts() {
    assert_eq!(requests_when_warm(|| drop(black_box(Box::new(1.0_f64)))), 1);
}

#[test]
fn one_sample_at_a_time_allocates_nothing() {
    for level in Level::available() {
        for dof in [1, 7, 13] {
            let model = random_tree(3, dof);
            let w = &mut Workspace::with_level(&model, level);
            let (q, dq, ddq) = (vec![0.3; dof], vec![-0.7; dof], vec![1.1; dof]);
            let mut check = |what: &str, call: &mut dyn FnMut(&mut Workspace)| {
                assert_eq!(requests_when_warm(|| call(w)), 0, "{what}, {dof} joints, {}", level.name());
            };
            check("inverse dynamics", &mut |w| use_up(inverse_dynamics(&model, w, &q, &dq, &ddq)[0]));
            check("gravity", &mut |w| use_up(gravity_torque(&model, w, &q)[0]));
            check("mass matrix", &mut |w| use_up(mass_matrix(&model, w, &q)[0]));
            check("equation of motion", &mut |w| use_up(mass_matrix_and_bias(&model, w, &q, &dq).1[0]));
            check("forward dynamics", &mut |w| use_up(forward_dynamics(&model, w, &q, &dq, &ddq)[0]));
            check("regressor", &mut |w| use_up(torque_regressor(&model, w, &q, &dq, &ddq)[0]));
            check("derivatives", &mut |w| {
                use_up(inverse_dynamics_derivatives(&model, w, &q, &dq, &ddq).by_position[0]);
            });
            check("derivatives of the acceleration", &mut |w| {
                use_up(forward_dynamics_derivatives(&model, w, &q, &dq, &ddq).by_position[0]);
            });
            check("Coriolis matrix", &mut |w| use_up(coriolis_matrix(&model, w, &q, &dq)[0]));
            check("derivative of gravity", &mut |w| use_up(gravity_torque_derivative(&model, w, &q)[0]));
            check("placements", &mut |w| use_up(body_placements(&model, w, &q)[0]));
            check("kinetic energy", &mut |w| use_up(kinetic_energy(&model, w, &q, &dq)));
            check("potential energy", &mut |w| use_up(potential_energy(&model, w, &q)));
        }
    }
}

#[test]
fn batches_allocate_nothing() {
    let (dof, samples) = (7, 37);
    let model = random_tree(5, dof);
    let shape = CoulombShape::Sign { dead_band: 0.0 };
    let mut terms = terms_per_joint(&model, |_| DriveChoice {
        drive_inertia: true,
        viscous: true,
        coulomb: Some(shape),
        offset: true,
    });
    terms.extend([CouplingEffect::Inertia, CouplingEffect::Coulomb(shape)].map(|effect| {
        TorqueTerm::Coupling(Coupling { name: "wrist".to_owned(), first: 5, second: 6, ratios: [1.0, 1.0], effect })
    }));
    let layout = PanelLayout::new(&model, all_columns(&model, &terms));
    let (q, dq, ddq) = (vec![0.3; dof * samples], vec![-0.7; dof * samples], vec![1.1; dof * samples]);
    let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
    let fewer = JointMotion { samples: 20, q: &q[..dof * 20], dq: &dq[..dof * 20], ddq: &ddq[..dof * 20] };
    let mut tau = vec![0.0; dof * samples];
    let mut panels = Panels::default();
    for level in Level::available() {
        let mut workspace = BatchWorkspace::with_level(&model, level);
        let torques = requests_when_warm(|| inverse_dynamics_batch(&model, &mut workspace, &motion, &mut tau));
        assert_eq!(torques, 0, "inverse dynamics, {}", level.name());
        let mut kept = [(); 3].map(|()| JointMatrices::new(&model));
        let inertias = requests_when_warm(|| mass_matrices(&model, &mut workspace, &q, samples, &mut kept[0]));
        assert_eq!(inertias, 0, "kept mass matrices, {}", level.name());
        let derivatives =
            requests_when_warm(|| inverse_dynamics_derivative_matrices(&model, &mut workspace, &motion, &mut kept));
        assert_eq!(derivatives, 0, "kept derivatives, {}", level.name());
        let whole = requests_when_warm(|| regressor_panels(&model, &mut workspace, &layout, &motion, &mut panels));
        assert_eq!(whole, 0, "panels, {}", level.name());
        // The last block of a log is shorter.
        let tail = requests_when_warm(|| {
            regressor_panels(&model, &mut workspace, &layout, &fewer, &mut panels);
            regressor_panels(&model, &mut workspace, &layout, &motion, &mut panels);
        });
        assert_eq!(tail, 0, "panels of a shorter block, {}", level.name());
    }
}
