//! PixelNeRF with weighted views, on any device; the mathematics is in [`viewfuse_kernels::pixelnerf`] and
//! [`viewfuse_kernels::network`].
//!
//! Source: Yu, Ye, Tancik, Kanazawa: "pixelNeRF", CVPR 2021, and its official code. The views are combined with
//! weights; the published network takes their mean.

pub mod architecture;
mod encoder;
mod grid;
mod memory;
mod network;
mod node_picture;
mod node_ray;
mod open;
mod options;
mod parameters;
mod pass;
mod picture;
mod probes;
pub mod reference;
pub mod test_networks;
mod variants;
mod visibility;

pub use architecture::{Architecture, KEYS, Level, Pass};
pub(crate) use open::ROW;
pub use options::{MIN_OPACITY, MIN_SHARE, Omissions, PixelNerfOptions, Sampling};

use super::learned::{Distance, over_white, usual_near_far, warn_of_place, warn_of_unit};
use super::rounding::Overflow;
use super::variant::erased;
use super::{
    About, AnyOptions, Check, Encoding, Field, FieldError, LeftOut, Prepared, Record, Rendered, Request, SourceSide,
    Variant,
};
use encoder::{ViewLatents, encode};
use grid::Grid;
use network::{Network, Workspace};
use open::{BEHIND, LAYERS, RAYS, SPACE};
use parameters::{DeviceParameters, HostParameters};
use pass::{Evaluated, Renderer};
use std::sync::Arc;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::CastBlock;
use viewfuse_device::{Device, DeviceError, Precision};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::rows::Kernel;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};
use viewfuse_nn::image::{Image, Size};
use viewfuse_scene::photographs::{SourceImage, SourceImages, longest_side};
use viewfuse_scene::unit::RigUnit;
use visibility::Visibility;

/// Those of a picture of a bounded error, in the order of their first use.
const KERNELS: [Kernel; 18] = [
    Kernel::Convolve,
    Kernel::Linear,
    Kernel::MaxPool,
    Kernel::Upsample,
    Kernel::EmbedPoints,
    Kernel::GatherLatents,
    Kernel::VisibleWeights,
    Kernel::FuseViews,
    Kernel::FindNonFinite,
    Kernel::CastRays,
    Kernel::CoarseDepths,
    Kernel::PlacePoints,
    Kernel::Radiance,
    Kernel::Composite,
    Kernel::WeighSamples,
    Kernel::RandomDraws,
    Kernel::FineDepths,
    Kernel::MergeDepths,
];

/// A PixelNeRF with its parameters, ready for any device.
pub struct PixelNerf {
    architecture: Architecture,
    parameters: Arc<HostParameters>,
    options: PixelNerfOptions,
    /// What is assumed of it ([`Architecture::assumption`]).
    assumption: Option<String>,
}

/// Photographs and parameters on a device, with the latents of the views that are encoded.
struct Views<'a, D: Device> {
    field: &'a PixelNerf,
    device: &'a D,
    parameters: DeviceParameters<D>,
    images: Vec<Image<D>>,
    /// The network's unit; cameras and bounds are in it.
    unit: RigUnit,
    /// Of the sources from what they look at.
    distance: Distance,
    cameras: Vec<CameraBlock>,
    /// `[view]`: none before it is encoded.
    latents: Vec<Option<ViewLatents<D>>>,
    /// The bounds where the options state none, in the network's unit.
    usual_near_far: [f32; 2],
    background: [f32; 3],
    counts: Counts,
    options: PixelNerfOptions,
    overflow: Overflow,
    /// Of the last picture.
    workspace: Option<Workspace<D>>,
}

/// Counts of computed and omitted work so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    latent_rows: u64,
    mapped_rows: u64,
    /// Of grids, as computed.
    latent_bytes: u64,
    /// As kept.
    kept_bytes: u64,
    /// Views at points, of samples that were evaluated.
    point_views: u64,
    passes: [Evaluated; 2],
}

impl PixelNerf {
    /// Reads the network from a checkpoint.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not of this family, or cannot be read.
    pub fn new(checkpoint: &Checkpoint, options: PixelNerfOptions) -> Result<PixelNerf, CheckpointError> {
        let architecture = Architecture::of(checkpoint)?;
        let parameters = Arc::new(HostParameters::read(checkpoint, &architecture)?);
        let assumption = Architecture::assumption(checkpoint);
        Ok(PixelNerf { architecture, parameters, options: options.checked(), assumption })
    }

    /// Its sizes.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// What is assumed of it, as a warning ([`Architecture::assumption`]).
    pub fn assumption(&self) -> Option<&str> {
        self.assumption.as_deref()
    }

    /// Its settings.
    pub fn options(&self) -> PixelNerfOptions {
        self.options
    }

