//! GeNVS with weighted views: volumes of features, looked up at points, become a feature image; the denoiser's inputs.
//!
//! Source: Chan et al., "Generative novel view synthesis with 3D-aware diffusion models" (2023), and the code of "Pay
//! Attention to Where You Looked" (`pixel_nerf_net.py`). A view's volume spans its photograph and the depths from
//! `near` to `far` along its principal axis; depth node 0 is the *farthest* (published convention).

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::half_precision::fetch_f16;
use viewfuse_core::math::{exp, floor_to_i32, has_nan_bits, max};
use viewfuse_core::rays::RayPoint;

/// A dispatch of [`volume_value`] or [`volume_value_f16`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct VolumeBlock {
    /// Which view's volume it is.
    pub view: u32,
    /// How many points there are.
    pub point_count: u32,
    /// Features of a node.
    pub feature_count: u32,
    /// Rows of the volume.
    pub height: u32,
    /// Columns of the volume.
    pub width: u32,
    /// Depth nodes of the volume.
    pub depth_count: u32,
    /// Depth along the view's axis where the volume begins.
    pub near: f32,
    /// Depth where it ends, above `near`.
    pub far: f32,
}

impl VolumeBlock {
    /// Where the view's part of `[view][point][feature]` starts.
    #[inline]
    pub fn first(&self) -> usize {
        self.view as usize * self.point_count as usize * self.feature_count as usize
    }
}

/// The cell of a volume around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumePlace {
    /// Column, row and depth node before the point; -1 where the point lies before the first one.
    pub lower: [i32; 3],
    /// Share of the column, row and depth node behind it.
    pub share: [f32; 3],
}

impl VolumePlace {
    /// Where a point lies in a view's volume. Nodes' centres lie at halves. A point that is not in front of the view,
    /// or not within a node of the volume, gets a place outside.
    #[inline]
    pub fn of(camera: &CameraBlock, point: &RayPoint, block: &VolumeBlock) -> VolumePlace {
        let seen = camera.project(Vec3::from_array(point.position));
        let x = seen.x * (block.width as f32 / camera.width as f32) - 0.5;
        let y = seen.y * (block.height as f32 / camera.height as f32) - 0.5;
        let behind = (block.far - seen.depth) / (block.far - block.near);
        let z = behind * block.depth_count as f32 - 0.5;
        let is_inside = seen.in_front
            && x > -1.0
            && y > -1.0
            && z > -1.0
            && x < block.width as f32
            && y < block.height as f32
            && z < block.depth_count as f32;
        if !is_inside {
            return VolumePlace { lower: [-2, -2, -2], share: [0.0, 0.0, 0.0] };
        }
        let (column, row, node) = (floor_to_i32(x), floor_to_i32(y), floor_to_i32(z));
        VolumePlace { lower: [column, row, node], share: [x - column as f32, y - row as f32, z - node as f32] }
    }

    /// Whether no node around it belongs to the volume.
    #[inline]
    pub fn is_outside(&self) -> bool {
        self.lower[0] < -1
    }

    /// One feature there from `volume[row][column][depth][feature]`, flat, trilinear, zeros around the volume: the sum
    /// over the eight nodes, columns innermost, then rows, then depths.
    #[inline(always)]
    pub fn value(&self, volume: impl Fn(usize) -> f32, block: &VolumeBlock, feature: u32) -> f32 {
        let mut sum = 0.0;
        if self.is_outside() {
            return sum;
        }
        let mut corner = 0;
        while corner < 8 {
            let (node, weight) = self.corner(block, corner);
            if node != u32::MAX {
                sum += volume((node * block.feature_count + feature) as usize) * weight;
            }
            corner += 1;
        }
        sum
    }

    /// Number of a node around the place (`[row][column][depth]`; `u32::MAX` outside the volume) and its weight. Bit 0
    /// of `corner` says which column, bit 1 which row, bit 2 which depth.
    #[inline(always)]
    pub fn corner(&self, block: &VolumeBlock, corner: u32) -> (u32, f32) {
        let (x, share_x) = step(self.lower[0], self.share[0], corner % 2);
        let (y, share_y) = step(self.lower[1], self.share[1], corner / 2 % 2);
        let (z, share_z) = step(self.lower[2], self.share[2], corner / 4);
        // Negative ones are large as well.
        let is_node = (x as u32) < block.width && (y as u32) < block.height && (z as u32) < block.depth_count;
        let node = (y as u32).wrapping_mul(block.width).wrapping_add(x as u32);
        let node = node.wrapping_mul(block.depth_count).wrapping_add(z as u32);
        (if is_node { node } else { u32::MAX }, share_x * share_y * share_z)
    }
}

#[inline(always)]
fn step(lower: i32, share: f32, upper: u32) -> (i32, f32) {
    if upper != 0 { (lower + 1, share) } else { (lower, 1.0 - share) }
}

