//! Places in files, and the parts of [`super::SceneFault`]: faults of images, intrinsics, files, arrays and PLY
//! headers.

use std::fmt;
use std::path::PathBuf;

use image::ImageError;
use image::metadata::Orientation;
use thiserror::Error;
use viewfuse_core::camera::{LONGEST_FOCAL, PinholeError, SHORTEST_FOCAL};
use viewfuse_core::lens::LensError;
use viewfuse_job::panics::Panicked;

use super::MAX_SIDE;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FilePlace {
    /// The file, or a folder.
    pub path: PathBuf,
    /// Where in it.
    pub location: FaultLocation,
}

impl FilePlace {
    /// A file as a whole, or a folder.
    pub fn file(path: impl Into<PathBuf>) -> FilePlace {
        FilePlace { path: path.into(), location: FaultLocation::File }
    }

    /// A line of a file, counted from 1.
    pub fn line(path: impl Into<PathBuf>, line: usize) -> FilePlace {
        FilePlace { path: path.into(), location: FaultLocation::Line(line) }
    }

    /// A key of a file.
    pub fn key(path: impl Into<PathBuf>, key: impl Into<String>) -> FilePlace {
        FilePlace { path: path.into(), location: FaultLocation::Key(key.into()) }
    }
}

impl fmt::Display for FilePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.path.display(), self.location)
    }
}

/// Where in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultLocation {
    /// The file as a whole.
    File,
    /// A line, counted from 1.
    Line(usize),
    /// A line and a column, counted from 1.
    Column(usize, usize),
    /// A byte of a binary file, counted from 0.
    Byte(usize),
    /// A key of a JSON file, such as `frames[3].fl_x`; arrays count from 0.
    Key(String),
}

impl fmt::Display for FaultLocation {
    /// The text after the path: nothing, `:12`, or `: frames[3].fl_x`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FaultLocation::File => Ok(()),
            FaultLocation::Line(line) => write!(f, ":{line}"),
            FaultLocation::Column(line, column) => write!(f, ":{line}:{column}"),
            FaultLocation::Byte(at) => write!(f, ": byte {at}"),
            FaultLocation::Key(key) => write!(f, ": {key}"),
        }
    }
}

/// Shows a number as it is, or with an exponent if it would have many zeros.
pub(super) struct Short(pub(super) f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.abs() {
            0.0 | 1.0e-4..1.0e12 => write!(f, "{}", self.0),
            _ => write!(f, "{:e}", self.0),
        }
    }
}

/// Why an image file cannot be used.
#[derive(Debug, Error)]
pub enum ImageFault {
    /// It cannot be decoded.
    #[error("not a readable image: {}", in_one_line(.0))]
    Unreadable(Box<ImageError>),
    /// It is empty.
    #[error("the file is empty")]
    Empty,
    /// It is of a format that is not read, whatever its name says.
    #[error("it is {0}, which is not read: JPEG and PNG are")]
    Kind(&'static str),
    /// A decoder panics on it.
    #[error("not a readable image: {0}")]
    Decoder(Panicked),
    /// A JPEG that ends before its picture does: decoders would fill the rest with grey.
    #[error("the file ends before the picture does")]
    CutShort,
    /// A JPEG whose data are no picture from somewhere on, and what its decoder says.
    #[error(
        "the file is damaged ({0}): programs that show it make up the rest of the picture; copy it again, or exclude it"
    )]
    Damaged(String),
    /// Its header has too large a size.
    #[error("the image is {0} x {1}; at most {MAX_SIDE} pixels are allowed on a side")]
    TooLarge(u32, u32),
    /// Its pixels take too much memory for its width and height: the bytes that decoding takes, and the most that are
    /// used.
    #[error(
        "the image is {} x {}: decoding it takes {} MiB; at most {} MiB are used for a photograph",
        .0[0], .0[1], .1 >> 20, .2 >> 20
    )]
    TooMuch([u32; 2], u64, u64),
    /// It has more bytes than are read of any image of its size, which is in words, where the header says it.
    #[error("the file has {} MiB; of an image{} at most {} MiB are read", .0 >> 20, .1, .2 >> 20)]
    TooLong(u64, String, u64),
    /// It is too short for the width and height in its header: its bytes.
    #[error("the image is {} x {}, and its file has only {} bytes", .0[0], .0[1], .1)]
    Hollow([u32; 2], u64),
    /// Its size is not that of its camera.
    #[error("the image is {} x {}, but {declared_in} is for {} x {}", size[0], size[1], declared[0], declared[1])]
    SizeMismatch {
        /// Width and height of the image.
        size: [u32; 2],
        /// Those of the camera's images.
        declared: [u32; 2],
        /// The source of the other size: a file, with the line or key.
        declared_in: String,
    },
    /// It must be turned to be upright, and it is ambiguous whether the cameras are for the upright or the stored
    /// picture.
    #[error(
        "the file says that its pixels must be turned to be upright (EXIF orientation {}, {:?}), and the \
         size that the cameras are for does not tell whether they are those of the stored or of the upright picture; \
         save the photograph without the tag", .0.to_exif(), .0
    )]
    Orientation(Orientation),
}