    /// The same network with other settings. The parameters are shared.
    pub fn with_options(&self, options: PixelNerfOptions) -> PixelNerf {
        let PixelNerf { architecture, parameters, assumption, .. } = self;
        let (architecture, parameters) = (architecture.clone(), Arc::clone(parameters));
        PixelNerf { architecture, parameters, options: options.checked(), assumption: assumption.clone() }
    }

    /// The most bytes that a run from sources of these widths and heights takes, beside photographs and pictures.
    pub fn memory_estimate<D: Device>(&self, device: &D, source_sizes: &[[u32; 2]]) -> u64 {
        memory::estimate(device, &self.architecture, &self.options, source_sizes)
    }

    /// Takes photographs and parameters to a device.
    fn views<'a, D: Device>(&'a self, device: &'a D, sources: &SourceImages) -> Result<Views<'a, D>, DeviceError> {
        let distance = Distance::of(sources);
        let unit = distance.unit(sources);
        let cameras: Vec<_> = sources.images.iter().map(|image| unit.camera(&image.camera)).collect();
        Ok(Views {
            field: self,
            device,
            parameters: self.parameters.load(device)?,
            images: sources.images.iter().map(|image| upload_image(device, image)).collect::<Result<_, _>>()?,
            cameras: cameras.iter().map(|camera| camera.block(0)).collect(),
            latents: cameras.iter().map(|_| None).collect(),
            usual_near_far: usual_near_far(distance.length / unit.length()),
            distance,
            unit,
            background: sources.background,
            counts: Counts::default(),
            options: self.options,
            overflow: Overflow::default(),
            workspace: None,
        })
    }
}

impl Field for PixelNerf {
    fn about(&self) -> About {
        let source_side = SourceSide::Pixels(self.architecture.source_side);
        About { source_side, ends_rays: true, kernels: &KERNELS, ..About::new(ROW.name) }
    }

    fn options(&self) -> AnyOptions {
        AnyOptions::new(self.options)
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        let views = self.views(device, sources)?;
        self.assumption.iter().for_each(|assumption| progress.warn(assumption));
        warn_of_unit(views.unit, views.distance, progress);
        warn_of_place(views.distance, sources, progress);
        if self.options.sampling.near_far.is_none() {
            views.distance.warn_of_guess(progress);
        }
        let trained = self.architecture.source_side;
        if sources.images.iter().any(|image| longest_side(&image.camera) < trained) {
            progress.warn(&format!(
                "the network was trained on images of {trained} pixels on their longest side; these are smaller"
            ));
        }
        Ok(Box::new(views))
    }
}

