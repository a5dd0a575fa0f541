use super::data::Data;
use super::{Figure, units};
use crate::pages::iteration::runs;
use crate::pages::run_figures::{error_in_bars, is_known, run_name};
use crate::pages::unit;
use crate::result::{IterationRun, IterationsFile};
use dynident_report::{ConvergencePlot, PrintPanel};

impl Figure {
    /// Plots the tracking error of every joint and the error bars of the parameters by run; if the true parameters
    /// are known, also the errors of the parameters.
    pub fn convergence(file: &IterationsFile) -> Self {
        let mut data = Data::new(["run", "accepted", "quantity", "of", "unit", "value"]);
        let mut add = |run: &IterationRun, quantity: &str, of: &str, unit: &str, value: f64| {
            let accepted = if run.accepted { "yes" } else { "no" };
            let texts = [(&run_name(run)).into(), accepted.into(), quantity.into(), of.into(), unit.into()];
            data.add(texts.into_iter().chain([value.into()]).collect::<Vec<_>>());
        };
        let mut tracking = ConvergencePlot::new("Largest tracking error", "rad (m)").log_y();
        for (joint, name) in file.joints.iter().enumerate() {
            let of = |run: &IterationRun| run.max_tracking_error_rad.get(joint).copied().unwrap_or(f64::NAN);
            file.runs.iter().for_each(|run| add(run, "largest tracking error", name, "rad (m)", of(run)));
            tracking = tracking.curve(name, file.runs.iter().map(of).collect());
        }
        let mut bars = ConvergencePlot::new("Root mean square error bar", "standard deviation").log_y();
        let all = file.runs.iter().flat_map(IterationRun::known).map(|own| own.unit.as_str());
        for of_unit in units(all) {
            let of = |run: &IterationRun| {
                let own = run.known().iter().filter(|own| own.unit == of_unit);
                root_mean_square(own.filter_map(|own| own.std))
            };
            file.runs
                .iter()
                .for_each(|run| add(run, "root mean square standard deviation", "parameters", of_unit, of(run)));
            bars = bars.curve(unit(of_unit), file.runs.iter().map(of).collect());
        }
        let mut panels = vec![PrintPanel::Runs(tracking), PrintPanel::Runs(bars)];
        if is_known(file) {
            let of = |run: &IterationRun| error_in_bars(run).unwrap_or(f64::NAN);
            let what = "root mean square error relative to the standard deviation";
            file.runs.iter().for_each(|run| add(run, what, "parameters", "1", of(run)));
            let plot = ConvergencePlot::new("Parameter error", "relative to its standard deviation").log_y();
            panels.push(PrintPanel::Runs(plot.curve("root mean square", file.runs.iter().map(of).collect())));
        }
        Self::new(format!("Convergence of {}", file.name), panels, data, runs(file))
    }
}

/// Root mean square; NaN if there are no values.
fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0_usize, 0.0), |(count, sum), value| (count + 1, sum + value * value));
    (sum / count as f64).sqrt()
}
