//! Golden files of other programs, in the order of Dynident's model. `golden/README.md` explains every key.

use dynident_model::{Model, load_robot};
use dynident_testing::repository;
use serde_json::Value;

/// The robots of `robots/`, each with a golden file of Pinocchio.
pub(crate) const ROBOTS: [&str; 8] =
    ["planar2r", "ur10", "panda", "panda_arm7", "iiwa14", "g1_29dof", "talos_reduced", "talos_full_v2"];

/// Robots with at most nine joints, whose files contain full regressors, derivatives and base parameters.
pub(crate) const ARMS: [&str; 5] = ["planar2r", "ur10", "panda", "panda_arm7", "iiwa14"];

/// A robot with independent joints, as in the files of the other programs.
pub(crate) fn robot(name: &str) -> Model {
    load_robot(repository(&format!("robots/{name}.urdf"))).unwrap().model.without_followers()
}

pub(crate) struct Golden {
    pub(crate) model: Model,
    pub(crate) file: Value,
    /// `theirs[j]`: index in the file's vectors of joint `j` of the model.
    theirs: Vec<usize>,
}

impl Golden {
    /// The file of `program` (`pinocchio`, `mujoco`) for a robot.
    pub(crate) fn of(program: &str, name: &'static str) -> Self {
        let path = repository(&format!("golden/{program}/{name}.json"));
        let file: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let model = robot(name);
        let names: Vec<&str> = file["joints"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
        assert_eq!(names.len(), model.dof(), "{name}: joints");
        let theirs = model
            .joints()
            .iter()
            .map(|joint| names.iter().position(|name| *name == joint.name).expect("the same joint names"))
            .collect();
        Self { model, file, theirs }
    }

    pub(crate) fn states(&self) -> &[Value] {
        self.file["states"].as_array().unwrap()
    }

    pub(crate) fn vector(&self, value: &Value) -> Vec<f64> {
        let theirs = numbers(value);
        self.theirs.iter().map(|&k| theirs[k]).collect()
    }

    pub(crate) fn parameters(&self, value: &Value) -> Vec<f64> {
        let theirs = numbers(value);
        self.theirs.iter().flat_map(|&k| theirs[10 * k..10 * k + 10].to_vec()).collect()
    }

    /// A matrix with a row and a column per joint, row-major.
    pub(crate) fn square(&self, value: &Value) -> Vec<f64> {
        let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
        self.theirs.iter().flat_map(|&i| self.theirs.iter().map(|&j| rows[i][j]).collect::<Vec<_>>()).collect()
    }

    /// A symmetric matrix from the file's lower triangle.
    pub(crate) fn symmetric(&self, value: &Value) -> Vec<f64> {
        let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
        let entry = |i: usize, j: usize| rows[i.max(j)][i.min(j)];
        self.theirs.iter().flat_map(|&i| self.theirs.iter().map(|&j| entry(i, j)).collect::<Vec<_>>()).collect()
    }

    /// A matrix with a row per joint and ten columns per body, row-major.
    pub(crate) fn regressor(&self, value: &Value) -> Vec<f64> {
        let rows = value.as_array().unwrap();
        self.theirs.iter().flat_map(|&i| self.parameters(&rows[i])).collect()
    }
}

pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

pub(crate) fn text(value: &Value) -> &str {
    value.as_str().unwrap()
}

/// Asserts that every entry is within `tolerance` of the golden array's largest entry, and returns the largest
/// deviation in that unit.
pub(crate) fn assert_close(ours: &[f64], golden: &[f64], tolerance: f64, what: &str) -> f64 {
    assert_eq!(ours.len(), golden.len(), "{what}: lengths");
    let scale = golden.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let mut worst = 0.0_f64;
    for (k, (x, y)) in ours.iter().zip(golden).enumerate() {
        let deviation = (x - y).abs();
        assert!(deviation <= tolerance * scale, "{what}: entry {k}: {x} against {y}, largest entry {scale}");
        worst = worst.max(if scale > 0.0 { deviation / scale } else { 0.0 });
    }
    worst
}

/// Asserts equality up to a share of the largest expected number.
pub(crate) fn close(relative: f64, ours: &[f64], theirs: &[f64], what: &str) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let scale = theirs.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() <= relative * scale, "{what}: {a} is not {b}, of at most {scale}");
    }
}
