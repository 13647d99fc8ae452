//! The interface of a layout's reader: it recognises a path with its layout, and returns the unchecked contents.
//!
//! Numbers become poses and pinholes in one place for all readers ([`crate::Scene::open_with`]): poses must be finite
//! and rigid, intrinsics a pinhole's, sizes those of the photographs, names unique. Another crate adds a layout by
//! implementing [`Reader`].

use std::path::{Path, PathBuf};

use image::metadata::Orientation;
use viewfuse_core::lens::Lens;

use super::error::SceneError;
use super::fault::{FaultLocation, FilePlace};
use super::images;
use super::masks::meaning::MaskMeaning;
use super::split::Split;

pub use super::files::{folders, has_extension, list, number_lines, read_text, stem};

/// A layout of scenes on disk.
pub trait Reader {
    /// The layout's name: `srn`.
    fn name(&self) -> &'static str;

    /// A description of the layout, for help texts and for the error if no reader recognises a path:
    /// `a folder with rgb/, pose/ and intrinsics.txt (SRN)`.
    fn form(&self) -> &'static str;

    /// The path to read if there is a scene of this layout at an existing path: the path itself, or a file in it.
    /// Checks names only.
    ///
    /// # Errors
    /// [`SceneError`] if the path cannot be read, or if the layout is recognised but ambiguous.
    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError>;

    /// The contents of the path that [`Reader::recognise`] returned; views in the order of the scene.
    ///
    /// # Errors
    /// [`SceneError`] with the path, and the line or key, of the first thing that is missing or wrong.
    fn read(&self, found: &Path) -> Result<RawScene, SceneError>;

    /// What the layout's masks say; `None` if that is to be seen in them.
    fn masks(&self) -> Option<MaskMeaning> {
        None
    }
}

/// An unchecked scene, as on disk. A list of views alone becomes one by `RawScene::from`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawScene {
    /// The views.
    pub views: Vec<RawView>,
    /// Sparse points that were reconstructed with the cameras.
    pub points: Vec<RawPoint>,
    /// The file that contains the points; empty without any.
    pub points_path: PathBuf,
    /// What was dropped or ignored, a line each.
    pub warnings: Vec<String>,
    /// Conventions of the files that were applied, a line each, as `masks: pixels that do not count, 11 files`.
    pub conventions: Vec<String>,
    /// Keys of the files that are not read, a line for each file.
    pub unused: Vec<String>,
}

impl From<Vec<RawView>> for RawScene {
    fn from(views: Vec<RawView>) -> RawScene {
        RawScene { views, ..RawScene::default() }
    }
}

/// An unchecked reconstructed point, as on disk.
#[derive(Clone, Debug, PartialEq)]
pub struct RawPoint {
    /// World coordinates of the file.
    pub position: [f64; 3],
    /// Mean reprojection error in pixels; negative if the file does not state it.
    pub error: f64,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// The views that saw it, as indices into [`RawScene::views`].
    pub views: Vec<u32>,
    /// Where it stands in [`RawScene::points_path`].
    pub location: FaultLocation,
}

/// An unchecked view, as on disk. Only the photograph's header has been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct RawView {
    /// Its name, without path separators.
    pub name: String,
    /// The photograph, if there is one.
    pub image: Option<ImageFile>,
    /// The camera's pose.
    pub pose: RawPose,
    /// The camera's intrinsics. `None` for a target pose: those of the scene's first photograph, at its size.
    pub intrinsics: Option<RawIntrinsics>,
    /// The mask, an image of the photograph's shape: 0 where the photograph does not count.
    pub mask: Option<PathBuf>,
    /// Near and far bound of the view, along the principal axis, in the file's units.
    pub near_far: Option<[f64; 2]>,
    /// The split of the scene that it belongs to.
    pub split: Option<Split>,
}

impl RawView {
    /// A view with only these properties.
    pub fn new(name: String, image: Option<ImageFile>, pose: RawPose, intrinsics: Option<RawIntrinsics>) -> RawView {
        RawView { name, image, pose, intrinsics, mask: None, near_far: None, split: None }
    }
}

/// A photograph whose header was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageFile {
    path: PathBuf,
    size: [u32; 2],
    orientation: Orientation,
}

impl ImageFile {
    /// Reads the header.
    ///
    /// # Errors
    /// [`SceneError`] if it cannot be read, is not an image, or states a side above [`crate::MAX_SIDE`].
    pub fn open(path: &Path) -> Result<ImageFile, SceneError> {
        let images::Header { size, orientation, .. } = images::header(path)?;
        Ok(ImageFile { path: path.to_path_buf(), size, orientation })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Width and height in pixels, as stored.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The orientation tag: how the pixels must be turned to be upright (EXIF).
    pub fn orientation(&self) -> Orientation {
        self.orientation
    }
}

/// The convention of a pose's 16 numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseForm {
    /// Camera-to-world, camera axes x right, y down, z forward.
    WorldFromOpenCv,
    /// Camera-to-world, camera axes x right, y up, z backward.
    WorldFromOpenGl,
    /// World-to-camera, `[R|t]`, camera axes x right, y down, z forward.
    OpenCvFromWorld,
}

/// A pose as numbers of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct RawPose {
    /// The 4x4 matrix, row-major.
    pub matrix: [[f64; 4]; 4],
    /// Its convention.
    pub form: PoseForm,
    /// The place that states it.
    pub place: FilePlace,
}

/// Intrinsics as numbers of a file, in our image coordinates: the top left pixel's centre is at (0.5, 0.5).
#[derive(Clone, Debug, PartialEq)]
pub struct RawIntrinsics {
    /// Focal lengths along x and y in pixels.
    pub focal: [f64; 2],
    /// Principal point, x and y, in pixels.
    pub principal: [f64; 2],
    /// Width and height of the images that they are for; `None` if only the photograph itself states it. A photograph
    /// may be a resampled copy of such an image: focal lengths and principal point then scale with their axis.
    pub size: Option<[u32; 2]>,
    /// The lens distortion. A photograph is undistorted when it is read.
    pub lens: Option<Lens>,
    /// The place that states focal lengths and principal point.
    pub place: FilePlace,
    /// The place that states the size.
    pub size_place: FilePlace,
}

impl RawIntrinsics {
    /// One focal length for both axes, the principal point in the centre of images of this size, no lens distortion.
    pub fn centred(focal: f64, size: [u32; 2], place: FilePlace) -> RawIntrinsics {
        let principal = size.map(|side| f64::from(side) / 2.0);
        RawIntrinsics { size: Some(size), ..RawIntrinsics::of_photograph([focal; 2], principal, place) }
    }

    /// Focal lengths and principal point for images whose size only the photograph itself states, no lens distortion.
    pub fn of_photograph(focal: [f64; 2], principal: [f64; 2], place: FilePlace) -> RawIntrinsics {
        RawIntrinsics { focal, principal, size: None, lens: None, size_place: place.clone(), place }
    }
}
