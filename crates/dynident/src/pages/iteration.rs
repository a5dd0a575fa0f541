//! `report.html` of an iteration.

use super::torque_check::torque_section;
use crate::error::Error;
use crate::result::{IterationParameter, IterationRun, IterationsFile, UnmetCondition};
use dynident_iteration::IterationStore;
use dynident_iteration::robot::read_log_table;
use dynident_report::{
    BarPlot, Cell, ConvergencePlot, Heading, KeyFigures, LinePlot, Report, Table, Text, Tone, short,
};
use dynident_simulation::Reference;

/// Half width of a 95 % error bar, in standard deviations.
const HALF_WIDTH_95: f64 = 1.96;

/// Curves of one plot: more cannot be distinguished.
const CURVES: usize = 6;

/// What is told of held-out runs.
const HELD_OUT: &str = "A motion that is never fitted, run under the controller with the newest model: how much of each joint's torque lies inside the 95 % band of what that model says. The verdict rests on the last.";

/// What is told of forecasts.
const FORECASTS: &str = "The worst bars: root mean square of the error bars along the ten directions that were known worst before the run, measured by the torque that they leave uncertain wherever the arm may be.";

/// Which trajectory of which run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct RunName {
    /// The run's number.
    pub(crate) run: usize,
    /// The leg's number, where there are several.
    pub(crate) leg: Option<usize>,
    /// Place of the leg within the run, from 0.
    pub(crate) place: usize,
}

/// How far a run was from its trajectory.
pub(crate) struct RunTrace {
    name: RunName,
    /// Times of the trajectory, s.
    pub(crate) times_s: Vec<f64>,
    /// For each joint the desired less the measured position at these times; NaN where the run had ended.
    pub(crate) error: Vec<Vec<f64>>,
}

impl RunTrace {
    /// From the log that was kept of the run. A log that cannot be read draws nothing: the page is to be written all
    /// the same.
    pub(crate) fn new(name: RunName, store: &IterationStore, reference: &Reference, joints: &[String]) -> Self {
        let log = if name.place == 0 { "log.csv".to_owned() } else { format!("log_{}.csv", name.place + 1) };
        let (motion, rate_hz) = (reference.motion(), reference.rate_hz());
        let times_s: Vec<f64> = (0..motion.samples).map(|sample| sample as f64 / rate_hz).collect();
        let record = read_log_table(&store.run_folder(name.run).join(log), joints, rate_hz).ok();
        let error = (0..joints.len()).map(|joint| {
            let target = &motion.q[motion.of(joint)];
            let Some(record) = &record else { return vec![f64::NAN; motion.samples] };
            let own = &record.q[record.of(joint)];
            let measured = times_s.iter().map(|time_s| between(&record.times_s, own, *time_s));
            target.iter().zip(measured).map(|(target, measured)| target - measured).collect()
        });
        Self { name, error: error.collect(), times_s }
    }
}

/// A value between two samples by a straight line; NaN after the last.
fn between(times_s: &[f64], values: &[f64], time_s: f64) -> f64 {
    let after = times_s.partition_point(|time| *time < time_s);
    match (after, times_s.get(after)) {
        // Rounding of the last instant does not end a run.
        (_, None) => times_s.last().filter(|last| time_s - **last < 1e-9).map_or(f64::NAN, |_| values[after - 1]),
        (0, Some(_)) => values[0],
        (_, Some(next)) => {
            let share = (time_s - times_s[after - 1]) / (next - times_s[after - 1]);
            values[after - 1] + share * (values[after] - values[after - 1])
        }
    }
}

/// What the computation took.
pub(crate) struct TimeSpent {
    /// Until the first run: robot, base parameters, the trajectory's design; s.
    pub(crate) before_runs_s: f64,
    /// Everything but this page, s.
    pub(crate) all_s: f64,
    /// Runs that were made; others were there already.
    pub(crate) runs: usize,
}

