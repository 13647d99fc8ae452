//! A scene of Gaussians that is there already, as a field: optimised before, or by another program.

use super::covers;
use super::harmonics::terms_of;
use super::picture::{Room, Splatter};
use crate::{About, AnyField, Encoding, Field, FieldError, Prepared, Rendered, Request, Rounded};
use std::path::Path;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::{REST_COUNTS, SH_0};
use viewfuse_core::random::uniform;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, DeviceError};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::rows::{GaussianBlock, HarmonicTerm, Kernel, ParticleState};
use viewfuse_scene::gaussians::{Gaussian, GaussianFile, GaussianScene, MAX_DEGREE};
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::{Scene, SceneError};

/// The field's name: sources play no part in its pictures.
pub const GIVEN: &str = "gaussian-file";
/// Depth from which on Gaussians are seen, in units of the scene's files: that of the published rasteriser, which is
/// what those of other programs were trained with...
const NEAR: f32 = 0.2;
/// ... where what is the nearest in the sources is so many times as far away; otherwise this share of that.
const MIN_FAR: f32 = 2.0;
const NEAR_SHARE: f32 = 0.1;
/// Share of what the sources see that is nearer than what counts as the nearest.
const NEAREST: f64 = 0.01;
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
    /// A unit of the scene's files, in world units ([`viewfuse_scene::SceneFrame`]).
    pub unit: f32,
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
    /// As of [`Splatter::harmonics`].
    harmonics: Option<(D::Buffer<HarmonicTerm>, u32)>,
    room: Room,
}

/// Those of a picture, in the order of their first use: the first one of colours that are the same from everywhere, the
/// second one of others.
const KERNELS: [Kernel; 9] = [
    Kernel::ProjectGaussians,
    Kernel::ProjectParticles,
    Kernel::CountEntries,
    Kernel::SumEntries,
    Kernel::ListEntries,
    Kernel::MarkBins,
    Kernel::SortEntries,
    Kernel::StartTiles,
    Kernel::BlendSplats,
];

/// Here and not where it is asked for, which may be a crate that is not optimised: the code for every device comes with
/// it.
impl From<GivenGaussians> for AnyField {
    fn from(field: GivenGaussians) -> AnyField {
        AnyField::new(field)
    }
}

impl Field for GivenGaussians {
    /// The Gaussians are only drawn.
    fn about(&self) -> About {
        About { is_live: true, draws_all: true, kernels: &KERNELS, ..About::new(GIVEN) }
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        let (usual, nearest) = (NEAR * self.unit, self.nearest_depth(sources));
        let near = if nearest >= MIN_FAR * usual { usual } else { NEAR_SHARE * nearest };
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
        let unit = (1.0 / scene.frame.scale) as f32;
        let GaussianFile { scene, notes } = GaussianFile::open(path, scene)?;
        Ok(GivenGaussians { scene, notes, unit })
    }

    /// The depth that [`NEAREST`] of the Gaussians that the sources see are nearer than; infinite if they see none.
    fn nearest_depth(&self, sources: &SourceImages) -> f32 {
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
        depths.get((depths.len() as f64 * NEAREST) as usize).copied().unwrap_or(f32::INFINITY)
    }
}

impl<D: Device> Prepare<'_, D> {
    /// The Gaussians on the device, where they are taken once, and what makes their pictures.
    fn uploaded(&mut self) -> Result<(&Uploaded<D>, Splatter<'_, D>), DeviceError> {
        let Prepare { device, near, background, scene, .. } = *self;
        let uploaded = match self.uploaded.take() {
            Some(uploaded) => uploaded,
            None => Uploaded::new(device, scene)?,
        };
        let uploaded = self.uploaded.insert(uploaded);
        let harmonics = uploaded.harmonics.as_ref().map(|(terms, count)| (terms, *count));
        Ok((uploaded, Splatter { device, near, background, is_antialiased: scene.is_antialiased, harmonics }))
    }

    fn picture(&mut self, camera: &CameraBlock) -> Result<Rendered, FieldError> {
        let (Uploaded { gaussians, count, room, .. }, splatter) = self.uploaded()?;
        let begun = splatter.begin(gaussians, *count, camera, room)?;
        Ok(splatter.rendered(gaussians, *count, begun, room, MIN_OPACITY)?)
    }
}

impl<'a, D: Device> Prepared<'a> for Prepare<'a, D> {
    fn encoding(&self) -> Encoding {
        Encoding::Used
    }

    fn background(&self) -> Option<[f32; 3]> {
        Some(self.background)
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
        let (Uploaded { gaussians, count, room, .. }, splatter) = self.uploaded()?;
        Ok(Some(splatter.rounded(gaussians, *count, &request.camera.block(0), room, MIN_OPACITY)?))
    }
}

impl<D: Device> Uploaded<D> {
    fn new(device: &D, scene: &GaussianScene) -> Result<Uploaded<D>, DeviceError> {
        let mut blocks = scene.blocks();
        let count = blocks.len();
        // No device has empty buffers, and one of these Gaussians stands in for a state.
        let hidden = GaussianBlock { opacity: -80.0, ..GaussianBlock::default() };
        blocks.resize(count.max(size_of::<ParticleState>() / size_of::<GaussianBlock>()), hidden);
        let term_count = REST_COUNTS[scene.degree.min(MAX_DEGREE) as usize];
        let harmonics = match term_count {
            0 => None,
            _ => Some((device.upload_owned(terms_of(&scene.f_rest, term_count as usize))?, term_count)),
        };
        Ok(Uploaded { gaussians: device.upload_owned(blocks)?, count: count.max(1), harmonics, room: Room::default() })
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
