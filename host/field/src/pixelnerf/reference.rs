//! The parts of a render on given inputs, for comparison with reference values.

use super::encoder::run_trunk;
use super::network::Workspace;
use super::{Architecture, Pass, PixelNerf, Views};
use crate::FieldError;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::depths::FineBlock;
use viewfuse_core::rays::{PlaceBlock, RayPoint, TargetRay};
use viewfuse_device::DeviceError;
use viewfuse_device::{Device, Pixels, Precision, Rays};
use viewfuse_kernels::sample_mask::RaysBlock;
use viewfuse_scene::photographs::SourceImages;

/// Sources on a device, with the network.
pub struct Reference<'a, D: Device> {
    views: Views<'a, D>,
}

/// The result of compositing rays.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedRays {
    /// `[ray][sample]`.
    pub weights: Vec<f32>,
    /// `[ray]`: red, green, blue over white.
    pub colours: Vec<[f32; 3]>,
    /// `[ray]`: the sum of weights times depths, not divided by the weights' sum.
    pub depths: Vec<f32>,
}

impl<'a, D: Device> Reference<'a, D> {
    /// Takes the sources to the device.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn new(field: &'a PixelNerf, device: &'a D, sources: &SourceImages) -> Result<Self, FieldError> {
        Ok(Reference { views: field.views(device, sources)? })
    }

    /// The network's sizes.
    pub fn architecture(&self) -> &Architecture {
        &self.views.field.architecture
    }

    /// The number of sources.
    pub fn view_count(&self) -> usize {
        self.views.images.len()
    }

    /// `[view][row][column][channel]`: the latents of all views.
    ///
    /// # Errors
    /// If the device fails.
    pub fn latents(&self) -> Result<Vec<f32>, DeviceError> {
        let mut all = Vec::new();
        let Views { field, device, parameters, .. } = &self.views;
        for image in &self.views.images {
            all.extend(device.download(&run_trunk(*device, &field.architecture, &parameters.trunk, image)?.values)?);
        }
        Ok(all)
    }

    /// Red, green, blue and density at points (their `length` must be 1, their `sample` their index), with these
    /// weights of all views.
    ///
    /// # Errors
    /// If the device fails.
    pub fn radiance(&mut self, pass: Pass, weights: &[f32], points: &[RayPoint]) -> Result<Vec<[f32; 4]>, DeviceError> {
        let all: Vec<usize> = (0..self.view_count()).collect();
        for view in &all {
            if self.views.latents[*view].is_none() {
                self.views.encode_view(*view)?;
            }
        }
        let Views { field, device, .. } = &self.views;
        let views = self.views.used(&all, weights, None)?;
        let maps = self.views.options.omissions.latent_layers;
        let mut workspace = Workspace::new(*device, &field.architecture, all.len(), points.len(), maps)?;
        let network = self.views.network(pass, Precision::Exact);
        let mut samples = device.zeros(points.len())?;
        for some in points.chunks(workspace.point_count as usize) {
            workspace.points = device.upload(some)?;
            network.evaluate(&mut workspace, &views, some.len() as u32)?;
            device.radiance(some.len() as u32, &workspace.raw, &workspace.points, &mut samples)?;
        }
        device.download(&samples)
    }

    /// Composites rays with samples at `depths[ray][sample]`.
    ///
    /// # Errors
    /// If the device fails.
    pub fn render_rays(
        &mut self,
        pass: Pass,
        weights: &[f32],
        rays: &[TargetRay],
        depths: &[f32],
    ) -> Result<RenderedRays, DeviceError> {
        let device = self.views.device;
        let sample_count = (depths.len() / rays.len()) as u32;
        let rays = self.load(rays)?;
        let depths = device.upload(depths)?;
        let point_count = rays.count * sample_count;
        let mut points = device.zeros(point_count as usize)?;
        let block = PlaceBlock { sample_count, ..PlaceBlock::default() };
        device.place_points(&block, point_count, None, &rays.rays, &depths, &mut points)?;
        let points: Vec<RayPoint> = device.download(&points)?;
        // With a length of 1, the optical depth is the density.
        let unit: Vec<RayPoint> = points.iter().map(|point| RayPoint { length: 1.0, ..*point }).collect();
        let mut samples = self.radiance(pass, weights, &unit)?;
        for (sample, point) in samples.iter_mut().zip(&points) {
            sample[3] *= point.length;
        }
        let samples = device.upload(&samples)?;
        let mut seen = device.zeros(point_count as usize)?;
        device.weigh_samples(&RaysBlock { sample_count, first_ray: 0 }, rays.count, &samples, &mut seen)?;
        let mut pixels: Pixels<D> =
            Pixels { colours: device.zeros(rays.count as usize)?, depths: device.zeros(rays.count as usize)? };
        let block = CompositeBlock { background: [1.0; 3], empty_depth: 0.0, sample_count };
        device.composite(&block, rays.count, &samples, &depths, &mut pixels.colours, &mut pixels.depths)?;
        let colours = device.download(&pixels.colours)?;
        let mean_depths = device.download(&pixels.depths)?;
        Ok(RenderedRays {
            weights: device.download(&seen)?.iter().map(|[weight, _]| *weight).collect(),
            depths: colours.iter().zip(mean_depths).map(|(colour, depth)| colour[3] * depth).collect(),
            colours: colours.iter().map(|colour| [colour[0], colour[1], colour[2]]).collect(),
        })
    }

    /// Depths of fine samples `[ray][sample]` and all depths in order `[ray][sample]`, from the first pass's
    /// `coarse_depths[ray][sample]`, `coarse_weights[ray][sample]` and `depths[ray]` (not divided by the weights' sum)
    /// and the random numbers `draws[ray][fine sample]`.
    ///
    /// # Errors
    /// If the device fails.
    #[allow(clippy::too_many_arguments)]
    pub fn fine_depths(
        &self,
        block: &FineBlock,
        rays: &[TargetRay],
        coarse_depths: &[f32],
        coarse_weights: &[f32],
        depths: &[f32],
        draws: &[[f32; 2]],
    ) -> Result<[Vec<f32>; 2], DeviceError> {
        let device = self.views.device;
        let block = FineBlock { depth_times_opacity: 1, ..*block };
        let rays = self.load(rays)?;
        // With an opacity of 1 the depth stays as it is.
        let pixels: Pixels<D> =
            Pixels { colours: device.upload(&vec![[1.0; 4]; depths.len()])?, depths: device.upload(depths)? };
        let seen: Vec<[f32; 2]> = coarse_weights.iter().map(|weight| [*weight, 1.0]).collect();
        let (seen, draws) = (device.upload(&seen)?, device.upload(draws)?);
        let mut fine = device.zeros(rays.count as usize * block.fine_count() as usize)?;
        let Pixels { colours, depths } = &pixels;
        device.fine_depths(&block, rays.count, &seen, &rays.rays, colours, depths, &draws, &mut fine)?;
        let mut merged = device.zeros(rays.count as usize * (block.coarse_count + block.fine_count()) as usize)?;
        device.merge_depths(&block, rays.count, &device.upload(coarse_depths)?, &fine, &mut merged)?;
        Ok([device.download(&fine)?, device.download(&merged)?])
    }

    fn load(&self, rays: &[TargetRay]) -> Result<Rays<D>, DeviceError> {
        let count = rays.len() as u32;
        let pixels: Vec<u32> = (0..count).collect();
        Ok(Rays { count, pixels: self.views.device.upload(&pixels)?, rays: self.views.device.upload(rays)? })
    }
}
