//! First values of the drives for the search, from the response of each joint to its commands.
//!
//! Each joint is approximated separately by `ẍ = ω² (r - x) - 2 ζ ω ẋ`, with the position x, the delayed command `r`,
//! the natural frequency ω and the damping ratio ζ. The best combination of ω, ζ and delay on a grid gives stiffness
//! and damping, together with the mean inertia of the joint during the motion.

use crate::command::{HeldCommand, Reach, SetPoint};
use crate::drive::Drive;
use crate::parameters::{Change, FreeParameter, ServoRobot, robot_value};
use crate::quantity::Quantity;
use crate::run::Run;
use dynident_dynamics::{Workspace, mass_matrix};
use dynident_model::Model;
use rayon::prelude::*;

/// Natural frequencies on the grid, rad/s.
const FREQUENCIES: [f64; 9] = [3.0, 5.0, 8.0, 13.0, 20.0, 32.0, 50.0, 80.0, 130.0];
/// Damping ratios on the grid.
const RATIOS: [f64; 6] = [0.3, 0.6, 1.0, 1.6, 2.5, 4.0];
/// Maximum number of samples of a run that are used, to save time.
const MOST_SAMPLES: usize = 1500;
/// Share of a joint's inertia that is first attributed to the drive.
const DRIVE_PART: f64 = 0.5;
/// First value of the friction, relative to the stiffness times the median distance from the command.
const FRICTION_PART: f64 = 0.3;
/// Velocity at which most of the Stribeck effect has disappeared, rad/s (m/s); from Rhoban's servo models.
const STRIBECK_SPEED: f64 = 0.1;
/// Delay of a typical servo, s.
const TYPICAL_DELAY_S: f64 = 0.01;
/// Delays on the grid, s.
const DELAYS_S: [f64; 5] = [0.0, 0.01, 0.02, 0.04, 0.06];

impl Drive {
    /// A drive with these values (in the units of the fields), typical values for other friction and delay, and no
    /// torque limit.
    pub fn typical(stiffness: f64, damping: f64, armature: f64, coulomb: f64) -> Self {
        Self {
            stiffness,
            damping,
            armature,
            coulomb,
            load_friction: 0.1,
            stribeck: 0.3 * coulomb,
            stribeck_speed: STRIBECK_SPEED,
            torque_limit: f64::INFINITY,
            profile_acceleration: f64::INFINITY,
            profile_speed: f64::INFINITY,
            delay_s: TYPICAL_DELAY_S,
            read_delay_s: 0.0,
            zero: 0.0,
        }
    }
}

/// First values of all drives. They are equal if all joints have the same type of servo (`alike`). Profile limits are
/// taken from `stated`.
pub fn start_drives(model: &Model, runs: &[Run], stated: &[Drive], alike: bool) -> Vec<Drive> {
    let runs: &[Run] = &runs.iter().map(|run| behind_profiles(run, stated)).collect::<Vec<_>>();
    let mut inertias = mean_inertias(model, runs);
    if !alike {
        // The drive of a light distal link has more inertia than the link. Therefore the geometric mean of the joint's
        // own inertia and the mean over all joints is used.
        let mean = inertias.iter().sum::<f64>() / inertias.len() as f64;
        for inertia in &mut inertias {
            *inertia = (*inertia * mean).sqrt();
        }
    }
    let mut drives: Vec<Drive> = (0..model.dof())
        .map(|joint| {
            let Response { frequency, ratio, delay_s } = response(runs, joint);
            let inertia = inertias[joint] / (1.0 - DRIVE_PART);
            let stiffness = inertia * frequency * frequency;
            let friction = FRICTION_PART * stiffness * median_distance(runs, joint);
            let drive = Drive::typical(stiffness, 2.0 * ratio * frequency * inertia, DRIVE_PART * inertia, friction);
            let Drive { profile_acceleration, profile_speed, .. } = stated[joint];
            Drive { profile_acceleration, profile_speed, delay_s, ..drive }
        })
        .collect();
    // The delays are caused by the common electronics, so all joints get the same value.
    let mut delays: Vec<f64> = drives.iter().map(|drive| drive.delay_s).collect();
    delays.sort_by(f64::total_cmp);
    for drive in &mut drives {
        drive.delay_s = delays[delays.len() / 2];
    }
    if alike { equal_drives(&drives) } else { drives }
}

