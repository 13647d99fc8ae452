//! Convolutions of images `[image][row][column][channel]`, as matrix products of windows laid out in rows.
//!
//! The library's own have another memory layout, have no gradient for the published networks' options (dilation with
//! stride, depthwise), or take many times as long.

use super::{Operation, Real};
use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2};
use rayon::prelude::*;
use std::ops::Range;

/// The most numbers of unfolded windows in memory at once.
const MAX_UNFOLDED: usize = 1 << 16;

/// Positions of windows on an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    /// Side of a window.
    pub(crate) size: usize,
    /// Pixels from one to the next.
    pub(crate) stride: usize,
    /// Padding with zeros.
    pub(crate) padding: usize,
    /// Pixels between neighbours in a window.
    pub(crate) dilation: usize,
}

impl Window {
    /// Windows of this side at every pixel, padded so that the output has the input's size.
    pub(crate) fn same(size: usize) -> Window {
        Window { size, stride: 1, padding: size / 2, dilation: 1 }
    }

    /// The number of windows along a side.
    pub(crate) fn count(&self, side: usize) -> usize {
        (side + 2 * self.padding - self.dilation * (self.size - 1) - 1) / self.stride + 1
    }

    fn is_a_pixel(&self) -> bool {
        self.size == 1 && self.stride == 1 && self.padding == 0
    }

    /// Calls `visit(first number of a pixel, place in the window)` for the pixels of the image in an output's window.
    fn visit(&self, [height, width]: [usize; 2], row: usize, column: usize, mut visit: impl FnMut(usize, usize)) {
        for place_row in 0..self.size {
            let y = (row * self.stride + place_row * self.dilation).wrapping_sub(self.padding);
            if y >= height {
                continue;
            }
            for place_column in 0..self.size {
                let x = (column * self.stride + place_column * self.dilation).wrapping_sub(self.padding);
                if x < width {
                    visit(y * width + x, place_row * self.size + place_column);
                }
            }
        }
    }
}

/// Inputs: images `[image][row][column][in]`, weights `[out][place][in]`, biases `[out]` of all images or
/// `[image][out]` of each. Result `[image][row][column][out]`.
pub(crate) struct Convolution {
    /// Images, rows, columns, channels of the input.
    pub(crate) input: [usize; 4],
    pub(crate) out_channels: usize,
    pub(crate) window: Window,
    /// Whether each image has its own biases.
    pub(crate) has_own_biases: bool,
    /// Whether negative results become 0.
    pub(crate) rectifies: bool,
    /// Whether the gradient of the images is needed.
    pub(crate) differentiates_input: bool,
}

impl Convolution {
    fn out_size(&self) -> [usize; 2] {
        [self.window.count(self.input[1]), self.window.count(self.input[2])]
    }

    fn row_len(&self) -> usize {
        self.window.size * self.window.size * self.input[3]
    }

    /// Rows of the output that are computed together, so that their windows stay in a core's caches.
    fn strips(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let [height, width] = self.out_size();
        let rows = (MAX_UNFOLDED / (width * self.row_len())).clamp(1, height);
        (0..height).step_by(rows).map(move |start| start..(start + rows).min(height))
    }

    /// Windows of some rows of an image, in rows `[pixel][place][channel]`.
    fn unfold<'a, T: Real>(&self, image: &'a [T], strip: &Range<usize>, scratch: &'a mut Vec<T>) -> &'a [T] {
        let [_, height, width, channels] = self.input;
        let [_, out_width] = self.out_size();
        let row_len = self.row_len();
        if self.window.is_a_pixel() {
            return &image[strip.start * width * channels..strip.end * width * channels];
        }
        scratch.clear();
        scratch.resize(strip.len() * out_width * row_len, T::zero());
        for (pixel, inputs) in scratch.chunks_exact_mut(row_len).enumerate() {
            let (row, column) = (strip.start + pixel / out_width, pixel % out_width);
            self.window.visit([height, width], row, column, |from, place| {
                inputs[place * channels..][..channels].copy_from_slice(&image[from * channels..][..channels]);
            });
        }
        scratch
    }

    /// Adds the rows' numbers at the places that they were read from.
    fn fold<T: Real>(&self, rows: &[T], strip: &Range<usize>, image: &mut [T]) {
        let [_, height, width, channels] = self.input;
        let [_, out_width] = self.out_size();
        for (pixel, inputs) in rows.chunks_exact(self.row_len()).enumerate() {
            let (row, column) = (strip.start + pixel / out_width, pixel % out_width);
            self.window.visit([height, width], row, column, |to, place| {
                let from = &inputs[place * channels..][..channels];
                image[to * channels..][..channels].iter_mut().zip(from).for_each(|(to, from)| *to += *from);
            });
        }
    }
}

