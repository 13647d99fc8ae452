//! Scenes: posed photographs on disk.
//!
//! [`Scene::open`] calls each reader, which says whether it recognises a folder, reads every pose and every image
//! *header* and checks them all: counts, finite and rigid poses, sizes. The pixels of a view are read when they are
//! first needed ([`Scene::photograph`]), so that a command that needs only poses decodes no image.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use image::GrayImage;
use image::metadata::Orientation;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::lens::Lens;
use viewfuse_core::pose::Pose;

mod bytes;
pub(crate) mod camera_models;
pub(crate) mod check;
mod colmap;
mod elsewhere;
mod error;
mod fault;
pub(crate) mod files;
mod found_poses;
pub(crate) mod frame;
mod images;
mod inputs;
mod jpeg;
pub(crate) mod json;
mod llff;
pub(crate) mod masks;
mod middlebury;
mod missing;
pub(crate) mod neus;
mod numpy;
pub mod reader;
mod split;
mod srn;
pub(crate) mod transforms;
mod undistort;
mod unlisted;

use check::Checked;
pub use error::{SceneError, SceneFault};
pub use fault::{FaultLocation, FileFault, FilePlace, ImageFault, IntrinsicsFault, NumpyFault, PlyFault};
pub use frame::SRN_DISTANCE;
use images::Turn;
pub use images::{encode_png, picture_size, read_picture};
pub use inputs::reads_below;
use masks::meaning::Decision;
pub use masks::meaning::{MaskChoice, MaskMeaning};
use reader::Reader;
pub use split::Split;

/// The readers of all layouts, in the order in which they are tried: the first that recognises a path reads it.
pub const READERS: [&dyn Reader; 6] =
    [&transforms::Transforms, &middlebury::Middlebury, &srn::Srn, &neus::Neus, &llff::Llff, &colmap::Colmap];

/// What readers look for, for help texts and messages.
pub fn looked_for(readers: &[&dyn Reader]) -> String {
    readers.iter().map(|reader| reader.form()).collect::<Vec<_>>().join("; ")
}

/// Most pixels that an image may have on a side: a larger header is refused before anything is allocated.
pub const MAX_SIDE: u32 = 16_384;

/// One camera of a scene, with its photograph if there is one.
///
/// The camera is always a pinhole. If the photograph has lens distortion, [`Scene::photograph`] undistorts it to that
/// pinhole, at the same size.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Its name: the stem of the photograph's file; `target_1` for `target_pose/1.txt` of an SRN folder.
    /// Names are unique in a scene and contain no path separator.
    pub name: String,
    /// The pinhole camera with its pose.
    pub camera: Camera,
    /// The photograph; `None` for a target pose without one.
    pub image: Option<PathBuf>,
    /// The lens distortion of the stored photograph; `None` if it is a pinhole's. Normalised coordinates of `camera`.
    pub lens: Option<Lens>,
    /// The mask's file (0: pixel does not count); [`Scene::masks`] says what it means.
    pub mask: Option<PathBuf>,
    /// Near and far bound of the view, if its file states them: along the principal axis, in world units.
    pub near_far: Option<[f32; 2]>,
    /// The split of the scene that it belongs to, if its files define splits.
    pub split: Option<Split>,
}

/// A sparse point that was reconstructed with the cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenePoint {
    /// World coordinates.
    pub position_world: Vec3,
    /// Mean reprojection error in pixels of the photographs that it was made from; `None` if the file does not state
    /// it.
    pub error: Option<f32>,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// The views that saw it, as indices into [`Scene::views`], ascending, each once.
    pub views: Vec<u32>,
}

