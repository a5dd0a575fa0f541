//! The identified drives as simulator files represent them, and the errors of the simulated motion.

use super::{Found, RoleRun};
use crate::result::{ServoDrive, ServoFile, ServoForm, ServoFormLog};
use dynident_identification::Role;
use dynident_servo::{Drive, DriveLaw, ServoError, ServoRobot, errors, simulate_with_law};
use rayon::prelude::*;

/// Smallest part of a joint's friction that must depend on transmitted torque or velocity to be mentioned.
const VARIABLE_FRICTION: f64 = 0.01;

/// A file format, and how its drives are simulated.
struct Form {
    name: &'static str,
    law: DriveLaw,
    step_s: f64,
    delay: FormDelay,
}

/// Delay of the drives in a file format.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FormDelay {
    None,
    Seconds,
    Steps,
}

/// Simulates all logs with the drives as each file format represents them.
///
/// # Errors
/// Runs that do not fit the robot.
pub(super) fn forms(
    file: &ServoFile,
    runs: &[RoleRun],
    found: &Found,
    [step_s, physics_step_s]: [f64; 2],
) -> Result<Vec<ServoForm>, ServoError> {
    let all = [
        Form { name: "isaac-lab-implicit", law: DriveLaw::Implicit, step_s: physics_step_s, delay: FormDelay::None },
        Form { name: "isaac-lab-delayed", law: DriveLaw::Explicit, step_s: physics_step_s, delay: FormDelay::Steps },
        Form { name: "mjcf", law: DriveLaw::Identified, step_s, delay: FormDelay::Seconds },
    ];
    all.iter().map(|form| written(form, file, runs, found)).collect()
}

fn written(form: &Form, file: &ServoFile, runs: &[RoleRun], found: &Found) -> Result<ServoForm, ServoError> {
    let steps = |drive: &Drive| (effective_delay(drive) / form.step_s).round() as u32;
    let of_joint = |(drive, stored): (&Drive, &ServoDrive)| Drive {
        coulomb: stored.mean_friction,
        load_friction: 0.0,
        stribeck: 0.0,
        profile_acceleration: f64::INFINITY,
        profile_speed: f64::INFINITY,
        delay_s: match form.delay {
            FormDelay::None => 0.0,
            FormDelay::Seconds => effective_delay(drive),
            FormDelay::Steps => f64::from(steps(drive)) * form.step_s,
        },
        read_delay_s: 0.0,
        zero: 0.0,
        ..*drive
    };
    let drives = found.robot.drives.iter().zip(&file.drives).map(of_joint).collect();
    let robot = ServoRobot { drives, ..found.robot.clone() };
    let log = |(run, simulated): (&RoleRun, &Option<Vec<Vec<f64>>>)| -> Result<Option<ServoFormLog>, ServoError> {
        let motion = simulate_with_law(&robot, &run.run, form.step_s, form.law)?;
        Ok(simulated.as_ref().map(|simulated| ServoFormLog {
            name: run.run.name.clone(),
            held_out: run.role == Role::Validate,
            errors: motion.map(|motion| errors(&run.run, &motion)),
            model_errors: errors(&run.run, simulated),
        }))
    };
    let logs: Vec<Option<ServoFormLog>> = runs.par_iter().zip(&found.simulated).map(log).collect::<Result<_, _>>()?;
    let delay_steps = match form.delay {
        FormDelay::Steps => found.robot.drives.iter().map(steps).collect(),
        FormDelay::None | FormDelay::Seconds => Vec::new(),
    };
    Ok(ServoForm {
        form: form.name.to_owned(),
        step_s: form.step_s,
        lost: lost(form, &delay_steps, file, found),
        delay_steps,
        logs: logs.into_iter().flatten().collect(),
    })
}

/// Time from a command to its measurement, because simulators read positions without a delay.
fn effective_delay(drive: &Drive) -> f64 {
    (drive.delay_s - drive.read_delay_s).max(0.0)
}

/// Parts of the drives that a file format lacks or represents by another law.
fn lost(form: &Form, delay_steps: &[u32], file: &ServoFile, found: &Found) -> Vec<String> {
    let drives = &found.robot.drives;
    let list = |items: Vec<String>| items.join(", ");
    let of_joints = |of: &dyn Fn(usize) -> Option<String>| -> Vec<String> {
        file.joints.iter().enumerate().filter_map(|(joint, name)| Some(format!("{name} {}", of(joint)?))).collect()
    };
    let milliseconds = |seconds: f64| format!("{:.1} ms", 1e3 * seconds);
    let mut all = Vec::new();
    let delayed = of_joints(&|joint| {
        let delay = effective_delay(&drives[joint]);
        (delay > 0.0).then(|| milliseconds(delay))
    });
    match form.delay {
        FormDelay::None if !delayed.is_empty() => {
            all.push(format!("without the delay from a command to the motion ({})", list(delayed)));
        }
        FormDelay::Steps if !delayed.is_empty() => {
            let rounded = of_joints(&|joint| Some(milliseconds(f64::from(delay_steps[joint]) * form.step_s)));
            all.push(format!(
                "delays are rounded to physics steps of {} ({} in place of {})",
                milliseconds(form.step_s),
                list(rounded),
                list(delayed)
            ));
        }
        FormDelay::None | FormDelay::Seconds | FormDelay::Steps => {}
    }
    let variable = of_joints(&|joint| {
        let (drive, mean) = (&drives[joint], file.drives[joint].mean_friction);
        let part = drive.load_friction * file.drives[joint].mean_load + drive.stribeck;
        let unit = if file.rotary[joint] { "Nm" } else { "N" };
        (part > VARIABLE_FRICTION * mean).then(|| format!("{mean:.3} {unit}"))
    });
    if !variable.is_empty() {
        all.push(format!(
            "friction that grows with load and at rest is replaced by its mean over the training logs ({})",
            list(variable)
        ));
    }
    if drives.iter().any(|drive| drive.profile_acceleration.is_finite() || drive.profile_speed.is_finite()) {
        all.push("without the limits of the set point's acceleration and speed".to_owned());
    }
    if form.law != DriveLaw::Identified && drives.iter().any(|drive| drive.torque_limit.is_finite()) {
        all.push("the torque limit applies to stiffness and damping together, not to the stiffness alone".to_owned());
    }
    let zeros = of_joints(&|joint| {
        let zero = drives[joint].zero;
        (zero != 0.0).then(|| format!("{:.1} {}", 1e3 * zero, if file.rotary[joint] { "mrad" } else { "mm" }))
    });
    if !zeros.is_empty() {
        all.push(format!("without the zeros of the joints ({})", list(zeros)));
    }
    if found.robot.floor.is_some() {
        all.push("the floor of the study belongs to the scene; it is included in the simulated motion".to_owned());
    }
    all
}
