//! Any sources: planes of equal disparity through the frusta of the sources and of the target; the mathematics is in
//! [`viewfuse_kernels::plane_sweep`].
//!
//! ```text
//! matching    costs of the planes in a frustum
//! sources     the sources' disparities: found, found again by what they say of one another, kept
//! consistency how far the sources' disparities confirm one another; their gains
//! search      surface points of a scene whose files do not tell its depths
//! kept        what was found of the sources, in a folder between runs
//! scratch     memory that is used again
//! holes       surfaces that no source shows
//! unseen      parts of a picture that its photograph does not show
//! scalars     the scalars that are chosen for a scene, and the pictures that are mixed
//! efforts     coarser comparisons, from the cheapest to the exact one
//! ```

mod consistency;
mod efforts;
mod holes;
mod kept;
mod matching;
mod scalars;
mod scratch;
mod search;
mod sources;
mod unseen;

use super::exposure;
use super::space::Space;
use crate::row::{Origin, Row};
use crate::{
    About, AnyField, DepthMap, Efforts, Encoding, Field, FieldError, Geometry, Prepared, Rendered, Request, Surfaces,
    Tuned, Weighted,
};
use consistency::Assessed;
pub use kept::Cache;
use kept::{Kept, Key};
use matching::{Images, Matching, Range};
use scratch::Scratch;
use sources::SourceMeans;
use std::borrow::Cow;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::blend::BlendBlock;
use viewfuse_kernels::plane_sweep::disparity::TEMPERATURE;
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_scene::photographs::{SourceImage, SourceImages, reduced_size};
use viewfuse_weighting::sources::SourceWeights;

/// The settings that serve most scenes.
const DEFAULT: Sweep = Sweep {
    plane_count: 64,
    neighbours: 2,
    match_side: 256,
    near_cost: 0.01,
    front_share: 0.1,
    second_share: 0.0,
    dissent_share: 0.0625,
    consistency_share: 0.5,
    temperature: TEMPERATURE,
};

/// Most views that contribute to a picture. Of 49 views of fox (288x512, `distance:power=2`, one target) all have 29.21 dB, the 20
/// of greatest weight 29.71, 12 have 30.12 and 8 have 30.46. With `auto` 12, 9 and 8 views are the same within 0.11 dB on three targets each
/// of fox (144x256: 32.29, 32.30, 32.28 dB in the mean) and kangaroo (126x280: 23.40, 23.42, 23.45); nine leave sets of nine as they are.
const MAX_VIEWS: usize = 9;

/// Settings of the sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Planes of a frustum: a multiple of 16, at most 128.
    pub plane_count: u32,
    /// Most other sources that a source is compared with, those with the greatest weights: run time is linear in the sources.
    pub neighbours: usize,
    /// Longest side at which views are compared, in pixels. Colours are blended at the size of the pictures.
    pub match_side: u32,
    /// Cost of the nearest plane relative to the farthest one: of equal matches the farther one is chosen.
    pub near_cost: f32,
    /// Cost of a plane that is transparent, or hidden by a nearer one, by the sources' own disparities: the nearer of two
    /// surfaces wins, whichever more sources see.
    pub front_share: f32,
    /// The same for the sources: their disparities are then found a second time, by what the first ones say of one another; 0
    /// for once.
    pub second_share: f32,
    /// Cost of contradicting the sources' own disparities.
    pub dissent_share: f32,
    /// Share of the confidence of a source's disparity that is its geometric consistency with two others; 0 for none.
    pub consistency_share: f32,
    /// Temperature of the softmax over planes.
    pub temperature: f32,
}

impl Default for Sweep {
    fn default() -> Sweep {
        DEFAULT
    }
}

