//! Errors of scenes on disk: the place, and what is wrong there. Every message is one line that begins with the path of
//! the faulty file, followed by the line or the key in it.

use std::path::PathBuf;

use image::error::ImageFormatHint;
use image::{ImageError, ImageFormat};
use thiserror::Error;
use viewfuse_core::pose::{MAX_COORDINATE, PoseError};
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::text::in_line;
use zip::result::ZipError;

use super::fault::{FileFault, FilePlace, ImageFault, IntrinsicsFault, NumpyFault, PlyFault, Short};

/// Why a scene could not be read.
#[derive(Debug, Error)]
#[error("{place}: {fault}")]
pub struct SceneError {
    /// The file or folder that a person must open, and the place in it.
    pub place: FilePlace,
    /// What is wrong.
    pub fault: Box<SceneFault>,
}

impl FilePlace {
    /// The error of what is wrong here.
    pub fn fault(self, fault: impl Into<SceneFault>) -> SceneError {
        SceneError { place: self, fault: Box::new(fault.into()) }
    }
}

/// What is wrong with a scene, or with one of its files.
#[derive(Debug, Error)]
pub enum SceneFault {
    /// A required file or folder does not exist.
    #[error("no such file or folder")]
    Missing,
    /// The operating system reported an error.
    #[error("cannot be read: {0}")]
    Read(std::io::Error),
    /// No known layout: what the readers recognise.
    #[error("no scene here; looked for {0}")]
    UnknownLayout(String),
    /// So many photographs, and no layout that gives their poses.
    #[error("{0} photographs, and nothing that gives their poses")]
    BarePhotographs(usize),
    /// So many photographs, and where their poses may be, in a sentence.
    #[error("{0} photographs without poses; {1}")]
    PosesElsewhere(usize, String),
    /// A file that is no camera path: what such files look like.
    #[error("no camera path; looked for {0}")]
    UnknownCameraPath(&'static str),
    /// A camera path without cameras.
    #[error("the path has no cameras")]
    NoCameras,
    /// nerfstudio's record of what it did to a scene is no rotation, offset and scale.
    #[error("transform is not a rotation with an offset, or scale is not above 0")]
    NoSimilarity,
    /// Two lists of cameras in a folder.
    #[error("holds both {0} and {1}; give the path of one of them")]
    Ambiguous(String, String),
    /// The layout was recognised but lists no views of the expected form.
    #[error("the scene has no photographs ({0})")]
    NoViews(&'static str),
    /// A pose whose photograph is missing (if its name has no extension: with any supported one).
    #[error("this pose has no photograph: there is no {}", in_line(.0.display()))]
    PoseWithoutImage(PathBuf),
    /// The same, where a file of its name lies beside the list.
    #[error(
        "this pose has no photograph: there is no {}, but {} is there: make the path relative to the list",
        in_line(.0.display()), in_line(.1.display())
    )]
    PoseWithImageElsewhere(PathBuf, PathBuf),
    /// A mask that is named and missing.
    #[error("there is no mask {}", in_line(.0.display()))]
    NoMask(PathBuf),
    /// Masks that may say either of two things, and how much they leave of the photographs in percent.
    #[error(
        "this mask and the others leave {0} % of the photographs, and not one region inside each: it is not clear \
         whether they say where an object is or which pixels do not count, or are inverted"
    )]
    UnclearMasks(u32),
    /// A photograph whose pose is missing: the expected file.
    #[error("this photograph has no pose: there is no {}", .0.display())]
    ImageWithoutPose(PathBuf),
    /// A view's name cannot be that of a file.
    #[error("{:?} cannot be the name of a view, of which files are called: {}", .0, not_a_name(.0))]
    Name(String),
    /// Two views of one name.
    #[error("two views are called {0:?}; names must differ")]
    DuplicateName(String),
    /// The matrix is not a camera pose.
    #[error("not a camera pose: {0}")]
    Pose(PoseError),
    /// A rotation with a scale.
    #[error(
        "the rotation is scaled by {}: divide its 3x3 block by that, not the camera's centre, or export the \
         cameras without the scale of their object", Short(*.0)
    )]
    Scaled(f64),
    /// Near and far bound of a view are not an interval.
    #[error("near {0} and far {1} are not two positive depths, the near one first")]
    Depths(f64, f64),
    /// A reconstructed point is not finite, or too far away.
    #[error(
        "the point ({}, {}, {}) is not finite, or further than {MAX_COORDINATE:e} from the origin",
        Short(.0[0]), Short(.0[1]), Short(.0[2])
    )]
    Point([f64; 3]),
    /// The pixels of a view without a photograph were requested.
    #[error("view {0:?} is a pose without a photograph")]
    NoPhotograph(String),
    /// An index, from 0, past the last of so many views.
    #[error("there is no view with index {0}, the scene has {1}")]
    NoSuchView(usize, usize),
    /// The numbers are not a camera that is read.
    #[error(transparent)]
    Intrinsics(#[from] IntrinsicsFault),
    /// An image file that cannot be used.
    #[error(transparent)]
    Image(#[from] ImageFault),
    /// A file that is damaged, or holds something else than it should.
    #[error(transparent)]
    File(#[from] FileFault),
    /// Not an array as NumPy writes them.
    #[error("not a readable NumPy array: {0}")]
    Numpy(NumpyFault),
    /// Not a PLY file that can be read.
    #[error("not a readable PLY file: {0}")]
    Ply(PlyFault),
    /// A file of Gaussians with another meaning than those that are read, or none, and the way out.
    #[error("{0}")]
    Gaussians(String),
    /// Not a zip archive.
    #[error("not a readable zip archive: {0}")]
    Zip(ZipError),
}

impl Hinted for SceneError {
    fn hint(&self) -> Option<Hint> {
        match &*self.fault {
            SceneFault::BarePhotographs(_) | SceneFault::PosesElsewhere(..) => Some(Hint::Poses),
            SceneFault::UnclearMasks(_) => Some(Hint::Masks),
            SceneFault::Image(ImageFault::Unreadable(cause)) => match &**cause {
                ImageError::Unsupported(problem)
                    if problem.format_hint() == ImageFormatHint::Exact(ImageFormat::Tiff) =>
                {
                    Some(Hint::BuildWithTiff)
                }
                _ => None,
            },
            _ => None,
        }
    }
}

/// Why a text is no name of a view.
fn not_a_name(name: &str) -> &'static str {
    match name {
        "" => "it is empty",
        _ if name.contains('\0') => "it holds a NUL",
        _ if name.contains(std::path::is_separator) => "it holds a separator of folders",
        _ => "it is too long",
    }
}