/// The world's place in the coordinates of the scene's files: `point_file = origin + scale * point_world`.
///
/// Rounding to `f32` would lose the distances between cameras far from the origin (surveyed coordinates). The origin is
/// therefore moved before rounding, if the centroid of their centres is more than 16 times their spread (root mean
/// square distance from it) away from the origin: to the point nearest to their principal axes, or to the centroid if
/// these are parallel or meet further off. Cameras in one place are moved if it is further than 1e4 from the origin.
/// The scale is other than 1 only where the spread is below 1e-3 or above 1e4: then it makes the cameras' mean distance
/// from what they look at that of SRN's (1.3), for which networks were trained. An ordinary scene keeps its numbers bit
/// for bit, because learned fields depend on the unit and on the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneFrame {
    /// The world's origin in the file's coordinates.
    pub origin: DVec3,
    /// The world's unit in the file's units.
    pub scale: f64,
}

impl SceneFrame {
    /// The file's coordinates, unchanged.
    pub const FILE: SceneFrame = SceneFrame { origin: DVec3::ZERO, scale: 1.0 };

    /// A point of the file in the world.
    pub fn world(&self, point_file: DVec3) -> DVec3 {
        (point_file - self.origin) / self.scale
    }

    /// A point of the world in the file's coordinates.
    pub fn file(&self, point_world: DVec3) -> DVec3 {
        self.origin + self.scale * point_world
    }

    /// A length of the world in the file's units.
    pub fn file_length(&self, length_world: f32) -> f32 {
        (f64::from(length_world) * self.scale) as f32
    }

    /// The camera-to-world matrix of a pose in the file's coordinates: OpenCV axes, row-major.
    pub fn file_from_camera(&self, pose: &Pose) -> [[f64; 4]; 4] {
        let mut matrix = pose.to_opencv().map(|row| row.map(f64::from));
        let centre = self.file(pose.centre_world().as_dvec3());
        for (row, coordinate) in matrix.iter_mut().zip(centre.to_array()) {
            row[3] = coordinate;
        }
        matrix
    }
}

/// A photograph in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// Straight (not premultiplied) 8-bit RGBA.
    pub pixels: image::RgbaImage,
    /// Whether any pixel is not opaque, or there is an object's mask. If not, the background must be estimated from the
    /// colours.
    pub has_alpha: bool,
    /// What counts: 255 inside the stored photograph, 0 outside of it, where `pixels` repeat the nearest pixel of the
    /// photograph, and where its ignore mask says that pixels do not count. `None` if all pixels count.
    pub seen: Option<image::GrayImage>,
}

impl Photograph {
    /// The whole photograph: its transparency is ignored.
    pub(crate) fn without_alpha(mut self) -> Photograph {
        self.pixels.pixels_mut().for_each(|pixel| pixel[3] = u8::MAX);
        Photograph { has_alpha: false, ..self }
    }
}

/// A scene whose poses and image headers have been read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The folder or file it was opened from.
    pub path: PathBuf,
    /// Its layout: the name of the reader that recognised it.
    pub layout: &'static str,
    /// Views with photographs first (at least one), then target poses without. In the order of the list where the
    /// layout has one, otherwise in natural order of the names (`2` before `10`).
    pub views: Vec<View>,
    /// Sparse points that were reconstructed with the cameras; often none.
    pub points: Vec<ScenePoint>,
    /// Warnings from opening the scene, a line each: missing photographs, ignored keys.
    pub warnings: Vec<String>,
    /// Conventions of the files that were applied, a line each (host/scene/CONVENTIONS.md).
    pub conventions: Vec<String>,
    /// What the masks of the views say.
    pub masks: MaskMeaning,
    /// What a person says of alpha channels and masks; masks that are not used are no view's.
    pub mask_choice: MaskChoice,
    /// Keys and files that were not read, a line each.
    pub unused: Vec<String>,
    /// The world's place in the coordinates of the files.
    pub frame: SceneFrame,
}

impl Scene {
    /// Opens a scene with the first of [`READERS`] that recognises it, and checks it.
    ///
    /// # Errors
    /// As [`Scene::open_with`].
    pub fn open(path: impl AsRef<Path>) -> Result<Scene, SceneError> {
        Scene::open_with(path, &READERS)
    }

