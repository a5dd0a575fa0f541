use super::Figure;
use super::data::Data;
use crate::pages::identification::error_table;
use crate::result::ResultFile;
use dynident_identification::examination::LogTrace;
use dynident_report::{LinePlot, PrintPanel};

impl Figure {
    /// Plots measured and predicted torque of every joint over time, and their difference, one plot for each joint
    /// and log. The table contains the errors of the joints from the result.
    pub fn residuals(r: &ResultFile, traces: &[LogTrace]) -> Self {
        let mut data = Data::new(["log", "joint", "time_s", "measured_nm", "predicted_nm", "residual_nm"]);
        let mut panels = Vec::new();
        for trace in traces {
            for (index, (name, joint)) in r.robot.joints.iter().zip(&trace.joints).enumerate() {
                let (time, rows) = (&trace.time_s, trace.time_s.len());
                let (measured, predicted) = (&joint.measured_nm[..rows], &joint.predicted_nm[..rows]);
                for row in (0..rows).filter(|row| measured[*row].is_finite()) {
                    let difference = measured[row] - predicted[row];
                    let numbers = [time[row], measured[row], predicted[row], difference].map(Into::into);
                    let texts = [(&trace.log).into(), name.into()];
                    data.add(texts.into_iter().chain(numbers).collect::<Vec<_>>());
                }
                let title = if traces.len() > 1 { format!("{name}: {}", trace.log) } else { name.clone() };
                let plot = LinePlot::new(title, "t, s", format!("torque, {}", r.torque_unit(index)), time.clone())
                    .broad("predicted", predicted.to_vec())
                    .line("measured", measured.to_vec())
                    .difference("measured minus predicted", 1, 0);
                panels.push(PrintPanel::Lines(plot));
            }
        }
        Self::new(format!("Torque residuals of {}", r.name), panels, data, error_table(r))
    }
}
