//! Scenes with backgrounds, named by a few words: a place, a rig, a seed and a size.

use crate::garden;
use crate::noise::{fractions, words};
use crate::photograph::{depth, photograph};
use crate::rig::Rig;
use crate::room;
use crate::scenery::{Scenery, SceneryError};
use image::RgbImage;
use std::fmt;
use std::str::FromStr;
use viewfuse_core::camera::{Camera, Pinhole, PinholeError};
use viewfuse_core::math::clamp;
use viewfuse_core::pose::PoseError;

/// What is around the cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A table with things on it in a furnished room.
    Room,
    /// The table outdoors: a house, trees, hills and a sky.
    Garden,
}

/// The name is none of a place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a place: room or garden")]
pub struct UnknownPlace(String);

/// Why there are no photographs.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ShootError {
    /// The size of the pictures is unusable.
    #[error("pictures of {} x {} pixels: {source}", size[0], size[1])]
    Size {
        /// What was asked for.
        size: [u32; 2],
        /// Why.
        source: PinholeError,
    },
    /// A camera is unusable.
    #[error("a camera is unusable: {0}")]
    Camera(#[from] PoseError),
    /// The scenery is unusable.
    #[error(transparent)]
    Scenery(#[from] SceneryError),
}

/// Focal length as a part of the pictures' longer side.
const FOCAL: f32 = 0.92;

/// Seed of the sample: a room with many colours and textures.
const SAMPLE_SEED: u64 = 17;

/// Pictures of the sample are so large.
const SAMPLE_SIZE: [u32; 2] = [320, 240];

/// Views of the sample.
const SAMPLE_VIEW_COUNT: u32 = 11;

/// A scenery and the cameras in it. Pictures and depths are made when asked for, each alike whatever was asked before.
#[derive(Clone, Debug, PartialEq)]
pub struct Shoot {
    scenery: Scenery,
    cameras: Vec<Camera>,
    /// A factor on the light of each view.
    exposures: Vec<f32>,
    seed: u32,
}

/// A scene: `count` cameras on a rig in a place, drawn for a seed, with pictures of `[width, height]` pixels.
///
/// # Errors
/// [`ShootError`]; none for a size that a camera can have.
pub fn generate(place: Place, rig: Rig, seed: u64, size: [u32; 2], count: u32) -> Result<Shoot, ShootError> {
    let [width, height] = size;
    let focal = FOCAL * width.max(height) as f32;
    let principal = [0.5 * width as f32, 0.5 * height as f32];
    let pinhole =
        Pinhole::new([focal; 2], principal, width, height).map_err(|source| ShootError::Size { size, source })?;
    let (scenery, walk) = match place {
        Place::Room => (room::room(seed, 0)?, room::WALK),
        Place::Garden => (garden::garden(seed, 0)?, room::WALK),
    };
    let cameras = rig.cameras(&walk, pinhole, count, seed)?;
    let exposures = vec![1.0; cameras.len()];
    Ok(Shoot { scenery, cameras, exposures, seed: seed as u32 })
}

/// The repository's sample of a room, as `tests/data/room` has it: 11 views of 320 x 240 pixels on an arc.
///
/// # Errors
/// None with the constants of this file.
pub fn sample() -> Result<Shoot, ShootError> {
    generate(Place::Room, Rig::Arc, SAMPLE_SEED, SAMPLE_SIZE, SAMPLE_VIEW_COUNT)
}

impl Shoot {
    /// What is photographed.
    pub fn scenery(&self) -> &Scenery {
        &self.scenery
    }

    /// The cameras, in the order of the views.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// The factor on the light of each view: 1 unless [`Shoot::with_exposures`] said otherwise.
    pub fn exposures(&self) -> &[f32] {
        &self.exposures
    }

    /// The same with a camera that sets its own exposure: each view gets a factor between `1 - spread` and `1 + spread` on its
    /// light, drawn for the seed. A spread outside of 0 to 0.9 is taken as the nearer of the two.
    #[must_use]
    pub fn with_exposures(self, spread: f32) -> Shoot {
        let spread = clamp(spread, 0.0, 0.9);
        let exposure = |view: usize| 1.0 + spread * (2.0 * fractions(self.seed, [view as i32, 1, 0])[0] - 1.0);
        Shoot { exposures: (0..self.cameras.len()).map(exposure).collect(), ..self }
    }

    /// The photograph of a view; `None` if there is no such view. Noise in the shadows differs from view to view.
    pub fn photograph(&self, view: usize, rays_per_side: u32) -> Option<RgbImage> {
        let camera = self.cameras.get(view)?;
        let [seed, ..] = words(self.seed, [view as i32, 0, 0]);
        let exposure = *self.exposures.get(view)?;
        Some(photograph(&self.scenery, camera, rays_per_side, exposure, seed))
    }

    /// The exact depth of a view's pixels, as [`depth`] has it; `None` if there is no such view.
    pub fn depth(&self, view: usize) -> Option<Vec<f32>> {
        self.cameras.get(view).map(|camera| depth(&self.scenery, camera))
    }
}

impl Place {
    /// All places.
    pub const ALL: [Place; 2] = [Place::Room, Place::Garden];
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Place::Room => "room",
            Place::Garden => "garden",
        })
    }
}

impl FromStr for Place {
    type Err = UnknownPlace;

    fn from_str(name: &str) -> Result<Place, UnknownPlace> {
        Place::ALL.into_iter().find(|place| place.to_string() == name).ok_or_else(|| UnknownPlace(name.to_owned()))
    }
}
