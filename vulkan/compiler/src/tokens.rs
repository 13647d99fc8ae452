//! The tokens of a source: what the compiler reads of it, without comments, documentation and layout.

use proc_macro2::{Delimiter, LexError, TokenStream, TokenTree};
use std::collections::BTreeSet;

/// The tokens in order, a delimiter being one of them.
///
/// # Errors
/// If the text is not Rust.
pub fn tokens(text: &str) -> Result<Vec<String>, LexError> {
    let mut flat = Vec::new();
    flatten(text.parse()?, &mut flat);
    Ok(flat)
}

fn flatten(stream: TokenStream, flat: &mut Vec<String>) {
    for token in stream {
        match token {
            TokenTree::Group(group) => {
                let [open, close] = match group.delimiter() {
                    Delimiter::Parenthesis => ["(", ")"],
                    Delimiter::Brace => ["{", "}"],
                    Delimiter::Bracket => ["[", "]"],
                    Delimiter::None => ["", ""],
                };
                if open == "[" && is_documentation(&group.stream()) {
                    flat.pop_if(|last| last == "!");
                    flat.pop_if(|last| last == "#");
                    continue;
                }
                flat.push(open.to_owned());
                flatten(group.stream(), flat);
                flat.push(close.to_owned());
            }
            other => flat.push(other.to_string()),
        }
    }
}

/// Whether what stands in an attribute's brackets documents: a comment of documentation is such an attribute, too.
fn is_documentation(attribute: &TokenStream) -> bool {
    matches!(attribute.clone().into_iter().next(), Some(TokenTree::Ident(name)) if name == "doc")
}

/// The names that follow `root::`, also those in braces behind it.
pub fn names_in(tokens: &[String], root: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for start in 0..tokens.len().saturating_sub(3) {
        let [first, colon, other_colon, name] = &tokens[start..start + 4] else { continue };
        if first != root || colon != ":" || other_colon != ":" {
            continue;
        }
        if name != "{" {
            names.insert(name.clone());
            continue;
        }
        let (mut depth, mut before) = (0, "");
        for token in &tokens[start + 3..] {
            depth += i32::from(token == "{") - i32::from(token == "}");
            if depth == 0 {
                break;
            }
            if depth == 1 && ["{", ","].contains(&before) {
                names.insert(token.clone());
            }
            before = token;
        }
    }
    names
}

/// Tokens without declarations of modules: which modules a crate has besides those that are read changes nothing.
pub fn without_modules(tokens: &[String]) -> Vec<String> {
    let mut kept: Vec<String> = Vec::new();
    let mut rest = tokens.iter();
    while let Some(token) = rest.next() {
        if token == "mod" && rest.as_slice().get(1).is_some_and(|end| end == ";") {
            kept.pop_if(|last| last == "pub");
            rest.nth(1);
        } else {
            kept.push(token.clone());
        }
    }
    kept
}
