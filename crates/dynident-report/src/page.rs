//! Combines sections to a page.

use crate::bar_plot::BarPlot;
use crate::convergence_plot::ConvergencePlot;
use crate::curve_picture::{CurvePicture, Place};
use crate::diagram::Diagram;
use crate::error::ReportError;
use crate::heading::Heading;
use crate::heat_map::HeatMap;
use crate::key_figures::KeyFigures;
use crate::line_plot::LinePlot;
use crate::scene::Scene;
use crate::table::Table;
use crate::templates::{TEMPLATES, rendered};
use crate::text::Text;
use minijinja::{Value, context};
use std::collections::BTreeMap;

/// A section of a page.
#[derive(Clone, Debug, PartialEq)]
pub enum Section {
    /// A heading.
    Heading(Heading),
    /// Paragraphs and lists.
    Text(Text),
    /// Key figures in large type.
    KeyFigures(KeyFigures),
    /// A table.
    Table(Table),
    /// Curves.
    LinePlot(LinePlot),
    /// Quantities by run.
    ConvergencePlot(ConvergencePlot),
    /// Bars.
    BarPlot(BarPlot),
    /// A matrix in colours.
    HeatMap(HeatMap),
    /// Boxes, arrows and texts.
    Diagram(Diagram),
    /// A robot in three dimensions.
    Scene(Scene),
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
sections!(Heading, Text, KeyFigures, Table, LinePlot, ConvergencePlot, BarPlot, HeatMap, Diagram, Scene);

/// A page: title and sections.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Title.
    pub title: String,
    /// Subtitle; may be empty.
    pub subtitle: String,
    /// The sections.
    pub sections: Vec<Section>,
}

const STATIC_PLOT_SIZE: [f64; 2] = [1040.0, 300.0];

/// Largest number of rows of a table that is open at the start.
const MAX_OPEN_ROWS: usize = 15;

const UPLOT_JS: &str = include_str!("../vendor/uplot/uPlot.iife.min.js");
const UPLOT_CSS: &str = include_str!("../vendor/uplot/uPlot.min.css");
const UPLOT_LICENCE: &str = include_str!("../vendor/uplot/LICENSE");

const OGL_JS: &str = include_str!("../vendor/ogl/ogl.min.js");
const OGL_LICENCE: &str = include_str!("../vendor/ogl/LICENSE");

impl Report {
    /// Creates a page without sections.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Sets the subtitle.
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

    /// Renders the page: one HTML file with all scripts, styles and data. Its security policy forbids network access.
    ///
    /// # Errors
    /// A section with inconsistent lists or a decreasing axis; the message names it.
    pub fn html(&self) -> Result<String, ReportError> {
        let mut contents = Vec::new();
        let links = self.links();
        let mut parts = Vec::with_capacity(self.sections.len());
        for (number, section) in self.sections.iter().enumerate() {
            if let Section::Heading(heading) = section {
                contents.push(context! { id => number, text => heading.text });
            }
            parts.push(Value::from_safe_string(section.html(number, &links)?));
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
                scenes => self.sections.iter().any(|section| matches!(section, Section::Scene(_))),
                style => safe(source("report.css")),
                script => safe(source("report.js")),
                uplot_style => safe(UPLOT_CSS),
                uplot_script => safe(UPLOT_JS),
                uplot_licence => safe(UPLOT_LICENCE),
                scene_script => safe(source("scene.js")),
                ogl_script => safe(OGL_JS),
                ogl_licence => safe(OGL_LICENCE),
            },
        )
    }
}

impl Report {
    /// Anchor of each title; the first of equal titles.
    fn links(&self) -> BTreeMap<&str, String> {
        let mut links = BTreeMap::new();
        for (number, section) in self.sections.iter().enumerate() {
            let id = if matches!(section, Section::Heading(_)) { "section" } else { "part" };
            if !section.title().is_empty() {
                links.entry(section.title()).or_insert_with(|| format!("#{id}-{number}"));
            }
        }
        links
    }
}

impl Section {
    fn title(&self) -> &str {
        match self {
            Self::Heading(heading) => &heading.text,
            Self::Text(_) | Self::KeyFigures(_) => "",
            Self::Table(table) => &table.title,
            Self::LinePlot(plot) => &plot.title,
            Self::ConvergencePlot(plot) => &plot.title,
            Self::BarPlot(plot) => &plot.title,
            Self::HeatMap(map) => &map.title,
            Self::Diagram(diagram) => &diagram.title,
            Self::Scene(scene) => &scene.title,
        }
    }

    fn html(&self, number: usize, links: &BTreeMap<&str, String>) -> Result<String, ReportError> {
        let picture = |title: &str, note: &str, svg: String, legend: &str, folded: bool| {
            let svg = Value::from_safe_string(svg);
            rendered("picture.html", &context! { number, title, note, svg, legend, folded })
        };
        let plot = |title: &str, note: &str, joint: &str, data: String, picture: CurvePicture<'_>| {
            let data = Value::from_safe_string(data);
            let svg = Value::from_safe_string(picture.svg(STATIC_PLOT_SIZE[0], STATIC_PLOT_SIZE[1], Place::Page)?);
            let words = picture.in_words();
            rendered("plot.html", &context! { number, title, note, joint, data, svg, words })
        };
        match self {
            Self::Heading(heading) => rendered("heading.html", &context! { number, text => heading.text }),
            Self::Text(text) => rendered("text.html", text),
            Self::KeyFigures(figures) => rendered("key_figures.html", figures),
            Self::Table(table) => {
                table.check()?;
                let targets = table.rows.iter().flatten().filter_map(|cell| cell.to.as_deref());
                if let Some(to) = targets.into_iter().find(|to| !links.contains_key(to)) {
                    return Err(ReportError::Link { section: table.title.clone(), to: to.to_owned() });
                }
                let folded = Some(table.rows.len()).filter(|rows| *rows > MAX_OPEN_ROWS);
                rendered("table.html", &context! { number, table, links, folded, numeric => table.numeric() })
            }
            Self::LinePlot(section) => {
                plot(&section.title, &section.note, &section.joint, section.data()?, section.picture())
            }
            Self::ConvergencePlot(section) => {
                let axis = section.axis();
                plot(&section.title, &section.note, "", section.data()?, section.picture(&axis))
            }
            Self::BarPlot(section) => {
                picture(&section.title, &section.note, section.svg()?, &section.reference_label, section.is_folded)
            }
            Self::HeatMap(section) => picture(&section.title, &section.note, section.svg()?, "", false),
            Self::Diagram(section) => picture(&section.title, &section.note, section.picture(Place::Page)?, "", false),
            Self::Scene(scene) => {
                let (data, svg) = (Value::from_safe_string(scene.data()?), Value::from_safe_string(scene.svg(false)?));
                let Scene { title, note, words, is_low, .. } = scene;
                rendered("scene.html", &context! { number, title, note, words, is_low, data, svg })
            }
        }
    }
}