    /// As [`Scene::open`], where a person says what masks and alpha channels mean.
    ///
    /// # Errors
    /// As [`Scene::open_with`].
    pub fn open_masked(path: impl AsRef<Path>, masks: MaskChoice) -> Result<Scene, SceneError> {
        Scene::open_by(path.as_ref(), &READERS, masks)
    }

    /// Opens a scene with the first of these readers that recognises it: reads every pose and every image header, and
    /// checks them. Other crates put their own readers before or after [`READERS`].
    ///
    /// # Errors
    /// [`SceneError`] with the path, and the line or key, of the first thing that is missing or wrong.
    pub fn open_with(path: impl AsRef<Path>, readers: &[&dyn Reader]) -> Result<Scene, SceneError> {
        Scene::open_by(path.as_ref(), readers, MaskChoice::Auto)
    }

    fn open_by(path: &Path, readers: &[&dyn Reader], mask_choice: MaskChoice) -> Result<Scene, SceneError> {
        fs::metadata(path).map_err(|cause| files::unreadable(path, cause))?;
        for reader in readers {
            let Some(found) = reader.recognise(path)? else { continue };
            let mut checked = check::scene(&found, reader.form(), reader.read(&found)?)?;
            distinguish(&mut checked.views);
            let mut unmasked = None;
            if mask_choice == MaskChoice::None {
                checked.views.iter_mut().for_each(|view| view.mask = None);
            } else {
                unmasked = masks::find(path, &mut checked.views);
            }
            let Decision { meaning: masks, line, warning } =
                masks::meaning::decide(&checked.views, mask_choice, reader.masks());
            checked.conventions.extend(line);
            checked.warnings.extend(warning);
            let mut names = HashSet::new();
            if let Some(twin) = checked.views.iter().find(|view| !names.insert(view.name.as_str())) {
                let place = FilePlace::file(twin.image.clone().unwrap_or(found));
                return Err(place.fault(SceneFault::DuplicateName(twin.name.clone())));
            }
            let Checked { mut views, points, mut warnings, conventions, mut unused, lists, frame } = checked;
            warnings.extend(unlisted::photographs(&views));
            warnings.extend(unlisted::alphas(&views));
            warnings.extend(found_poses::warnings(path, &views));
            unused.extend(unlisted::files(&found, &views, &lists));
            let is_of_object = masks == MaskMeaning::Object && mask_choice != MaskChoice::None;
            let excluded = is_of_object.then(|| masks::exclude_unmasked(path, &mut views)).flatten();
            warnings.extend(excluded.or(unmasked));
            let (path, layout) = (path.to_path_buf(), reader.name());
            return Ok(Scene { path, layout, views, points, warnings, conventions, unused, masks, mask_choice, frame });
        }
        Err(FilePlace::file(path).fault(match files::photograph_count(path) {
            0 => SceneFault::UnknownLayout(looked_for(readers)),
            count => match elsewhere::poses(path, readers) {
                Some(place) => SceneFault::PosesElsewhere(count, place),
                None => SceneFault::BarePhotographs(count),
            },
        }))
    }

