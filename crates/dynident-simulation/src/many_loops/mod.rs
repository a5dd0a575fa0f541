//! Many closed loops at once: Monte Carlo over robots, starts, references, gains and seeds.

mod lane_loop;
mod tape;

use crate::closed_loop::{Beginning, LoopSettings, closed_loop};
use crate::controllers::Controller;
use crate::error::SimulationError;
use crate::plant::Plant;
use crate::reference::Reference;
use crate::run::Run;
use dynident_lanes::{Level, dispatch};
use lane_loop::LaneLoops;
use rayon::prelude::*;

/// One of many loops: what [`closed_loop()`] takes. Robot, reference and settings may be shared by any number of loops.
#[derive(Debug)]
pub struct ClosedLoop<'a> {
    /// The robot. It is left as it is: every loop runs on one of its own.
    pub plant: &'a Plant,
    /// The controller, reset before the run.
    pub controller: &'a mut dyn Controller,
    /// What is to be followed, and how often a second.
    pub reference: &'a Reference,
    /// How the run is made.
    pub settings: &'a LoopSettings,
}

/// Runs many closed loops, side by side and on all processors, and gives what `each` makes of their runs, in the order
/// of the loops. `each` gets a loop's place and its [`Run`] as soon as this has ended, in any order and from any
/// thread; what it drops is not kept: of a million runs only what is asked of them needs room.
///
/// **Every run is to the last bit the one that [`closed_loop()`] gives**, whatever other loops there are, in whatever
/// order, on any number of threads; across processor levels results differ as those of [`closed_loop()`] do.
///
/// Loops whose robots have the same tree and terms that act on the same joints (their values may differ) stand side by
/// side in the processor's lanes, four or eight at a time, and take every step together: rigid bodies, drive inertia,
/// viscous friction and constant torques, by semi-implicit Euler or Runge-Kutta. Joint PD that sees the true state goes
/// over lanes as well; other controllers and sensors are called loop by loop, between steps that go over lanes. A run
/// that ends early gives its lane to the next. All other loops run one by one: with dry friction, springs that slip,
/// declared torques, disturbances, locked joints, joints that follow others, or steps of controlled length; of a tree
/// that no other loop has; and those whose motion blows up, from their start.
///
/// ```
/// use dynident_model::{InertialParameters, Mat3, Vec3, sample::planar_2r};
/// use dynident_simulation::controllers::{JointPd, JointPdSettings};
/// use dynident_simulation::{ClosedLoop, LoopSettings, Plant, Reference, Start, closed_loops};
///
/// let rod = InertialParameters::from_centre_of_mass(1.0, Vec3([1.0, 0.0, 0.0]), &Mat3::ZERO);
/// let plant = Plant::new(&planar_2r(1.0, rod, rod), &[], &[])?;
/// let reference = Reference::standing(&[-1.5, 0.0], 1000.0, 1.0)?;
/// // From twenty postures, with gains that grow.
/// let settings: Vec<LoopSettings> = (0..20)
///     .map(|k| Start::At { q: vec![-1.5 + 0.02 * f64::from(k), 0.0], dq: vec![0.0, 0.0] })
///     .map(|start| LoopSettings { start, ..LoopSettings::default() })
///     .collect();
/// let gains = |k: usize| JointPdSettings { kp: (400.0 + 10.0 * k as f64).into(), kd: 80.0.into() };
/// let mut controllers = (0..20).map(|k| JointPd::new(2, &gains(k))).collect::<Result<Vec<_>, _>>()?;
/// let mut loops: Vec<ClosedLoop<'_>> = controllers
///     .iter_mut()
///     .zip(&settings)
///     .map(|(controller, settings)| ClosedLoop { plant: &plant, controller, reference: &reference, settings })
///     .collect();
/// let worst = closed_loops(&mut loops, |_, run| run.max_error[0])?;
/// assert!(worst.len() == 20 && worst[19] > worst[0]);
/// # Ok::<(), dynident_simulation::SimulationError>(())
/// ```
///
/// # Errors
/// [`SimulationError::Loop`] with the place of the first loop that [`closed_loop()`] would refuse; no loop is run then.
/// What happens during a run is its [`RunStatus`](crate::RunStatus).
pub fn closed_loops<R: Send>(
    loops: &mut [ClosedLoop<'_>],
    each: impl Fn(usize, Run) -> R + Sync,
) -> Result<Vec<R>, SimulationError> {
    for (index, one) in loops.iter().enumerate() {
        Beginning::of(one.plant, one.controller, one.reference, one.settings)
            .map_err(|source| SimulationError::Loop { index, source: Box::new(source) })?;
    }
    let count = loops.len();
    let level = Level::detect();
    let mut shares: Vec<Share<'_, '_>> = groups(loops).into_iter().flat_map(|group| shared_out(group, level)).collect();
    let run = |share: &mut Share<'_, '_>| share.run(level, &each);
    // With one thread everything stays in the caller's.
    let results: Vec<Vec<(usize, R)>> = if rayon::current_num_threads() == 1 {
        shares.iter_mut().map(run).collect()
    } else {
        shares.par_iter_mut().map(run).collect()
    };
    let mut results: Vec<(usize, R)> = results.into_iter().flatten().collect();
    debug_assert_eq!(results.len(), count);
    results.sort_unstable_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

/// A loop and its place among all.
type Placed<'s, 'a> = (usize, &'s mut ClosedLoop<'a>);

/// Loops that can stand side by side; or one that runs by itself.
struct Group<'s, 'a> {
    loops: Vec<Placed<'s, 'a>>,
    over_lanes: bool,
}

/// What one thread takes at a time.
type Share<'s, 'a> = Group<'s, 'a>;

/// Sorts loops into those that can stand side by side, each in the order in which they came.
fn groups<'s, 'a>(loops: &'s mut [ClosedLoop<'a>]) -> Vec<Group<'s, 'a>> {
    let mut groups: Vec<Group<'s, 'a>> = Vec::new();
    for (index, one) in loops.iter_mut().enumerate() {
        let over_lanes = one.plant.goes_over_lanes(one.settings.integrator);
        let fits = |group: &&mut Group<'_, '_>| {
            group.over_lanes && group.loops.first().is_some_and(|(_, other)| stand_beside(one, other))
        };
        match groups.iter_mut().rev().find(fits) {
            Some(group) if over_lanes => group.loops.push((index, one)),
            _ => groups.push(Group { loops: vec![(index, one)], over_lanes }),
        }
    }
    groups
}

fn stand_beside(one: &ClosedLoop<'_>, other: &ClosedLoop<'_>) -> bool {
    one.settings.integrator == other.settings.integrator
        && one.settings.accelerations == other.settings.accelerations
        && is_plain(one) == is_plain(other)
        && (core::ptr::eq(one.plant, other.plant) || one.plant.stands_beside(other.plant))
}

/// Whether controller and sensors go over lanes too: joint PD of the true state.
fn is_plain(one: &ClosedLoop<'_>) -> bool {
    one.controller.joint_gains().is_some() && one.settings.sensors.see_the_truth(one.plant.dof())
}

/// Some shares for each thread, of whole lanes; a loop that stands alone in its group runs by itself.
fn shared_out<'s, 'a>(mut group: Group<'s, 'a>, level: Level) -> Vec<Share<'s, 'a>> {
    let (count, lanes) = (group.loops.len(), level.lanes());
    let over_lanes = group.over_lanes && count > 1;
    let size = count.div_ceil(4 * rayon::current_num_threads()).next_multiple_of(lanes);
    let mut shares = Vec::new();
    while !group.loops.is_empty() {
        let rest = group.loops.split_off(size.min(group.loops.len()));
        shares.push(Group { loops: core::mem::replace(&mut group.loops, rest), over_lanes });
    }
    shares
}

impl Share<'_, '_> {
    fn run<R>(&mut self, level: Level, each: &(impl Fn(usize, Run) -> R + Sync)) -> Vec<(usize, R)> {
        let mut results = Vec::with_capacity(self.loops.len());
        let mut alone: Vec<usize> = (0..self.loops.len()).collect();
        if self.over_lanes {
            alone.clear();
            let mut ended = |place: usize, index: usize, run: Option<Run>| match run {
                Some(run) => results.push((index, each(index, run))),
                None => alone.push(place),
            };
            dispatch(level, LaneLoops { loops: &mut self.loops, ended: &mut ended });
        }
        let mut own: Option<(&Plant, Plant)> = None;
        for place in alone {
            let (index, one) = &mut self.loops[place];
            // Loops of one robot run on one copy of it.
            let (_, plant) = match own.take() {
                Some(same) if core::ptr::eq(same.0, one.plant) => own.insert(same),
                _ => own.insert((one.plant, one.plant.clone())),
            };
            // Its settings were found good before.
            if let Ok(run) = closed_loop(plant, &mut *one.controller, one.reference, one.settings) {
                results.push((*index, each(*index, run)));
            }
        }
        results
    }
}