/// The run with its commands replaced by the set points of the drives' profiles.
fn behind_profiles(run: &Run, drives: &[Drive]) -> Run {
    let times = &run.times_s;
    let commands = run.commands.iter().zip(drives).map(|(commands, drive)| {
        let mut set_point = SetPoint::new(times, commands, drive, false);
        let mut shaped: Vec<f64> =
            times.windows(2).map(|pair| set_point.during(pair[0], pair[1], Reach::UNLIMITED).mean).collect();
        shaped.extend(commands.last());
        shaped
    });
    Run { commands: commands.collect(), ..run.clone() }
}

/// Mean diagonal of the mass matrix over the motion of the runs.
fn mean_inertias(model: &Model, runs: &[Run]) -> Vec<f64> {
    let dof = model.dof();
    let mut workspace = Workspace::new(model);
    let (mut sums, mut count) = (vec![0.0; dof], 0.0);
    for run in runs {
        for sample in (0..run.times_s.len()).step_by((run.times_s.len() / 50).max(1)) {
            let q: Vec<f64> = run.positions.iter().map(|joint| joint[sample]).collect();
            let matrix = mass_matrix(model, &mut workspace, &q);
            for (joint, sum) in sums.iter_mut().enumerate() {
                *sum += matrix[joint * dof + joint];
            }
            count += 1.0;
        }
    }
    // The drive of a joint without mass behind it still has inertia.
    sums.iter().map(|sum| (sum / count).max(1e-6)).collect()
}

fn median_distance(runs: &[Run], joint: usize) -> f64 {
    let mut distances: Vec<f64> = runs
        .iter()
        .flat_map(|run| run.commands[joint].iter().zip(&run.positions[joint]).map(|pair| (run.gain(joint), pair)))
        .map(|(gain, (command, position))| gain * (command - position).abs())
        .collect();
    distances.sort_by(f64::total_cmp);
    distances[distances.len() / 2].max(1e-5)
}

/// Coordinates at which the drives have the values from the responses of the joints, as another start of the search if
/// the nominal drives are far from the real ones. Values that several joints share get the mean. Unless `with_own` is
/// set, the deviations of single joints from the mean are zero.
pub(crate) fn response_coordinates(
    nominal: &ServoRobot,
    parameters: &[FreeParameter],
    runs: &[Run],
    with_own: bool,
) -> Vec<f64> {
    let drives = start_drives(&nominal.model, runs, &nominal.drives, false);
    let responses = ServoRobot { drives, ..nominal.clone() };
    let is_found = |quantity: Quantity| {
        matches!(
            quantity,
            Quantity::Stiffness
                | Quantity::Damping
                | Quantity::Armature
                | Quantity::Coulomb
                | Quantity::Stribeck
                | Quantity::Delay
        )
    };
    drive_coordinates(nominal, parameters, &responses, is_found, with_own)
}

/// Coordinates at which the drives of `nominal` have the values of `robot`, for the quantities that `is_found` selects;
/// other coordinates are zero. A value that several joints share gets the mean over the joints. If `with_own` is set,
/// each joint also gets its deviation from the mean.
pub(crate) fn drive_coordinates(
    nominal: &ServoRobot,
    parameters: &[FreeParameter],
    robot: &ServoRobot,
    is_found: impl Fn(Quantity) -> bool,
    with_own: bool,
) -> Vec<f64> {
    let dof = nominal.model.dof();
    let all: Vec<usize> = (0..dof).collect();
    let is_shared = |quantity: Quantity| {
        parameters.iter().any(|other| other.quantity == quantity && other.members.len() == dof && dof > 1)
    };
    let coordinate = |parameter: &FreeParameter| {
        let quantity = parameter.quantity;
        let is_own = parameter.members.len() == 1 && is_shared(quantity);
        if !quantity.is_of_drive() || !is_found(quantity) || (is_own && !with_own) {
            return 0.0;
        }
        let difference = |joint: usize| {
            let [found, stated] = [robot, nominal].map(|robot| robot_value(robot, quantity, joint));
            match parameter.change {
                Change::Factor => (found / stated).ln(),
                Change::Sum => found - stated,
            }
        };
        let mean = |joints: &[usize]| joints.iter().map(|&joint| difference(joint)).sum::<f64>() / joints.len() as f64;
        let common = if is_own { mean(&all) } else { 0.0 };
        let own = mean(&parameter.members) - common;
        if own.is_finite() { own } else { 0.0 }
    };
    parameters.iter().map(coordinate).collect()
}

