//! Occupancy and colour at a point, and a ray through them.

use super::{
    BoundedProjection, NOWHERE, Scene, Vector, along, centre, interval, look_up, project, radius, tents, towards,
};
use crate::bounded::{Bounded, ROUNDING};
use viewfuse_core::camera::CameraBlock;
use viewfuse_kernels::visual_hull::NO_SURFACE;
use viewfuse_kernels::visual_hull::ray_marching::{MAX_STEPS, STEP};
use viewfuse_kernels::visual_hull::shade::{
    DEEPEST, EMPTY_ALPHA, FULL_ALPHA, HIDDEN_SHARE, JUMP, SEEN_BEHIND, SURFACE_OFFSET, SURFACE_WIDTH, TRUNCATION,
};

/// Occupancy and colour.
pub type Colour = (Bounded, [Bounded; 3]);

const EMPTY: Colour = (Bounded::ZERO, [Bounded::ZERO; 3]);

/// Depth of a map at an image coordinate; [`NOWHERE`] where there is no surface.
pub fn depth_at(camera: &CameraBlock, depths: &[f32], x: Bounded, y: Bounded, jump: Bounded) -> Option<Bounded> {
    let (columns, rows) = (tents(x, camera.width), tents(y, camera.height));
    let error = columns.error + rows.error;
    let at = |row: usize, column: usize| camera.first_texel as usize + row * camera.width as usize + column;
    let nodes: Vec<(Bounded, f32)> = rows
        .nodes
        .iter()
        .flat_map(|(row, height)| {
            columns.nodes.iter().map(move |(column, width)| (width * height, depths[at(*row, *column)]))
        })
        .map(|(value, depth)| (Bounded { value, error }, depth))
        .collect();
    let seen: Vec<f32> = nodes.iter().map(|(_, depth)| *depth).filter(|depth| *depth < NO_SURFACE).collect();
    if seen.is_empty() {
        return Some(NOWHERE);
    }
    let nearest = seen.iter().copied().fold(NO_SURFACE, f32::min);
    let greatest = nodes.iter().map(|(share, _)| share.value).fold(0.0, f64::max);
    let candidates = nodes.iter().filter(|(share, _)| share.value + 2.0 * error >= greatest).map(|(_, depth)| *depth);
    // The same nodes must be on the surface, whichever of nearly equal shares is the greatest.
    let mut surface: Option<Vec<bool>> = None;
    for candidate in candidates {
        if candidate >= NO_SURFACE && nodes.len() > 4 {
            // Which four nodes are the candidates depends on rounding.
            return None;
        }
        let anchor = Bounded::from(if candidate < NO_SURFACE { candidate } else { nearest });
        let belongs = |(_, depth): &(Bounded, f32)| {
            (Bounded::from(*depth) - anchor).magnitude().below(jump).map(|near| near || jump.value == 0.0)
        };
        let members: Vec<bool> = nodes.iter().map(belongs).collect::<Option<_>>()?;
        if surface.get_or_insert_with(|| members.clone()) != &members {
            return None;
        }
    }
    let members = surface?;
    let on_surface: Vec<&(Bounded, f32)> =
        nodes.iter().zip(&members).filter(|(_, member)| **member).map(|(node, _)| node).collect();
    let least = on_surface.iter().map(|(_, depth)| f64::from(*depth)).fold(f64::MAX, f64::min);
    let greatest = on_surface.iter().map(|(_, depth)| f64::from(*depth)).fold(f64::MIN, f64::max);
    let total: f64 = on_surface.iter().map(|(share, _)| share.value).sum();
    let doubt = error * on_surface.len() as f64;
    if greatest > least && total <= 2.0 * doubt {
        return None;
    }
    // Relative to the least depth: an error of a share counts as far as its depth differs.
    let excess: f64 = on_surface.iter().map(|(share, depth)| share.value * (f64::from(*depth) - least)).sum();
    let value = if greatest > least { least + excess / total } else { least };
    let spread = if greatest > least { (greatest - least) * doubt / (total - doubt) } else { 0.0 };
    // Sums of four depths times shares, and their quotient.
    Some(Bounded { value, error: spread + 5.0 * ROUNDING * value })
}

