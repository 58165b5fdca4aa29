//! The guide: each command prints what its page shows, and each link has a target.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use hyst_tests::guide::{commands, differences, folder, pages};
use hyst_tests::root;

/// Defines one test for each page with commands: the tests run in parallel, and a failure names its page.
macro_rules! pages {
    ($($name:ident: $page:literal,)*) => {
        $(#[test]
        fn $name() {
            let found = differences(&folder().join($page));
            assert!(found.is_empty(), "docs/guide/{}: {found}", $page);
        })*

        const PAGES: &[&str] = &[$($page),*];
    };
}

pages! {
    choosing_a_model: "choosing-a-model.md",
    closed_loop: "closed-loop.md",
    compensation: "compensation.md",
    concepts: "concepts.md",
    effects_readme: "effects/README.md",
    effects_asymmetry: "effects/asymmetry.md",
    effects_creep: "effects/creep.md",
    effects_delay: "effects/delay.md",
    effects_drift: "effects/drift.md",
    effects_interference: "effects/interference.md",
    effects_lag: "effects/lag.md",
    effects_load: "effects/load.md",
    effects_rate_dependence: "effects/rate-dependence.md",
    effects_resonance: "effects/resonance.md",
    effects_saturation: "effects/saturation.md",
    effects_temperature: "effects/temperature.md",
    firmware: "firmware.md",
    first_steps: "first-steps.md",
    fleets: "fleets.md",
    force: "force.md",
    learning: "learning.md",
    recording: "recording.md",
    report: "report.md",
    safety: "safety.md",
    troubleshooting: "troubleshooting.md",
}

#[test]
fn every_page_with_commands_has_a_test() {
    let text = |page: &String| fs::read_to_string(folder().join(page)).unwrap();
    let with_commands: Vec<String> = pages().into_iter().filter(|page| !commands(&text(page)).is_empty()).collect();
    assert_eq!(with_commands, PAGES);
}

/// Returns the targets of the links of a page, without those to other servers.
fn links(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut is_code = false;
    for line in text.lines() {
        is_code ^= line.starts_with("```");
        let parts = if is_code { "" } else { line };
        for part in parts.split("](").skip(1) {
            let target = part.split(')').next().unwrap_or_default();
            if !target.contains("://") {
                found.push(target.to_owned());
            }
        }
    }
    found
}

/// Returns the anchors of the headings of a page.
fn anchors(text: &str) -> BTreeSet<String> {
    let heading = |line: &str| line.starts_with('#').then(|| line.trim_start_matches('#').trim().to_lowercase());
    let anchor = |heading: String| {
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    text.lines().filter_map(heading).map(anchor).collect()
}

fn documents() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root().join(name)).into();
    let mut folders = vec![root().join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                found.push(path);
            }
        }
    }
    found
}

#[test]
fn link_targets_exist() {
    let mut broken = Vec::new();
    for page in documents() {
        for link in links(&fs::read_to_string(&page).unwrap()) {
            let (file, anchor) = link.split_once('#').map_or((link.as_str(), None), |(file, a)| (file, Some(a)));
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            let exists = target.exists() && anchor.is_none_or(|a| anchors(&read(&target)).contains(a));
            if !exists {
                broken.push(format!("{}: {link}", page.strip_prefix(root()).unwrap().display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

#[test]
fn the_summary_lists_every_page() {
    let listed: BTreeSet<String> = links(&read(&root().join("docs/SUMMARY.md"))).into_iter().collect();
    let missing: Vec<PathBuf> = documents()
        .into_iter()
        .filter_map(|page| page.strip_prefix(root().join("docs")).ok().map(Path::to_path_buf))
        .filter(|page| page != Path::new("SUMMARY.md") && !listed.contains(&page.to_string_lossy().into_owned()))
        .collect();
    assert!(missing.is_empty(), "{missing:?}");
}