/// The whole page.
pub(crate) fn iteration_report(file: &IterationsFile, traces: &[RunTrace], time: &TimeSpent) -> Result<String, Error> {
    let mut page = Report::new(&file.name).subtitle(format!("{} joints; {}", file.joints.len(), file.reason));
    page.add(figures(file));
    if !file.unmet.is_empty() {
        page.add(Heading::new("What is not met"));
        page.add(unmet(file));
    }
    page.add(Heading::new("Runs"));
    page.add(runs(file));
    let rejected = file.runs.iter().filter_map(|run| run.reason.as_ref().map(|reason| (run_name(run), reason)));
    let points: Vec<(Tone, String)> =
        rejected.map(|(run, reason)| (Tone::Warning, format!("run {run}: {reason}"))).collect();
    if !points.is_empty() {
        page.add(Text { paragraphs: Vec::new(), points });
    }
    let oscillating = file.oscillation_sentences().into_iter().map(|sentence| (Tone::Warning, sentence));
    let points: Vec<(Tone, String)> = file
        .lowered_bandwidths_sentence()
        .map(|sentence| (Tone::Plain, sentence))
        .into_iter()
        .chain(oscillating)
        .collect();
    if !points.is_empty() {
        page.add(Text { paragraphs: Vec::new(), points });
    }
    let forecasts = file.runs.iter().filter_map(|run| Some((run_name(run), run.forecast.as_ref()?)));
    let mut points: Vec<(Tone, String)> =
        forecasts.map(|(run, forecast)| (Tone::Plain, format!("run {run}: {}", forecast.sentence()))).collect();
    points.extend(
        file.declined
            .iter()
            .map(|forecast| (Tone::Plain, format!("a further run was not worth it: {}", forecast.sentence()))),
    );
    if !points.is_empty() {
        page.add(Heading::new("What the motions were to bring"));
        page.add(Text { paragraphs: vec![FORECASTS.to_owned()], points });
    }
    let warmed = file.runs.iter().filter_map(|run| Some((run_name(run), run.warm_up.as_ref()?)));
    let points: Vec<(Tone, String)> = warmed
        .map(|(run, warm_up)| (Tone::Plain, format!("before run {run}: {}", warm_up.sentence(&file.joints))))
        .collect();
    if !points.is_empty() {
        page.add(Heading::new("Warm-up"));
        page.add(Text { paragraphs: Vec::new(), points });
    }
    let judged = file.runs.iter().filter_map(|run| Some((run_name(run), run.held_out.as_ref()?)));
    let points: Vec<(Tone, String)> = judged
        .map(|(run, held_out)| (Tone::Plain, format!("after run {run}: {}", held_out.sentence(&file.joints))))
        .collect();
    if !points.is_empty() {
        page.add(Heading::new("The held-out motion"));
        page.add(Text { paragraphs: vec![HELD_OUT.to_owned()], points });
    }
    if let Some(sentence) = last_good(file).and_then(|run| run.run_offsets_sentence(&file.joints)) {
        page.add(Heading::new("Offsets of single runs"));
        page.add(Text { paragraphs: Vec::new(), points: vec![(Tone::Plain, sentence)] });
    }
    if let Some(shown) = last_shown(file) {
        page.add(Heading::new("What the last log shows"));
        page.add(shown);
    }
    let ways =
        file.runs.iter().filter_map(|run| run.differentiator.as_ref().map(|way| (run_name(run), way.sentence())));
    let points: Vec<(Tone, String)> = ways.map(|(run, way)| (Tone::Plain, format!("run {run}: {way}"))).collect();
    if !points.is_empty() {
        page.add(Heading::new("From positions to velocities and accelerations"));
        page.add(Text { paragraphs: Vec::new(), points });
    }
    torque_section(&mut page, file);
    page.add(Heading::new("Tracking"));
    tracking(&mut page, file, traces);
    page.add(Heading::new("Parameters"));
    if !file.base_parameters.is_empty() {
        page.add(found(file));
    }
    parameters(&mut page, file);
    page.add(Heading::new("Time"));
    page.add(spent(file, time));
    Ok(page.html()?)
}

