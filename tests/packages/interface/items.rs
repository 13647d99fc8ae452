//! The public items of a crate, from its sources.

use super::shown::{made, rows, shown};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use syn::{
    Attribute, Fields, ImplItem, Item, ItemEnum, ItemImpl, ItemMacro, ItemStruct, ItemTrait, TraitItem, Type,
    Visibility,
};

/// The public items of the crate that begins with this file: sorted lines, each with the module that it stands in.
pub(crate) fn interface(root: &Path) -> String {
    of_source(&read(root), root)
}

/// The same, with the text of that file.
pub(crate) fn of_source(source: &str, root: &Path) -> String {
    let items = syn::parse_file(source).unwrap_or_else(|error| panic!("{}: {error}", root.display())).items;
    let mut found = Interface::default();
    found.items(&items, &Place { module: String::new(), file: root.to_path_buf(), folder: folder(root) });
    // An implementation for what nobody outside can name is none of the interface.
    let hidden: BTreeSet<&String> = found.private.difference(&found.public).collect();
    let open = found.impls.iter().filter(|(_, names)| !names.iter().any(|name| hidden.contains(name)));
    let lines: BTreeSet<&String> = found.lines.iter().chain(open.map(|(line, _)| line)).collect();
    lines.into_iter().map(|line| format!("{line}\n")).collect()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Where modules of a file are: beside `lib.rs`, otherwise in the folder of its name.
fn folder(file: &Path) -> PathBuf {
    if file.ends_with("lib.rs") { file.with_file_name("") } else { file.with_extension("") }
}

/// A module, its file, and where its own modules are.
struct Place {
    module: String,
    file: PathBuf,
    folder: PathBuf,
}

impl Place {
    fn inside(&self, name: &str) -> Place {
        let module = format!("{}{name}: ", self.module.replace(": ", "::"));
        Place { module, file: self.folder.join(format!("{name}.rs")), folder: self.folder.join(name) }
    }
}

#[derive(Default)]
struct Interface {
    lines: Vec<String>,
    /// Implementations, each with the names in its head.
    impls: Vec<(String, Vec<String>)>,
    /// Names of types and traits.
    public: BTreeSet<String>,
    private: BTreeSet<String>,
}

impl Interface {
    fn line(&mut self, place: &Place, attributes: &[Attribute], text: &str) {
        self.lines.push(format!("{}{text}{}", place.module, conditions(attributes)));
    }

    /// Whether an item is public; its name is kept.
    fn is_public(&mut self, visibility: &Visibility, name: &syn::Ident) -> bool {
        let is_public = matches!(visibility, Visibility::Public(_));
        if is_public { &mut self.public } else { &mut self.private }.insert(name.to_string());
        is_public
    }

    fn items(&mut self, items: &[Item], place: &Place) {
        for item in items {
            self.item(item, place);
        }
    }

    fn item(&mut self, item: &Item, place: &Place) {
        match item {
            Item::Mod(module) if !is_test(&module.attrs) => {
                let inside = place.inside(&module.ident.to_string());
                if is_open(&module.vis) {
                    self.line(place, &module.attrs, &format!("pub mod {}", module.ident));
                }
                match &module.content {
                    Some((_, items)) => self.items(items, &inside),
                    None => {
                        let file = syn::parse_file(&read(&inside.file));
                        let file = file.unwrap_or_else(|error| panic!("{}: {error}", inside.file.display()));
                        self.items(&file.items, &inside);
                    }
                }
            }
            Item::Use(one) if is_open(&one.vis) => {
                self.line(place, &one.attrs, &format!("pub use {}", shown(&one.tree)));
            }
            Item::Fn(one) if is_open(&one.vis) => {
                self.line(place, &one.attrs, &format!("pub {}", shown(&one.sig)));
            }
            Item::Const(one) if is_open(&one.vis) => {
                self.line(place, &one.attrs, &format!("pub const {}: {}", one.ident, shown(&one.ty)));
            }
            Item::Static(one) if is_open(&one.vis) => {
                self.line(place, &one.attrs, &format!("pub static {}: {}", one.ident, shown(&one.ty)));
            }
            Item::Type(one) if self.is_public(&one.vis, &one.ident) => {
                let generics = shown(&one.generics);
                self.line(place, &one.attrs, &format!("pub type {}{generics} = {}", one.ident, shown(&one.ty)));
            }
            Item::Struct(one) if self.is_public(&one.vis, &one.ident) => self.structure(one, place),
            Item::Enum(one) if self.is_public(&one.vis, &one.ident) => self.enumeration(one, place),
            Item::Trait(one) if self.is_public(&one.vis, &one.ident) => self.interface(one, place),
            Item::Union(one) if self.is_public(&one.vis, &one.ident) => {
                self.line(place, &one.attrs, &shown(one));
            }
            Item::Impl(one) if !is_test(&one.attrs) => self.implementation(one, place),
            Item::Macro(one) => self.call(one, place),
            _ => {}
        }
    }

    fn structure(&mut self, one: &ItemStruct, place: &Place) {
        let mut all = 0;
        let head = format!("pub struct {}", one.ident);
        for (number, field) in one.fields.iter().enumerate().filter(|(_, field)| is_open(&field.vis)) {
            let name = field.ident.as_ref().map_or(number.to_string(), ToString::to_string);
            self.line(place, &field.attrs, &format!("{head}: pub {name}: {}", shown(&field.ty)));
            all += 1;
        }
        let rest = match &one.fields {
            Fields::Unit => ";",
            fields if fields.len() > all => " { private fields }",
            _ => "",
        };
        let generics = head_of(&one.generics);
        self.line(place, &one.attrs, &format!("{head}{generics}{rest}"));
    }

    fn enumeration(&mut self, one: &ItemEnum, place: &Place) {
        let head = format!("pub enum {}", one.ident);
        self.line(place, &one.attrs, &format!("{head}{}", head_of(&one.generics)));
        for variant in &one.variants {
            let named = |field: &syn::Field| match &field.ident {
                Some(name) => format!("{name}: {}", shown(&field.ty)),
                None => shown(&field.ty),
            };
            let inside = variant.fields.iter().map(named).collect::<Vec<_>>().join(", ");
            let fields = match &variant.fields {
                Fields::Unit => String::new(),
                Fields::Named(_) => format!(" {{ {inside} }}"),
                Fields::Unnamed(_) => format!("({inside})"),
            };
            let number =
                variant.discriminant.as_ref().map_or(String::new(), |(_, value)| format!(" = {}", shown(value)));
            self.line(place, &variant.attrs, &format!("{head}: {}{fields}{number}", variant.ident));
        }
    }

    fn interface(&mut self, one: &ItemTrait, place: &Place) {
        let head = format!("pub trait {}", one.ident);
        let unsafety = if one.unsafety.is_some() { "unsafe " } else { "" };
        let above = if one.supertraits.is_empty() { String::new() } else { format!(": {}", shown(&one.supertraits)) };
        let generics = shown(&one.generics);
        let conditions =
            one.generics.where_clause.as_ref().map_or(String::new(), |clause| format!(" {}", shown(clause)));
        self.line(place, &one.attrs, &format!("{unsafety}{head}{generics}{above}{conditions}"));
        for item in &one.items {
            let (attributes, text) = match item {
                TraitItem::Fn(one) => {
                    let rest = if one.default.is_some() { " { default }" } else { "" };
                    (&one.attrs, format!("{}{rest}", shown(&one.sig)))
                }
                TraitItem::Const(one) => {
                    let rest = if one.default.is_some() { " = default" } else { "" };
                    (&one.attrs, format!("const {}: {}{rest}", one.ident, shown(&one.ty)))
                }
                TraitItem::Type(one) => {
                    let bounds =
                        if one.bounds.is_empty() { String::new() } else { format!(": {}", shown(&one.bounds)) };
                    (&one.attrs, format!("type {}{}{bounds}", one.ident, shown(&one.generics)))
                }
                other => panic!("{}: {} is not understood", place.file.display(), shown(other)),
            };
            self.line(place, attributes, &format!("{head}: {text}"));
        }
    }

    fn implementation(&mut self, one: &ItemImpl, place: &Place) {
        let own = shown(&one.self_ty);
        let of = one.trait_.as_ref().map(|(path, _)| path);
        let name = of.map_or(String::new(), |path| format!("{} for ", shown(path)));
        let head = format!("impl{} {name}{own}", shown(&one.generics));
        let conditions_of_types =
            one.generics.where_clause.as_ref().map_or(String::new(), |clause| format!(" {}", shown(clause)));
        let last = |path: &syn::Path| path.segments.last().map(|segment| segment.ident.to_string());
        let names: Vec<String> = of.and_then(last).into_iter().chain(plain(&one.self_ty).and_then(last)).collect();
        let mut keep = |attributes: &[Attribute], text: String| {
            let line = format!("{}{text}{}", place.module, conditions(attributes));
            self.impls.push((line, names.clone()));
        };
        if of.is_some() {
            keep(&one.attrs, format!("{head}{conditions_of_types}"));
        }
        for item in &one.items {
            match item {
                ImplItem::Fn(one) if of.is_none() && is_open(&one.vis) => {
                    keep(&one.attrs, format!("{head}{conditions_of_types}: pub {}", shown(&one.sig)));
                }
                ImplItem::Const(one) if of.is_none() && is_open(&one.vis) => {
                    keep(&one.attrs, format!("{head}: pub const {}: {}", one.ident, shown(&one.ty)));
                }
                ImplItem::Type(one) => {
                    keep(&one.attrs, format!("{head}: type {} = {}", one.ident, shown(&one.ty)));
                }
                _ => {}
            }
        }
    }

    /// A macro: the items that it makes, or what it is called with.
    fn call(&mut self, one: &ItemMacro, place: &Place) {
        let called = shown(&one.mac.path);
        let (head, lines) = match &one.ident {
            Some(name) if one.attrs.iter().any(|attribute| attribute.path().is_ident("macro_export")) => {
                (format!("pub macro {name}:"), rows(one.mac.tokens.clone()))
            }
            Some(name) => (format!("macro {name}:"), made(one.mac.tokens.clone())),
            None if called == "thread_local" => return,
            None => (format!("{called}!"), rows(one.mac.tokens.clone())),
        };
        for line in lines {
            self.line(place, &[], &format!("{head} {line}"));
        }
    }
}

fn is_open(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| attribute.path().is_ident("cfg") && shown(&attribute.meta) == "cfg(test)")
}

