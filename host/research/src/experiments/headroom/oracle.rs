//! Pictures of the training-free field with one of its parts replaced by the truth's choice.
//!
//! Choices by colour are made on windows of 3x3 pixels, the same choice for the window's pixels: a single pixel's colour
//! could be met by accident.

use super::super::planes::TargetPlanes;
use super::super::planes::samples::{Colour, Samples, disparity, excesses, mean, plane_count, samples};
use viewfuse_kernels::plane_sweep::blend::{CUTOFF, HIDDEN_SHARE};

/// Of the sources with the greatest weights, those whose subsets are tried.
const MAX_SUBSET: usize = 5;
/// Factors on the inverse temperature of the softmax over planes.
const FACTORS: [f32; 7] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Steps of the search for the best convex combination.
const STEPS: usize = 60;
/// Share of the posterior from which on a source has a colour.
const MIN_SEEN: f32 = 0.05;
/// A point is on a source's surface up to this difference of depths, as a share of the depth.
const SAME_DEPTH: f32 = 0.03;

/// Colours of a picture, not composited.
pub(crate) type Picture = Vec<Colour>;

/// The pictures.
pub(crate) struct Oracles {
    /// The field's own.
    pub(crate) base: Picture,
    /// The best temperature of the softmax over planes.
    pub(crate) temperature: Picture,
    /// On each plane the best subset of the sources.
    pub(crate) visibility: Picture,
    /// The posterior's colour of the best single source.
    pub(crate) source: Picture,
    /// The best convex combination of the sources' colours under the posterior.
    pub(crate) blend: Picture,
    /// The plane whose blended colour is best.
    pub(crate) depth: Picture,
    /// On that plane the best convex combination.
    pub(crate) depth_blend: Picture,
    /// With the generator's depths.
    pub(crate) exact: Option<Exact>,
    /// The share of the softmax that no source sees, by the field's own visibility.
    pub(crate) unseen: Vec<f32>,
}

/// The pictures with exact depths.
pub(crate) struct Exact {
    /// The field's own visibility.
    pub(crate) depth: Picture,
    /// With exact visibility as well.
    pub(crate) visibility: Picture,
    /// With the best convex combination of the sources in whose image the point is.
    pub(crate) blend: Picture,
    /// Whether no source sees the point; `None` beside an object that is cut out.
    pub(crate) unseen: Vec<Option<bool>>,
}

/// Exact depths from a generator: along the principal axis in world units, infinite where there is nothing.
pub(crate) struct Depths {
    /// Of the target, at the size of the picture.
    pub(crate) target: Vec<f32>,
    /// Of each blended view, at the size of its photograph.
    pub(crate) sources: Vec<Vec<f32>>,
}

