//! Resampling by area: every output pixel is the mean of what it covers, so a silhouette becomes a fractional alpha.

use rayon::prelude::*;

/// `[row][column]` of `size` = `[width, height]` from an image of `own_size`. Enlarging repeats the nearest pixels.
pub(super) fn area_average(texels: &[[f32; 4]], own_size: [u32; 2], size: [u32; 2]) -> Vec<[f32; 4]> {
    if own_size == size {
        return texels.to_vec();
    }
    let columns = spans(own_size[0], size[0]);
    let rows = spans(own_size[1], size[1]);
    let own_width = own_size[0] as usize;
    let mut averaged = vec![[0.0; 4]; (size[0] * size[1]) as usize];
    averaged.par_chunks_mut(size[0] as usize).zip(&rows).for_each(|(output, row)| {
        for (texel, column) in output.iter_mut().zip(&columns) {
            for (y, share_y) in row {
                for (x, share_x) in column {
                    let share = share_x * share_y;
                    for (sum, value) in texel.iter_mut().zip(texels[y * own_width + x]) {
                        *sum += share * value;
                    }
                }
            }
        }
    });
    averaged
}

/// For each output pixel along an axis, the input pixels that it covers with their shares, which sum to 1.
fn spans(own: u32, wanted: u32) -> Vec<Vec<(usize, f32)>> {
    let step = f64::from(own) / f64::from(wanted);
    (0..wanted)
        .map(|output| {
            let (start, end) = (f64::from(output) * step, f64::from(output + 1) * step);
            // Rounding must not make a span touch a pixel by a hair.
            let first = (start + 1e-9).floor() as usize;
            let last = ((end - 1e-9).ceil() as usize).clamp(first + 1, own as usize);
            (first..last)
                .map(|input| {
                    let covered = (end.min(input as f64 + 1.0) - start.max(input as f64)).max(0.0);
                    (input, (covered / step) as f32)
                })
                .collect()
        })
        .collect()
}
