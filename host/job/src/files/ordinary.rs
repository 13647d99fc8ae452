//! Files that a program continues in a folder that a person chose: no links, no pipes, no devices, and lines of limited
//! length.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, ErrorKind, Read};
use std::path::Path;

/// Whether there is a file.
///
/// # Errors
/// If what is there is a link or no ordinary file: reading from it could wait, or go on, without end, and writing to it
/// could change a file elsewhere.
pub fn is_ordinary(path: &Path) -> io::Result<bool> {
    let refused = |what| Err(io::Error::other(format!("it is {what}, and is left alone")));
    match fs::symlink_metadata(path) {
        Err(cause) if cause.kind() == ErrorKind::NotFound => Ok(false),
        Err(cause) => Err(cause),
        Ok(about) if about.is_symlink() => refused("a link"),
        Ok(about) if !about.is_file() => refused("no ordinary file"),
        Ok(_) => Ok(true),
    }
}

/// Opens a file for reading; `None` if there is none.
///
/// # Errors
/// As [`is_ordinary`], or what the system says.
pub fn open_ordinary(path: &Path) -> io::Result<Option<File>> {
    if is_ordinary(path)? { File::open(path).map(Some) } else { Ok(None) }
}

/// Opens a file for appending; it is made where there is none.
///
/// # Errors
/// As [`is_ordinary`], or what the system says.
pub(super) fn append_ordinary(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.append(true).read(true);
    if is_ordinary(path)? {
        return options.open(path);
    }
    match options.clone().create_new(true).open(path) {
        // Another process made it just now.
        Err(cause) if cause.kind() == ErrorKind::AlreadyExists && is_ordinary(path)? => options.open(path),
        opened => opened,
    }
}

/// The next line with its line break; without one if it is the last and not whole; empty at the end.
///
/// # Errors
/// If it has more than `most` bytes, or what the system says.
pub(super) fn read_line(reader: &mut impl BufRead, most: u64) -> io::Result<Vec<u8>> {
    let mut line = Vec::new();
    reader.take(most).read_until(b'\n', &mut line)?;
    let is_cut = line.len() as u64 == most && !line.ends_with(b"\n");
    if is_cut { Err(io::Error::other(format!("a line is longer than {most} bytes"))) } else { Ok(line) }
}

#[cfg(test)]
mod tests {
    use super::{append_ordinary, is_ordinary, open_ordinary, read_line};
    use std::io::Write;

    #[test]
    fn only_ordinary_files_are_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("own");
        assert!(open_ordinary(&path).expect("none").is_none());
        append_ordinary(&path).expect("made").write_all(b"a").expect("written");
        append_ordinary(&path).expect("there").write_all(b"b").expect("written");
        assert_eq!(std::fs::read(&path).expect("a file"), b"ab");
        assert!(open_ordinary(&path).expect("there").is_some());
        assert!(append_ordinary(folder.path()).is_err() && is_ordinary(folder.path()).is_err());
        #[cfg(unix)]
        for target in ["own", "nowhere"] {
            let link = folder.path().join(format!("link to {target}"));
            std::os::unix::fs::symlink(folder.path().join(target), &link).expect("a link");
            assert!(append_ordinary(&link).is_err() && open_ordinary(&link).is_err(), "{target}");
        }
        assert!(!folder.path().join("nowhere").exists());
    }

    #[test]
    fn lines_have_a_limit() {
        let mut reader = b"ab\ncd\ne".as_slice();
        let lines = [(); 4].map(|()| read_line(&mut reader, 4).expect("a line"));
        assert_eq!(lines, [b"ab\n".to_vec(), b"cd\n".to_vec(), b"e".to_vec(), Vec::new()]);
        assert!(read_line(&mut b"abcd".as_slice(), 4).is_err());
        assert_eq!(read_line(&mut b"abc\n".as_slice(), 4).expect("a line"), b"abc\n");
    }
}
