//! Data sets: many scenes of one kind, in folders for training, validation and test.
//!
//! The searched places, for the training split of `data/cars` (the others end in `_val` and `_test`):
//!
//! ```text
//! data/cars_train/<object>/                    the path names the data set, as in the code that PixelNeRF was published with
//! data/cars/cars_train/<object>/               the path is a folder around it
//! .../chairs_train/chairs_2.0_train/<object>/  one folder more, as in the archive of the chairs
//! data/cars/<object>/                          a folder of scenes, which is then used for every split; not one whose
//!                                              name says that it is another split
//! ```
//!
//! An object is a folder in SRN's layout: one that holds `intrinsics.txt`. Nothing else is read here; a scene is
//! checked when it is opened ([`crate::Scene::open`]).

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

pub use crate::scene::Split;

/// The scenes of one split.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dataset {
    /// Its name: `cars` for `cars_train/`, otherwise the folder's name.
    pub name: String,
    /// The folders of the objects, sorted by name; at least one.
    pub scenes: Vec<PathBuf>,
}

/// Why a data set was not found.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// No data set of a split was found at the path, which would abbreviate the folder.
    #[error(
        "{0}: no data set: looked for a folder {2}, for one folder *_{1} inside, and for folders with intrinsics.txt \
            inside"
    )]
    NotFound(PathBuf, Split, PathBuf),
    /// There is more than one data set: the folders found.
    #[error("{}: holds several data sets ({}); name one of them", .0.display(), .1.join(", "))]
    Several(PathBuf, Vec<String>),
    /// The path is the folder of another split: that split's ending.
    #[error("{}: is the folder of the {} split by its name; for the {} split name the data set, {}",
        .0.display(), .2, .1, stem(.0, .2).display())]
    OtherSplit(PathBuf, Split, Split),
    /// The folder of the split exists, but holds no scene.
    #[error("{}: no scenes: looked for folders with intrinsics.txt inside", .0.display())]
    NoScenes(PathBuf),
    /// The file system reported an error for a folder.
    #[error("{}: cannot be read", .0.display())]
    Io(PathBuf, #[source] io::Error),
}

impl Dataset {
    /// Finds the scenes of a split. The first existing place of [the list above](self) is used.
    ///
    /// # Errors
    /// [`DatasetError`] with the path and the searched places.
    pub fn open(path: impl AsRef<Path>, split: Split) -> Result<Dataset, DatasetError> {
        let path = path.as_ref();
        let ending = format!("_{split}");
        let mut beside = path.components().as_path().as_os_str().to_owned();
        beside.push(&ending);
        let beside = PathBuf::from(beside);
        if beside.is_dir() {
            return Ok(Dataset { name: name_of(path), scenes: scenes_of_split(&beside, &ending)? });
        }
        let not_found = || DatasetError::NotFound(path.to_owned(), split, beside.clone());
        if !path.is_dir() {
            return Err(not_found());
        }
        let inside = folders(path)?;
        let of_split: Vec<&PathBuf> = inside.iter().filter(|folder| name_of(folder).ends_with(&ending)).collect();
        match of_split[..] {
            [] => {}
            // A folder that holds scenes is not a data set's folder, whatever the names of its scenes.
            _ if inside.iter().any(|folder| is_scene(folder)) => {}
            [folder] => {
                let name = name_of(folder).trim_end_matches(&ending).to_owned();
                return Ok(Dataset { name, scenes: scenes_of_split(folder, &ending)? });
            }
            _ => {
                let names = of_split.iter().map(|folder| name_of(folder)).collect();
                return Err(DatasetError::Several(path.to_owned(), names));
            }
        }
        let scenes: Vec<PathBuf> = inside.into_iter().filter(|folder| is_scene(folder)).collect();
        let is_of = |other: &Split| name_of(path).ends_with(&format!("_{other}"));
        if let Some(other) = Split::ALL.into_iter().find(|other| *other != split && is_of(other)) {
            return Err(DatasetError::OtherSplit(path.to_owned(), split, other));
        }
        if scenes.is_empty() { Err(not_found()) } else { Ok(Dataset { name: name_of(path), scenes }) }
    }
}

/// The scenes in a split's folder, or in the one folder inside that ends as it does.
fn scenes_of_split(folder: &Path, ending: &str) -> Result<Vec<PathBuf>, DatasetError> {
    let inside = folders(folder)?;
    let (scenes, others): (Vec<PathBuf>, Vec<PathBuf>) = inside.into_iter().partition(|folder| is_scene(folder));
    if !scenes.is_empty() {
        return Ok(scenes);
    }
    let extra = others.into_iter().find(|folder| name_of(folder).ends_with(ending));
    let deeper = extra.map_or(Ok(Vec::new()), |extra| folders(&extra))?;
    let scenes: Vec<PathBuf> = deeper.into_iter().filter(|folder| is_scene(folder)).collect();
    if scenes.is_empty() { Err(DatasetError::NoScenes(folder.to_owned())) } else { Ok(scenes) }
}

/// The data set of a split's folder.
fn stem(folder: &Path, split: &Split) -> PathBuf {
    let name = name_of(folder);
    folder.with_file_name(name.strip_suffix(&format!("_{split}")).unwrap_or(&name))
}

fn is_scene(folder: &Path) -> bool {
    folder.join("intrinsics.txt").is_file()
}

/// The folders in a folder, sorted by name, without hidden ones, which may be unfinished.
fn folders(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let failed = |cause| DatasetError::Io(folder.to_owned(), cause);
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() && !name_of(&path).starts_with('.') {
            all.push(path);
        }
    }
    all.sort();
    Ok(all)
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or(OsStr::new("")).to_string_lossy().into_owned()
}
