//! What a refinement knows of a picture: at each pixel the best planes, and on each of them every source.

use super::super::planes::TargetPlanes;
use super::super::planes::samples::{Sample, Samples, disparity, excesses, mean, plane_count, samples};
use super::super::planes::visit::Visit;
use anyhow::ensure;
use candle_core::{Device, Tensor};
use viewfuse_kernels::plane_sweep::blend::CUTOFF;

/// Planes of a pixel that a refinement may change: those of least cost. The others stay as they are.
pub(crate) const KEPT: usize = 8;
/// Numbers of a plane: excess of its cost, the least cost, the posterior's spread, its place in it, difference of its colour to
/// the field's, variance over the sources, how much of the weight sees it; then the position: column, row, disparity.
pub(crate) const OF_PLANE: usize = 10;
/// Where a plane's position begins.
pub(crate) const POSITION: usize = 7;
/// Numbers of a source on a plane: visibility, whether in the image, difference to the plane's colour (mean, largest), to the
/// field's, planes behind its own surface, confidence in that; then the logarithm of the camera weight; then the direction:
/// angle to the target's ray, logarithm of the ratio of depths.
pub(crate) const OF_SOURCE: usize = 10;
/// Where the camera weight stands, and where the direction begins.
pub(crate) const WEIGHT: usize = 7;
pub(crate) const DIRECTION: usize = 8;
/// The largest difference between the picture that is put together here and the field's own, of 1.
const MAX_DIFFERENCE: f32 = 2.0e-3;

/// A picture's pixels; rows of all tensors are pixels.
pub(crate) struct Candidates {
    /// The scene.
    pub(crate) scene: String,
    /// All of them, row by row.
    pub(crate) pixels: Pixels,
    /// Which pixels count.
    pub(crate) seen: Vec<bool>,
    /// Mean square error of the field.
    pub(crate) error: f64,
}

/// Pixels as tensors of `f32`.
#[derive(Clone)]
pub(crate) struct Pixels {
    /// `[pixel][plane][OF_PLANE]`.
    pub(crate) plane: Tensor,
    /// `[pixel][plane][source][OF_SOURCE]`.
    pub(crate) source: Tensor,
    /// Straight colours with equal exposures, `[pixel][plane][source][3]`.
    pub(crate) colour: Tensor,
    /// Camera weight times visibility times alpha, `[pixel][plane][source]`.
    pub(crate) part: Tensor,
    /// Shares of the softmax over planes, `[pixel][plane]`.
    pub(crate) share: Tensor,
    /// Sum of the other planes' colours with their shares, and of the shares: `[pixel][4]`.
    pub(crate) rest: Tensor,
    /// The photograph, `[pixel][3]`.
    pub(crate) truth: Tensor,
}

impl Pixels {
    /// Some of them.
    pub(crate) fn select(&self, indices: &Tensor) -> candle_core::Result<Pixels> {
        let of = |tensor: &Tensor| tensor.index_select(indices, 0);
        Ok(Pixels {
            plane: of(&self.plane)?,
            source: of(&self.source)?,
            colour: of(&self.colour)?,
            part: of(&self.part)?,
            share: of(&self.share)?,
            rest: of(&self.rest)?,
            truth: of(&self.truth)?,
        })
    }
}

