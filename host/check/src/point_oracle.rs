//! PixelNeRF's points in `f64`: the inputs of its network and radiance from its outputs, with bounds on the error of
//! `f32`.

use super::bounded::Bounded;
use super::camera_oracle::{Vector, axes, bilinear, centre, dot, point, project, tents};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::pixelnerf::{EmbedBlock, GatherBlock};

/// Nearer points are not in front of a view.
const MIN_DEPTH: f32 = 1.0e-20;

/// The largest magnitude whose exponential is not saturated.
const SATURATED: f32 = 88.7;

/// A vector in a view's axes: right, up, backward.
fn in_view_axes(view: &CameraBlock, vector: Vector) -> Vector {
    let [right, down, forward] = axes(view).map(|axis| dot(axis, vector));
    [right, -down, -forward]
}

/// The features of a point in a view.
pub fn embed(view: &CameraBlock, at: &RayPoint, block: &EmbedBlock) -> Vec<Bounded> {
    let position = in_view_axes(view, point(at.position));
    let mut features = position.to_vec();
    for octave in 0..block.frequency_count {
        // Powers of two are exact.
        let frequency = Bounded::from(block.frequency * (1_u32 << octave) as f32);
        let angles = position.map(|coordinate| coordinate * frequency);
        features.extend(angles.map(Bounded::sine));
        features.extend(angles.map(Bounded::cosine));
    }
    features.extend(in_view_axes(view, point(at.direction)));
    features
}

/// Whether a point is in front of a view; `None` if it depends on rounding.
pub(super) fn is_in_front(view: &CameraBlock, at: Vector) -> Option<bool> {
    let origin = centre(view);
    let [_, _, forward] = axes(view);
    Bounded::from(MIN_DEPTH).below(dot(forward, [0, 1, 2].map(|axis| at[axis] - origin[axis])))
}

/// The weights of all views at a point.
pub fn visible_weights(views: &[CameraBlock], weights: &[f32], at: &RayPoint) -> Vec<Option<Bounded>> {
    let position = point(at.position);
    let weights: Vec<Bounded> = weights.iter().copied().map(Bounded::from).collect();
    let Some(seen) = views.iter().map(|view| is_in_front(view, position)).collect::<Option<Vec<bool>>>() else {
        return vec![None; views.len()];
    };
    let of_seen: Vec<Bounded> =
        weights.iter().zip(&seen).map(|(weight, seen)| if *seen { *weight } else { Bounded::ZERO }).collect();
    let all = of_seen.iter().fold(Bounded::ZERO, |sum, weight| sum + *weight);
    if all.value == 0.0 || !seen.contains(&false) {
        return weights.into_iter().map(Some).collect();
    }
    of_seen.into_iter().map(|weight| Some(weight / all)).collect()
}

/// All channels of a view's grid at a point's projection; `None` if it depends on rounding whether the point is in
/// front.
pub fn gather(view: &CameraBlock, grid: &[f32], at: &RayPoint, block: &GatherBlock) -> Option<Vec<Bounded>> {
    let position = point(at.position);
    let (x, y) = if is_in_front(view, position)? {
        let seen = project(view, position);
        let node = |coordinate: Bounded, grid_side: u32, side: u32| {
            let scale = Bounded::from(grid_side) / Bounded::from(side);
            (coordinate - block.pixel_centre.into()) * scale + Bounded::from(0.5)
        };
        (node(seen.x, block.width, view.width), node(seen.y, block.height, view.height))
    } else {
        // The first node.
        (Bounded::ZERO, Bounded::ZERO)
    };
    let (columns, rows) = (tents(x, block.width), tents(y, block.height));
    let channels = block.channel_count as usize;
    let node = |row: usize, column: usize| (row * block.width as usize + column) * channels;
    Some(
        (0..channels)
            .map(|channel| bilinear(|row, column| grid[node(row, column) + channel], &columns, &rows))
            .collect(),
    )
}

/// Red, green, blue and optical depth from a network's outputs.
pub fn radiance(raw: &[f32], length: f32) -> [Bounded; 4] {
    let colour = |raw: f32| {
        let exponential = (-Bounded::from(raw)).lesser(SATURATED.into()).exp();
        let colour = Bounded::ONE / (Bounded::ONE + exponential);
        // What a device may flush to 0, and divide as it likes.
        Bounded { error: colour.error + f64::from(f32::MIN_POSITIVE), ..colour }
    };
    let density = Bounded::from(raw[3]).greater(Bounded::ZERO);
    [colour(raw[0]), colour(raw[1]), colour(raw[2]), density * length.into()]
}
