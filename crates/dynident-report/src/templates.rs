//! The templates of pages and pictures, and how they are filled in.

use crate::error::ReportError;
use minijinja::{AutoEscape, Environment};
use serde::Serialize;

pub(crate) const TEMPLATES: [(&str, &str); 15] = [
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