impl Operation<3> for Convolution {
    const NAME: &'static str = "convolve";

    fn shape(&self) -> Vec<usize> {
        let [height, width] = self.out_size();
        vec![self.input[0], height, width, self.out_channels]
    }

    fn forward<T: Real>(&self, [images, weights, biases]: [&[T]; 3]) -> Vec<T> {
        let [count, height, width, channels] = self.input;
        let [out_height, out_width] = self.out_size();
        let (pixels, row_len, outs) = (out_height * out_width, self.row_len(), self.out_channels);
        let mut output = vec![T::zero(); count * pixels * outs];
        let weights = matrix(weights, outs, row_len);
        let each = images.par_chunks_exact(height * width * channels).zip(output.par_chunks_exact_mut(pixels * outs));
        each.enumerate().for_each(|(index, (image, output))| {
            let biases = &biases[if self.has_own_biases { index * outs } else { 0 }..][..outs];
            let mut scratch = Vec::new();
            for strip in self.strips() {
                let rows = self.unfold(image, &strip, &mut scratch);
                let strip_output = &mut output[strip.start * out_width * outs..strip.end * out_width * outs];
                strip_output.chunks_exact_mut(outs).for_each(|pixel| pixel.copy_from_slice(biases));
                let count = strip.len() * out_width;
                add_product(matrix(rows, count, row_len), weights.t(), matrix_mut(strip_output, count, outs));
                if self.rectifies {
                    // NaN stays NaN, so that the loss shows it.
                    strip_output
                        .iter_mut()
                        .for_each(|value| *value = if *value < T::zero() { T::zero() } else { *value });
                }
            }
        });
        output
    }

    fn backward<T: Real>(&self, [images, weights, _]: [&[T]; 3], output: &[T], gradient: &[T]) -> [Option<Vec<T>>; 3] {
        let [count, height, width, channels] = self.input;
        let [out_height, out_width] = self.out_size();
        let (pixels, row_len, outs) = (out_height * out_width, self.row_len(), self.out_channels);
        let image_len = height * width * channels;
        let weights = matrix(weights, outs, row_len);
        let mut of_images = vec![T::zero(); if self.differentiates_input { images.len() } else { 0 }];
        let mut parts: Vec<&mut [T]> = of_images.chunks_exact_mut(image_len).collect();
        parts.resize_with(count, Default::default);
        let one = |(index, of_image): (usize, &mut [T])| {
            let image = &images[index * image_len..][..image_len];
            let (mut of_weights, mut of_biases) = (vec![T::zero(); outs * row_len], vec![T::zero(); outs]);
            let (mut scratch, mut of_rows, mut passed) = (Vec::new(), Vec::new(), Vec::new());
            for strip in self.strips() {
                let count = strip.len() * out_width;
                let first = (index * pixels + strip.start * out_width) * outs;
                let (mut gradient, output) = (&gradient[first..][..count * outs], &output[first..][..count * outs]);
                if self.rectifies {
                    passed.clear();
                    let pass = |(gradient, output): (&T, &T)| if *output > T::zero() { *gradient } else { T::zero() };
                    passed.extend(gradient.iter().zip(output).map(pass));
                    gradient = &passed;
                }
                for row in gradient.chunks_exact(outs) {
                    of_biases.iter_mut().zip(row).for_each(|(to, value)| *to += *value);
                }
                let gradient = matrix(gradient, count, outs);
                let rows = matrix(self.unfold(image, &strip, &mut scratch), count, row_len);
                add_product(gradient.t(), rows, matrix_mut(&mut of_weights, outs, row_len));
                if !self.differentiates_input {
                    continue;
                }
                of_rows.resize(count * row_len, T::zero());
                product(gradient, weights, matrix_mut(&mut of_rows, count, row_len));
                if self.window.is_a_pixel() {
                    let to = strip.start * out_width * row_len..strip.end * out_width * row_len;
                    of_image[to].copy_from_slice(&of_rows);
                } else {
                    self.fold(&of_rows, &strip, of_image);
                }
            }
            (of_weights, of_biases)
        };
        let (of_weights, of_biases): (Vec<Vec<T>>, Vec<Vec<T>>) = parts.into_par_iter().enumerate().map(one).unzip();
        let of_biases = if self.has_own_biases { of_biases.concat() } else { sum(of_biases) };
        [self.differentiates_input.then_some(of_images), Some(sum(of_weights)), Some(of_biases)]
    }
}

/// One filter a channel. Inputs: images `[image][row][column][channel]`, weights `[place][channel]`.
pub(crate) struct DepthwiseConvolution {
    /// Images, rows, columns, channels of the input.
    pub(crate) input: [usize; 4],
    pub(crate) window: Window,
}