/// Most characters of what a decoder says.
const MAX_CAUSE: usize = 300;

/// A message of a decoder: some end in a line break, some list every number that they do not know.
fn in_one_line(cause: &ImageError) -> String {
    let line = cause.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MAX_CAUSE) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}

/// Why numbers from a file are not a camera that is read.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum IntrinsicsFault {
    /// A focal length, along x or y, is out of range.
    #[error("focal lengths {} and {} are not both from {SHORTEST_FOCAL} to {LONGEST_FOCAL:e} \
        pixels", Short(*.0), Short(*.1))]
    Focal(f64, f64),
    /// A coordinate of the principal point, to the right or downwards, is out of range.
    #[error(
        "principal point ({}, {}) is further than {LONGEST_FOCAL:e} pixels from the corner of the \
            image", Short(*.0), Short(*.1)
    )]
    Principal(f64, f64),
    /// A width or height is not a whole number of pixels from 1 to 2^20.
    #[error("image size {0} x {1} is not two whole numbers from 1 to 1048576")]
    Size(f64, f64),
    /// An opening angle is not between 0 and pi.
    #[error("opening angle {0} is not between 0 and pi radians")]
    Angle(f64),
    /// The image axes are not at right angles: element (0, 1) of K is not 0.
    #[error("the skew {0} of K is not 0; only square image axes are supported")]
    Skew(f64),
    /// A projection of 3 x 4 numbers that is singular.
    #[error("the projection is singular: it has no centre")]
    Projection,
    /// The matrix is not upper triangular with a last row of `0 0 1`.
    #[error("K does not have the form fx 0 cx / 0 fy cy / 0 0 1")]
    Form,
    /// The coefficients are not a lens.
    #[error("{0}")]
    Lens(LensError),
    /// A key, and its value, of a lens that is not supported.
    #[error(
        "{0} is {1}: this lens is not supported; undistort the photographs first, for example \
         with COLMAP's image_undistorter, and use the cameras that it writes"
    )]
    Distorted(String, String),
    /// A camera model that is not supported, and the names of those that are.
    #[error("camera model {0} is not supported; the models are {1}")]
    CameraModel(String, String),
}

impl IntrinsicsFault {
    /// The fault that core reports for these numbers, with their values.
    pub(super) fn from_pinhole(error: PinholeError, focal: [f64; 2], principal: [f64; 2], size: [u32; 2]) -> Self {
        match error {
            PinholeError::Focal => IntrinsicsFault::Focal(focal[0], focal[1]),
            PinholeError::Principal => IntrinsicsFault::Principal(principal[0], principal[1]),
            PinholeError::Size => IntrinsicsFault::Size(size[0].into(), size[1].into()),
        }
    }
}

