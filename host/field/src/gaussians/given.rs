//! A scene of Gaussians that is there already, as a field: optimised before, or by another program.

use super::covers;
use super::picture::Splatter;
use crate::{About, Encoding, Field, FieldError, Prepared, Rendered, Request, Rounded};
use std::path::Path;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::SH_0;
use viewfuse_core::random::uniform;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, DeviceError};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::rows::{GaussianBlock, Kernel};
use viewfuse_scene::gaussians::{Gaussian, GaussianFile, GaussianScene};
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::{Scene, SceneError};

/// Depth from which on Gaussians are seen, relative to their median depth in the sources.
const NEAR: f32 = 0.1;
/// Most Gaussians whose depths are looked at.
const MAX_LOOKED_AT: usize = 4096;
/// Opacity below which a pixel has no depth.
const MIN_OPACITY: f32 = 0.5;

/// Pictures of a scene of Gaussians. The sources give their weights, the near bound and the colour behind.
#[derive(Clone, Debug)]
pub struct GivenGaussians {
    /// The Gaussians.
    pub scene: GaussianScene,
    /// What their file says beyond them, told before the first picture.
    pub notes: Vec<String>,
}

/// The same for a scene's sources.
struct Prepare<'a, D: Device> {
    device: &'a D,
    scene: &'a GaussianScene,
    near: f32,
    background: [f32; 3],
    /// The Gaussians as they are on the device, once they are there.
    uploaded: Option<Uploaded<D>>,
}

/// Gaussians on a device.
struct Uploaded<D: Device> {
    gaussians: D::Buffer<GaussianBlock>,
    count: usize,
    /// The camera's centre that their colours are for; those of degree 0 are the same for all cameras.
    centre: Vec3,
}

/// Those of a picture, in the order of their first use.
const KERNELS: [Kernel; 8] = [
    Kernel::ProjectGaussians,
    Kernel::CountEntries,
    Kernel::SumEntries,
    Kernel::ListEntries,
    Kernel::MarkBins,
    Kernel::SortEntries,
    Kernel::StartTiles,
    Kernel::BlendSplats,
];

impl Field for GivenGaussians {
    /// The Gaussians are only drawn.
    fn about(&self) -> About {
        About { is_live: true, kernels: &KERNELS, ..About::new("gaussians") }
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
        let near = NEAR * self.median_depth(sources);
        let background = behind(sources);
        let mut prepared = Prepare { device, scene: &self.scene, near, background, uploaded: None };
        self.notes.iter().for_each(|note| progress.warn(note));
        covers::warning(sources, |camera| prepared.picture(camera))?.iter().for_each(|warning| progress.warn(warning));
        Ok(Box::new(prepared))
    }
}

impl GivenGaussians {
    /// The Gaussians of a file for a scene.
    ///
    /// # Errors
    /// As [`GaussianFile::open`].
    pub fn open(path: &Path, scene: &Scene) -> Result<GivenGaussians, SceneError> {
        let GaussianFile { scene, notes } = GaussianFile::open(path, scene)?;
        Ok(GivenGaussians { scene, notes })
    }

    /// The median depth of the Gaussians that the sources see; 1 if they see none.
    fn median_depth(&self, sources: &SourceImages) -> f32 {
        let count = self.scene.gaussians.len();
        let looked_at = (0..MAX_LOOKED_AT.min(count)).filter_map(|draw| {
            let drawn = if count > MAX_LOOKED_AT { (uniform(0, draw as u32, 0) * count as f32) as usize } else { draw };
            self.scene.gaussians.get(drawn).map(|gaussian| Vec3::from_array(gaussian.position))
        });
        let positions: Vec<Vec3> = looked_at.collect();
        let seen = sources.images.iter().flat_map(|image| {
            let camera = image.camera.block(0);
            positions.iter().map(move |position| camera.project(*position))
        });
        let mut depths: Vec<f32> = seen.filter(|seen| seen.in_image).map(|seen| seen.depth).collect();
        depths.sort_by(f32::total_cmp);
        depths.get(depths.len() / 2).copied().unwrap_or(1.0)
    }
}

