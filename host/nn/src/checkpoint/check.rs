//! Comparing the tensors of a file with those of an architecture.

use super::TensorShape;
use super::error::shortened;
use std::collections::{BTreeMap, BTreeSet};

/// The most names of each kind in a message.
const MAX_NAMES: usize = 8;

/// The differences, if there are any.
pub(super) fn compare(
    shapes: &BTreeMap<String, Vec<usize>>,
    expected: &[TensorShape],
    optional: impl Fn(&str) -> bool,
) -> Option<String> {
    let names: BTreeSet<&str> = expected.iter().map(|tensor| tensor.name.as_str()).collect();
    let missing: Vec<&str> =
        expected.iter().map(|tensor| tensor.name.as_str()).filter(|&name| !shapes.contains_key(name)).collect();
    let unexpected: Vec<&str> =
        shapes.keys().map(String::as_str).filter(|&name| !names.contains(name) && !optional(name)).collect();
    let misshapen = |tensor: &TensorShape| {
        let shape = shapes.get(&tensor.name).filter(|&shape| *shape != tensor.shape)?;
        Some(format!("{} is {shape:?}, not {:?}", shortened(&tensor.name), tensor.shape))
    };
    let misshapen: Vec<String> = expected.iter().filter_map(misshapen).collect();
    let kinds = [
        ("missing", list(missing.iter().copied().map(shortened))),
        ("unexpected", list(unexpected.iter().copied().map(shortened))),
        ("of another shape", list(misshapen)),
    ];
    let found: Vec<String> =
        kinds.iter().filter_map(|(kind, list)| Some(format!("{kind}: {}", list.as_ref()?))).collect();
    if found.is_empty() {
        return None;
    }
    let hint = prefix(&missing, &unexpected).map_or(String::new(), |hint| format!(" ({hint})"));
    Some(format!("not the tensors of this architecture; {}{hint}", found.join("; ")))
}

/// The first few, and how many more.
fn list(names: impl IntoIterator<Item = String>) -> Option<String> {
    let mut names = names.into_iter();
    let first: Vec<String> = names.by_ref().take(MAX_NAMES).collect();
    let more = names.count();
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!first.is_empty()).then(|| format!("{}{rest}", first.join(", ")))
}

/// A hint if the names differ by a prefix.
fn prefix(missing: &[&str], unexpected: &[&str]) -> Option<String> {
    let in_file = longer(missing, unexpected).map(|prefix| {
        format!("the names in the file begin with '{}', those of the architecture do not", shortened(prefix))
    });
    in_file.or_else(|| {
        let prefix = longer(unexpected, missing)?;
        Some(format!(
            "the names in the file lack the '{}' that those of the architecture begin with",
            shortened(prefix)
        ))
    })
}

/// The prefix by which most of the `long` names differ from the `short` ones.
fn longer<'a>(short: &[&str], long: &[&'a str]) -> Option<&'a str> {
    let first = short.first()?;
    let candidates = long.iter().filter_map(|name| name.strip_suffix(first)).filter(|prefix| !prefix.is_empty());
    let names: BTreeSet<&str> = long.iter().copied().collect();
    let explained =
        |prefix: &str| short.iter().filter(|name| names.contains(format!("{prefix}{name}").as_str())).count();
    candidates.take(MAX_NAMES).find(|prefix| 2 * explained(prefix) > short.len())
}
