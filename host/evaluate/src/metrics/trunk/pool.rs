//! Pools that no kernel computes: they run on the host, in `f64`, between layers.

use super::Map;
use rayon::prelude::*;

/// The mean of the 3x3 pixels around each pixel. Outside of the image there are zeros, or, if these do not count, nothing.
pub(super) fn mean(image: &Map, counts_border: bool) -> Map {
    pooled(image, [image.height, image.width], 1, |window, channel| {
        let (mut sum, mut count) = (0.0, 0);
        for (_, pixel) in window {
            sum += f64::from(pixel[channel]);
            count += 1;
        }
        sum / if counts_border { 9.0 } else { f64::from(count) }
    })
}

/// What DISTS adds before it takes the root.
const FLOOR: f64 = 1.0e-12;

/// The root of the blurred squares at every second pixel; outside of the image there are zeros.
pub(super) fn root_mean_square(image: &Map) -> Map {
    let size = [image.height.div_ceil(2), image.width.div_ceil(2)];
    pooled(image, size, 2, |window, channel| {
        let sum: f64 = window
            .map(|([row, column], pixel)| {
                // 1, 2, 1 in both directions.
                let share = (2 - row.abs_diff(1)) * (2 - column.abs_diff(1));
                share as f64 / 16.0 * f64::from(pixel[channel]).powi(2)
            })
            .sum();
        (sum + FLOOR).sqrt()
    })
}

/// A place of a window of 3x3 and the channels of the pixel there.
type Seen<'a> = ([usize; 2], &'a [f32]);

/// An image of `size` of what `value` makes of the windows of 3x3 around every `stride`-th pixel.
fn pooled(
    image: &Map,
    size: [usize; 2],
    stride: usize,
    value: impl Fn(&mut dyn Iterator<Item = Seen<'_>>, usize) -> f64 + Sync,
) -> Map {
    let [height, width] = size;
    let channels = image.channels;
    let mut values = vec![0.0; height * width * channels];
    values.par_chunks_mut(channels).enumerate().for_each(|(pixel, outputs)| {
        let (top, left) = (pixel / width * stride, pixel % width * stride);
        let window: Vec<Seen<'_>> = (0..9)
            .map(|place| [place / 3, place % 3])
            .filter_map(|[row, column]| {
                // Outside of the image the difference is none.
                let (y, x) = ((top + row).checked_sub(1)?, (left + column).checked_sub(1)?);
                (y < image.height && x < image.width).then(|| ([row, column], image.pixel(y, x)))
            })
            .collect();
        for (channel, output) in outputs.iter_mut().enumerate() {
            *output = value(&mut window.iter().copied(), channel) as f32;
        }
    });
    Map { height, width, channels, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 rows of 3 pixels, 2 channels: 1 to 6, and 10 times that.
    fn image() -> Map {
        let values = (1..=6_u8).flat_map(|value| [f32::from(value), f32::from(value) * 10.0]).collect();
        Map { height: 2, width: 3, channels: 2, values }
    }

    #[test]
    fn means_with_and_without_the_border() {
        let (zeros, none) = (mean(&image(), true), mean(&image(), false));
        // The corner sees 1, 2, 4 and 5; the pixel beside it all six.
        assert_eq!(zeros.pixel(0, 0), [12.0 / 9.0, 120.0 / 9.0]);
        assert_eq!(none.pixel(0, 0), [3.0, 30.0]);
        assert_eq!(zeros.pixel(1, 1), [21.0 / 9.0, 210.0 / 9.0]);
        assert_eq!(none.pixel(1, 1), [3.5, 35.0]);
    }

    #[test]
    fn roots_of_blurred_squares() {
        let pooled = root_mean_square(&image());
        assert_eq!([pooled.height, pooled.width, pooled.channels], [1, 2, 2]);
        let left = ((4.0 + 2.0 * 4.0 + 2.0 * 16.0 + 25.0) / 16.0_f32).sqrt();
        let right = ((4.0 * 9.0 + 2.0 * 4.0 + 2.0 * 36.0 + 25.0) / 16.0_f32).sqrt();
        for (value, expected) in pooled.values.iter().zip([left, 10.0 * left, right, 10.0 * right]) {
            assert!((value - expected).abs() <= 1.0e-6 * expected, "{value} is not {expected}");
        }
    }
}