impl<D: Device> Views<'_, D> {
    /// A point network, for one of the passes, in this precision.
    fn network(&self, pass: Pass, precision: Precision) -> Network<'_, D> {
        let index = if pass == Pass::Fine && self.field.architecture.has_fine { 1 } else { 0 };
        Network {
            device: self.device,
            architecture: &self.field.architecture,
            layers: &self.parameters.networks[index],
            grids: self.options.omissions.latent_layers.then_some(index),
            precision,
        }
    }

    /// Some of the views, with these weights, for a target's rays or for any points.
    fn used(
        &self,
        views: &[usize],
        weights: &[f32],
        target: Option<&CastBlock>,
    ) -> Result<network::Views<'_, D>, DeviceError> {
        let cameras: Vec<CameraBlock> = views.iter().map(|view| self.cameras[*view]).collect();
        let visibility = Visibility { cameras, weights: weights.to_vec() };
        let target = target.filter(|_| self.options.omissions.unseen_points);
        Ok(network::Views {
            cameras: self.device.upload(&visibility.cameras)?,
            weights: self.device.upload(weights)?,
            latents: views.iter().filter_map(|view| self.latents[*view].as_ref()).collect(),
            visibility: target.is_some_and(|cast| visibility.is_partial(cast)).then_some(visibility),
        })
    }

    /// Near and far bounds in the network's unit.
    fn near_far(&self) -> [f32; 2] {
        let given = self.options.sampling.near_far;
        given.map_or(self.usual_near_far, |bounds| bounds.map(|depth| depth / self.unit.length()))
    }

    /// A target's rays.
    fn cast(&self, request: &Request<'_>) -> CastBlock {
        let ([near, far], camera) = (self.near_far(), self.unit.camera(request.camera).block(0));
        CastBlock { camera, near, far, pixel_centre: self.field.architecture.pixel_centre, along_axis: 0 }
    }

    /// What renders a target's rays with these options.
    fn renderer<'r>(
        &'r self,
        views: &'r network::Views<'r, D>,
        request: &Request<'_>,
        options: PixelNerfOptions,
        progress: &'r dyn Progress,
    ) -> Renderer<'r, D> {
        let PixelNerfOptions { sampling, omissions, precision } = options;
        Renderer {
            device: self.device,
            coarse: self.network(Pass::Coarse, precision),
            fine: self.network(Pass::Fine, precision),
            views,
            sampling,
            omissions,
            early_termination: request.early_termination,
            cast: self.cast(request),
            background: self.background,
            progress,
        }
    }

    /// Buffers for a target's points: those of the last picture, if they will do.
    fn workspace(&mut self, request: &Request<'_>, most_points: usize) -> Result<Workspace<D>, DeviceError> {
        let (device, architecture) = (self.device, &self.field.architecture);
        let (view_count, maps) = (request.views.len(), self.options.omissions.latent_layers);
        let last = self.workspace.take();
        match last.filter(|last| last.serves(device, architecture, view_count, most_points, maps)) {
            Some(last) => Ok(last),
            None => Workspace::new(device, architecture, view_count, most_points, maps),
        }
    }

    /// Renders a target under these options, which differ from those that are set in their precision alone.
    fn render_under(
        &mut self,
        options: PixelNerfOptions,
        request: &Request<'_>,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        let PixelNerfOptions { sampling, omissions, .. } = options;
        let Request { camera, .. } = request;
        let pixel_count = (camera.pinhole.width() * camera.pinhole.height()) as usize;
        let most_points = match omissions.nodes {
            0 => pixel_count * sampling.coarse_count as usize,
            _ => node_picture::most_points(pixel_count),
        };
        let mut workspace = self.workspace(request, most_points)?;
        let views = self.used(request.views, &request.view_weights(), Some(&self.cast(request)))?;
        let renderer = self.renderer(&views, request, options, progress);
        let mut evaluated = [Evaluated::default(); 2];
        let probes = renderer.probes(&mut workspace, &mut evaluated[0])?;
        let mut rendered = match omissions.nodes {
            0 => renderer.picture(&mut workspace, probes.as_ref(), &mut evaluated)?,
            _ => renderer.picture_between_nodes(&mut workspace, &mut evaluated)?,
        };
        workspace.check(self.device)?;
        along_axis(&mut rendered, &renderer.cast);
        self.workspace = Some(workspace);
        if !self.unit.is_world() {
            rendered.depths.iter_mut().for_each(|depth| *depth *= self.unit.length());
        }
        let views_and_layers = [request.views.len(), self.field.architecture.injected_count].map(|count| count as u64);
        self.counts.add(views_and_layers, omissions.latent_layers, &evaluated);
        Ok(rendered)
    }

    /// Colours of some pixels under these options, each from a ray of its own.
    fn pixels_under(
        &mut self,
        options: PixelNerfOptions,
        request: &Request<'_>,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        let PixelNerfOptions { sampling, omissions, .. } = options;
        let most_points = match omissions.nodes {
            0 => pixels.len() * sampling.coarse_count as usize,
            _ => node_picture::most_points(pixels.len()),
        };
        let mut workspace = self.workspace(request, most_points)?;
        let views = self.used(request.views, &request.view_weights(), Some(&self.cast(request)))?;
        let renderer = self.renderer(&views, request, options, progress);
        let mut evaluated = [Evaluated::default(); 2];
        let colours = match omissions.nodes {
            0 => {
                let probes = renderer.probes(&mut workspace, &mut evaluated[0])?;
                renderer.pixels_at(&mut workspace, pixels, probes.as_ref(), &mut evaluated)?.0
            }
            _ => renderer.pixels_of_nodes(&mut workspace, pixels, &mut evaluated[1])?,
        };
        workspace.check(self.device)?;
        self.workspace = Some(workspace);
        Ok(colours)
    }

    fn encode_view(&mut self, view: usize) -> Result<(), DeviceError> {
        let (architecture, omissions) = (&self.field.architecture, &self.options.omissions);
        let encoded = encode(self.device, architecture, &self.parameters, &self.images[view], omissions)?;
        for [kept, whole] in encoded.grids.iter().flatten().map(Grid::bytes) {
            self.counts.kept_bytes += kept;
            self.counts.latent_bytes += whole;
        }
        self.latents[view] = Some(encoded);
        Ok(())
    }
}