/// Views by index, with the projection of a point and their depth and colour there.
type Witnesses = Vec<(usize, BoundedProjection, [Bounded; 4])>;

/// The views that contain a point, and the least alpha over all views that have it in front of them; the inner `None`
/// if it projects to the background of one of them.
fn containing(scene: &Scene, place: Vector) -> Option<Option<(Witnesses, Bounded)>> {
    let mut undecided = false;
    let (mut views, mut hull) = (Vec::new(), Bounded::ONE);
    for (index, view) in scene.views.iter().enumerate() {
        let seen = project(view, place);
        if seen.in_front == Some(false) {
            continue;
        }
        let texel = look_up(view, scene.texels, seen.x, seen.y);
        match (seen.in_front, texel[3].below(EMPTY_ALPHA.into())) {
            (Some(true), Some(true)) => return Some(None),
            (Some(true), Some(false)) => hull = hull.lesser(texel[3]),
            _ => undecided = true,
        }
        match seen.in_image {
            Some(true) => views.push((index, seen, texel)),
            Some(false) => {}
            None => undecided = true,
        }
    }
    if undecided { None } else { Some(Some((views, hull))) }
}

/// Occupancy and colour at a point.
pub fn sample(scene: &Scene, footprints: &[f32], depths: &[f32], weights: &[f32], place: Vector) -> Option<Colour> {
    let Some((views, hull)) = containing(scene, place)? else {
        return Some(EMPTY);
    };
    if views.len() < scene.object.least_containing as usize {
        return Some(EMPTY);
    }
    let (mut distances, mut distance_share) = (Bounded::ZERO, Bounded::ZERO);
    let (mut colours, mut colour_share) = ([Bounded::ZERO; 3], Bounded::ZERO);
    let mut least_behind = NOWHERE;
    let truncation = Bounded::from(TRUNCATION);
    for (view, seen, texel) in views.into_iter().filter(|(view, _, _)| weights[*view] > 0.0) {
        let (weight, footprint) = (Bounded::from(weights[view]), Bounded::from(footprints[view]));
        let camera = &scene.views[view];
        let depth = depth_at(camera, depths, seen.x, seen.y, Bounded::from(JUMP) * footprint)?;
        // Positive in front of the surface, in footprints; nothing seen is free space.
        let distance = if depth == NOWHERE { truncation } else { (depth - seen.depth) / footprint };
        let behind = (Bounded::ZERO - distance).greater(Bounded::ZERO);
        least_behind = least_behind.lesser(behind * footprint);
        // Fades out where it is cut off: no threshold.
        let share = weight * (Bounded::ONE - behind / truncation).greater(Bounded::ZERO);
        distances = distances + share * distance.lesser(truncation);
        distance_share = distance_share + share;
        let falloff = behind / Bounded::from(SEEN_BEHIND);
        let visible = super::bell(falloff);
        let hidden = Bounded::from(HIDDEN_SHARE) / (Bounded::ONE + behind.squared());
        let share = weight * (visible + hidden) * texel[3];
        for channel in 0..3 {
            colours[channel] = colours[channel] + share * texel[channel];
        }
        colour_share = colour_share + share * texel[3];
    }
    if (Bounded::from(DEEPEST) * radius(scene.object)).below(least_behind)? {
        return Some(EMPTY);
    }
    let outside = Bounded::ZERO - truncation;
    let known = Bounded::from(1.0e-4_f32).below(distance_share)?;
    let distance = if known { distances / distance_share } else { outside };
    let inside = (hull / Bounded::from(FULL_ALPHA)).lesser(Bounded::ONE);
    let step = ((distance - Bounded::from(SURFACE_OFFSET)) / Bounded::from(SURFACE_WIDTH)).exp();
    let colour = if colour_share.value > 0.0 { colours.map(|sum| sum / colour_share) } else { [Bounded::ZERO; 3] };
    Some((inside / (Bounded::ONE + step), colour))
}

/// Colour, depth and opacity of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// Red, green, blue.
    pub colour: [Bounded; 3],
    /// Depth; 0 if the opacity is below a half. `None` if that depends on rounding.
    pub depth: Option<Bounded>,
    /// Opacity.
    pub opacity: Bounded,
}

/// If it depends on rounding whether a ray terminates, it does at this transmittance or less, and its error grows by
/// the transmittance.
const DARK: f64 = 1.0e-3;

