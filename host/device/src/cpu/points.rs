//! The inputs of PixelNeRF's network at points.

use crate::parallel::for_each_row;
use pulp::Arch;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::half_precision::Halves;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::pixelnerf::{EmbedBlock, GatherBlock, GridPlace, in_view_axes, waves};

pub(super) fn embed_points(
    block: &EmbedBlock,
    view_count: u32,
    views: &[CameraBlock],
    points: &[RayPoint],
    embedded: &mut [f32],
) {
    let (row_len, point_count) = (block.row_len() as usize, block.point_count as usize);
    let row_count = view_count as usize * point_count;
    // A row at a time: its rotations are needed once, and a sine comes with its cosine.
    for_each_row(&mut embedded[..row_count * row_len], row_len, 2048, |row, embedded| {
        let (view, point) = (&views[row / point_count], &points[row % point_count]);
        let position = in_view_axes(view, point.position);
        embedded[..3].copy_from_slice(&position);
        for (octave, values) in embedded[3..row_len - 3].chunks_exact_mut(6).enumerate() {
            for (axis, coordinate) in position.into_iter().enumerate() {
                (values[axis], values[axis + 3]) = waves(coordinate, octave as u32, block);
            }
        }
        embedded[row_len - 3..].copy_from_slice(&in_view_axes(view, point.direction));
    });
}

pub(super) fn gather_latents(
    block: &GatherBlock,
    views: &[CameraBlock],
    points: &[RayPoint],
    grid: &[f32],
    residual: Option<&[f32]>,
    gathered: &mut [f32],
) {
    let channels = block.channel_count as usize;
    gather_rows(block, views, points, residual, gathered, |place, values| {
        look_up(place, place.nodes.map(|node| &grid[node..node + channels]), values);
    });
}

/// The rows of a view, each looked up at its place, with the residual if there is one.
#[inline(always)]
fn gather_rows(
    block: &GatherBlock,
    views: &[CameraBlock],
    points: &[RayPoint],
    residual: Option<&[f32]>,
    gathered: &mut [f32],
    look_up: impl Fn(&GridPlace, &mut [f32]) + Sync,
) {
    let (first, channels, point_count) = (block.first(), block.channel_count as usize, block.point_count as usize);
    for_each_row(&mut gathered[first..first + point_count * channels], channels, 16384, |point, gathered| {
        let place = GridPlace::of(&views[block.view as usize], &points[point], block);
        // As wide as the machine can.
        Arch::new().dispatch(|| {
            look_up(&place, gathered);
            if let Some(residual) = residual {
                let residual = &residual[first + point * channels..];
                gathered.iter_mut().zip(residual).for_each(|(value, residual)| *value += residual);
            }
        });
    });
}

pub(super) fn gather_latents_f16(
    block: &GatherBlock,
    views: &[CameraBlock],
    points: &[RayPoint],
    grid: &[u32],
    residual: Option<&[f32]>,
    gathered: &mut [f32],
) {
    let channels = block.channel_count as usize;
    gather_rows(block, views, points, residual, gathered, |place, values| {
        if channels.is_multiple_of(2) {
            let nodes = place.nodes.map(|node| &grid[node / 2..(node + channels) / 2]);
            look_up_f16(place, nodes, values);
        } else {
            // Rows of odd length begin within a word.
            let grid = Halves(grid);
            values.iter_mut().enumerate().for_each(|(channel, value)| *value = place.value(&grid, channel));
        }
    });
}

/// [`GridPlace::value`] for all channels together, from the four nodes.
#[inline(always)]
fn look_up(place: &GridPlace, nodes: [&[f32]; 4], values: &mut [f32]) {
    let [upper_left, upper_right, lower_left, lower_right] = nodes;
    let upper = upper_left.iter().zip(upper_right);
    let lower = lower_left.iter().zip(lower_right);
    for (value, ((a, b), (c, d))) in values.iter_mut().zip(upper.zip(lower)) {
        let upper = a + (b - a) * place.share_x;
        let lower = c + (d - c) * place.share_x;
        *value = upper + (lower - upper) * place.share_y;
    }
}

/// As [`look_up`], from words of two channels each. Loops over arrays in place of these lines are not vectorised.
#[inline(always)]
fn look_up_f16(place: &GridPlace, nodes: [&[u32]; 4], values: &mut [f32]) {
    let [upper_left, upper_right, lower_left, lower_right] = nodes;
    let upper = upper_left.iter().zip(upper_right);
    let lower = lower_left.iter().zip(lower_right);
    for (pair, ((a, b), (c, d))) in values.as_chunks_mut::<2>().0.iter_mut().zip(upper.zip(lower)) {
        *pair = [mixed_f16(place, *a, *b, *c, *d), mixed_f16(place, a >> 16, b >> 16, c >> 16, d >> 16)];
    }
}

/// [`GridPlace::value`] of the numbers in the lower halves of four nodes' words.
#[inline(always)]
fn mixed_f16(place: &GridPlace, a: u32, b: u32, c: u32, d: u32) -> f32 {
    let (a, b, c, d) = (value_f16(a), value_f16(b), value_f16(c), value_f16(d));
    let upper = a + (b - a) * place.share_x;
    let lower = c + (d - c) * place.share_x;
    upper + (lower - upper) * place.share_y
}

/// As [`f16_value`], without branches: the CPU keeps subnormal numbers, so that a product with 2^112 moves the
/// exponent.
///
/// [`f16_value`]: viewfuse_core::half_precision::f16_value
#[inline(always)]
fn value_f16(bits: u32) -> f32 {
    let (sign, magnitude) = ((bits & 0x8000) << 16, bits & 0x7fff);
    let finite = (f32::from_bits(magnitude << 13) * f32::from_bits((127 + 112) << 23)).to_bits();
    f32::from_bits(sign | if magnitude < 0x7c00 { finite } else { (magnitude << 13) + (224 << 23) })
}

#[cfg(test)]
mod tests {
    use super::value_f16;
    use viewfuse_core::half_precision::f16_value;

    #[test]
    fn every_half_is_what_the_definition_says() {
        for bits in 0..=u32::from(u16::MAX) {
            let (ours, definition) = (value_f16(bits), f16_value(bits));
            assert!(ours.to_bits() == definition.to_bits(), "{bits:#06x}: {ours:e} is not {definition:e}");
            assert_eq!(value_f16(0xabcd_0000 | bits).to_bits(), ours.to_bits(), "the other half counts");
        }
    }
}
