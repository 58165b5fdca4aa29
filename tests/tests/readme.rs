//! The demo prints what the README shows.

use hyst_tests::Lab;

/// Returns the text of the first block of the README that begins with `start`.
fn block(readme: &str, start: &str) -> String {
    readme
        .split("```")
        .find(|part| part.trim_start().starts_with(start))
        .expect("the README has the block")
        .trim()
        .to_owned()
}

/// Returns whether two words are equal, or figures that agree within 1 %: rounding differs between processors.
fn agree(shown: &str, printed: &str) -> bool {
    let figure = |word: &str| {
        word.trim_matches(|c: char| !c.is_ascii_digit() && c != '-' && c != '.')
            .trim_end_matches('.')
            .parse::<f64>()
            .ok()
    };
    match (figure(shown), figure(printed)) {
        (Some(a), Some(b)) => (a - b).abs() <= 0.01 * a.abs().max(b.abs()),
        _ => shown == printed,
    }
}

#[test]
fn the_demo_prints_what_the_readme_shows() {
    let readme = std::fs::read_to_string(hyst_tests::root().join("README.md")).unwrap();
    let shown = block(&readme, "fit        pi on");
    let printed = Lab::new().ok("demo --seed 5").stdout;
    let (shown_lines, printed_lines): (Vec<&str>, Vec<&str>) =
        (shown.lines().collect(), printed.trim().lines().collect());
    assert_eq!(shown_lines.len(), printed_lines.len(), "{printed}");
    for (shown, printed) in shown_lines.iter().zip(&printed_lines) {
        let (a, b): (Vec<&str>, Vec<&str>) = (shown.split_whitespace().collect(), printed.split_whitespace().collect());
        assert!(
            a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| agree(a, b)),
            "the README has\n{shown}\nthe demo prints\n{printed}"
        );
    }
}