/// The type that a name stands for, through references.
fn plain(own: &Type) -> Option<&syn::Path> {
    match own {
        Type::Path(path) => Some(&path.path),
        Type::Reference(reference) => plain(&reference.elem),
        _ => None,
    }
}

/// Parameters with their conditions.
fn head_of(generics: &syn::Generics) -> String {
    let conditions = generics.where_clause.as_ref().map_or(String::new(), |clause| format!(" {}", shown(clause)));
    format!("{}{conditions}", shown(generics))
}

/// The attributes that whoever uses an item notices, behind it.
fn conditions(attributes: &[Attribute]) -> String {
    let names = ["cfg", "cfg_attr", "derive", "non_exhaustive", "repr", "deprecated", "doc", "unsafe", "no_mangle"];
    let mut text = String::new();
    for attribute in attributes {
        let shown = match &attribute.meta {
            // What a type derives, in any order.
            syn::Meta::List(list) if list.path.is_ident("derive") => {
                let mut names: Vec<String> =
                    list.tokens.to_string().split(',').map(|name| name.replace(' ', "")).collect();
                names.retain(|name| !name.is_empty());
                names.sort();
                format!("derive({})", names.join(", "))
            }
            // Documentation is none; `doc(hidden)` is.
            syn::Meta::NameValue(value) if value.path.is_ident("doc") => continue,
            meta if names.iter().any(|name| meta.path().is_ident(name)) => shown(meta),
            _ => continue,
        };
        text.push_str(&format!(" #[{shown}]"));
    }
    text
}
