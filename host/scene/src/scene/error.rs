//! Errors of scenes on disk.
//!
//! Every message is one line and begins with the path of the faulty file, followed by the line or the key in it.

use std::path::PathBuf;

use image::error::ImageFormatHint;
use image::{ImageError, ImageFormat};
use thiserror::Error;
use viewfuse_core::lens::LensError;
use viewfuse_core::pose::{MAX_COORDINATE, PoseError};
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::panics::Panicked;
use viewfuse_job::text::in_line;

use super::MAX_SIDE;
use super::fault::{FaultLocation, FileFault, IntrinsicsFault, NumpyFault, PlyFault, Short};

/// Why a scene could not be read.
#[derive(Debug, Error)]
pub enum SceneError {
    /// A required file or folder does not exist.
    #[error("{path}: no such file or folder")]
    Missing {
        /// The path that was searched.
        path: PathBuf,
    },
    /// The operating system reported an error, or the file is not text.
    #[error("{path}: cannot be read: {cause}")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        cause: std::io::Error,
    },
    /// No known layout.
    #[error("{path}: no scene here; looked for {looked_for}")]
    UnknownLayout {
        /// The folder or file to open.
        path: PathBuf,
        /// The layouts that the readers recognise.
        looked_for: String,
    },
    /// Photographs, and no layout that gives their poses.
    #[error("{path}: {count} photographs, and nothing that gives their poses")]
    BarePhotographs {
        /// The folder.
        path: PathBuf,
        /// How many photographs.
        count: usize,
    },
    /// A file that is no camera path.
    #[error("{path}: no camera path; looked for {looked_for}")]
    UnknownCameraPath {
        /// The file.
        path: PathBuf,
        /// What such files look like.
        looked_for: &'static str,
    },
    /// A camera path without cameras.
    #[error("{path}: the path has no cameras")]
    NoCameras {
        /// The file.
        path: PathBuf,
    },
    /// A column of a table of poses is missing, unknown, or there twice.
    #[error("{path}{place}: {problem}; the columns are {columns}")]
    Columns {
        /// The file.
        path: PathBuf,
        /// The line with the columns' names.
        place: FaultLocation,
        /// What is wrong.
        problem: String,
        /// The columns that there can be.
        columns: &'static str,
    },
    /// A table that is no CSV.
    #[error("{path}{place}: not a table of comma-separated values: {reason}")]
    Table {
        /// The file.
        path: PathBuf,
        /// The line.
        place: FaultLocation,
        /// What the parser said.
        reason: String,
    },
    /// nerfstudio's record of what it did to a scene is no rotation, offset and scale.
    #[error("{path}: transform is not a rotation with an offset, or scale is not above 0")]
    NoSimilarity {
        /// The file.
        path: PathBuf,
    },
    /// More than one list of cameras in a folder.
    #[error("{path}: holds both {first} and {second}; give the path of one of them")]
    Ambiguous {
        /// The folder.
        path: PathBuf,
        /// Name of a list.
        first: String,
        /// Name of another.
        second: String,
    },
    /// The layout was recognised but lists no views.
    #[error("{path}: the scene has no photographs ({looked_for})")]
    NoViews {
        /// The folder or file that lists the views.
        path: PathBuf,
        /// The expected form of a view.
        looked_for: &'static str,
    },
    /// A pose whose photograph is missing.
    #[error("{path}{place}: this pose has no photograph: there is no {}", in_line(image.display()))]
    PoseWithoutImage {
        /// The file with the pose.
        path: PathBuf,
        /// The pose's place in it.
        place: FaultLocation,
        /// The expected photograph (if the name has no extension: with any supported one).
        image: PathBuf,
    },
    /// A mask that is named and missing.
    #[error("{path}{place}: there is no mask {}", in_line(mask.display()))]
    NoMask {
        /// The file that names it.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The expected mask.
        mask: PathBuf,
    },
    /// Masks that may say either of two things.
    #[error(
        "{path}: this mask and the others leave {percent} % of the photographs, and not one region inside each: it is not clear \
         whether they say where an object is or which pixels do not count, or are inverted"
    )]
    UnclearMasks {
        /// The mask's file.
        path: PathBuf,
        /// How much they leave.
        percent: u32,
    },
    /// A photograph whose pose is missing.
    #[error("{path}: this photograph has no pose: there is no {pose}")]
    ImageWithoutPose {
        /// The photograph.
        path: PathBuf,
        /// The expected file.
        pose: PathBuf,
    },
    /// A view's name cannot be that of a file.
    #[error("{path}: {name:?} cannot be the name of a view, of which files are called: {}", not_a_name(.name))]
    Name {
        /// The scene.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// Two views of one name.
    #[error("{path}: two views are called {name:?}; names must differ")]
    DuplicateName {
        /// The second of the two: its photograph, or the scene where it has none.
        path: PathBuf,
        /// The name of both.
        name: String,
    },
    /// A word where a number should be.
    #[error("{path}{place}: {word:?} is not a number")]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The word, shortened if it is long.
        word: String,
    },
    /// NaN, an infinity, or a number too large to hold.
    #[error("{path}{place}: {word:?} is not a finite number")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The word.
        word: String,
    },
    /// Too few or too many numbers (or rows).
    #[error("{path}{place}: found {found} {of} instead of {expected}")]
    WrongCount {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The counted items.
        of: &'static str,
        /// The expected count.
        expected: usize,
        /// The count found.
        found: usize,
    },
    /// The matrix is not a camera pose.
    #[error("{path}{place}: not a camera pose: {reason}")]
    Pose {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The message of core's check.
        reason: PoseError,
    },
    /// The numbers are not a pinhole camera.
    #[error("{path}{place}: {fault}")]
    Intrinsics {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// What is wrong with them.
        fault: IntrinsicsFault,
    },
    /// The photograph was taken through a lens that is not supported.
    #[error(
        "{path}: {key} is {value}: this lens is not supported; undistort the photographs first, for example \
         with COLMAP's image_undistorter, and use the cameras that it writes"
    )]
    Distorted {
        /// The JSON file.
        path: PathBuf,
        /// The key that states the lens.
        key: String,
        /// Its value.
        value: String,
    },
    /// Not JSON.
    #[error("{path}:{line}:{column}: not valid JSON: {reason}")]
    Json {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the parser says.
        reason: String,
    },
    /// A required key is missing.
    #[error("{path}: {key} is missing")]
    MissingKey {
        /// The JSON file.
        path: PathBuf,
        /// The key.
        key: String,
    },
    /// A key holds another kind of value.
    #[error("{path}: {key} must be {expected}")]
    WrongType {
        /// The JSON file.
        path: PathBuf,
        /// The key.
        key: String,
        /// The expected type.
        expected: &'static str,
    },
    /// An image file that cannot be decoded.
    #[error("{path}: not a readable image: {}", in_one_line(cause))]
    Image {
        /// The image file.
        path: PathBuf,
        /// What the decoder says.
        cause: image::ImageError,
    },
    /// An image file on which a decoder panics.
    #[error("{path}: not a readable image: {panic}")]
    Decoder {
        /// The image file.
        path: PathBuf,
        /// The panic.
        panic: Panicked,
    },
    /// An image header with too large a size.
    #[error("{path}: the image is {width} x {height}; at most {MAX_SIDE} pixels are allowed on a side")]
    TooLarge {
        /// The image file.
        path: PathBuf,
        /// Width in the header.
        width: u32,
        /// Height in the header.
        height: u32,
    },
    /// An image whose pixels take too much memory.
    #[error(
        "{path}: the image is {width} x {height}: decoding it takes {} MiB; at most {} MiB are used for a photograph",
        bytes >> 20, most >> 20
    )]
    TooMuch {
        /// The image file.
        path: PathBuf,
        /// Width in the header.
        width: u32,
        /// Height in the header.
        height: u32,
        /// Bytes that decoding takes.
        bytes: u64,
        /// The most that are used.
        most: u64,
    },
    /// An image file that is longer than any image of its size.
    #[error("{path}: the file has {} MiB; of an image{of_size} at most {} MiB are read", length >> 20, most >> 20)]
    LongImage {
        /// The image file.
        path: PathBuf,
        /// Bytes of the file.
        length: u64,
        /// Its size in words, where the header says it.
        of_size: String,
        /// Most bytes that are read.
        most: u64,
    },
    /// An image file that is too short for the size in its header.
    #[error("{path}: the image is {width} x {height}, and its file has only {length} bytes")]
    Hollow {
        /// The image file.
        path: PathBuf,
        /// Width in the header.
        width: u32,
        /// Height in the header.
        height: u32,
        /// Bytes of the file.
        length: u64,
    },
    /// The photograph's size differs from that of its camera.
    #[error("{path}: the image is {width} x {height}, but {declared_in} is for {declared_width} x {declared_height}")]
    SizeMismatch {
        /// The image file.
        path: PathBuf,
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
        /// The source of the other size: a file, with the line or key.
        declared_in: String,
        /// Width of the camera's image.
        declared_width: u32,
        /// Height of the camera's image.
        declared_height: u32,
    },
    /// A file is damaged, or refers to an entry that it does not contain.
    #[error("{path}{place}: {fault}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// What is wrong.
        fault: FileFault,
    },
    /// A camera model that is not supported.
    #[error("{path}{place}: camera model {model} is not supported; the models are {supported}")]
    CameraModel {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// Its name or number.
        model: String,
        /// The names of the supported ones.
        supported: String,
    },
    /// Two keys of a file contradict each other.
    #[error("{path}: {first} and {second} contradict each other: keep the one that is right")]
    Contradiction {
        /// The file.
        path: PathBuf,
        /// A key and its value.
        first: String,
        /// Another one.
        second: String,
    },
    /// A rotation with a scale.
    #[error(
        "{path}{place}: the rotation is scaled by {}: divide its 3x3 block by that, not the camera's centre, or export the \
         cameras without the scale of their object", Short(*scale)
    )]
    Scaled {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The scale.
        scale: f64,
    },
    /// The numbers are not a lens.
    #[error("{path}{place}: {reason}")]
    Lens {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The message of core's check.
        reason: LensError,
    },
    /// Not an array as NumPy writes them.
    #[error("{path}{entry}: not a readable NumPy array: {fault}")]
    Numpy {
        /// The file.
        path: PathBuf,
        /// `: name` of an array in an archive; empty for a file of one array.
        entry: String,
        /// What is wrong.
        fault: NumpyFault,
    },
    /// Not a PLY file that can be read.
    #[error("{path}{place}: not a readable PLY file: {fault}")]
    Ply {
        /// The file.
        path: PathBuf,
        /// The line of its header.
        place: FaultLocation,
        /// What is wrong.
        fault: PlyFault,
    },
    /// A file of Gaussians with another meaning than those that are read, or none.
    #[error("{path}{place}: {problem}")]
    Gaussians {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// What is wrong with it, and the way out.
        problem: String,
    },
    /// Not a zip archive.
    #[error("{path}: not a readable zip archive: {cause}")]
    Zip {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        cause: zip::result::ZipError,
    },
    /// A photograph that must be turned to be upright, where it is ambiguous whether the cameras are for the upright or
    /// the stored picture.
    #[error(
        "{path}: the file says that its pixels must be turned to be upright (EXIF orientation {tag}, {orientation:?}), and the \
         size that the cameras are for does not tell whether they are those of the stored or of the upright picture; save \
         the photograph without the tag"
    )]
    Orientation {
        /// The image file.
        path: PathBuf,
        /// The tag's value, from 2 to 8.
        tag: u8,
        /// What it means.
        orientation: image::metadata::Orientation,
    },
    /// Near and far bound of a view are not an interval.
    #[error("{path}{place}: near {near} and far {far} are not two positive depths, the near one first")]
    Depths {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// The near depth.
        near: f64,
        /// The far depth.
        far: f64,
    },
    /// A reconstructed point is not finite, or too far away.
    #[error(
        "{path}{place}: the point ({}, {}, {}) is not finite, or further than {MAX_COORDINATE:e} from the origin",
        Short(*x), Short(*y), Short(*z)
    )]
    Point {
        /// The file.
        path: PathBuf,
        /// The place in it.
        place: FaultLocation,
        /// Its first coordinate.
        x: f64,
        /// Its second.
        y: f64,
        /// Its third.
        z: f64,
    },
    /// The pixels of a view without a photograph were requested.
    #[error("{path}: view {name:?} is a pose without a photograph")]
    NoPhotograph {
        /// The scene.
        path: PathBuf,
        /// The view's name.
        name: String,
    },
    /// An index past the last view.
    #[error("{path}: there is no view with index {view}, the scene has {view_count}")]
    NoSuchView {
        /// The scene.
        path: PathBuf,
        /// The requested index, from 0.
        view: usize,
        /// Number of views.
        view_count: usize,
    },
}

impl Hinted for SceneError {
    fn hint(&self) -> Option<Hint> {
        match self {
            SceneError::BarePhotographs { .. } => Some(Hint::Poses),
            SceneError::UnclearMasks { .. } => Some(Hint::Masks),
            SceneError::Image { cause: ImageError::Unsupported(problem), .. }
                if problem.format_hint() == ImageFormatHint::Exact(ImageFormat::Tiff) =>
            {
                Some(Hint::BuildWithTiff)
            }
            _ => None,
        }
    }
}

/// Most characters of what a decoder says.
const LONGEST_CAUSE: usize = 300;

/// A message of a decoder: some end in a line break, some list every number that they do not know.
fn in_one_line(cause: &image::ImageError) -> String {
    let line = cause.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(LONGEST_CAUSE) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
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
