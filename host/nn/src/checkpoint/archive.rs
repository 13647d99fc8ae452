//! The format of `torch.save` since PyTorch 1.6: a zip archive with `ARCHIVE/data.pkl`, the description, and
//! `ARCHIVE/data/KEY`, the storages.
//!
//! PyTorch does not compress, so an entry is a range of the file, and its size can be checked.

use super::error::{Problem, shortened};
use super::input::Input;
use super::location::{TensorLocation, TensorLocations};
use super::pickle::Pickle;
use super::state_dict::{self, StateDict};
use std::fs::File;
use std::io::BufReader;
use zip::{CompressionMethod, ZipArchive, result::ZipError};

/// Longest key of a storage; PyTorch numbers them.
const LONGEST_KEY: usize = 64;

struct Archive<'a> {
    zip: ZipArchive<BufReader<&'a File>>,
    /// Length of the file.
    length: u64,
}

/// Opens the archive.
pub(super) fn open(file: &File, length: u64) -> Result<(StateDict, TensorLocations), Problem> {
    let zip = ZipArchive::new(BufReader::new(file)).map_err(damaged)?;
    if zip.has_duplicate_names() {
        return Err(Problem::Content("is a zip archive with two entries of one name; PyTorch writes none".to_owned()));
    }
    let mut archive = Archive { zip, length };
    let folder = archive.folder()?;
    if archive.entry(&format!("{folder}constants.pkl"))?.is_some() {
        return Err(Problem::Content(
            "is a TorchScript program; in PyTorch, save model.state_dict() with torch.save".to_owned(),
        ));
    }
    if let Some((start, length)) = archive.entry(&format!("{folder}byteorder"))? {
        let order = Input::new(file, start, start + length)?.take(length.min(16))?;
        if order != b"little" {
            return Err(Problem::Content(format!(
                "has numbers in byte order '{}', only 'little' is read; save it again on a usual machine",
                shortened(&String::from_utf8_lossy(&order))
            )));
        }
    }
    let Some((start, length)) = archive.entry(&format!("{folder}data.pkl"))? else {
        return Err(Problem::Content(format!("has no entry {folder}data.pkl")));
    };
    let pickle = Pickle::read(&mut Input::new(file, start, start + length)?)?;
    let found = state_dict::find(&pickle, &|id| state_dict::storage(&pickle, id)).map_err(Problem::Content)?;
    let mut places = TensorLocations::new();
    for (name, claim) in &found.claims {
        let wrong = |what: String| Problem::Content(format!("tensor '{}': {what}", shortened(name)));
        let storage = state_dict::storage(&pickle, claim.storage).map_err(wrong)?;
        let entry = match storage.key.len() <= LONGEST_KEY {
            true => archive.entry(&format!("{folder}data/{}", storage.key))?,
            false => None,
        };
        let Some((start, available)) = entry else {
            return Err(wrong(format!("the archive has no entry {folder}data/{}", shortened(storage.key))));
        };
        places.insert(name.clone(), TensorLocation::of(&shortened(name), claim, storage, start, available)?);
    }
    Ok((found, places))
}

impl Archive<'_> {
    /// The one folder with a `data.pkl`, with its slash.
    fn folder(&self) -> Result<String, Problem> {
        let mut folders = Vec::new();
        for name in self.zip.file_names() {
            let name = name.map_err(damaged)?;
            let folder = name.strip_suffix("data.pkl").filter(|folder| folder.is_empty() || folder.ends_with('/'));
            folders.extend(folder.map(str::to_owned));
        }
        match (folders.pop(), folders.is_empty()) {
            (Some(folder), true) => Ok(folder),
            (Some(_), false) => Err(Problem::Content("is a zip archive with more than one data.pkl".to_owned())),
            (None, _) => Err(Problem::NoCheckpoint(
                "a zip archive without data.pkl, so not from torch.save; unpack it first if the checkpoint is inside"
                    .to_owned(),
            )),
        }
    }

    /// Offset and length in the file of an entry's content.
    fn entry(&mut self, name: &str) -> Result<Option<(u64, u64)>, Problem> {
        let Some(index) = self.zip.index_for_name(name) else { return Ok(None) };
        let wrong = |what: &str| Problem::Content(format!("entry {}: {what}", shortened(name)));
        let entry = self.zip.by_index_raw(index).map_err(damaged)?;
        if entry.compression() != CompressionMethod::Stored || entry.encrypted() {
            return Err(wrong(
                "is compressed or encrypted, which PyTorch never does; in PyTorch, load the file and save it again",
            ));
        }
        let (start, length) = (entry.data_start(), entry.size());
        let end = start.and_then(|start| start.checked_add(length));
        match (start, end) {
            (Some(start), Some(end)) if end <= self.length && entry.compressed_size() == length => {
                Ok(Some((start, length)))
            }
            _ => Err(wrong("reaches beyond the end of the file; the file is cut off or damaged")),
        }
    }
}

fn damaged(error: ZipError) -> Problem {
    match error {
        ZipError::Io(cause) => cause.into(),
        error => Problem::Content(format!("is a damaged zip archive ({error}); was the download complete?")),
    }
}
