//! The mixture of pictures under several settings: its constants are fitted to the errors on held-out sources.
//!
//! The constants minimise the squares of the errors on all of these sources, each source's over the mean square error
//! of its plain mean, plus a penalty that draws them towards the plain mean. The last picture is the dearest one, and
//! its errors are the least like the others': it stays out where the mixture without it is better by more than the loss
//! that a mixture may have, and where its share is too small for what it takes. A source's score is that with constants
//! that were fitted to the other ones.
//!
//! Of several mixtures those are tried further that are not far below the best one at the source that is nearest to the
//! others, with constants fitted to it alone, nor below one picture under the chosen settings.

use super::MAX_LOSS;
use super::gain::{is_preferred, mean_score};
use super::held_out::{HeldOutSources, Outcome};
use crate::mixture::{Mixture, term_count, terms};
use crate::render::RenderError;
use crate::{AnyOptions, Rendered, Variant};
use image::RgbImage;
use std::ops::Range;
use viewfuse_device::parallel::{for_each, map};
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::{GroundTruth, to_rgb8};
use viewfuse_weighting::Weighting;

/// Fewest held-out sources for a fit: one alone says nothing of the others.
const MIN_SOURCES: usize = 3;
/// The penalty of a constant's square, where each source's errors weigh [`SOURCE_WEIGHT`]
/// (`host/results/front_to_back.md`, "Mixtures by region").
const PENALTY: f64 = 1000.0;
/// The weight of all sources together, in mean squares of the plain mean's errors.
const SOURCE_WEIGHT: f64 = 300.0;

/// Least mean share of the last of three pictures or more: with less, nothing is gained for twice the time
/// (`host/results/gaussians.md`).
const MIN_LAST_SHARE: f32 = 0.1;
/// The same of the first source alone, with constants fitted to it, before the picture is made for the others (the same
/// page).
const MIN_FIRST_SHARE: f32 = 0.5 * MIN_LAST_SHARE;

/// How far below the best of several mixtures another one may be at the source that is nearest to the others, to be
/// tried on the other ones, decibels (`host/results/objects.md`).
const MAX_BELOW: f64 = 0.5;

/// A mixture with the scores that it has on the held-out sources.
pub(super) struct Mixed {
    pub(super) label: String,
    pub(super) mixture: Mixture,
    pub(super) outcomes: Vec<Outcome>,
    /// The score of the last picture alone at the source that is nearest to the others, decibels.
    pub(super) last_at_nearest: f64,
    /// The mean share of the last picture on these sources.
    last_share: f32,
}

/// The pictures of a held-out source, and what they should have shown.
struct Example {
    parts: Vec<Rendered>,
    /// `[pixel][term]`.
    terms: Vec<f32>,
    truth: RgbImage,
    /// Whether the photograph shows a pixel.
    seen: Vec<bool>,
}

impl Example {
    fn of(GroundTruth { picture, seen }: &GroundTruth) -> Example {
        let seen = match seen {
            Some(seen) => seen.as_raw().iter().map(|level| *level > 0).collect(),
            None => vec![true; picture.pixels().len()],
        };
        Example { parts: Vec::new(), terms: Vec::new(), truth: picture.clone(), seen }
    }
}

/// Mixes the pictures of each of these mixtures, as far as it is tried, in place of a `single` one; the best one is the
/// last. Nothing if there are too few sources.
pub(super) fn mixed(
    held_out: &mut HeldOutSources<'_>,
    weighting: &Weighting,
    mixtures: Vec<Variant<Vec<AnyOptions>>>,
    single: &[Outcome],
    progress: &dyn Progress,
) -> Result<Vec<Mixed>, RenderError> {
    let mut all: Vec<Mixed> = Vec::new();
    if held_out.len() < MIN_SOURCES {
        return Ok(all);
    }
    for Variant { label, options: parts, .. } in further(held_out, weighting, mixtures, single, progress)? {
        let mixed = one(held_out, weighting, (label, parts), progress)?;
        let is_best = all.last().is_none_or(|best| is_preferred(&mixed.outcomes, &best.outcomes));
        all.insert(if is_best { all.len() } else { all.len() - 1 }, mixed);
    }
    Ok(all)
}

