//! The held-out error of the model in each export format.

use super::text::{percent, wrapped};
use dynident::ResultFile;
use dynident::model::terms::TermClass;

/// The export formats with their errors, one line for each held-out log; empty if no log was held out.
pub(super) fn forms(r: &ResultFile) -> String {
    let mut text = String::new();
    for (number, log) in r.validation.iter().enumerate() {
        let of_form = |form: &dynident::result::FormResult| {
            let has_state = form.class == TermClass::WithState;
            if has_state && !form.has_memory() {
                return None;
            }
            let error = form.held_out.iter().find(|error| error.log == log.log)?.relative_error_percent?;
            let names = if has_state { "function step of code".to_owned() } else { form.forms.join("/") };
            Some(format!("{names} {}\u{a0}%", percent(Some(error))))
        };
        let errors: Vec<String> = r.forms.iter().filter_map(of_form).collect();
        if !errors.is_empty() {
            let line = format!(
                "error of exported files on [{}]; terms that a format lacks are replaced: {}",
                number + 1,
                errors.join(", ")
            );
            text += &wrapped(&line, 2);
        }
    }
    text
}
