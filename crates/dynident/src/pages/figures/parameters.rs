use super::data::Data;
use super::{Figure, units};
use crate::pages::unit;
use crate::result::{BaseParameterResult, ResultFile};
use dynident_report::{BarPlot, Cell, PrintPanel, Table, short};

impl Figure {
    /// Plots base parameters with 95 % error bars and the values of the robot description, one plot for each unit.
    pub fn parameters(r: &ResultFile) -> Self {
        let panels = units(r.base_parameters.iter().map(|own| own.unit.as_str())).into_iter().map(|of_unit| {
            let own = r.base_parameters.iter().filter(|own| own.unit == of_unit);
            let plot = BarPlot::new(format!("Base parameters, {}", unit(of_unit)), "");
            let described = own.clone().any(|own| own.prior.is_some());
            let plot = plot.reference_label(if described { "robot description" } else { "" });
            PrintPanel::Bars(own.fold(plot, |plot, own| plot.bar(&own.symbol, value(own), bar(own), own.prior)))
        });
        let mut data = Data::new([
            "symbol",
            "expression",
            "unit",
            "value",
            "half_width_95",
            "consistent_set",
            "robot_description",
            "excited",
        ]);
        for own in &r.base_parameters {
            data.add([
                (&own.symbol).into(),
                (&own.expression).into(),
                (&own.unit).into(),
                value(own).into(),
                bar(own).into(),
                own.physical.into(),
                own.prior.into(),
                (if own.excited { "yes" } else { "no" }).into(),
            ]);
        }
        Self::new(format!("Base parameters of {}", r.name), panels.collect(), data, table(r))
    }
}

/// The estimate; NaN for a parameter that the logs do not excite.
fn value(own: &BaseParameterResult) -> f64 {
    if own.excited { own.value } else { f64::NAN }
}

fn bar(own: &BaseParameterResult) -> Option<f64> {
    own.excited.then(|| own.bar_95())
}

fn table(r: &ResultFile) -> Table {
    let columns = ["parameter", "expression", "estimate", "± (95 %)", "consistent set", "robot description", "unit"];
    let number =
        |value: Option<f64>, digits| Cell::from(value.map_or_else(|| "–".to_owned(), |value| short(value, digits)));
    let row = |own: &BaseParameterResult| {
        vec![
            Cell::from(&own.symbol),
            Cell::from(&own.expression),
            number(Some(value(own)), 5),
            number(bar(own), 2),
            number(own.physical, 5),
            number(own.prior, 5),
            Cell::from(unit(&own.unit)),
        ]
    };
    Table::new(format!("Base parameters of {}", r.name), columns)
        .note("estimate with the half-width of the 95 % interval; –: not excited, or unknown")
        .rows(r.base_parameters.iter().map(row))
}
