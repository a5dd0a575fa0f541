//! How much torque the dry friction of a joint may hold while the joint rests.

use dynident_dynamics::Column;
use dynident_estimation::SpeedRanges;
use dynident_model::terms::{HysteresisState, JointMotion, TermInput, TorqueTerm};
use dynident_rows::RegressorModel;

/// Speeds at which friction is looked at, from a rest's limit to a reversal's, equally far apart by factors.
const SPEEDS: usize = 8;

/// The largest friction of a joint at the edge of rest:
///
/// ```text
/// F(load) = max over |v| from 0.005 to 0.1 rad/s of |f(v) + |load| g(v)|
/// ```
///
/// with `f` the joint's friction at the velocity `v` (m/s where it slides, both of a usual arm) and `g` what it has for
/// each Nm of load. A joint at rest is held by any torque within ±F (de Wit, Olsson, Åström and Lischinsky, IEEE Trans.
/// Automatic Control 40 (1995) 419): what it is follows from how the joint came to rest, which positions do not tell.
#[derive(Clone, Debug)]
pub struct Stiction {
    /// Friction without load and for each Nm (N) of it, at every velocity.
    levels: Vec<[f64; 2]>,
    /// Places of friction among the joint's columns, and their values.
    friction: Vec<(usize, f64)>,
}

impl Stiction {
    /// Of a joint of a model with the values `theta` of all columns of its layout. Terms that need a temperature count
    /// as none.
    pub fn of(model: &RegressorModel, joint: usize, theta: &[f64]) -> Self {
        let layout = model.layout();
        let own = layout.joint_columns(joint).iter().enumerate();
        let terms: Vec<(usize, f64, &TorqueTerm)> = own
            .filter_map(|(place, &column)| match &layout.columns()[column] {
                Column::Term(term) if term.is_friction() => Some((place, theta[column], term)),
                Column::Term(_) | Column::Body { .. } => None,
            })
            .collect();
        let usual = model.model().own_scale().velocity(model.model().joints()[joint].turns(), 1.0);
        let speed = |k: usize| {
            let share = k as f64 / (SPEEDS - 1) as f64;
            usual * SpeedRanges::REST_BELOW.powf(1.0 - share) * SpeedRanges::REVERSAL_BELOW.powf(share)
        };
        let velocities = (0..SPEEDS).flat_map(|k| [speed(k), -speed(k)]);
        let levels = velocities.map(|velocity| {
            let mut level = [0.0; 2];
            for &(_, value, term) in &terms {
                level[usize::from(term.needs_load())] += value * steady(term, joint, model.dof(), velocity);
            }
            level
        });
        Self { levels: levels.collect(), friction: terms.iter().map(|&(place, value, _)| (place, value)).collect() }
    }

    /// F under this load, Nm (N).
    pub fn under(&self, load: f64) -> f64 {
        self.levels.iter().map(|[bare, loaded]| (bare + load.abs() * loaded).abs()).fold(0.0, f64::max)
    }

    /// F in one row of the joint's panel of `rows` rows, whose model predicts the torque `predicted`, Nm (N): the load
    /// is what of that is not friction.
    pub(crate) fn level(&self, panel: &[f64], rows: usize, row: usize, predicted: f64) -> f64 {
        let friction: f64 = self.friction.iter().map(|(place, value)| value * panel[place * rows + row]).sum();
        self.under(predicted - friction)
    }
}

/// The column of a term in the row of a joint while all joints move at a constant velocity, under a load of 1 Nm (N),
/// after so long a way that elements with hysteresis slip.
fn steady(term: &TorqueTerm, joint: usize, dof: usize, velocity: f64) -> f64 {
    let (q, dq) = ([0.0, velocity.signum()].repeat(dof), vec![velocity; 2 * dof]);
    let ddq = vec![0.0; 2 * dof];
    let motion = JointMotion { samples: 2, q: &q, dq: &dq, ddq: &ddq };
    let mut out = [0.0; 2];
    let mut memory = HysteresisState::default();
    let mut input = TermInput { load: Some(&[1.0; 2]), temperature_c: None, memory: &mut memory };
    term.column_following(joint, &motion, &mut input, &mut out);
    out[1]
}