impl Operation<2> for DepthwiseConvolution {
    const NAME: &'static str = "convolve_depthwise";

    fn shape(&self) -> Vec<usize> {
        let [count, height, width, channels] = self.input;
        vec![count, self.window.count(height), self.window.count(width), channels]
    }

    fn forward<T: Real>(&self, [images, weights]: [&[T]; 2]) -> Vec<T> {
        let [_, height, width, channels] = self.input;
        let out_width = self.window.count(width);
        let mut output = vec![T::zero(); self.shape().iter().product()];
        let out_len = self.window.count(height) * out_width * channels;
        let each = images.par_chunks_exact(height * width * channels).zip(output.par_chunks_exact_mut(out_len));
        each.for_each(|(image, output)| {
            for (pixel, sums) in output.chunks_exact_mut(channels).enumerate() {
                self.window.visit([height, width], pixel / out_width, pixel % out_width, |from, place| {
                    let (from, by) = (&image[from * channels..][..channels], &weights[place * channels..][..channels]);
                    sums.iter_mut().zip(from.iter().zip(by)).for_each(|(sum, (from, by))| *sum += *from * *by);
                });
            }
        });
        output
    }

    fn backward<T: Real>(&self, [images, weights]: [&[T]; 2], _: &[T], gradient: &[T]) -> [Option<Vec<T>>; 2] {
        let [_, height, width, channels] = self.input;
        let out_width = self.window.count(width);
        let (image_len, out_len) = (height * width * channels, self.window.count(height) * out_width * channels);
        let mut of_images = vec![T::zero(); images.len()];
        let each = of_images.par_chunks_exact_mut(image_len).zip(images.par_chunks_exact(image_len));
        let one = |((of_image, image), gradient): ((&mut [T], &[T]), &[T])| {
            let mut of_weights = vec![T::zero(); weights.len()];
            for (pixel, values) in gradient.chunks_exact(channels).enumerate() {
                self.window.visit([height, width], pixel / out_width, pixel % out_width, |at, place| {
                    let (at, place) = (at * channels, place * channels);
                    for channel in 0..channels {
                        of_image[at + channel] += values[channel] * weights[place + channel];
                        of_weights[place + channel] += values[channel] * image[at + channel];
                    }
                });
            }
            of_weights
        };
        let of_weights: Vec<Vec<T>> = each.zip(gradient.par_chunks_exact(out_len)).map(one).collect();
        [Some(of_images), Some(sum(of_weights))]
    }
}

/// The sum of lists, in their order: the same for any number of threads.
pub(super) fn sum<T: Real>(lists: Vec<Vec<T>>) -> Vec<T> {
    let mut lists = lists.into_iter();
    let mut all = lists.next().unwrap_or_default();
    for list in lists {
        all.iter_mut().zip(&list).for_each(|(all, part)| *all += *part);
    }
    all
}

/// The gradients of all objects from those of each: of its own inputs and of the weights of its views, one object
/// behind another, and the sum of those of the parameters that objects share. Only the weights' if the network does not
/// train.
pub(super) fn of_all<T: Real>(objects: Vec<(Vec<T>, Vec<T>, Vec<T>)>, trains: bool) -> [Option<Vec<T>>; 3] {
    let (mut of_inputs, mut of_weights, mut of_parameters) = (Vec::new(), Vec::new(), Vec::new());
    for (inputs, weights, parameters) in objects {
        of_inputs.extend(inputs);
        of_weights.extend(weights);
        of_parameters.push(parameters);
    }
    [trains.then_some(of_inputs), Some(of_weights), trains.then(|| sum(of_parameters))]
}

/// Numbers as rows and columns. Their count is that of the matrix by construction.
pub(super) fn matrix<T>(values: &[T], rows: usize, columns: usize) -> ArrayView2<'_, T> {
    ArrayView2::from_shape((rows, columns), values).expect("as many numbers as the matrix has")
}

/// A mutable [`matrix`].
pub(super) fn matrix_mut<T>(values: &mut [T], rows: usize, columns: usize) -> ArrayViewMut2<'_, T> {
    ArrayViewMut2::from_shape((rows, columns), values).expect("as many numbers as the matrix has")
}

/// `output = left x right`.
pub(super) fn product<T: Real>(left: ArrayView2<'_, T>, right: ArrayView2<'_, T>, mut output: ArrayViewMut2<'_, T>) {
    general_mat_mul(T::one(), &left, &right, T::zero(), &mut output);
}

/// `output += left x right`.
pub(super) fn add_product<T: Real>(
    left: ArrayView2<'_, T>,
    right: ArrayView2<'_, T>,
    mut output: ArrayViewMut2<'_, T>,
) {
    general_mat_mul(T::one(), &left, &right, T::one(), &mut output);
}
