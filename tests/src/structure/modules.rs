//! The modules of a crate: which file defines what a path names.

use std::collections::{HashMap, HashSet};

use super::imports::{ALL, Imports, Names};

/// Maximum number of re-exports on the way to a definition; more are a loop of re-exports.
const MAX_REEXPORTS: usize = 16;

/// Returns the module of a file; `root` is the root file of the crate.
pub(super) fn module_of(file: &str, root: &str) -> Names {
    if file == root {
        return Names::new();
    }
    let path = file.strip_suffix(".rs").unwrap_or(file);
    path.strip_suffix("/mod").unwrap_or(path).split('/').map(str::to_owned).collect()
}

/// The modules of a crate.
pub(super) struct Modules<'a> {
    /// Number of the file of each module.
    files: HashMap<&'a [String], usize>,
    /// Names of all definitions.
    defined: HashSet<&'a [String]>,
    /// Re-exported names and what they stand for.
    reexports: HashMap<&'a [String], Names>,
    /// Modules whose names another module re-exports.
    all_of: HashMap<&'a [String], Vec<Names>>,
}

impl<'a> Modules<'a> {
    /// Takes the module and the imports of each file.
    pub(super) fn of(files: &'a [(Names, Imports)]) -> Self {
        let mut modules = Self {
            files: files.iter().zip(0..).map(|((module, _), number)| (&module[..], number)).collect(),
            defined: files.iter().flat_map(|(_, imports)| &imports.defined).map(|named| &named[..]).collect(),
            reexports: HashMap::new(),
            all_of: HashMap::new(),
        };
        for (named, path) in files.iter().flat_map(|(_, imports)| &imports.reexports) {
            let Some((name, module)) = named.split_last() else { continue };
            let Some(target) = modules.absolute(module, path) else { continue };
            if name == ALL {
                modules.all_of.entry(module).or_default().push(target);
            } else {
                modules.reexports.insert(named, target);
            }
        }
        modules
    }

    /// Returns the number of the file that defines what a path in a module names; `None` for another crate.
    pub(super) fn file_of(&self, module: &[String], path: &[String]) -> Option<usize> {
        self.owner(&self.absolute(module, path)?, MAX_REEXPORTS)
    }

    /// Returns a path from the root of the crate on; `None` for a path into another crate.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<Names> {
        let (first, rest) = path.split_first()?;
        let mut absolute = module.to_vec();
        match first.as_str() {
            "crate" => absolute.clear(),
            "self" => {}
            "super" => drop(absolute.pop()?),
            // A module in the present one, as in `use child::Name`.
            child => {
                absolute.push(child.to_owned());
                self.files.get(&absolute[..])?;
            }
        }
        for name in rest {
            if name == "super" {
                absolute.pop()?;
            } else {
                absolute.push(name.clone());
            }
        }
        Some(absolute)
    }

    /// Returns the number of the file that defines what a path from the root names.
    fn owner(&self, path: &[String], reexports: usize) -> Option<usize> {
        let module = (0..=path.len()).rev().find(|end| self.files.contains_key(&path[..*end]))?;
        for end in module + 1..=path.len() {
            let (named, rest) = path.split_at(end);
            if let Some(target) = self.target(named, reexports) {
                return self.owner(&[&target[..], rest].concat(), reexports.checked_sub(1)?);
            }
        }
        self.files.get(&path[..module]).copied()
    }

    /// Returns what a name stands for; `None` if its module defines it.
    fn target(&self, named: &[String], reexports: usize) -> Option<Names> {
        if let Some(target) = self.reexports.get(named) {
            return Some(target.clone());
        }
        let (name, module) = named.split_last()?;
        if self.defined.contains(named) {
            return None;
        }
        let left = reexports.checked_sub(1)?;
        let mut found =
            self.all_of.get(module)?.iter().map(|module| [&module[..], std::slice::from_ref(name)].concat());
        found.find(|named| self.has(named, left))
    }

    /// Whether a module has a name.
    fn has(&self, named: &[String], reexports: usize) -> bool {
        self.files.contains_key(named) || self.defined.contains(named) || self.target(named, reexports).is_some()
    }
}
