//! Rays, samples on them, and the sample mask, in `f64` with bounds on the error of `f32`.
//!
//! Random draws are integers before scaling, and come from the code under test: other tests compare them with known
//! answers.

use super::bounded::Bounded;
use super::camera_oracle::{along, any, centre, point, towards};
use std::f64::consts::TAU;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::depths::{CoarseBlock, FineBlock, PROBABILITY_FLOOR};
use viewfuse_core::random::uniform_pair;
use viewfuse_core::rays::{CastBlock, TargetRay};
use viewfuse_kernels::sample_mask::SampleMaskBlock;

/// Products below it may be flushed to 0.
const NEGLIGIBLE: f64 = f32::MIN_POSITIVE as f64;

/// Origin, near, direction, far of the ray through a pixel.
pub fn cast_ray(block: &CastBlock, pixel: u32) -> [Bounded; 8] {
    let camera: &CameraBlock = &block.camera;
    let at = [pixel % camera.width, pixel / camera.width].map(|at| at as f32 + block.pixel_centre);
    let [x, y, z] = towards(camera, at);
    let length = match block.along_axis {
        0 => (x.squared() + y.squared() + z.squared()).square_root(),
        _ => Bounded::ONE,
    };
    let [origin_x, origin_y, origin_z] = centre(camera);
    let (near, far) = (block.near.into(), block.far.into());
    [origin_x, origin_y, origin_z, near, x / length, y / length, z / length, far]
}

/// A depth at a share of the interval between a ray's bounds.
fn depth_at(ray: &TargetRay, share: Bounded) -> Bounded {
    let (near, far) = (Bounded::from(ray.near), Bounded::from(ray.far));
    (near + (far - near) * share).clamped(ray.near, ray.far)
}

/// Depth of a coarse sample.
pub fn coarse_depth(ray: &TargetRay, pixel: u32, sample: u32, block: &CoarseBlock) -> Bounded {
    let [random, _] = uniform_pair(block.seed, pixel, sample);
    let inside = Bounded::from(0.5) + Bounded::from(block.jitter) * (Bounded::from(random) - Bounded::from(0.5));
    depth_at(ray, (Bounded::from(sample) + inside) / Bounded::from(block.sample_count))
}

/// The random numbers of a fine sample.
pub fn random_draw(pixel: u32, index: u32, block: &FineBlock) -> [Bounded; 2] {
    if index < block.importance_count {
        let [first, second] = uniform_pair(block.seed, pixel, block.coarse_count + index);
        let place = (Bounded::from(index) + first.into()) / Bounded::from(block.importance_count);
        return [place, second.into()];
    }
    [normal(block.seed, pixel, block.coarse_count + index), Bounded::ZERO]
}

/// A normally distributed random number.
pub fn normal(seed: [u32; 2], pixel: u32, sample: u32) -> Bounded {
    let [first, second] = uniform_pair(seed, pixel, sample);
    // A multiple of 2^-24 below 1 is subtracted from 1 exactly.
    let radius = (-Bounded::from(2.0) * Bounded::from(1.0 - first).ln()).square_root();
    let turn = Bounded { value: TAU, error: (TAU - f64::from(std::f32::consts::TAU)).abs() };
    radius * (turn * second.into()).cosine()
}

/// Depth of a fine sample; `seen[part]` is weight and transmittance. `None` if the part depends on rounding.
pub fn fine_depth(
    seen: &[[f32; 2]],
    ray: &TargetRay,
    [depth, opacity]: [f32; 2],
    draw: [f32; 2],
    index: u32,
    block: &FineBlock,
) -> Option<Bounded> {
    let draw = draw.map(Bounded::from);
    if index >= block.importance_count {
        let times_opacity = if block.depth_times_opacity == 0 { 1.0 } else { opacity };
        let centre = Bounded::from(depth) * Bounded::from(times_opacity);
        return Some((centre + draw[0] * Bounded::from(block.depth_deviation)).clamped(ray.near, ray.far));
    }
    let masses = seen.iter().map(|[weight, _]| Bounded::from(*weight) + Bounded::from(PROBABILITY_FLOOR));
    let reached: Vec<Bounded> = masses
        .scan(Bounded::ZERO, |sum, mass| {
            *sum = *sum + mass;
            Some(*sum)
        })
        .collect();
    let wanted = draw[0] * reached[reached.len() - 1];
    // In front of it are the parts whose cumulative sum is at most the requested one; the last part never is.
    let mut part = 0_u32;
    for end in &reached[..reached.len() - 1] {
        part += u32::from(!wanted.below(*end)?);
    }
    Some(depth_at(ray, (Bounded::from(part) + draw[1]) / Bounded::from(block.coarse_count)))
}

