//! When a result was made, and from what: `stamps.json` beside the results.
//!
//! A result's inputs are its command lines and the files that its row is dated by. Of Rust's sources the tokens count, without
//! comments and documentation; of other files the bytes. Data sets that are given do not count: they do not change.

use anyhow::Context;
use proc_macro2::{TokenStream, TokenTree};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};
use viewfuse_job::digest::{sha256, sha256_of};
use viewfuse_job::files::write_whole;

use crate::repository;

const FILE: &str = "stamps.json";
const SECONDS_A_DAY: u64 = 86_400;

/// Of one result.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Stamp {
    /// The digest of what it was made from.
    pub(crate) inputs: String,
    /// The day, in UTC.
    pub(crate) made: String,
    pub(crate) machine: String,
    /// Of all processes; 0 where the system does not tell.
    pub(crate) cpu_seconds: f64,
    pub(crate) wall_seconds: f64,
}

/// Of all results of a folder, by name.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Stamps(BTreeMap<String, Stamp>);

impl Stamps {
    /// Those of a folder; none if nothing was made there.
    pub(crate) fn read(folder: &Path) -> anyhow::Result<Stamps> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(Stamps::default());
        }
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        serde_json::from_str(&text).with_context(|| path.display().to_string())
    }

    pub(crate) fn of(&self, name: &str) -> Option<&Stamp> {
        self.0.get(name)
    }

    /// Adds a stamp and writes all of them.
    pub(crate) fn add(&mut self, folder: &Path, name: &str, stamp: Stamp) -> anyhow::Result<()> {
        self.0.insert(name.to_owned(), stamp);
        let text = serde_json::to_string_pretty(self)? + "\n";
        Ok(write_whole(&folder.join(FILE), text.as_bytes())?)
    }
}

/// The digest of a text and of files and folders of the repository.
pub(crate) fn digest(text: &str, paths: &[&str]) -> anyhow::Result<String> {
    let mut parts = text.to_owned();
    for path in paths {
        let mut files = Vec::new();
        let path = repository().join(path);
        collect(&path, &mut files).with_context(|| path.display().to_string())?;
        // A module stands beside its folder.
        let beside = path.with_extension("rs");
        if path.is_dir() && beside.exists() {
            files.push(beside);
        }
        for file in files {
            let own = match file.extension().is_some_and(|extension| extension == "rs") {
                true => {
                    let source = std::fs::read_to_string(&file)?;
                    sha256(tokens(&source).with_context(|| file.display().to_string())?.as_bytes())
                }
                false => sha256_of(&file)?,
            };
            let name = file.strip_prefix(repository())?.display().to_string();
            parts += &format!("\n{name} {own}");
        }
    }
    Ok(sha256(parts.as_bytes()))
}

/// All files of a folder, or the file, in the order of their paths.
fn collect(path: &Path, files: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    if !path.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    let mut entries = std::fs::read_dir(path)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    entries.sort();
    entries.iter().try_for_each(|entry| collect(entry, files))
}

/// The tokens of a source without comments and documentation.
fn tokens(source: &str) -> anyhow::Result<String> {
    fn add(stream: TokenStream, text: &mut String) {
        let mut rest = stream.into_iter().peekable();
        while let Some(tree) = rest.next() {
            match tree {
                // Documentation is an attribute: `#[doc = "..."]`, inside a module `#![doc = "..."]`.
                TokenTree::Punct(mark) if mark.as_char() == '#' => {
                    let inner = rest.next_if(|tree| matches!(tree, TokenTree::Punct(mark) if mark.as_char() == '!'));
                    let is_documentation = |tree: &TokenTree| matches!(tree, TokenTree::Group(group) if group.stream().to_string().starts_with("doc ="));
                    if rest.next_if(is_documentation).is_none() {
                        *text += if inner.is_some() { "#! " } else { "# " };
                    }
                }
                TokenTree::Group(group) => {
                    *text += &format!("{:?}( ", group.delimiter());
                    add(group.stream(), text);
                    *text += ") ";
                }
                other => *text += &format!("{other} "),
            }
        }
    }
    let stream = TokenStream::from_str(source).map_err(|error| anyhow::anyhow!("no Rust: {error}"))?;
    let mut text = String::new();
    add(stream, &mut text);
    Ok(text)
}

/// The day, in UTC.
pub(crate) fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let [year, month, day] = date(seconds / SECONDS_A_DAY);
    format!("{year:04}-{month:02}-{day:02}")
}

/// Year, month and day of a day since 1970, by counting from the first of March of year 0, in eras of 400 years.
fn date(days: u64) -> [u64; 3] {
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    [era * 400 + year + u64::from(month <= 2), month, day]
}

/// The processor and how many threads it runs.
pub(crate) fn machine() -> String {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(std::env::consts::ARCH);
    format!("{}, {threads} threads", model.trim_start_matches([' ', '\t', ':']))
}

/// CPU seconds of all finished children so far, where the system tells (Linux).
pub(crate) fn cpu_seconds() -> f64 {
    // The children's times are fields 14 and 15 behind the name.
    seconds_of([13, 14])
}

/// CPU seconds of this process so far; 0 where the system does not tell.
pub(crate) fn own_cpu_seconds() -> f64 {
    seconds_of([11, 12])
}

/// The sum of two times of this process, by their places behind its name.
fn seconds_of(places: [usize; 2]) -> f64 {
    const TICKS_A_SECOND: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Behind the name, which stands in parentheses, the state is the first field.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |place: usize| fields.get(place).and_then(|text| text.parse::<f64>().ok()).unwrap_or(0.0);
    places.map(ticks).iter().sum::<f64>() / TICKS_A_SECOND
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_date_nothing() {
        let plain = tokens("fn a() { b(1.5) }").expect("tokens");
        let same = "//! A module.\n/// Says.\nfn a() {\n    // Why.\n    b(1.5) /* here */\n}\n";
        assert_eq!(tokens(same).expect("tokens"), plain);
        for other in ["fn a() { b(1.25) }", "fn a() { b[1.5] }", "#[inline] fn a() { b(1.5) }", "fn a() { b(1.5); }"] {
            assert_ne!(tokens(other).expect("tokens"), plain, "{other}");
        }
    }

    #[test]
    fn days_have_dates() {
        for (days, expected) in
            [(0, [1970, 1, 1]), (11_016, [2000, 2, 29]), (19_723, [2024, 1, 1]), (20_788, [2026, 12, 1])]
        {
            assert_eq!(date(days), expected);
        }
    }
}
