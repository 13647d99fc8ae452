//! Scenes with backgrounds, named by a few words: a place, a rig, a seed and a size.

use crate::garden;
use crate::noise::{fractions, words};
use crate::photograph::{depth, photograph_through};
use crate::rig::Rig;
use crate::room;
use crate::scenery::{Scenery, SceneryError};
use image::RgbImage;
use std::fmt;
use std::str::FromStr;
use viewfuse_core::camera::{Camera, Pinhole, PinholeError};
use viewfuse_core::lens::Lens;
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
    /// A lens folds over inside the pictures.
    #[error("the lens {0:?} shows some points of the pictures twice or not at all")]
    Lens([f64; 8]),
    /// The scenery is unusable.
    #[error(transparent)]
    Scenery(#[from] SceneryError),
}

/// Focal length as a part of the pictures' longer side.
const FOCAL: f32 = 0.92;

/// Distance of a corner and where the lens bends the corner's ray to, normalised, above which the lens folds over.
const MAX_RESIDUAL: f64 = 1.0e-6;

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
    lens: Option<Lens>,
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
    Ok(Shoot { scenery, cameras, exposures, lens: None, seed: seed as u32 })
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

    /// The same with a lens that is zoomed: each view gets a factor between `1 - spread` and `1 + spread` on its focal lengths,
    /// drawn for the seed. A spread outside of 0 to 0.5 is taken as the nearer of the two.
    ///
    /// # Errors
    /// [`ShootError::Size`]; none for a spread of 0.5 or less.
    pub fn with_focals(self, spread: f32) -> Result<Shoot, ShootError> {
        let spread = clamp(spread, 0.0, 0.5);
        let zoomed = |(view, camera): (usize, &Camera)| {
            let factor = 1.0 + spread * (2.0 * fractions(self.seed, [view as i32, 2, 0])[0] - 1.0);
            let pinhole = camera.pinhole;
            let size = [pinhole.width(), pinhole.height()];
            let focal = pinhole.focal().map(|focal| focal * factor);
            match Pinhole::new(focal, pinhole.principal(), size[0], size[1]) {
                Ok(pinhole) => Ok(Camera { pinhole, ..*camera }),
                Err(source) => Err(ShootError::Size { size, source }),
            }
        };
        let cameras = self.cameras.iter().enumerate().map(zoomed).collect::<Result<_, _>>()?;
        Ok(Shoot { cameras, ..self })
    }

    /// The same through a lens, which all views share. Depths stay those of the pinholes.
    ///
    /// # Errors
    /// [`ShootError::Lens`] if it folds over inside a picture.
    pub fn with_lens(self, lens: Lens) -> Result<Shoot, ShootError> {
        let folds = |camera: &Camera| {
            let pinhole = &camera.pinhole;
            let ([focal_x, focal_y], [x, y]) = (pinhole.focal(), pinhole.principal());
            let (right, below) = (pinhole.width() as f32 - x, pinhole.height() as f32 - y);
            let corners = [[-x, -y], [right, -y], [-x, below], [right, below]];
            let misses = |[x, y]: [f32; 2]| {
                let corner = [f64::from(x / focal_x), f64::from(y / focal_y)];
                let straight = lens.undistort(corner);
                let radius = straight.point[0].hypot(straight.point[1]);
                !(straight.residual <= MAX_RESIDUAL) || lens.reach(2.0 * radius + 1.0e-9) < radius
            };
            corners.into_iter().any(misses)
        };
        match self.cameras.iter().any(folds) {
            true => Err(ShootError::Lens(lens.coefficients())),
            false => Ok(Shoot { lens: Some(lens).filter(|lens| !lens.is_pinhole()), ..self }),
        }
    }

    /// The lens, if it is none of a pinhole.
    pub fn lens(&self) -> Option<&Lens> {
        self.lens.as_ref()
    }

    /// The photograph of a view; `None` if there is no such view. Noise in the shadows differs from view to view.
    pub fn photograph(&self, view: usize, rays_per_side: u32) -> Option<RgbImage> {
        let camera = self.cameras.get(view)?;
        let [seed, ..] = words(self.seed, [view as i32, 0, 0]);
        let exposure = *self.exposures.get(view)?;
        Some(photograph_through(&self.scenery, camera, self.lens.as_ref(), rays_per_side, exposure, seed))
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
