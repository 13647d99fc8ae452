//! Exposure: a gain for each source and channel, that equalise the exposure of photographs of the same surfaces.

use viewfuse_core::camera::CameraBlock;
use viewfuse_device::parallel::map;
use viewfuse_job::medians::upper_median;

/// Confidence from which on a pixel's disparity counts.
const MIN_CONFIDENCE: f32 = 0.6;
/// Stride of the pixels that are sampled, along both axes.
const STRIDE: u32 = 3;
/// Colours that are compared lie between these: neither black nor saturated.
const COMPARABLE: std::ops::Range<f32> = 0.04..0.94;
/// Fewest common points of a usable pair.
const MIN_POINTS: usize = 24;
/// Median absolute deviation of a pair's logarithms above which it is ignored.
const MAX_SPREAD: f64 = 0.06;
/// Weight of the prior towards a gain of 1, in common points.
const PRIOR_POINTS: f64 = 64.0;
/// Gains as natural logarithms: those below the first are not applied, those above the second are rejected.
const GAINS: (f64, f64) = (0.03, 0.7);
/// Iterations over the sources for solving the equations.
const ITERATIONS: usize = 200;

/// The estimate from a pair of sources: the second one's colours over the first one's.
struct Ratio {
    first: usize,
    second: usize,
    /// Median of the logarithms, for each channel.
    logarithms: [f64; 3],
    count: f64,
}

/// The gain of each source: red, green, blue, 1. `maps[texel]` are disparity and confidence, `steps[view]` from a
/// plane's disparity to the next one's, or 0 for a view that is not used. The gains' logarithms solve the pairs'
/// equations `g(first) - g(second) = ratio` in the sense of least squares and are 0 in the mean. All are 1 where
/// sources differ by less than 3 %.
pub(super) fn gains(cameras: &[CameraBlock], texels: &[[f32; 4]], maps: &[[f32; 2]], steps: &[f32]) -> Vec<[f32; 4]> {
    let ratios = ratios(cameras, texels, maps, steps);
    let mut gains = vec![[1.0; 4]; cameras.len()];
    for channel in 0..3 {
        let mut logarithms = vec![0.0_f64; cameras.len()];
        for _ in 0..ITERATIONS {
            for view in 0..cameras.len() {
                let (mut sum, mut count) = (0.0, PRIOR_POINTS);
                for ratio in &ratios {
                    let (other, sign) = match view {
                        view if view == ratio.first => (ratio.second, 1.0),
                        view if view == ratio.second => (ratio.first, -1.0),
                        _ => continue,
                    };
                    sum += ratio.count * (logarithms[other] + sign * ratio.logarithms[channel]);
                    count += ratio.count;
                }
                logarithms[view] = sum / count;
            }
        }
        let used = logarithms.iter().zip(steps).filter(|(_, step)| **step > 0.0);
        let (count, sum) = used.fold((0_usize, 0.0), |(count, sum), (logarithm, _)| (count + 1, sum + logarithm));
        let mean = sum / count.max(1) as f64;
        for (gain, logarithm) in gains.iter_mut().zip(&logarithms) {
            let logarithm = logarithm - mean;
            if logarithm.abs() > GAINS.0 {
                gain[channel] = logarithm.clamp(-GAINS.1, GAINS.1).exp() as f32;
            }
        }
    }
    gains
}

/// The weighted geometric mean of views' gains; `weights` are views with their weights.
pub(super) fn common(gains: &[[f32; 4]], weights: &[(usize, f32)]) -> [f32; 4] {
    let sum: f64 = weights.iter().map(|(_, weight)| f64::from(*weight)).sum();
    [0, 1, 2, 3].map(|channel| {
        let part = |(view, weight): &(usize, f32)| f64::from(*weight) * f64::from(gains[*view][channel]).ln();
        (weights.iter().map(part).sum::<f64>() / sum.max(1.0e-12)).exp() as f32
    })
}

/// The medians of all pairs with enough common points.
fn ratios(cameras: &[CameraBlock], texels: &[[f32; 4]], maps: &[[f32; 2]], steps: &[f32]) -> Vec<Ratio> {
    let of =
        |first: usize| if steps[first] > 0.0 { ratios_of(first, cameras, texels, maps, steps) } else { Vec::new() };
    map(cameras.len(), 1, of).into_iter().flatten().collect()
}

/// Those of a view and each other.
fn ratios_of(
    first: usize,
    cameras: &[CameraBlock],
    texels: &[[f32; 4]],
    maps: &[[f32; 2]],
    steps: &[f32],
) -> Vec<Ratio> {
    let (camera, mut ratios) = (&cameras[first], Vec::new());
    let mut logarithms: Vec<[Vec<f64>; 3]> = cameras.iter().map(|_| Default::default()).collect();
    for (row, column) in grid(camera) {
        let texel = (camera.first_texel + row * camera.width + column) as usize;
        let [disparity, confidence] = maps[texel];
        if confidence < MIN_CONFIDENCE || disparity < 0.5 * steps[first] {
            continue;
        }
        let point = camera.centre_world() + camera.towards(column as f32 + 0.5, row as f32 + 0.5) / disparity;
        for (second, other) in cameras.iter().enumerate().filter(|(view, _)| *view != first && steps[*view] > 0.0) {
            let seen = other.project(point);
            if !seen.in_image {
                continue;
            }
            let at = other.texel_at(seen.x, seen.y);
            if (maps[at][0] - 1.0 / seen.depth).abs() > 1.5 * steps[second] {
                continue;
            }
            let (here, there) = (texels[texel], texels[at]);
            for channel in 0..3 {
                if COMPARABLE.contains(&here[channel]) && COMPARABLE.contains(&there[channel]) {
                    logarithms[second][channel].push(f64::from(there[channel] / here[channel]).ln());
                }
            }
        }
    }
    for (second, mut channels) in logarithms.into_iter().enumerate() {
        let count = channels.iter().map(Vec::len).min().unwrap_or(0);
        if count >= MIN_POINTS {
            let medians = [0, 1, 2].map(|channel| median(&channels[channel]));
            let spreads = [0, 1, 2].map(|channel| {
                channels[channel].iter_mut().for_each(|value| *value = (*value - medians[channel]).abs());
                median(&channels[channel])
            });
            // Exposure changes all surfaces alike; light that depends on the direction does not.
            if spreads.iter().any(|spread| *spread > MAX_SPREAD) {
                continue;
            }
            ratios.push(Ratio { first, second, logarithms: medians, count: count as f64 });
        }
    }
    ratios
}

/// Pixels of a camera's image, away from its border.
fn grid(camera: &CameraBlock) -> impl Iterator<Item = (u32, u32)> {
    let (width, height) = (camera.width, camera.height);
    let rows = (2..height.saturating_sub(2)).step_by(STRIDE as usize);
    rows.flat_map(move |row| (2..width.saturating_sub(2)).step_by(STRIDE as usize).map(move |column| (row, column)))
}

/// The median of at least one value.
fn median(values: &[f64]) -> f64 {
    upper_median(values.iter().copied(), f64::total_cmp).expect("points")
}