impl Candidates {
    /// Of a target.
    ///
    /// # Errors
    /// A target of the visual hull, which has no planes, and one whose picture is not the field's own.
    pub(crate) fn of(scene: &str, visit: &Visit<'_>) -> anyhow::Result<Candidates> {
        ensure!(!visit.has_silhouettes, "{scene}: with silhouettes the field is the hull, which has no planes");
        let planes = visit.planes;
        let (excess, least) = excesses(planes);
        let sharpness = planes.block.sharpness;
        let (count, views) = (excess.len(), planes.views.len());
        let scaled = |pixel: usize, plane: usize| excess[pixel][plane] * sharpness;
        let share = |pixel: usize, plane: usize| {
            Some(scaled(pixel, plane)).filter(|e| *e <= CUTOFF).map_or(0.0, |e| (-e).exp())
        };
        let best: Vec<Vec<usize>> = (0..count)
            .map(|pixel| {
                let mut order: Vec<usize> = (0..plane_count(planes)).collect();
                order.sort_by(|a, b| excess[pixel][*a].total_cmp(&excess[pixel][*b]).then(a.cmp(b)));
                order.truncate(KEPT);
                order
            })
            .collect();
        let mut rest = vec![[0.0; 4]; count];
        let mut field = vec![[0.0; 4]; count];
        for plane in 0..plane_count(planes) {
            let own = samples(planes, |_| disparity(planes, plane));
            for pixel in 0..count {
                let (colour, share) = (mean(&own, pixel, |_, sample| sample.part), share(pixel, plane));
                let add = |to: &mut [f32; 4]| {
                    (0..3).for_each(|channel| to[channel] += share * colour[channel]);
                    to[3] += share;
                };
                add(&mut field[pixel]);
                if !best[pixel].contains(&plane) {
                    add(&mut rest[pixel]);
                }
            }
        }
        let field: Vec<[f32; 3]> = field.iter().map(|own| [0, 1, 2].map(|channel| own[channel] / own[3])).collect();
        // Filled holes are not a blend of planes.
        let is_blended = |pixel: &usize| visit.confidences.get(*pixel).is_some_and(|confidence| *confidence > 0.0);
        for pixel in (0..count).filter(is_blended) {
            let (own, of_field) = (field[pixel], visit.colours[pixel]);
            let differs = |channel: usize| !((own[channel] - of_field[channel]).abs() <= MAX_DIFFERENCE);
            ensure!(!(0..3).any(differs), "{scene}: pixel {pixel}: {own:?} is not the field's {of_field:?}");
        }
        let of_rank: Vec<Samples> =
            (0..KEPT).map(|rank| samples(planes, |pixel| disparity(planes, best[pixel][rank]))).collect();
        let mut lists = Lists::default();
        for pixel in 0..count {
            let shares: Vec<f32> = best[pixel].iter().map(|plane| share(pixel, *plane)).collect();
            let all: f32 = shares.iter().sum();
            let moment = |power: i32, from: f32| -> f32 {
                let own =
                    best[pixel].iter().zip(&shares).map(|(plane, share)| share * (*plane as f32 - from).powi(power));
                own.sum::<f32>() / all
            };
            let centre = moment(1, 0.0);
            let spread = moment(2, centre).max(0.0).sqrt();
            for (rank, &plane) in best[pixel].iter().enumerate() {
                let place = [scaled(pixel, plane).min(12.0) / 4.0, 5.0 * least[pixel], spread / 8.0];
                let offset = ((plane as f32 - centre) / 8.0).clamp(-2.0, 2.0);
                lists.plane(visit, &of_rank[rank], pixel, plane, field[pixel], place, offset);
            }
            lists.share.extend(shares);
        }
        let truth = visit.photograph();
        let seen = visit.seen();
        let error = error(&field, &truth, &seen);
        let tensor = |values: Vec<f32>, shape: &[usize]| Tensor::from_vec(values, shape, &Device::Cpu);
        let pixels = Pixels {
            plane: tensor(lists.plane, &[count, KEPT, OF_PLANE])?,
            source: tensor(lists.source, &[count, KEPT, views, OF_SOURCE])?,
            colour: tensor(lists.colour, &[count, KEPT, views, 3])?,
            part: tensor(lists.part, &[count, KEPT, views])?,
            share: tensor(lists.share, &[count, KEPT])?,
            rest: tensor(rest.concat(), &[count, 4])?,
            truth: tensor(truth.concat(), &[count, 3])?,
        };
        Ok(Candidates { scene: scene.to_owned(), pixels, seen, error })
    }

    /// What a picture of these pixels gains over the field, decibels.
    pub(crate) fn gain(&self, picture: &Tensor) -> candle_core::Result<f64> {
        let colours = |tensor: &Tensor| -> candle_core::Result<Vec<[f32; 3]>> {
            Ok(tensor.to_vec2::<f32>()?.into_iter().map(|own| [own[0], own[1], own[2]]).collect())
        };
        let own = error(&colours(picture)?, &colours(&self.pixels.truth)?, &self.seen);
        Ok(10.0 * (self.error / own).log10())
    }
}

/// The mean square error of the pixels that count, of values in `[0, 1]`; at least that of rounding to 8 bits.
fn error(picture: &[[f32; 3]], truth: &[[f32; 3]], seen: &[bool]) -> f64 {
    let square = |(a, b): (&f32, &f32)| f64::from(a.clamp(0.0, 1.0) - b).powi(2);
    let pixels = picture.iter().zip(truth).zip(seen).filter(|(_, seen)| **seen);
    let squares: Vec<f64> = pixels.map(|((a, b), _)| a.iter().zip(b).map(square).sum::<f64>() / 3.0).collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).max(1.0 / 255.0_f64.powi(2) / 12.0)
}

