//! Which picture is compared with which: by name, without what a render writes beside its pictures.

use anyhow::{Context, bail, ensure};
use std::path::{Path, PathBuf};
use viewfuse_output::record::{RECORD, SUFFIXES};
use viewfuse_output::video::VideoFormat;

/// Extensions of pictures, in small letters.
const EXTENSIONS: [&str; 6] = ["png", "jpg", "jpeg", "webp", "tif", "tiff"];

/// A picture's name, its path, and the path of its ground truth.
pub(super) struct Pair {
    pub(super) name: String,
    pub(super) prediction: PathBuf,
    pub(super) truth: PathBuf,
}

/// Every picture with its ground truth.
pub(super) fn pairs(prediction: &Path, truth: &Path) -> anyhow::Result<Vec<Pair>> {
    if let Some(path) = [prediction, truth].into_iter().find(|path| !path.exists()) {
        bail!("{}: no such file or folder", path.display());
    }
    if !prediction.is_dir() {
        ensure!(!truth.is_dir(), "{}: is a folder, {} is not", truth.display(), prediction.display());
        let name = prediction.display().to_string();
        return Ok(vec![Pair { name, prediction: prediction.to_owned(), truth: truth.to_owned() }]);
    }
    ensure!(!truth.is_file(), "{}: is a folder, {} is not", prediction.display(), truth.display());
    let all = pictures(prediction)?;
    let is_beside = |path: &Path| {
        let stem = stem(path);
        let base = SUFFIXES.iter().filter(|suffix| !suffix.is_empty()).find_map(|suffix| stem.strip_suffix(suffix));
        base.is_some_and(|stem| all.iter().any(|other| self::stem(other) == stem))
    };
    // Some videos are pictures, too. In another folder every picture is one to compare.
    let is_run = prediction.join(RECORD).is_file();
    let is_video = |path: &Path| VideoFormat::ALL.iter().any(|format| path.ends_with(format!("video.{format}")));
    let is_other = |path: &Path| is_run && (is_beside(path) || is_video(path));
    let predictions: Vec<&PathBuf> = all.iter().filter(|path| !is_other(path)).collect();
    if predictions.is_empty() {
        bail!("{}: has no pictures ({})", prediction.display(), EXTENSIONS[..3].join(", "));
    }
    let truths = if truth.is_dir() { pictures(truth)? } else { Vec::new() };
    let pair = |path: &&PathBuf| {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        // The very name, before one that differs in its extension.
        let same = truth.join(&name);
        let alike: Vec<&PathBuf> = truths.iter().filter(|truth| stem(truth) == stem(path)).collect();
        let found = match alike[..] {
            _ if same.is_file() => Some(same.clone()),
            [first, second, ..] => {
                bail!("{}: may be compared with {} or {}", path.display(), first.display(), second.display())
            }
            _ => alike.first().copied().cloned(),
        };
        let truth =
            found.with_context(|| format!("{}: is missing, to compare {} with", same.display(), path.display()))?;
        Ok(Pair { name, prediction: path.to_path_buf(), truth })
    };
    predictions.iter().map(pair).collect()
}

/// The pictures of a folder, sorted by name: those that begin with a dot are macOS's notes of them.
fn pictures(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let listed = || format!("{}: cannot be listed", folder.display());
    let mut pictures = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(listed)? {
        let path = entry.with_context(listed)?.path();
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        let is_hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        if !is_hidden && extension.is_some_and(|extension| EXTENSIONS.iter().any(|known| extension == *known)) {
            pictures.push(path);
        }
    }
    pictures.sort();
    Ok(pictures)
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
