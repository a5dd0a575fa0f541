//! Tables of parameters in the report of an identification.

use super::unit;
use crate::result::{
    BaseParameterResult, BodyResult, ErrorTermResult, JointFrictionResult, POORLY_KNOWN_PERCENT, ResultFile,
    TermResult, ValueSource,
};
use dynident_estimation::HALF_WIDTH_95;
use dynident_estimation::consistent::IntervalEnd;
use dynident_identification::DriveInertiaEstimate;
use dynident_identification::consistent::ParameterInterval;
use dynident_identification::friction::FrictionConstant;
use dynident_report::{BarPlot, Cell, HeatMap, Report, Table, Text, Tone, short};

const MAX_CORRELATED_PARAMETERS: usize = 80;

fn base_table(page: &mut Report, r: &ResultFile) {
    let optional = |value: Option<f64>| Cell::from(value.map_or_else(String::new, |value| short(value, 5)));
    let row = |p: &BaseParameterResult| {
        let relative = p.relative_half_width_percent();
        let tone =
            if relative.is_none_or(|relative| relative > POORLY_KNOWN_PERCENT) { Tone::Warning } else { Tone::Plain };
        let relative = relative.map_or_else(String::new, |value| short(value, 3));
        vec![
            Cell::from(&p.expression),
            short(p.value, 6).into(),
            short(p.bar_95(), 3).into(),
            Cell::judged(relative, if p.excited { tone } else { Tone::Bad }),
            optional(p.physical),
            optional(p.prior),
            Cell::from(unit(&p.unit)),
            Cell::from(largest_error(p)),
        ]
    };
    let columns = [
        "expression",
        "estimate",
        "± (95 %)",
        "± in %",
        "consistent set",
        "robot description",
        "unit",
        "largest error source",
    ];
    page.add(Table::new("Base parameters", columns).rows(r.base_parameters.iter().map(row)));
}

fn largest_error(p: &BaseParameterResult) -> String {
    let words = |(term, share): (&ErrorTermResult, f64)| format!("{} ({:.0} %)", term.name(), 100.0 * share);
    p.largest_error().map_or_else(String::new, words)
}

pub(super) fn parameters(page: &mut Report, r: &ResultFile) {
    // One plot per unit, because parameters in a plot have a common scale.
    let mut units: Vec<&str> = Vec::new();
    for parameter in &r.base_parameters {
        if !units.contains(&parameter.unit.as_str()) {
            units.push(&parameter.unit);
        }
    }
    for of_unit in units {
        let mut plot = BarPlot::new(format!("Base parameters in {}", unit(of_unit)), unit(of_unit))
            .note("with 95 % error bars")
            .reference_label("robot description");
        for p in r.base_parameters.iter().filter(|parameter| parameter.unit == of_unit) {
            let half_width = p.excited.then_some(p.bar_95());
            plot = plot.bar(&p.expression, if p.excited { p.value } else { f64::NAN }, half_width, p.prior);
        }
        page.add(plot);
    }
    base_table(page, r);
    if !r.method.coincident.is_empty() {
        let points = r.method.coincident.iter().map(|sentence| (Tone::Warning, sentence.clone())).collect();
        page.add(Text { paragraphs: Vec::new(), points });
    }
    if !r.method.not_excited.is_empty() {
        let mut points = vec![(
            Tone::Warning,
            format!(
                "Not excited by the logs, fixed at the values of the robot description: {}",
                r.method.not_excited.join(", ")
            ),
        )];
        if !r.method.resting_joints.is_empty() {
            let text = format!("Not moved above encoder noise in any log: {}", r.method.resting_joints.join(", "));
            points.push((Tone::Warning, text));
        }
        page.add(Text { paragraphs: Vec::new(), points });
        conditional_estimates(page, r);
    }
    let n = r.base_parameters.len();
    if (2..=MAX_CORRELATED_PARAMETERS).contains(&n) && r.base_parameter_covariance.len() == n {
        let std = |i: usize| r.base_parameter_covariance[i][i].sqrt();
        let value = |i: usize, j: usize| r.base_parameter_covariance[i][j] / (std(i) * std(j));
        let values = (0..n).map(|i| (0..n).map(|j| value(i, j)).collect()).collect();
        let names = || r.base_parameters.iter().map(|parameter| parameter.symbol.clone());
        page.add(HeatMap::new("Correlation of the base parameters", names(), names(), values).limit(1.0));
        let strongest = r.correlations.iter().map(|pair| {
            let [first, second] = &pair.parameters;
            vec![Cell::from(first), Cell::from(second), Cell::from(short(pair.correlation, 4))]
        });
        page.add(Table::new("Strongest correlations", ["parameter", "and", "correlation"]).rows(strongest));
    }
}

