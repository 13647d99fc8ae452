//! Pictures of one target under several settings, mixed by region.
//!
//! ```text
//! share_i = 1 / n + c_i . x   for i > 0, and share_0 the rest; negative ones are 0, and all are divided by their sum
//! x       = 1, k_0 - K, ..., k_(n-1) - K, |d_1|, ..., |d_(n-1)|
//! ```
//!
//! `k_i` is the confidence of picture `i`, `d_i` its disparity less that of picture 0, both averaged over the pixels
//! around. With constants `c` of 0 the mixture is the plain mean. Errors of pictures under different settings are
//! partly independent, so the mean is nearly always nearer to the truth than each of them.
//!
//! ```text
//! near     how much of a mixture is in the picture of a target near its sources
//! ```

mod near;

use crate::{AnyOptions, Rendered};
pub use near::NearTargets;
use serde::Serialize;
use viewfuse_core::pose::Pose;
use viewfuse_device::parallel::{for_each, for_each_row, map};
use viewfuse_job::medians::upper_median;

/// Confidences count from here (`K`).
const USUAL_CONFIDENCE: f32 = 0.3;
/// Root mean square difference of the parts' colours from the mixed one that halves a pixel's confidence: of 0.02, 0.05
/// and 0.1,
/// 0.02 and 0.05 told large errors best on targets of three scenes.
const USUAL_SPREAD: f32 = 0.03;
/// Reach of the mean over pixels, as a share of the longer side; it is taken twice.
const REACH: f32 = 0.01;
/// A difference of disparities counts as a share of this part of the median disparity...
const DISPARITY_SHARE: f32 = 0.1;
/// ... and at most so many times.
const MAX_DIFFERENCE: f32 = 2.0;
/// Pixels, and terms of pixels, that are enough work for a thread.
const MIN_PIXELS: usize = 1024;
const MIN_TERMS: usize = 8 * MIN_PIXELS;

/// Settings under which a target is rendered, and how the pictures are mixed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mixture {
    /// The settings of each picture.
    pub parts: Vec<AnyOptions>,
    /// The constants `c_i` of each picture but the first.
    pub constants: Vec<Vec<f32>>,
    /// Targets whose picture is only partly the mixture; none if all are.
    #[serde(skip)]
    pub near: Option<NearTargets>,
}

/// How many terms a share has, for so many pictures.
pub(crate) fn term_count(parts: usize) -> usize {
    2 * parts
}

impl Mixture {
    /// With these constants.
    pub fn new(parts: Vec<AnyOptions>, constants: Vec<Vec<f32>>) -> Mixture {
        Mixture { parts, constants, near: None }
    }

    /// The plain mean.
    pub fn mean(parts: Vec<AnyOptions>) -> Mixture {
        let constants = vec![vec![0.0; term_count(parts.len())]; parts.len().saturating_sub(1)];
        Mixture::new(parts, constants)
    }

    /// Mixes pictures of one size, in the order of the parts; returns the mean share of each, too. See [`blended`].
    pub(crate) fn mixed(&self, parts: &[Rendered]) -> (Rendered, Vec<f32>) {
        let (terms, count) = (terms(parts), term_count(parts.len()));
        blended(parts, |pixel, shares| self.shares(&terms[pixel * count..][..count], shares))
    }

    /// The share of the mixture in a target's picture; the rest is that of the picture under the chosen settings.
    pub(crate) fn share_at(&self, target: &Pose) -> f32 {
        self.near.as_ref().map_or(1.0, |near| near.share_at(target))
    }

    /// The share of each picture at a pixel with these terms.
    fn shares(&self, terms: &[f32], shares: &mut [f32]) {
        let equal = 1.0 / shares.len() as f32;
        let mut rest = 1.0;
        for (share, constants) in shares[1..].iter_mut().zip(&self.constants) {
            *share = equal + constants.iter().zip(terms).map(|(constant, term)| constant * term).sum::<f32>();
            rest -= *share;
        }
        shares[0] = rest;
        shares.iter_mut().for_each(|share| *share = share.max(0.0));
        // The shares sum to 1 before negative ones are taken away, so that this sum is at least 1.
        let sum: f32 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= sum);
    }
}

/// A picture mixed with another one, which has this share everywhere.
pub(crate) fn between(first: Rendered, second: Rendered, share: f32) -> Rendered {
    blended(&[first, second], |_, shares| shares.copy_from_slice(&[1.0 - share, share])).0
}