impl<'a, D: Device> Prepared<'a> for Views<'a, D> {
    fn encoding(&self) -> Encoding {
        if self.options.omissions.unused_views { Encoding::Used } else { Encoding::All }
    }

    fn encode(&mut self, view: usize, _progress: &dyn Progress) -> Result<(), FieldError> {
        Ok(self.encode_view(view)?)
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let precision = self.overflow.limit(self.options.precision);
        let in_precision = |precision| PixelNerfOptions { precision, ..self.options };
        let [options, exact] = [precision, Precision::Exact].map(in_precision);
        let mut rendered = self.render_under(options, request, progress);
        if Overflow::is_repeated(&rendered, precision) {
            rendered = self.render_under(exact, request, progress);
            if rendered.is_ok() {
                self.overflow.tell(progress);
            }
        }
        rendered
    }

    fn set(&mut self, options: &AnyOptions) -> Result<(), FieldError> {
        if let Some(options) = options.of() {
            self.options = PixelNerfOptions::checked(*options);
        }
        Ok(())
    }

    fn efforts(&self, options: &AnyOptions, pixel_count: u64) -> Vec<Variant<AnyOptions>> {
        let Some(options) = options.of::<PixelNerfOptions>() else { return Vec::new() };
        let samples = options.sampling.counts().map(u64::from).iter().sum::<u64>();
        let point = self.field.architecture.point_multiply_adds(self.cameras.len() as u64);
        let precisions = self.device.precisions_for(pixel_count * samples * point);
        erased(variants::efforts(options, &precisions))
    }

    fn check(&self) -> Check {
        Check::Pixels
    }

    fn exact_pixels(
        &mut self,
        request: &Request<'_>,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        // Nothing less than exact: what leaves out empty parts of rays misses mist in its own check.
        self.pixels_under(variants::exact(&self.options), request, pixels, progress)
    }

    fn pixels(
        &mut self,
        request: &Request<'_>,
        pixels: &[u32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 4]>, FieldError> {
        let precision = self.overflow.limit(self.options.precision);
        self.pixels_under(PixelNerfOptions { precision, ..self.options }, request, pixels, progress)
    }

    fn record(&self) -> Record {
        let Counts { latent_rows, mapped_rows, latent_bytes, kept_bytes, point_views, passes: [coarse, fine] } =
            self.counts;
        let Omissions {
            latent_layers,
            half_latents,
            unseen_points,
            empty_space,
            empty_rays,
            empty_parts,
            hidden_samples,
            interpolation,
            nodes,
            ..
        } = self.options.omissions;
        let omitted = |pass: Evaluated| pass.samples.saturating_sub(pass.evaluated);
        let first = empty_space > 1 || interpolation > 0.0 || nodes > 0;
        let second = empty_rays || empty_parts || hidden_samples || nodes > 0;
        let halves = LeftOut {
            what: "latent bytes",
            switch: half_latents,
            left_out: latent_bytes - kept_bytes,
            of: latent_bytes,
            typical_error: "2^-11 of a latent",
        };
        let left_out = vec![
            LAYERS.left_out(latent_layers, mapped_rows, latent_rows),
            halves,
            BEHIND.left_out(unseen_points, coarse.unseen + fine.unseen, point_views),
            SPACE.left_out(first, omitted(coarse), coarse.samples),
            RAYS.left_out(second, omitted(fine), fine.samples),
        ];
        let sizes: Vec<[u32; 2]> = self.images.iter().map(|image| [image.size.width, image.size.height]).collect();
        let memory_estimate = Some(memory::estimate(self.device, &self.field.architecture, &self.options, &sizes));
        let near_far = Some(self.near_far().map(|depth| depth * self.unit.length()));
        Record { left_out, memory_estimate, near_far, notes: self.overflow.notes(), ..Record::default() }
    }
}

impl Counts {
    /// Adds a picture from so many views, with so many latent layers in each.
    fn add(&mut self, [views, layers]: [u64; 2], maps: bool, evaluated: &[Evaluated; 2]) {
        let point_views = views * (evaluated[0].evaluated + evaluated[1].evaluated);
        self.point_views += point_views;
        let rows = layers * (point_views - evaluated[0].unseen - evaluated[1].unseen);
        self.latent_rows += rows;
        if maps {
            self.mapped_rows += rows;
        }
        for (total, pass) in self.passes.iter_mut().zip(evaluated) {
            total.samples += pass.samples;
            total.evaluated += pass.evaluated;
            total.unseen += pass.unseen;
        }
    }
}

/// An image over white, as the networks are trained: red, green, blue in `[-1, 1]`.
fn upload_image<D: Device>(device: &D, image: &SourceImage) -> Result<Image<D>, DeviceError> {
    let values: Vec<f32> = image.texels.iter().flat_map(|texel| over_white(*texel)).collect();
    let (width, height) = (image.camera.pinhole.width(), image.camera.pinhole.height());
    Image::upload(device, Size { height, width, channels: 3 }, &values)
}

/// Depths along the rays become depths along the principal axis; rays without a surface get 0.
fn along_axis(rendered: &mut Rendered, cast: &CastBlock) {
    let forward = cast.camera.pose.rotate_to_world(0.0, 0.0, 1.0);
    for (pixel, (depth, colour)) in (0..).zip(rendered.depths.iter_mut().zip(&rendered.colours)) {
        let ray = viewfuse_core::rays::cast_ray(cast, pixel);
        let direction = viewfuse_core::Vec3::from_array(ray.direction);
        *depth = if colour[3] >= MIN_OPACITY { *depth * direction.dot(forward) } else { 0.0 };
    }
}
