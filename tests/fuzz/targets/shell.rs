//! Names as words of a command line that a person pastes into a shell.

use super::{Target, Verdict};
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use viewfuse::job::shell::quoted;

pub(crate) struct Shell;

/// What a shell makes of a word, by the rules of POSIX 2024 for quotes and `$'...'`; an error where the word is not
/// one, or anything in it would be expanded.
fn unquoted(word: &str) -> Result<Vec<u8>, String> {
    let (mut bytes, mut rest) = (Vec::new(), word.as_bytes());
    while let Some((first, after)) = rest.split_first() {
        rest = match first {
            b'\'' => {
                let end = after.iter().position(|byte| *byte == b'\'').ok_or("a quote without an end")?;
                bytes.extend(&after[..end]);
                &after[end + 1..]
            }
            b'$' if after.first() == Some(&b'\'') => numbered(&after[1..], &mut bytes)?,
            b'\\' => {
                let (escaped, behind) = after.split_first().ok_or("a backslash at the end")?;
                bytes.push(*escaped);
                behind
            }
            plain if plain.is_ascii_alphanumeric() || b"_@%+=:,./-".contains(plain) => {
                bytes.push(*plain);
                after
            }
            other => return Err(format!("the byte {other} is not quoted")),
        };
    }
    Ok(bytes)
}

/// Behind `$'`: up to the end, and what follows it.
fn numbered<'a>(mut rest: &'a [u8], bytes: &mut Vec<u8>) -> Result<&'a [u8], String> {
    loop {
        let (first, after) = rest.split_first().ok_or("a quote without an end")?;
        rest = match first {
            b'\'' => return Ok(after),
            b'\\' if after.first().is_some_and(u8::is_ascii_digit) => {
                let digits = after.get(..3).ok_or("a number of fewer than three digits")?;
                let text = std::str::from_utf8(digits).map_err(|error| error.to_string())?;
                bytes.push(u8::from_str_radix(text, 8).map_err(|error| error.to_string())?);
                &after[3..]
            }
            b'\\' => {
                let (escaped, behind) = after.split_first().ok_or("a backslash at the end")?;
                bytes.push(*escaped);
                behind
            }
            other => {
                bytes.push(*other);
                after
            }
        };
    }
}

impl Target for Shell {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let words: [&[u8]; 7] = [
            b"plain",
            b"it's",
            b"$(rm -rf *); `id`",
            b"{view} & ~",
            "B\u{e4}r\u{202e}".as_bytes(),
            b"a\n\x1b[201~",
            b"\xff\xfe",
        ];
        words.map(<[u8]>::to_vec).to_vec()
    }

    fn words(&self) -> &'static [&'static str] {
        &["'", "\\", "$'", "\\'", "\n", "\u{2028}", "\u{61c}", "`", "$(", "~", "#", "0", "7"]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let word = quoted(OsStr::from_bytes(bytes));
        if word.is_empty() || word.chars().any(char::is_control) {
            return Err(format!("{word:?} is not one word to paste"));
        }
        match unquoted(&word) {
            Ok(again) if again == bytes => {}
            Ok(again) => return Err(format!("{word:?} means {again:?}, not {bytes:?}")),
            Err(reason) => return Err(format!("{word:?}: {reason}")),
        }
        let is_plain = word.as_bytes() == bytes;
        Ok(if is_plain {
            Verdict::Read
        } else {
            Verdict::Refused(word.chars().take(2).filter(|letter| !letter.is_alphanumeric()).collect())
        })
    }
}
