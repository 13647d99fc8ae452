//! PixelNeRF with weighted views, on any device; the mathematics is in [`viewfuse_core::pixelnerf`] and
//! [`viewfuse_core::network`].
//!
//! Source: Yu, Ye, Tancik, Kanazawa: "pixelNeRF", CVPR 2021, and its official code. The views are combined by weights
//! where the published network takes their mean.

use viewfuse_device::DeviceError;
pub mod architecture;
mod encoder;
mod memory;
mod network;
mod options;
mod parameters;
mod pass;
mod probes;
pub mod reference;
pub mod test_networks;

pub use architecture::{Architecture, Level, Pass};
pub use options::{LEAST_OPACITY, LEAST_SHARE, Omissions, PixelNerfOptions, Sampling};

use super::learned::{default_near_far, over_white};
use super::{Field, FieldError, LeftOut, Rendered};
use encoder::{ViewLatents, encode};
use network::{Network, Views, Workspace};
use parameters::{DeviceParameters, HostParameters};
use pass::{Asked, Renderer, rays_at_once};
use std::cell::OnceCell;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::rays::CastBlock;
use viewfuse_device::{Device, Pixels};
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};
use viewfuse_nn::image::{Image, Size};
use viewfuse_scene::photographs::{SourceImage, SourceImages};
use viewfuse_weighting::sources::SourceWeights;

/// Longest side of the photographs that a network is shown: the size that the published ones were trained on.
pub const SOURCE_SIDE: u32 = 128;
/// A PixelNeRF with its parameters, ready for any device.
pub struct PixelNerf {
    architecture: Architecture,
    parameters: Arc<HostParameters>,
    options: PixelNerfOptions,
    counts: Mutex<Counts>,
}

/// What was done and what was left out so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    views: u64,
    encoded_views: u64,
    latent_rows: u64,
    mapped_rows: u64,
    passes: [Asked; 2],
}

/// Photographs and parameters on a device.
pub struct Prepared<D: Device> {
    parameters: DeviceParameters<D>,
    images: Vec<Image<D>>,
    cameras: Vec<CameraBlock>,
    /// `[view]`: encoded when a target first uses the view.
    latents: Vec<OnceCell<ViewLatents<D>>>,
    near_far: [f32; 2],
    background: [f32; 3],
}

impl PixelNerf {
    /// Reads the network from a checkpoint.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not of this family, or cannot be read.
    pub fn new(checkpoint: &Checkpoint, options: PixelNerfOptions) -> Result<PixelNerf, CheckpointError> {
        let architecture = Architecture::of(checkpoint)?;
        let parameters = Arc::new(HostParameters::read(checkpoint, &architecture)?);
        let options = options.checked();
        Ok(PixelNerf { architecture, parameters, options, counts: Mutex::default() })
    }

    /// Its sizes.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// Its settings.
    pub fn options(&self) -> PixelNerfOptions {
        self.options
    }

    /// The same network with other settings, and nothing counted yet. The parameters are shared.
    pub fn with_options(&self, options: PixelNerfOptions) -> PixelNerf {
        let PixelNerf { architecture, parameters, .. } = self;
        PixelNerf {
            architecture: architecture.clone(),
            parameters: Arc::clone(parameters),
            options: options.checked(),
            counts: Mutex::default(),
        }
    }

    /// The views that a target with these weights asks about.
    fn used_views<D: Device>(&self, prepared: &Prepared<D>, weights: &SourceWeights) -> Vec<usize> {
        let all = !self.options.omissions.unused_views;
        (0..prepared.images.len()).filter(|view| all || weights.get(*view as u32) > 0.0).collect()
    }

    fn encode_view<D: Device>(&self, device: &D, prepared: &Prepared<D>, view: usize) -> Result<(), DeviceError> {
        if prepared.latents[view].get().is_some() {
            return Ok(());
        }
        let maps = self.options.omissions.latent_layers;
        let latents = encode(device, &self.architecture, &prepared.parameters, &prepared.images[view], maps)?;
        if prepared.latents[view].set(latents).is_ok() {
            self.counts().encoded_views += 1;
        }
        Ok(())
    }