    /// Its name: that of its folder, for any spelling of the path.
    pub fn name(&self) -> String {
        let whole = fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone());
        let folder = if whole.is_file() { whole.parent().map(Path::to_path_buf) } else { Some(whole) };
        let name = folder.as_deref().and_then(Path::file_name);
        name.map_or_else(|| self.path.display().to_string(), files::exact)
    }

    /// Decodes the photograph of the view with this index: turned upright where the cameras are those of the upright
    /// picture, with an object's mask as the alpha channel, undistorted to the view's pinhole.
    ///
    /// # Errors
    /// [`SceneError`] if there is no such view, if it has no photograph, if a file cannot be decoded, or if its size
    /// has changed since the scene was opened.
    pub fn photograph(&self, view: usize) -> Result<Photograph, SceneError> {
        self.photograph_after(view, |stored| stored)
    }

    /// As [`Scene::photograph`], with the stored photograph (upright, with its mask) made smaller before it is
    /// undistorted.
    pub(crate) fn photograph_after(
        &self,
        view: usize,
        reduce: impl FnOnce(Photograph) -> Photograph,
    ) -> Result<Photograph, SceneError> {
        let View { camera, lens, .. } = self.view(view)?;
        let photograph = reduce(self.masked_photograph(view)?);
        Ok(match lens {
            Some(lens) => undistort::undistorted(&photograph, lens, &camera.pinhole),
            None => photograph,
        })
    }

    /// The photograph of a view upright, and otherwise as it is stored: without its mask, not undistorted.
    pub(crate) fn stored_photograph(&self, view: usize) -> Result<Photograph, SceneError> {
        let (photograph, _) = images::decode(self.photograph_file(view)?, self.size(view)?)?;
        Ok(photograph)
    }

    /// The same with its mask.
    pub(crate) fn masked_photograph(&self, view: usize) -> Result<Photograph, SceneError> {
        let (mut photograph, turn) = images::decode(self.photograph_file(view)?, self.size(view)?)?;
        if !self.uses_alpha() {
            photograph = photograph.without_alpha();
        }
        if let Some(mask) = &self.view(view)?.mask {
            masks::apply(mask, &mut photograph, &turn, self.masks)?;
        }
        Ok(photograph)
    }

    /// Whether alpha channels are used: a person may say that they are not.
    pub(crate) fn uses_alpha(&self) -> bool {
        self.mask_choice != MaskChoice::None
    }

    /// Whether a view has an object's mask.
    pub fn has_object_mask(&self, view: &View) -> bool {
        view.mask.is_some() && self.masks == MaskMeaning::Object
    }

    /// The mask of a view for the photograph of [`Scene::stored_photograph`], at the mask's own size; `None` without a
    /// mask, or if the mask's file is that already.
    pub(crate) fn stored_mask(&self, view: usize) -> Result<Option<GrayImage>, SceneError> {
        let Some(mask) = &self.view(view)?.mask else { return Ok(None) };
        let turn = Turn::of(&images::header(self.photograph_file(view)?)?, self.size(view)?);
        if masks::is_as_stored(mask, &turn)? {
            return Ok(None);
        }
        masks::read(mask, &turn, self.masks).map(Some)
    }

    /// The ignore mask of a view for the photograph of [`Scene::stored_photograph`], at a size: 0 for what does not
    /// count, 255 elsewhere and without a mask.
    pub(crate) fn stored_ignore_mask(&self, view: usize, [width, height]: [u32; 2]) -> Result<GrayImage, SceneError> {
        let Some(mask) = &self.view(view)?.mask else {
            return Ok(GrayImage::from_pixel(width, height, image::Luma([u8::MAX])));
        };
        let turn = Turn::of(&images::header(self.photograph_file(view)?)?, self.size(view)?);
        masks::ignoring(mask, &turn, [width, height])
    }

    /// The file of a view's photograph if its pixels are upright as they are stored.
    pub(crate) fn upright_file(&self, view: usize) -> Result<Option<&Path>, SceneError> {
        let file = self.photograph_file(view)?;
        Ok((images::header(file)?.orientation == Orientation::NoTransforms).then_some(file))
    }

    /// Width and height of a view's picture.
    fn size(&self, view: usize) -> Result<[u32; 2], SceneError> {
        let pinhole = &self.view(view)?.camera.pinhole;
        Ok([pinhole.width(), pinhole.height()])
    }

    fn view(&self, view: usize) -> Result<&View, SceneError> {
        self.views
            .get(view)
            .ok_or_else(|| FilePlace::file(&self.path).fault(SceneFault::NoSuchView(view, self.views.len())))
    }

    fn photograph_file(&self, view: usize) -> Result<&Path, SceneError> {
        let View { name, image, .. } = self.view(view)?;
        image.as_deref().ok_or_else(|| FilePlace::file(&self.path).fault(SceneFault::NoPhotograph(name.clone())))
    }

    /// The index of the view that `text` refers to; `None` if it may be none or several ([`Scene::views_meant`]).
    pub fn view_named(&self, text: &str) -> Option<usize> {
        match self.views_meant(text)[..] {
            [view] => Some(view),
            _ => None,
        }
    }

    /// The views that `text` may refer to: the view of exactly this name; `#3` is the index 3, too where a name is `#3`;
    /// a whole number is an index, and the number that a name ends in, leading zeros aside.
    ///
    /// Both, because some data sets count from 1 and some from 0: in `toy0001, toy0002` the number 1 may mean either,
    /// which the caller says, and 2 can only be `toy0002`. A number with leading zeros is no index, and where names are
    /// nothing but numbers (`000048`), a number is a name. Of a photograph and a target pose of the same number the
    /// photograph is meant.
    pub fn views_meant(&self, text: &str) -> Vec<usize> {
        let number = text.strip_prefix('#').unwrap_or(text);
        let index = number.parse().ok().filter(|index| is_number(number) && *index < self.views.len());
        if let Some(view) = self.views.iter().position(|view| view.name == text) {
            let other = index.filter(|index| number != text && *index != view);
            return [view].into_iter().chain(other).collect();
        }
        if number != text || !is_number(number) {
            return index.into_iter().collect();
        }
        let ends_in = |view: &usize| trailing_number(&self.views[*view].name) == trailing_number(text);
        let (photographs, poses): (Vec<usize>, Vec<usize>) =
            (0..self.views.len()).filter(ends_in).partition(|view| self.views[*view].image.is_some());
        let mut meant = if photographs.is_empty() { poses } else { photographs };
        let is_index = |index: &usize| {
            index.to_string() == text && !meant.contains(index) && !self.views.iter().any(|view| is_number(&view.name))
        };
        meant.extend(index.filter(is_index));
        meant
    }
}

