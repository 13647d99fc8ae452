//! SSIM with a Gaussian window, as Wang et al. defined it and many tables use it.
//!
//! The other one, with a uniform window of 7x7, is [`viewfuse_core::metrics::ssim`]; it is the default of scikit-image,
//! and the published evaluations of this field's systems used it. On one pair of pictures the two differ by up to 0.1.

use image::RgbImage;

/// Side of the window: 3.5 deviations to each side, as in scikit-image.
pub const GAUSSIAN_WINDOW: usize = 11;
/// Standard deviation of the window, pixels.
const DEVIATION: f64 = 1.5;

/// Mean structural similarity with a Gaussian window of deviation 1.5, population covariance and the constants 0.01 and
/// 0.03 of a range of 255, over every window that lies inside of the image, averaged over the channels: scikit-image's
/// `structural_similarity` with `gaussian_weights` and without `use_sample_covariance`, in `f64`. `None` if the
/// pictures have different sizes or are smaller than the window.
pub fn ssim_gaussian(prediction: &RgbImage, truth: &RgbImage) -> Option<f64> {
    let (width, height) = (truth.width() as usize, truth.height() as usize);
    if prediction.dimensions() != truth.dimensions() || width.min(height) < GAUSSIAN_WINDOW {
        return None;
    }
    let sums = (0..3).map(|channel| {
        let level = |picture: &RgbImage, pixel: usize| f64::from(picture.as_raw()[pixel * 3 + channel]);
        let blur = |value: &dyn Fn(f64, f64) -> f64| {
            let values = (0..width * height).map(|pixel| value(level(prediction, pixel), level(truth, pixel)));
            blurred(&values.collect::<Vec<_>>(), width)
        };
        let (p, t) = (blur(&|p, _| p), blur(&|_, t| t));
        let (pp, tt, pt) = (blur(&|p, _| p * p), blur(&|_, t| t * t), blur(&|p, t| p * t));
        (0..p.len()).map(|at| similarity([p[at], t[at]], [pp[at], tt[at]], pt[at])).sum::<f64>()
    });
    let window_count = (width - GAUSSIAN_WINDOW + 1) * (height - GAUSSIAN_WINDOW + 1);
    Some(sums.sum::<f64>() / (3 * window_count) as f64)
}

/// SSIM of a window from its means of the levels, of their squares and of their product.
fn similarity(means: [f64; 2], squares: [f64; 2], product: f64) -> f64 {
    const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
    const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);
    let [m, n] = means;
    let variances = squares[0] - m * m + squares[1] - n * n;
    (2.0 * m * n + C1) * (2.0 * (product - m * n) + C2) / ((m * m + n * n + C1) * (variances + C2))
}

/// The weighted mean of every window that lies inside of the image.
fn blurred(values: &[f64], width: usize) -> Vec<f64> {
    let centre = (GAUSSIAN_WINDOW / 2) as f64;
    let weights: [f64; GAUSSIAN_WINDOW] =
        std::array::from_fn(|place| (-0.5 * ((place as f64 - centre) / DEVIATION).powi(2)).exp());
    let sum: f64 = weights.iter().sum();
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        values.zip(weights).map(|(value, weight)| value * weight).sum::<f64>() / sum
    };
    let rows: Vec<f64> = values
        .chunks_exact(width)
        .flat_map(|row| row.windows(GAUSSIAN_WINDOW).map(|w| mean(&mut w.iter().copied())))
        .collect();
    let width = width + 1 - GAUSSIAN_WINDOW;
    let count = rows.len() - (GAUSSIAN_WINDOW - 1) * width;
    (0..count).map(|first| mean(&mut rows[first..].iter().copied().step_by(width))).collect()
}