/// Pictures of one size, each with a share at each pixel, and the mean share of each. Colours are mixed; confidences
/// are mixed, and divided by 1 plus the spread of the parts' colours over [`USUAL_SPREAD`]; a pixel's depth is that of
/// the picture with the greatest share, so that no surface stands between two others.
fn blended(parts: &[Rendered], shares_at: impl Fn(usize, &mut [f32]) + Sync) -> (Rendered, Vec<f32>) {
    let Some(first) = parts.first() else {
        let nothing =
            Rendered { colours: Vec::new(), depths: Vec::new(), confidences: Vec::new(), width: 0, height: 0 };
        return (nothing, Vec::new());
    };
    let (mut blended, count) = (first.clone(), parts.len());
    let mut shares = vec![0.0; first.colours.len() * count];
    for_each_row(&mut shares, count, MIN_TERMS, shares_at);
    let shares_of = |pixel: usize| &shares[pixel * count..][..count];
    let mean = |pixel: usize, value: &dyn Fn(&Rendered) -> f32| -> f32 {
        parts.iter().zip(shares_of(pixel)).map(|(part, share)| share * value(part)).sum()
    };
    for_each(&mut blended.colours, MIN_PIXELS, |pixel, colour| {
        *colour = [0, 1, 2, 3].map(|channel| mean(pixel, &|part| part.colours[pixel][channel]));
    });
    let colours = &blended.colours;
    for_each(&mut blended.confidences, MIN_PIXELS, |pixel, confidence| {
        let square = |part: &Rendered| -> f32 {
            let difference = |channel: usize| part.colours[pixel][channel] - colours[pixel][channel];
            (0..3).map(|channel| difference(channel).powi(2)).sum::<f32>() / 3.0
        };
        let spread = mean(pixel, &square).sqrt() / USUAL_SPREAD;
        *confidence = mean(pixel, &|part| part.confidences.get(pixel).copied().unwrap_or(0.0)) / (1.0 + spread);
    });
    for_each(&mut blended.depths, MIN_PIXELS, |pixel, depth| {
        let shares = shares_of(pixel);
        let greatest = (1..count).fold(0, |best, part| if shares[part] > shares[best] { part } else { best });
        *depth = parts[greatest].depths.get(pixel).copied().unwrap_or(*depth);
    });
    let mut sums = vec![0.0_f64; count];
    for shares in shares.chunks_exact(count) {
        sums.iter_mut().zip(shares).for_each(|(sum, share)| *sum += f64::from(*share));
    }
    let pixels = blended.colours.len().max(1) as f64;
    (blended, sums.into_iter().map(|sum| (sum / pixels) as f32).collect())
}

/// The terms `x` of all pixels, `[pixel][term]`.
pub(crate) fn terms(parts: &[Rendered]) -> Vec<f32> {
    let Some(Rendered { width, height, colours, .. }) = parts.first() else { return Vec::new() };
    let (size, count) = ([*width as usize, *height as usize], term_count(parts.len()));
    let disparity = |depth: f32| if depth > 0.0 { depth.recip() } else { 0.0 };
    let first: Vec<f32> = parts[0].depths.iter().copied().map(disparity).collect();
    let usual = DISPARITY_SHARE * upper_median(first.iter().copied(), f32::total_cmp).unwrap_or(0.0);
    let confidences = |part: usize| {
        let confidences = &parts[part].confidences;
        (confidences.len() == colours.len()).then(|| smooth(confidences, size))
    };
    let differences = |part: usize| {
        let difference =
            |(depth, first): (&f32, &f32)| ((disparity(*depth) - first) / usual).clamp(-MAX_DIFFERENCE, MAX_DIFFERENCE);
        let differences = || -> Vec<f32> { parts[part].depths.iter().zip(&first).map(difference).collect() };
        (usual > 0.0 && parts[part].depths.len() == first.len()).then(|| smooth(&differences(), size))
    };
    // Confidences of all pictures, and disparities of all but the first.
    let means: Vec<Option<Vec<f32>>> = map(count - 1, 1, |mean| match mean.checked_sub(parts.len()) {
        None => confidences(mean),
        Some(part) => differences(1 + part),
    });
    let mut terms = vec![0.0; colours.len() * count];
    for_each_row(&mut terms, count, MIN_TERMS, |pixel, terms| {
        terms[0] = 1.0;
        for (mean, term) in terms[1..].iter_mut().enumerate() {
            let Some(means) = &means[mean] else { continue };
            *term = if mean < parts.len() { means[pixel] - USUAL_CONFIDENCE } else { means[pixel].abs() };
        }
    });
    terms
}

/// Means over square windows, taken twice; at the border over the pixels in the picture.
fn smooth(values: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let reach = ((REACH * width.max(height) as f32).round() as usize).max(1);
    let once = along(&along(values, height, width, 1, reach), width, height, width, reach);
    along(&along(&once, height, width, 1, reach), width, height, width, reach)
}

