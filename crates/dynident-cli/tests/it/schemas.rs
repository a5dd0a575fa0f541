//! The stored schemas are those of the types.

#[path = "../../examples/schemas.rs"]
#[expect(dead_code, reason = "the example's own main")]
mod example;

use std::collections::BTreeMap;
use std::path::Path;

fn files(folder: &Path) -> BTreeMap<String, String> {
    let read = |entry: std::io::Result<std::fs::DirEntry>| {
        let entry = entry.unwrap();
        (entry.file_name().into_string().unwrap(), std::fs::read_to_string(entry.path()).unwrap())
    };
    std::fs::read_dir(folder).unwrap().map(read).collect()
}

#[test]
fn schemas_are_those_of_the_types() {
    let made = tempfile::tempdir().unwrap();
    example::write_all(made.path()).unwrap();
    let shipped = files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas"));
    let made = files(made.path());
    assert_eq!(made.keys().collect::<Vec<_>>(), shipped.keys().collect::<Vec<_>>());
    for (name, schema) in &made {
        let again = "cargo run -p dynident-cli --features schema --example schemas";
        assert!(*schema == shipped[name], "{name} of docs/schemas is of other types: make it again by `{again}`");
    }
}
