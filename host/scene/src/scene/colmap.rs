//! COLMAP's sparse models, binary and text: `cameras`, `images` and, if present, `points3D`.
//!
//! A model is searched in `sparse`, `dense/0/sparse`, `dense/sparse`, `colmap/sparse` (in each first among numbered
//! models, `sparse/0`, `sparse/1`, of which the one with most images is read) and in the folder itself, which may be
//! next to the photographs or contain them. Photographs are searched from the model's folder
//! upwards, in `images`, `images_2`, `images_4`, `images_8`, `input`, `image`, `rgb` and in the folder itself; the
//! first folder that has any of them is used. They may be smaller than in the model, by one scale: intrinsics scale
//! with them. Photographs that are missing are left out, with one warning that counts them. Views are in natural order
//! of the names.
//!
//! Image coordinates are as ours, with pixel centres at halves. Poses are world-to-camera in OpenCV axes.

mod binary;
mod text;

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DQuat;

use super::camera_models::{CameraModel, Parameters, camera_model_names};
use super::check;
use super::error::SceneError;
use super::fault::{FaultLocation, FileFault};
use super::files;
use super::missing::Missing;
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPoint, RawPose, RawScene, RawView, Reader};

/// Folders of models, in the order in which they are searched.
const MODEL_FOLDERS: [&str; 4] = ["sparse", "dense/0/sparse", "dense/sparse", "colmap/sparse"];
/// Number of parent folders of the model in which photographs are searched.
const HIGHEST: usize = 4;
/// Range of a quaternion's norm that rounding in a text file can cause.
const UNIT_NORMS: std::ops::RangeInclusive<f64> = 0.99..=1.01;

/// COLMAP: `sparse/0/cameras.bin` or `.txt`, `images/`.
pub(super) struct Colmap;

/// A camera of a model.
#[derive(Clone, Debug)]
struct ModelCamera {
    size: [u32; 2],
    parameters: Parameters,
    place: FaultLocation,
}

/// An image of a model.
#[derive(Clone, Debug)]
struct ModelImage {
    id: u32,
    /// `w x y z` of the rotation from world to camera.
    rotation: [f64; 4],
    translation: [f64; 3],
    camera: u32,
    /// Relative to the folder of photographs.
    name: String,
    place: FaultLocation,
}

/// A point of a model; its views are numbers of images.
#[derive(Clone, Debug)]
struct ModelPoint {
    position: [f64; 3],
    colour: [u8; 3],
    error: f64,
    images: Vec<u32>,
    place: FaultLocation,
}

/// The two forms of a model's files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Binary,
    Text,
}

impl Form {
    fn file(self, folder: &Path, stem: &str) -> PathBuf {
        folder.join(match self {
            Form::Binary => format!("{stem}.bin"),
            Form::Text => format!("{stem}.txt"),
        })
    }

    /// The form of the model in a folder, the binary one if both exist.
    fn of(folder: &Path) -> Option<Form> {
        let is_there = |form: &Form| ["cameras", "images"].iter().all(|stem| form.file(folder, stem).is_file());
        [Form::Binary, Form::Text].into_iter().find(is_there)
    }
}

/// The data of a model used by layouts that were made from it.
pub(super) struct Origin {
    /// World-to-camera matrices of its images, which are in the order of their names by character.
    pub(super) cameras_from_world: Vec<[f64; 16]>,
    /// Its points; their views are indices into these images.
    pub(super) points: Vec<RawPoint>,
    /// The file of the points.
    pub(super) points_path: PathBuf,
}

/// The model in a scene's folder, if there is one.
fn model_in(root: &Path) -> Option<PathBuf> {
    let in_folder = |name: &str| {
        let folder = root.join(name);
        // Of equal ones the first.
        let largest = numbered_models(&folder).into_iter().rev().max_by_key(|model| image_count(model));
        largest.or_else(|| Form::of(&folder).map(|_| folder))
    };
    let itself = || Form::of(root).map(|_| root.to_path_buf());
    MODEL_FOLDERS.into_iter().find_map(in_folder).or_else(itself)
}

/// COLMAP makes a model of each part of the photographs that it cannot join with another: `0`, `1` and so on, ascending.
fn numbered_models(folder: &Path) -> Vec<PathBuf> {
    let is_number = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().parse::<u32>().is_ok());
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut models: Vec<PathBuf> = entries.filter(|path| is_number(path) && Form::of(path).is_some()).collect();
    models.sort_by_key(|path| path.file_name().and_then(|name| name.to_string_lossy().parse::<u32>().ok()));
    models
}

/// How many images a model has; 0 if it cannot be read.
fn image_count(model: &Path) -> u64 {
    let path = |form: Form| form.file(model, "images");
    match Form::of(model) {
        Some(Form::Binary) => binary::image_count(&path(Form::Binary)).unwrap_or_default(),
        Some(Form::Text) => text::images(&path(Form::Text)).map_or(0, |images| images.len() as u64),
        None => 0,
    }
}

