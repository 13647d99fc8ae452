//! Picture quality: PSNR and SSIM of 8-bit images, in `f64`.
//!
//! Images are `u8`, `[row][column][channel]`, flat, of equal size. Both metrics are those of scikit-image
//! (`peak_signal_noise_ratio`, `structural_similarity`), as in the published evaluation.

use crate::math::log10;

/// Mean squared difference in units of 8-bit steps squared: NaN if the lengths differ, 0 for empty images.
pub fn mean_squared_error(prediction: &[u8], truth: &[u8]) -> f64 {
    if prediction.len() != truth.len() {
        return f64::NAN;
    }
    let mut sum = 0_u64;
    let mut i = 0;
    while i < truth.len() {
        let difference = prediction[i] as i64 - truth[i] as i64;
        sum += (difference * difference) as u64;
        i += 1;
    }
    if truth.is_empty() { 0.0 } else { sum as f64 / truth.len() as f64 }
}

/// Peak signal to noise ratio in decibels for a peak of 255; infinite for equal images, NaN if the lengths differ.
pub fn psnr(prediction: &[u8], truth: &[u8]) -> f64 {
    let error = mean_squared_error(prediction, truth);
    if error == 0.0 { f64::INFINITY } else { 10.0 * log10(255.0 * 255.0 / error) }
}

/// Side of SSIM's uniform window.
pub const SSIM_WINDOW: usize = 7;

/// Mean structural similarity with a uniform 7x7 window, sample covariance (divided by 48) and the constants 0.01 and
/// 0.03 of a range of 255, over every window that lies inside the image, averaged over the channels. `None` if the
/// image is smaller than the window, or a length is not `width * height * channel_count`. Which is the width, lengths
/// do not tell.
pub fn ssim(prediction: &[u8], truth: &[u8], width: usize, height: usize, channel_count: usize) -> Option<f64> {
    let len = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(channel_count));
    let fits = len == Some(truth.len()) && prediction.len() == truth.len();
    if !fits || width < SSIM_WINDOW || height < SSIM_WINDOW || channel_count == 0 {
        return None;
    }
    let mut total = 0.0;
    let mut channel = 0;
    while channel < channel_count {
        let mut row = 0;
        while row + SSIM_WINDOW <= height {
            // The columns of the last window, and their sum: whole numbers, hence exact in any order.
            let (mut columns, mut window) = ([Sums::default(); SSIM_WINDOW], Sums::default());
            let mut column = 0;
            while column < width {
                let entering = Sums::of_column(prediction, truth, width, channel_count, [row, column, channel]);
                let leaving = core::mem::replace(&mut columns[column % SSIM_WINDOW], entering);
                window = window.moved(entering, leaving);
                column += 1;
                if column >= SSIM_WINDOW {
                    total += window.similarity();
                }
            }
            row += 1;
        }
        channel += 1;
    }
    let window_count = (width - SSIM_WINDOW + 1) * (height - SSIM_WINDOW + 1) * channel_count;
    Some(total / window_count as f64)
}

/// Sums over pixels of one channel of a prediction and of the truth: of the values, of their squares, of the products.
#[derive(Clone, Copy, Default)]
struct Sums {
    p: u32,
    t: u32,
    pp: u32,
    tt: u32,
    pt: u32,
}

impl Sums {
    /// Those of a window's height of pixels from `[row, column, channel]` down.
    fn of_column(prediction: &[u8], truth: &[u8], width: usize, channel_count: usize, at: [usize; 3]) -> Sums {
        let mut sums = Sums::default();
        let mut row = at[0];
        while row < at[0] + SSIM_WINDOW {
            let i = (row * width + at[1]) * channel_count + at[2];
            let (p, t) = (prediction[i] as u32, truth[i] as u32);
            sums.p += p;
            sums.t += t;
            sums.pp += p * p;
            sums.tt += t * t;
            sums.pt += p * t;
            row += 1;
        }
        sums
    }

    /// With a column, and without another that is in it.
    fn moved(self, entering: Sums, leaving: Sums) -> Sums {
        Sums {
            p: self.p + entering.p - leaving.p,
            t: self.t + entering.t - leaving.t,
            pp: self.pp + entering.pp - leaving.pp,
            tt: self.tt + entering.tt - leaving.tt,
            pt: self.pt + entering.pt - leaving.pt,
        }
    }

    /// SSIM of the window that these are the sums of.
    fn similarity(self) -> f64 {
        const COUNT: f64 = (SSIM_WINDOW * SSIM_WINDOW) as f64;
        const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
        const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);
        let (mean_p, mean_t) = (self.p as f64 / COUNT, self.t as f64 / COUNT);
        let covariance = |sum: u32, a: f64, b: f64| (sum as f64 - COUNT * a * b) / (COUNT - 1.0);
        let variance_p = covariance(self.pp, mean_p, mean_p);
        let variance_t = covariance(self.tt, mean_t, mean_t);
        let covariance_pt = covariance(self.pt, mean_p, mean_t);
        let numerator = (2.0 * mean_p * mean_t + C1) * (2.0 * covariance_pt + C2);
        let denominator = (mean_p * mean_p + mean_t * mean_t + C1) * (variance_p + variance_t + C2);
        numerator / denominator
    }
}
