use dynident_dynamics::*;
use dynident_lanes::Level;
use dynident_model::laws::JointMotion;
use dynident_model::sample::{Random, random_tree};
use std::time::Instant;
fn main() {
    // serial 7-revolute from random trees: pick pieces
    let mut random = Random::new(1);
    let t = random_tree(1, 7);
    let joints = t
        .joints()
        .iter()
        .enumerate()
        .map(|(i, j)| {
            let mut j = j.clone();
            j.kind = dynident_model::JointKind::Continuous;
            j.parent = i.checked_sub(1);
            j.axis = dynident_model::Vec3([0.0, 0.0, 1.0]);
            j
        })
        .collect();
    let model = dynident_model::Model::new("x", t.base().clone(), joints, t.bodies().to_vec()).unwrap();
    let n = 512;
    let mut array = || (0..7 * n).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
    let (q, dq, ddq) = (array(), array(), array());
    let s = |a: &[f64], i: usize| -> [f64; 7] { a[7 * i..7 * i + 7].try_into().unwrap() };
    let time = |name: &str, per: usize, f: &mut dyn FnMut()| {
        let mut best = f64::MAX;
        for _ in 0..200 {
            let t = Instant::now();
            f();
            best = best.min(t.elapsed().as_nanos() as f64 / per as f64);
        }
        println!("{name:40} {best:8.1} ns");
    };
    for level in Level::available() {
        let mut ws = Workspace::with_level(&model, level);
        let mut sink = 0.0;
        println!("{}", level.name());
        time("rnea", n, &mut || {
            for i in 0..n {
                sink += inverse_dynamics(&model, &mut ws, &s(&q, i), &s(&dq, i), &s(&ddq, i))[0];
            }
        });
        time("crba", n, &mut || {
            for i in 0..n {
                sink += mass_matrix(&model, &mut ws, &s(&q, i))[0];
            }
        });
        time("aba", n, &mut || {
            for i in 0..n {
                sink += forward_dynamics(&model, &mut ws, &s(&q, i), &s(&dq, i), &s(&ddq, i))[0];
            }
        });
        time("regressor", n, &mut || {
            for i in 0..n {
                sink += torque_regressor(&model, &mut ws, &s(&q, i), &s(&dq, i), &s(&ddq, i))[0];
            }
        });
        time("derivatives", n, &mut || {
            for i in 0..n {
                sink +=
                    inverse_dynamics_derivatives(&model, &mut ws, &s(&q, i), &s(&dq, i), &s(&ddq, i)).by_position[0];
            }
        });
        let mut b = BatchWorkspace::with_level(&model, level);
        for samples in [16, 32, 64, 72, 128] {
            let layout = PanelLayout::new(&model, all_columns(&model, &[]));
            let mut panels = Panels::default();
            let mut tau = vec![0.0; 7 * samples];
            let w = 7 * samples;
            let c = n / samples;
            let per = c * samples;
            let m = |k: usize| JointMotion {
                samples,
                q: &q[k * w..(k + 1) * w],
                dq: &dq[k * w..(k + 1) * w],
                ddq: &ddq[k * w..(k + 1) * w],
            };
            time(&format!("rnea batch {samples}"), per, &mut || {
                for k in 0..c {
                    inverse_dynamics_batch(&model, &mut b, &m(k), &mut tau);
                    sink += tau[0];
                }
            });
            time(&format!("regressor batch {samples}"), per, &mut || {
                for k in 0..c {
                    regressor_panels(&model, &mut b, &layout, &m(k), &mut panels);
                    sink += panels.joint(0)[0];
                }
            });
        }
        if sink == 1.25 {
            println!("{sink}");
        }
    }
}
