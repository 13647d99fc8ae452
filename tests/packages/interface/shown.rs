//! Tokens as text on one line, as a person writes them.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens;

/// What stands between tokens as they are printed, and what a person writes.
const SPACES: [(&str, &str); 17] = [
    (" :: ", "::"),
    (":: ", "::"),
    (" ::", "::"),
    (" < ", "<"),
    (" >", ">"),
    ("< ", "<"),
    ("& ", "&"),
    (" ,", ","),
    (" ;", ";"),
    (" :", ":"),
    (" ! ", "! "),
    (" (", "("),
    (" [", "["),
    ("# [", "#["),
    ("$ ", "$"),
    ("* const", "*const"),
    ("* mut", "*mut"),
];

/// Where a space belongs after all.
const KEPT: [(&str, &str); 11] = [
    ("->(", "-> ("),
    ("->[", "-> ["),
    ("-><", "-> <"),
    ("=<", "= <"),
    ("=[", "= ["),
    ("=(", "= ("),
    (",(", ", ("),
    (",[", ", ["),
    (":(", ": ("),
    (":[", ": ["),
    (":<", ": <"),
];

/// Tokens as text.
pub(crate) fn shown(tokens: impl ToTokens) -> String {
    let mut text = tokens.into_token_stream().to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    for (between, written) in SPACES.into_iter().chain(KEPT) {
        text = text.replace(between, written);
    }
    text = text.replace(",)", ")").replace("mut[", "mut [").replace("mut(", "mut (");
    // A lifetime before an array or a tuple.
    let mut written = String::new();
    let mut in_lifetime = false;
    for character in text.chars() {
        if in_lifetime && (character == '[' || character == '(') {
            written.push(' ');
        }
        in_lifetime = character == '\'' || in_lifetime && (character.is_alphanumeric() || character == '_');
        written.push(character);
    }
    written
}

/// Tokens without what documents them.
fn without_docs(tokens: TokenStream) -> TokenStream {
    let mut kept: Vec<TokenTree> = Vec::new();
    for token in tokens {
        match token {
            TokenTree::Group(group) => {
                let is_attribute = kept.last().is_some_and(|last| last.to_string() == "#");
                if is_attribute && group.stream().to_string().starts_with("doc ") {
                    kept.pop();
                    continue;
                }
                let inside = proc_macro2::Group::new(group.delimiter(), without_docs(group.stream()));
                kept.push(TokenTree::Group(inside));
            }
            other => kept.push(other),
        }
    }
    kept.into_iter().collect()
}

/// Characters of a row that is written on one line.
const LONGEST_ROW: usize = 600;

/// What stands in a macro, a line for each of its rows, which end in braces.
pub(crate) fn rows(tokens: TokenStream) -> Vec<String> {
    rows_of(without_docs(tokens))
}

fn rows_of(tokens: TokenStream) -> Vec<String> {
    let (mut found, mut row): (Vec<String>, Vec<TokenTree>) = (Vec::new(), Vec::new());
    for token in tokens {
        let inside = match &token {
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => Some(group.stream()),
            _ => None,
        };
        match inside {
            Some(inside) if shown(&token).chars().count() > LONGEST_ROW => {
                found.push(ended(std::mem::take(&mut row)));
                found.extend(rows_of(inside));
            }
            Some(_) => {
                row.push(token);
                found.push(ended(std::mem::take(&mut row)));
            }
            None => row.push(token),
        }
    }
    found.push(ended(row));
    found.retain(|row| row.len() > 1);
    found
}

/// The public items that a macro makes, each up to its body or value.
pub(crate) fn made(tokens: TokenStream) -> Vec<String> {
    let (mut found, mut item): (Vec<String>, Option<Vec<TokenTree>>) = (Vec::new(), None);
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    for (place, token) in tokens.iter().enumerate() {
        let is_plain = |next: Option<&TokenTree>| match next {
            Some(TokenTree::Group(group)) => group.delimiter() != Delimiter::Parenthesis,
            _ => true,
        };
        match token {
            TokenTree::Ident(ident) if ident == "pub" && is_plain(tokens.get(place + 1)) => {
                item = Some(vec![token.clone()]);
                continue;
            }
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                found.extend(item.take().map(ended));
                found.extend(made(group.stream()));
            }
            TokenTree::Punct(end) if [';', '=', ','].contains(&end.as_char()) => found.extend(item.take().map(ended)),
            TokenTree::Group(group) if item.is_none() => found.extend(made(group.stream())),
            _ => {}
        }
        if let Some(item) = &mut item {
            item.push(token.clone());
        }
    }
    found.extend(item.map(ended));
    found
}

fn ended(item: Vec<TokenTree>) -> String {
    shown(item.into_iter().collect::<TokenStream>())
}