/// The mixtures that are tried further: see the module.
fn further(
    held_out: &mut HeldOutSources<'_>,
    weighting: &Weighting,
    mixtures: Vec<Variant<Vec<AnyOptions>>>,
    single: &[Outcome],
    progress: &dyn Progress,
) -> Result<Vec<Variant<Vec<AnyOptions>>>, RenderError> {
    if mixtures.len() < 2 {
        return Ok(mixtures);
    }
    progress.expect(mixtures.iter().map(|mixture| mixture.options.len()).sum());
    let nearest = held_out.nearest();
    let mut scores = Vec::with_capacity(mixtures.len());
    for Variant { options: parts, .. } in &mixtures {
        let mut example: Vec<Example> = held_out.truths().skip(nearest).take(1).map(Example::of).collect();
        add(&mut example, held_out.frames(weighting, &under(nearest..nearest + 1, parts), progress)?);
        let (rendered, _) = by_its_own(&mut example[0], parts);
        scores.push(held_out.outcome(nearest, &picture(&rendered), &rendered.confidences).psnr);
    }
    let is_near = near_the_best(&scores, single[nearest].psnr);
    Ok(mixtures.into_iter().zip(is_near).filter(|(_, is_near)| *is_near).map(|(mixture, _)| mixture).collect())
}

/// Which of the scores are at most [`MAX_BELOW`] below the best one, and not below that of a `single` picture by twice
/// the loss that a mixture may have there: with constants fitted to other sources, none had 0.02 dB more
/// (`host/results/objects.md`).
fn near_the_best(scores: &[f64], single: f64) -> Vec<bool> {
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    scores.iter().map(|score| *score >= (best - MAX_BELOW).max(single - 2.0 * MAX_LOSS)).collect()
}

/// Mixes the pictures under these options.
fn one(
    held_out: &mut HeldOutSources<'_>,
    weighting: &Weighting,
    (label, parts): (String, Vec<AnyOptions>),
    progress: &dyn Progress,
) -> Result<Mixed, RenderError> {
    let mut examples: Vec<Example> = held_out.truths().map(Example::of).collect();
    progress.expect(examples.len() * parts.len());
    let count = examples.len();
    let cheap = if parts.len() < 3 { parts.len() } else { parts.len() - 1 };
    add(&mut examples, held_out.frames(weighting, &under(0..count, &parts[..cheap]), progress)?);
    let without_last = fitted(held_out, &mut examples, &label, &parts[..cheap]);
    let last = &parts[cheap..];
    if last.is_empty() {
        return Ok(without_last);
    }
    // The last picture is the dearest one: a source says whether it has a share at all.
    add(&mut examples, held_out.frames(weighting, &under(0..1, last), progress)?);
    let (_, first_shares) = by_its_own(&mut examples[0], &parts);
    if first_shares.last().is_none_or(|share| *share < MIN_FIRST_SHARE) {
        (1..count).for_each(|_| progress.step());
        return Ok(without_last);
    }
    add(&mut examples[1..], held_out.frames(weighting, &under(1..count, last), progress)?);
    let all = fitted(held_out, &mut examples, &label, &parts);
    let is_worth_it =
        mean_score(&all.outcomes) > mean_score(&without_last.outcomes) - MAX_LOSS && all.last_share >= MIN_LAST_SHARE;
    Ok(if is_worth_it { all } else { without_last })
}

/// The same sources under each of some options.
fn under(which: Range<usize>, options: &[AnyOptions]) -> Vec<(Range<usize>, &AnyOptions)> {
    options.iter().map(|options| (which.clone(), options)).collect()
}

/// Adds more pictures of each example.
fn add(examples: &mut [Example], frames: Vec<Vec<Rendered>>) {
    for frames in frames {
        for (example, frame) in examples.iter_mut().zip(frames) {
            example.parts.push(frame);
        }
    }
}

/// An example's pictures, mixed by its own errors, with the mean share of each.
fn by_its_own(example: &mut Example, parts: &[AnyOptions]) -> (Rendered, Vec<f32>) {
    example.terms = terms(&example.parts);
    let constants = solved([Sums::of(example)].iter(), parts.len());
    Mixture::new(parts.to_vec(), constants).mixed(&example.parts)
}

/// In whole levels.
fn picture(rendered: &Rendered) -> RgbImage {
    to_rgb8(&rendered.colours, [rendered.width, rendered.height])
}

