//! Structure of the workspace's sources: files are short, and no files import each other around a loop.

use hyst_tests::{root, structure};

/// Maximum number of lines of a file.
const MAX_LINES: usize = 400;
/// Longer files: sets of cases that were frozen when they were used, and the declarations of the Python module.
const LONGER: [&str; 2] = ["tests/examination/", "crates/hyst-py/python/hyst/_hyst.pyi"];

#[test]
fn files_are_short() {
    let mut long = structure::long_files(root(), MAX_LINES).unwrap();
    long.retain(|(file, _)| !LONGER.iter().any(|start| file.starts_with(start)));
    let list: String = long.iter().map(|(file, lines)| format!("\n  {file}: {lines} lines")).collect();
    assert!(long.is_empty(), "files with more than {MAX_LINES} lines; split them by idea:{list}");
}

#[test]
fn no_files_import_each_other_around_a_loop() {
    let mut list = String::new();
    for part in structure::crates(root()).unwrap() {
        for found in structure::loops(&part.sources).unwrap_or_else(|error| panic!("{}/{error}", part.folder)) {
            list += &format!("\n  {}: {} → {}", part.folder, found.join(" → "), found[0]);
        }
    }
    assert!(list.is_empty(), "files that import each other; move what both need into a file of its own:{list}");
}
