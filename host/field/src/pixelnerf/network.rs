//! A point network, evaluated at many points at once: each view's blocks, fusion of the views, the blocks behind.

use super::architecture::Architecture;
use super::encoder::ViewLatents;
use super::parameters::PointNetwork;
use super::visibility::Visibility;
use crate::FieldError;
use crate::finite::NotFinite;
use std::mem::swap;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_device::{Device, DeviceError, Later, Precision};
use viewfuse_kernels::finite::{ALL_FINITE, FINITE_RUN};
use viewfuse_kernels::pixelnerf::{EmbedBlock, GatherBlock};
use viewfuse_nn::linear::{Linear, LinearOptions};

/// Floats of a buffer of activations on the CPU: 4 MiB, which fit into the caches of a few cores. A quarter and four
/// times as many took the same time.
const MIN_ACTIVATIONS: usize = 1 << 20;
/// Outputs of a matrix product that an invocation computes.
const OUTPUTS_AN_INVOCATION: usize = 64;

/// The views that a target uses, with their weights.
pub(super) struct Views<'a, D: Device> {
    /// Their cameras.
    pub(super) cameras: D::Buffer<CameraBlock>,
    /// Their weights, which sum to 1.
    pub(super) weights: D::Buffer<f32>,
    /// Their encodings.
    pub(super) latents: Vec<&'a ViewLatents<D>>,
    /// The same cameras and weights on the host, where a view has weight 0 at some points and is left out there.
    pub(super) visibility: Option<Visibility>,
}

/// Buffers for activations, reused for every chunk of points, and for other pictures of as many views.
pub(super) struct Workspace<D: Device> {
    /// The most points at once.
    pub(super) point_count: u32,
    /// Of how many views, and whether without latents.
    views: (usize, bool),
    pub(super) points: D::Buffer<RayPoint>,
    embedded: D::Buffer<f32>,
    /// `[view][point][channel]`; empty where the grids hold `lin_z` outputs.
    latents: D::Buffer<f32>,
    /// `[view][point][width]`, later `[point][width]`: the residual stream, its next value, and a block's hidden
    /// layer.
    flow: D::Buffer<f32>,
    next: D::Buffer<f32>,
    inside: D::Buffer<f32>,
    visible: D::Buffer<f32>,
    pub(super) raw: D::Buffer<f32>,
    /// Of each chunk so far the first outputs that are not finite, by runs: looked at when all is dispatched.
    not_finite: Vec<D::Buffer<u32>>,
}

impl<D: Device> Workspace<D> {
    /// Buffers for as many points as keep the device busy, for `view_count` views; at most `most_points`.
    pub(super) fn new(
        device: &D,
        architecture: &Architecture,
        view_count: usize,
        most_points: usize,
        maps: bool,
    ) -> Result<Workspace<D>, DeviceError> {
        let Architecture { width, .. } = *architecture;
        let points = points_at_once(device, architecture, view_count, most_points, maps);
        let rows = points * view_count;
        Ok(Workspace {
            point_count: points as u32,
            views: (view_count, maps),
            points: device.zeros(points)?,
            embedded: device.zeros(rows * architecture.embedded_len())?,
            latents: device.zeros(if maps { 1 } else { rows * architecture.latent_channels() })?,
            flow: device.zeros(rows * width)?,
            next: device.zeros(rows * width)?,
            inside: device.zeros(rows * width)?,
            visible: device.zeros(rows)?,
            raw: device.zeros(points * 4)?,
            not_finite: Vec::new(),
        })
    }

    /// Whether it is as [`Workspace::new`] would make it, or larger.
    pub(super) fn serves(
        &self,
        device: &D,
        architecture: &Architecture,
        view_count: usize,
        most_points: usize,
        maps: bool,
    ) -> bool {
        let points = points_at_once(device, architecture, view_count, most_points, maps);
        self.views == (view_count, maps) && self.point_count as usize >= points
    }

    /// Checks all outputs since the last check, for which it waits once.
    ///
    /// # Errors
    /// [`FieldError::NotFinite`]: weights that are finite themselves may overflow together.
    pub(super) fn check(&mut self, device: &D) -> Result<(), FieldError> {
        let chunks = std::mem::take(&mut self.not_finite);
        let chunks: Vec<Later<'_, u32>> =
            chunks.iter().map(|firsts| device.download_later(firsts)).collect::<Result<_, _>>()?;
        for firsts in chunks {
            if let Some(first) = firsts.get()?.into_iter().find(|first| *first != ALL_FINITE) {
                return Err(FieldError::NotFinite(NotFinite {
                    stage: "evaluating the network at points".to_owned(),
                    tensor: "outputs [point][4]".to_owned(),
                    index: first as usize,
                    value: f32::NAN,
                }));
            }
        }
        Ok(())
    }
}

/// The number of points of [`Workspace::new`].
fn points_at_once<D: Device>(
    device: &D,
    architecture: &Architecture,
    view_count: usize,
    most_points: usize,
    maps: bool,
) -> usize {
    let latents = if maps { 0 } else { architecture.latent_channels() };
    let widest = architecture.width.max(architecture.embedded_len()).max(latents);
    let busy = MIN_ACTIVATIONS.max(device.busy_elements().saturating_mul(OUTPUTS_AN_INVOCATION));
    let rows = (busy / widest).min(device.most_elements::<f32>() / widest);
    (rows / view_count.max(1)).clamp(1, most_points.max(1))
}

