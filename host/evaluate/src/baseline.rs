//! Baselines without a field: copies and warps of the nearest sources. A field must score above them.
//!
//! ```text
//! plane   one scene depth for each target
//! warp    a source as the target would see it if the scene were a plane at that depth
//! ```
//!
//! | row | picture |
//! |---|---|
//! | `nearest copy` | the source whose camera is nearest, as it is |
//! | `warped copy` | the same source, warped by the plane's homography |
//! | `warped blend` | the mean of the four nearest sources, each warped |
//!
//! The plane is perpendicular to the target's principal axis. All arithmetic is in `f64` on the host; values are 8-bit
//! levels, looked up bilinearly and rounded once at the end.

pub mod plane;
mod warp;

pub use warp::WarpedSample;

use image::{Rgb, RgbImage};
use std::fmt;
use viewfuse_core::camera::Camera;
use viewfuse_field::held_out::resampled;
use warp::Homography;

/// A source photograph and the camera of its pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Its camera; width and height are the picture's.
    pub camera: Camera,
    /// Its pixels.
    pub picture: RgbImage,
}

/// A picture computed from the sources without a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Baseline {
    /// The nearest source as it is, resampled to the target's size.
    NearestCopy,
    /// The nearest source warped by the homography of a plane.
    WarpedCopy,
    /// The mean of the [`BLENDED`] nearest sources, each warped.
    WarpedBlend,
}

/// Number of sources that [`Baseline::WarpedBlend`] uses.
pub const BLENDED: usize = 4;

impl Baseline {
    /// All baselines, in the order of their rows.
    pub const ALL: [Baseline; 3] = [Baseline::NearestCopy, Baseline::WarpedCopy, Baseline::WarpedBlend];

    /// The name of its row.
    pub const fn name(self) -> &'static str {
        match self {
            Baseline::NearestCopy => "nearest copy",
            Baseline::WarpedCopy => "warped copy",
            Baseline::WarpedBlend => "warped blend",
        }
    }

    /// Whether a row of this name is a baseline and not a scheme.
    pub fn is_named(row: &str) -> bool {
        Baseline::ALL.iter().any(|baseline| baseline.name() == row)
    }

    /// The largest number of sources that it uses, nearest first.
    pub const fn source_count(self) -> usize {
        match self {
            Baseline::NearestCopy | Baseline::WarpedCopy => 1,
            Baseline::WarpedBlend => BLENDED,
        }
    }

    /// The picture at a target, of the target's size. `nearest` are sources, the nearest to the target first; `depth`
    /// is that of the plane along the target's principal axis in world units, infinite for the homography of a pure
    /// rotation. Without sources the picture is black.
    ///
    /// Where the plane's point lies outside a source, the copy takes the source's nearest pixel. The blend is the mean
    /// of those sources that show the point, and where none does, the nearest source's nearest pixel.
    pub fn picture(self, nearest: &[&Shot], target: &Camera, depth: f64) -> RgbImage {
        let (width, height) = (target.pinhole.width(), target.pinhole.height());
        let Some((first, _)) = nearest.split_first() else { return RgbImage::new(width, height) };
        if self == Baseline::NearestCopy {
            return resampled(&first.picture, (width, height)).into_owned();
        }
        let taken = &nearest[..nearest.len().min(self.source_count())];
        let warps: Vec<(&Shot, Homography)> =
            taken.iter().map(|shot| (*shot, Homography::of_plane(target, &shot.camera, depth))).collect();
        RgbImage::from_fn(width, height, |column, row| {
            let looks = warps.iter().map(|(shot, warp)| warp.look(&shot.picture, column, row));
            Rgb(mean_of_seen(looks).map(|level| (level + 0.5) as u8))
        })
    }
}

impl fmt::Display for Baseline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The mean of the samples that are inside their picture; if none is, the first sample. Without samples 0.
fn mean_of_seen(looks: impl Iterator<Item = WarpedSample>) -> [f64; 3] {
    let (mut sum, mut count, mut first) = ([0.0; 3], 0_u32, None);
    for look in looks {
        if look.inside {
            count += 1;
            sum.iter_mut().zip(look.levels).for_each(|(sum, level)| *sum += level);
        }
        first.get_or_insert(look.levels);
    }
    match count {
        0 => first.unwrap_or_default(),
        _ => sum.map(|sum| sum / f64::from(count)),
    }
}
