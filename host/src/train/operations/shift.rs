//! Numbers added to channels, with rectification behind, in one pass over the images.

use super::{Operation, Real};

/// Inputs: images `[image][row][column][channel]`, shifts `[channel]` of all images or `[image][channel]` of each. Result as
/// the images.
pub(crate) struct Shift {
    /// Images, rows, columns, channels.
    pub(crate) input: [usize; 4],
    /// Whether shifts are each image's own.
    pub(crate) is_own: bool,
    /// Whether negative results become 0.
    pub(crate) rectifies: bool,
}

impl Shift {
    /// Numbers that share a list of shifts.
    fn part(&self) -> usize {
        let [count, height, width, channels] = self.input;
        height * width * channels * if self.is_own { 1 } else { count }
    }
}

impl Operation<2> for Shift {
    const NAME: &'static str = "shift";

    fn shape(&self) -> Vec<usize> {
        self.input.to_vec()
    }

    fn forward<T: Real>(&self, [images, shifts]: [&[T]; 2]) -> Vec<T> {
        let channels = self.input[3];
        let mut output = images.to_vec();
        for (part, shifts) in output.chunks_exact_mut(self.part()).zip(shifts.chunks_exact(channels)) {
            for pixel in part.chunks_exact_mut(channels) {
                for (own, shift) in pixel.iter_mut().zip(shifts) {
                    *own += *shift;
                    // NaN stays: the loss must show it.
                    if self.rectifies && *own < T::zero() {
                        *own = T::zero();
                    }
                }
            }
        }
        output
    }

    fn backward<T: Real>(&self, [images, shifts]: [&[T]; 2], gradient: &[T]) -> [Option<Vec<T>>; 2] {
        let channels = self.input[3];
        let mut of_images = gradient.to_vec();
        let mut of_shifts = vec![T::zero(); shifts.len()];
        let parts = of_images.chunks_exact_mut(self.part()).zip(images.chunks_exact(self.part()));
        let shifts = shifts.chunks_exact(channels).zip(of_shifts.chunks_exact_mut(channels));
        for ((of_part, part), (shifts, of_shifts)) in parts.zip(shifts) {
            for (of_pixel, pixel) in of_part.chunks_exact_mut(channels).zip(part.chunks_exact(channels)) {
                for channel in 0..channels {
                    let passes = !self.rectifies || pixel[channel] + shifts[channel] > T::zero();
                    of_pixel[channel] = if passes { of_pixel[channel] } else { T::zero() };
                    of_shifts[channel] += of_pixel[channel];
                }
            }
        }
        [Some(of_images), Some(of_shifts)]
    }
}
