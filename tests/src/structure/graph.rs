//! Loops of files that import each other.

use std::collections::{BTreeSet, VecDeque};

use super::imports::{Imports, Names};
use super::modules::{Modules, module_of};
use super::sources::Source;

/// Returns the shortest loops of files of a crate that import each other. A file is in at most one of them.
///
/// # Errors
/// When a file is not Rust.
pub fn loops(sources: &[Source]) -> Result<Vec<Vec<String>>, String> {
    let imported = imported(sources)?;
    let mut in_loop = vec![false; sources.len()];
    let mut loops = Vec::new();
    for start in 0..sources.len() {
        if in_loop[start] {
            continue;
        }
        let Some(found) = shortest_loop(&imported, start) else { continue };
        if found.iter().any(|file| in_loop[*file]) {
            continue;
        }
        found.iter().for_each(|file| in_loop[*file] = true);
        loops.push(found.iter().map(|file| sources[*file].file.clone()).collect());
    }
    Ok(loops)
}

/// Returns the numbers of the files that each file imports.
fn imported(sources: &[Source]) -> Result<Vec<BTreeSet<usize>>, String> {
    let root = if sources.iter().any(|source| source.file == "lib.rs") { "lib.rs" } else { "main.rs" };
    let mut files = Vec::with_capacity(sources.len());
    for source in sources {
        let module = module_of(&source.file, root);
        let imports = Imports::of(&module, &source.text).map_err(|error| format!("{}: {error}", source.file))?;
        files.push((module, imports));
    }
    let modules = Modules::of(&files);
    let tests: Vec<&Names> = files.iter().flat_map(|(_, imports)| &imports.tests).collect();
    let for_tests = |number: usize| tests.iter().any(|test| files[number].0.starts_with(test));
    let of = |number: usize| -> BTreeSet<usize> {
        if for_tests(number) {
            return BTreeSet::new();
        }
        let used = files[number].1.used.iter();
        used.filter_map(|(module, path)| modules.file_of(module, path)).filter(|file| *file != number).collect()
    };
    Ok((0..files.len()).map(of).collect())
}

/// Returns the shortest way from a file back to it, which begins with it.
fn shortest_loop(imported: &[BTreeSet<usize>], start: usize) -> Option<Vec<usize>> {
    let mut before = vec![None; imported.len()];
    let mut next = VecDeque::from([start]);
    while let Some(file) = next.pop_front() {
        for to in &imported[file] {
            if *to == start {
                let mut way: Vec<usize> = std::iter::successors(Some(file), |file| before[*file]).collect();
                way.reverse();
                return Some(way);
            }
            if before[*to].is_none() {
                before[*to] = Some(file);
                next.push_back(*to);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests;
