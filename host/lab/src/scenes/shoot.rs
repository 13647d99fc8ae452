//! Photographs of a room, named by a seed and a size.

use crate::scenes::noise::words;
use crate::scenes::photograph::{depth, photograph};
use crate::scenes::scenery::Scenery;
use crate::scenes::{rig, room};
use image::RgbImage;
use viewfuse_core::camera::{Camera, Pinhole, PinholeError};
use viewfuse_core::pose::PoseError;

/// Why there are no photographs.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ShootError {
    #[error("pictures of {} x {} pixels: {source}", size[0], size[1])]
    Size { size: [u32; 2], source: PinholeError },
    #[error("a camera is unusable: {0}")]
    Camera(#[from] PoseError),
}

/// Focal length as a part of the pictures' longer side.
const FOCAL: f32 = 0.92;

/// Seed of the sample: a room with many colours and textures.
const SAMPLE_SEED: u64 = 17;

/// Pictures of the sample are so large.
const SAMPLE_SIZE: [u32; 2] = [320, 240];

const SAMPLE_VIEW_COUNT: u32 = 11;

/// A scenery and the cameras in it. Pictures and depths are made when asked for, each alike whatever was asked before.
#[derive(Clone, Debug, PartialEq)]
pub struct Shoot {
    scenery: Scenery,
    cameras: Vec<Camera>,
    seed: u32,
}

/// A room and `count` cameras on an arc in front of its table, drawn for a seed, with pictures of `[width, height]`
/// pixels.
pub fn generate(seed: u64, size: [u32; 2], count: u32) -> Result<Shoot, ShootError> {
    let [width, height] = size;
    let focal = FOCAL * width.max(height) as f32;
    let principal = [0.5 * width as f32, 0.5 * height as f32];
    let pinhole =
        Pinhole::new([focal; 2], principal, width, height).map_err(|source| ShootError::Size { size, source })?;
    let cameras = rig::cameras(&room::WALK, pinhole, count, seed)?;
    Ok(Shoot { scenery: room::room(seed, 0), cameras, seed: seed as u32 })
}

/// The repository's sample of a room, as `tests/data/room` has it: 11 views of 320 x 240 pixels on an arc.
pub fn sample() -> Result<Shoot, ShootError> {
    generate(SAMPLE_SEED, SAMPLE_SIZE, SAMPLE_VIEW_COUNT)
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

    /// The photograph of a view; `None` if there is no such view. Noise in the shadows differs from view to view.
    pub fn photograph(&self, view: usize, rays_per_side: u32) -> Option<RgbImage> {
        let camera = self.cameras.get(view)?;
        let [seed, ..] = words(self.seed, [view as i32, 0, 0]);
        Some(photograph(&self.scenery, camera, rays_per_side, seed))
    }

    /// The exact depth of a view's pixels, as [`depth`] has it; `None` if there is no such view.
    pub fn depth(&self, view: usize) -> Option<Vec<f32>> {
        self.cameras.get(view).map(|camera| depth(&self.scenery, camera))
    }
}