    /// A point network, for one of the passes.
    fn network<'a, D: Device>(&'a self, device: &'a D, prepared: &'a Prepared<D>, pass: Pass) -> Network<'a, D> {
        let index = if pass == Pass::Fine && self.architecture.has_fine { 1 } else { 0 };
        Network {
            device,
            architecture: &self.architecture,
            layers: &prepared.parameters.networks[index],
            grids: self.options.omissions.latent_layers.then_some(index),
        }
    }
}

impl<D: Device> Field<D> for PixelNerf {
    type Prepared = Prepared<D>;
    type Latents = ();

    fn name(&self) -> &'static str {
        "pixelnerf"
    }

    fn least_sources(&self) -> usize {
        1
    }

    fn source_side(&self, _picture_side: u32) -> u32 {
        SOURCE_SIDE
    }

    fn memory_estimate(&self, device: &D, source_sizes: &[[u32; 2]]) -> Option<u64> {
        Some(memory::estimate(device, &self.architecture, &self.options, source_sizes))
    }

    fn prepare(&self, device: &D, sources: &SourceImages, _progress: &dyn Progress) -> Result<Prepared<D>, FieldError> {
        let failed = FieldError::Device;
        let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
        let images =
            sources.images.iter().map(|image| upload_image(device, image)).collect::<Result<_, _>>().map_err(failed)?;
        self.counts().views += cameras.len() as u64;
        Ok(Prepared {
            parameters: self.parameters.load(device).map_err(failed)?,
            images,
            cameras: cameras.iter().map(|camera| camera.block(0)).collect(),
            latents: cameras.iter().map(|_| OnceCell::new()).collect(),
            near_far: self.options.sampling.near_far.unwrap_or_else(|| default_near_far(&cameras)),
            background: sources.background,
        })
    }

    fn encode(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        _relevance: &[SourceWeights],
        progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        if self.options.omissions.unused_views {
            return Ok(());
        }
        progress.expect(prepared.images.len());
        for view in 0..prepared.images.len() {
            progress.check()?;
            self.encode_view(device, prepared, view).map_err(FieldError::Device)?;
            progress.step();
        }
        device.finish().map_err(FieldError::Device)
    }

    fn encode_used(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        (): &(),
        weights: &SourceWeights,
        progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        let encoded_views = self.counts().encoded_views;
        for view in self.used_views(prepared, weights) {
            progress.check()?;
            self.encode_view(device, prepared, view).map_err(FieldError::Device)?;
        }
        if self.counts().encoded_views > encoded_views {
            device.finish().map_err(FieldError::Device)?;
        }
        Ok(())
    }

    fn render(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        (): &(),
        weights: &SourceWeights,
        target: &Camera,
        settled: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        let failed = FieldError::Device;
        self.encode_used(device, prepared, &(), weights, progress)?;
        let used = self.used_views(prepared, weights);
        let cameras: Vec<CameraBlock> = used.iter().map(|view| prepared.cameras[*view]).collect();
        let view_weights: Vec<f32> = used.iter().map(|view| weights.get(*view as u32)).collect();
        let views = Views {
            cameras: device.upload(&cameras).map_err(failed)?,
            weights: device.upload(&view_weights).map_err(failed)?,
            latents: used.iter().filter_map(|view| prepared.latents[*view].get()).collect(),
        };
        let [near, far] = prepared.near_far;
        let renderer = Renderer {
            device,
            coarse: self.network(device, prepared, Pass::Coarse),
            fine: self.network(device, prepared, Pass::Fine),
            views: &views,
            sampling: self.options.sampling,
            omissions: self.options.omissions,
            settled,
            cast: CastBlock {
                camera: target.block(0),
                near,
                far,
                pixel_centre: self.architecture.pixel_centre,
                along_axis: 0,
            },
            background: prepared.background,
            progress,
        };
        let (width, height) = (target.pinhole.width(), target.pinhole.height());
        let pixels: Vec<u32> = (0..width * height).collect();
        let maps = self.options.omissions.latent_layers;
        let most_points = pixels.len() * self.options.sampling.coarse_count as usize;
        let mut workspace =
            Workspace::new(device, &self.architecture, used.len(), most_points, maps).map_err(failed)?;
        let mut asked = [Asked::default(); 2];
        let step = self.options.omissions.empty_space;
        let seen = match step > 1 {
            true => {
                let mut probes = Asked::default();
                let seen = renderer.probe(&mut workspace, step, &mut probes)?;
                asked[0].asked += probes.asked;
                Some(seen)
            }
            false => None,
        };
        let at_once = rays_at_once(device, &self.options.sampling);
        progress.expect(pixels.len().div_ceil(at_once));
        let mut tiles: Vec<Pixels<D>> = Vec::new();
        for some in pixels.chunks(at_once) {
            tiles.push(renderer.render(&mut workspace, some, seen.as_ref(), &mut asked)?);
            progress.step();
        }
        self.count(used.len() as u64, &asked);
        let mut rendered = Rendered { colours: Vec::new(), depths: Vec::new(), width, height };
        for tile in tiles {
            rendered.colours.extend(device.download(&tile.colours).map_err(failed)?);
            rendered.depths.extend(device.download(&tile.depths).map_err(failed)?);
        }
        along_axis(&mut rendered, &renderer.cast);
        Ok(rendered)
    }

    fn left_out(&self) -> Vec<LeftOut> {
        let Counts { views, encoded_views, latent_rows, mapped_rows, passes: [coarse, fine] } = *self.counts();
        let Omissions { unused_views, latent_layers, empty_space, empty_rays, empty_parts, hidden_samples, .. } =
            self.options.omissions;
        let line = |what, switch, left_out, of, cost| LeftOut { what, switch, left_out, of, cost };
        let unasked = |pass: Asked| pass.samples.saturating_sub(pass.asked);
        vec![
            line("encoded views", unused_views, views - encoded_views.min(views), views, "nothing"),
            line("latent layers at points", latent_layers, mapped_rows, latent_rows, "rounding"),
            line(
                "first-pass samples",
                empty_space > 1,
                unasked(coarse),
                coarse.samples,
                "objects that pass between the probes; see `viewfuse pareto`",
            ),
            line(
                "second-pass samples",
                empty_rays || empty_parts || hidden_samples,
                unasked(fine),
                fine.samples,
                "what the first pass missed; the light behind is at most the transmittance at which rays end",
            ),
        ]
    }
}