/// Bytes of a [`Workspace`].
pub(super) fn workspace_bytes<D: Device>(
    device: &D,
    architecture: &Architecture,
    view_count: usize,
    maps: bool,
) -> usize {
    let points = points_at_once(device, architecture, view_count, usize::MAX, maps);
    let latents = if maps { 0 } else { architecture.latent_channels() };
    let row = architecture.embedded_len() + latents + 3 * architecture.width + 1;
    points * (view_count * row * size_of::<f32>() + size_of::<RayPoint>() + 4 * size_of::<f32>())
}

/// A network on a device, with the data of its evaluation.
pub(super) struct Network<'a, D: Device> {
    pub(super) device: &'a D,
    pub(super) architecture: &'a Architecture,
    pub(super) layers: &'a PointNetwork<Linear<D>>,
    /// Which list of a view's grids is this network's; `None` where the grid holds latents.
    pub(super) grids: Option<usize>,
    /// That of its layers.
    pub(super) precision: Precision,
}

impl<D: Device> Network<'_, D> {
    /// A layer without rectification.
    fn plain(&self) -> LinearOptions {
        LinearOptions::PLAIN.in_precision(self.precision)
    }

    /// Computes the four raw outputs of the first `point_count` points of a workspace.
    pub(super) fn evaluate(
        &self,
        workspace: &mut Workspace<D>,
        views: &Views<'_, D>,
        point_count: u32,
    ) -> Result<(), DeviceError> {
        let Network { device, architecture, layers, .. } = self;
        let view_count = views.latents.len() as u32;
        let width = architecture.width as u32;
        let row_count = view_count * point_count;
        let embed = EmbedBlock {
            point_count,
            frequency_count: architecture.frequency_count as u32,
            frequency: architecture.frequency,
        };
        device.embed_points(&embed, view_count, &views.cameras, &workspace.points, &mut workspace.embedded)?;
        let Workspace { embedded, flow, .. } = workspace;
        layers.lin_in.run(device, row_count, self.plain(), embedded, None, flow)?;
        if self.grids.is_none() {
            self.gather_latents(workspace, views, point_count)?;
        }
        for block in 0..architecture.injected_count {
            self.add_latents(workspace, views, point_count, block)?;
            self.run_block(workspace, row_count, block)?;
        }
        let Workspace { points, visible, flow, next, .. } = workspace;
        device.visible_weights(&view_count, point_count, &views.cameras, &views.weights, points, visible)?;
        let fuse =
            FuseBlock { view_count, stride: point_count * width, channel_count: width, weight_stride: view_count };
        device.fuse_views(&fuse, point_count * width, visible, flow, next)?;
        swap(flow, next);
        for block in architecture.injected_count..architecture.block_count {
            self.run_block(workspace, point_count, block)?;
        }
        let options = LinearOptions { relu_inputs: true, ..self.plain() };
        layers.lin_out.run(device, point_count, options, &workspace.flow, None, &mut workspace.raw)?;
        let value_count = 4 * point_count;
        let mut firsts = device.zeros(value_count.div_ceil(FINITE_RUN) as usize)?;
        device.find_non_finite(&value_count, &workspace.raw, &mut firsts)?;
        workspace.not_finite.push(firsts);
        Ok(())
    }

    /// Interpolates the latents in every view.
    fn gather_latents(
        &self,
        workspace: &mut Workspace<D>,
        views: &Views<'_, D>,
        point_count: u32,
    ) -> Result<(), DeviceError> {
        let channel_count = self.architecture.latent_channels() as u32;
        for (view, known) in (0..).zip(&views.latents) {
            let block = self.gather(known, view, point_count, channel_count);
            let Workspace { points, latents, .. } = workspace;
            known.grids[0][0].gather(self.device, &block, &views.cameras, points, None, latents)?;
        }
        Ok(())
    }

    /// Adds a block's `lin_z` output for the latents: interpolated in the grids that hold it, or computed at the
    /// points.
    fn add_latents(
        &self,
        workspace: &mut Workspace<D>,
        views: &Views<'_, D>,
        point_count: u32,
        block: usize,
    ) -> Result<(), DeviceError> {
        let width = self.architecture.width as u32;
        let Workspace { points, latents, flow, next, .. } = workspace;
        match self.grids {
            Some(network) => {
                for (view, known) in (0..).zip(&views.latents) {
                    let gather = self.gather(known, view, point_count, width);
                    let grid = &known.grids[network][block];
                    grid.gather(self.device, &gather, &views.cameras, points, Some(flow), next)?;
                }
            }
            None => {
                let row_count = views.latents.len() as u32 * point_count;
                let lin_z = &self.layers.lin_z[block];
                lin_z.run(self.device, row_count, self.plain(), latents, Some(flow), next)?;
            }
        }
        swap(flow, next);
        Ok(())
    }

    fn gather(&self, known: &ViewLatents<D>, view: u32, point_count: u32, channel_count: u32) -> GatherBlock {
        let [height, width] = known.grid_size;
        let pixel_centre = self.architecture.pixel_centre;
        GatherBlock { view, point_count, channel_count, height, width, has_residual: 0, pixel_centre }
    }

    /// A residual block: `flow + fc_1(relu(fc_0(relu(flow))))`.
    fn run_block(&self, workspace: &mut Workspace<D>, row_count: u32, block: usize) -> Result<(), DeviceError> {
        let [fc_0, fc_1] = &self.layers.blocks[block];
        let rectified = LinearOptions { relu_inputs: true, relu_outputs: true, ..self.plain() };
        let Workspace { flow, next, inside, .. } = workspace;
        fc_0.run(self.device, row_count, rectified, flow, None, inside)?;
        fc_1.run(self.device, row_count, self.plain(), inside, Some(flow), next)?;
        swap(flow, next);
        Ok(())
    }
}