/// A warning that names the numbered models beside this one.
fn other_models(model: &Path) -> Option<String> {
    let models = numbered_models(model.parent()?);
    let others = models.iter().filter(|other| *other != model && models.contains(&model.to_path_buf()));
    let others = others.map(|other| format!("{} ({} photographs)", files::stem(other), image_count(other)));
    let list = others.collect::<Vec<_>>().join(", ");
    let (count, model) = (image_count(model), model.display());
    (!list.is_empty()).then(|| {
        format!(
            "{model}: this model has {count} photographs; others beside it are not read, each has coordinates of its own: {list}"
        )
    })
}

/// The model with points in a scene's folder, if there is one.
pub(super) fn beside(root: &Path) -> Result<Option<Origin>, SceneError> {
    let Some(folder) = model_in(root) else { return Ok(None) };
    let Some(form) = Form::of(&folder) else { return Ok(None) };
    let [images_path, points_path] = ["images", "points3D"].map(|stem| form.file(&folder, stem));
    if !points_path.is_file() {
        return Ok(None);
    }
    let (mut images, points) = match form {
        Form::Binary => (binary::images(&images_path)?, binary::points(&points_path)?),
        Form::Text => (text::images(&images_path)?, text::points(&points_path)?),
    };
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let view_of = images.iter().enumerate().map(|(view, image)| (image.id, view as u32)).collect();
    let cameras_from_world = images.iter().map(camera_from_world).collect();
    Ok(Some(Origin { cameras_from_world, points: raw_points(points, &view_of), points_path }))
}

/// Points with their views as [`RawScene`] counts them; images without a view are left out.
fn raw_points(points: Vec<ModelPoint>, view_of: &HashMap<u32, u32>) -> Vec<RawPoint> {
    let raw = |point: ModelPoint| RawPoint {
        position: point.position,
        error: point.error,
        colour: point.colour,
        views: point.images.iter().filter_map(|image| view_of.get(image).copied()).collect(),
        place: point.place,
    };
    points.into_iter().map(raw).collect()
}

impl Reader for Colmap {
    fn name(&self) -> &'static str {
        "colmap"
    }

    fn form(&self) -> &'static str {
        "a folder with sparse/0/cameras.bin and images.bin, or .txt (COLMAP)"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        Ok(model_in(path))
    }

    fn read(&self, folder: &Path) -> Result<RawScene, SceneError> {
        let Some(form) = Form::of(folder) else {
            return Err(SceneError::Missing { path: Form::Binary.file(folder, "cameras") });
        };
        let [cameras_path, images_path, points_path] =
            ["cameras", "images", "points3D"].map(|stem| form.file(folder, stem));
        let (cameras, images) = match form {
            Form::Binary => (binary::cameras(&cameras_path)?, binary::images(&images_path)?),
            Form::Text => (text::cameras(&cameras_path)?, text::images(&images_path)?),
        };
        let points = match form {
            _ if !points_path.is_file() => Vec::new(),
            Form::Binary => binary::points(&points_path)?,
            Form::Text => text::points(&points_path)?,
        };
        let scene = assemble(folder, [&cameras_path, &images_path], &by_id(&cameras_path, cameras)?, images, points)?;
        Ok(RawScene { points_path, ..scene })
    }
}

/// Cameras by their numbers, which must differ.
fn by_id(path: &Path, cameras: Vec<(u32, ModelCamera)>) -> Result<HashMap<u32, ModelCamera>, SceneError> {
    let mut all = HashMap::new();
    for (id, camera) in cameras {
        let place = camera.place.clone();
        if all.insert(id, camera).is_some() {
            let path = path.to_path_buf();
            return Err(SceneError::Damaged {
                path,
                place,
                fault: FileFault::DuplicateId { of: "cameras", id: id.into() },
            });
        }
    }
    Ok(all)
}

