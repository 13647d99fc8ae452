//! Scenes: posed photographs on disk.
//!
//! [`Scene::open`] asks each reader of a layout whether a folder is its own, reads every pose and every image *header* and
//! checks them all: counts, finite and rigid poses, sizes. The pixels of a view are read when they are first needed
//! ([`Scene::photograph`]), so that a command that needs only poses touches no image.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use viewfuse_core::camera::Camera;

mod check;
mod error;
mod fault;
mod files;
mod images;
mod json;
mod middlebury;
pub mod reader;
mod srn;
mod transforms;

pub use error::SceneError;
pub use fault::{IntrinsicsFault, Place};
use reader::Reader;

/// The readers of all layouts, in the order in which they are asked: a path is taken for the first that fits.
pub const READERS: [&dyn Reader; 3] = [&transforms::Transforms, &middlebury::Middlebury, &srn::Srn];

/// What readers look for, for help texts and messages.
pub fn looked_for(readers: &[&dyn Reader]) -> String {
    readers.iter().map(|reader| reader.form()).collect::<Vec<_>>().join("; ")
}

/// Most pixels that an image may have on a side: a larger header is refused before anything is allocated.
pub const LARGEST_SIDE: u32 = 16_384;

/// One camera of a scene, with the photograph it took if there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// What people call it: the stem of the photograph's file; `target_1` for `target_pose/1.txt` of an SRN folder.
    /// No two views of a scene have the same, and none holds a separator of folders.
    pub name: String,
    /// Where the camera was and how it maps the world to its image.
    pub camera: Camera,
    /// The photograph; `None` for a target pose without one.
    pub image: Option<PathBuf>,
}

/// A photograph in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// Straight (not premultiplied) 8-bit RGBA.
    pub pixels: image::RgbaImage,
    /// Whether any pixel is not opaque; if not, the background must be told from the colours.
    pub has_alpha: bool,
}

/// A scene whose poses and image headers have been read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The folder or file it was opened from.
    pub path: PathBuf,
    /// How it is laid out: the name of the reader that fitted.
    pub layout: &'static str,
    /// Views with photographs first (at least one), then target poses without. In the order of the list where the
    /// layout has one, otherwise in natural order of the names (`2` before `10`).
    pub views: Vec<View>,
}

impl Scene {
    /// Opens a scene by the first of [`READERS`] that fits, and checks it.
    ///
    /// # Errors
    /// As [`Scene::open_with`].
    pub fn open(path: impl AsRef<Path>) -> Result<Scene, SceneError> {
        Scene::open_with(path, &READERS)
    }

    /// Opens a scene by the first of these readers that fits: reads every pose and every image header, and checks them.
    /// A crate outside puts its own readers before or behind [`READERS`].
    ///
    /// # Errors
    /// [`SceneError`] with the path, and the line or key, of the first thing that is missing or wrong.
    pub fn open_with(path: impl AsRef<Path>, readers: &[&dyn Reader]) -> Result<Scene, SceneError> {
        let path = path.as_ref();
        fs::metadata(path).map_err(|cause| files::unreadable(path, cause))?;
        for reader in readers {
            let Some(found) = reader.recognise(path)? else { continue };
            let mut views = check::views(&found, reader.form(), reader.read(&found)?)?;
            distinguish(&mut views);
            let mut names = HashSet::new();
            for view in &views {
                if !names.insert(view.name.as_str()) {
                    let path = view.image.clone().unwrap_or(found);
                    return Err(SceneError::DuplicateName { path, name: view.name.clone() });
                }
            }
            return Ok(Scene { path: path.to_path_buf(), layout: reader.name(), views });
        }
        Err(SceneError::UnknownLayout { path: path.to_path_buf(), looked_for: looked_for(readers) })
    }

