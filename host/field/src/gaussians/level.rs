//! The source views at the sizes of the pyramid.

use super::loss::Structure;
use std::sync::OnceLock;
use viewfuse_core::camera::{CameraBlock, PinholeError};
use viewfuse_device::parallel::{map, try_map};
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// A source view at a level.
#[derive(Clone, Debug)]
pub(super) struct LevelView {
    pub(super) camera: CameraBlock,
    /// Red, green and blue over the background, and opacity: `[channel][row][column]`.
    pub(super) channels: [Vec<f32>; 4],
    /// What the host compares the photograph by, once for all iterations, from when it does.
    structure: OnceLock<Vec<Structure>>,
    /// `[row][column]`: 0 where the lens saw nothing or pixels do not count, 1 elsewhere; empty if all count.
    pub(super) seen: Vec<f32>,
    /// Whether the opacity is a silhouette.
    pub(super) has_silhouette: bool,
}

/// All source views at a level: `1 / 2^level` of the finest one's size.
pub(super) fn level(images: &SourceImages, finest_side: u32, level: u32) -> Result<Vec<LevelView>, PinholeError> {
    let side = (finest_side >> level).max(8);
    try_map(images.images.len(), |view| Ok(LevelView::of(&images.images[view].reduced(side)?, images)))
}

impl LevelView {
    fn of(image: &SourceImage, images: &SourceImages) -> LevelView {
        let camera = image.camera.block(0);
        let behind = images.background;
        let channel = |channel: usize| -> Vec<f32> {
            let over = |texel: &[f32; 4]| match (channel, images.has_silhouettes) {
                (3, _) => texel[3],
                (_, true) => texel[channel] + (1.0 - texel[3]) * behind[channel],
                (_, false) => texel[channel],
            };
            image.texels.iter().map(over).collect()
        };
        let channels = [channel(0), channel(1), channel(2), channel(3)];
        let hidden = !images.has_silhouettes && channels[3].iter().any(|alpha| *alpha < 0.999);
        let seen = match hidden {
            true => channels[3].iter().map(|alpha| if *alpha < 0.999 { 0.0 } else { 1.0 }).collect(),
            false => Vec::new(),
        };
        LevelView { camera, channels, structure: OnceLock::new(), seen, has_silhouette: images.has_silhouettes }
    }

    /// The photograph's windows: red, green, blue.
    pub(super) fn structure(&self) -> &[Structure] {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let of = |channel: usize| Structure::of(&self.channels[channel], width, height);
        self.structure.get_or_init(|| map(3, 1, of))
    }
}