/// Means over `2 reach + 1` elements of each of `lines` lines of `length` elements that are `stride` apart.
fn along(values: &[f32], lines: usize, length: usize, stride: usize, reach: usize) -> Vec<f32> {
    let mut means = vec![0.0; values.len()];
    let next_line = if stride == 1 { length } else { 1 };
    let mut sums = vec![0.0_f64; length + 1];
    for line in 0..lines {
        let at = |index: usize| line * next_line + index * stride;
        for index in 0..length {
            sums[index + 1] = sums[index] + f64::from(values[at(index)]);
        }
        for index in 0..length {
            let (first, end) = (index.saturating_sub(reach), (index + reach + 1).min(length));
            means[at(index)] = ((sums[end] - sums[first]) / (end - first) as f64) as f32;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of one colour, confidence and depth.
    fn flat(level: f32, confidence: f32, depth: f32) -> Rendered {
        let (width, height, count) = (6, 4, 24);
        Rendered {
            colours: vec![[level, level, level, 1.0]; count],
            depths: vec![depth; count],
            confidences: vec![confidence; count],
            width,
            height,
        }
    }

    fn near(value: f32, expected: f32) -> bool {
        (value - expected).abs() < 1.0e-6
    }

    #[test]
    fn without_constants_it_is_the_plain_mean() {
        let parts = [flat(0.2, 0.1, 1.0), flat(0.5, 0.3, 2.0), flat(0.8, 0.8, 4.0)];
        let (mixed, shares) = Mixture::mean(vec![AnyOptions::new(()); 3]).mixed(&parts);
        assert!(mixed.colours.iter().all(|colour| near(colour[0], 0.5) && near(colour[3], 1.0)));
        // The colours are 0.3, 0 and 0.3 from the mean, so that the spread is the square root of 0.06.
        let confidence = 0.4 / (1.0 + 0.06_f32.sqrt() / USUAL_SPREAD);
        assert!(mixed.confidences.iter().all(|mixed| near(*mixed, confidence)), "{:?}", mixed.confidences);
        assert!(shares.iter().all(|share| near(*share, 1.0 / 3.0)), "{shares:?}");
    }

    #[test]
    fn the_surer_picture_gets_the_greater_share() {
        let mut mixture = Mixture::mean(vec![AnyOptions::new(()); 2]);
        mixture.constants[0] = vec![0.0, 0.0, 1.0, 0.0];
        let (mixed, shares) = mixture.mixed(&[flat(0.0, 0.3, 1.0), flat(1.0, 0.5, 2.0)]);
        assert!(near(shares[1], 0.7) && near(shares[0], 0.3), "{shares:?}");
        assert!(mixed.colours.iter().all(|colour| near(colour[0], 0.7)));
        assert_eq!(mixed.depths, [2.0; 24], "the depth of the picture with the greater share");
        // No share is negative, and they sum to 1.
        mixture.constants[0][0] = 9.0;
        assert_eq!(mixture.mixed(&[flat(0.0, 0.3, 1.0), flat(1.0, 0.5, 2.0)]).1, [0.0, 1.0]);
    }

    #[test]
    fn a_share_may_be_the_same_everywhere() {
        let (first, second) = (flat(0.2, 0.3, 1.0), flat(0.6, 0.3, 2.0));
        let picture = between(first.clone(), second.clone(), 0.25);
        assert!(picture.colours.iter().all(|colour| near(colour[0], 0.3)));
        assert_eq!(picture.depths, [1.0; 24], "the depth of the picture with the greater share");
        // As with a constant that no term of the pixels changes.
        let mixture = Mixture::new(vec![AnyOptions::new(()); 2], vec![vec![0.25 - 0.5, 0.0, 0.0, 0.0]]);
        assert_eq!(picture, mixture.mixed(&[first, second]).0);
    }

    #[test]
    fn pictures_that_differ_in_depth_are_told() {
        let parts = [flat(0.0, 0.3, 1.0), flat(1.0, 0.3, 1.0 / 1.05)];
        let terms = terms(&parts);
        assert!(terms.chunks_exact(4).all(|terms| terms[0] == 1.0 && near(terms[1], 0.0)));
        assert!(terms.chunks_exact(4).all(|terms| (terms[3] - 0.5).abs() < 1.0e-4), "{terms:?}");
    }

    #[test]
    fn a_mean_over_pixels_keeps_what_is_the_same_everywhere() {
        let values: Vec<f32> = (0..35).map(|index| (index % 7) as f32).collect();
        assert!(smooth(&[2.5; 35], [7, 5]).iter().all(|mean| near(*mean, 2.5)));
        let smooth = smooth(&values, [7, 5]);
        assert!((0..5).all(|row| near(smooth[row * 7 + 3], 3.0)), "a slope stays in the middle: {smooth:?}");
        assert!(smooth[0] > 0.4, "the border is averaged with what lies beside it");
    }
}
