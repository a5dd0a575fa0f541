// A simulated recording of a UR10 whose bodies are 20 % heavier than in its URDF, for the examples of this crate.

const RATE_HZ: f64 = 200.0;
const VISCOUS: f64 = 2.0;

/// The true arm.
fn true_arm(description: &dynident_model::Model) -> dynident_model::Model {
    let heavier = |body: &dynident_model::InertialParameters| {
        dynident_model::InertialParameters(body.0.map(|parameter| 1.2 * parameter))
    };
    let inertials: Vec<_> = description.inertials().iter().map(heavier).collect();
    description.with_inertials(&inertials).unwrap()
}

/// Ten seconds of positions and torques by joint, for sums of three sines with a phase shift.
fn recorded(description: &dynident_model::Model, phase: f64) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let arm = true_arm(description);
    let mut workspace = dynident_dynamics::Workspace::new(&arm);
    let (mut q, mut tau) = (vec![Vec::new(); arm.dof()], vec![Vec::new(); arm.dof()]);
    for sample in 0..2000 {
        let t = f64::from(sample) / RATE_HZ;
        let mut now = [vec![0.0; arm.dof()], vec![0.0; arm.dof()], vec![0.0; arm.dof()]];
        for joint in 0..arm.dof() {
            for harmonic in 1..=3 {
                let (k, j) = (f64::from(harmonic), joint as f64);
                let (w, amplitude) = (k * (0.7 + 0.13 * j), 0.8 / k);
                let angle = w * t + phase * k + 1.7 * j;
                now[0][joint] += amplitude * angle.sin();
                now[1][joint] += amplitude * w * angle.cos();
                now[2][joint] -= amplitude * w * w * angle.sin();
            }
        }
        let torque = dynident_dynamics::inverse_dynamics(&arm, &mut workspace, &now[0], &now[1], &now[2]);
        for joint in 0..arm.dof() {
            q[joint].push(now[0][joint]);
            tau[joint].push(torque[joint] + VISCOUS * now[1][joint]);
        }
    }
    (q, tau)
}
