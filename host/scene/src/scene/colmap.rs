//! COLMAP's sparse models, binary and text: `cameras`, `images` and, if present, `points3D`.
//!
//! A model is searched in `sparse`, `dense/0/sparse`, `dense/sparse`, `colmap/sparse` (in each first among numbered
//! models, `sparse/0`, `sparse/1`, of which the one with most images is read) and in the folder itself, which may be
//! next to the photographs or contain them. Photographs are searched from the model's folder
//! upwards, in `images`, `images_2`, `images_4`, `images_8`, `input`, `image`, `rgb` and in the folder itself; the
//! first folder that has any of them is used. They may be smaller than in the model, by one scale: intrinsics scale
//! with them. Photographs that are missing are skipped, with one warning that counts them. Views are in natural order
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
use super::error::{SceneError, SceneFault};
use super::fault::{FaultLocation, FileFault, FilePlace, IntrinsicsFault};
use super::files;
use super::missing::Missing;
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPoint, RawPose, RawScene, RawView, Reader};

/// Folders of models, in the order in which they are searched.
const MODEL_FOLDERS: [&str; 4] = ["sparse", "dense/0/sparse", "dense/sparse", "colmap/sparse"];
/// Number of parent folders of the model in which photographs are searched.
const MAX_LEVELS: usize = 4;
/// Range of a quaternion's norm that rounding in a text file can cause.
const UNIT_NORMS: std::ops::RangeInclusive<f64> = 0.99..=1.01;

/// COLMAP: `sparse/0/cameras.bin` or `.txt`, `images/`.
pub(super) struct Colmap;

#[derive(Clone, Debug)]
struct ModelCamera {
    size: [u32; 2],
    parameters: Parameters,
    place: FilePlace,
}

#[derive(Clone, Debug)]
struct ModelImage {
    id: u32,
    /// `w x y z` of the rotation from world to camera.
    rotation: [f64; 4],
    translation: [f64; 3],
    camera: u32,
    /// Relative to the folder of photographs.
    name: String,
    place: FilePlace,
}

/// A point of a model; its views are numbers of images.
#[derive(Clone, Debug)]
struct ModelPoint {
    position: [f64; 3],
    colour: [u8; 3],
    error: f64,
    images: Vec<u32>,
    location: FaultLocation,
}

/// The form of a model's files: the ending of their names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Binary,
    Text,
}

/// A model in a folder.
struct Model {
    folder: PathBuf,
    form: Form,
}

impl Model {
    /// The model in a folder, the binary one if both exist.
    fn of(folder: &Path) -> Option<Model> {
        let models = [Form::Binary, Form::Text].map(|form| Model { folder: folder.to_path_buf(), form });
        let is_there = |model: &Model| ["cameras", "images"].iter().all(|stem| model.file(stem).is_file());
        models.into_iter().find(is_there)
    }

    fn file(&self, stem: &str) -> PathBuf {
        self.folder.join(match self.form {
            Form::Binary => format!("{stem}.bin"),
            Form::Text => format!("{stem}.txt"),
        })
    }

    /// Cameras by their numbers, which must differ.
    fn cameras(&self) -> Result<HashMap<u32, ModelCamera>, SceneError> {
        let path = self.file("cameras");
        let cameras = match self.form {
            Form::Binary => binary::cameras(&path)?,
            Form::Text => text::cameras(&path)?,
        };
        let mut all = HashMap::new();
        for (id, camera) in cameras {
            let place = camera.place.clone();
            if all.insert(id, camera).is_some() {
                return Err(place.fault(FileFault::DuplicateId("cameras", id.into())));
            }
        }
        Ok(all)
    }

    fn images(&self) -> Result<Vec<ModelImage>, SceneError> {
        let path = self.file("images");
        match self.form {
            Form::Binary => binary::images(&path),
            Form::Text => text::images(&path),
        }
    }

    /// How many images it has; 0 if that cannot be read.
    fn image_count(&self) -> u64 {
        match self.form {
            Form::Binary => binary::image_count(&self.file("images")).unwrap_or_default(),
            Form::Text => self.images().map_or(0, |images| images.len() as u64),
        }
    }

