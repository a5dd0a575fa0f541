//! Robots, limits and motions that the tests share.

use dynident_excitation::Motion;
use dynident_excitation::limits::{BoxLimit, ColumnLimit, FloorLimit, JointLimit, Limits, LinkPoint, SelfCollision};
use dynident_model::sample::Random;
use dynident_model::{LoopClosure, Model};

pub(crate) fn ur10() -> Model {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
    dynident_model::load_robot(path).expect("the repository holds robots/ur10.urdf").model
}

/// A palletising arm with two closed chains: four joints follow others and have separate limits.
pub(crate) fn palletizer() -> Model {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/robots/palletizer.urdf");
    let tree = dynident_model::load_robot(path).expect("the repository holds the arm").model;
    let cut = |first: &str, second: &str, passive: [&str; 2]| LoopClosure {
        links: [first.to_owned(), second.to_owned()],
        points_m: [[0.0; 3]; 2],
        passive: passive.map(str::to_owned).to_vec(),
    };
    let cuts = [
        cut("rod_end", "forearm_back", ["elbow_joint", "rod_joint"]),
        cut("strut_end", "plate_back", ["strut_joint", "plate_joint"]),
    ];
    let followers = dynident_model::loops::followers(&tree, &cuts).expect("both are parallelograms");
    tree.with_followers(&followers).expect("what was found is there")
}

pub(crate) fn all_limits(model: &Model) -> Limits {
    let joint = |name: &String| JointLimit {
        joint: name.clone(),
        position: Some([-1.0, 1.5]),
        speed: Some(1.5),
        acceleration: Some(4.0),
        jerk: Some(20.0),
        torque: Some(40.0),
        torque_margin: 0.2,
        power_w: Some(50.0),
    };
    let points: Vec<LinkPoint> = model
        .bodies()
        .iter()
        .map(|body| LinkPoint { link: body.name().to_owned(), at_m: [0.1, -0.05, 0.2], radius_m: 0.03 })
        .collect();
    Limits {
        joints: model.joints().iter().map(|joint_of| joint(&joint_of.name)).collect(),
        boxes: vec![BoxLimit {
            x_m: Some([-0.6, 0.8]),
            z_m: Some([-0.2, 1.1]),
            points: points.clone(),
            ..BoxLimit::default()
        }],
        floor: Some(FloorLimit { height_m: 0.1, ..Default::default() }),
        column: Some(ColumnLimit { radius_m: 0.2, axis_xy_m: [0.02, -0.03], points, height_m: Some(0.6) }),
        self_collision: Some(SelfCollision::default()),
        ..Limits::default()
    }
}

/// A sum of three harmonics per joint, exact in all derivatives.
#[derive(Clone, Debug)]
pub(crate) struct Harmonics {
    /// Per joint: offset, then amplitude, angular frequency and phase of each harmonic.
    pub joints: Vec<(f64, [[f64; 3]; 3])>,
}

impl Harmonics {
    pub(crate) fn random(random: &mut Random, dof: usize, amplitude: f64) -> Self {
        let mut harmonic = |order: f64| {
            [random.uniform(-amplitude, amplitude) / order, order * random.uniform(1.0, 4.0), random.uniform(0.0, 6.0)]
        };
        let joints = (0..dof).map(|_| [harmonic(1.0), harmonic(2.0), harmonic(3.0)]).collect::<Vec<_>>();
        Self { joints: joints.into_iter().map(|harmonics| (random.uniform(-0.5, 0.5), harmonics)).collect() }
    }

    pub(crate) fn motion(&self, times_s: &[f64], out: &mut Motion) {
        out.reset(self.joints.len(), times_s.len());
        for (joint, (offset, harmonics)) in self.joints.iter().enumerate() {
            for (sample, t) in times_s.iter().enumerate() {
                let at = joint * times_s.len() + sample;
                out.q[at] = *offset;
                for [a, w, phase] in harmonics {
                    let (sin, cos) = (w * t + phase).sin_cos();
                    out.q[at] += a * sin;
                    out.dq[at] += a * w * cos;
                    out.ddq[at] -= a * w * w * sin;
                    out.dddq[at] -= a * w * w * w * cos;
                }
            }
        }
    }
}

/// `count + 1` times from 0 to `duration_s`.
pub(crate) fn grid(duration_s: f64, count: usize) -> Vec<f64> {
    (0..=count).map(|k| duration_s * k as f64 / count as f64).collect()
}
