//! Estimates a picture's error from few exact pixels.
//!
//! Most errors are where colours change: half of the pixels are drawn with probabilities that follow the contrast
//! around them, the others evenly where the picture shows something, and evenly everywhere. Each squared difference
//! counts by the inverse of its probability, which makes the estimate unbiased whatever the probabilities are
//! (importance sampling).

use super::Estimate;
use crate::Rendered;
use viewfuse_core::random::uniform;

/// Share of the draws that goes to all pixels alike: what is missing altogether leaves no contrast.
const EVEN_SHARE: f64 = 0.2;
/// Share of the draws that goes to all pixels alike that show something: errors of flat surfaces leave no contrast
/// either.
const SEEN_SHARE: f64 = 0.3;
/// A pixel shows something if its opacity is at least this.
const MIN_OPACITY: f32 = 1.0 / 256.0;
/// Standard errors from the estimate to its upper end: a one-sided 95 % of Student's distribution with 23 degrees of
/// freedom is 1.7; squared differences are skewed.
const STANDARD_ERRORS: f64 = 2.0;

/// A drawn pixel, and the inverse of its probability over the number of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Draw {
    pub(super) pixel: u32,
    pub(super) weight: f64,
}

/// `count` pixels of a picture, with repetition: along the rows, one at random from each of `count` parts of equal
/// probability (stratified sampling). Neighbours are seldom drawn together. Equal steps from a single random begin
/// would do that too, but where a step is about a row all draws are in one column.
pub(super) fn draw(picture: &Rendered, count: usize, seed: u64) -> Vec<Draw> {
    let contrasts = contrasts(picture);
    let contrast: f64 = contrasts.iter().sum();
    let is_seen = |colour: &[f32; 4]| colour[3] >= MIN_OPACITY;
    let seen = picture.colours.iter().filter(|colour| is_seen(colour)).count() as f64;
    let even = 1.0 / contrasts.len().max(1) as f64;
    let seen_share = if seen > 0.0 { SEEN_SHARE } else { 0.0 };
    let contrast_share = if contrast > 0.0 { 1.0 - EVEN_SHARE - SEEN_SHARE } else { 0.0 };
    let even_share = 1.0 - seen_share - contrast_share;
    let at = |draw: usize| (draw as f64 + f64::from(uniform(seed, draw as u32, 0))) / count.max(1) as f64;
    let (mut draws, mut reached) = (Vec::with_capacity(count), 0.0);
    for (pixel, (pixel_contrast, colour)) in contrasts.iter().zip(&picture.colours).enumerate() {
        let of_contrast = if contrast > 0.0 { pixel_contrast / contrast } else { 0.0 };
        let of_seen = if is_seen(colour) { 1.0 / seen } else { 0.0 };
        let probability = even_share * even + seen_share * of_seen + contrast_share * of_contrast;
        reached += probability;
        while draws.len() < count && at(draws.len()) < reached {
            draws.push(Draw { pixel: pixel as u32, weight: even / probability });
        }
    }
    draws
}

/// `count` of so many pixels, drawn evenly: in ascending order, one at random from each of `count` equal parts.
pub(super) fn draw_evenly(pixel_count: usize, count: usize, seed: u64) -> Vec<u32> {
    let at = |draw: usize| (draw as f64 + f64::from(uniform(seed, draw as u32, 0))) / count.max(1) as f64;
    (0..count).map(|draw| ((at(draw) * pixel_count as f64) as u32).min(pixel_count.saturating_sub(1) as u32)).collect()
}

