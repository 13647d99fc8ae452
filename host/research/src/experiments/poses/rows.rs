//! Rows of a result file, each appended when it is made: a run that was stopped goes on where it ended.

use anyhow::Context;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::PathBuf;

/// The file.
pub(super) struct Rows {
    path: PathBuf,
    file: File,
    all: Vec<String>,
}

impl Rows {
    /// Opens a file or begins it; whole rows that are there stay, all else goes.
    pub(super) fn open(path: &str, title: &str) -> anyhow::Result<Rows> {
        let path = PathBuf::from(path);
        let before = if path.exists() {
            fs::read_to_string(&path).with_context(|| path.display().to_string())?
        } else {
            String::new()
        };
        let whole = before.rfind('\n').map_or("", |end| &before[..end]);
        let all: Vec<String> = whole.lines().filter(|line| is_row(line)).map(str::to_owned).collect();
        let text: String =
            std::iter::once(title).chain(all.iter().map(String::as_str)).map(|line| format!("{line}\n")).collect();
        fs::write(&path, text).with_context(|| path.display().to_string())?;
        let file = OpenOptions::new().append(true).open(&path).with_context(|| path.display().to_string())?;
        Ok(Rows { path, file, all })
    }

    /// All rows.
    pub(super) fn all(&self) -> &[String] {
        &self.all
    }

    /// Makes the row that begins with this head, if it is not there.
    pub(super) fn row(&mut self, head: &str, rest: impl FnOnce() -> anyhow::Result<String>) -> anyhow::Result<()> {
        let words: Vec<&str> = head.split_whitespace().collect();
        let is_it = |row: &String| row.split_whitespace().take(words.len()).eq(words.iter().copied());
        if self.all.iter().any(is_it) {
            return Ok(());
        }
        let row = format!("{head}  {}", rest()?);
        println!("{row}");
        self.append(&row)?;
        self.all.push(row);
        Ok(())
    }

    /// Appends what is to be said of all rows.
    pub(super) fn finish(mut self, summary: &str) -> anyhow::Result<()> {
        println!("\n{summary}");
        self.append(&format!("\n{summary}"))
    }

    fn append(&mut self, text: &str) -> anyhow::Result<()> {
        self.file.write_all(format!("{text}\n").as_bytes()).with_context(|| self.path.display().to_string())
    }
}

/// Whether a line is a scene, the number of photographs, a seed, and what is said of the focal length.
fn is_row(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    words.len() > 4 && words[1..3].iter().all(|word| word.parse::<u64>().is_ok())
}

/// The numbers of a row behind its head; a name that is a number is not among them.
pub(super) fn numbers(row: &str) -> Vec<f64> {
    row.split_whitespace().skip(4).filter_map(|word| word.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_was_stopped_goes_on() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("rows.txt").display().to_string();
        let mut rows = Rows::open(&path, "scene photographs seed focal rest").expect("a file");
        rows.row("fern   3  1  EXIF", || Ok("2.5".to_owned())).expect("a row");
        drop(rows);
        // Killed while a row was written.
        let cut = fs::read_to_string(&path).expect("a file") + "fern 5 1 EXIF 2";
        fs::write(&path, cut).expect("a file");
        let mut rows = Rows::open(&path, "scene photographs seed focal rest").expect("a file");
        rows.row("fern 3 1 EXIF", || panic!("it is there")).expect("a row");
        rows.row("fern 5 1 EXIF", || Ok("refused".to_owned())).expect("a row");
        rows.finish("2 sets").expect("an end");
        let text = fs::read_to_string(&path).expect("a file");
        assert_eq!(
            text,
            "scene photographs seed focal rest\nfern   3  1  EXIF  2.5\nfern 5 1 EXIF  refused\n\n2 sets\n"
        );
        let again = Rows::open(&path, "title").expect("a file");
        assert_eq!(again.all().len(), 2);
        assert_eq!(numbers(&again.all()[0]), [2.5]);
    }
}
