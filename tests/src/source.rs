//! Rust's sources as text: code without its comments, and what stands in its strings.

use proc_macro2::{Span, TokenStream, TokenTree};
use std::fs;
use std::path::{Path, PathBuf};

/// A file, taken apart. Lines keep their numbers in both parts.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Source {
    /// The code: comments are gone, strings and characters are empty.
    pub code: String,
    /// What stands in strings, with the number of the line where each begins.
    pub strings: Vec<(usize, String)>,
}

impl Source {
    /// Takes a file's text apart.
    pub fn new(text: &str) -> Source {
        let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{error}: {text}"));
        let mut source = Source::default();
        source.add(tokens, text, &mut 0);
        source
    }

    /// `end` is where the last token ended.
    fn add(&mut self, tokens: TokenStream, text: &str, end: &mut usize) {
        for token in tokens {
            // A comment of documentation is tokens, all in the comment's place.
            let comment = &text[token.span().byte_range()];
            if comment.starts_with("//") || comment.starts_with("/*") {
                continue;
            }
            match token {
                TokenTree::Group(group) => {
                    self.push(text, group.span_open(), end);
                    self.add(group.stream(), text, end);
                    self.push(text, group.span_close(), end);
                }
                token => self.push(text, token.span(), end),
            }
        }
    }

    fn push(&mut self, text: &str, span: Span, end: &mut usize) {
        let place = span.byte_range();
        // Blanks stay; of comments only their lines do.
        let gap = &text[*end..place.start];
        let rest = if gap.trim().is_empty() {
            gap
        } else {
            gap.rsplit('\n').next().filter(|line| line.trim().is_empty()).unwrap_or(" ")
        };
        let lines = gap.matches('\n').count() - rest.matches('\n').count();
        self.code.extend(std::iter::repeat_n('\n', lines));
        self.code.push_str(rest);
        *end = place.end;
        let literal = &text[place];
        match (literal.find('"'), literal.rfind('"')) {
            (Some(first), Some(last)) if first < last => {
                self.strings.push((span.start().line, literal[first + 1..last].to_owned()));
                self.code.push_str("\"\"");
                self.code.extend(literal.matches('\n').map(|_| '\n'));
            }
            _ if literal.len() > 1 && literal.ends_with('\'') => self.code.push_str("''"),
            _ => self.code.push_str(literal),
        }
    }

    /// Reads a file without its unit tests, which stand at its end.
    pub fn read(path: &Path) -> Source {
        let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Source::new(text.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default())
    }

    /// The lines of the code, with their numbers.
    pub fn lines(&self) -> impl Iterator<Item = (usize, &str)> {
        self.code.lines().enumerate().map(|(place, line)| (place + 1, line))
    }
}

/// All files of a folder and its folders whose names end so, in the order of their paths; not what lies in target
/// folders.
pub fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() && path.file_name().is_some_and(|name| name != "target") {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|ending| ending == extension) {
            found.push(path);
        }
    }
    found
}
