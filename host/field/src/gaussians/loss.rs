//! How far a picture is from a photograph, `(1 - s) mean |x - y| + s (1 - SSIM)`, and the derivative by the picture.
//!
//! SSIM (Wang et al. 2004) with Gaussian windows of standard deviation 1.5 and radius [`RADIUS`], which end at the
//! picture's edge: what lies outside counts as 0, in both pictures. Its derivative goes through the windows' means of
//! `x`, `x x` and `x y`, and these windows are symmetric, so it is again three blurs.

use viewfuse_kernels::gaussians::windows::{RADIUS, SMALL, WINDOW, similarity_gradient};

/// A channel of a photograph, in windows.
#[derive(Clone, Debug)]
pub(super) struct Structure {
    pub(super) means: Vec<f32>,
    pub(super) variances: Vec<f32>,
}

impl Structure {
    pub(super) fn of(channel: &[f32], width: usize, height: usize) -> Structure {
        let means = blurred(channel, width, height);
        let squares: Vec<f32> = channel.iter().map(|value| value * value).collect();
        let mut variances = blurred(&squares, width, height);
        variances.iter_mut().zip(&means).for_each(|(square, mean)| *square -= mean * mean);
        Structure { means, variances }
    }
}

/// A channel of a picture and of a photograph.
pub(super) struct Pair<'a> {
    pub(super) picture: &'a [f32],
    pub(super) photograph: &'a [f32],
    pub(super) structure: &'a Structure,
    /// Weights of the pixels; empty for 1.
    pub(super) seen: &'a [f32],
    pub(super) width: usize,
    pub(super) height: usize,
}

/// The derivative of the loss by each pixel of the channel, times the number of pixels.
pub(super) fn gradient(pair: &Pair<'_>, structure_share: f32) -> Vec<f32> {
    let Pair { picture, photograph, seen, .. } = pair;
    let differences = picture.iter().zip(*photograph);
    let mut gradient: Vec<f32> =
        differences.map(|(x, y)| (1.0 - structure_share) * ((x - y) / SMALL).clamp(-1.0, 1.0)).collect();
    if structure_share > 0.0 {
        add_structure(pair, structure_share, &mut gradient);
    }
    gradient.iter_mut().zip(*seen).for_each(|(value, seen)| *value *= seen);
    gradient
}

fn add_structure(pair: &Pair<'_>, share: f32, gradient: &mut [f32]) {
    let &Pair { picture, photograph, structure, width, height, .. } = pair;
    let means = blurred(picture, width, height);
    let squares: Vec<f32> = picture.iter().map(|x| x * x).collect();
    let products: Vec<f32> = picture.iter().zip(photograph).map(|(x, y)| x * y).collect();
    let (mut squares, mut products) = (blurred(&squares, width, height), blurred(&products, width, height));
    let mut by_means = vec![0.0; means.len()];
    for index in 0..means.len() {
        let window = [means[index], squares[index], products[index]];
        let by = similarity_gradient(window, structure.means[index], structure.variances[index]);
        [by_means[index], squares[index], products[index]] = by.map(|by| -share * by);
    }
    let by_means = blurred(&by_means, width, height);
    let (squares, products) = (blurred(&squares, width, height), blurred(&products, width, height));
    for (index, gradient) in gradient.iter_mut().enumerate() {
        *gradient += by_means[index] + 2.0 * picture[index] * squares[index] + photograph[index] * products[index];
    }
}

/// Means over windows: along the rows, then along the columns, each from the centre outwards.
fn blurred(values: &[f32], width: usize, height: usize) -> Vec<f32> {
    let window = WINDOW;
    let mut padded = vec![0.0; width + 2 * RADIUS];
    let mut rows = vec![0.0; values.len()];
    for (row, blurred) in values.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        padded[RADIUS..RADIUS + width].copy_from_slice(row);
        blurred.iter_mut().zip(row).for_each(|(blurred, value)| *blurred = window[0] * value);
        for (offset, weight) in window.iter().enumerate().skip(1) {
            let (before, after) = (&padded[RADIUS - offset..][..width], &padded[RADIUS + offset..][..width]);
            for ((blurred, a), b) in blurred.iter_mut().zip(before).zip(after) {
                *blurred += weight * (a + b);
            }
        }
    }
    let nothing = vec![0.0; width];
    let row_of = |row: Option<usize>| match row {
        Some(row) if row < height => &rows[row * width..][..width],
        _ => &nothing[..],
    };
    let mut blurred = vec![0.0; values.len()];
    for (row, blurred) in blurred.chunks_exact_mut(width).enumerate() {
        blurred.iter_mut().zip(row_of(Some(row))).for_each(|(blurred, value)| *blurred = window[0] * value);
        for (offset, weight) in window.iter().enumerate().skip(1) {
            let (above, below) = (row_of(row.checked_sub(offset)), row_of(Some(row + offset)));
            for ((blurred, a), b) in blurred.iter_mut().zip(above).zip(below) {
                *blurred += weight * (a + b);
            }
        }
    }
    blurred
}