/// Adds estimates that depend on parameters fixed at nominal values.
fn conditional_estimates(page: &mut Report, r: &ResultFile) {
    let rows = r.base_parameters.iter().filter(|p| !p.conditional_on.is_empty()).map(|p| {
        let on = p.conditional_on.iter().map(|own| format!("{} ({} per unit)", own.on, short(own.per_unit, 3)));
        let with = p.half_width_95_with_nominal.map_or_else(String::new, |bar| short(bar, 3));
        vec![
            Cell::from(&p.symbol),
            short(p.value, 6).into(),
            short(p.half_width_95, 3).into(),
            Cell::from(with),
            Cell::from(on.collect::<Vec<_>>().join(", ")),
        ]
    });
    let rows: Vec<Vec<Cell>> = rows.collect();
    if rows.is_empty() {
        return;
    }
    let columns =
        ["parameter", "estimate", "± (95 %) if these are exact", "± (95 %) with their uncertainty", "fixed at nominal"];
    page.add(Table::new("Estimates that depend on unexcited parameters", columns).rows(rows));
}

pub(super) fn friction(page: &mut Report, r: &ResultFile) {
    let mut table = Table::new("", ["joint", "parameter", "value", "± (95 %)", "unit"]).note(
        "from the physically consistent set if there is one; error bars only for separately identified parameters",
    );
    // A term that is identified separately is a base parameter; its error bar is the one that is shown.
    let bar = |term: &TermResult| {
        let base = r.base_parameters.iter().find(|p| Some(&p.expression) == term.base_parameter.as_ref());
        base.filter(|p| term.std.is_some() && p.excited).map_or_else(String::new, |p| short(p.half_width_95, 3))
    };
    let owned = r.joints.iter().map(|joint| (joint.name.as_str(), &joint.terms[..]));
    let coupled = [("coupling", &r.couplings[..])];
    for (name, terms) in owned.chain(coupled) {
        for term in terms {
            table =
                table.row([name.to_owned(), term.symbol.clone(), short(term.value, 5), bar(term), unit(&term.unit)]);
        }
    }
    page.add(table);
    lags(page, r);
    drives(page, r);
    if !r.friction_choice.is_empty() {
        let row = |joint: &JointFrictionResult| {
            let constants: Vec<String> = joint.constants.iter().map(constant).collect();
            let chosen =
                joint.restriction().map_or_else(|| joint.chosen.clone(), |cost| format!("{} ({cost})", joint.chosen));
            vec![Cell::from(&joint.joint), Cell::from(chosen), Cell::from(constants.join(", "))]
        };
        let header = ["joint", "friction", "constants with 95 % intervals (rad/s or m/s, and their powers)"];
        page.add(Table::new("Selected friction", header).rows(r.friction_choice.iter().map(row)));
    }
}

/// Adds the test for drive inertia, with the estimate of each joint.
fn drives(page: &mut Report, r: &ResultFile) {
    let Some(choice) = &r.drive_inertia_choice else { return };
    let row = |drive: &DriveInertiaEstimate| {
        let figures = [short(drive.inertia, 3), short(drive.half_width_95, 3)].map(Cell::from);
        core::iter::once(Cell::from(&drive.joint)).chain(figures).collect::<Vec<_>>()
    };
    if !choice.drives.is_empty() {
        let header = ["joint", "drive inertia, kg m² (kg)", "± (95 %)"];
        let table = Table::new("Test for drive inertia", header)
            .note("least squares with stated friction, before any other selection");
        page.add(table.rows(choice.drives.iter().map(row)));
    }
    page.add(Text::new(format!("Drive inertia: {}.", choice.sentence())));
}

/// A constant of the selected friction as text.
fn constant(own: &FrictionConstant) -> String {
    let [from, to] = own.interval_95;
    format!("{} {} {} ({} to {})", own.term, own.constant, short(own.value, 3), short(from, 2), short(to, 2))
}

/// Explanation of the marks after the values of bodies.
const MARKS: &str = "~: identified only in sums; =: not identified, nominal value";

/// Mark of a body's value, in the order of the ten parameters.
fn source_mark(body: &BodyResult, parameter: usize) -> &'static str {
    match body.sources.map(|sources| sources[parameter]) {
        Some(ValueSource::Partly) => "\u{a0}~",
        Some(ValueSource::Nominal) => "\u{a0}=",
        Some(ValueSource::Measured) | None => "",
    }
}