/// A target's ray: in equal steps of at most a footprint through the box, until the transmittance is at most
/// `termination`.
#[allow(clippy::too_many_arguments)]
pub fn march_ray(
    scene: &Scene,
    footprints: &[f32],
    depths: &[f32],
    weights: &[f32],
    target: &CameraBlock,
    at: [f32; 2],
    background: [f32; 3],
    termination: f32,
) -> Option<Pixel> {
    let (origin, direction) = (centre(target), towards(target, at));
    let (enter, leave) = interval(scene.object, origin, direction);
    let (mut passes, mut lost) = (Bounded::ONE, 0.0);
    // What is met, and what passes behind it.
    let mut layers: Vec<(Bounded, [Bounded; 3])> = Vec::new();
    let (mut first, mut behind_first) = (None, Bounded::ZERO);
    if enter.below(leave)? {
        let footprint = (enter + leave) / (Bounded::from(2.0) * Bounded::from(target.intrinsics[0]));
        let wanted = ((leave - enter) / (Bounded::from(STEP) * footprint)).clamped(1.0, (MAX_STEPS - 1) as f32);
        let floor = (wanted.value - wanted.error).floor();
        if floor != (wanted.value + wanted.error).floor() {
            return None;
        }
        let count = floor as u32 + 1;
        let step = (leave - enter) / Bounded::from(count);
        for index in 0..count {
            match Bounded::from(termination).below(passes) {
                Some(true) => {}
                Some(false) => break,
                None if passes.value + passes.error <= DARK => {
                    lost = passes.value + passes.error;
                    break;
                }
                None => return None,
            }
            let depth = enter + (Bounded::from(index) + Bounded::from(0.5)) * step;
            let (occupancy, here) = sample(scene, footprints, depths, weights, along(origin, direction, depth))?;
            let behind = passes.lesser(Bounded::ONE - occupancy);
            if behind == passes {
                continue;
            }
            let weight = passes - behind;
            // Relative to the first depth: an error of a weight counts as far as its depth differs.
            behind_first = behind_first + weight * (depth - *first.get_or_insert(depth));
            layers.push((behind, here));
            passes = behind;
        }
    }
    let colour = [0, 1, 2].map(|channel| {
        let seen = blended(&layers, channel, background[channel]);
        Bounded { error: seen.error + lost, ..seen }
    });
    let opacity = Bounded::ONE - passes;
    let depth = match opacity.below(Bounded::from(0.5)) {
        Some(true) => Some(Bounded::ZERO),
        Some(false) => {
            let mean = first.unwrap_or(Bounded::ZERO) + behind_first / opacity;
            // The sum of weights times whole depths rounds once for each of them.
            let rounding = (layers.len() + 2) as f64 * ROUNDING * mean.value + 2.0 * lost * mean.value;
            Some(Bounded { error: mean.error + rounding, ..mean })
        }
        None => None,
    };
    Some(Pixel { colour, depth, opacity: Bounded { error: opacity.error + lost, ..opacity } })
}

/// A channel of layers before a background, by parts: `sum (T_i - T_(i+1)) c_i` is `c_0 + sum T_i (c_i - c_(i-1))`, so
/// that an error of a transmittance contributes the change of the colour there. `layers` have the transmittance behind
/// each.
fn blended(layers: &[(Bounded, [Bounded; 3])], channel: usize, background: f32) -> Bounded {
    let background = Bounded::from(background);
    let colour = |layer: usize| layers.get(layer).map_or(background, |(_, colour)| colour[channel]);
    let (mut before, mut value, mut error) = (Bounded::ONE, 0.0, 0.0);
    let mut largest = background.value.abs();
    for (index, (behind, _)) in layers.iter().enumerate() {
        let (here, next) = (colour(index), colour(index + 1));
        let weight = before.value - behind.value;
        value += weight * here.value;
        error += (weight + before.error + behind.error) * here.error;
        error += behind.error * ((next.value - here.value).abs() + next.error);
        largest = largest.max(here.value.abs());
        before = *behind;
    }
    value += before.value * background.value;
    // Every partial sum is rounded, and every product and weight in it.
    Bounded { value, error: error + (layers.len() + 2) as f64 * ROUNDING * largest }
}
