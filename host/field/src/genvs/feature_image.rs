//! A target's feature image from volumes: rays at half the resolution, look-ups in every view's volume, fusion of the
//! views, the point network, compositing; then bilinear upsampling.
//!
//! Source: `pixel_nerf_net.py`, with the mean over views replaced by weights.

use super::ray_sampling::RaySampling;
use super::volume::Volume;
use crate::FieldError;
use crate::finite::check_finite_on;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::depths::CoarseBlock;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::rays::{CastBlock, PlaceBlock};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::genvs::{FeatureBlock, VolumeBlock};
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::linear::{Linear, LinearOptions};
use viewfuse_nn::loader::Loader;
use viewfuse_nn::resample::upsample;
use viewfuse_nn::scratch::Scratch;

/// Rays that the CPU computes at once: their points' activations stay in its caches.
const MIN_RAYS: usize = 64;
/// Length of the last sample as published: any density there is opaque.
pub const LAST_LENGTH: f32 = 1.0e10;

/// The views that a target uses.
pub(super) struct Views<'a, D: Device> {
    /// Their cameras; width and height are those of the encoded images.
    pub(super) cameras: D::Buffer<CameraBlock>,
    /// Their weights, which sum to 1.
    pub(super) weights: D::Buffer<f32>,
    /// Their volumes.
    pub(super) volumes: Vec<&'a Volume<D>>,
}

/// The point network on a device.
pub(super) struct PointNetwork<D: Device> {
    layers: [Linear<D>; 3],
    /// Features of a point.
    pub(super) features: u32,
    width: u32,
}

impl<D: Device> PointNetwork<D> {
    /// Loads it for `features` of a point and hidden layers of `width`.
    pub(super) fn load(loader: &Loader<'_, D>, features: u32, width: u32) -> Result<PointNetwork<D>, FieldError> {
        let layer = |index: usize| loader.linear(&format!("mlp.layers.{index}"));
        Ok(PointNetwork { layers: [layer(0)?, layer(1)?, layer(2)?], features, width })
    }

    /// Density and a residual of each feature, `raw[point][1 + feature]`, from `fused[point][feature]`; not rectified.
    pub(super) fn run(
        &self,
        device: &D,
        point_count: u32,
        fused: &D::Buffer<f32>,
        hidden: &mut [D::Buffer<f32>; 2],
        raw: &mut D::Buffer<f32>,
    ) -> Result<(), DeviceError> {
        let rectified = LinearOptions::RELU;
        let [first, second, third] = &self.layers;
        let [inside, next] = hidden;
        first.run(device, point_count, rectified, fused, None, inside)?;
        second.run(device, point_count, rectified, inside, None, next)?;
        third.run(device, point_count, LinearOptions::PLAIN, next, None, raw)
    }

    /// Buffers for the hidden layers at this many points.
    pub(super) fn hidden(&self, device: &D, point_count: usize) -> Result<[D::Buffer<f32>; 2], DeviceError> {
        let hidden = || device.zeros(point_count * self.width as usize);
        Ok([hidden()?, hidden()?])
    }
}

/// A target's feature image `[row][column][feature]`; its rows and columns are even.
pub(super) fn render<D: Device>(
    device: &D,
    scratch: &mut Scratch<'_, D>,
    network: &PointNetwork<D>,
    views: &Views<'_, D>,
    target: &CameraBlock,
    ray_sampling: &RaySampling,
    progress: &dyn Progress,
) -> Result<Image<D>, FieldError> {
    let half = Size { height: target.height / 2, width: target.width / 2, channels: network.features };
    let at_once = (device.busy_elements() / ray_sampling.sample_count as usize).max(MIN_RAYS);
    // The buffer of the looked-up features of all views is bound as a whole.
    let a_ray = ray_sampling.sample_count as usize * network.features as usize * views.volumes.len();
    let at_once = at_once.min(device.most_elements::<f32>() / a_ray).max(1);
    let pixels: Vec<u32> = (0..half.pixel_count()).collect();
    let mut tile = Tile::new(device, network, views, ray_sampling, at_once.min(pixels.len()))?;
    let cast = cast_block(target, ray_sampling.near_far, ray_sampling.sample_count);
    let mut half_image = scratch.image(half)?;
    for (index, pixels) in pixels.chunks(at_once).enumerate() {
        progress.check()?;
        tile.render(pixels, (index * at_once) as u32, &cast, &mut half_image.values)?;
    }
    let count = half.pixel_count() * half.channels;
    check_finite_on(device, &half_image.values, count, "rendering the target's features", "feature image")?;
    let mut image = scratch.image(half.doubled())?;
    upsample(device, &half_image, 0, &mut image)?;
    scratch.recycle(half_image);
    Ok(image)
}

