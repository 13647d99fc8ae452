//! Many scenes to learn from, in the folders that published training code reads.
//!
//! ```text
//! OUT/cars.json               what everything in OUT was made with
//! OUT/cars_train/000000/      random views of an object
//! OUT/cars_val/000000/        views on the spiral of another one
//! OUT/cars_test/000000/       the same
//! ```
//!
//! No two folders hold the same object: the three sets draw from stretches of indices of their own, so that more
//! objects can be added to one and leave all others as they are.

use crate::scenes::cameras::{random_views, sphere, spiral_views};
use crate::scenes::folder::{self, write_scene};
use crate::scenes::kinds::car;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};
use viewfuse_core::camera::{Camera, PinholeError};
use viewfuse_core::pose::PoseError;
use viewfuse_job::files;
use viewfuse_job::progress::{Interrupted, Progress};

/// What the objects are, as files and folders say it.
const KIND: &str = "cars";

/// Counts up when the same settings come to give other pictures.
const MAKING: u32 = 2;

/// Rays per pixel along each axis: fewer than the sample scene has, for there are many more pictures.
pub const RAYS_PER_SIDE: u32 = 3;

/// Most bytes of the file of settings.
const LONGEST_SETTINGS: u64 = 1 << 20;

/// Most objects in a folder: their names have six digits, and the folders' stretches of indices do not overlap.
pub const MAX_OBJECT_COUNT: u32 = 1_000_000;

/// What decides every picture of a collection, whatever the number of objects.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Name of the kind of objects: cars.
    kind: String,
    /// Seed of every random number.
    pub seed: u64,
    /// Pixels of a picture along each side.
    pub size: u32,
    /// Views of an object to learn from.
    pub views: u32,
    /// Views of an object to validate or test on.
    pub test_views: u32,
    making: u32,
}

/// How many objects each folder gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectCounts {
    /// To learn from.
    pub train: u32,
    /// To watch the learning with.
    pub validation: u32,
    /// To measure the result with.
    pub test: u32,
}

/// What [`make`] found and did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Made {
    /// Scenes that are new.
    pub new_count: usize,
    /// Scenes that were there.
    pub kept_count: usize,
    /// Scenes that an earlier call made beyond the number that this one asks for: they stay.
    pub more_count: usize,
}

/// Why a collection was not made, or not to the end.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    #[error(
        "{}: what is there was made with other settings ({there}; asked for: {wanted}); give the same settings or \
            another folder",
        path.display()
    )]
    OtherSettings { path: PathBuf, there: String, wanted: String },
    #[error("{}: exists, but {} does not, which says what it was made with; give another \
        folder", path.display(), settings.display())]
    NoSettings { path: PathBuf, settings: PathBuf },
    #[error("{}: cannot be read", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{}: not the settings of a collection", path.display())]
    Parse { path: PathBuf, source: serde_json::Error },
    #[error(transparent)]
    Settings(#[from] files::WriteError),
    #[error(transparent)]
    Scene(#[from] folder::WriteError),
    #[error("pictures of {size} x {size} pixels")]
    Size { size: u32, source: PinholeError },
    #[error("a camera is unusable")]
    Camera(#[from] PoseError),
    #[error("a folder holds at most {MAX_OBJECT_COUNT} objects, not {0}")]
    Count(u32),
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

impl Settings {
    /// What decides the pictures of a collection.
    pub fn new(seed: u64, size: u32, views: u32, test_views: u32) -> Settings {
        Settings { kind: KIND.to_owned(), seed, size, views, test_views, making: MAKING }
    }
}

/// A scene to make.
struct Planned {
    folder: PathBuf,
    index: u32,
    on_spiral: bool,
}

/// Makes what is missing of a collection in `out`, on all threads. A scene appears whole or not at all, and what is
/// there is kept: after an interruption the same call goes on.
pub fn make(out: &Path, settings: &Settings, counts: ObjectCounts, progress: &dyn Progress) -> Result<Made, MakeError> {
    let sets = [("train", counts.train, false), ("val", counts.validation, true), ("test", counts.test, true)];
    if let Some((_, count, _)) = sets.iter().find(|(_, count, _)| *count > MAX_OBJECT_COUNT) {
        return Err(MakeError::Count(*count));
    }
    let sphere = sphere(settings.size).map_err(|source| MakeError::Size { size: settings.size, source })?;
    let spiral = spiral_views(&sphere, settings.test_views)?;
    let folders: Vec<PathBuf> = sets.iter().map(|(set, ..)| out.join(format!("{KIND}_{set}"))).collect();
    claim(&out.join(format!("{KIND}.json")), settings, &folders)?;

    let mut missing = Vec::new();
    let mut made = Made::default();
    for (set, (folder, (_, count, on_spiral))) in folders.iter().zip(sets).enumerate() {
        made.more_count += (count..).take_while(|object| folder.join(format!("{object:06}")).is_dir()).count();
        for object in 0..count {
            let folder = folder.join(format!("{object:06}"));
            if folder.is_dir() {
                made.kept_count += 1;
            } else {
                missing.push(Planned { folder, index: set as u32 * MAX_OBJECT_COUNT + object, on_spiral });
            }
        }
    }
    let cameras_of = |scene: &Planned| if scene.on_spiral { spiral.len() } else { settings.views as usize };
    progress.expect(missing.iter().map(cameras_of).sum());
    missing.par_iter().try_for_each(|scene| {
        progress.check()?;
        let object = car(settings.seed, scene.index);
        let random: Vec<Camera>;
        let cameras = if scene.on_spiral {
            &spiral
        } else {
            random = random_views(&sphere, settings.seed, scene.index, settings.views)?;
            &random
        };
        write_scene(&scene.folder, &object, cameras, RAYS_PER_SIDE, progress)?;
        Ok::<(), MakeError>(())
    })?;
    made.new_count = missing.len();
    Ok(made)
}

/// Checks that what is there was made with the same settings, or writes them down first of all.
fn claim(path: &Path, settings: &Settings, folders: &[PathBuf]) -> Result<(), MakeError> {
    let in_words = |settings: &Settings| serde_json::to_string(settings).unwrap_or_default();
    match files::read_at_most(path, LONGEST_SETTINGS) {
        // An empty file is of a machine that lost its power, before the first scene.
        Ok(text) if text.is_empty() && !folders.iter().any(|folder| folder.exists()) => {
            Ok(files::write_whole(path, (in_words(settings) + "\n").as_bytes())?)
        }
        Ok(text) => {
            let there: Settings =
                serde_json::from_slice(&text).map_err(|source| MakeError::Parse { path: path.to_owned(), source })?;
            if there == *settings {
                return Ok(());
            }
            let (there, wanted) = (in_words(&there), in_words(settings));
            Err(MakeError::OtherSettings { path: path.to_owned(), there, wanted })
        }
        Err(source) if source.kind() == io::ErrorKind::NotFound => {
            if let Some(folder) = folders.iter().find(|folder| folder.exists()) {
                return Err(MakeError::NoSettings { path: folder.clone(), settings: path.to_owned() });
            }
            Ok(files::write_whole(path, (in_words(settings) + "\n").as_bytes())?)
        }
        Err(source) => Err(MakeError::Read { path: path.to_owned(), source }),
    }
}