/// All pictures for a target. `truth` and `background` are colours in `[0, 1]`.
pub(crate) fn oracles(planes: &TargetPlanes, truth: &[Colour], depths: Option<&Depths>) -> Oracles {
    let shape = Shape { width: planes.block.target.width as usize, height: planes.block.target.height as usize };
    let (count, views) = (shape.width * shape.height, planes.views.len());
    let (excess, _) = excesses(planes);
    let sharpness = planes.block.sharpness;
    let mut base = Mixture::new(count);
    let mut tempered: Vec<Mixture> = FACTORS.iter().map(|_| Mixture::new(count)).collect();
    let mut of_visibility = Mixture::new(count);
    let mut of_views: Vec<Mixture> = (0..views).map(|_| Mixture::new(count)).collect();
    let mut best_plane = vec![(f32::MAX, 0); count];
    let mut unseen = vec![0.0; count];
    // Planes index the excesses of each pixel.
    #[allow(clippy::needless_range_loop)]
    for plane in 0..plane_count(planes) {
        let samples = samples(planes, |_| disparity(planes, plane));
        let share = |pixel: usize, factor: f32| share(excess[pixel][plane] * sharpness * factor);
        let own: Picture = (0..count).map(|pixel| mean(&samples, pixel, |_, sample| sample.part)).collect();
        base.add(&own, |pixel| share(pixel, 1.0));
        for (mixture, factor) in tempered.iter_mut().zip(FACTORS) {
            mixture.add(&own, |pixel| share(pixel, factor));
        }
        of_visibility.add(&best_subset(&shape, planes, &samples, truth), |pixel| share(pixel, 1.0));
        for (mixture, own) in of_views.iter_mut().zip(&samples) {
            let colours: Picture = own.iter().map(|sample| sample.colour).collect();
            let seen = |pixel: usize| if own[pixel].in_image { own[pixel].alpha } else { 0.0 };
            mixture.add(&colours, |pixel| share(pixel, 1.0) * seen(pixel));
        }
        for (pixel, error) in shape.windows(&errors(&own, truth)).into_iter().enumerate() {
            if error < best_plane[pixel].0 {
                best_plane[pixel] = (error, plane);
            }
        }
        for (pixel, unseen) in unseen.iter_mut().enumerate() {
            let most = samples.iter().map(|own| own[pixel].visibility).fold(0.0, f32::max);
            *unseen += share(pixel, 1.0) * (1.0 - most);
        }
    }
    unseen.iter_mut().zip(&base.weights).for_each(|(unseen, weight)| *unseen /= weight.max(1.0e-12));
    let all = base.weights.clone();
    let base = base.picture();
    let tempered: Vec<Picture> = tempered.into_iter().map(Mixture::picture).collect();
    let valid = |view: usize, pixel: usize| of_views[view].weights[pixel] > MIN_SEEN * all[pixel];
    let valid: Vec<Vec<bool>> = (0..views).map(|view| (0..count).map(|pixel| valid(view, pixel)).collect()).collect();
    let posterior: Vec<Picture> = of_views.into_iter().map(Mixture::picture).collect();
    let chosen = samples(planes, |pixel| disparity(planes, best_plane[pixel].1));
    let of_depth: Picture = (0..count).map(|pixel| mean(&chosen, pixel, |_, sample| sample.part)).collect();
    Oracles {
        temperature: best_of(&shape, &tempered, truth),
        visibility: of_visibility.picture(),
        source: best_valid(&shape, &posterior, &valid, &base, truth),
        blend: convex(&shape, &posterior, &valid, &base, truth),
        depth_blend: of_samples(&shape, &chosen, &of_depth, truth),
        depth: of_depth,
        exact: depths.map(|depths| exact(&shape, planes, depths, &base, truth)),
        base,
        unseen,
    }
}

/// Pictures from exact depths. Beside an object that is cut out they are `base`.
fn exact(shape: &Shape, planes: &TargetPlanes, depths: &Depths, base: &Picture, truth: &[Colour]) -> Exact {
    let is_beside = |pixel: usize| planes.block.has_silhouettes != 0 && depths.target[pixel].is_infinite();
    let kept = |picture: Picture| -> Picture {
        picture.iter().enumerate().map(|(pixel, own)| if is_beside(pixel) { base[pixel] } else { *own }).collect()
    };
    let at = samples(planes, |pixel| 1.0 / depths.target[pixel]);
    let sees = |view: usize, pixel: usize| {
        let sample = &at[view][pixel];
        let camera = &planes.views[view].camera;
        let own = &depths.sources[view];
        let texel = camera.texel_at(sample.at[0], sample.at[1]) - camera.first_texel as usize;
        let (surface, depth) = (own[texel], sample.at[2]);
        sample.in_image && ((surface - depth).abs() <= SAME_DEPTH * depth || (surface.is_infinite() && depth > 1.0e6))
    };
    let count = truth.len();
    let visible: Vec<Vec<bool>> =
        (0..at.len()).map(|view| (0..count).map(|pixel| sees(view, pixel)).collect()).collect();
    let weight =
        |view: usize, pixel: usize| planes.views[view].weight * if visible[view][pixel] { 1.0 } else { HIDDEN_SHARE };
    let depth: Picture = (0..count).map(|pixel| mean(&at, pixel, |_, sample| sample.part)).collect();
    let of_visibility = (0..count).map(|pixel| mean(&at, pixel, |view, _| weight(view, pixel))).collect();
    let unseen = |pixel: usize| (!is_beside(pixel)).then(|| !(0..at.len()).any(|view| visible[view][pixel]));
    Exact {
        visibility: kept(of_visibility),
        blend: kept(of_samples(shape, &at, &depth, truth)),
        depth: kept(depth),
        unseen: (0..count).map(unseen).collect(),
    }
}

