//! Any sources: planes of equal disparity through the frusta of the sources and of the target; the mathematics is in
//! [`viewfuse_core::plane_sweep`].

use super::exposure;
use super::space::{Space, first_guess};
use crate::{FieldError, Prepared, Rendered, Request, Setting, Surfaces, Tunable};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::plane_sweep::blend::BlendBlock;
use viewfuse_core::plane_sweep::census::REACH;
use viewfuse_core::plane_sweep::disparity::TEMPERATURE;
use viewfuse_core::plane_sweep::evidence::ViewPair;
use viewfuse_core::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_core::plane_sweep::path::{CostBlock, DIRECTIONS};
use viewfuse_core::plane_sweep::window::WindowBlock;
use viewfuse_core::plane_sweep::{MOST_MATCHED, PLANES, Planes};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::{SourceImage, SourceImages, reduced_size};
use viewfuse_weighting::sources::SourceWeights;

/// Longest side in the search for the depth range, in pixels.
const RANGE_SIDE: u32 = 128;
/// Planes of that search.
const RANGE_PLANES: u32 = 128;
/// Neighbours that a view is compared with there.
const RANGE_NEIGHBOURS: usize = 4;
/// Confidence from which on a pixel counts there.
const RANGE_CONFIDENCE: f32 = 0.6;
/// Most other sources that a source is compared with, those with the greatest weights: run time is linear in the
/// sources.
const NEIGHBOURS: usize = 4;
/// Most pairs that are compared, for each view.
const PAIRS_PER_VIEW: usize = 3;

/// Most planes of a frustum in pictures that are only compared with one another.
const TRIAL_PLANES: u32 = 32;

const NEAR_COST: &str = "near cost";
const DISSENT_SHARE: &str = "dissent share";
const TEMPERATURE_NAME: &str = "temperature";

/// The scalars that differ most from scene to scene, the most effective ones first.
const TUNABLES: &[Tunable] = &[
    Tunable { name: NEAR_COST, default: DEFAULT.near_cost, others: &[0.002, 0.02] },
    Tunable { name: DISSENT_SHARE, default: DEFAULT.dissent_share, others: &[0.0, 0.125] },
    Tunable { name: TEMPERATURE_NAME, default: DEFAULT.temperature, others: &[0.005, 0.013] },
];

/// The settings that serve most scenes.
const DEFAULT: Sweep =
    Sweep { plane_count: 64, match_side: 256, near_cost: 0.01, dissent_share: 0.0625, temperature: TEMPERATURE };

/// Settings of the sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Planes of a frustum: a multiple of 16, at most 128.
    pub plane_count: u32,
    /// Longest side at which views are compared, in pixels. Colours are blended at the size of the pictures.
    pub match_side: u32,
    /// Cost of the nearest plane relative to the farthest one: of equal matches the farther one is chosen.
    pub near_cost: f32,
    /// Cost of contradicting the sources' own disparities.
    pub dissent_share: f32,
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
    /// At the size of the comparison.
    matched: Images<D>,
    disparities: D::Buffer<[f32; 2]>,
    /// From a plane's disparity to the next one's, of each view that has a map.
    steps: Vec<f32>,
    relevance: Vec<SourceWeights>,
    space: Space,
    /// The matched sources' texels on the host, and the gains estimated from them under the current weighting.
    texels: Vec<[f32; 4]>,
    gains: Option<Vec<[f32; 4]>>,
}

/// The sources at one size.
struct Images<D: Device> {
    cameras: Vec<CameraBlock>,
    texels: D::Buffer<[f32; 4]>,
}

impl<D: Device> Images<D> {
    fn upload(device: &D, images: &[SourceImage]) -> Result<Images<D>, FieldError> {
        let (cameras, texels) = super::hull::joined(images);
        Ok(Images { cameras, texels: device.upload(&texels)? })
    }
}

/// A camera's planes.
#[derive(Clone, Copy)]
struct Range {
    far_disparity: f32,
    step: f32,
    group_count: u32,
}

impl Range {
    fn new([least, greatest]: [f32; 2], plane_count: u32) -> Range {
        let group_count = plane_count.div_ceil(PLANES as u32);
        let intervals = (group_count * PLANES as u32 - 1) as f32;
        Range { far_disparity: least, step: (greatest - least) / intervals, group_count }
    }
}