    /// Its points, none where it has no file of them.
    fn points(&self) -> Result<Vec<ModelPoint>, SceneError> {
        let path = self.file("points3D");
        match self.form {
            _ if !path.is_file() => Ok(Vec::new()),
            Form::Binary => binary::points(&path),
            Form::Text => text::points(&path),
        }
    }
}

/// Points with their views as [`RawScene`] counts them; images without a view are dropped.
fn raw_points(points: Vec<ModelPoint>, view_of: &HashMap<u32, u32>) -> Vec<RawPoint> {
    let raw = |point: ModelPoint| RawPoint {
        position: point.position,
        error: point.error,
        colour: point.colour,
        views: point.images.iter().filter_map(|image| view_of.get(image).copied()).collect(),
        location: point.location,
    };
    points.into_iter().map(raw).collect()
}

/// The data of a model used by layouts that were made from it.
pub(super) struct Origin {
    /// The names of its images, in their order by character.
    pub(super) names: Vec<String>,
    /// World-to-camera matrices of these images.
    pub(super) cameras_from_world: Vec<[[f64; 4]; 4]>,
    /// Its points; their views are indices into these images.
    pub(super) points: Vec<RawPoint>,
    /// The file of the points.
    pub(super) points_path: PathBuf,
}

/// The model in a scene's folder, if there is one.
fn model_in(root: &Path) -> Option<Model> {
    let in_folder = |name: &str| {
        let folder = root.join(name);
        // Of equal ones the first.
        let largest = numbered_models(&folder).into_iter().rev().max_by_key(Model::image_count);
        largest.or_else(|| Model::of(&folder))
    };
    MODEL_FOLDERS.into_iter().find_map(in_folder).or_else(|| Model::of(root))
}

/// COLMAP makes a model of each part of the photographs that it cannot join with another: `0`, `1` and so on,
/// ascending.
fn numbered_models(folder: &Path) -> Vec<Model> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let numbered = |path: PathBuf| {
        let number: u32 = path.file_name()?.to_string_lossy().parse().ok()?;
        Some((number, Model::of(&path)?))
    };
    let mut models: Vec<(u32, Model)> = entries.filter_map(numbered).collect();
    models.sort_by_key(|(number, _)| *number);
    models.into_iter().map(|(_, model)| model).collect()
}

/// A warning that names the numbered models beside this one.
fn other_models(model: &Model) -> Option<String> {
    let models = numbered_models(model.folder.parent()?);
    let is_numbered = models.iter().any(|other| other.folder == model.folder);
    let others = models.iter().filter(|other| other.folder != model.folder && is_numbered);
    let others = others.map(|other| format!("{} ({} photographs)", files::stem(&other.folder), other.image_count()));
    let list = others.collect::<Vec<_>>().join(", ");
    let (count, model) = (model.image_count(), model.folder.display());
    (!list.is_empty()).then(|| {
        format!(
            "{model}: this model has {count} photographs; others beside it are not read, each has coordinates of its \
                own: {list}"
        )
    })
}

/// The model with points in a scene's folder, if there is one.
pub(super) fn beside(root: &Path) -> Result<Option<Origin>, SceneError> {
    let Some(model) = model_in(root) else { return Ok(None) };
    let points_path = model.file("points3D");
    if !points_path.is_file() {
        return Ok(None);
    }
    let (mut images, points) = (model.images()?, model.points()?);
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let view_of = images.iter().enumerate().map(|(view, image)| (image.id, view as u32)).collect();
    let cameras_from_world = images.iter().map(camera_from_world).collect();
    let names = images.into_iter().map(|image| image.name).collect();
    Ok(Some(Origin { names, cameras_from_world, points: raw_points(points, &view_of), points_path }))
}

