//! **Report pages**: results as one self-contained HTML page, without network access or other files.
//!
//! A [`Report`] is a list of typed sections, each a plain struct with a template. Line plots are interactive
//! ([uPlot](https://github.com/leeoniya/uPlot), embedded): they show the values at the cursor, zoom by dragging, and
//! show or hide curves by their legend. Bars and heat maps are pictures with tooltips. Without scripts and in print,
//! every plot is a static picture. Pages support light and dark themes, narrow screens, keyboard and screen readers.
//! All content is escaped: names of joints or files never become markup or script.
//!
//! ```
//! use dynident_report::{KeyFigures, LinePlot, Report, Table};
//! let time: Vec<f64> = (0..5000).map(|i| f64::from(i) * 0.001).collect();
//! let mut report = Report::new("Elbow & wrist");
//! report.add(KeyFigures::new().figure("relative error", "2.7 %", "held-out log"));
//! report.add(
//!     LinePlot::new("Torque of the elbow", "s", "Nm", time.clone())
//!         .line("measured", time.iter().map(|t| (3.0 * t).sin()).collect())
//!         .line("predicted", time.iter().map(|t| 0.98 * (3.0 * t).sin()).collect()),
//! );
//! report.add(Table::new("Friction", ["joint", "viscous, Nm s"]).row(["elbow <1>", "2.10"]));
//! let page = report.html()?;
//! assert!(page.contains("Elbow &amp; wrist") && page.contains("elbow &lt;1&gt;"));
//! # Ok::<(), dynident_report::ReportError>(())
//! ```
#![forbid(unsafe_code)]

mod bar_plot;
mod convergence_plot;
mod curve_picture;
mod decimation;
mod diagram;
mod error;
mod fitness_picture;
mod heading;
mod heat_map;
mod key_figures;
mod line_plot;
mod motion_picture;
mod page;
mod palette;
mod path_picture;
mod pen;
mod plot_data;
mod print_figure;
mod print_file;
mod scene;
mod scene_picture;
mod surface;
mod table;
mod table_text;
mod templates;
mod text;
mod ticks;
mod tone;

pub use bar_plot::{Bar, BarPlot};
pub use convergence_plot::ConvergencePlot;
pub use decimation::kept_samples;
pub use diagram::{Diagram, LineStyle, Shape};
pub use error::ReportError;
pub use fitness_picture::FitnessPicture;
pub use heading::Heading;
pub use heat_map::HeatMap;
pub use key_figures::{KeyFigure, KeyFigures};
pub use line_plot::{Line, LinePlot};
pub use motion_picture::{MotionCurve, MotionPicture};
pub use page::{Report, Section};
pub use path_picture::{ArmPose, ColumnShape, PathPicture, Place};
pub use print_figure::{PrintFigure, PrintPanel, PrintStyle};
pub use scene::{BodyMotion, BodyPair, Colouring, Ellipsoid, Gauge, Scene, SceneBody, SceneMotion};
pub use surface::Surface;
pub use table::{Cell, Table};
pub use text::Text;
pub use ticks::short;
pub use tone::Tone;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