/// Squared contrast of each pixel with its neighbours, the largest of the channels.
fn contrasts(picture: &Rendered) -> Vec<f64> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let contrast = |index: usize| {
        let (column, row) = (index % width, index / width);
        let mut range = [[f32::MAX; 4], [f32::MIN; 4]];
        for row in row.saturating_sub(1)..(row + 2).min(height) {
            for colour in
                &picture.colours[row * width + column.saturating_sub(1)..row * width + (column + 2).min(width)]
            {
                for channel in 0..4 {
                    range[0][channel] = range[0][channel].min(colour[channel]);
                    range[1][channel] = range[1][channel].max(colour[channel]);
                }
            }
        }
        let largest = (0..4).map(|channel| range[1][channel] - range[0][channel]).fold(0.0, f32::max);
        f64::from(largest).powi(2)
    };
    (0..picture.colours.len()).map(contrast).collect()
}

/// Mean square over red, green and blue of the difference of two colours.
pub(super) fn square(a: &[f32; 4], b: &[f32; 4]) -> f64 {
    (0..3).map(|channel| f64::from(a[channel] - b[channel]).powi(2)).sum::<f64>() / 3.0
}

/// The weighted squared differences of the draws so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Sample {
    terms: Vec<f64>,
}

impl Sample {
    /// Adds draws with the exact colours of their pixels.
    pub(super) fn add(&mut self, picture: &Rendered, draws: &[Draw], exact: &[[f32; 4]]) {
        let term =
            |(draw, exact): (&Draw, &[f32; 4])| draw.weight * square(&picture.colours[draw.pixel as usize], exact);
        self.terms.extend(draws.iter().zip(exact).map(term));
    }

    /// Adds what is expected before the first draw, as if it had been drawn this many times: without it, a few draws
    /// that meet none of the large differences would promise too much.
    pub(super) fn expect(&mut self, error: f64, times: usize) {
        self.terms.extend(vec![error * error; times]);
    }

    /// Adds evenly drawn pixels' colours with their exact ones.
    pub(super) fn add_even(&mut self, colours: &[[f32; 4]], exact: &[[f32; 4]]) {
        self.terms.extend(colours.iter().zip(exact).map(|(colour, exact)| square(colour, exact)));
    }

    /// Whether the error is above this but for one time in six: by more than a standard error, which the difference of
    /// a single pixel is not.
    pub(super) fn is_above(&self, most: f64) -> bool {
        let (mean, variance) = self.moments();
        // Not a number is above everything.
        !(mean - (variance / self.terms.len() as f64).sqrt() <= most * most)
    }

    /// Mean and variance of the terms.
    fn moments(&self) -> (f64, f64) {
        let count = self.terms.len() as f64;
        let mean = self.terms.iter().sum::<f64>() / count;
        (mean, self.terms.iter().map(|term| (term - mean).powi(2)).sum::<f64>() / (count - 1.0))
    }

