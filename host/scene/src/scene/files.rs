//! Reading text, listing folders and naming files, with the path in every error.

use std::cmp::Ordering;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{fs, io};

use viewfuse_job::files::read_at_most;

use super::error::{SceneError, SceneFault};
use super::fault::{FileFault, FilePlace};

/// Extensions of photographs, compared without regard to case.
pub(super) const IMAGE_EXTENSIONS: [&str; 9] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "JPG", "JPEG", "PNG"];

/// Folders of photographs, in the order in which they are searched: the largest photographs first.
pub(super) const IMAGE_FOLDERS: [&str; 8] =
    ["images", "images_1", "images_2", "images_4", "images_8", "input", "image", "rgb"];

/// Most bytes of a list of cameras, points or depths.
pub(super) const MAX_FILE: u64 = 4 << 30;

/// Most bytes of any other text: a `transforms.json` of ten thousand views takes ten million.
const MAX_TEXT: u64 = 256 << 20;

/// Longest part of a wrong word that an error quotes: a binary file's first "word" may be the whole file.
const MAX_EXCERPT: usize = 40;

/// The error for a file or folder that the operating system could not open.
pub(crate) fn unreadable(path: &Path, cause: io::Error) -> SceneError {
    let is_missing = cause.kind() == io::ErrorKind::NotFound;
    FilePlace::file(path).fault(if is_missing { SceneFault::Missing } else { SceneFault::Read(cause) })
}

/// The contents of a text file of at most 256 MiB, without the byte order mark that some editors put in front. The
/// length is judged before anything is read.
///
/// # Errors
/// [`SceneFault::Missing`], [`SceneFault::Read`] if it cannot be read, or [`FileFault::NotText`] with the line if it is
/// not UTF-8.
pub fn read_text(path: &Path) -> Result<String, SceneError> {
    read_text_of(path, MAX_TEXT)
}

/// The same for another limit.
pub(super) fn read_text_of(path: &Path, most: u64) -> Result<String, SceneError> {
    let bytes = read_at_most(path, most).map_err(|cause| unreadable(path, cause))?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        FilePlace::line(path, line).fault(FileFault::NotText("this line"))
    })?;
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_string(),
        None => text,
    })
}

/// The files in a folder for whose name `wanted` holds, in natural order, without hidden ones: archives made on a Mac
/// contain a `._000000.png` next to each `000000.png`.
///
/// # Errors
/// [`SceneFault::Missing`] or [`SceneFault::Read`] for a folder that cannot be listed.
pub fn list(folder: &Path, wanted: impl Fn(&Path) -> bool) -> Result<Vec<PathBuf>, SceneError> {
    entries(folder, |_, path| wanted(path) && path.is_file())
}

/// The folders in a folder, in natural order, without hidden ones and links.
///
/// # Errors
/// As [`list`].
pub fn folders(folder: &Path) -> Result<Vec<PathBuf>, SceneError> {
    entries(folder, |entry, _| entry.file_type().is_ok_and(|kind| kind.is_dir()))
}

fn entries(folder: &Path, wanted: impl Fn(&fs::DirEntry, &Path) -> bool) -> Result<Vec<PathBuf>, SceneError> {
    let failed = |cause| unreadable(folder, cause);
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let (path, is_hidden) = (entry.path(), entry.file_name().to_string_lossy().starts_with('.'));
        if !is_hidden && wanted(&entry, &path) {
            paths.push(path);
        }
    }
    // Names that are equal as text are not equal as names.
    paths.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()).then_with(|| a.cmp(b)));
    Ok(paths)
}

/// How many photographs lie in a folder, or in `images` in it, or in all folders in it; 0 for what cannot be listed.
pub(super) fn photograph_count(folder: &Path) -> usize {
    let count =
        |folder: &Path| list(folder, |path| has_extension(path, &IMAGE_EXTENSIONS)).map_or(0, |paths| paths.len());
    let below = || folders(folder).unwrap_or_default().iter().map(|inner| count(inner)).sum();
    [count(folder), count(&folder.join("images"))].into_iter().find(|count| *count > 0).unwrap_or_else(below)
}

/// The existing ones of `images` and, by increasing N, `images_N`: photographs at full size and N times smaller.
pub(super) fn image_folders(root: &Path) -> Result<Vec<PathBuf>, SceneError> {
    // The folder of a bare file name is the current one.
    let here = if root.as_os_str().is_empty() { Path::new(".") } else { root };
    let factor = |path: &PathBuf| reduction(&path.file_name().unwrap_or_default().to_string_lossy());
    let mut folders = entries(here, |_, path| path.is_dir())?;
    folders.retain(|path| factor(path).is_some());
    folders.sort_by_key(factor);
    Ok(folders)
}

