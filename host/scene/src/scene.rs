//! Scenes: posed photographs on disk.
//!
//! [`Scene::open`] recognises the layout of a folder, reads every pose and every image *header* and checks them all:
//! counts, finite and rigid poses, sizes. The pixels of a view are read when they are first needed
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
mod srn;
mod transforms;

pub use error::SceneError;
pub use fault::{IntrinsicsFault, Place};

/// Most pixels that an image may have on a side: a larger header is refused before anything is allocated.
pub const LARGEST_SIDE: u32 = 16_384;

/// How a scene is laid out on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// ShapeNet scenes of Scene Representation Networks: `rgb/`, `pose/`, `intrinsics.txt`, and `target_pose/`.
    Srn,
    /// NeRF's `transforms.json` (Blender, instant-ngp, nerfstudio).
    Transforms,
    /// Middlebury multi-view stereo: `*_par.txt` beside the images.
    Middlebury,
}

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
    /// How it is laid out.
    pub layout: Layout,
    /// Views with photographs first (at least one), then target poses without. In the order of the list where the
    /// layout has one, otherwise in natural order of the names (`2` before `10`).
    pub views: Vec<View>,
}

impl Scene {
    /// Opens a scene: recognises its layout, reads every pose and every image header, and checks them.
    ///
    /// A folder is taken for the first of these that fits: `transforms.json` or, without one,
    /// `transforms_train.json`; one `*_par.txt`; `rgb/` or `pose/` (SRN). A file must be a `.json` or a `*_par.txt`.
    ///
    /// # Errors
    /// [`SceneError`] with the path, and the line or key, of the first thing that is missing or wrong.
    pub fn open(path: impl AsRef<Path>) -> Result<Scene, SceneError> {
        let path = path.as_ref();
        let (layout, file) = recognise(path)?;
        let mut views = match layout {
            Layout::Srn => srn::read(&file),
            Layout::Transforms => transforms::read(&file),
            Layout::Middlebury => middlebury::read(&file),
        }?;
        distinguish(&mut views);
        let mut names = HashSet::new();
        for view in &views {
            if !names.insert(view.name.as_str()) {
                let path = view.image.clone().unwrap_or(file);
                return Err(SceneError::DuplicateName { path, name: view.name.clone() });
            }
        }
        Ok(Scene { path: path.to_path_buf(), layout, views })
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

/// The layout of what is at a path, and the folder or file that its reader takes.
fn recognise(path: &Path) -> Result<(Layout, PathBuf), SceneError> {
    let is_list = |path: &Path| path.to_string_lossy().ends_with(middlebury::SUFFIX);
    let unknown = || SceneError::UnknownLayout { path: path.to_path_buf() };
    if !fs::metadata(path).map_err(|cause| files::unreadable(path, cause))?.is_dir() {
        return if files::has_extension(path, &["json"]) {
            Ok((Layout::Transforms, path.to_path_buf()))
        } else if is_list(path) {
            Ok((Layout::Middlebury, path.to_path_buf()))
        } else {
            Err(unknown())
        };
    }
    if let Some(file) = transforms::FILE_NAMES.iter().map(|name| path.join(name)).find(|file| file.is_file()) {
        return Ok((Layout::Transforms, file));
    }
    match files::list(path, is_list)?.as_slice() {
        [] => {}
        [list] => return Ok((Layout::Middlebury, list.clone())),
        [first, second, ..] => {
            let name = |list: &Path| list.file_name().unwrap_or_default().to_string_lossy().into_owned();
            return Err(SceneError::Ambiguous { path: path.to_path_buf(), first: name(first), second: name(second) });
        }
    }
    // One of the two folders is enough, so that a scene with the other one missing is told which.
    if path.join("rgb").is_dir() || path.join("pose").is_dir() {
        return Ok((Layout::Srn, path.to_path_buf()));
    }
    Err(unknown())
}

/// The digits that a name ends in, without leading zeros (empty for zero itself); `None` if it ends in no digit.
fn trailing_number(name: &str) -> Option<&str> {
    let digits = &name[name.trim_end_matches(|c: char| c.is_ascii_digit()).len()..];
    if digits.is_empty() { None } else { Some(digits.trim_start_matches('0')) }
}