/// Photographs on the device at two sizes, and their disparity maps.
pub(super) struct Views<'a, D: Device> {
    settings: Sweep,
    /// The settings before any scalar was chosen.
    defaults: Sweep,
    device: &'a D,
    has_silhouettes: bool,
    background: [f32; 3],
    /// At the size of the pictures.
    pictures: Images<D>,
    /// The sources at the field's own size of the comparison.
    small: Vec<SourceImage>,
    /// At the size of the comparison.
    matched: Images<D>,
    /// `[view][row][column]` of the matched ones: disparity and confidence.
    disparities: D::Buffer<[f32; 2]>,
    /// Those found the second time.
    settled: Option<Settled<D>>,
    /// From a plane's disparity to the next one's, of each view; 0 if it is not encoded.
    steps: Vec<f32>,
    relevance: Vec<SourceWeights>,
    space: Space,
    /// The matched sources' texels on the host, for the gains.
    texels: Vec<[f32; 4]>,
    /// What is found of the sources, in a folder.
    kept: Option<Kept>,
    /// Disparities that were kept, and are not on the device yet...
    found: Vec<(usize, Vec<[f32; 2]>)>,
    /// ... and those on the device that are to be kept.
    unkept: Vec<(usize, Key)>,
    /// Confidences and gains from some views under the current weighting.
    assessed: Option<Assessed<D>>,
    /// What the last picture's planes have been compared to, for another one under other settings.
    compared: Option<Compared<D>>,
    /// The means of sources' planes, for their second disparities: those that were found last.
    means: Vec<SourceMeans<D>>,
    scratch: Scratch<D>,
}

/// What views show on a target's planes, with the current maps: the same for all settings but one.
struct Compared<D: Device> {
    /// With the setting that it is for, the cost of contradicting the maps.
    frustum: FrustumBlock,
    views: Vec<SweptView>,
    /// As of [`Matching::compared`].
    costs: D::Buffer<Planes>,
}

/// Disparities and confidences of some views, found the second time.
struct Settled<D: Device> {
    /// The settings under which they were found.
    settings: Sweep,
    /// Of each view, by which others and with which weights; none where it was not found.
    voters: Vec<Option<Vec<(usize, f32)>>>,
    maps: D::Buffer<[f32; 2]>,
}

/// The planes of a target.
struct Volume<D: Device> {
    block: BlendBlock,
    /// The views that are blended, with pictures' cameras.
    views: Vec<SweptView>,
    /// `[row][column][group]`.
    costs: D::Buffer<Planes>,
}

impl Sweep {
    fn matching<'d, D: Device>(&self, device: &'d D, has_silhouettes: bool) -> Matching<'d, D> {
        let &Sweep { near_cost, dissent_share, front_share, .. } = self;
        Matching { device, has_silhouettes, near_cost, dissent_share, front_share }
    }

    pub(super) fn views<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        cache: Option<&Cache>,
        progress: &dyn Progress,
    ) -> Result<Views<'a, D>, FieldError> {
        let kept = cache.map(|cache| Kept::new(cache.clone(), device, progress)).transpose()?;
        let reduced = |side: u32| -> Result<Vec<SourceImage>, FieldError> {
            let images = sources.images.iter().map(|image| image.reduced(side));
            images.collect::<Result<_, _>>().map_err(FieldError::unsuitable)
        };
        let has_silhouettes = sources.has_silhouettes;
        let known = Space::of(sources);
        let space = match known.is_known() {
            true => known,
            false => {
                let matching = self.matching(device, has_silhouettes);
                matching.kept_space(&reduced(search::SIDE)?, kept.as_ref(), progress)?
            }
        };
        let small = reduced(self.match_side)?;
        // With silhouettes, alpha 0 is the background.
        let pictures: Vec<Cow<'_, SourceImage>> = match has_silhouettes {
            true => sources.images.iter().map(Cow::Borrowed).collect(),
            false => sources.images.iter().map(unseen::filled).collect(),
        };
        let (matched, texels) = Images::upload_kept(device, &small)?;
        Ok(Views {
            settings: *self,
            defaults: *self,
            device,
            has_silhouettes,
            background: sources.background,
            pictures: Images::upload(device, &pictures)?,
            matched,
            disparities: device.zeros(texels.len())?,
            settled: None,
            steps: vec![0.0; sources.images.len()],
            relevance: Vec::new(),
            space,
            texels,
            assessed: None,
            compared: None,
            means: Vec::new(),
            scratch: Scratch::default(),
            kept,
            found: Vec::new(),
            unkept: Vec::new(),
            small,
        })
    }
}

