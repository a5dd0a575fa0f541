//! Check that data for one model are valid for another model: both must have the same tree.

use dynident_model::Model;

/// Parent of each body.
pub(crate) fn parents(model: &Model) -> Vec<Option<usize>> {
    model.maps().iter().map(|map| map.parent).collect()
}

pub(crate) fn same_tree(parents: &[Option<usize>], model: &Model) -> bool {
    model.maps().iter().map(|map| map.parent).eq(parents.iter().copied())
}
