//! The mixture of pictures under several settings: its constants are fitted to the errors on sources that were left
//! out.
//!
//! The constants minimise the squares of the errors on all of these sources, each source's over the mean square error
//! of its plain mean, plus a penalty that draws them towards the plain mean. The last picture is the dearest one, and
//! its errors are the least like the others': it stays out where the mixture without it is better by more than the loss
//! that a mixture may have, and where its share is too small for what it takes. A source's score is that with constants
//! that were fitted to the other ones.

use super::leave_out::{Outcome, Trials};
use super::{MAX_LOSS, mean_score};
use crate::mixture::{Mixture, term_count, terms};
use crate::render::{Frame, RenderError};
use crate::{Rendered, Setting};
use image::RgbImage;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::to_rgb8;
use viewfuse_weighting::Weighting;

/// Fewest sources that are left out for a fit: one alone says nothing of the others.
const MIN_SOURCES: usize = 3;
/// The penalty of a constant's square, where each source's errors weigh [`SOURCE_WEIGHT`]. Penalties from 100 to 1000
/// gave scores within 0.05 dB on four scenes; the greatest keeps nearest to the plain mean, where targets are unlike
/// the sources.
const PENALTY: f64 = 1000.0;
/// The weight of all sources together, in mean squares of the plain mean's errors.
const SOURCE_WEIGHT: f64 = 300.0;

/// Least mean share of the last of three pictures or more. Two targets of fox (288x512, 49 sources): the Gaussians have
/// shares of 0.05 and
/// 0.06, left-out sources gain nothing by them, and with them it takes twice the time.
const MIN_LAST_SHARE: f32 = 0.1;
/// The same of the first source alone, with constants fitted to it, before the picture is made for the others. For 19
/// targets of six scenes it is taken or left out as with the first three sources (host/results/gaussians.md).
const MIN_FIRST_SHARE: f32 = 0.5 * MIN_LAST_SHARE;

/// A mixture with the scores that it has on the sources that were left out.
pub(super) struct Mixed {
    pub(super) mixture: Mixture,
    pub(super) outcomes: Vec<Outcome>,
    /// The mean share of the last picture on these sources.
    last_share: f32,
}

/// The pictures of a source that was left out, and what they should have shown.
struct Example {
    parts: Vec<Rendered>,
    /// `[pixel][term]`.
    terms: Vec<f32>,
    truth: RgbImage,
    /// Whether the photograph shows a pixel.
    seen: Vec<bool>,
}

/// Mixes the pictures under these settings. `None` if there are too few sources or pictures.
///
/// # Errors
/// [`RenderError`].
pub(super) fn mixed(
    trials: &mut Trials<'_>,
    weighting: &Weighting,
    parts: Vec<Vec<Setting>>,
    progress: &dyn Progress,
) -> Result<Option<Mixed>, RenderError> {
    if parts.len() < 2 || trials.len() < MIN_SOURCES {
        return Ok(None);
    }
    let mut examples: Vec<Example> = trials
        .truths()
        .map(|(truth, seen)| Example {
            parts: Vec::new(),
            terms: Vec::new(),
            seen: seen.map_or_else(
                || vec![true; truth.pixels().len()],
                |seen| seen.as_raw().iter().map(|level| *level > 0).collect(),
            ),
            truth: truth.clone(),
        })
        .collect();
    let count = examples.len();
    let cheap = if parts.len() < 3 { parts.len() } else { parts.len() - 1 };
    for settings in &parts[..cheap] {
        add(&mut examples, trials.frames(0..count, weighting, settings, progress)?);
    }
    let without_last = fitted(trials, &mut examples, &parts[..cheap]);
    let Some(last) = parts.get(cheap) else { return Ok(Some(without_last)) };
    // The last picture is the dearest one: a source says whether it has a share at all.
    add(&mut examples, trials.frames(0..1, weighting, last, progress)?);
    if first_share(&mut examples[0], &parts) < MIN_FIRST_SHARE {
        (1..count).for_each(|_| progress.step());
        return Ok(Some(without_last));
    }
    add(&mut examples[1..], trials.frames(1..count, weighting, last, progress)?);
    let all = fitted(trials, &mut examples, &parts);
    let is_worth_it =
        mean_score(&all.outcomes) > mean_score(&without_last.outcomes) - MAX_LOSS && all.last_share >= MIN_LAST_SHARE;
    Ok(Some(if is_worth_it { all } else { without_last }))
}

/// Adds another picture of each example.
fn add(examples: &mut [Example], frames: Vec<Frame>) {
    for (example, frame) in examples.iter_mut().zip(frames) {
        let (width, height) = frame.picture.dimensions();
        let Frame { colours, depths, confidences, .. } = frame;
        example.parts.push(Rendered { colours, depths, confidences, width, height });
    }
}

