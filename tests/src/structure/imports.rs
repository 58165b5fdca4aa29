//! What a file imports, re-exports and defines.

use std::collections::HashSet;

use proc_macro2::{Ident, TokenStream, TokenTree};
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, ImplItemFn, Item, ItemMod, ItemUse, Meta, Path, Token, UseTree, Visibility};

/// Segments of a path. That of a module or of a definition begins at the root of the crate.
pub(super) type Names = Vec<String>;

/// First segments of a path inside the crate.
const STARTS: [&str; 3] = ["crate", "self", "super"];
/// Name that stands for all names of a module.
pub(super) const ALL: &str = "*";

/// Imports and definitions of a file.
#[derive(Debug, Default)]
pub(super) struct Imports {
    /// Used paths, each after the module that uses it.
    pub(super) used: Vec<(Names, Names)>,
    /// Paths of re-exports, each after the re-exported name.
    pub(super) reexports: Vec<(Names, Names)>,
    /// Names of all definitions.
    pub(super) defined: HashSet<Names>,
    /// Modules that are compiled only for tests.
    pub(super) tests: Vec<Names>,
}

impl Imports {
    /// Reads the text of the file of a module.
    ///
    /// # Errors
    /// When the text is not Rust.
    pub(super) fn of(module: &[String], text: &str) -> syn::Result<Self> {
        let file = syn::parse_file(text)?;
        let mut reader = Reader { module: module.to_vec(), imports: Self::default() };
        reader.visit_file(&file);
        Ok(reader.imports)
    }
}

/// Reads the items of a file.
struct Reader {
    /// Module of the present item.
    module: Names,
    imports: Imports,
}

impl Reader {
    /// Returns the path of a name of the present module.
    fn named(&self, name: &Ident) -> Names {
        after(&self.module, name)
    }

    fn add_used(&mut self, path: Names) {
        self.imports.used.push((self.module.clone(), path));
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast Item) {
        if !is_for_tests(attributes(item)) {
            if let Some(name) = name(item) {
                let named = self.named(name);
                self.imports.defined.insert(named);
            }
            visit::visit_item(self, item);
        } else if let Item::Mod(item) = item {
            let module = self.named(&item.ident);
            self.imports.tests.push(module);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        if !is_for_tests(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        self.module.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        if item.leading_colon.is_some() {
            return;
        }
        let mut paths = Vec::new();
        leaves(&item.tree, &[], &mut paths);
        for (path, name) in paths {
            if matches!(item.vis, Visibility::Inherited) {
                self.add_used(path);
            } else {
                self.imports.reexports.push(([&self.module[..], &[name]].concat(), path));
            }
        }
    }

    fn visit_path(&mut self, path: &'ast Path) {
        let names: Names = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if path.leading_colon.is_none() && names.len() > 1 && STARTS.contains(&names[0].as_str()) {
            self.add_used(names);
        }
        // Paths in the generic arguments.
        visit::visit_path(self, path);
    }

    /// Reads the paths in the arguments of a macro or an attribute.
    fn visit_token_stream(&mut self, tokens: &'ast TokenStream) {
        for path in paths(tokens.clone()) {
            self.add_used(path);
        }
    }

    /// The path in `pub(in path)` is no import.
    fn visit_visibility(&mut self, _: &'ast Visibility) {}
}

/// Returns a path with one more name.
fn after(path: &[String], name: &Ident) -> Names {
    [path, &[name.to_string()]].concat()
}

/// Adds the paths of a `use` declaration, each with the name that it gets.
fn leaves(tree: &UseTree, path: &[String], found: &mut Vec<(Names, String)>) {
    let whole = |name: &Ident| if name == "self" { path.to_vec() } else { after(path, name) };
    match tree {
        UseTree::Path(part) => leaves(&part.tree, &after(path, &part.ident), found),
        UseTree::Name(part) => {
            let path = whole(&part.ident);
            let name = path.last().cloned().unwrap_or_default();
            found.push((path, name));
        }
        UseTree::Rename(part) => found.push((whole(&part.ident), part.rename.to_string())),
        UseTree::Glob(_) => found.push((path.to_vec(), ALL.to_owned())),
        UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, path, found)),
    }
}

/// Returns the paths inside the crate among tokens.
fn paths(tokens: TokenStream) -> Vec<Names> {
    let (mut found, mut path, mut colons) = (Vec::new(), Names::new(), 0);
    for token in tokens {
        match token {
            TokenTree::Ident(name) if !path.is_empty() && colons == 2 => {
                path.push(name.to_string());
                colons = 0;
            }
            TokenTree::Punct(mark) if !path.is_empty() && mark.as_char() == ':' => colons += 1,
            other => {
                found.push(std::mem::take(&mut path));
                colons = 0;
                match other {
                    TokenTree::Ident(name) if STARTS.iter().any(|start| name == start) => path.push(name.to_string()),
                    TokenTree::Group(group) => found.extend(paths(group.stream())),
                    _ => {}
                }
            }
        }
    }
    found.push(path);
    found.retain(|path| path.len() > 1);
    found
}

/// Whether an item with these attributes is compiled only for tests.
fn is_for_tests(attributes: &[Attribute]) -> bool {
    let condition =
        |attribute: &Attribute| attribute.parse_args::<Meta>().is_ok_and(|condition| needs_test(&condition));
    attributes.iter().any(|attribute| attribute.path().is_ident("cfg") && condition(attribute))
}

/// Whether a condition holds only for tests.
fn needs_test(condition: &Meta) -> bool {
    match condition {
        Meta::Path(path) => path.is_ident("test"),
        Meta::List(list) if list.path.is_ident("all") => list
            .parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated)
            .is_ok_and(|parts| parts.iter().any(needs_test)),
        _ => false,
    }
}

/// Returns the name that an item defines.
fn name(item: &Item) -> Option<&Ident> {
    match item {
        Item::Const(item) => Some(&item.ident),
        Item::Enum(item) => Some(&item.ident),
        Item::Fn(item) => Some(&item.sig.ident),
        Item::Macro(item) => item.ident.as_ref(),
        Item::Mod(item) => Some(&item.ident),
        Item::Static(item) => Some(&item.ident),
        Item::Struct(item) => Some(&item.ident),
        Item::Trait(item) => Some(&item.ident),
        Item::Type(item) => Some(&item.ident),
        Item::Union(item) => Some(&item.ident),
        _ => None,
    }
}

/// Returns the attributes of an item.
fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}