impl Sweep {
    /// The scalars that can be chosen for a scene, by the names in [`TUNABLES`].
    fn scalars(&mut self) -> [(&'static str, &mut f32); 3] {
        [
            (NEAR_COST, &mut self.near_cost),
            (DISSENT_SHARE, &mut self.dissent_share),
            (TEMPERATURE_NAME, &mut self.temperature),
        ]
    }

    pub(super) fn views<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Views<'a, D>, FieldError> {
        let reduced = |side: u32| -> Result<Vec<SourceImage>, FieldError> {
            let images = sources.images.iter().map(|image| image.reduced(side));
            images.collect::<Result<_, _>>().map_err(FieldError::unsuitable)
        };
        let small = reduced(self.match_side)?;
        let matched = Images::upload(device, &small)?;
        let map_len: usize = small.iter().map(|image| image.texels.len()).sum();
        let mut views = Views {
            settings: *self,
            defaults: *self,
            device,
            has_silhouettes: sources.has_silhouettes,
            background: sources.background,
            pictures: Images::upload(device, &sources.images)?,
            matched,
            disparities: device.zeros(map_len)?,
            steps: vec![0.0; sources.images.len()],
            relevance: Vec::new(),
            texels: small.iter().flat_map(|image| image.texels.iter().copied()).collect(),
            gains: None,
            space: Space::of(sources),
        };
        if !views.space.is_known() {
            views.space = views.find_range(&reduced(RANGE_SIDE)?, progress)?;
        }
        Ok(views)
    }
}

