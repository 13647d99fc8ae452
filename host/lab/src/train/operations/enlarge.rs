//! Bilinear enlargement with aligned corners, added to an image.
//!
//! The library has none of its own for gradients; as products with constant matrices it takes several times as long.

use super::{Operation, Real};
use rayon::prelude::*;
use viewfuse_core::lookup::split;
use viewfuse_kernels::network::resample::aligned;

/// Inputs: images `[image][row][column][channel]`, and smaller ones of as many channels, which are enlarged and added.
pub(crate) struct AddEnlarged {
    /// Images, rows, columns, channels of the result.
    pub(crate) size: [usize; 4],
    /// Rows and columns of the smaller images.
    pub(crate) small: [usize; 2],
}

/// The two neighbours of each row or column among the smaller image's, and the share of the second.
fn neighbours<T: Real>(outer: usize, inner: usize) -> Vec<([usize; 2], [T; 2])> {
    let one = |index: usize| {
        let (before, behind, share) = split(aligned(index as u32, outer as u32, inner as u32), inner as u32);
        ([before, behind], [T::of(1.0 - share), T::of(share)])
    };
    (0..outer).map(one).collect()
}

impl AddEnlarged {
    fn lengths(&self) -> [usize; 2] {
        let [_, height, width, channels] = self.size;
        [height * width * channels, self.small[0] * self.small[1] * channels]
    }
}

impl Operation<2> for AddEnlarged {
    const NAME: &'static str = "add_enlarged";

    fn shape(&self) -> Vec<usize> {
        self.size.to_vec()
    }

    fn forward<T: Real>(&self, [images, small]: [&[T]; 2]) -> Vec<T> {
        let [_, height, width, channels] = self.size;
        let [large_len, small_len] = self.lengths();
        let (rows, columns) = (neighbours::<T>(height, self.small[0]), neighbours::<T>(width, self.small[1]));
        let row_len = self.small[1] * channels;
        let mut output = images.to_vec();
        let each = output.par_chunks_exact_mut(large_len).zip(small.par_chunks_exact(small_len));
        each.for_each(|(output, small)| {
            let mut row = vec![T::zero(); row_len];
            for (output, ([above, below], [of_above, of_below])) in output.chunks_exact_mut(width * channels).zip(&rows)
            {
                let [above, below] = [above, below].map(|row| &small[row * row_len..][..row_len]);
                row.iter_mut()
                    .zip(above.iter().zip(below))
                    .for_each(|(row, (a, b))| *row = *a * *of_above + *b * *of_below);
                for (pixel, ([left, right], [of_left, of_right])) in output.chunks_exact_mut(channels).zip(&columns) {
                    let [left, right] = [left, right].map(|column| &row[column * channels..][..channels]);
                    let both = left.iter().zip(right);
                    pixel.iter_mut().zip(both).for_each(|(value, (a, b))| *value += *a * *of_left + *b * *of_right);
                }
            }
        });
        output
    }

    fn backward<T: Real>(&self, _: [&[T]; 2], _: &[T], gradient: &[T]) -> [Option<Vec<T>>; 2] {
        let [count, height, width, channels] = self.size;
        let [large_len, small_len] = self.lengths();
        let (rows, columns) = (neighbours::<T>(height, self.small[0]), neighbours::<T>(width, self.small[1]));
        let row_len = self.small[1] * channels;
        let mut of_small = vec![T::zero(); count * small_len];
        let each = of_small.par_chunks_exact_mut(small_len).zip(gradient.par_chunks_exact(large_len));
        each.for_each(|(of_small, gradient)| {
            let mut row = vec![T::zero(); row_len];
            for (gradient, (neighbours, shares)) in gradient.chunks_exact(width * channels).zip(&rows) {
                row.fill(T::zero());
                for (pixel, (neighbours, shares)) in gradient.chunks_exact(channels).zip(&columns) {
                    for (column, share) in neighbours.iter().zip(shares) {
                        let to = &mut row[column * channels..][..channels];
                        to.iter_mut().zip(pixel).for_each(|(to, value)| *to += *value * *share);
                    }
                }
                for (place, share) in neighbours.iter().zip(shares) {
                    let to = &mut of_small[place * row_len..][..row_len];
                    to.iter_mut().zip(&row).for_each(|(to, value)| *to += *value * *share);
                }
            }
        });
        [Some(gradient.to_vec()), Some(of_small)]
    }
}
