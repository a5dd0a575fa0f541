//! Torque of drives in MIT mode: a sum of commands, positions and velocities with known gains.

use crate::common::{Job, repository};
use crate::new_study_mapping::rows;
use std::fmt::Write as _;
use std::path::Path;

const KP: [f64; 2] = [60.0, 25.0];
const KD: [f64; 2] = [2.0, 0.5];

/// A log with torques, and one with the commands of controllers that cause exactly these torques.
fn logs(folder: &Path) {
    let mut texts = ["t,q1,q2,tau1,tau2\n".to_owned(), "t,q1,q2,dq1,dq2,c1,c2,ff1,ff2\n".to_owned()];
    for [t, q1, q2, tau1, tau2] in rows() {
        writeln!(texts[0], "{t:?},{q1:?},{q2:?},{tau1:?},{tau2:?}").unwrap();
        let (q, tau, dq, ff) = ([q1, q2], [tau1, tau2], [(3.0 * t).sin(), (2.0 * t).cos()], [0.25 * tau1, 0.5]);
        let command: [f64; 2] = core::array::from_fn(|j| q[j] + (tau[j] - ff[j] + KD[j] * dq[j]) / KP[j]);
        let [c1, c2] = command;
        writeln!(texts[1], "{t:?},{q1:?},{q2:?},{:?},{:?},{c1:?},{c2:?},{:?},{:?}", dq[0], dq[1], ff[0], ff[1])
            .unwrap();
    }
    for (name, text) in ["torque.csv", "commands.csv"].into_iter().zip(texts) {
        std::fs::write(folder.join(name), text).unwrap();
    }
}

#[test]
fn gains_and_commands_give_the_model_of_the_measured_torque() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path());
    let sum = format!(
        "columns = [\"c{{1..2}}\", \"q{{1..2}}\", \"dq{{1..2}}\", \"ff{{1..2}}\"]\nsum = [{KP:?}, {:?}, {:?}, 1.0]",
        KP.map(|gain| -gain),
        KD.map(|gain| -gain)
    );
    let found = [("torque.csv", "columns = \"tau{1..2}\""), ("commands.csv", &sum[..])].map(|(file, torque)| {
        let text = format!(
            "[robot]\nfile = {:?}\n[format]\ntime.column = \"t\"\nposition.columns = \"q{{1..2}}\"\n\
             [format.torque]\n{torque}\n[[log]]\nfile = \"{file}\"\nfraction = [0.0, 0.65]\n\
             [[log]]\nfile = \"{file}\"\nfraction = [0.7, 1.0]\nrole = \"validate\"\n",
            repository("robots/planar2r.urdf").display().to_string()
        );
        let value = serde_json::to_value(Job::new(folder.path(), &text).identify().result).unwrap();
        let parameters = value["base_parameters"].as_array().unwrap().clone();
        parameters.iter().map(|parameter| parameter["value"].as_f64().unwrap()).collect::<Vec<f64>>()
    });
    let size = found[0].iter().fold(0.0_f64, |size, value| size.max(value.abs()));
    assert!(size > 1.0 && found[0].len() == found[1].len(), "{found:?}");
    for (measured, computed) in found[0].iter().zip(&found[1]) {
        // The torques differ by the rounding of the commands.
        assert!((measured - computed).abs() < 1e-9 * size, "{found:?}");
    }
}