impl<'d, D: Device> Prepare<'d, D> {
    /// The Gaussians on the device as this camera sees them. Those that all cameras see alike are taken there once.
    fn uploaded(&mut self, camera: &CameraBlock) -> Result<&Uploaded<D>, DeviceError> {
        let scene = self.scene;
        let is_there = |uploaded: &Uploaded<D>| scene.degree == 0 || uploaded.centre == camera.centre_world();
        let kept = self.uploaded.take().filter(is_there);
        let uploaded = match kept {
            Some(uploaded) => uploaded,
            None => {
                let mut blocks = scene.blocks(camera.centre_world());
                if blocks.is_empty() {
                    // No device has empty buffers.
                    blocks.push(GaussianBlock { opacity: -80.0, ..GaussianBlock::default() });
                }
                Uploaded { gaussians: self.device.upload(&blocks)?, count: blocks.len(), centre: camera.centre_world() }
            }
        };
        Ok(self.uploaded.insert(uploaded))
    }

    fn splatter(&self) -> Splatter<'d, D> {
        let Prepare { device, near, background, scene, .. } = *self;
        Splatter { device, near, background, is_antialiased: scene.is_antialiased }
    }

    fn picture(&mut self, camera: &CameraBlock) -> Result<Rendered, FieldError> {
        let splatter = self.splatter();
        let Uploaded { gaussians, count, .. } = self.uploaded(camera)?;
        Ok(splatter.rendered(gaussians, *count, &[*camera], MIN_OPACITY)?.remove(0))
    }
}

impl<D: Device> Prepared for Prepare<'_, D> {
    fn encoding(&self) -> Encoding {
        Encoding::Used
    }

    fn encode(&mut self, _view: usize, _progress: &dyn Progress) -> Result<(), FieldError> {
        Ok(())
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        progress.check()?;
        self.picture(&request.camera.block(0))
    }

    fn render_rounded(
        &mut self,
        request: &Request<'_>,
        progress: &dyn Progress,
    ) -> Result<Option<Rounded>, FieldError> {
        progress.check()?;
        let (splatter, camera) = (self.splatter(), request.camera.block(0));
        let Uploaded { gaussians, count, .. } = self.uploaded(&camera)?;
        Ok(Some(splatter.rounded(gaussians, *count, &camera, MIN_OPACITY)?))
    }
}

/// Gaussians of one colour in all directions, as a scene that can be written.
pub fn scene_of(gaussians: &[GaussianBlock]) -> GaussianScene {
    let gaussian = |block: &GaussianBlock| Gaussian {
        position: block.position,
        log_scales: block.log_scales,
        rotation: block.rotation,
        opacity: block.opacity,
        f_dc: block.colour.map(|value| (value - 0.5) / SH_0),
    };
    GaussianScene { gaussians: gaussians.iter().map(gaussian).collect(), ..GaussianScene::default() }
}

/// What lies behind Gaussians: the background of sources with silhouettes, otherwise the mean of all photographs.
pub fn behind(sources: &SourceImages) -> [f32; 3] {
    if sources.has_silhouettes { sources.background } else { mean_colour(sources) }
}

/// The mean of what all photographs show. Each is summed by itself, and these in their order, whatever the threads.
fn mean_colour(sources: &SourceImages) -> [f32; 3] {
    let sums = map(sources.images.len(), 1, |view| {
        let sum =
            |channel: usize| sources.images[view].texels.iter().map(|texel| f64::from(texel[channel])).sum::<f64>();
        [0, 1, 2, 3].map(sum)
    });
    let sum = |channel: usize| sums.iter().fold(0.0, |sum, photograph| sum + photograph[channel]);
    [0, 1, 2].map(|channel| (sum(channel) / sum(3).max(1.0)) as f32)
}
