//! A bound on a picture's error or on its time: chooses how much of a field's work is needed, from cheap measurements
//! on this scene, like the step-size controller of a solver for stiff equations.
//!
//! ```text
//! check        the difference of a picture from the exact one, estimated from few pixels
//! embedded     the same from two pictures of different efforts, for fields whose pixels are not independent
//! deadline     progress of what is tried: no pieces, and cancelled where it would come too late
//! expected     the errors and times that efforts are expected to have
//! controller   the search, and what it keeps from picture to picture
//! ```
//!
//! The search begins at the cheapest effort ([`Prepared::efforts`](crate::Prepared::efforts)) whose typical error,
//! scaled by what the pictures before had, is below the bound. The picture is then checked on pixels drawn for this
//! purpose, which chose nothing; where the check fails the next effort follows. What omits something and is not cheap
//! is first tried on few pixels, by which it can only be rejected. The error is the root mean square over
//! pixels and channels of the difference from the picture of the exact effort, before rounding, colours from 0 to 1.

mod check;
mod controller;
mod deadline;
mod embedded;
mod expected;

pub(crate) use controller::{Controller, View};

use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What a picture must keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// The largest root mean square difference from the exact picture, colours from 0 to 1.
    Error(f32),
    /// The longest time for a picture, encoding of sources included that no picture before used.
    Time(Duration),
}

/// What a learned field's pictures keep where nothing says how much of its work is omitted: 45 dB to the exact picture.
/// What may be omitted of one network shows in another.
pub const DEFAULT_BOUND: Bound = Bound::Error(0.005_623_413);

/// How a picture keeps a bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// The bound on the error; null if the time is bounded.
    pub most_error: Option<f32>,
    /// The bound on the time in seconds; null if the error is bounded.
    pub most_seconds: Option<f64>,
    /// The effort of the picture.
    pub effort: String,
    /// Its estimated error, root mean square; null if it was not estimated.
    pub error: Option<Estimate>,
    /// Seconds from the request to the picture, all trials included.
    pub seconds: f64,
    /// Whether the bound is kept, by the upper end of the estimate or by the clock.
    pub is_kept: bool,
    /// The efforts that were tried before.
    pub tried: Vec<Tried>,
}

/// An estimate of a picture's error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// The error is below this in 19 of 20 pictures: the bound, where drawn pixels say that it is kept.
    pub upper: f64,
    /// Exact pixels that it was made from; 0 if it was made from two pictures of different efforts, or is exact.
    pub pixels: usize,
}

/// An effort that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// Its name.
    pub effort: String,
    /// The estimated error of its picture; null if there was no time for it.
    pub error: Option<Estimate>,
}

impl Estimate {
    /// That of the exact picture.
    pub const EXACT: Estimate = Estimate { value: 0.0, upper: 0.0, pixels: 0 };
}