/// Value number `element` of a view's `[point][feature]`: its volume where the point lies.
#[inline]
pub fn volume_value(
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    volume: &(impl Fetch<f32> + ?Sized),
    block: &VolumeBlock,
    element: usize,
) -> f32 {
    let (point, feature) = (element as u32 / block.feature_count, element as u32 % block.feature_count);
    let camera = views.fetch(block.view as usize);
    VolumePlace::of(&camera, &points.fetch(point as usize), block).value(|at| volume.fetch(at), block, feature)
}

/// As [`volume_value`], from a volume in numbers in half precision, two in a word.
#[inline]
pub fn volume_value_f16(
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    volume: &(impl Fetch<u32> + ?Sized),
    block: &VolumeBlock,
    element: usize,
) -> f32 {
    let (point, feature) = (element as u32 / block.feature_count, element as u32 % block.feature_count);
    let camera = views.fetch(block.view as usize);
    VolumePlace::of(&camera, &points.fetch(point as usize), block).value(|at| fetch_f16(volume, at), block, feature)
}

/// A dispatch of [`weigh_features`] or [`summed_feature`], as plain data. The yes-or-no field is 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FeatureBlock {
    /// Samples on each ray.
    pub sample_count: u32,
    /// Features of a sample.
    pub feature_count: u32,
    /// Factor from world units to the unit of length of the network's densities.
    pub length_scale: f32,
    /// Length of the last sample of a ray; 1e10 as published.
    pub last_length: f32,
    /// Inclusive weights, as in published checkpoints: a sample's weight is multiplied by the transmittance behind it,
    /// not in front of it.
    pub inclusive: u32,
    /// Where the first ray's sums go, counted in rays.
    pub first_ray: u32,
}

/// Weights of a ray's samples, one at a time and front to back: `weigh(sample, weight)`. `raw[sample][0]` is the
/// network's density (rectified; a density or optical depth of NaN makes all weights from there on NaN),
/// `points[sample]` has its length.
///
/// With the optical depth `o_i` and the transmittance `T_i` in front of a sample, exclusive weights are `T_i - T_(i+1)`
/// as in [`viewfuse_core::composite`]; inclusive ones, `(1 - e^-o_i) T_(i+1)`, are those times `e^-o_i`.
#[inline]
pub fn weigh_features(
    raw: &(impl Fetch<f32> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    block: &FeatureBlock,
    ray: usize,
    mut weigh: impl FnMut(usize, f32),
) {
    let first = ray * block.sample_count as usize;
    let (mut passed, mut before) = (0.0, 1.0);
    let mut index = 0;
    while index < block.sample_count as usize {
        let sample = first + index;
        let given = raw.fetch(sample * (block.feature_count as usize + 1));
        let density = max(given, 0.0);
        let is_last = index + 1 == block.sample_count as usize;
        let length = if is_last { block.last_length } else { points.fetch(sample).length * block.length_scale };
        let absorbed = density * length;
        passed += if has_nan_bits(given) { given } else { absorbed };
        let behind = exp(-passed);
        let stopped = before - behind;
        let weight = if block.inclusive != 0 { stopped * exp(-absorbed) } else { stopped };
        // The exponential of NaN is 0.
        weigh(sample, if has_nan_bits(passed) { passed } else { weight });
        before = behind;
        index += 1;
    }
}

/// Number `element` of `[ray][feature]`: the sum over the ray's samples of `weights[sample]` times the feature, which
/// is the fused feature plus the network's output: `fused[sample][feature] + raw[sample][1 + feature]`.
#[inline]
pub fn summed_feature(
    weights: &(impl Fetch<f32> + ?Sized),
    fused: &(impl Fetch<f32> + ?Sized),
    raw: &(impl Fetch<f32> + ?Sized),
    block: &FeatureBlock,
    element: usize,
) -> f32 {
    let features = block.feature_count as usize;
    let (ray, feature) = (element / features, element % features);
    let mut sum = 0.0;
    let mut index = 0;
    while index < block.sample_count as usize {
        let sample = ray * block.sample_count as usize + index;
        let value = fused.fetch(sample * features + feature) + raw.fetch(sample * (features + 1) + 1 + feature);
        sum += weights.fetch(sample) * value;
        index += 1;
    }
    sum
}

/// A dispatch of [`denoiser_input`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DenoiserInputBlock {
    /// Channels of the noisy picture.
    pub picture_channels: u32,
    /// Channels of the condition.
    pub condition_channels: u32,
    /// `c_in`; the condition is multiplied by it as well, as published (`networks.py`).
    pub scale: f32,
}

/// Number `element` of `[pixel][channel]`: the channels of `noisy[pixel][channel]`, then those of
/// `condition[pixel][channel]`, scaled.
#[inline]
pub fn denoiser_input(
    noisy: &(impl Fetch<f32> + ?Sized),
    condition: &(impl Fetch<f32> + ?Sized),
    block: &DenoiserInputBlock,
    element: usize,
) -> f32 {
    let (picture_channels, beside) = (block.picture_channels as usize, block.condition_channels as usize);
    let (pixel, channel) = (element / (picture_channels + beside), element % (picture_channels + beside));
    let value = if channel < picture_channels {
        noisy.fetch(pixel * picture_channels + channel)
    } else {
        condition.fetch(pixel * beside + channel - picture_channels)
    };
    block.scale * value
}