/// A ray's depths in order.
pub fn merge_depths(coarse: &[f32], fine: &[f32]) -> Vec<Bounded> {
    let mut depths = [coarse, fine].concat();
    depths.sort_by(f32::total_cmp);
    depths.into_iter().map(Bounded::from).collect()
}

/// Position, length, direction and number of a sample's point.
pub fn place_point(rays: &[TargetRay], depths: &[f32], sample_count: u32, sample: u32) -> [Bounded; 8] {
    let (count, sample) = (sample_count as usize, sample as usize);
    let ray = &rays[sample / count];
    let [x, y, z] = along(point(ray.origin), point(ray.direction), depths[sample].into());
    let along = &depths[sample / count * count..][..count];
    let behind = along.get(sample % count + 1).copied().unwrap_or(ray.far);
    let length = (Bounded::from(behind) - Bounded::from(depths[sample])).greater(Bounded::ZERO);
    let [across, below, ahead] = point(ray.direction);
    [x, y, z, length, across, below, ahead, (sample as f32).into()]
}

/// Weights of a ray's samples and the transmittance in front of each.
pub fn weigh_samples(samples: &[[f32; 4]]) -> Vec<[Bounded; 2]> {
    let mut sum = Bounded::ZERO;
    let weigh = |sample: &[f32; 4]| {
        let before = passing(sum);
        if sample[3] > 0.0 {
            sum = sum + sample[3].into();
            [before - passing(sum), before]
        } else {
            [Bounded::ZERO, before]
        }
    };
    samples.iter().map(weigh).collect()
}

/// The transmittance of an optical depth.
fn passing(optical_depth: Bounded) -> Bounded {
    if optical_depth == Bounded::ZERO { Bounded::ONE } else { (-optical_depth).exp() }
}

/// Whether a sample is in the mask; `None` if it depends on rounding. `seen[ray][part]` is weight and transmittance.
pub fn is_sampled(
    seen: &[[f32; 2]],
    ray: &TargetRay,
    depth: f32,
    index: u32,
    pixel: u32,
    block: &SampleMaskBlock,
) -> Option<bool> {
    let share = (Bounded::from(depth) - ray.near.into()) / (Bounded::from(ray.far) - ray.near.into());
    let part = share * Bounded::from(block.part_count);
    let last = f64::from(block.part_count - 1);
    let [low, high] = [-1.0, 1.0].map(|side| (part.value + side * part.error).clamp(0.0, last) as u32);
    let witnesses = match block.step {
        0 => vec![index],
        step => {
            let (column, row) = (pixel % block.width / step, pixel / block.width / step);
            let columns = [column, column + 1].map(|column| column.min(block.seen_columns - 1));
            let rows = [row, row + 1].map(|row| row.min(block.seen_rows - 1));
            rows.iter().flat_map(|row| columns.map(|column| row * block.seen_columns + column)).collect()
        }
    };
    let answer = |part| {
        let says_so = |ray: &u32| {
            let count = block.part_count as usize;
            says_so(&seen[*ray as usize * count..][..count], part, block)
        };
        any(witnesses.iter().map(says_so))
    };
    // Into whichever part the sample falls.
    let answers = [answer(low), answer(high)];
    if answers[0] == answers[1] { answers[0] } else { None }
}

/// Whether a ray's weights put samples in a part into the mask.
fn says_so(seen: &[[f32; 2]], part: u32, block: &SampleMaskBlock) -> Option<bool> {
    let part = part as usize;
    let around = &seen[part.saturating_sub(1)..seen.len().min(part + 2)];
    let [end_weight, end_transmittance] = seen[seen.len() - 1].map(Bounded::from);
    let opacity = Bounded::ONE - (end_transmittance - end_weight);
    let sees_too_little = opacity.below(block.least_opacity.into());
    let ends_before = !(around[0][1] > block.termination);
    let occupied = |[weight, transmittance]: &[f32; 2]| {
        let least = Bounded::from(block.least_share) * Bounded::from(*transmittance);
        let flushed = if least.value > 0.0 { NEGLIGIBLE } else { 0.0 };
        Bounded::from(*weight).below(Bounded { error: least.error + flushed, ..least }).map(|below| !below)
    };
    let refused = any([sees_too_little, Some(ends_before)].into_iter());
    match (refused, any(around.iter().map(occupied))) {
        (Some(true), _) | (_, Some(false)) => Some(false),
        (Some(false), occupied) => occupied,
        _ => None,
    }
}