fn assemble(
    folder: &Path,
    [cameras_path, images_path]: [&Path; 2],
    cameras: &HashMap<u32, ModelCamera>,
    mut images: Vec<ModelImage>,
    points: Vec<ModelPoint>,
) -> Result<RawScene, SceneError> {
    if images.is_empty() {
        return Err(SceneError::NoViews { path: images_path.to_path_buf(), looked_for: "images of a COLMAP model" });
    }
    images.sort_by(|a, b| files::natural_order(&a.name, &b.name));
    let photographs = photograph_folder(folder, &images);
    let mut missing = Missing::default();
    let mut views: Vec<RawView> = Vec::new();
    let mut view_of: HashMap<u32, u32> = HashMap::new();
    for image in &images {
        let Some(camera) = cameras.get(&image.camera) else {
            let (path, place) = (images_path.to_path_buf(), image.place.clone());
            return Err(SceneError::Damaged {
                path,
                place,
                fault: FileFault::NoSuchId { of: "camera", id: image.camera.into() },
            });
        };
        let Some(photograph) = present(&photographs, &image.name) else {
            missing.missed(image.place.clone(), photographs.join(&image.name));
            continue;
        };
        missing.found();
        let intrinsics = RawIntrinsics {
            focal: camera.parameters.focal,
            principal: camera.parameters.principal,
            size: Some(camera.size),
            lens: camera.parameters.lens,
            path: cameras_path.to_path_buf(),
            place: camera.place.clone(),
            size_place: camera.place.clone(),
        };
        let pose = RawPose {
            matrix: camera_from_world(image),
            form: PoseForm::OpenCvFromWorld,
            path: images_path.to_path_buf(),
            place: image.place.clone(),
        };
        if view_of.insert(image.id, views.len() as u32).is_some() {
            let (path, place) = (images_path.to_path_buf(), image.place.clone());
            return Err(SceneError::Damaged {
                path,
                place,
                fault: FileFault::DuplicateId { of: "images", id: image.id.into() },
            });
        }
        let name = files::stem(&photograph);
        views.push(RawView::new(name, Some(ImageFile::open(&photograph)?), pose, Some(intrinsics)));
    }
    let points = raw_points(points, &view_of);
    let warnings = missing.warning(images_path)?.into_iter().chain(other_models(folder)).collect();
    Ok(RawScene { views, points, warnings, ..RawScene::default() })
}

/// The folder that has the photographs: the first, from the model's upwards, that has any of them.
fn photograph_folder(model: &Path, images: &[ModelImage]) -> PathBuf {
    let above = |levels: usize| model.ancestors().nth(levels).map(Path::to_path_buf);
    for level in (0..=HIGHEST).filter_map(above) {
        for folder in files::IMAGE_FOLDERS.iter().map(|name| level.join(name)).chain([level.clone()]) {
            if folder.is_dir() && images.iter().any(|image| present(&folder, &image.name).is_some()) {
                return folder;
            }
        }
    }
    // The most common place, for the message.
    let root = model.ancestors().find(|folder| folder.join("images").is_dir());
    root.unwrap_or(model).join("images")
}

/// The photograph with this name, which may be one of another system. Its extension may have changed when it was
/// downscaled.
fn present(folder: &Path, name: &str) -> Option<PathBuf> {
    let joined = |name: &str| folder.join(name).components().collect::<PathBuf>();
    let path = joined(name);
    if path.is_file() {
        return Some(path);
    }
    let path = joined(&name.replace('\\', "/"));
    if path.is_file() {
        return Some(path);
    }
    files::IMAGE_EXTENSIONS.iter().map(|extension| path.with_extension(extension)).find(|path| path.is_file())
}

/// `[R | t]` of an image. A quaternion whose length differs from 1 by more than rounding gives a matrix that is not
/// rigid.
fn camera_from_world(image: &ModelImage) -> [f64; 16] {
    let [w, x, y, z] = image.rotation;
    let [a, b, c] = image.translation;
    let given = DQuat::from_xyzw(x, y, z, w);
    let norm = given.length();
    let unit = if UNIT_NORMS.contains(&norm) { given.normalize() } else { given };
    let (w, x, y, z) = (unit.w, unit.x, unit.y, unit.z);
    [
        w * w + x * x - y * y - z * z,
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        a,
        2.0 * (x * y + w * z),
        w * w - x * x + y * y - z * z,
        2.0 * (y * z - w * x),
        b,
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        w * w - x * x - y * y + z * z,
        c,
        0.0,
        0.0,
        0.0,
        1.0,
    ]
}

/// A camera from its model's name or number, its size and its parameters.
fn camera(
    path: &Path,
    place: FaultLocation,
    model: Result<CameraModel, String>,
    size: [f64; 2],
    parameters: &[f64],
) -> Result<ModelCamera, SceneError> {
    let model = known(path, &place, model)?;
    let expected = model.parameter_count();
    if parameters.len() != expected {
        let (path, found) = (path.to_path_buf(), parameters.len());
        return Err(SceneError::WrongCount { path, place, of: "parameters of the camera model", expected, found });
    }
    let size = check::size(path, place.clone(), size[0], size[1])?;
    let parameters = model.interpret(parameters).map_err(|reason| SceneError::Lens {
        path: path.to_path_buf(),
        place: place.clone(),
        reason,
    })?;
    Ok(ModelCamera { size, parameters, place })
}

/// The model, if it is supported.
fn known(path: &Path, place: &FaultLocation, model: Result<CameraModel, String>) -> Result<CameraModel, SceneError> {
    model.map_err(|model| SceneError::CameraModel {
        path: path.to_path_buf(),
        place: place.clone(),
        model,
        supported: camera_model_names(),
    })
}