impl Reader for Colmap {
    fn name(&self) -> &'static str {
        "colmap"
    }

    fn form(&self) -> &'static str {
        "a folder with sparse/0/cameras.bin and images.bin, or .txt (COLMAP)"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        Ok(model_in(path).map(|model| model.folder))
    }

    fn read(&self, folder: &Path) -> Result<RawScene, SceneError> {
        let missing = || FilePlace::file(folder.join("cameras.bin")).fault(SceneFault::Missing);
        let model = Model::of(folder).ok_or_else(missing)?;
        let (cameras, mut images, points) = (model.cameras()?, model.images()?, model.points()?);
        let images_path = model.file("images");
        if images.is_empty() {
            return Err(FilePlace::file(images_path).fault(SceneFault::NoViews("images of a COLMAP model")));
        }
        images.sort_by(|a, b| files::natural_order(&a.name, &b.name));
        let photographs = photograph_folder(folder, &images);
        let mut missing = Missing::default();
        let mut views: Vec<RawView> = Vec::new();
        let mut view_of: HashMap<u32, u32> = HashMap::new();
        for image in &images {
            let fault = |fault: FileFault| image.place.clone().fault(fault);
            let unknown = || fault(FileFault::NoSuchId("camera", image.camera.into()));
            let camera = cameras.get(&image.camera).ok_or_else(unknown)?;
            let Some(photograph) = present(&photographs, &image.name) else {
                missing.missed(image.place.clone(), photographs.join(&image.name));
                continue;
            };
            missing.found();
            let Parameters { focal, principal, lens } = camera.parameters;
            let intrinsics = RawIntrinsics {
                size: Some(camera.size),
                lens,
                ..RawIntrinsics::of_photograph(focal, principal, camera.place.clone())
            };
            let (matrix, place) = (camera_from_world(image), image.place.clone());
            let pose = RawPose { matrix, form: PoseForm::OpenCvFromWorld, place };
            if view_of.insert(image.id, views.len() as u32).is_some() {
                return Err(fault(FileFault::DuplicateId("images", image.id.into())));
            }
            let name = files::stem(&photograph);
            views.push(RawView::new(name, Some(ImageFile::open(&photograph)?), pose, Some(intrinsics)));
        }
        let (points, points_path) = (raw_points(points, &view_of), model.file("points3D"));
        let warnings = missing.warning(&images_path)?.into_iter().chain(other_models(&model)).collect();
        Ok(RawScene { views, points, points_path, warnings, ..RawScene::default() })
    }
}

/// The folder that has the photographs: the first, from the model's upwards, that has any of them.
fn photograph_folder(model: &Path, images: &[ModelImage]) -> PathBuf {
    let above = |levels: usize| model.ancestors().nth(levels).map(Path::to_path_buf);
    for level in (0..=MAX_LEVELS).filter_map(above) {
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
fn camera_from_world(image: &ModelImage) -> [[f64; 4]; 4] {
    let [w, x, y, z] = image.rotation;
    let [a, b, c] = image.translation;
    let given = DQuat::from_xyzw(x, y, z, w);
    let norm = given.length();
    let unit = if UNIT_NORMS.contains(&norm) { given.normalize() } else { given };
    let (w, x, y, z) = (unit.w, unit.x, unit.y, unit.z);
    [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y), a],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x), b],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z, c],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// A camera from its model's name or number, its size and its parameters.
fn camera(
    place: FilePlace,
    model: Result<CameraModel, String>,
    size: [f64; 2],
    parameters: &[f64],
) -> Result<ModelCamera, SceneError> {
    let model = known(&place, model)?;
    let (expected, found) = (model.parameter_count(), parameters.len());
    if found != expected {
        return Err(place.fault(FileFault::WrongCount { of: "parameters of the camera model", expected, found }));
    }
    let size = check::size(&place, size[0], size[1])?;
    match model.interpret(parameters) {
        Ok(parameters) => Ok(ModelCamera { size, parameters, place }),
        Err(reason) => Err(place.fault(IntrinsicsFault::Lens(reason))),
    }
}

/// The model, if it is supported.
fn known(place: &FilePlace, model: Result<CameraModel, String>) -> Result<CameraModel, SceneError> {
    model.map_err(|model| place.clone().fault(IntrinsicsFault::CameraModel(model, camera_model_names())))
}
