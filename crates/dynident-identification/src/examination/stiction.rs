//! Dry friction of a joint at rest.

use dynident_dynamics::Column;
use dynident_estimation::SpeedRanges;
use dynident_model::terms::{HysteresisState, JointMotion, TermInput, TorqueTerm};
use dynident_rows::RegressorModel;

/// Number of speeds between the limit of rest and the speed of a reversal, on a logarithmic scale.
const SPEEDS: usize = 8;

/// The largest friction of a joint near rest:
///
/// ```text
/// F(load) = max over |v| from 0.005 to 0.1 rad/s of |f(v) + |load| g(v)|
/// ```
///
/// Here `f` is the joint's friction at the velocity `v` (m/s for a prismatic joint; values for an arm of usual size)
/// and `g` its friction per unit of load. The friction of a joint at rest can have any value within ±F (de Wit, Olsson,
/// Åström and Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419). The value depends on how the joint came to
/// rest, so positions do not determine it.
#[derive(Clone, Debug)]
pub struct Stiction {
    /// Friction without load, and friction per Nm (N) of load, at every velocity.
    levels: Vec<[f64; 2]>,
    /// Indices of the joint's friction columns, and their values.
    friction: Vec<(usize, f64)>,
}

impl Stiction {
    /// Friction of a joint of a model; `theta` are the values of all columns of its layout. Temperature terms are
    /// ignored.
    pub fn of(model: &RegressorModel, joint: usize, theta: &[f64]) -> Self {
        let layout = model.layout();
        let own = layout.joint_columns(joint).iter().enumerate();
        let terms: Vec<(usize, f64, &TorqueTerm)> = own
            .filter_map(|(place, &column)| match &layout.columns()[column] {
                Column::Term(term) if term.is_friction() => Some((place, theta[column], term)),
                Column::Term(_) | Column::Body { .. } => None,
            })
            .collect();
        let usual = model.model().characteristic_scale().velocity(model.model().joints()[joint].is_rotary(), 1.0);
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

    /// Largest friction F for this load, Nm (N).
    pub fn under(&self, load: f64) -> f64 {
        self.levels.iter().map(|[bare, loaded]| (bare + load.abs() * loaded).abs()).fold(0.0, f64::max)
    }

    /// Largest friction F in one row of the joint's panel of `rows` rows, Nm (N). The load is the `predicted` torque
    /// without friction.
    pub(crate) fn level(&self, panel: &[f64], rows: usize, row: usize, predicted: f64) -> f64 {
        let friction: f64 = self.friction.iter().map(|(place, value)| value * panel[place * rows + row]).sum();
        self.under(predicted - friction)
    }
}

/// Value of a term's column for a joint while all joints move at the same constant velocity under a load of 1 Nm (N),
/// after a distance at which elements with hysteresis slip.
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