/// The mixture of the examples' pictures.
fn fitted(held_out: &HeldOutSources<'_>, examples: &mut [Example], label: &str, parts: &[AnyOptions]) -> Mixed {
    for_each(examples, 1, |_, example| example.terms = terms(&example.parts));
    let sums = map(examples.len(), 1, |index| Sums::of(&examples[index]));
    let count = parts.len();
    let without = |index: usize| {
        let others = sums.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, sums)| sums);
        Mixture::new(parts.to_vec(), solved(others, count))
    };
    let mixed = map(examples.len(), 1, |index| without(index).mixed(&examples[index].parts));
    let mut outcomes = Vec::with_capacity(examples.len());
    let mut last_share = 0.0;
    for (index, (rendered, shares)) in mixed.iter().enumerate() {
        last_share += shares.last().copied().unwrap_or(0.0) / examples.len() as f32;
        outcomes.push(held_out.outcome(index, &picture(rendered), &rendered.confidences));
    }
    let mixture = Mixture::new(parts.to_vec(), solved(sums.iter(), count));
    let nearest = held_out.nearest();
    let alone = examples[nearest].parts.last().map(picture);
    let last_at_nearest = alone.map_or(0.0, |alone| held_out.outcome(nearest, &alone, &[]).psnr);
    Mixed { label: label.to_owned(), mixture, outcomes, last_at_nearest, last_share }
}

/// The normal equations of a source's errors, over the mean square error of the plain mean.
struct Sums {
    /// Row-major, its lower half: it is symmetric.
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Sums {
    fn of(example: &Example) -> Sums {
        let Example { parts, terms, truth, seen } = example;
        let term_count = term_count(parts.len());
        let size = (parts.len() - 1) * term_count;
        let (mut matrix, mut right, mut square) = (vec![0.0; size * size], vec![0.0; size], 0.0);
        let mut products = vec![0.0; size];
        let pixels = truth.pixels().zip(seen).zip(terms.chunks_exact(term_count)).enumerate();
        for (pixel, ((truth, _), terms)) in pixels.filter(|(_, ((_, seen), _))| **seen) {
            for channel in 0..3 {
                let value = |part: &Rendered| f64::from(part.colours[pixel][channel]);
                let mean = parts.iter().map(value).sum::<f64>() / parts.len() as f64;
                let error = f64::from(truth.0[channel]) / 255.0 - mean;
                square += error * error;
                for (part, products) in parts[1..].iter().zip(products.chunks_exact_mut(term_count)) {
                    let change = value(part) - value(&parts[0]);
                    products.iter_mut().zip(terms).for_each(|(product, term)| *product = change * f64::from(*term));
                }
                for (row, product) in products.iter().enumerate() {
                    right[row] += product * error;
                    let columns = matrix[row * size..].iter_mut().zip(&products[..=row]);
                    columns.for_each(|(sum, other)| *sum += product * other);
                }
            }
        }
        let scale = if square > 0.0 { 3.0 * SOURCE_WEIGHT / square } else { 0.0 };
        matrix.iter_mut().chain(&mut right).for_each(|sum| *sum *= scale);
        Sums { matrix, right }
    }
}

/// The constants of each picture but the first, from the sums of some sources.
fn solved<'s>(sums: impl Iterator<Item = &'s Sums>, parts: usize) -> Vec<Vec<f32>> {
    let term_count = term_count(parts);
    let size = (parts - 1) * term_count;
    let (mut matrix, mut right, mut count) = (vec![0.0; size * size], vec![0.0; size], 0.0);
    for source in sums {
        matrix.iter_mut().zip(&source.matrix).for_each(|(sum, term)| *sum += term);
        right.iter_mut().zip(&source.right).for_each(|(sum, term)| *sum += term);
        count += 1.0;
    }
    matrix.iter_mut().chain(&mut right).for_each(|sum| *sum /= f64::max(count, 1.0));
    (0..size).for_each(|row| matrix[row * size + row] += PENALTY);
    let solution = cholesky(matrix, right);
    solution.chunks_exact(term_count).map(|constants| constants.iter().map(|value| *value as f32).collect()).collect()
}