/// Values in the order of the tensors.
#[derive(Default)]
struct Lists {
    plane: Vec<f32>,
    source: Vec<f32>,
    colour: Vec<f32>,
    part: Vec<f32>,
    share: Vec<f32>,
}

impl Lists {
    /// Adds a plane at a pixel. `first` are the plane's first numbers, `offset` its place in the posterior.
    #[allow(clippy::too_many_arguments)]
    fn plane(
        &mut self,
        visit: &Visit<'_>,
        samples: &Samples,
        pixel: usize,
        plane: usize,
        field: [f32; 3],
        first: [f32; 3],
        offset: f32,
    ) {
        let planes = visit.planes;
        let disparity = disparity(planes, plane);
        let colour = mean(samples, pixel, |_, sample| sample.part);
        let (mut variance, mut weight, mut seen) = (0.0, 1.0e-12, 0.0);
        for own in samples {
            let sample = &own[pixel];
            let part = sample.part * sample.alpha;
            variance += part * apart(sample.colour, colour).iter().map(|d| d * d).sum::<f32>();
            weight += part;
            seen += if sample.in_image { sample.part } else { 0.0 };
        }
        let to_field = apart(colour, field).iter().sum::<f32>() / 3.0;
        self.plane.extend(first);
        self.plane.extend([offset, 5.0 * to_field, 5.0 * (variance / weight).sqrt(), seen.min(1.0)]);
        let (width, height) = (visit.size[0] as usize, visit.size[1] as usize);
        let at = [(pixel % width) as f32 / width as f32 - 0.5, (pixel / width) as f32 / height as f32 - 0.5];
        self.plane.extend([at[0], at[1], plane as f32 / plane_count(planes) as f32]);
        for (view, own) in samples.iter().enumerate() {
            let sample = &own[pixel];
            let (mean_apart, most_apart) = spread(apart(sample.colour, colour));
            let (of_field, _) = spread(apart(sample.colour, field));
            let [behind, confidence] = own_surface(planes, view, sample);
            let relative = planes.views[view].weight * planes.views.len() as f32;
            let direction = direction(planes, view, pixel, disparity, sample);
            let visible = [sample.visibility, if sample.in_image { 1.0 } else { 0.0 }];
            self.source.extend(visible);
            self.source.extend([5.0 * mean_apart, 5.0 * most_apart, 5.0 * of_field, behind, confidence]);
            self.source.push((relative.max(1.0e-6).ln() / 2.0).clamp(-2.0, 2.0));
            self.source.extend(direction);
            self.colour.extend(sample.colour);
            self.part.push(sample.part * sample.alpha);
        }
    }
}

fn apart(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|channel| (a[channel] - b[channel]).abs())
}

/// Mean and largest of differences.
fn spread(apart: [f32; 3]) -> (f32, f32) {
    (apart.iter().sum::<f32>() / 3.0, apart.iter().copied().fold(0.0, f32::max))
}

/// How many planes a point lies behind the source's own surface, of 4, from -1 to 1, and the confidence in the surface.
fn own_surface(planes: &TargetPlanes, view: usize, sample: &Sample) -> [f32; 2] {
    let own = &planes.views[view];
    if !sample.in_image || !(own.disparity_step > 0.0) {
        return [0.0; 2];
    }
    let texel = |at: f32, size: u32, map: u32| ((at / size as f32 * map as f32) as u32).min(map - 1) as usize;
    let column = texel(sample.at[0], own.camera.width, own.map_width);
    let row = texel(sample.at[1], own.camera.height, own.map_height);
    let [surface, confidence] =
        planes.disparities[own.first_disparity as usize + row * own.map_width as usize + column];
    [((surface - 1.0 / sample.at[2]) / (8.0 * own.disparity_step)).clamp(-1.0, 1.0), confidence]
}

/// The angle between the rays of target and source in units of 20 degrees, at most 3, and half the logarithm of the depths' ratio.
fn direction(planes: &TargetPlanes, view: usize, pixel: usize, disparity: f32, sample: &Sample) -> [f32; 2] {
    let (target, source) = (&planes.block.target, &planes.views[view].camera);
    let width = target.width as usize;
    let ray = target.towards((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
    // The source's ray, times the disparity: finite for points at infinity.
    let other = ray + (target.centre_world() - source.centre_world()) * disparity;
    let angle = ray.angle_between(other).to_degrees() / 20.0;
    let ratio = (sample.at[2] * disparity.max(1.0e-9)).max(1.0e-3).ln() / 2.0;
    [angle.min(3.0), ratio.clamp(-2.0, 2.0)]
}
