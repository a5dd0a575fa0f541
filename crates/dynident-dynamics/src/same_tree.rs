//! Whether what was made for one model fits another: both hang together alike.

use dynident_model::Model;

/// Which body hangs on which.
pub(crate) fn parents(model: &Model) -> Vec<Option<usize>> {
    model.maps().iter().map(|map| map.parent).collect()
}

/// Whether a model's bodies hang on each other as `parents` says.
pub(crate) fn same_tree(parents: &[Option<usize>], model: &Model) -> bool {
    model.maps().iter().map(|map| map.parent).eq(parents.iter().copied())
}
