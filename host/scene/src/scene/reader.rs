//! What a reader of a layout is: it tells whether a path is laid out its way, and hands over what stands there as it is.
//!
//! Numbers become poses and pinholes in one place, whatever the reader ([`crate::Scene::open_with`]): poses must be finite
//! and rigid, intrinsics a pinhole's, sizes those of the photographs, names different. A crate outside adds a layout by
//! implementing [`Reader`].

use std::path::{Path, PathBuf};

use super::error::SceneError;
use super::fault::Place;
use super::images;

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

    /// The views of what [`Reader::recognise`] found, in the order in which the scene has them.
    ///
    /// # Errors
    /// [`SceneError`] with the path, and the line or key, of the first thing that is missing or wrong.
    fn read(&self, found: &Path) -> Result<Vec<RawView>, SceneError>;
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
}

/// A photograph whose header was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageFile {
    path: PathBuf,
    size: [u32; 2],
}

impl ImageFile {
    /// Reads the header.
    ///
    /// # Errors
    /// [`SceneError`] if it cannot be read, is no image, or states a side above [`crate::LARGEST_SIDE`].
    pub fn open(path: &Path) -> Result<ImageFile, SceneError> {
        Ok(ImageFile { path: path.to_path_buf(), size: images::size(path)? })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
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
    /// Width and height of the images that they are for. A photograph may be a resampled copy of such an image: focal
    /// lengths and principal point then scale with their axis.
    pub size: [u32; 2],
    /// The file that they stand in.
    pub path: PathBuf,
    /// Where in the file focal lengths and principal point stand.
    pub place: Place,
    /// Where in the file the size stands.
    pub size_place: Place,
}