/// Drives with equal values: the means over the joints. Profile limits, torque limits and zeros are unchanged; the
/// delay is that of the first drive.
pub(crate) fn equal_drives(drives: &[Drive]) -> Vec<Drive> {
    let mean = |value: fn(&Drive) -> f64| {
        let logs = drives.iter().map(|drive| value(drive).max(f64::MIN_POSITIVE).ln());
        (logs.sum::<f64>() / drives.len() as f64).exp()
    };
    let equal = Drive {
        stiffness: mean(|drive| drive.stiffness),
        damping: mean(|drive| drive.damping),
        armature: mean(|drive| drive.armature),
        coulomb: mean(|drive| drive.coulomb),
        load_friction: mean(|drive| drive.load_friction),
        stribeck: mean(|drive| drive.stribeck),
        ..drives[0]
    };
    let with_own = |drive: &Drive| Drive {
        torque_limit: drive.torque_limit,
        profile_acceleration: drive.profile_acceleration,
        profile_speed: drive.profile_speed,
        zero: drive.zero,
        ..equal
    };
    drives.iter().map(with_own).collect()
}

/// Response of one joint: natural frequency (rad/s), damping ratio and delay.
#[derive(Clone, Copy)]
struct Response {
    frequency: f64,
    ratio: f64,
    delay_s: f64,
}

/// Response on the grid with the smallest error.
fn response(runs: &[Run], joint: usize) -> Response {
    let grid = DELAYS_S.iter().flat_map(|&delay_s| {
        FREQUENCIES
            .iter()
            .flat_map(move |&frequency| RATIOS.iter().map(move |&ratio| Response { frequency, ratio, delay_s }))
    });
    let all: Vec<Response> = grid.collect();
    let squares = |response: &Response| runs.iter().map(|run| response_error(run, joint, *response)).sum::<f64>();
    let errors: Vec<f64> = all.par_iter().map(squares).collect();
    let best = (0..all.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])).unwrap_or(0);
    all[best]
}

/// Sum of the squared errors of a response, simulated by implicit steps from stamp to stamp. The mean error is
/// subtracted, because it is the effect of gravity.
fn response_error(run: &Run, joint: usize, response: Response) -> f64 {
    let (commands, positions) = (&run.commands[joint], &run.positions[joint]);
    let Response { frequency, ratio, delay_s } = response;
    let stiffness = run.gain(joint) * frequency * frequency;
    let (mut x, mut v) = (positions[0], 0.0);
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    let mut command = HeldCommand::held(&run.times_s, commands);
    for sample in 1..run.times_s.len().min(MOST_SAMPLES) {
        let parts = 4.0;
        let h = (run.times_s[sample] - run.times_s[sample - 1]) / parts;
        for part in 0..parts as usize {
            let from = run.times_s[sample - 1] + h * part as f64 - delay_s;
            let pull = stiffness * (command.mean(from, from + h, Reach::UNLIMITED).mean - x);
            v = (v + h * pull) / (1.0 + h * 2.0 * ratio * frequency + h * h * stiffness);
            x += h * v;
        }
        let error = positions[sample] - x;
        sum += error;
        squares += error * error;
        count += 1.0;
    }
    squares - sum * sum / count
}