/// The share of a plane in the softmax, relative to the best one's.
fn share(excess: f32) -> f32 {
    if excess <= CUTOFF { (-excess).exp() } else { 0.0 }
}

/// A weighted mean of pictures.
struct Mixture {
    sums: Picture,
    weights: Vec<f32>,
}

impl Mixture {
    fn new(count: usize) -> Mixture {
        Mixture { sums: vec![[0.0; 3]; count], weights: vec![0.0; count] }
    }

    fn add(&mut self, picture: &[Colour], weight: impl Fn(usize) -> f32) {
        for (pixel, colour) in picture.iter().enumerate() {
            let weight = weight(pixel);
            (0..3).for_each(|channel| self.sums[pixel][channel] += weight * colour[channel]);
            self.weights[pixel] += weight;
        }
    }

    fn picture(self) -> Picture {
        let mean = |(sum, weight): (Colour, f32)| sum.map(|value| value / weight.max(1.0e-12));
        self.sums.into_iter().zip(self.weights).map(mean).collect()
    }
}

/// The size of a picture.
pub(crate) struct Shape {
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl Shape {
    /// Pixels of the 3x3 window around a pixel.
    fn window(&self, pixel: usize) -> impl Iterator<Item = usize> {
        let (width, height) = (self.width, self.height);
        let (column, row) = (pixel % width, pixel / width);
        let rows = row.saturating_sub(1)..(row + 2).min(height);
        rows.flat_map(move |y| (column.saturating_sub(1)..(column + 2).min(width)).map(move |x| y * width + x))
    }

    /// Sums over the windows of all pixels.
    fn windows(&self, values: &[f32]) -> Vec<f32> {
        (0..values.len()).map(|pixel| self.window(pixel).map(|near| values[near]).sum()).collect()
    }
}

/// Squared differences of colours.
pub(crate) fn errors(picture: &[Colour], truth: &[Colour]) -> Vec<f32> {
    let error = |(a, b): (&Colour, &Colour)| (0..3).map(|channel| (a[channel] - b[channel]).powi(2)).sum();
    picture.iter().zip(truth).map(error).collect()
}

/// At each pixel that of the pictures which is best around it.
fn best_of(shape: &Shape, pictures: &[Picture], truth: &[Colour]) -> Picture {
    let everywhere = vec![vec![true; truth.len()]; pictures.len()];
    best_valid(shape, pictures, &everywhere, &pictures[0], truth)
}

/// The same among the pictures that are valid at the pixel; `other` where none is.
fn best_valid(shape: &Shape, pictures: &[Picture], valid: &[Vec<bool>], other: &Picture, truth: &[Colour]) -> Picture {
    let mut best: Vec<(f32, Colour)> = other.iter().map(|colour| (f32::MAX, *colour)).collect();
    for (picture, valid) in pictures.iter().zip(valid) {
        for (pixel, error) in shape.windows(&errors(picture, truth)).into_iter().enumerate() {
            if valid[pixel] && error < best[pixel].0 {
                best[pixel] = (error, picture[pixel]);
            }
        }
    }
    best.into_iter().map(|(_, colour)| colour).collect()
}

/// The best subset of the sources with the greatest weights on a plane, camera weights inside the subset.
fn best_subset(shape: &Shape, planes: &TargetPlanes, samples: &Samples, truth: &[Colour]) -> Picture {
    let most = planes.views.len().min(MAX_SUBSET);
    let own: Picture = (0..truth.len()).map(|pixel| mean(samples, pixel, |_, sample| sample.part)).collect();
    let mut pictures = vec![own.clone()];
    let mut valid = vec![vec![true; truth.len()]];
    for subset in 1..1_usize << most {
        let has = |view: usize| subset >> view & 1 == 1;
        let weight = |view: usize| if has(view) { planes.views[view].weight } else { 0.0 };
        let in_all = |pixel: usize| (0..most).all(|view| !has(view) || samples[view][pixel].in_image);
        pictures.push((0..truth.len()).map(|pixel| mean(samples, pixel, |view, _| weight(view))).collect());
        valid.push((0..truth.len()).map(in_all).collect());
    }
    best_valid(shape, &pictures, &valid, &own, truth)
}

/// The best convex combination of the sources' samples that are in the image.
fn of_samples(shape: &Shape, samples: &Samples, other: &Picture, truth: &[Colour]) -> Picture {
    let pictures: Vec<Picture> = samples.iter().map(|own| own.iter().map(|sample| sample.colour).collect()).collect();
    let valid: Vec<Vec<bool>> =
        samples.iter().map(|own| own.iter().map(|sample| sample.in_image && sample.alpha > 0.5).collect()).collect();
    convex(shape, &pictures, &valid, other, truth)
}

/// At each pixel the convex combination of the valid pictures that is best around it, by Frank and Wolfe's method; `other` where
/// none is valid.
fn convex(shape: &Shape, pictures: &[Picture], valid: &[Vec<bool>], other: &Picture, truth: &[Colour]) -> Picture {
    let combined = |pixel: usize| {
        let views: Vec<usize> = (0..pictures.len()).filter(|view| valid[*view][pixel]).collect();
        if views.is_empty() {
            return other[pixel];
        }
        let near: Vec<usize> = shape.window(pixel).collect();
        let dot = |a: &dyn Fn(usize, usize) -> f32, b: &dyn Fn(usize, usize) -> f32| -> f32 {
            near.iter().flat_map(|p| (0..3).map(move |channel| (*p, channel))).map(|(p, c)| a(p, c) * b(p, c)).sum()
        };
        let of = |view: usize| move |p: usize, channel: usize| pictures[view][p][channel] - truth[p][channel];
        // With weights that sum to 1 the error is a quadratic form of the single sources' errors.
        let gram: Vec<Vec<f32>> = views.iter().map(|&a| views.iter().map(|&b| dot(&of(a), &of(b))).collect()).collect();
        let first = (0..views.len()).min_by(|a, b| gram[*a][*a].total_cmp(&gram[*b][*b])).unwrap_or(0);
        let mut weights = vec![0.0; views.len()];
        weights[first] = 1.0;
        for _ in 0..STEPS {
            let slope: Vec<f32> = gram.iter().map(|row| row.iter().zip(&weights).map(|(g, w)| g * w).sum()).collect();
            let least = (0..views.len()).min_by(|a, b| slope[*a].total_cmp(&slope[*b])).unwrap_or(0);
            let value: f32 = slope.iter().zip(&weights).map(|(s, w)| s * w).sum();
            let curvature = gram[least][least] - 2.0 * slope[least] + value;
            let step = if curvature > 1.0e-12 { ((value - slope[least]) / curvature).clamp(0.0, 1.0) } else { 0.0 };
            weights.iter_mut().for_each(|weight| *weight *= 1.0 - step);
            weights[least] += step;
        }
        let mut colour = [0.0; 3];
        for (view, weight) in views.iter().zip(&weights) {
            (0..3).for_each(|channel| colour[channel] += weight * pictures[*view][pixel][channel]);
        }
        colour
    };
    (0..truth.len()).map(combined).collect()
}
