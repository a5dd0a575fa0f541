//! The model in each class of export formats: what is fitted again, and the held-out error of each class.

use crate::result::ResultFile;
use dynident_model::terms::TermClass;
use dynident_report::{Report, Table};

/// Adds the table of export formats; adds nothing for results without them.
pub(super) fn forms(page: &mut Report, r: &ResultFile) {
    if r.forms.is_empty() {
        return;
    }
    let percent = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2} %"));
    // Without hysteresis friction, code with state equals code without state.
    let shown = r.forms.iter().filter(|form| form.class != TermClass::WithState || form.has_memory());
    let rows = shown.flat_map(|form| {
        // The columns of the table "What each form can hold" of the book (docs/src/export.md).
        let (held, refitted) = match form.class {
            TermClass::DampingAndFriction => {
                ("bodies, damping, Coulomb friction", "damping and friction of each joint")
            }
            TermClass::DampingFrictionAndInertia => (
                "bodies, damping, Coulomb friction, drive inertia, springs",
                "damping, friction and drive inertia of each joint",
            ),
            TermClass::FunctionsOfMotion => (
                "all terms that depend on the current motion, with smooth steps",
                "joints with friction that has memory or depends on temperature, with a sign or with a narrow step",
            ),
            TermClass::WithState => (
                "the same, and friction with memory",
                "joints with friction that depends on temperature, with a sign or with a narrow step",
            ),
        };
        let refitted = if form.refitted { refitted } else { "nothing: all terms are kept" };
        let row = move |log: &str, error: Option<f64>, model: Option<f64>| {
            let names = form.forms.join(", ");
            let names = if form.class == TermClass::WithState { format!("function step of {names}") } else { names };
            let cells = [names, held.to_owned(), refitted.to_owned(), log.to_owned()];
            let errors = [percent(error), percent(model)];
            cells.into_iter().chain(errors).map(Into::into).collect::<Vec<_>>()
        };
        let of_log = |error: &crate::result::FormError| {
            row(&error.log, error.relative_error_percent, error.model_relative_error_percent)
        };
        let rows: Vec<_> = form.held_out.iter().map(of_log).collect();
        if rows.is_empty() { vec![row("none held out", None, None)] } else { rows }
    });
    page.add(
        Table::new(
            "Forms of the model",
            ["form", "can hold", "refitted", "held-out log", "error of the form", "error of the model"],
        )
        .rows(rows),
    );
}
