//! The poses of the source views.

use crate::pose::Pose;
use core::fmt;

/// The most source views of a run on a workstation: the `S` of its fixed-size arrays. Firmware chooses its own.
pub const MAX_SOURCES: usize = 256;

/// Why poses cannot be sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SourcesError {
    /// There are no sources.
    Empty,
    /// There are more sources than the capacity.
    TooMany {
        /// How many were given.
        count: u32,
        /// The capacity.
        capacity: u32,
    },
}

impl fmt::Display for SourcesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SourcesError::Empty => f.write_str("there is no source view"),
            SourcesError::TooMany { count, capacity } => {
                write!(f, "there are {count} source views; at most {capacity} fit")
            }
        }
    }
}

impl core::error::Error for SourcesError {}

/// Between one and `S` source poses, in the order of the views.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sources<const S: usize> {
    poses: [Pose; S],
    count: u32,
}

impl<const S: usize> Sources<S> {
    /// The poses of the source views; their order is the order of every weight that comes from them.
    ///
    /// # Errors
    /// [`SourcesError`] if there are none, or more than `S`.
    pub fn new(poses: &[Pose]) -> Result<Sources<S>, SourcesError> {
        const { assert!(S > 0) };
        if poses.is_empty() {
            return Err(SourcesError::Empty);
        }
        if poses.len() > S {
            return Err(SourcesError::TooMany { count: poses.len() as u32, capacity: S as u32 });
        }
        let mut sources = Sources { poses: [Pose::IDENTITY; S], count: poses.len() as u32 };
        let mut view = 0;
        while view < poses.len() {
            sources.poses[view] = poses[view];
            view += 1;
        }
        Ok(sources)
    }

    /// The first `count` poses of an array; `count` is limited to `[1, S]`.
    #[inline]
    pub fn from_array(poses: [Pose; S], count: u32) -> Sources<S> {
        const { assert!(S > 0) };
        Sources { poses, count: count.clamp(1, S as u32) }
    }

    /// How many sources there are: at least 1, at most `S`.
    #[inline]
    pub fn count(&self) -> u32 {
        // Never larger as it is, but said here it saves every loop over the views its checks of bounds.
        self.count.min(S as u32)
    }

    /// The pose of one source, `view < count`.
    #[inline]
    pub fn pose(&self, view: u32) -> &Pose {
        &self.poses[view as usize]
    }
}
