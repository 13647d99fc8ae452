//! Pictures of held-out sources that were rendered before: none is rendered twice. Where the field has a folder they
//! are kept in it, and a second choice for the same sources under the same options renders none of them again.
//!
//! A file's name is the SHA-256 of all that its pictures depend on but scheme and settings, which are in each picture's
//! own name: another scene, size, option, device or version finds nothing, and makes a file of its own. A file that is
//! damaged or was kept under another name is not used, and a warning says so. What is chosen follows from the pictures
//! as if they had been rendered.

use crate::{AnyOptions, Rendered};
use bytemuck::{cast_slice, pod_collect_to_vec};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use viewfuse_job::digest::{sealed, sha256, unsealed};
use viewfuse_job::files::{is_ordinary, read_at_most, write_whole};
use viewfuse_job::progress::Progress;

/// Of the form of the files.
const FORM: u32 = 1;
/// Most bytes of a file: some hundred pictures of 96 pixels on a side.
const MAX_BYTES: u64 = 256 << 20;
/// Characters of a name.
const NAME: usize = 64;

/// The pictures, by their names.
#[derive(Default)]
pub(super) struct Kept {
    /// The file with its name's digest; none without a folder.
    file: Option<(PathBuf, String)>,
    pictures: BTreeMap<String, Rendered>,
    /// Whether some are not in the file.
    is_new: bool,
}

impl Kept {
    /// Those in a folder that depend on this.
    pub(super) fn open(folder: &Path, depends_on: &[u8], progress: &dyn Progress) -> Kept {
        let version = format!("{} {FORM} held-out pictures ", env!("CARGO_PKG_VERSION"));
        let name = sha256(&[version.as_bytes(), depends_on].concat());
        let path = folder.join(format!("{name}.kept"));
        let read = || {
            is_ordinary(&path).ok()?;
            let bytes = read_at_most(&path, MAX_BYTES).ok()?;
            pictures_of(unsealed(&name, &bytes)?)
        };
        let is_missing = is_ordinary(&path).is_ok_and(|is_there| !is_there);
        let pictures = if is_missing { Some(BTreeMap::new()) } else { read() };
        if pictures.is_none() {
            let folder = folder.display();
            progress.warn(&format!("{folder}: holds pictures that are not as they were kept; they are rendered anew"));
        }
        Kept { pictures: pictures.unwrap_or_default(), file: Some((path, name)), is_new: false }
    }

    /// The name of a held-out source's picture: all that it depends on beside what the file does.
    pub(super) fn name(source: usize, weighting: &impl ToString, options: &AnyOptions) -> String {
        sha256(format!("{source} {} {}", weighting.to_string(), options.in_full()).as_bytes())
    }

    /// The picture of this name.
    pub(super) fn picture(&self, name: &str) -> Option<&Rendered> {
        self.pictures.get(name)
    }

    /// Adds a picture.
    pub(super) fn add(&mut self, name: String, picture: Rendered) {
        self.pictures.insert(name, picture);
        self.is_new = true;
    }

    /// Writes the file, if there is one and there are new pictures. That it cannot be written costs the next run its
    /// time, and is a warning.
    pub(super) fn write(&mut self, progress: &dyn Progress) {
        let is_new = std::mem::take(&mut self.is_new);
        let Some((path, digest)) = self.file.as_ref().filter(|_| is_new) else { return };
        let bytes: Vec<u8> = self.pictures.iter().flat_map(|(name, picture)| bytes_of(name, picture)).collect();
        if let Err(error) = write_whole(path, &sealed(digest, &bytes)) {
            progress.warn(&format!("what was chosen for the scene is not kept: {error}"));
        }
    }
}

/// Name, width, height, the numbers of depths and confidences, colours, depths, confidences.
fn bytes_of(name: &str, picture: &Rendered) -> Vec<u8> {
    let Rendered { colours, depths, confidences, width, height } = picture;
    let sizes = [*width, *height, depths.len() as u32, confidences.len() as u32].map(u32::to_le_bytes);
    let values = [cast_slice(colours), cast_slice::<f32, u8>(depths), cast_slice(confidences)];
    [name.as_bytes(), sizes.as_flattened(), &values.concat()].concat()
}

/// All pictures of a file; `None` if it does not hold whole ones of finite numbers.
fn pictures_of(mut bytes: &[u8]) -> Option<BTreeMap<String, Rendered>> {
    let mut take = |count: usize| -> Option<&[u8]> {
        let (taken, rest) = bytes.split_at_checked(count)?;
        bytes = rest;
        Some(taken)
    };
    let mut pictures = BTreeMap::new();
    while let Some(name) = take(NAME) {
        let sizes: Vec<u32> = pod_collect_to_vec(take(4 * size_of::<u32>())?);
        let &[width, height, depths, confidences] = &sizes[..] else { return None };
        let count = (width as usize).checked_mul(height as usize)?;
        let colours: Vec<[f32; 4]> = pod_collect_to_vec(take(count.checked_mul(size_of::<[f32; 4]>())?)?);
        let mut numbers = |count: u32| -> Option<Vec<f32>> {
            Some(pod_collect_to_vec(take((count as usize).checked_mul(size_of::<f32>())?)?))
        };
        let (depths, confidences) = (numbers(depths)?, numbers(confidences)?);
        let mut all = colours.as_flattened().iter().chain(&depths).chain(&confidences);
        if !all.all(|number| number.is_finite()) {
            return None;
        }
        let picture = Rendered { colours, depths, confidences, width, height };
        pictures.insert(String::from_utf8(name.to_vec()).ok()?, picture);
    }
    bytes.is_empty().then_some(pictures)
}
