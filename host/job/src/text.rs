//! Text of files in messages.

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

#[cfg(test)]
mod tests {
    #[test]
    fn a_line_stays_one() {
        assert_eq!(super::in_line("a\nb\u{1b}[c é"), "a\\u000ab\\u001b[c é");
    }
}
