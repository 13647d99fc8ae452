//! Group norm with optional SiLU, as [`viewfuse_kernels::network::group_norm`] has it.

use super::{Operation, Real};
use rayon::prelude::*;

/// Inputs: images `[image][row][column][channel]`, weights `[channel]`, biases `[channel]`. Result as the images.
pub(crate) struct Normalise {
    /// Images, rows, columns, channels.
    pub(crate) input: [usize; 4],
    /// Groups of neighbouring channels.
    pub(crate) group_count: usize,
    /// Added to variances (epsilon).
    pub(crate) variance_floor: f64,
    /// Whether results go through `x / (1 + e^-x)`.
    pub(crate) silu: bool,
}

impl Normalise {
    fn image_len(&self) -> usize {
        self.input[1..].iter().product()
    }

    /// Sums over pixels of `value(channel, number)`, one a channel, then those of each group as a mean, one a channel
    /// again.
    fn means<T: Real>(&self, image: &[T], value: impl Fn(usize, T) -> T) -> Vec<T> {
        let channels = self.input[3];
        let mut sums = vec![T::zero(); channels];
        for pixel in image.chunks_exact(channels) {
            for (channel, (sum, entry)) in sums.iter_mut().zip(pixel).enumerate() {
                *sum += value(channel, *entry);
            }
        }
        self.shared(&sums)
    }

    /// Sums of channels as the means of their groups, one a channel.
    fn shared<T: Real>(&self, sums: &[T]) -> Vec<T> {
        let size = sums.len() / self.group_count;
        let count = T::from_f64((self.input[1] * self.input[2] * size) as f64);
        let mut shared = Vec::with_capacity(sums.len());
        for group in sums.chunks_exact(size) {
            let mean = group.iter().fold(T::zero(), |all, value| all + *value) / count;
            shared.extend((0..size).map(|_| mean));
        }
        shared
    }

    /// Mean of each channel's group, and the factor of its deviations.
    fn moments<T: Real>(&self, image: &[T]) -> [Vec<T>; 2] {
        let means = self.means(image, |_, value| value);
        let spreads = self.means(image, |channel, value| (value - means[channel]) * (value - means[channel]));
        let factors =
            spreads.iter().map(|spread| T::from_f64(1.0 / (spread.to_f64() + self.variance_floor).sqrt())).collect();
        [means, factors]
    }
}

impl Operation<3> for Normalise {
    const NAME: &'static str = "normalise";

    fn shape(&self) -> Vec<usize> {
        self.input.to_vec()
    }

    fn forward<T: Real>(&self, [images, weights, biases]: [&[T]; 3]) -> Vec<T> {
        let channels = self.input[3];
        let mut output = vec![T::zero(); images.len()];
        let each = images.par_chunks_exact(self.image_len()).zip(output.par_chunks_exact_mut(self.image_len()));
        each.for_each(|(image, output)| {
            let [means, factors] = self.moments(image);
            for (pixel, values) in image.chunks_exact(channels).zip(output.chunks_exact_mut(channels)) {
                for channel in 0..channels {
                    let value = (pixel[channel] - means[channel]) * (factors[channel] * weights[channel]);
                    let value = value + biases[channel];
                    values[channel] = if self.silu { value * logistic(value) } else { value };
                }
            }
        });
        output
    }

    fn backward<T: Real>(&self, [images, weights, biases]: [&[T]; 3], _: &[T], gradient: &[T]) -> [Option<Vec<T>>; 3] {
        let channels = self.input[3];
        let mut of_images = vec![T::zero(); images.len()];
        let len = self.image_len();
        let each =
            images.par_chunks_exact(len).zip(gradient.par_chunks_exact(len)).zip(of_images.par_chunks_exact_mut(len));
        let one = |((image, gradient), of_image): ((&[T], &[T]), &mut [T])| {
            let [means, factors] = self.moments(image);
            let (mut of_weights, mut of_biases) = (vec![T::zero(); channels], vec![T::zero(); channels]);
            // First the gradient of the normalised number, in place of the result's.
            let pixels = image.chunks_exact(channels).zip(gradient.chunks_exact(channels));
            for ((pixel, gradient), values) in pixels.zip(of_image.chunks_exact_mut(channels)) {
                for channel in 0..channels {
                    let normal = (pixel[channel] - means[channel]) * factors[channel];
                    let mut slope = gradient[channel];
                    if self.silu {
                        let value = normal * weights[channel] + biases[channel];
                        let share = logistic(value);
                        slope *= share + value * share * (T::one() - share);
                    }
                    of_weights[channel] += slope * normal;
                    of_biases[channel] += slope;
                    values[channel] = slope;
                }
            }
            let sums = |values: &[T]| -> Vec<T> {
                values.iter().zip(weights).map(|(value, weight)| *value * *weight).collect()
            };
            let mean_slope = self.shared(&sums(&of_biases));
            let mean_product = self.shared(&sums(&of_weights));
            for (pixel, values) in image.chunks_exact(channels).zip(of_image.chunks_exact_mut(channels)) {
                for channel in 0..channels {
                    let normal = (pixel[channel] - means[channel]) * factors[channel];
                    let slope = values[channel] * weights[channel];
                    values[channel] = (slope - mean_slope[channel] - normal * mean_product[channel]) * factors[channel];
                }
            }
            (of_weights, of_biases)
        };
        let (of_weights, of_biases): (Vec<Vec<T>>, Vec<Vec<T>>) = each.map(one).unzip();
        [Some(of_images), Some(super::convolve::sum(of_weights)), Some(super::convolve::sum(of_biases))]
    }
}

fn logistic<T: Real>(value: T) -> T {
    T::one() / (T::one() + (T::zero() - value).exponential())
}
