//! Status codes.

use core::ffi::{CStr, c_char};
use viewfuse_core::pose::PoseError;
use viewfuse_core::weighting::SchemeError;

/// The result of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// Done.
    Ok = 0,
    /// A pointer is null or not aligned.
    Pointer = 1,
    /// A count is 0, larger than the function takes, or larger than the memory.
    Count = 2,
    /// The scheme's formula or choice is not one of those listed.
    Formula = 3,
    /// The scheme's parameter is out of its range.
    Parameter = 4,
    /// An entry of a pose is NaN or infinite.
    PoseNotFinite = 5,
    /// A coordinate of a camera's place is beyond 1e30.
    PoseTooFar = 6,
    /// The last row of a pose is not 0 0 0 1.
    PoseLastRow = 7,
    /// The upper left 3x3 block of a pose is scaled or skewed: an entry of R^T R is more than 1e-3 off the identity's.
    PoseNotRigid = 8,
    /// The 3x3 block of a pose has the determinant -1: an axis is mirrored.
    PoseMirrored = 9,
    /// A weight is negative, NaN or infinite.
    Weight = 10,
    /// A noise level is negative, NaN or infinite, or the levels of a schedule are out of range or in the wrong order.
    NoiseLevel = 11,
}

impl From<PoseError> for Status {
    fn from(error: PoseError) -> Status {
        match error {
            PoseError::NotFinite { .. } => Status::PoseNotFinite,
            PoseError::TooFar => Status::PoseTooFar,
            PoseError::LastRow => Status::PoseLastRow,
            PoseError::NotRigid { .. } | PoseError::NoDirection => Status::PoseNotRigid,
            PoseError::Mirrored => Status::PoseMirrored,
        }
    }
}

impl From<SchemeError> for Status {
    fn from(error: SchemeError) -> Status {
        match error {
            SchemeError::Formula(_) | SchemeError::Choice(_) => Status::Formula,
            SchemeError::Parameter(_) => Status::Parameter,
        }
    }
}

impl Status {
    pub(crate) fn of(result: Result<(), Status>) -> Status {
        match result {
            Ok(()) => Status::Ok,
            Err(status) => status,
        }
    }
}

/// The message of a status, in English, as a static string. Every number is valid input.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub extern "C" fn viewfuse_status_text(status: i32) -> *const c_char {
    let text: &'static CStr = match status {
        0 => c"done",
        1 => c"a pointer is null or not aligned",
        2 => c"a count is 0 or too large",
        3 => c"the scheme's formula or choice is unknown",
        4 => c"the scheme's parameter is out of its range",
        5 => c"an entry of a pose is not finite",
        6 => c"a camera is too far from the origin",
        7 => c"the last row of a pose is not 0 0 0 1",
        8 => c"a pose is scaled or skewed",
        9 => c"a pose has a mirrored axis",
        10 => c"a weight is negative or not finite",
        11 => c"a noise level is out of its range",
        _ => c"no status of viewfuse",
    };
    text.as_ptr()
}