/// Whether a text is nothing but digits.
fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Views of several cameras are often numbered alike, in a folder for each camera: their names get the folder's name as
/// a prefix.
fn distinguish(views: &mut [View]) {
    let folder_of = |view: &View| view.image.as_deref().and_then(Path::parent).map(Path::to_path_buf);
    let mut folders: HashMap<String, Vec<PathBuf>> = HashMap::new();
    for view in views.iter() {
        folders.entry(view.name.clone()).or_default().extend(folder_of(view));
    }
    let mut names: Vec<String> = views.iter().map(|view| view.name.clone()).collect();
    for (view, name) in views.iter().zip(&mut names) {
        let all = &folders[&view.name];
        let differ = all.iter().collect::<HashSet<_>>().len() == all.len();
        let Some(folder) = folder_of(view).filter(|_| all.len() > 1 && differ) else { continue };
        // As few folders as tell them apart: rig1/camera1 and rig2/camera1 need two.
        let ending = |folder: &Path, count: usize| -> Vec<String> {
            let parts: Vec<String> = folder.components().map(|part| files::exact(part.as_os_str())).collect();
            parts[parts.len().saturating_sub(count)..].to_vec()
        };
        let is_enough = |count: &usize| {
            let endings: HashSet<Vec<String>> = all.iter().map(|other| ending(other, *count)).collect();
            endings.len() == all.len()
        };
        let count = (1..=folder.components().count()).find(is_enough).unwrap_or(1);
        *name = format!("{}_{}", ending(&folder, count).join("_"), view.name);
    }
    views.iter_mut().zip(names).for_each(|(view, name)| view.name = name);
}

/// The digits that a name ends in, without leading zeros (empty for zero itself); `None` if it ends in no digit.
fn trailing_number(name: &str) -> Option<&str> {
    let digits = &name[name.trim_end_matches(|c: char| c.is_ascii_digit()).len()..];
    if digits.is_empty() { None } else { Some(digits.trim_start_matches('0')) }
}
