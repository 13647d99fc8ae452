//! Journals: files of lines that say what is finished, and survive a kill at any time. A last line without its line
//! break is not whole and does not count.

use super::ordinary::{append_ordinary, open_ordinary, read_line};
use std::fs::{File, TryLockError};
use std::io::{self, BufReader, Write};
use std::path::Path;

/// The lines of a journal that is there.
#[derive(Debug)]
pub struct JournalLines {
    reader: BufReader<File>,
    most: u64,
    whole: u64,
    unfinished: Vec<u8>,
}

impl JournalLines {
    /// Opens a journal whose lines have at most `most` bytes; `None` if there is none.
    ///
    /// # Errors
    /// As [`open_ordinary`].
    pub fn open(path: &Path, most: u64) -> io::Result<Option<JournalLines>> {
        let lines = |file| JournalLines { reader: BufReader::new(file), most, whole: 0, unfinished: Vec::new() };
        Ok(open_ordinary(path)?.map(lines))
    }

    /// The next whole line, with its line break; `None` behind the last one.
    ///
    /// # Errors
    /// As reading a line of a file.
    pub fn next_line(&mut self) -> io::Result<Option<Vec<u8>>> {
        let line = read_line(&mut self.reader, self.most)?;
        if line.ends_with(b"\n") {
            self.whole += line.len() as u64;
            return Ok(Some(line));
        }
        self.unfinished = line;
        Ok(None)
    }

    /// The length of the whole lines so far: where the journal is to be cut to go on behind them.
    pub fn whole(&self) -> u64 {
        self.whole
    }

    /// What follows the last whole line, once that is known.
    pub fn unfinished(&self) -> &[u8] {
        &self.unfinished
    }

    /// Whether what follows the last whole line can become a line that begins like this.
    pub fn is_begun_like(&self, beginning: &[u8]) -> bool {
        self.unfinished.starts_with(beginning) || beginning.starts_with(&self.unfinished)
    }
}

/// A journal that is gone on with.
#[derive(Debug)]
pub struct Journal(File);

impl Journal {
    /// Opens a journal behind its last byte; it is made where there is none.
    ///
    /// # Errors
    /// As opening an ordinary file to append to it.
    pub fn append(path: &Path) -> io::Result<Journal> {
        append_ordinary(path).map(Journal)
    }

    /// Keeps other processes from locking it as long as it is open; `false` if one has. File systems without locks
    /// still work: nothing is locked there.
    pub fn lock(&self) -> bool {
        !matches!(self.0.try_lock(), Err(TryLockError::WouldBlock))
    }

    /// Removes what follows its first bytes.
    ///
    /// # Errors
    /// What the system says.
    pub fn cut(&self, whole: u64) -> io::Result<()> {
        self.0.set_len(whole)
    }

    /// Adds a line, given without its line break; it is on disk when this returns.
    ///
    /// # Errors
    /// What the system says.
    pub fn add(&mut self, mut line: Vec<u8>) -> io::Result<()> {
        line.push(b'\n');
        self.0.write_all(&line)?;
        self.0.sync_data()
    }
}

#[cfg(test)]
mod tests {
    use super::{Journal, JournalLines};

    #[test]
    fn a_line_that_a_kill_cut_does_not_count() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal");
        assert!(JournalLines::open(&path, 10).expect("none").is_none());
        let mut journal = Journal::append(&path).expect("made");
        assert!(journal.lock() && !Journal::append(&path).expect("the same").lock());
        journal.add(b"{\"a\":1}".to_vec()).expect("a line");
        std::fs::write(&path, b"{\"a\":1}\n{\"a").expect("a kill");
        let mut lines = JournalLines::open(&path, 10).expect("it is there").expect("a journal");
        assert_eq!(lines.next_line().expect("a line"), Some(b"{\"a\":1}\n".to_vec()));
        assert_eq!(lines.next_line().expect("no other"), None);
        assert_eq!((lines.whole(), lines.unfinished()), (8, b"{\"a".as_slice()));
        assert!(lines.is_begun_like(b"{\"a\":") && lines.is_begun_like(b"{\"") && !lines.is_begun_like(b"{\"b"));
        journal.cut(lines.whole()).expect("cut");
        journal.add(b"{}".to_vec()).expect("another");
        assert_eq!(std::fs::read(&path).expect("a file"), b"{\"a\":1}\n{}\n");
    }
}
