//! Feature images from volumes in `f64`, with bounds on the error of `f32`.

use super::bounded::{Bounded, ROUNDING, roundings};
use super::camera_oracle::{point, project};
use super::point_oracle::is_in_front;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::genvs::{DenoiserInputBlock, FeatureBlock, VolumeBlock};

/// Nodes of one axis around a coordinate, with their shares; those outside (`None`) hold zeros.
struct Nodes {
    nodes: Vec<(Option<usize>, f64)>,
    /// The error of the coordinate.
    error: f64,
}

/// The nodes around a coordinate, of which `count` lie at whole numbers from 0 on.
fn nodes(coordinate: Bounded, count: u32) -> Nodes {
    // Beyond a node's distance from the volume there are zeros only.
    let at = |position: f64| position.clamp(-2.0, f64::from(count) + 1.0);
    // A share may be rounded once more.
    let reach = coordinate.error + ROUNDING;
    let (low, position, high) = (at(coordinate.value - reach), at(coordinate.value), at(coordinate.value + reach));
    let node = |node: i64| {
        let share = (1.0 - (position - node as f64).abs()).max(0.0);
        (usize::try_from(node).ok().filter(|node| *node < count as usize), share)
    };
    Nodes { nodes: (low.floor() as i64..=high.ceil() as i64).map(node).collect(), error: high - low }
}

/// All features of a view's volume where a point lies; `None` if it depends on rounding whether it is in front of the
/// view.
pub fn gather(view: &CameraBlock, volume: &[f32], at: &RayPoint, block: &VolumeBlock) -> Option<Vec<Bounded>> {
    let features = block.feature_count as usize;
    let position = point(at.position);
    if !is_in_front(view, position)? {
        return Some(vec![Bounded::ZERO; features]);
    }
    let seen = project(view, position);
    let half = Bounded::from(0.5);
    let across = |at: Bounded, count: u32, side: u32| at * (Bounded::from(count) / Bounded::from(side)) - half;
    let (near, far) = (Bounded::from(block.near), Bounded::from(block.far));
    let coordinates = [
        (across(seen.x, block.width, view.width), block.width),
        (across(seen.y, block.height, view.height), block.height),
        ((far - seen.depth) / (far - near) * Bounded::from(block.depth_count) - half, block.depth_count),
    ];
    if coordinates.iter().any(|(coordinate, _)| !(coordinate.error <= 1.0)) {
        return None;
    }
    let [columns, rows, depths] = coordinates.map(|(coordinate, count)| nodes(coordinate, count));
    let value = |feature: usize| {
        let (mut value, mut least, mut greatest) = (0.0, f64::MAX, f64::MIN);
        for (row, height) in &rows.nodes {
            for (column, width) in &columns.nodes {
                for (depth, share) in &depths.nodes {
                    let place = |(row, column, depth)| {
                        let pixel: usize = row * block.width as usize + column;
                        (pixel * block.depth_count as usize + depth) * features + feature
                    };
                    let inside = (*row).zip(*column).zip(*depth).map(|((row, column), depth)| (row, column, depth));
                    let node = inside.map_or(0.0, |inside| f64::from(volume[place(inside)]));
                    value += height * width * share * node;
                    least = node.min(least);
                    greatest = node.max(greatest);
                }
            }
        }
        // A coordinate that is off costs as much as the volume changes over its error. Three factors, eight summands.
        let error = (columns.error + rows.error + depths.error) * (greatest - least);
        Bounded { value, error: error + roundings(2 + 8) * least.abs().max(greatest.abs()) }
    };
    Some((0..features).map(value).collect())
}

/// Weights of a ray's samples; `raw[sample][0]` is the density.
pub fn weigh_features(raw: &[f32], points: &[RayPoint], block: &FeatureBlock) -> Vec<Bounded> {
    let row = block.feature_count as usize + 1;
    let mut sum = Bounded::ZERO;
    let mut before = Bounded::ONE;
    let densities = raw.chunks_exact(row).map(|raw| Bounded::from(raw[0].max(0.0)));
    let weights = densities.zip(points).enumerate().map(|(index, (density, point))| {
        let length = if index + 1 < points.len() {
            Bounded::from(point.length) * block.length_scale.into()
        } else {
            block.last_length.into()
        };
        let optical = density * length;
        sum = sum + optical;
        let behind = passing(sum);
        let stopped = before - behind;
        before = behind;
        if block.inclusive == 0 {
            return stopped;
        }
        let weight = stopped * passing(optical);
        // What a device may flush to 0.
        Bounded { error: weight.error + f64::from(f32::MIN_POSITIVE), ..weight }
    });
    weights.collect()
}

/// The transmittance of an optical depth.
fn passing(optical_depth: Bounded) -> Bounded {
    if optical_depth.value == 0.0 { Bounded::ONE } else { (-optical_depth).exp() }
}

/// A feature of a ray, summed in any order: each summand is rounded as a sum and as a product.
pub fn summed_feature(weights: &[f32], fused: &[f32], raw: &[f32], block: &FeatureBlock, feature: usize) -> Bounded {
    let (features, count) = (block.feature_count as usize, weights.len());
    let fused = fused.chunks_exact(features).map(|fused| f64::from(fused[feature]));
    let raw = raw.chunks_exact(features + 1).map(|raw| f64::from(raw[1 + feature]));
    let (mut value, mut magnitudes) = (0.0, 0.0);
    for (weight, (fused, raw)) in weights.iter().zip(fused.zip(raw)) {
        let weight = f64::from(*weight);
        value += weight * (fused + raw);
        magnitudes += weight.abs() * (fused + raw).abs();
    }
    Bounded { value, error: magnitudes * roundings(count + 2) + count as f64 * f64::from(f32::MIN_POSITIVE) }
}

/// A number of the denoiser's input.
pub fn denoiser_input(noisy: &[f32], condition: &[f32], block: &DenoiserInputBlock, element: usize) -> Bounded {
    let [pictured, beside] = [block.picture_channels, block.condition_channels].map(|count| count as usize);
    let (pixel, channel) = (element / (pictured + beside), element % (pictured + beside));
    let value = match channel.checked_sub(pictured) {
        None => noisy[pixel * pictured + channel],
        Some(channel) => condition[pixel * beside + channel],
    };
    Bounded::from(value) * block.scale.into()
}
