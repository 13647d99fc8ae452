//! Text of files in messages, and names that were nearly written.

use std::fmt::{Display, Write};

/// The text in one line, whatever a file made of it: control characters are written as `\u000a`.
pub fn in_line(text: impl Display) -> String {
    let text = text.to_string();
    let mut line = String::with_capacity(text.len());
    for character in text.chars() {
        match character.is_control() {
            // Writing to a string does not fail.
            true => drop(write!(line, "\\u{:04x}", u32::from(character))),
            false => line.push(character),
        }
    }
    line
}

/// Names in a line, at most `most` of them: `a, b and 3 more`.
pub fn listed(names: &[impl AsRef<str>], most: usize) -> String {
    let shown: Vec<&str> = names.iter().take(most).map(AsRef::as_ref).collect();
    match names.len() - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Of the names that are known, those that a text most likely meant, the nearest first, at most `most`: at most half of
/// its characters have to be changed, inserted, removed or swapped.
pub fn nearest<'a>(text: &str, known: impl IntoIterator<Item = &'a str>, most: usize) -> Vec<&'a str> {
    let length = |text: &str| text.chars().count();
    let near = |name: &'a str| {
        let edits = strsim::damerau_levenshtein(text, name);
        (2 * edits <= length(text).max(length(name))).then_some((edits, name))
    };
    let mut near: Vec<(usize, &str)> = known.into_iter().filter_map(near).collect();
    // Names of one distance stay in their order.
    near.sort_by_key(|(edits, _)| *edits);
    near.into_iter().map(|(_, name)| name).take(most).collect()
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn what_was_nearly_written_is_found() {
        let known = ["auto", "mean", "error", "gaussian"];
        for (text, expected) in [("eror", "error"), ("auot", "auto"), ("gausian", "gaussian"), ("mena", "mean")] {
            assert_eq!(nearest(text, known, 1), [expected], "{text}");
        }
        assert_eq!(nearest("median", known, 3), ["mean"]);
        assert!(nearest("xyz", known, 3).is_empty() && nearest("", known, 3).is_empty());
        assert_eq!(nearest("im2", ["im0", "im1", "im20"], 2), ["im0", "im1"]);
    }

    #[test]
    fn a_line_stays_one() {
        assert_eq!(super::in_line("a\nb\u{1b}[c é"), "a\\u000ab\\u001b[c é");
    }
}