/// What stands between the iteration and success, with what would help.
fn unmet(file: &IterationsFile) -> Text {
    let point =
        |unmet: &UnmetCondition| (Tone::Warning, format!("{}. What would help: {}.", unmet.message, unmet.remedy));
    Text { paragraphs: Vec::new(), points: file.unmet.iter().map(point).collect() }
}

/// Joint by joint what the verdict rests on, of the last run whose log shows it.
fn last_shown(file: &IterationsFile) -> Option<Table> {
    let run = file.runs.iter().rfind(|run| run.evidence.is_some())?;
    let optional = |value: Option<String>| Cell::from(value.unwrap_or_else(|| "–".to_owned()));
    let columns = [
        "joint",
        "tracking error, rad (m)",
        "its floor",
        "at the torque limit",
        "torque after motion, ms",
        "of it taken off, ms",
        "predicted inside the 95 % band",
    ];
    let evidence = run.evidence.as_ref()?;
    let delay = evidence.feedback_delay_s.map_or_else(String::new, |delay_s| {
        format!("; the tracking error is that of a controller which sees positions {} ms late", short(1e3 * delay_s, 3))
    });
    let mut table = Table::new(format!("Run {}", run_name(run)), columns).note(format!(
        "floor: what noise, friction and delay explain, looked for where tracking is beyond the tolerance{delay}; predicted: by the model of the good runs before it",
    ));
    for (joint, (name, shown)) in file.joints.iter().zip(&evidence.joints).enumerate() {
        let lag = run.torque_lags.get(joint).copied().flatten();
        table = table.rows([vec![
            Cell::from(name),
            Cell::from(short(run.max_tracking_error_rad[joint], 3)),
            optional(shown.tracking_floor_rad.map(|floor| short(floor, 3))),
            optional(shown.clipping.map(|clipping| format!("{} %", short(100.0 * clipping.share, 3)))),
            optional(lag.map(|lag| format!("{:.2} ± {:.2}", 1e3 * lag.lag_s, 1e3 * lag.half_width_95_s))),
            optional(lag.filter(|lag| lag.taken_off_s != 0.0).map(|lag| format!("{:.2}", 1e3 * lag.taken_off_s))),
            optional(shown.prediction.map(|prediction| format!("{} %", short(100.0 * prediction.inside, 3)))),
        ]]);
    }
    Some(table)
}