/// The views with a weight above 0, the greatest weights first. `cameras` are those of the texels, `maps` those of the
/// disparity maps, whose steps are used if given; without gains all are 1.
fn swept(
    cameras: &[CameraBlock],
    maps: &[CameraBlock],
    weights: &[(usize, f32)],
    steps: Option<&[f32]>,
    gains: Option<&[[f32; 4]]>,
) -> Vec<SweptView> {
    let mut order: Vec<(usize, f32)> = weights.iter().copied().filter(|(_, weight)| *weight > 0.0).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    // The picture gets the exposure of the sources that count.
    let common = gains.map_or([1.0; 4], |gains| exposure::common(gains, &order));
    let gain = |view: usize| {
        gains.map_or([1.0; 4], |gains| [0, 1, 2, 3].map(|channel| gains[view][channel] / common[channel]))
    };
    let view = |(view, weight): (usize, f32)| {
        let map = &maps[view];
        SweptView {
            camera: cameras[view],
            gain: gain(view),
            weight,
            disparity_step: steps.map_or(0.0, |steps| steps[view]),
            first_disparity: map.first_texel,
            map_width: map.width,
            map_height: map.height,
            padding: [0; 3],
        }
    };
    order.into_iter().map(view).collect()
}

/// The row of the plane sweep alone.
pub(crate) const ROW: Row = Row {
    name: "plane-sweep",
    title: "plane sweep",
    heading: "Options of the plane sweep",
    origin: Origin::TrainingFree { open: |_| Ok(AnyField::new(Sweep::default())) },
    flags: &[],
    omissions: &[],
    presets: |_, _, _| Vec::new(),
};

impl Field for Sweep {
    /// Sources at the size of the pictures.
    fn about(&self) -> About {
        About { least_sources: 2, ..About::new(ROW.name) }
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
        self.prepare_kept(device, sources, None, progress)
    }

    fn preview(&self) -> Option<Sweep> {
        Some(self.cheaper())
    }
}

impl Sweep {
    /// As [`Field::prepare`], with what was found of the sources before.
    pub(super) fn prepare_kept<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        cache: Option<&Cache>,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
        if !sources.has_silhouettes {
            let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
            viewfuse_scene::rig::gap_warning(&cameras).iter().for_each(|warning| progress.warn(warning));
        }
        Ok(Box::new(self.views(device, sources, cache, progress)?))
    }
}

impl<D: Device> Views<'_, D> {
    /// Planes for a camera.
    fn range(&self, camera: &CameraBlock) -> Range {
        Range::new(self.space.disparities(camera), self.settings.plane_count)
    }

    /// The costs of a target's planes, and what its pixels are blended from.
    fn volume(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Volume<D>, FieldError> {
        let &Request { camera: target, views, .. } = request;
        self.exchange(progress)?;
        self.settle(views, progress)?;
        self.assess(views)?;
        let (small_width, small_height) = reduced_size(target, self.settings.match_side);
        let pinhole = target.pinhole.resized(small_width, small_height).map_err(FieldError::unsuitable)?;
        let camera = Camera { pinhole, ..*target }.block(0);
        let weights: Vec<(usize, f32)> = views.iter().copied().zip(request.view_weights()).collect();
        let range = self.range(&camera);
        let (maps, gains) = (&self.matched.cameras, self.assessed.as_ref().map(|own| &own.gains[..]));
        let matched = swept(maps, maps, &weights, Some(&self.steps), gains);
        let matching = self.settings.matching(self.device, self.has_silhouettes);
        let frustum = matching.frustum(camera, range, &matched);
        let mut scratch = std::mem::take(&mut self.scratch);
        let known = self.compared.take().filter(|own| own.frustum == frustum && own.views == matched);
        let compared = match known {
            Some(own) => own,
            None => {
                let costs =
                    matching.compared(&frustum, &matched, &self.matched.texels, self.maps(), &mut scratch, progress)?;
                Compared { frustum, views: matched, costs }
            }
        };
        let means = matching.means(&frustum, &compared.costs, &mut scratch)?;
        let costs = matching.costs(frustum, &means, &compared.views, self.maps(), &mut scratch)?;
        self.scratch = scratch;
        let views = swept(&self.pictures.cameras, maps, &weights, Some(&self.steps), gains);
        let block = BlendBlock {
            target: target.block(0),
            far_disparity: range.far_disparity,
            disparity_step: range.step,
            volume_width: camera.width,
            volume_height: camera.height,
            group_count: range.group_count,
            view_count: views.len() as u32,
            sharpness: 1.0 / self.settings.temperature,
            has_silhouettes: u32::from(self.has_silhouettes),
        };
        self.compared = Some(compared);
        Ok(Volume { block, views, costs })
    }

    /// A view's depths, of the disparities of all views.
    fn depth_map(&self, view: usize, maps: &[[f32; 2]]) -> DepthMap {
        let (camera, step) = (self.matched.cameras[view], self.steps[view]);
        let own = maps[camera.first_texel as usize..].iter().take((camera.width * camera.height) as usize);
        // Below half a step a disparity is that of the farthest plane: it bounds nothing.
        let depth = |disparity: f32| if step > 0.0 && disparity > 0.5 * step { 1.0 / disparity } else { 0.0 };
        DepthMap {
            camera: CameraBlock { first_texel: 0, ..camera },
            depths: own.clone().map(|[disparity, _]| depth(*disparity)).collect(),
            confidences: own.map(|[_, confidence]| *confidence).collect(),
        }
    }
}