/// Rays through a grid whose corners are the picture's corners (published: `linspace(-1, 1)` over half the pixels),
/// with this many samples between two depths along the target's principal axis. Rows and columns of the target are
/// even.
pub fn cast_block(target: &CameraBlock, [near, far]: [f32; 2], sample_count: u32) -> CastBlock {
    let [width, height] = [target.width / 2, target.height / 2];
    let scale = |nodes: u32, pixels: u32| nodes.saturating_sub(1).max(1) as f32 / pixels as f32;
    let (across, down) = (scale(width, target.width), scale(height, target.height));
    let [focal_x, focal_y, principal_x, principal_y] = target.intrinsics;
    let camera = CameraBlock {
        intrinsics: [focal_x * across, focal_y * down, principal_x * across, principal_y * down],
        width,
        height,
        ..*target
    };
    // Samples are the middles of equal parts: the parts of the first and the last reach half their length further.
    let beyond = 0.5 * (far - near) / (sample_count - 1) as f32;
    CastBlock { camera, near: near - beyond, far: far + beyond, pixel_centre: 0.0, along_axis: 1 }
}

/// The default length of a ray from its first to its last sample, in the unit of length of the network's densities: as
/// published for SRN, 1 over the focal length in halves of the image's height.
pub fn ray_length(target: &CameraBlock) -> f32 {
    target.height as f32 / (2.0 * target.intrinsics[1])
}

/// Buffers for some rays.
struct Tile<'a, D: Device> {
    device: &'a D,
    network: &'a PointNetwork<D>,
    views: &'a Views<'a, D>,
    ray_sampling: &'a RaySampling,
    depths: D::Buffer<f32>,
    points: D::Buffer<viewfuse_core::rays::RayPoint>,
    gathered: D::Buffer<f32>,
    fused: D::Buffer<f32>,
    hidden: [D::Buffer<f32>; 2],
    raw: D::Buffer<f32>,
    weights: D::Buffer<f32>,
}

impl<'a, D: Device> Tile<'a, D> {
    fn new(
        device: &'a D,
        network: &'a PointNetwork<D>,
        views: &'a Views<'a, D>,
        ray_sampling: &'a RaySampling,
        ray_count: usize,
    ) -> Result<Tile<'a, D>, DeviceError> {
        let count = ray_count * ray_sampling.sample_count as usize;
        let features = network.features as usize;
        Ok(Tile {
            device,
            network,
            views,
            ray_sampling,
            depths: device.zeros(count)?,
            points: device.zeros(count)?,
            gathered: device.zeros(count * features * views.volumes.len())?,
            fused: device.zeros(count * features)?,
            hidden: network.hidden(device, count)?,
            raw: device.zeros(count * (features + 1))?,
            weights: device.zeros(count)?,
        })
    }

    /// The features of some pixels, into `summed[pixel][feature]` from pixel `first_ray` on.
    fn render(
        &mut self,
        pixels: &[u32],
        first_ray: u32,
        cast: &CastBlock,
        summed: &mut D::Buffer<f32>,
    ) -> Result<(), DeviceError> {
        let Tile { device, network, views, ray_sampling, .. } = *self;
        let RaySampling { near_far: [near, far], sample_count, jitter, seed, ray_length, inclusive } = *ray_sampling;
        let ray_count = pixels.len() as u32;
        let point_count = ray_count * sample_count;
        let (pixels, mut rays) = (device.upload(pixels)?, device.zeros(pixels.len())?);
        device.cast_rays(cast, ray_count, &pixels, &mut rays)?;
        let coarse = CoarseBlock { seed: [seed as u32, (seed >> 32) as u32], sample_count, jitter };
        device.coarse_depths(&coarse, ray_count, &rays, &pixels, &mut self.depths)?;
        let block = PlaceBlock { sample_count, ..PlaceBlock::default() };
        device.place_points(&block, point_count, None, &rays, &self.depths, &mut self.points)?;
        let features = network.features;
        for (view, volume) in (0..).zip(&views.volumes) {
            let block = VolumeBlock {
                view,
                point_count,
                feature_count: features,
                height: volume.size.height,
                width: volume.size.width,
                depth_count: volume.size.channels / features,
                near,
                far,
            };
            volume.gather(device, &block, &views.cameras, &self.points, &mut self.gathered)?;
        }
        let block = FuseBlock {
            view_count: views.volumes.len() as u32,
            stride: point_count * features,
            ..FuseBlock::default()
        };
        let elements = point_count * features;
        device.fuse_views(&block, elements, &views.weights, &self.gathered, &mut self.fused)?;
        network.run(device, point_count, &self.fused, &mut self.hidden, &mut self.raw)?;
        let block = FeatureBlock {
            sample_count,
            feature_count: features,
            length_scale: ray_length / (far - near),
            last_length: LAST_LENGTH,
            inclusive: u32::from(inclusive),
            first_ray,
        };
        device.weigh_features(&block, ray_count, &self.raw, &self.points, &mut self.weights)?;
        device.sum_features(&block, ray_count, &self.weights, &self.fused, &self.raw, summed)
    }
}