impl<D: Device> Views<'_, D> {
    /// Surface points, from a coarse sweep of every source against its nearest neighbours.
    fn find_range(&self, images: &[SourceImage], progress: &dyn Progress) -> Result<Space, FieldError> {
        let device = self.device;
        let small = Images::upload(device, images)?;
        let cameras: Vec<Camera> = images.iter().map(|image| image.camera).collect();
        let range = Range::new(first_guess(&cameras), RANGE_PLANES);
        let mut maps = device.zeros(images.iter().map(|image| image.texels.len()).sum())?;
        for (view, camera) in cameras.iter().enumerate() {
            progress.check()?;
            let mut near: Vec<(usize, f32)> = (0..cameras.len())
                .filter(|other| *other != view)
                .map(|other| (other, camera.pose.centre_world().distance(cameras[other].pose.centre_world())))
                .collect();
            near.sort_by(|a, b| a.1.total_cmp(&b.1));
            near.truncate(RANGE_NEIGHBOURS);
            let mut weights: Vec<(usize, f32)> =
                near.iter().map(|(other, gap)| (*other, 1.0 / (gap * gap + 1.0e-12))).collect();
            let sum: f32 = weights.iter().map(|(_, weight)| weight).sum();
            weights.iter_mut().for_each(|(_, weight)| *weight /= sum);
            weights.push((view, 1.0));
            let swept = self.swept(&small, &small, &weights, false);
            let costs = self.costs(small.cameras[view], range, &small, &swept, progress)?;
            let frustum = self.frustum(small.cameras[view], range, &swept);
            device.pick_disparity(&frustum, &costs, &mut maps)?;
        }
        let maps = device.download(&maps)?;
        let points = consistent_points(&small.cameras, &maps, range.step);
        Ok(Space::of_points(points, &cameras))
    }

    /// The views with a weight above 0, the greatest weights first.
    fn swept(&self, images: &Images<D>, maps: &Images<D>, weights: &[(usize, f32)], use_maps: bool) -> Vec<SweptView> {
        let mut order: Vec<(usize, f32)> = weights.iter().copied().filter(|(_, weight)| *weight > 0.0).collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        // The picture gets the exposure of the sources that count.
        let common = self.gains.as_ref().map_or([1.0; 4], |gains| exposure::common(gains, &order));
        let gain = |view: usize| {
            self.gains
                .as_ref()
                .map_or([1.0; 4], |gains| [0, 1, 2, 3].map(|channel| gains[view][channel] / common[channel]))
        };
        let view = |(view, weight): (usize, f32)| {
            let map = &maps.cameras[view];
            SweptView {
                camera: images.cameras[view],
                gain: gain(view),
                weight,
                disparity_step: if use_maps { self.steps[view] } else { 0.0 },
                first_disparity: map.first_texel,
                map_width: map.width,
                map_height: map.height,
                padding: [0; 3],
            }
        };
        order.into_iter().map(view).collect()
    }

    fn frustum(&self, camera: CameraBlock, range: Range, swept: &[SweptView]) -> FrustumBlock {
        FrustumBlock {
            camera,
            far_disparity: range.far_disparity,
            disparity_step: range.step,
            group_count: range.group_count,
            view_count: swept.len().min(MOST_MATCHED) as u32,
            pair_count: pairs(swept).len() as u32,
            has_silhouettes: u32::from(self.has_silhouettes),
            dissent_share: self.settings.dissent_share,
            first_row: 0,
            row_count: camera.height,
        }
    }

    /// The costs of all planes in a frustum: `costs[row][column][group]`.
    fn costs(
        &self,
        camera: CameraBlock,
        range: Range,
        images: &Images<D>,
        swept: &[SweptView],
        progress: &dyn Progress,
    ) -> Result<D::Buffer<Planes>, FieldError> {
        let device = self.device;
        let pairs = pairs(swept);
        let matched = &swept[..swept.len().min(MOST_MATCHED)];
        let whole = self.frustum(camera, range, swept);
        let row_len = (camera.width * range.group_count) as usize;
        let volume = row_len * camera.height as usize;
        let (views, pair_buffer) = (device.upload(matched)?, device.upload(&pairs)?);
        let mut costs = device.zeros::<Planes>(2 * volume)?;
        let band_rows = 32.min(camera.height);
        let rows = (band_rows + REACH).min(camera.height) as usize;
        let mut grey = device.zeros::<Planes>(rows * row_len * matched.len())?;
        let mut evidence = device.zeros::<Planes>(4 * rows * row_len)?;
        for first in (0..camera.height).step_by(band_rows as usize) {
            progress.check()?;
            let halo = first.min(REACH);
            let kept = band_rows.min(camera.height - first);
            let band = FrustumBlock { first_row: first - halo, row_count: halo + kept, ..whole };
            device.compare_views(
                &band,
                &views,
                &pair_buffer,
                &images.texels,
                &self.disparities,
                &mut grey,
                &mut evidence,
            )?;
            device.census_cost(&band, halo, kept, &pair_buffer, &grey, &evidence, &mut costs)?;
        }
        let window = WindowBlock::new(&whole, self.settings.near_cost);
        let mut sums = device.zeros::<Planes>(6 * volume)?;
        device.row_sums(&window, &costs, &mut sums)?;
        drop(costs);
        let mut means = device.zeros::<Planes>(volume)?;
        device.window_cost(&window, &sums, &mut means)?;
        drop(sums);
        let block =
            CostBlock { width: camera.width, height: camera.height, group_count: range.group_count, padding: 0 };
        let mut paths = device.zeros::<Planes>(DIRECTIONS as usize * volume)?;
        device.follow_paths(&block, &means, &mut paths)?;
        device.join_paths(&block, &paths, &mut means)?;
        Ok(means)
    }

    /// Planes for a camera.
    fn range(&self, camera: &CameraBlock) -> Range {
        Range::new(self.space.disparities(camera), self.settings.plane_count)
    }
}

/// Points of confident pixels whose disparity another view's map confirms to within a plane and a half.
fn consistent_points(cameras: &[CameraBlock], maps: &[[f32; 2]], step: f32) -> Vec<Vec3> {
    let mut points = Vec::new();
    for (view, camera) in cameras.iter().enumerate() {
        for row in 2..camera.height.saturating_sub(2) {
            for column in 2..camera.width.saturating_sub(2) {
                let [disparity, confidence] = maps[(camera.first_texel + row * camera.width + column) as usize];
                if confidence < RANGE_CONFIDENCE || disparity < 0.5 * step {
                    continue;
                }
                let towards = camera.towards(column as f32 + 0.5, row as f32 + 0.5);
                let point = camera.centre_world() + towards / disparity;
                let confirms = |other: &CameraBlock| {
                    let seen = other.project(point);
                    seen.in_image && (maps[other.texel_at(seen.x, seen.y)][0] - 1.0 / seen.depth).abs() < 1.5 * step
                };
                if cameras.iter().enumerate().any(|(other, camera)| other != view && confirms(camera)) {
                    points.push(point);
                }
            }
        }
    }
    points
}

