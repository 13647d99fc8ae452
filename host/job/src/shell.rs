//! Words as a shell takes them, for command lines that a person pastes.

use std::ffi::OsStr;

/// Characters that change the direction of what follows, or break lines in some programs: a line that holds one is not
/// what it looks like.
pub fn turns(character: char) -> bool {
    matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A word as bash, zsh and other shells of POSIX take it: as it is where it has letters, digits and `_@%+=:,./-` only,
/// otherwise between quotes. A word with control characters, which a terminal would obey while the line is pasted, with
/// characters that turn the text, or with bytes that are no UTF-8 has these as numbers: `$'a\033b'` (POSIX since 2024).
pub fn quoted(word: impl AsRef<OsStr>) -> String {
    let bytes = word.as_ref().as_encoded_bytes();
    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"_@%+=:,./-".contains(byte);
    match std::str::from_utf8(bytes) {
        Ok(text) if !text.is_empty() && bytes.iter().all(is_plain) => text.to_owned(),
        Ok(text) if !text.contains(|letter: char| letter.is_control() || turns(letter)) => {
            format!("'{}'", text.replace('\'', "'\\''"))
        }
        _ => numbered(bytes),
    }
}

fn numbered(bytes: &[u8]) -> String {
    let mut word = "$'".to_owned();
    // Three digits: what follows them is not taken for a fourth.
    let as_number = |word: &mut String, byte: u8| word.push_str(&format!("\\{byte:03o}"));
    for chunk in bytes.utf8_chunks() {
        for character in chunk.valid().chars() {
            match character {
                '\'' | '\\' => word.extend(['\\', character]),
                letter if letter.is_control() || turns(letter) => {
                    letter.encode_utf8(&mut [0; 4]).bytes().for_each(|byte| as_number(&mut word, byte));
                }
                letter => word.push(letter),
            }
        }
        chunk.invalid().iter().for_each(|byte| as_number(&mut word, *byte));
    }
    word.push('\'');
    word
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_are_quoted_where_they_must_be() {
        for plain in ["a", "tests/data/room", "error:alpha=1,angle=full", "50%", "a@b", "-1"] {
            assert_eq!(quoted(plain), plain);
        }
        assert_eq!(quoted(""), "''");
        assert_eq!(quoted("it's {view}; $(rm *)"), r"'it'\''s {view}; $(rm *)'");
        assert_eq!(quoted("a\n\u{1b}[201~\\'1"), r"$'a\012\033[201~\\\'1'");
        assert_eq!(quoted("Bär\u{202e}"), r"$'Bär\342\200\256'");
    }

    /// Every byte that a word can have, between others and beside what quotes it, read by shells.
    #[cfg(unix)]
    #[test]
    fn shells_read_every_byte_as_it_was() {
        use std::ffi::OsStr;
        use std::io::Write;
        use std::os::unix::ffi::OsStrExt;
        use std::process::{Command, Stdio};
        for shell in ["bash", "sh"] {
            let is_plain = |byte: u8| (b' '..0x7f).contains(&byte);
            // The numbers are younger than some shells that are called `sh`.
            let bytes: Vec<u8> = (1..=u8::MAX).filter(|byte| shell == "bash" || is_plain(*byte)).collect();
            let around = |byte: u8| [vec![byte], vec![b'a', byte, b'7'], vec![byte, byte], vec![b'\'', byte, b'\\']];
            let words: Vec<Vec<u8>> = bytes.iter().copied().flat_map(around).collect();
            let mut script = String::new();
            for word in &words {
                script += &format!("printf '%s\\0' {}\n", quoted(OsStr::from_bytes(word)));
            }
            assert!(
                script.bytes().all(|byte| byte == b'\n' || !byte.is_ascii_control()),
                "only the ends of lines control"
            );
            let run = Command::new(shell).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
            let Ok(mut run) = run else {
                assert_eq!(shell, "bash", "every system has a shell");
                continue;
            };
            run.stdin.take().expect("a pipe").write_all(script.as_bytes()).expect("a shell that reads");
            let read = run.wait_with_output().expect("its output").stdout;
            let expected: Vec<u8> = words.iter().flat_map(|word| word.iter().copied().chain([0])).collect();
            assert!(read == expected, "{shell}");
        }
    }
}