    /// What people call it: the name of its folder, however the path was written.
    pub fn name(&self) -> String {
        let whole = fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone());
        let folder = if whole.is_file() { whole.parent().map(Path::to_path_buf) } else { Some(whole) };
        let name = folder.as_deref().and_then(Path::file_name);
        name.map_or_else(|| self.path.display().to_string(), |name| name.to_string_lossy().into_owned())
    }

    /// Decodes the photograph of the view with this index. An orientation tag in the file is not applied: the pose is
    /// that of the pixels as they are stored.
    ///
    /// # Errors
    /// [`SceneError`] if there is no such view, if it has no photograph, if the file cannot be decoded, or if its size
    /// is no longer what it was when the scene was opened.
    pub fn photograph(&self, view: usize) -> Result<Photograph, SceneError> {
        let Some(View { name, camera, image }) = self.views.get(view) else {
            let (path, view_count) = (self.path.clone(), self.views.len());
            return Err(SceneError::NoSuchView { path, view, view_count });
        };
        let Some(path) = image else {
            return Err(SceneError::NoPhotograph { path: self.path.clone(), name: name.clone() });
        };
        let photograph = images::decode(path)?;
        let (width, height) = photograph.pixels.dimensions();
        let (declared_width, declared_height) = (camera.pinhole.width(), camera.pinhole.height());
        if (width, height) != (declared_width, declared_height) {
            let declared_in = "the scene as it was opened".to_string();
            let path = path.clone();
            return Err(SceneError::SizeMismatch { path, width, height, declared_in, declared_width, declared_height });
        }
        Ok(photograph)
    }

    /// The index of the view that a person means by `text`: the view of exactly this name; otherwise, if `text` is a
    /// whole number, the one view whose name ends in that number, leading zeros aside.
    ///
    /// `1` finds `dinoSR0001`, `3` finds `000003`, also where the count starts at 0. It never is a position in
    /// [`Scene::views`]: some data sets count from 1 and some from 0. Of a photograph and a target pose of the same
    /// number the photograph is meant. `None` if no view fits or, by number, several do.
    pub fn view_named(&self, text: &str) -> Option<usize> {
        if let Some(view) = self.views.iter().position(|view| view.name == text) {
            return Some(view);
        }
        let wanted = trailing_number(text).filter(|_| text.bytes().all(|byte| byte.is_ascii_digit()))?;
        let fitting = |has_image: bool| {
            let fits =
                move |view: &View| view.image.is_some() == has_image && trailing_number(&view.name) == Some(wanted);
            let mut found = self.views.iter().enumerate().filter(move |(_, view)| fits(view)).map(|(index, _)| index);
            (found.next(), found.next())
        };
        match (fitting(true), fitting(false)) {
            ((Some(view), None), _) | ((None, _), (Some(view), None)) => Some(view),
            _ => None,
        }
    }
}

/// Views of several cameras are often numbered alike in a folder each: those get the folder's name in front of theirs.
fn distinguish(views: &mut [View]) {
    let folder_of = |view: &View| view.image.as_deref().and_then(Path::parent).map(Path::to_path_buf);
    let mut folders: HashMap<String, Vec<PathBuf>> = HashMap::new();
    for view in views.iter() {
        folders.entry(view.name.clone()).or_default().extend(folder_of(view));
    }
    for view in views.iter_mut() {
        let all = &folders[&view.name];
        let differ = all.iter().collect::<HashSet<_>>().len() == all.len();
        if let Some(folder) = folder_of(view).as_deref().and_then(Path::file_name).filter(|_| all.len() > 1 && differ) {
            view.name = format!("{}_{}", folder.to_string_lossy(), view.name);
        }
    }
}

/// The digits that a name ends in, without leading zeros (empty for zero itself); `None` if it ends in no digit.
fn trailing_number(name: &str) -> Option<&str> {
    let digits = &name[name.trim_end_matches(|c: char| c.is_ascii_digit()).len()..];
    if digits.is_empty() { None } else { Some(digits.trim_start_matches('0')) }
}
