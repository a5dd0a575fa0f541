//! Sections put together to one page.

use crate::bar_plot::BarPlot;
use crate::convergence_plot::ConvergencePlot;
use crate::error::ReportError;
use crate::heading::Heading;
use crate::heat_map::HeatMap;
use crate::key_figures::KeyFigures;
use crate::line_plot::LinePlot;
use crate::table::Table;
use crate::text::Text;
use minijinja::{AutoEscape, Environment, Value, context};
use serde::Serialize;

/// One section of a page; the registry of what there is.
#[derive(Clone, Debug, PartialEq)]
pub enum Section {
    /// A headline.
    Heading(Heading),
    /// Paragraphs and lists.
    Text(Text),
    /// Figures in large type.
    KeyFigures(KeyFigures),
    /// A table.
    Table(Table),
    /// Curves.
    LinePlot(LinePlot),
    /// Figures by run.
    ConvergencePlot(ConvergencePlot),
    /// Bars.
    BarPlot(BarPlot),
    /// A matrix in colours.
    HeatMap(HeatMap),
}

macro_rules! sections {
    ($($name:ident),*) => {
        $(impl From<$name> for Section {
            fn from(section: $name) -> Self {
                Self::$name(section)
            }
        })*
    };
}
sections!(Heading, Text, KeyFigures, Table, LinePlot, ConvergencePlot, BarPlot, HeatMap);

/// A page: a title and its sections in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The page's title.
    pub title: String,
    /// A line below it; may be empty.
    pub subtitle: String,
    /// The sections.
    pub sections: Vec<Section>,
}

const TEMPLATES: [(&str, &str); 15] = [
    ("page.html", include_str!("templates/page.html")),
    ("heading.html", include_str!("templates/heading.html")),
    ("text.html", include_str!("templates/text.html")),
    ("key_figures.html", include_str!("templates/key_figures.html")),
    ("table.html", include_str!("templates/table.html")),
    ("plot.html", include_str!("templates/plot.html")),
    ("picture.html", include_str!("templates/picture.html")),
    ("bar_plot.svg", include_str!("templates/bar_plot.svg")),
    ("heat_map.svg", include_str!("templates/heat_map.svg")),
    ("line_plot.svg", include_str!("templates/line_plot.svg")),
    ("motion_picture.svg", include_str!("templates/motion_picture.svg")),
    ("path_picture.svg", include_str!("templates/path_picture.svg")),
    ("fitness_picture.svg", include_str!("templates/fitness_picture.svg")),
    ("report.css", include_str!("templates/report.css")),
    ("report.js", include_str!("templates/report.js")),
];

const UPLOT_JS: &str = include_str!("../vendor/uplot/uPlot.iife.min.js");
const UPLOT_CSS: &str = include_str!("../vendor/uplot/uPlot.min.css");
const UPLOT_LICENCE: &str = include_str!("../vendor/uplot/LICENSE");

impl Report {
    /// A page without sections.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// The line below the title.
    #[must_use]
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = subtitle.into();
        self
    }

    /// Appends a section.
    pub fn add(&mut self, section: impl Into<Section>) -> &mut Self {
        self.sections.push(section.into());
        self
    }

    /// The page: one HTML file with all scripts, styles and data inside. It asks nothing of any network, and its
    /// security policy forbids that.
    ///
    /// # Errors
    /// A section whose lists do not belong together, or whose axis runs backwards; the message names it.
    pub fn html(&self) -> Result<String, ReportError> {
        let mut contents = Vec::new();
        let mut parts = Vec::with_capacity(self.sections.len());
        for (number, section) in self.sections.iter().enumerate() {
            if let Section::Heading(heading) = section {
                contents.push(context! { id => number, text => heading.text });
            }
            parts.push(Value::from_safe_string(section.html(number)?));
        }
        let safe = |text: &str| Value::from_safe_string(text.to_owned());
        let source = |wanted: &str| TEMPLATES.iter().find(|(name, _)| *name == wanted).map_or("", |(_, text)| *text);
        rendered(
            "page.html",
            &context! {
                title => self.title,
                subtitle => self.subtitle,
                contents,
                parts,
                plots => self.sections.iter().any(|s| matches!(s, Section::LinePlot(_) | Section::ConvergencePlot(_))),
                style => safe(source("report.css")),
                script => safe(source("report.js")),
                uplot_style => safe(UPLOT_CSS),
                uplot_script => safe(UPLOT_JS),
                uplot_licence => safe(UPLOT_LICENCE),
            },
        )
    }
}

impl Section {
    fn html(&self, number: usize) -> Result<String, ReportError> {
        let picture = |title: &str, note: &str, svg: String, legend: &str| {
            let svg = Value::from_safe_string(svg);
            rendered("picture.html", &context! { title, note, svg, legend })
        };
        let plot = |title: &str, note: &str, data: String| {
            let data = Value::from_safe_string(data);
            rendered("plot.html", &context! { number, title, note, data })
        };
        match self {
            Self::Heading(heading) => rendered("heading.html", &context! { number, text => heading.text }),
            Self::Text(text) => rendered("text.html", text),
            Self::KeyFigures(figures) => rendered("key_figures.html", figures),
            Self::Table(table) => {
                table.check()?;
                rendered("table.html", &context! { table, numeric => table.numeric() })
            }
            Self::LinePlot(section) => plot(&section.title, &section.note, section.data()?),
            Self::ConvergencePlot(section) => plot(&section.title, &section.note, section.data()?),
            Self::BarPlot(section) => picture(&section.title, &section.note, section.svg()?, &section.reference_label),
            Self::HeatMap(section) => picture(&section.title, &section.note, section.svg()?, ""),
        }
    }
}

/// A template filled in; everything that is not marked safe is escaped, in SVG as in HTML.
pub(crate) fn rendered(name: &str, view: &impl Serialize) -> Result<String, ReportError> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_trim_blocks(true);
    environment.set_lstrip_blocks(true);
    for (name, source) in TEMPLATES.iter().filter(|(name, _)| !name.starts_with("report.")) {
        environment.add_template(name, source)?;
    }
    let mut text = environment.get_template(name)?.render(view)?;
    if text.starts_with("<svg") {
        // XML has no place for control characters.
        text.retain(|letter| letter == '\n' || !letter.is_control());
    }
    Ok(text)
}
