//! From a motion to rows of regressor and torque, filtered alike, within the windows that count.

use crate::error::IterationError;
use crate::leg::{IterationTask, Leg};
use crate::motion::MeasuredMotion;
use dynident_dynamics::{BatchWorkspace, LawHistory, Panels, regressor_panels_following};
use dynident_model::laws::JointMotion;
use dynident_recording::{DecimationSettings, Decimator};

/// Samples that are made into panels at a time.
const PANEL_SAMPLES: usize = 256;

/// Hands the rows of every joint that count to `take(joint, rows, panel)`: the base columns of its panel one after another, then its torque.
pub(crate) fn visit_rows(
    task: &IterationTask,
    leg: &Leg,
    motion: &MeasuredMotion,
    filter: Option<&DecimationSettings>,
    mut take: impl FnMut(usize, usize, &[f64]) -> Result<(), IterationError>,
) -> Result<(), IterationError> {
    let machine = &task.machine;
    let (model, layout, dof) = (machine.model(), machine.layout(), machine.dof());
    let mut decimators = filter
        .map(|settings| {
            (0..dof)
                .map(|joint| Decimator::new(settings, motion.rate_hz, layout.joint_columns(joint).len() + 1))
                .collect::<Result<Vec<_>, _>>()
        })
        .transpose()?;
    let (half, factor) = decimators
        .as_ref()
        .and_then(|all| all.first())
        .map_or((0, 1), |first| (first.half_length(), filter.map_or(1, |settings| settings.factor)));
    // How many samples up to each are unusable: a filtered row must see none.
    let mut spoilt = Vec::with_capacity(motion.samples + 1);
    spoilt.push(0_usize);
    for usable in &motion.usable {
        spoilt.push(spoilt[spoilt.len() - 1] + usize::from(!usable));
    }
    let (mut workspace, mut panels) = (BatchWorkspace::new(model), Panels::default());
    let mut history = LawHistory::new(None);
    let mut block: [Vec<f64>; 3] = Default::default();
    let (mut filtered, mut kept) = (Vec::new(), Vec::new());
    let mut done = vec![0_usize; dof];
    for from in (0..motion.samples).step_by(PANEL_SAMPLES) {
        let samples = PANEL_SAMPLES.min(motion.samples - from);
        for (to, source) in block.iter_mut().zip([&motion.q, &motion.dq, &motion.ddq]) {
            to.clear();
            for joint in 0..dof {
                to.extend_from_slice(&source[joint * motion.samples + from..][..samples]);
            }
        }
        let [q, dq, ddq] = &block;
        let view = JointMotion { samples, q, dq, ddq };
        regressor_panels_following(model, &mut workspace, layout, &view, &mut history, &mut panels);
        for joint in 0..dof {
            panels.torque_mut(joint).copy_from_slice(&motion.tau[joint * motion.samples + from..][..samples]);
            let (rows, panel) = match &mut decimators {
                Some(decimators) => {
                    let rows = decimators[joint].push(panels.joint(joint), samples, &mut filtered);
                    (rows, &filtered[..])
                }
                None => (samples, panels.joint(joint)),
            };
            let first = done[joint];
            done[joint] += rows;
            let counts = |row: usize| {
                let centre = (first + row) * factor + half;
                let clean = spoilt[centre - half] == spoilt[(centre + half + 1).min(motion.samples)];
                clean && leg.counts(joint, motion.time_s(centre))
            };
            let places: Vec<usize> = (0..rows).filter(|&row| counts(row)).collect();
            if places.is_empty() {
                continue;
            }
            kept.clear();
            for column in panel.chunks_exact(rows) {
                kept.extend(places.iter().map(|&row| column[row]));
            }
            take(joint, places.len(), &kept)?;
        }
    }
    Ok(())
}
