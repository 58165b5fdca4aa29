//! Loops of made-up crates.

use super::*;

/// Returns the loops of a crate of these files; `lib.rs` is empty if it is not among them.
fn found(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    let source = |(file, text): &(&str, &str)| Source { file: (*file).to_owned(), text: (*text).to_owned() };
    let mut sources: Vec<Source> = files.iter().map(source).collect();
    if !sources.iter().any(|source| source.file == "lib.rs") {
        sources.push(source(&("lib.rs", "")));
    }
    loops(&sources).unwrap()
}

#[test]
fn files_that_import_each_other_are_a_loop() {
    let inline = ("b.rs", "fn g() -> u8 { crate::a::f() }");
    assert_eq!(found(&[("a.rs", "use crate::b::g; pub fn f() {}"), inline]), [["a.rs", "b.rs"]]);
    assert_eq!(found(&[("a.rs", "use super::{b::{self, g}}; pub fn f() {}"), inline]), [["a.rs", "b.rs"]]);
    assert_eq!(found(&[("a.rs", "fn f() { assert!(1 == crate::b::g()); }"), inline]), [["a.rs", "b.rs"]]);
    assert_eq!(found(&[("a.rs", "fn f(x: Vec<crate::b::G>) {}"), inline]), [["a.rs", "b.rs"]]);
    assert!(found(&[("a.rs", "pub fn f() {}"), inline]).is_empty());
}

#[test]
fn a_longer_loop_is_shown_from_file_to_file() {
    let files = [
        ("a.rs", "use crate::b::B;"),
        ("b.rs", "use super::c;"),
        ("c/mod.rs", "mod deep; use deep::D;"),
        ("c/deep.rs", "fn f() { super::super::a::A }"),
        ("d.rs", "use crate::a::A;"),
    ];
    assert_eq!(found(&files), [["a.rs", "b.rs", "c/mod.rs", "c/deep.rs"]]);
}

#[test]
fn a_module_and_its_child_can_be_a_loop() {
    let child = ("run/view.rs", "use super::Values; pub struct View;");
    assert_eq!(
        found(&[("run.rs", "mod view; use view::View; pub struct Values;"), child]),
        [["run.rs", "run/view.rs"]]
    );
    // Without `use view::View`.
    assert!(found(&[("run.rs", "mod view; pub struct Values;"), child]).is_empty());
}

#[test]
fn a_re_export_is_no_import_and_is_followed_to_the_definition() {
    let [a, b] = [("a.rs", "pub struct A; fn f(b: crate::Renamed) {}"), ("b.rs", "use crate::A; pub struct B;")];
    assert_eq!(
        found(&[("lib.rs", "mod a; mod b; pub use a::A; pub(crate) use b::B as Renamed;"), a, b]),
        [["a.rs", "b.rs"]]
    );
    let a = ("a.rs", "pub struct A; fn f(b: crate::B) {}");
    assert_eq!(found(&[("lib.rs", "mod a; mod b; pub use a::*; pub use b::*;"), a, b]), [["a.rs", "b.rs"]]);
    // The root defines `B` itself.
    assert!(found(&[("lib.rs", "mod a; mod b; pub use a::*; pub use b::*; struct B;"), a, b]).is_empty());
    // Siblings that import each other's names from their parent, without a loop.
    let parent = ("p/mod.rs", "mod x; mod y; pub use x::X; pub use y::Y;");
    assert!(found(&[parent, ("p/x.rs", "pub struct X;"), ("p/y.rs", "use super::X; pub struct Y;")]).is_empty());
    // Re-exports of one another have no definition.
    assert!(
        found(&[("a.rs", "pub use crate::b::C;"), ("b.rs", "pub use crate::a::C; fn f(c: crate::a::C) {}")]).is_empty()
    );
}

#[test]
fn tests_and_visibilities_are_no_imports() {
    let b = ("b.rs", "use crate::a::A;");
    for a in [
        "#[cfg(test)] mod tests { use crate::b::B; }",
        "#[cfg(all(test, unix))] mod tests { use crate::b::B; }",
        "#[cfg(test)] fn f() { crate::b::f() }",
        "struct A; impl A { #[cfg(test)] fn f() { crate::b::f() } }",
        "pub(in crate::b) struct A;",
        "use other::b::B; fn f() { ::b::f(); b::f(); }",
    ] {
        assert!(found(&[("a.rs", a), b]).is_empty(), "{a}");
    }
    let of_tests = [("a/tests.rs", "use crate::b::B; pub struct T;"), ("b.rs", "use crate::a::tests::T;")];
    assert!(found(&[("a.rs", "#[cfg(test)] mod tests;"), of_tests[0], of_tests[1]]).is_empty());
    assert!(!found(&[("a.rs", "mod tests;"), of_tests[0], of_tests[1]]).is_empty());
    assert!(!found(&[("a.rs", "#[cfg(not(test))] mod m { use crate::b::B; }"), b]).is_empty());
}

#[test]
fn a_file_that_is_not_rust_is_named() {
    let source = Source { file: "a.rs".to_owned(), text: "fn (".to_owned() };
    assert!(loops(&[source]).unwrap_err().starts_with("a.rs: "));
}