/// The base parameters by all good runs together.
fn found(file: &IterationsFile) -> Table {
    let columns = ["parameter", "what it sums", "unit", "value", "± (95 %)", "of the consistent robot"];
    let mut table = Table::new("The robot found, by all good runs together", columns)
        .note("result.json has all of it with the bodies and friction, identification.html the torques; controller.json is the controller with this robot as its model");
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

fn is_known(file: &IterationsFile) -> bool {
    file.runs.iter().flat_map(|run| &run.parameters).any(|parameter| parameter.error.is_some())
}

/// The last good run with an estimate.
fn last_good(file: &IterationsFile) -> Option<&IterationRun> {
    file.runs.iter().rev().find(|run| run.accepted && !run.parameters.is_empty())
}

fn worst(run: &IterationRun) -> f64 {
    run.max_tracking_error_rad.iter().fold(0.0, |most, error| most.max(*error))
}

/// Largest and root mean square error of what a run determines, in units of its own error bars.
fn error_in_bars(run: &IterationRun) -> Option<f64> {
    let squares: Vec<f64> = run
        .parameters
        .iter()
        .filter_map(|parameter| Some((parameter.error?, parameter.std.filter(|std| *std > 0.0)?)))
        .map(|(error, std)| (error / std).powi(2))
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

fn largest_error(run: &IterationRun) -> Option<f64> {
    run.parameters.iter().filter_map(|parameter| parameter.error.map(f64::abs)).reduce(f64::max)
}

fn figures(file: &IterationsFile) -> KeyFigures {
    let tone = match &file.status[..] {
        "converged" => Tone::Good,
        "refused" => Tone::Bad,
        _ => Tone::Warning,
    };
    let rejected = file.runs.iter().filter(|run| !run.accepted).count();
    let of = if rejected == 0 { "none rejected".to_owned() } else { format!("{rejected} rejected") };
    let mut figures = KeyFigures::new().judged("verdict", file.status.replace('-', " "), "", tone).judged(
        "runs",
        file.runs.len().to_string(),
        of,
        if rejected == 0 { Tone::Plain } else { Tone::Warning },
    );
    if let [first, .., last] = &file.runs[..] {
        let note = format!("largest of all joints; {} in the first run", short(worst(first), 3));
        figures = figures.figure("tracking error, last run", format!("{} rad (m)", short(worst(last), 3)), note);
    }
    if let Some(improvement) = file.tracking_improvement {
        figures = figures.figure("tracking better by", short(improvement, 3), "first to last good run");
    }
    if let Some(error) = last_good(file).and_then(largest_error) {
        figures = figures.figure("largest parameter error", short(error, 3), "last good run, against the truth");
    }
    if let Some(ratio) = file.error_over_bound {
        figures = figures.figure("error over the Cramér-Rao bound", short(ratio, 3), "root mean square, last good run");
    }
    figures
}

/// A run's number, with its leg where each has an iteration of its own.
fn run_name(run: &IterationRun) -> String {
    run.leg.map_or_else(|| run.run.to_string(), |leg| format!("{} of leg {leg}", run.run))
}

/// What controlled a run, in words.
fn model(run: &IterationRun) -> String {
    match (run.model_based, run.model_of_run) {
        (false, _) if run.stiffness == 1.0 => "none".to_owned(),
        (false, _) => format!("none; stiffer {} times", short(run.stiffness, 3)),
        (true, Some(of)) => format!("of run {of}"),
        (true, None) if run.damping < 1.0 => {
            format!("{} of the step from the last good one", short(run.damping, 3))
        }
        (true, None) => "what was believed before".to_owned(),
    }
}

fn runs(file: &IterationsFile) -> Table {
    let known = is_known(file);
    let mut columns = vec!["run", "controller", "its model", "verdict", "tracking error, rad (m)", "widest bar"];
    if known {
        columns.extend(["largest error", "error in bars"]);
    }
    let mut table = Table::new("", columns).note(if known {
        "tracking: the largest of all joints; error in bars: root mean square over the parameters of error over error bar (one standard deviation)"
    } else {
        "tracking: the largest of all joints; widest bar: one standard deviation"
    });
    let optional = |value: Option<f64>| Cell::from(value.map_or_else(|| "–".to_owned(), |value| short(value, 3)));
    for run in &file.runs {
        let verdict = if run.accepted { ("good", Tone::Good) } else { ("rejected", Tone::Warning) };
        let widest = run.parameters.iter().filter_map(|parameter| parameter.std).reduce(f64::max);
        let mut row = vec![
            Cell::from(run_name(run)),
            Cell::from(&run.controller),
            Cell::from(model(run)),
            Cell::judged(verdict.0, verdict.1),
            Cell::from(short(worst(run), 3)),
            optional(widest),
        ];
        if known {
            row.extend([optional(largest_error(run)), optional(error_in_bars(run))]);
        }
        table = table.rows([row]);
    }
    table
}

fn tracking(page: &mut Report, file: &IterationsFile, traces: &[RunTrace]) {
    let mut settling = ConvergencePlot::new("Largest tracking error", "rad (m)").log_y();
    for (joint, name) in file.joints.iter().enumerate() {
        let of = |run: &IterationRun| run.max_tracking_error_rad.get(joint).copied().unwrap_or(f64::NAN);
        settling = settling.curve(name, file.runs.iter().map(of).collect());
    }
    page.add(settling);
    let mut legs: Vec<Option<usize>> = traces.iter().map(|trace| trace.name.leg).collect();
    legs.sort_unstable();
    legs.dedup();
    for leg in legs {
        let own: Vec<&RunTrace> = traces.iter().filter(|trace| trace.name.leg == leg).collect();
        let Some(longest) = own.iter().max_by_key(|trace| trace.times_s.len()) else { continue };
        for (joint, name) in file.joints.iter().enumerate() {
            // A locked joint has no error to draw.
            if own.iter().all(|trace| trace.error[joint].iter().all(|error| *error == 0.0)) {
                continue;
            }
            let of_leg = leg.map_or_else(String::new, |leg| format!(", leg {leg}"));
            let title = format!("{name}: tracking error{of_leg}");
            let mut plot =
                LinePlot::new(title, "t, s", "rad (m)", longest.times_s.clone()).note("desired less measured position");
            // The first runs and the last: what lies between differs little from either.
            let shown = |place: usize| place + 2 < CURVES || place + 2 >= own.len();
            for trace in own.iter().enumerate().filter(|(place, _)| shown(*place)).map(|(_, trace)| trace) {
                let mut error = trace.error[joint].clone();
                error.resize(longest.times_s.len(), f64::NAN);
                plot = plot.line(format!("run {}", trace.name.run), error);
            }
            page.add(plot);
        }
    }
}

/// A unit that is not broken, with raised exponents.
fn unit(unit: &str) -> String {
    unit.replace(' ', "\u{a0}").replace("^2", "²")
}

fn parameters(page: &mut Report, file: &IterationsFile) {
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
        for (part, some) in places.chunks(CURVES).enumerate() {
            page.add(by_run(file, of_unit, some, part, places.len().div_ceil(CURVES), known));
        }
    }
    page.add(table(file, last, known));
}

/// How the errors of all parameters settle.
fn settling_errors(page: &mut Report, file: &IterationsFile) {
    let of = |figure: &dyn Fn(&IterationRun) -> Option<f64>| -> Vec<f64> {
        file.runs.iter().map(|run| figure(run).unwrap_or(f64::NAN)).collect()
    };
    let root_mean_square = |run: &IterationRun| {
        let squares: Vec<f64> = run.parameters.iter().filter_map(|p| p.error.map(|error| error * error)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    page.add(
        ConvergencePlot::new("Parameter errors against the truth", "kg m, kg m², ..")
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
    let mut relative = ConvergencePlot::new("The same, relative", "root mean square over the parameters")
        .log_y()
        .curve("over its error bar", of(&error_in_bars));
    if file.bound.is_some() {
        relative = relative.curve("over the Cramér-Rao bound", of(&over_bound));
    }
    page.add(relative);
}

/// Some parameters of one unit run by run: against the truth where it is known.
fn by_run(
    file: &IterationsFile,
    of_unit: &str,
    places: &[usize],
    part: usize,
    parts: usize,
    known: bool,
) -> ConvergencePlot {
    let number = if parts > 1 { format!(" ({} of {parts})", part + 1) } else { String::new() };
    let what = if known { "Value less the truth" } else { "Value" };
    let mut plot = ConvergencePlot::new(format!("{what}, {}{number}", unit(of_unit)), unit(of_unit))
        .note("run by run, with 95 % error bars");
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
        columns.extend(["truth".to_owned(), "error in bars".to_owned()]);
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
            // One of three hundred is beyond three bars by chance.
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

fn spent(file: &IterationsFile, time: &TimeSpent) -> Table {
    let duration = format!("{} s", short(file.duration_s, 4));
    let moved = format!("{} s", short(file.duration_s * file.runs.len() as f64, 4));
    let made = format!("{} runs and their identification", time.runs);
    Table::new("", ["what", "time"]).rows([
        vec![Cell::from("motion of one run"), Cell::from(duration)],
        vec!["motion of all runs".into(), moved.into()],
        vec!["computing: robot and trajectory".into(), format!("{} s", short(time.before_runs_s, 3)).into()],
        vec![
            format!("computing: {made}").into(),
            format!("{} s", short((time.all_s - time.before_runs_s).max(0.0), 3)).into(),
        ],
    ])
}