    /// The error; infinite without draws, or if a difference is not finite.
    pub(super) fn estimate(&self) -> Estimate {
        let (mean, variance) = self.moments();
        let upper = mean + STANDARD_ERRORS * (variance / self.terms.len() as f64).sqrt();
        let finite = |value: f64| if value.is_finite() { value.sqrt() } else { f64::INFINITY };
        Estimate { value: finite(mean), upper: finite(upper), pixels: self.terms.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of radius 10 in the middle of 64x64 pixels, with an edge two pixels wide.
    fn disc(shift: f32, brightness: f32) -> Rendered {
        let colour = |index: u32| {
            let (x, y) = ((index % 64) as f32 - 32.0 - shift, (index / 64) as f32 - 32.0);
            let inside = (0.5 * (10.0 - x.hypot(y)) + 0.5).clamp(0.0, 1.0);
            [brightness * inside, 0.5 * inside, 0.2, inside]
        };
        let colours = (0..64 * 64).map(colour).collect();
        Rendered { colours, depths: Vec::new(), confidences: Vec::new(), width: 64, height: 64 }
    }

    fn estimated(picture: &Rendered, truth: &Rendered, seed: u64) -> Estimate {
        let draws = draw(picture, 16, seed);
        let exact: Vec<[f32; 4]> = draws.iter().map(|draw| truth.colours[draw.pixel as usize]).collect();
        let mut sample = Sample::default();
        sample.add(picture, &draws, &exact);
        let estimate = sample.estimate();
        assert_eq!((estimate.pixels, draws.len()), (16, 16));
        estimate
    }

    const COUNT: usize = 4000;

    #[test]
    fn the_estimate_is_unbiased_and_its_upper_end_holds() {
        // An edge that is moved, and a disc that is darker.
        for truth in [disc(0.3, 1.0), disc(0.0, 0.97)] {
            let picture = disc(0.0, 1.0);
            let squares = picture.colours.iter().zip(&truth.colours).map(|(a, b)| square(a, b));
            let error = (squares.sum::<f64>() / 4096.0).sqrt();
            let estimates: Vec<Estimate> = (0..COUNT as u64).map(|seed| estimated(&picture, &truth, seed)).collect();
            let mean = estimates.iter().map(|estimate| estimate.value.powi(2)).sum::<f64>() / COUNT as f64;
            assert!((mean.sqrt() / error - 1.0).abs() < 0.05, "{} {error}", mean.sqrt());
            let missed = estimates.iter().filter(|estimate| estimate.upper < error).count();
            // Without what is expected before the first draw, which a search adds.
            assert!(missed * 4 <= COUNT, "{missed} of {COUNT} below the true error");
        }
    }

    #[test]
    fn a_flat_picture_is_drawn_evenly() {
        let flat = disc(1000.0, 1.0);
        let draws = draw(&flat, 8, 1);
        assert!(draws.iter().all(|draw| (draw.weight - 1.0).abs() < 1.0e-9), "{draws:?}");
        let rows: Vec<u32> = draws.iter().map(|draw| draw.pixel / 512).collect();
        assert_eq!(rows, (0..8).collect::<Vec<u32>>());
    }

    #[test]
    fn draws_of_one_a_row_are_not_in_one_column() {
        let colours = vec![[0.5; 4]; 24 * 24];
        let flat = Rendered { colours, depths: Vec::new(), confidences: Vec::new(), width: 24, height: 24 };
        let meets = |seed: &u64| draw(&flat, 24, *seed).iter().any(|draw| draw.pixel % 24 == 5);
        // 1 - (23 / 24)^24 is 0.64.
        let share = (0..1000).filter(meets).count() as f64 / 1000.0;
        assert!((share - 0.64).abs() < 0.05, "{share}");
    }

    #[test]
    fn one_pixel_tells_nothing_of_a_picture_and_many_do() {
        let with = |wrong: usize| {
            let colour = |index: usize| [if index < wrong { 0.5 } else { 0.0 }; 4];
            let colours: Vec<[f32; 4]> = (0..32).map(colour).collect();
            let mut sample = Sample::default();
            sample.expect(1.0e-3, 8);
            sample.add_even(&colours, &[[0.0; 4]; 32]);
            sample
        };
        assert_eq!([0, 1, 4, 32].map(|wrong| with(wrong).is_above(0.01)), [false, false, true, true]);
        assert!(!with(4).is_above(0.5));
        let mut sample = with(0);
        sample.add_even(&[[f32::NAN; 4]], &[[0.0; 4]]);
        assert!(sample.is_above(0.01));
        let evenly = draw_evenly(64, 8, 3);
        assert_eq!(evenly.iter().map(|pixel| pixel / 8).collect::<Vec<u32>>(), (0..8).collect::<Vec<u32>>());
    }

    #[test]
    fn nothing_known_is_no_estimate() {
        assert_eq!(Sample::default().estimate().upper, f64::INFINITY);
        let mut picture = disc(0.0, 1.0);
        let draws = draw(&picture, 4, 0);
        picture.colours[draws[0].pixel as usize][0] = f32::NAN;
        let mut sample = Sample::default();
        sample.add(&picture, &draws, &[[0.0; 4]; 4]);
        assert_eq!(sample.estimate().upper, f64::INFINITY);
    }
}
