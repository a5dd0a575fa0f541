//! Parameters on the page of an iteration, with error bars, for each run.

use super::run_figures::{HALF_WIDTH_95, MAX_CURVES, error_in_bars, is_known, largest_error, last_good, run_name};
use super::unit;
use crate::result::{IterationParameter, IterationRun, IterationsFile};
use dynident_report::{BarPlot, Cell, ConvergencePlot, Report, Table, Text, Tone, short};

/// The base parameters from all accepted runs.
pub(super) fn identified_parameters(file: &IterationsFile) -> Table {
    let columns = ["parameter", "expression", "unit", "value", "± (95 %)", "consistent set"];
    let mut table = Table::new("Identified parameters from all accepted runs", columns)
        .note("result.json contains bodies and friction, identification.html the torques, controller.json the controller with this model");
    for one in &file.base_parameters {
        let bar = if one.excited { short(one.bar_95(), 3) } else { "not excited".to_owned() };
        table = table.rows([vec![
            Cell::from(&one.symbol),
            Cell::from(&one.expression),
            Cell::from(unit(&one.unit)),
            Cell::from(short(one.value, 5)),
            Cell::from(bar),
            Cell::from(one.physical.map_or_else(|| "–".to_owned(), |value| short(value, 5))),
        ]]);
    }
    table
}

/// Adds the parameters of all runs: errors, error bars, values per run, and a table.
pub(super) fn add_parameters(page: &mut Report, file: &IterationsFile) {
    let Some(last) = last_good(file) else {
        page.add(Text::new("No run determines the parameters."));
        return;
    };
    let known = is_known(file);
    if known {
        settling_errors(page, file);
    }
    let mut units: Vec<&str> = Vec::new();
    for parameter in &last.parameters {
        if !units.contains(&&*parameter.unit) {
            units.push(&parameter.unit);
        }
    }
    for of_unit in units {
        let places: Vec<usize> = (0..last.parameters.len()).filter(|&k| last.parameters[k].unit == of_unit).collect();
        let mut bars = BarPlot::new(format!("Base parameters in {}, run {}", unit(of_unit), last.run), unit(of_unit))
            .note("with 95 % error bars")
            .reference_label(if known { "the truth" } else { "" });
        for parameter in places.iter().map(|&k| &last.parameters[k]) {
            let half_width = parameter.std.map(|std| HALF_WIDTH_95 * std);
            let truth = parameter.error.map(|error| parameter.value - error);
            let value = if half_width.is_some() { parameter.value } else { f64::NAN };
            bars = bars.bar(&parameter.expression, value, half_width, truth);
        }
        page.add(bars);
        for (part, some) in places.chunks(MAX_CURVES).enumerate() {
            page.add(by_run(file, of_unit, some, part, places.len().div_ceil(MAX_CURVES), known));
        }
    }
    page.add(table(file, last, known));
}

/// Plots how the errors of the parameters decrease from run to run.
fn settling_errors(page: &mut Report, file: &IterationsFile) {
    let of = |figure: &dyn Fn(&IterationRun) -> Option<f64>| -> Vec<f64> {
        file.runs.iter().map(|run| figure(run).unwrap_or(f64::NAN)).collect()
    };
    let root_mean_square = |run: &IterationRun| {
        let squares: Vec<f64> = run.parameters.iter().filter_map(|p| p.error.map(|error| error * error)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    page.add(
        ConvergencePlot::new("Parameter errors", "kg m, kg m², ..")
            .log_y()
            .curve("largest", of(&largest_error))
            .curve("root mean square", of(&root_mean_square)),
    );
    let over_bound = |run: &IterationRun| {
        let bound = run.bound.as_ref().or(file.bound.as_ref())?;
        let squares: Vec<f64> = run
            .parameters
            .iter()
            .zip(bound)
            .filter_map(|(p, bound)| (p.std.is_some() && *bound > 0.0).then_some(p.error? / bound))
            .map(|ratio| ratio * ratio)
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    let mut relative = ConvergencePlot::new("Relative parameter errors", "root mean square over the parameters")
        .log_y()
        .curve("relative to the standard deviation", of(&error_in_bars));
    if file.bound.is_some() {
        relative = relative.curve("relative to the Cramér-Rao bound", of(&over_bound));
    }
    page.add(relative);
}

/// Plots some parameters of one unit for each run: values, or errors if the true values are known.
fn by_run(
    file: &IterationsFile,
    of_unit: &str,
    places: &[usize],
    part: usize,
    parts: usize,
    known: bool,
) -> ConvergencePlot {
    let number = if parts > 1 { format!(" ({} of {parts})", part + 1) } else { String::new() };
    let what = if known { "Error" } else { "Value" };
    let mut plot = ConvergencePlot::new(format!("{what}, {}{number}", unit(of_unit)), unit(of_unit))
        .note("per run, with 95 % error bars");
    for &place in places {
        let each: Vec<Option<&IterationParameter>> = file.runs.iter().map(|run| run.parameters.get(place)).collect();
        let determined = |parameter: &&IterationParameter| parameter.std.is_some();
        let value = |parameter: Option<&IterationParameter>| {
            parameter.filter(determined).map_or(f64::NAN, |parameter| parameter.error.unwrap_or(parameter.value))
        };
        let bar = |parameter: Option<&IterationParameter>| {
            parameter.and_then(|parameter| parameter.std).map_or(f64::NAN, |std| HALF_WIDTH_95 * std)
        };
        let name = each.iter().flatten().next().map_or_else(String::new, |parameter| parameter.symbol.clone());
        plot = plot.curve_with_bars(
            name,
            each.iter().copied().map(value).collect(),
            each.iter().copied().map(bar).collect(),
        );
    }
    plot
}

fn table(file: &IterationsFile, last: &IterationRun, known: bool) -> Table {
    let mut columns = vec!["expression".to_owned(), "unit".to_owned()];
    columns.extend(file.runs.iter().map(|run| format!("run {}", run_name(run))));
    columns.push(format!("std, run {}", last.run));
    if known {
        columns.extend(["truth".to_owned(), "error in std".to_owned()]);
    }
    if file.bound.is_some() {
        columns.push("bound".to_owned());
    }
    let optional = |value: Option<f64>| Cell::from(value.map_or_else(|| "–".to_owned(), |value| short(value, 3)));
    let mut table = Table::new("All runs", columns);
    for (place, parameter) in last.parameters.iter().enumerate() {
        let mut row = vec![Cell::from(&parameter.expression), Cell::from(unit(&parameter.unit))];
        row.extend(file.runs.iter().map(|run| match run.parameters.get(place) {
            Some(own) if own.std.is_some() => Cell::from(short(own.value, 5)),
            _ => Cell::from("–"),
        }));
        row.push(optional(parameter.std));
        if known {
            let bars = parameter.error.zip(parameter.std.filter(|std| *std > 0.0)).map(|(error, std)| error / std);
            // About 0.3 % of the errors exceed three standard deviations by chance.
            let tone = if bars.is_some_and(|bars| bars.abs() > 3.0) { Tone::Warning } else { Tone::Plain };
            row.push(Cell::from(parameter.error.map_or_else(String::new, |e| short(parameter.value - e, 5))));
            row.push(Cell::judged(bars.map_or_else(|| "–".to_owned(), |bars| short(bars, 2)), tone));
        }
        if let Some(bound) = &file.bound {
            row.push(optional(bound.get(place).copied()));
        }
        table = table.rows([row]);
    }
    table
}