/// The mean share of an example's last picture, mixed by its own errors.
fn first_share(example: &mut Example, parts: &[Vec<Setting>]) -> f32 {
    example.terms = terms(&example.parts);
    let constants = solved([Sums::of(example)].iter(), parts.len());
    let (_, shares) = Mixture::new(parts.to_vec(), constants).mixed(&example.parts);
    shares.last().copied().unwrap_or(0.0)
}

/// The mixture of the examples' pictures.
fn fitted(trials: &Trials<'_>, examples: &mut [Example], parts: &[Vec<Setting>]) -> Mixed {
    for example in &mut *examples {
        example.terms = terms(&example.parts);
    }
    let sums: Vec<Sums> = examples.iter().map(Sums::of).collect();
    let count = parts.len();
    let mut outcomes = Vec::with_capacity(examples.len());
    let mut last_share = 0.0;
    for (index, example) in examples.iter().enumerate() {
        let others = sums.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, sums)| sums);
        let mixture = Mixture::new(parts.to_vec(), solved(others, count));
        let (rendered, shares) = mixture.mixed(&example.parts);
        last_share += shares.last().copied().unwrap_or(0.0) / examples.len() as f32;
        let picture = to_rgb8(&rendered.colours, [rendered.width, rendered.height]);
        outcomes.push(trials.outcome(index, &picture, &rendered.confidences));
    }
    let mixture = Mixture::new(parts.to_vec(), solved(sums.iter(), count));
    Mixed { mixture, outcomes, last_share }
}

/// The normal equations of a source's errors, over the mean square error of the plain mean.
struct Sums {
    /// Row-major.
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
                for (row, own) in products.iter().enumerate() {
                    right[row] += own * error;
                    let columns = matrix[row * size..].iter_mut().zip(&products);
                    columns.for_each(|(sum, other)| *sum += own * other);
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
    for own in sums {
        matrix.iter_mut().zip(&own.matrix).for_each(|(sum, own)| *sum += own);
        right.iter_mut().zip(&own.right).for_each(|(sum, own)| *sum += own);
        count += 1.0;
    }
    matrix.iter_mut().chain(&mut right).for_each(|sum| *sum /= f64::max(count, 1.0));
    (0..size).for_each(|row| matrix[row * size + row] += PENALTY);
    let solution = cholesky(matrix, right);
    solution.chunks_exact(term_count).map(|own| own.iter().map(|value| *value as f32).collect()).collect()
}

/// Solves `matrix x = right` for a symmetric positive definite matrix, row-major.
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
    fn a_positive_definite_system_is_solved() {
        let matrix = vec![4.0, 2.0, 0.5, 2.0, 5.0, 1.0, 0.5, 1.0, 3.0];
        let expected = [1.0, -2.0, 0.5];
        let right = matrix.chunks_exact(3).map(|row| row.iter().zip(expected).map(|(a, b)| a * b).sum()).collect();
        let solution = cholesky(matrix, right);
        assert!(solution.iter().zip(expected).all(|(own, other)| (own - other).abs() < 1.0e-12), "{solution:?}");
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
            let own = parts[usize::from(!is_left(index))].colours[index];
            Rgb([0, 1, 2].map(|channel| (own[channel] * 255.0).round() as u8))
        });
        Example { terms: terms(&parts), parts, truth, seen: vec![true; 576] }
    }

    #[test]
    fn the_fit_finds_the_picture_that_is_right_in_each_region() {
        let examples = [example(1), example(2), example(3)];
        let sums: Vec<Sums> = examples.iter().map(Sums::of).collect();
        let parts = vec![Vec::new(); 2];
        let fitted = Mixture::new(parts.clone(), solved(sums.iter(), 2));
        let error = |mixture: &Mixture| {
            let (mixed, _) = mixture.mixed(&examples[0].parts);
            let truth = examples[0].truth.pixels();
            let square = |(own, truth): (&[f32; 4], &Rgb<u8>)| (own[0] - f32::from(truth.0[0]) / 255.0).powi(2);
            mixed.colours.iter().zip(truth).map(square).sum::<f32>()
        };
        let (own, plain) = (error(&fitted), error(&Mixture::mean(parts)));
        assert!(own < 0.5 * plain, "{own} instead of {plain}: {:?}", fitted.constants);
    }

    #[test]
    fn equal_pictures_are_mixed_evenly() {
        let mut same = example(5);
        same.parts[1] = same.parts[0].clone();
        let constants = solved([Sums::of(&same)].iter(), 2);
        assert!(constants.iter().flatten().all(|constant| *constant == 0.0), "{constants:?}");
    }
}