/// What is wrong with what a file holds.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FileFault {
    /// A word, shortened if it is long, where a number should be.
    #[error("{0:?} is not a number")]
    NotANumber(String),
    /// NaN, an infinity, or a number too large to hold.
    #[error("{0:?} is not a finite number")]
    NotFinite(String),
    /// A number that must be whole and not negative is not.
    #[error("{0:?} is not a whole number")]
    NotWhole(String),
    /// Too few or too many numbers (or rows).
    #[error("found {found} {of} instead of {expected}")]
    WrongCount {
        /// The counted items.
        of: &'static str,
        /// The expected count.
        expected: usize,
        /// The count found.
        found: usize,
    },
    /// Not JSON: what the parser says.
    #[error("not valid JSON: {0}")]
    Json(String),
    /// A required key is missing.
    #[error("{0} is missing")]
    MissingKey(String),
    /// A key holds another kind of value than this one.
    #[error("{0} must be {1}")]
    WrongType(String, &'static str),
    /// Two keys, each with its value, contradict each other.
    #[error("{0} and {1} contradict each other: keep the one that is right")]
    Contradiction(String, String),
    /// Not a table of CSV: what the parser says.
    #[error("not a table of comma-separated values: {0}")]
    Table(String),
    /// A column of a table of poses is missing, unknown, or there twice; and the columns that there can be.
    #[error("{0}; the columns are {1}")]
    Columns(String, &'static str),
    /// A row of a table of poses is no pose, or has the name of another one: why.
    #[error("{0}")]
    Row(String),
    /// It ends too early: after so many bytes, inside this.
    #[error("ends after {0} bytes, inside {1}")]
    Truncated(usize, &'static str),
    /// So many bytes follow its expected end.
    #[error("{0} bytes are left over")]
    Surplus(usize),
    /// Its header states more entries of a kind than the file can hold: how many, and how many it can.
    #[error("announces {1} {0}; the file has room for {2}")]
    NoRoom(&'static str, u64, usize),
    /// What should be a text is not UTF-8.
    #[error("{0} is not UTF-8 text")]
    NotText(&'static str),
    /// Two entries of a kind have one number.
    #[error("there are two {0} with the number {1}")]
    DuplicateId(&'static str, u64),
    /// A reference to an entry of a kind that does not exist.
    #[error("there is no {0} with the number {1}")]
    NoSuchId(&'static str, u64),
}

/// Why bytes are not an array of NumPy's.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NumpyFault {
    /// The magic number is missing.
    #[error("it does not begin with \\x93NUMPY")]
    Magic,
    /// An unknown version of the format.
    #[error("its format has version {0}; 1 to 3 are read")]
    Version(u8),
    /// The header or the numbers are cut off.
    #[error("it ends too early for what its header says")]
    Truncated,
    /// A key of the header is missing or wrong.
    #[error("its header is damaged at {0}")]
    Header(&'static str),
    /// Not floating point numbers.
    #[error("it holds elements of type {0:?}; <f4 and <f8 are read")]
    Kind(String),
    /// NaN or an infinity, and its index in the order of the file, from 0.
    #[error("element {0} is {1}")]
    NotFinite(usize, f64),
    /// An array of an archive is too large for cameras.
    #[error("it is larger than 16 MiB")]
    TooLarge,
    /// Two arrays of one name.
    #[error("the archive holds it twice")]
    Twice,
}

/// Why bytes are not a PLY file that can be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PlyFault {
    /// The first line is another one.
    #[error("the first line is not ply")]
    Magic,
    /// The header has no end.
    #[error("the header does not end")]
    NoEnd,
    /// Text, or big-endian numbers.
    #[error("the format is {0:?}; binary_little_endian 1.0 is read")]
    Format(String),
    /// A line that a header does not have there.
    #[error("{0:?} is no line of a header")]
    Line(String),
    /// A property before the first element.
    #[error("a property before the first element")]
    NoElement,
    /// An unknown type.
    #[error("there is no type {0:?}")]
    Type(String),
    /// Two properties of one name.
    #[error("property {0} is there twice")]
    Twice(String),
    /// A list, where rows must have one length.
    #[error("element {0} has a list; rows of one length are read")]
    List(String),
    /// The element that is needed is missing.
    #[error("there is no element {0}")]
    NoSuchElement(&'static str),
    /// Coefficients of no degree of spherical harmonics.
    #[error("there are {0} properties f_rest_; degrees 0 to 3 have 0, 9, 24 or 45")]
    RestCount(usize),
}