pub(super) fn bodies(page: &mut Report, r: &ResultFile) {
    let mut verdict = Text::new(format!("Consistency is that {}.", r.physical.note));
    if r.physical.consistent {
        let tone = if r.problems.is_empty() && r.method.is_settled() { Tone::Good } else { Tone::Plain };
        verdict = verdict.point(tone, "every body, friction and drive is physically consistent");
    }
    let failure = r.physical.failure.iter().map(|reason| format!("no physically consistent set: {reason}"));
    for violation in r.physical.violations.iter().cloned().chain(failure) {
        verdict = verdict.point(Tone::Bad, violation);
    }
    if let Some(reason) = &r.no_urdf {
        verdict = verdict.point(Tone::Warning, format!("no identified.urdf: {reason}"));
    }
    if let Some(reason) = &r.no_mjcf {
        verdict = verdict.point(Tone::Warning, format!("no identified.xml: {reason}"));
    }
    if let Some(reason) = &r.no_sdf {
        verdict = verdict.point(Tone::Warning, format!("no identified.sdf: {reason}"));
    }
    page.add(verdict);
    let rows = r.bodies.iter().map(|body| {
        let prior = body.prior.map_or_else(String::new, |prior| short(prior[0], 4));
        let marked = |text: String, k: usize| Cell::from(text + source_mark(body, k));
        let bar = body.std.map_or_else(String::new, |std| short(HALF_WIDTH_95 * std[0], 3));
        let mut row = vec![Cell::from(&body.name), marked(short(body.mass_kg, 4), 0), bar.into(), prior.into()];
        row.extend((0..3).map(|k| body.com_m.map_or_else(|| Cell::from(""), |com| marked(short(com[k], 4), k + 1))));
        let least = body.pseudo_inertia_min_eigenvalue;
        row.push(Cell::judged(short(least, 3), if least > 0.0 { Tone::Plain } else { Tone::Bad }));
        row
    });
    let bars = if r.description_differences.is_some() {
        "± averaged over the explanations of the difference from the robot description"
    } else {
        "± for 30 % uncertainty of the robot description"
    };
    let note = format!("{bars}; centre of mass in the body frame; smallest eigenvalue of the pseudo-inertia; {MARKS}");
    let columns = ["body", "mass, kg", "± (95 %), kg", "nominal, kg", "x, m", "y, m", "z, m", "smallest eigenvalue"];
    page.add(Table::new("Bodies", columns).note(note).rows(rows));
    let rows = r.bodies.iter().map(|body| {
        let inertia = body.inertia_at_origin_kgm2.iter().enumerate();
        let inertia = inertia.map(|(k, value)| Cell::from(short(*value, 4) + source_mark(body, k + 4)));
        [Cell::from(&body.name)].into_iter().chain(inertia).collect()
    });
    let note = format!("kg m², in the body frame, about its origin; {MARKS}");
    let columns = ["body", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];
    page.add(Table::new("Inertia of the bodies", columns).note(note).rows(rows));
    if let Some(found) = &r.possible_intervals {
        page.add(intervals(found));
    }
}

/// Intervals of all parameters.
fn intervals(found: &[ParameterInterval]) -> Table {
    let end = |end: Option<f64>| Cell::from(end.map_or_else(|| "open".to_owned(), |end| short(end, 4)));
    let holder = |end: IntervalEnd| match end {
        IntervalEnd::Data => "data",
        IntervalEnd::Constraint => "physical consistency",
        IntervalEnd::Open => "–",
        IntervalEnd::Unsettled => "not converged",
    };
    let rows = found.iter().map(|interval| {
        vec![
            Cell::from(&interval.symbol),
            interval.of.clone().unwrap_or_default().into(),
            unit(&interval.unit).into(),
            short(interval.value, 4).into(),
            end(interval.lower),
            end(interval.upper),
            holder(interval.held_by[0]).into(),
            holder(interval.held_by[1]).into(),
        ]
    });
    let note = "every value in an interval belongs to a physically consistent set that the data do not reject at 95 %; each end is limited by the data, by physical consistency, or not at all";
    Table::new(
        "Possible intervals of the parameters",
        ["parameter", "of", "unit", "best fit", "from", "to", "lower end limited by", "upper end limited by"],
    )
    .note(note)
    .rows(rows)
}

fn lags(page: &mut Report, r: &ResultFile) {
    if r.joints.iter().all(|joint| joint.torque_lag.is_none()) {
        return;
    }
    let rows = r.joints.iter().filter_map(|joint| {
        let lag = joint.torque_lag?;
        let ms = |seconds: f64| Cell::from(short(1e3 * seconds, 3));
        let tone = if lag.matters { Tone::Warning } else { Tone::Plain };
        Some(vec![Cell::from(&joint.name), Cell::judged(short(1e3 * lag.lag_s, 3), tone), ms(lag.half_width_95_s)])
    });
    let table = Table::new("Lag of the torque behind the motion", ["joint", "lag, ms", "± (95 %), ms"])
        .note("estimated with the model for each log, including the compensated part; marked if the remaining lag changes the torque by more than the residual")
        .rows(rows);
    page.add(table);
    if let Some(what) = r.method.torque_lag.sentence() {
        page.add(Text::new(format!("Lag of the torque: {what}.")));
    }
}
