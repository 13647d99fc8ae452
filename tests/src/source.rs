//! Rust's sources as text: code without its comments, and what stands in its strings.

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
        let mut source = Source::default();
        let (mut rest, mut line) = (text, 1);
        while let Some(first) = rest.chars().next() {
            let (taken, part) = part(rest, source.code.chars().next_back());
            let own = &rest[..taken];
            match part {
                Part::Code => source.code.push(first),
                Part::Comment => {}
                Part::Character => source.code.push_str("''"),
                Part::String { prefix, end } => {
                    source.strings.push((line, own[prefix..own.len() - end].to_owned()));
                    source.code.push_str("\"\"");
                }
            }
            let lines = own.matches('\n').count();
            if !matches!(part, Part::Code) {
                source.code.extend(std::iter::repeat_n('\n', lines));
            }
            line += lines;
            rest = &rest[taken..];
        }
        source
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

enum Part {
    Code,
    Comment,
    Character,
    /// So many bytes before and after what stands in it.
    String {
        prefix: usize,
        end: usize,
    },
}

/// What comes next after this character of code, and its length in bytes.
fn part(rest: &str, before: Option<char>) -> (usize, Part) {
    let first = rest.chars().next().map_or(0, char::len_utf8);
    if rest.starts_with("//") {
        return (rest.find('\n').unwrap_or(rest.len()), Part::Comment);
    }
    if rest.starts_with("/*") {
        return (block_comment(rest), Part::Comment);
    }
    if rest.starts_with('"') {
        return (quoted(rest), Part::String { prefix: 1, end: 1 });
    }
    let in_word = before.is_some_and(|before| before.is_alphanumeric() || before == '_');
    let raw = rest.strip_prefix('r').filter(|_| !in_word || before == Some('b') || before == Some('c'));
    if let Some(after) = raw {
        let marks = after.len() - after.trim_start_matches('#').len();
        if after[marks..].starts_with('"') {
            let close = format!("\"{}", "#".repeat(marks));
            let inside = after[marks + 1..].find(&close).unwrap_or(after.len() - marks - 1 - close.len());
            let prefix = marks + 2;
            return (prefix + inside + close.len(), Part::String { prefix, end: close.len() });
        }
    }
    if let Some(after) = rest.strip_prefix('\'') {
        // A character, or a lifetime.
        if after.starts_with('\\') {
            let end = after[2..].find('\'').map_or(rest.len(), |end| 2 + end + 2);
            return (end, Part::Character);
        }
        let one = after.chars().next().map_or(0, char::len_utf8);
        if after[one..].starts_with('\'') {
            return (one + 2, Part::Character);
        }
    }
    (first, Part::Code)
}

fn block_comment(rest: &str) -> usize {
    let (mut depth, mut place) = (0, 0);
    while place < rest.len() {
        if rest[place..].starts_with("/*") {
            (depth, place) = (depth + 1, place + 2);
        } else if rest[place..].starts_with("*/") {
            (depth, place) = (depth - 1, place + 2);
            if depth == 0 {
                return place;
            }
        } else {
            place += rest[place..].chars().next().map_or(1, char::len_utf8);
        }
    }
    rest.len()
}

fn quoted(rest: &str) -> usize {
    let mut is_escaped = false;
    for (place, character) in rest.char_indices().skip(1) {
        match character {
            '"' if !is_escaped => return place + 1,
            '\\' => is_escaped = !is_escaped,
            _ => is_escaped = false,
        }
    }
    rest.len()
}

/// All files of a folder and its folders whose names end so, in the order of their paths; not what lies in target folders.
pub fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() && path.file_name().is_some_and(|name| name != "target") {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|own| own == extension) {
            found.push(path);
        }
    }
    found
}