/// Solves `matrix x = right` for a symmetric positive definite matrix, row-major, of which the lower half is read.
fn cholesky(mut matrix: Vec<f64>, right: Vec<f64>) -> Vec<f64> {
    let size = right.len();
    for row in 0..size {
        for column in 0..=row {
            let products = (0..column).map(|k| matrix[row * size + k] * matrix[column * size + k]);
            let rest = matrix[row * size + column] - products.sum::<f64>();
            matrix[row * size + column] =
                if row == column { rest.max(f64::MIN_POSITIVE).sqrt() } else { rest / matrix[column * size + column] };
        }
    }
    let mut solution = right;
    for row in 0..size {
        let products: f64 = (0..row).map(|k| matrix[row * size + k] * solution[k]).sum();
        solution[row] = (solution[row] - products) / matrix[row * size + row];
    }
    for row in (0..size).rev() {
        let products: f64 = (row + 1..size).map(|k| matrix[k * size + row] * solution[k]).sum();
        solution[row] = (solution[row] - products) / matrix[row * size + row];
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn one_source_decides_which_mixtures_are_tried_further() {
        assert_eq!(near_the_best(&[23.0, 25.0, 24.75], 20.0), [false, true, true]);
        assert_eq!(near_the_best(&[23.0, 25.0, 24.75], 25.0625), [false, true, false]);
        assert_eq!(near_the_best(&[23.0, 25.0, 24.75], 25.125), [false; 3]);
        assert!(near_the_best(&[], 20.0).is_empty());
    }

    #[test]
    fn a_positive_definite_system_is_solved() {
        let matrix = vec![4.0, 2.0, 0.5, 2.0, 5.0, 1.0, 0.5, 1.0, 3.0];
        let expected = [1.0, -2.0, 0.5];
        let right = matrix.chunks_exact(3).map(|row| row.iter().zip(expected).map(|(a, b)| a * b).sum()).collect();
        let solution = cholesky(matrix, right);
        assert!(
            solution.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1.0e-12),
            "{solution:?}"
        );
    }

    /// Two pictures of noise, and a truth that is the first one where it is sure and the second one elsewhere.
    fn example(salt: usize) -> Example {
        let (width, height) = (24_u32, 24_u32);
        let noise = |index: usize, salt: usize| ((index * 7919 + salt * 104_729) % 251) as f32 / 250.0;
        let is_left = |index: usize| index % 24 < 12;
        let part = |part: usize| Rendered {
            colours: (0..576)
                .map(|index| [noise(index, salt + part * 31); 3])
                .map(|[r, g, b]| [r, g, b, 1.0])
                .collect(),
            depths: vec![1.0; 576],
            confidences: (0..576).map(|index| if is_left(index) == (part == 0) { 0.8 } else { 0.1 }).collect(),
            width,
            height,
        };
        let parts = vec![part(0), part(1)];
        let truth = RgbImage::from_fn(width, height, |x, y| {
            let index = (y * width + x) as usize;
            let colour = parts[usize::from(!is_left(index))].colours[index];
            Rgb([0, 1, 2].map(|channel| (colour[channel] * 255.0).round() as u8))
        });
        Example { terms: terms(&parts), parts, truth, seen: vec![true; 576] }
    }

    #[test]
    fn the_fit_finds_the_picture_that_is_right_in_each_region() {
        let examples = [example(1), example(2), example(3)];
        let sums: Vec<Sums> = examples.iter().map(Sums::of).collect();
        let parts = vec![AnyOptions::new(()); 2];
        let fitted = Mixture::new(parts.clone(), solved(sums.iter(), 2));
        let error = |mixture: &Mixture| {
            let (mixed, _) = mixture.mixed(&examples[0].parts);
            let truth = examples[0].truth.pixels();
            let square = |(colour, truth): (&[f32; 4], &Rgb<u8>)| (colour[0] - f32::from(truth.0[0]) / 255.0).powi(2);
            mixed.colours.iter().zip(truth).map(square).sum::<f32>()
        };
        let (error_fitted, error_plain) = (error(&fitted), error(&Mixture::mean(parts)));
        assert!(error_fitted < 0.5 * error_plain, "{error_fitted} instead of {error_plain}: {:?}", fitted.constants);
    }

    #[test]
    fn sums_are_of_all_terms() {
        let example = example(4);
        let (terms, changes) =
            (example.terms.chunks_exact(4), example.parts[0].colours.iter().zip(&example.parts[1].colours));
        let sums = Sums::of(&example);
        // Grey pictures: each pixel counts three times.
        let pixels = terms.zip(changes).zip(example.truth.pixels());
        let (mut square, mut expected) = (0.0, [0.0; 3]);
        for ((terms, (first, second)), truth) in pixels {
            let (first, second) = (f64::from(first[0]), f64::from(second[0]));
            square += (f64::from(truth.0[0]) / 255.0 - (first + second) / 2.0).powi(2);
            for (sum, term) in expected.iter_mut().zip(terms) {
                *sum += ((second - first) * f64::from(*term)).powi(2);
            }
        }
        for (term, expected) in expected.into_iter().enumerate() {
            let (found, expected) = (sums.matrix[term * 4 + term], 3.0 * SOURCE_WEIGHT * expected / square);
            assert!((found / expected - 1.0).abs() < 1.0e-9, "term {term}: {found} instead of {expected}");
        }
    }

    #[test]
    fn equal_pictures_are_mixed_evenly() {
        let mut same = example(5);
        same.parts[1] = same.parts[0].clone();
        let constants = solved([Sums::of(&same)].iter(), 2);
        assert!(constants.iter().flatten().all(|constant| *constant == 0.0), "{constants:?}");
    }
}