impl<D: Device> Prepared for Views<'_, D> {
    fn encoding(&self) -> Encoding {
        Encoding::Greatest(MAX_VIEWS)
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.find(view, progress)
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let Volume { block, views: blended, costs } = self.volume(request, progress)?;
        let device = self.device;
        let (width, height) = (block.target.width, block.target.height);
        let count = (width * height) as usize;
        let blend_views = device.upload(&blended)?;
        let (mut colours, mut depths, mut confidences) =
            (device.zeros::<[f32; 4]>(count)?, device.zeros::<f32>(count)?, device.zeros::<f32>(count)?);
        device.blend_planes(
            &block,
            0,
            height,
            &blend_views,
            &self.pictures.texels,
            self.maps(),
            &costs,
            &mut colours,
            &mut depths,
            &mut confidences,
        )?;
        let mut colours = device.download(&colours)?;
        for colour in &mut colours {
            let behind = 1.0 - colour[3];
            (0..3).for_each(|channel| colour[channel] += behind * self.background[channel]);
        }
        let (depths, confidences) = (device.download(&depths)?, device.download(&confidences)?);
        let mut rendered = Rendered { colours, depths, confidences, width, height };
        if !self.has_silhouettes {
            let maps = self.device.download(self.maps())?;
            let used: Vec<DepthMap> = request.views.iter().map(|view| self.depth_map(*view, &maps)).collect();
            holes::fill(&mut rendered, &block.target, &used);
        }
        Ok(rendered)
    }

    fn weighted(&mut self) -> Option<&mut dyn Weighted> {
        Some(self)
    }

    fn efforts(&mut self) -> Option<&mut dyn Efforts> {
        Some(self)
    }

    fn tuned(&mut self) -> Option<&mut dyn Tuned> {
        Some(self)
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(self)
    }
}

impl<D: Device> Weighted for Views<'_, D> {
    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.relevance = relevance.to_vec();
        self.steps.fill(0.0);
        self.settled = None;
        self.found.clear();
        self.unkept.clear();
        self.assessed = None;
        self.compared = None;
        self.means.clear();
        Ok(())
    }
}

impl<D: Device> Geometry for Views<'_, D> {
    fn surfaces(&self) -> Surfaces {
        self.space.surfaces()
    }

    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        let mut maps = self.device.download(self.found())?;
        self.add_kept(&mut maps);
        let encoded: Vec<usize> = (0..self.steps.len()).filter(|view| self.steps[*view] > 0.0).collect();
        self.confirm(&encoded, &mut maps);
        Ok((0..self.steps.len()).map(|view| self.depth_map(view, &maps)).collect())
    }
}