/// How many times smaller the photographs in a folder `images` or `images_N` are.
pub(super) fn reduction(name: &str) -> Option<u64> {
    match name.strip_prefix("images")? {
        "" => Some(1),
        rest => rest.strip_prefix('_')?.parse().ok(),
    }
}

/// Whether a folder's name is `images` or `images_N`.
pub(super) fn is_images_folder(name: &str) -> bool {
    reduction(name).is_some()
}

/// The number that a name ends in.
pub(crate) fn trailing_number(name: &str) -> Option<u64> {
    name[name.trim_end_matches(|c: char| c.is_ascii_digit()).len()..].parse().ok()
}

/// Whether the file's name ends in one of these extensions, in either case.
pub fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(OsStr::to_str);
    extension.is_some_and(|extension| extensions.iter().any(|wanted| extension.eq_ignore_ascii_case(wanted)))
}

/// The file's name without folder and extension. Bytes that are not UTF-8 are written as `%E9`, so that different names
/// stay different.
pub fn stem(path: &Path) -> String {
    exact(path.file_stem().unwrap_or_default())
}

/// The same of a picture that need not be there: what follows the last dot stays if pictures have no such extension.
pub(crate) fn picture_stem(path: &Path) -> String {
    if has_extension(path, &IMAGE_EXTENSIONS) { stem(path) } else { exact(path.file_name().unwrap_or_default()) }
}

/// A name of the file system as text; bytes that are not UTF-8 are written as `%E9`.
pub(super) fn exact(name: &OsStr) -> String {
    let mut text = String::new();
    for chunk in name.as_encoded_bytes().utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|byte| format!("%{byte:02X}")));
    }
    text
}

/// The path with an extension behind the one it has.
pub(super) fn appended(path: &Path, extension: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(extension);
    name.into()
}

/// The numbers of each line that is not blank, with the line's number from 1; `path` is the text's file.
///
/// # Errors
/// [`FileFault::NotANumber`] or [`FileFault::NotFinite`], with the line.
pub fn number_lines(path: &Path, text: &str) -> Result<Vec<(usize, Vec<f64>)>, SceneError> {
    lines(text)
        .map(|(line, content)| {
            Ok((line, content.split_whitespace().map(|w| number(path, line, w)).collect::<Result<_, _>>()?))
        })
        .collect()
}

/// The lines that are not blank, numbered from 1.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(index, line)| (index + 1, line)).filter(|(_, line)| !line.trim().is_empty())
}

/// A finite number from a word of a line.
pub(crate) fn number(path: &Path, line: usize, word: &str) -> Result<f64, SceneError> {
    let fault = match word.parse::<f64>() {
        Ok(value) if value.is_finite() => return Ok(value),
        Ok(_) => FileFault::NotFinite(excerpt(word)),
        Err(_) => FileFault::NotANumber(excerpt(word)),
    };
    Err(FilePlace::line(path, line).fault(fault))
}

/// The first few characters of a word.
pub(crate) fn excerpt(word: &str) -> String {
    let mut short: String = word.chars().take(MAX_EXCERPT).collect();
    if short.len() < word.len() {
        short.push_str("...");
    }
    short
}

/// Natural order of names: runs of digits are compared by their value, so that `2` comes before `10`; the rest by
/// character. Names that differ only in leading zeros are compared by character, so that the order is total.
pub(crate) fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut rest_a, mut rest_b) = (a, b);
    loop {
        let (digits_a, digits_b) = (leading_digits(rest_a), leading_digits(rest_b));
        if !digits_a.is_empty() && !digits_b.is_empty() {
            let (value_a, value_b) = (digits_a.trim_start_matches('0'), digits_b.trim_start_matches('0'));
            // Without leading zeros a longer number is a larger one; no number of digits overflows.
            let order = value_a.len().cmp(&value_b.len()).then_with(|| value_a.cmp(value_b));
            if order != Ordering::Equal {
                return order;
            }
            (rest_a, rest_b) = (&rest_a[digits_a.len()..], &rest_b[digits_b.len()..]);
            continue;
        }
        let (mut characters_a, mut characters_b) = (rest_a.chars(), rest_b.chars());
        match (characters_a.next(), characters_b.next()) {
            (None, None) => return a.cmp(b),
            (first_a, first_b) if first_a != first_b => return first_a.cmp(&first_b),
            _ => (rest_a, rest_b) = (characters_a.as_str(), characters_b.as_str()),
        }
    }
}

/// The ASCII digits that a text begins with.
fn leading_digits(text: &str) -> &str {
    &text[..text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len())]
}
