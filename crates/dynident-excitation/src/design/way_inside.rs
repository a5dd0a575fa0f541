//! Interpolation from a motion slightly outside the limits towards a motion inside.

use super::DesignTask;
use super::assess::{Assessment, assess};
use crate::criteria::Criterion;

/// Maximum violation at which an interpolation is still a small change.
const MAX_VIOLATION: f64 = 0.02;

/// First interpolation share, and number of shares tested; the last share is one half.
const FIRST_SHARE: f64 = 1.0 / 512.0;
const SHARES: i32 = 9;

/// Returns `(1 - s) outside + s inside` for the smallest of the shares s = 1/512, 1/256, .., 1/2 that keeps all
/// limits between samples. `None` in these cases: `outside` already keeps the limits or is far outside, `inside`
/// violates a limit, the family is not linear in its parameters, the result is worse than `inside`, or `stop` returns
/// true.
///
/// In a linear family, positions, velocities and accelerations change linearly with the share, and violations of
/// convex limits change at most linearly. A violation ε is therefore removed at a share of about ε, with a small loss
/// in the criterion.
pub(super) fn way_inside(
    task: &DesignTask<'_>,
    criterion: &dyn Criterion,
    outside: &Assessment,
    inside: &Assessment,
    grids: [&[f64]; 2],
    stop: &dyn Fn() -> bool,
) -> Option<Assessment> {
    let [fine, logged] = grids;
    let near = outside.violation > 0.0 && outside.violation <= MAX_VIOLATION;
    if !near || inside.violation > 0.0 || !task.family.is_linear() {
        return None;
    }
    let between = |share: f64| -> Vec<f64> {
        outside.parameters.iter().zip(&inside.parameters).map(|(from, to)| from + share * (to - from)).collect()
    };
    (0..SHARES)
        .take_while(|_| !stop())
        .map(|doubling| assess(task, criterion, between(FIRST_SHARE * f64::from(1 << doubling)), fine, logged))
        .find(|assessed| assessed.violation <= 0.0)
        .filter(|assessed| assessed.better_than(inside))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criteria::DOptimal;
    use crate::design::{grid, ranges};
    use crate::families::{Fourier, FourierSettings};
    use crate::family::Family;
    use crate::limits::{LimitSet, Limits};
    use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
    use dynident_model::load_robot;
    use dynident_model::sample::Random;

    #[test]
    fn small_shares_cost_little() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
        let model = load_robot(path).unwrap().model;
        let limits = LimitSet::new(&Limits::from_model(&model), &model).unwrap();
        let family = Fourier::new(model.dof(), 10.0, &FourierSettings::default()).unwrap();
        let base = BaseParameters::new(&model, &[], &BaseParameterSettings::default());
        let layout = PanelLayout::new(&model, base.base_columns());
        let task = DesignTask {
            family: &family,
            criteria: &[&DOptimal],
            limits: &limits,
            layout: &layout,
            torque_std_nm: &[1.0; 6],
            prior: None,
        };
        let (fine, logged) = (grid(10.0, 127), grid(10.0, 1001));
        let judged = |parameters: Vec<f64>| assess(&task, &DOptimal, parameters, &fine, &logged);
        let way = |outside, inside| way_inside(&task, &DOptimal, outside, inside, [&fine, &logged], &|| false);
        let (positions, speeds) = ranges(&limits);
        let start = family.random(&positions, &speeds, &mut Random::new(3));
        let scaled = |by: f64| judged(start.iter().map(|p| by * p).collect());
        let (mut below, mut above) = (0.0, 64.0);
        for _ in 0..60 {
            let middle = 0.5 * (below + above);
            *(if scaled(middle).violation <= 0.0 { &mut below } else { &mut above }) = middle;
        }
        let (outside, inside, far) = (scaled(1.001 * above), scaled(0.5 * below), scaled(2.0 * above));
        assert!(outside.violation > 0.0 && inside.violation <= 0.0 && far.violation > MAX_VIOLATION);
        let between = way(&outside, &inside).expect("a small share is sufficient");
        assert!(between.violation <= 0.0);
        // Share 1/256 of a change by half of the motion, squared in 36 columns: 36 · 2 · 0.5 / 256 nats, and as much
        // again for the previous step.
        let lost = between.figure.unwrap() - outside.figure.unwrap();
        assert!(lost < 0.3, "{lost}");
        assert!(way(&far, &inside).is_none(), "far outside an interpolation is not a small change");
        assert!(way(&inside, &inside).is_none() && way(&outside, &far).is_none());
    }
}
