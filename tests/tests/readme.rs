//! What the README says the demo prints, the demo prints.

use hyst_tests::Lab;

/// The text of the README's first block that begins with `start`.
fn block(readme: &str, start: &str) -> String {
    readme
        .split("```")
        .find(|part| part.trim_start().starts_with(start))
        .expect("the README has the block")
        .trim()
        .to_owned()
}

/// Whether two words are the same, or figures that agree to 1 %: another processor's last bits are not the README's.
fn agree(told: &str, printed: &str) -> bool {
    let figure = |word: &str| {
        word.trim_matches(|c: char| !c.is_ascii_digit() && c != '-' && c != '.')
            .trim_end_matches('.')
            .parse::<f64>()
            .ok()
    };
    match (figure(told), figure(printed)) {
        (Some(a), Some(b)) => (a - b).abs() <= 0.01 * a.abs().max(b.abs()),
        _ => told == printed,
    }
}

#[test]
fn the_demo_prints_what_the_readme_shows() {
    let readme = std::fs::read_to_string(hyst_tests::root().join("README.md")).unwrap();
    let told = block(&readme, "fit        pi on");
    let printed = Lab::new().ok("demo --seed 5").stdout;
    let (told_lines, printed_lines): (Vec<&str>, Vec<&str>) =
        (told.lines().collect(), printed.trim().lines().collect());
    assert_eq!(told_lines.len(), printed_lines.len(), "{printed}");
    for (told, printed) in told_lines.iter().zip(&printed_lines) {
        let (a, b): (Vec<&str>, Vec<&str>) = (told.split_whitespace().collect(), printed.split_whitespace().collect());
        assert!(
            a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| agree(a, b)),
            "the README has\n{told}\nthe demo prints\n{printed}"
        );
    }
}
