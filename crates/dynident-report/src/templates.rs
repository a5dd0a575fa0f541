//! Templates of pages and pictures.

use crate::error::ReportError;
use dynident_text::visible;
use minijinja::{AutoEscape, Environment, HtmlEscape, Value};
use serde::Serialize;
use std::borrow::Cow;
use std::path::Path;

pub(crate) const TEMPLATES: [(&str, &str); 20] = [
    ("page.html", include_str!("templates/page.html")),
    ("heading.html", include_str!("templates/heading.html")),
    ("text.html", include_str!("templates/text.html")),
    ("key_figures.html", include_str!("templates/key_figures.html")),
    ("table.html", include_str!("templates/table.html")),
    ("plot.html", include_str!("templates/plot.html")),
    ("picture.html", include_str!("templates/picture.html")),
    ("bar_plot.svg", include_str!("templates/bar_plot.svg")),
    ("heat_map.svg", include_str!("templates/heat_map.svg")),
    ("diagram.svg", include_str!("templates/diagram.svg")),
    ("line_plot.svg", include_str!("templates/line_plot.svg")),
    ("motion_picture.svg", include_str!("templates/motion_picture.svg")),
    ("path_picture.svg", include_str!("templates/path_picture.svg")),
    ("fitness_picture.svg", include_str!("templates/fitness_picture.svg")),
    ("print_figure.svg", include_str!("templates/print_figure.svg")),
    ("scene.html", include_str!("templates/scene.html")),
    ("scene.svg", include_str!("templates/scene.svg")),
    ("scene.js", include_str!("templates/scene.js")),
    ("report.css", include_str!("templates/report.css")),
    ("report.js", include_str!("templates/report.js")),
];

/// Converts text to HTML: escaped, with text between backticks as code. An unpaired backtick remains.
fn prose(text: &str) -> Value {
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return Value::from_safe_string(HtmlEscape(text).to_string());
    }
    let part = |(k, part): (usize, &&str)| match k % 2 {
        0 => HtmlEscape(part).to_string(),
        _ => format!("<code>{}</code>", HtmlEscape(part)),
    };
    Value::from_safe_string(parts.iter().enumerate().map(part).collect())
}

/// Whether a file is a template that has to be rendered; scripts and styles are included as they are.
fn is_template(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|kind| kind == "html" || kind == "svg")
}

/// Renders a template; everything that is not marked as safe is escaped, in HTML and SVG. Invisible characters are
/// shown as escape sequences.
pub(crate) fn rendered(name: &str, view: &impl Serialize) -> Result<String, ReportError> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_filter("prose", prose);
    environment.set_trim_blocks(true);
    environment.set_lstrip_blocks(true);
    for (name, source) in TEMPLATES.iter().filter(|(name, _)| is_template(name)) {
        environment.add_template(name, source)?;
    }
    let text = environment.get_template(name)?.render(view)?;
    // The escape sequences are valid in text and in JSON.
    Ok(match visible(&text) {
        Cow::Borrowed(_) => text,
        Cow::Owned(visible) => visible,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_is_marked_and_nothing_else_is() {
        let shown = |text: &str| prose(text).to_string();
        assert_eq!(shown("run `a <b>` & `c`"), "run <code>a &lt;b&gt;</code> &amp; <code>c</code>");
        assert_eq!(shown("a ` alone <i>"), "a ` alone &lt;i&gt;");
        assert_eq!(shown("none"), "none");
    }
}
