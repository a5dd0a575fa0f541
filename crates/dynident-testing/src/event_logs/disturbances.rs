//! Torque of events, and faults of a recorder.

use super::paths::smoothed;
use super::{Path, RATE_HZ, Scene, Simulated, Truth};
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, Model, Vec3};

impl Truth {
    /// Adds the torque of an event.
    pub(super) fn add_event(
        &self,
        scene: Scene,
        path: &Path,
        tau: &mut Path,
        start_s: f64,
        out: &mut Simulated,
        random: &mut Random,
    ) {
        let samples = path[0].len();
        let last_s = (samples - 1) as f64 / RATE_HZ;
        let dof = path.len();
        let unit = {
            let vector: Vec<f64> = (0..3).map(|_| random.normal()).collect();
            let size = vector.iter().map(|value| value * value).sum::<f64>().sqrt();
            Vec3::new(vector[0] / size, vector[1] / size, vector[2] / size)
        };
        let size = self.size().max(0.4);
        let mut push = |body: usize, newtons: f64, [from, to]: [f64; 2]| {
            let mut workspace = Workspace::new(&self.model);
            for k in (from * RATE_HZ) as usize..((to * RATE_HZ) as usize).min(samples) {
                let t = k as f64 / RATE_HZ;
                let ramp = ((t - from) / 0.03).min((to - t) / 0.03).clamp(0.0, 1.0);
                let q: Vec<f64> = path.iter().map(|q| q[k]).collect();
                let torque = torque_of_force(&self.model, &mut workspace, &q, body, unit.scale(ramp * newtons));
                tau.iter_mut().zip(torque).for_each(|(tau, value)| tau[k] += value);
            }
            out.intervals.push([from, to]);
        };
        match scene {
            Scene::Collision => push(dof - 1, 85.0 * size, [start_s, start_s + 0.4]),
            Scene::Push => push(dof / 2, 110.0 * size, [start_s, start_s + 0.8]),
            Scene::HandGuiding => push(dof - 1, 40.0 * size, [start_s, start_s + 6.0]),
            Scene::DrivesOff | Scene::EmergencyStop => {
                let [from, to] = out.intervals[0];
                for k in (from * RATE_HZ) as usize..((to * RATE_HZ) as usize + 1).min(samples) {
                    for tau in tau.iter_mut() {
                        tau[k] = 0.0;
                    }
                }
            }
            Scene::LoadChange => {
                let from = start_s + 4.0;
                let other = Self::rigid(path, &loaded(&self.model, 4.0 * size));
                let plain = Self::rigid(path, &self.model);
                for k in (from * RATE_HZ) as usize..samples {
                    for joint in 0..dof {
                        tau[joint][k] += other[joint][k] - plain[joint][k];
                    }
                }
                out.intervals.push([from, last_s]);
            }
            Scene::OffsetChange => {
                let from = start_s + 4.0;
                for tau in &mut tau[1][(from * RATE_HZ) as usize..] {
                    *tau += 0.2 * self.scale[1];
                }
                out.intervals.push([from, last_s]);
            }
            Scene::Drift => {
                for (k, tau) in tau[1].iter_mut().enumerate() {
                    *tau += 0.25 * self.scale[1] * (1.0 - (-(k as f64) / RATE_HZ / 10.0).exp());
                }
                out.intervals.push([0.0, last_s]);
            }
            Scene::WarmUp => out.intervals.push([0.0, last_s]),
            _ => {}
        }
    }
}

/// `τ = Jᵀ f` of a force in the base frame at the origin of the body and 0.1 m along its z axis.
fn torque_of_force(model: &Model, workspace: &mut Workspace, q: &[f64], body: usize, force: Vec3) -> Vec<f64> {
    let placements = body_placements(model, workspace, q);
    let at = placements[body].point(Vec3::new(0.0, 0.0, 0.1));
    let of_joint = |joint: usize| {
        if !model.moves(joint, body) {
            return 0.0;
        }
        let own = &placements[model.body_of(joint)];
        let axis = own.rotation.mul_vec(model.joints()[joint].axis);
        let origin = own.translation;
        let arm = Vec3::new(at.0[0] - origin.0[0], at.0[1] - origin.0[1], at.0[2] - origin.0[2]);
        axis.dot(arm.cross(force))
    };
    (0..model.dof()).map(of_joint).collect()
}

/// The robot with a point mass 0.1 m along the z axis of the last link.
pub(super) fn loaded(model: &Model, kilograms: f64) -> Model {
    let mut inertials = model.inertials().to_vec();
    let last = inertials.len() - 1;
    let load = InertialParameters::from_centre_of_mass(
        kilograms,
        Vec3::new(0.02, 0.01, 0.1),
        &dynident_model::Mat3::IDENTITY.scale(0.002 * kilograms),
    );
    inertials[last] = InertialParameters(std::array::from_fn(|k| inertials[last].0[k] + load.0[k]));
    model.with_inertials(&inertials).expect("a load is a valid body")
}

pub(super) fn fill_holes(log: &mut Simulated, random: &mut Random) {
    for hole in 0..8 {
        let from_s = 2.5 + 2.4 * f64::from(hole) + random.uniform(0.0, 1.0);
        let to_s = from_s + random.uniform(0.25, 0.6);
        let (from, to) = ((from_s * RATE_HZ) as usize, (to_s * RATE_HZ) as usize);
        for values in log.q.iter_mut().chain(&mut log.tau) {
            let (before, after) = (values[from - 1], values[to]);
            for at in from..to {
                values[at] = before + (after - before) * (at + 1 - from) as f64 / (to + 1 - from) as f64;
            }
        }
        log.intervals.push([from as f64 / RATE_HZ, to as f64 / RATE_HZ]);
    }
}

/// The torque of joint 2 wraps slightly below its largest value.
pub(super) fn overflow(log: &mut Simulated) {
    let tau = &mut log.tau[1];
    let size = smoothed(tau, 10).iter().fold(0.0_f64, |size, tau| size.max(tau.abs()));
    let limit = 0.85 * size;
    let wrapped = |tau: f64| tau - 2.0 * limit * ((tau + limit) / (2.0 * limit)).floor();
    let mut since: Option<usize> = None;
    for k in 0..tau.len() {
        let is_over = tau[k].abs() > limit;
        tau[k] = wrapped(tau[k]);
        match (is_over, since) {
            (true, None) => {
                since = Some(k);
                log.intervals.push([k as f64 / RATE_HZ, k as f64 / RATE_HZ]);
            }
            (true, Some(_)) => log.intervals.last_mut().expect("just added")[1] = k as f64 / RATE_HZ,
            (false, _) => since = None,
        }
    }
    // Noise crosses the limit several times.
    let mut merged: Vec<[f64; 2]> = Vec::new();
    for [from, to] in log.intervals.drain(..) {
        match merged.last_mut() {
            Some(last) if from - last[1] < 0.3 => last[1] = to,
            _ => merged.push([from, to]),
        }
    }
    log.intervals = merged;
}