impl PixelNerf {
    fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn count(&self, view_count: u64, asked: &[Asked; 2]) {
        let mut counts = self.counts();
        let rows = view_count * self.architecture.injected_count as u64 * (asked[0].asked + asked[1].asked);
        counts.latent_rows += rows;
        if self.options.omissions.latent_layers {
            counts.mapped_rows += rows;
        }
        for (total, own) in counts.passes.iter_mut().zip(asked) {
            total.samples += own.samples;
            total.asked += own.asked;
        }
    }
}

/// An image over white, as the networks are trained: red, green, blue in `[-1, 1]`.
fn upload_image<D: Device>(device: &D, image: &SourceImage) -> Result<Image<D>, DeviceError> {
    let values: Vec<f32> = image.texels.iter().flat_map(|texel| over_white(*texel)).collect();
    let (width, height) = (image.camera.pinhole.width(), image.camera.pinhole.height());
    Image::upload(device, Size { height, width, channels: 3 }, &values)
}

/// Depths along the rays become depths along the principal axis; rays that meet nothing get 0.
fn along_axis(rendered: &mut Rendered, cast: &CastBlock) {
    let forward = cast.camera.pose.rotate_to_world(0.0, 0.0, 1.0);
    for (pixel, (depth, colour)) in (0..).zip(rendered.depths.iter_mut().zip(&rendered.colours)) {
        let ray = viewfuse_core::rays::cast_ray(cast, pixel);
        let direction = viewfuse_core::Vec3::from_array(ray.direction);
        *depth = if colour[3] >= LEAST_OPACITY { *depth * direction.dot(forward) } else { 0.0 };
    }
}
