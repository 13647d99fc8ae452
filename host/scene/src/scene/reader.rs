//! What a reader of a layout is: it tells whether a path is laid out its way, and hands over what stands there as it is.
//!
//! Numbers become poses and pinholes in one place, whatever the reader ([`crate::Scene::open_with`]): poses must be finite
//! and rigid, intrinsics a pinhole's, sizes those of the photographs, names different. A crate outside adds a layout by
//! implementing [`Reader`].

use std::path::{Path, PathBuf};

use image::metadata::Orientation;
use viewfuse_core::lens::Lens;

use super::error::SceneError;
use super::fault::Place;
use super::images;
use super::split::Split;

pub use super::files::{has_extension, list, number_lines, read_text, stem};

/// A layout of scenes on disk.
pub trait Reader {
    /// What people call the layout: `srn`.
    fn name(&self) -> &'static str;

    /// What is looked for, for help texts and for the error where no reader fits: `a folder with rgb/, pose/ and
    /// intrinsics.txt (SRN)`.
    fn form(&self) -> &'static str;

    /// What to read if there is a scene of this layout at a path that exists: the path itself, or a file in it. Looks at
    /// names only.
    ///
    /// # Errors
    /// [`SceneError`] if the path cannot be read, or where the layout is there and it is unclear what is meant.
    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError>;

    /// What stands in what [`Reader::recognise`] found; views in the order in which the scene has them.
    ///
    /// # Errors
    /// [`SceneError`] with the path, and the line or key, of the first thing that is missing or wrong.
    fn read(&self, found: &Path) -> Result<RawScene, SceneError>;
}

/// A scene as it stands on disk. A list of views alone becomes one by `RawScene::from`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawScene {
    /// The views.
    pub views: Vec<RawView>,
    /// Points of the world that were reconstructed with the cameras.
    pub points: Vec<RawPoint>,
    /// What was left out or ignored, a line each.
    pub warnings: Vec<String>,
}

impl From<Vec<RawView>> for RawScene {
    fn from(views: Vec<RawView>) -> RawScene {
        RawScene { views, ..RawScene::default() }
    }
}

/// A reconstructed point as it stands on disk.
#[derive(Clone, Debug, PartialEq)]
pub struct RawPoint {
    /// World coordinates of the file.
    pub position: [f64; 3],
    /// Mean reprojection error in pixels; negative where the file does not say.
    pub error: f64,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// The views that saw it, as indices into [`RawScene::views`].
    pub views: Vec<u32>,
}

/// A view as it stands on disk. Not checked yet, but for the photograph's header.
#[derive(Clone, Debug, PartialEq)]
pub struct RawView {
    /// What people call it; without separators of folders.
    pub name: String,
    /// The photograph, if there is one.
    pub image: Option<ImageFile>,
    /// Where the camera was.
    pub pose: RawPose,
    /// How it maps the world to its image. `None` for a target pose: the camera of the scene's first photograph, at that
    /// one's size.
    pub intrinsics: Option<RawIntrinsics>,
    /// An image of the photograph's shape that says what counts: 0 where nothing does.
    pub mask: Option<PathBuf>,
    /// Nearest and furthest depth of what the view shows, along the principal axis, in the file's units.
    pub near_far: Option<[f64; 2]>,
    /// Which part of the scene it belongs to.
    pub split: Option<Split>,
}

impl RawView {
    /// A view of which the layout knows no more than this.
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
    /// [`SceneError`] if it cannot be read, is no image, or states a side above [`crate::LARGEST_SIDE`].
    pub fn open(path: &Path) -> Result<ImageFile, SceneError> {
        let images::Header { size, orientation } = images::header(path)?;
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

    /// How the file says that its pixels must be turned to be upright (EXIF).
    pub fn orientation(&self) -> Orientation {
        self.orientation
    }
}

/// What the 16 numbers of a pose are.
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
    pub matrix: [f64; 16],
    /// What it is.
    pub form: PoseForm,
    /// The file that it stands in.
    pub path: PathBuf,
    /// Where in the file.
    pub place: Place,
}

/// Intrinsics as numbers of a file, in our image coordinates: the top left pixel's centre is at (0.5, 0.5).
#[derive(Clone, Debug, PartialEq)]
pub struct RawIntrinsics {
    /// Focal lengths along x and y in pixels.
    pub focal: [f64; 2],
    /// Principal point, x and y, in pixels.
    pub principal: [f64; 2],
    /// Width and height of the images that they are for; `None` where nothing says so but the photograph itself. A
    /// photograph may be a resampled copy of such an image: focal lengths and principal point then scale with their axis.
    pub size: Option<[u32; 2]>,
    /// What the lens does to the pinhole's image. A photograph is undistorted when it is read.
    pub lens: Option<Lens>,
    /// The file that they stand in.
    pub path: PathBuf,
    /// Where in the file focal lengths and principal point stand.
    pub place: Place,
    /// Where in the file the size stands.
    pub size_place: Place,
}
