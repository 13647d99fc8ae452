//! Text as it is shown on the terminal: names, keys and metadata from files must not control it.

use std::fmt::{Display, Write};
use viewfuse_job::shell::turns;

/// The text with every control character, and every character that changes the direction of what follows, written as
/// `\u001b`; line breaks and tabs stay. In JSON, where such characters stand only in strings, that is the same string.
pub(crate) fn shown(text: impl Display) -> String {
    escaped(&text.to_string(), |character| character == '\n' || character == '\t')
}

/// The same in one line, for errors and warnings.
pub(crate) fn shown_in_line(text: impl Display) -> String {
    escaped(&text.to_string(), |_| false)
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> String {
    let mut shown = String::with_capacity(text.len());
    for character in text.chars() {
        let controls = character.is_control() || turns(character);
        if controls && !stays(character) {
            // Writing to a string does not fail.
            let _ = write!(shown, "\\u{:04x}", u32::from(character));
        } else {
            shown.push(character);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_controls_the_terminal_is_written_out() {
        assert_eq!(shown("a\u{1b}[31mred\u{9b}0m\r\n\tb\u{202e}"), "a\\u001b[31mred\\u009b0m\\u000d\n\tb\\u202e");
        assert_eq!(shown_in_line("two\nlines"), "two\\u000alines");
        let json = serde_json::to_string("a\u{7f}\u{2066}\"\\").expect("JSON");
        assert_eq!(serde_json::from_str::<String>(&shown(&json)).expect("JSON"), "a\u{7f}\u{2066}\"\\");
    }
}
