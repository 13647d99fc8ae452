//! Camera paths: cameras without photographs, read from files or generated from the cameras of a scene.
//!
//! ```text
//! arc         the part of a circle on which there are photographs
//! generated   an orbit, the way between two cameras, a spiral
//! nerfstudio  camera_path.json of nerfstudio's viewer
//! transforms  transforms.json, of which only the poses are read
//! csv         a table of poses
//! ```
//!
//! A file's poses are in the coordinates of the scene's own files, and are moved and scaled with them
//! ([`crate::SceneFrame`]).

pub mod arc;
mod csv;
pub mod generated;
mod nerfstudio;
mod transforms;

use std::collections::HashSet;
use std::path::Path;

use serde_json::Value;
use viewfuse_core::camera::{Camera, Pinhole};

use crate::Scene;
use crate::scene::check::{camera_in, is_name};
use crate::scene::files::{has_extension, read_text};
use crate::scene::json::{self, Object};
use crate::scene::reader::RawView;
use crate::scene::{FilePlace, SceneError, SceneFault, files};

/// What files of camera paths look like, for help texts and messages.
pub const FORMS: &str =
    "nerfstudio's camera_path.json; a transforms.json, of which only the poses are read; a .csv of poses";

/// A camera of a path.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// Its name, for files and tables: not empty, without a path separator.
    pub name: String,
    /// The camera.
    pub camera: Camera,
}

/// Cameras along a path, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// At least one; their names differ.
    pub cameras: Vec<NamedCamera>,
    /// Frames per second, if the file states them; finite and above 0.
    pub frames_per_second: Option<f64>,
    /// What makes it doubtful that its cameras are in the coordinates of the scene's files.
    pub warning: Option<String>,
}

/// What a file of a path holds, unchecked.
#[derive(Debug, Default)]
struct RawPath {
    /// An empty name stands for none.
    views: Vec<RawView>,
    frames_per_second: Option<f64>,
    warning: Option<String>,
}

impl CameraPath {
    /// Reads a path for a scene. `pinhole` is that of cameras for which the file states none.
    ///
    /// Cameras without a name, and all of them if two names are equal, are called `path-000`, `path-001` and so on.
    ///
    /// # Errors
    /// [`SceneError`] with the path, and the line or key, of the first thing that is missing or wrong.
    pub fn open(path: &Path, scene: &Scene, pinhole: &Pinhole) -> Result<CameraPath, SceneError> {
        let unknown = || FilePlace::file(path).fault(SceneFault::UnknownCameraPath(FORMS));
        if path.is_dir() {
            return Err(unknown());
        }
        let text = read_text(path)?;
        let raw = if has_extension(path, &["csv"]) {
            csv::read(path, &text, scene)?
        } else if has_extension(path, &["json"]) {
            let value: Value = json::parse(path, &text)?;
            let top = Object::new(path, "", &value)?;
            if top.get(nerfstudio::KEY).is_some() {
                nerfstudio::read(path, &top, scene)?
            } else if top.get(transforms::KEY).is_some() {
                transforms::read(path, &top, pinhole)?
            } else {
                return Err(unknown());
            }
        } else {
            return Err(unknown());
        };
        let RawPath { views, frames_per_second, warning } = raw;
        if views.is_empty() {
            return Err(FilePlace::file(path).fault(SceneFault::NoCameras));
        }
        let cameras = views.iter().map(|view| camera_in(view, pinhole, &scene.frame)).collect::<Result<Vec<_>, _>>()?;
        let names = names(path, views)?;
        let cameras = names.into_iter().zip(cameras).map(|(name, camera)| NamedCamera { name, camera }).collect();
        Ok(CameraPath { cameras, frames_per_second, warning })
    }
}

/// The names of a path's cameras, made up where they are missing or equal.
fn names(path: &Path, views: Vec<RawView>) -> Result<Vec<String>, SceneError> {
    if let Some(view) = views.iter().find(|view| !view.name.is_empty() && !is_name(&view.name)) {
        return Err(FilePlace::file(path).fault(SceneFault::Name(view.name.clone())));
    }
    let differ = views.iter().map(|view| view.name.as_str()).collect::<HashSet<_>>().len() == views.len();
    let name = |(index, view): (usize, RawView)| {
        if differ && !view.name.is_empty() { view.name } else { numbered("path", index) }
    };
    Ok(views.into_iter().enumerate().map(name).collect())
}

/// `orbit-007`.
pub(crate) fn numbered(what: &str, index: usize) -> String {
    format!("{what}-{index:03}")
}

/// A name from the file that a view would have: without its folder, and without the extension of a picture.
fn stem_of(file: &str) -> String {
    files::picture_stem(Path::new(&file.replace('\\', "/")))
}
