//! Parts of [`super::SceneError`]: the place in a file, and faults of intrinsics, files, arrays and PLY headers.

use std::fmt;

use thiserror::Error;
use viewfuse_core::camera::{LONGEST_FOCAL, PinholeError, SHORTEST_FOCAL};

/// The place of a fault in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultLocation {
    /// The file as a whole.
    File,
    /// A line, counted from 1.
    Line(usize),
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

/// Why numbers from a file are not a pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum IntrinsicsFault {
    /// A focal length is out of range.
    #[error("focal lengths {} and {} are not both from {SHORTEST_FOCAL} to {LONGEST_FOCAL:e} pixels", Short(*x), Short(*y))]
    Focal {
        /// Focal length along x.
        x: f64,
        /// Focal length along y.
        y: f64,
    },
    /// A coordinate of the principal point is out of range.
    #[error(
        "principal point ({}, {}) is further than {LONGEST_FOCAL:e} pixels from the corner of the image", Short(*x), Short(*y)
    )]
    Principal {
        /// Coordinate to the right.
        x: f64,
        /// Coordinate downwards.
        y: f64,
    },
    /// A width or height is not a whole number of pixels from 1 to 2^20.
    #[error("image size {width} x {height} is not two whole numbers from 1 to 1048576")]
    Size {
        /// Width as stated in the file.
        width: f64,
        /// Height as stated in the file.
        height: f64,
    },
    /// An opening angle is not between 0 and pi.
    #[error("opening angle {angle} is not between 0 and pi radians")]
    Angle {
        /// The angle as stated in the file.
        angle: f64,
    },
    /// The image axes are not at right angles.
    #[error("the skew {skew} of K is not 0; only square image axes are supported")]
    Skew {
        /// Element (0, 1) of the matrix.
        skew: f64,
    },
    /// A projection of 3 x 4 numbers that is singular.
    #[error("the projection is singular: it has no centre")]
    Projection,
    /// The matrix is not upper triangular with a last row of `0 0 1`.
    #[error("K does not have the form fx 0 cx / 0 fy cy / 0 0 1")]
    Form,
}

impl IntrinsicsFault {
    /// The fault that core reports for these numbers, with their values.
    pub(super) fn from_pinhole(error: PinholeError, focal: [f64; 2], principal: [f64; 2], size: [u32; 2]) -> Self {
        match error {
            PinholeError::Focal => IntrinsicsFault::Focal { x: focal[0], y: focal[1] },
            PinholeError::Principal => IntrinsicsFault::Principal { x: principal[0], y: principal[1] },
            PinholeError::Size => IntrinsicsFault::Size { width: size[0].into(), height: size[1].into() },
        }
    }
}

/// What is wrong with a file that is damaged.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FileFault {
    /// It ends too early.
    #[error("ends after {length} bytes, inside {of}")]
    Truncated {
        /// Its length in bytes.
        length: usize,
        /// What is cut off.
        of: &'static str,
    },
    /// Data follows its expected end.
    #[error("{left} bytes are left over")]
    LeftOver {
        /// How many bytes.
        left: usize,
    },
    /// Its header states more entries than the file can hold.
    #[error("announces {count} {of}; the file has room for {most}")]
    NoRoom {
        /// What is counted.
        of: &'static str,
        /// The stated count.
        count: u64,
        /// The largest possible count.
        most: usize,
    },
    /// A text in a binary file is not UTF-8.
    #[error("{of} is not UTF-8 text")]
    NotText {
        /// What it should be.
        of: &'static str,
    },
    /// A number that must be whole and not negative is not.
    #[error("{word:?} is not a whole number")]
    NotWhole {
        /// The word.
        word: String,
    },
    /// Two entries have one number.
    #[error("there are two {of} with the number {id}")]
    DuplicateId {
        /// What they are.
        of: &'static str,
        /// The number.
        id: u64,
    },
    /// A reference to an entry that does not exist.
    #[error("there is no {of} with the number {id}")]
    NoSuchId {
        /// What is referred to.
        of: &'static str,
        /// The number.
        id: u64,
    },
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
    /// NaN or an infinity.
    #[error("element {index} is {value}")]
    NotFinite {
        /// Its index in the order of the file, from 0.
        index: usize,
        /// The number.
        value: f64,
    },
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