/// The pairs that are compared, of the greatest products of weights.
fn pairs(swept: &[SweptView]) -> Vec<ViewPair> {
    let count = swept.len().min(MOST_MATCHED);
    let mut pairs: Vec<ViewPair> = (0..count)
        .flat_map(|first| (first + 1..count).map(move |second| (first, second)))
        .map(|(first, second)| ViewPair {
            first: first as u32,
            second: second as u32,
            weight: swept[first].weight * swept[second].weight,
            padding: 0,
        })
        .collect();
    pairs.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    pairs.truncate((PAIRS_PER_VIEW * count).max(1));
    let sum: f32 = pairs.iter().map(|pair| pair.weight).sum();
    pairs.iter_mut().for_each(|pair| pair.weight /= sum.max(1.0e-30));
    pairs
}

impl<D: Device> Prepared for Views<'_, D> {
    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.relevance = relevance.to_vec();
        self.steps.fill(0.0);
        self.gains = None;
        Ok(())
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        let camera = self.matched.cameras[view];
        let range = self.range(&camera);
        let count = self.matched.cameras.len();
        let relevance = &self.relevance[view];
        let mut weights: Vec<(usize, f32)> =
            (0..count).filter(|other| *other != view).map(|other| (other, relevance.get(other as u32))).collect();
        weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        weights.truncate(NEIGHBOURS);
        weights.push((view, 1.0));
        let swept = self.swept(&self.matched, &self.matched, &weights, false);
        let costs = self.costs(camera, range, &self.matched, &swept, progress)?;
        let frustum = self.frustum(camera, range, &swept);
        self.device.pick_disparity(&frustum, &costs, &mut self.disparities)?;
        self.steps[view] = range.step;
        Ok(())
    }

    fn tunables(&self) -> &'static [Tunable] {
        TUNABLES
    }

    fn tune(&mut self, settings: &[Setting]) {
        let Sweep { plane_count, match_side, .. } = self.settings;
        self.settings = Sweep { plane_count, match_side, ..self.defaults };
        for Setting { name, value } in settings {
            if let Some((_, scalar)) = self.settings.scalars().into_iter().find(|(own, _)| own == name) {
                *scalar = *value;
            }
        }
    }

    fn simplify(&mut self) {
        self.settings.plane_count = self.settings.plane_count.min(TRIAL_PLANES);
    }

    fn surfaces(&self) -> Surfaces {
        self.space.surfaces()
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        if self.gains.is_none() {
            let maps = self.device.download(&self.disparities)?;
            self.gains = Some(exposure::gains(&self.matched.cameras, &self.texels, &maps, &self.steps));
        }
        let device = self.device;
        let &Request { camera: target, views, .. } = request;
        let (width, height) = (target.pinhole.width(), target.pinhole.height());
        let (small_width, small_height) = reduced_size(target, self.settings.match_side);
        let pinhole = target.pinhole.resized(small_width, small_height).map_err(FieldError::unsuitable)?;
        let camera = Camera { pinhole, ..*target }.block(0);
        let weights: Vec<(usize, f32)> = views.iter().copied().zip(request.view_weights()).collect();
        let range = self.range(&camera);
        let matched = self.swept(&self.matched, &self.matched, &weights, true);
        let costs = self.costs(camera, range, &self.matched, &matched, progress)?;
        let blended = self.swept(&self.pictures, &self.matched, &weights, true);
        let block = BlendBlock {
            target: target.block(0),
            far_disparity: range.far_disparity,
            disparity_step: range.step,
            volume_width: camera.width,
            volume_height: camera.height,
            group_count: range.group_count,
            view_count: blended.len() as u32,
            sharpness: 1.0 / self.settings.temperature,
            has_silhouettes: u32::from(self.has_silhouettes),
        };
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
            &self.disparities,
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
        Ok(Rendered { colours, depths, confidences, width, height })
    }
}
