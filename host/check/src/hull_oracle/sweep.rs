//! The sweep: costs of planes, their means over windows, the depth of least cost.

use super::{NOWHERE, Scene, along, centre, look_up, project, radius, towards};
use crate::bounded::{Bounded, ROUNDING};
use crate::camera_oracle::{cell, window};
use viewfuse_kernels::visual_hull::hull::SWEPT_ALPHA;
use viewfuse_kernels::visual_hull::sweep::{
    DEPTH_COST, MAX_DIFFERENCE, MAX_ROUGHNESS, NO_WITNESS, OUTSIDE, ROUGHNESS_COST, SEEN_BEHIND_ENTRY,
    SWEPT_BEHIND_ENTRY, SweepBlock, WINDOW_REACH,
};
use viewfuse_kernels::visual_hull::{NO_SURFACE, ObjectBlock};

/// The cost outside the hull.
const OUT: Bounded = Bounded { value: OUTSIDE as f64, error: 0.0 };

fn plane_depth(sweep: &SweepBlock, plane: u32) -> Bounded {
    Bounded::from(sweep.near) + (Bounded::from(plane) + Bounded::from(0.5)) * Bounded::from(sweep.plane_step)
}

/// Mean absolute difference between a pixel's colour and the other views' colours at its point on a plane; a share of
/// [`NO_WITNESS`] always has the difference [`MAX_DIFFERENCE`].
pub fn match_cost(
    scene: &Scene,
    sweep: &SweepBlock,
    entries: &[f32],
    pair_weights: &[f32],
    pixel: u32,
    plane: u32,
) -> Option<Bounded> {
    let camera = &scene.views[sweep.view as usize];
    let texel = (camera.first_texel + pixel) as usize;
    let depth = plane_depth(sweep, plane);
    let behind_entry = depth - Bounded::from(entries[texel]);
    let object_radius = radius(scene.object);
    let in_front = behind_entry.below(Bounded::from(-0.5) * Bounded::from(sweep.plane_step))?;
    if in_front || (Bounded::from(SWEPT_BEHIND_ENTRY) * object_radius).below(behind_entry)? {
        return Some(OUT);
    }
    let here = scene.texels[texel].map(Bounded::from);
    let at = [(pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5];
    let place = along(centre(camera), towards(camera, at), depth);
    let mut containing = 1;
    let (mut undecided, mut votes) = (false, Vec::new());
    for (other, view) in scene.views.iter().enumerate().filter(|(other, _)| *other != sweep.view as usize) {
        let seen = project(view, place);
        if seen.in_front == Some(false) {
            continue;
        }
        let colour = look_up(view, scene.texels, seen.x, seen.y);
        match (seen.in_front, colour[3].below(SWEPT_ALPHA.into())) {
            (Some(true), Some(true)) => return Some(OUT),
            (Some(true), Some(false)) => {}
            _ => undecided = true,
        }
        match seen.in_image {
            Some(true) => containing += 1,
            Some(false) => continue,
            None => undecided = true,
        }
        let (Some(column), Some(row)) = (cell(seen.x, view.width), cell(seen.y, view.height)) else {
            undecided = true;
            continue;
        };
        let entry = Bounded::from(entries[view.first_texel as usize + row * view.width as usize + column]);
        let reach = Bounded::from(SEEN_BEHIND_ENTRY) * object_radius;
        let behind = (seen.depth - entry).greater(Bounded::ZERO) / reach;
        let weight = Bounded::from(pair_weights[sweep.view as usize * scene.views.len() + other]);
        let share = weight * super::bell(behind);
        let differences = [0, 1, 2].map(|c| (colour[c] / colour[3] - here[c] / here[3]).magnitude());
        let difference = (differences[0] + differences[1] + differences[2]) / Bounded::from(3.0);
        votes.push((share, difference.lesser(MAX_DIFFERENCE.into())));
    }
    if undecided {
        return None;
    }
    if containing < scene.object.least_containing {
        return Some(OUT);
    }
    let no_witness = (Bounded::from(NO_WITNESS), Bounded::from(MAX_DIFFERENCE));
    let total = votes.iter().fold(no_witness.0, |sum, (share, _)| sum + *share);
    // The mean as a correction of the first vote: an error of a share counts as far as its vote differs.
    let excess =
        votes.iter().fold(Bounded::ZERO, |sum, (share, difference)| sum + *share * (*difference - no_witness.1));
    let mean = no_witness.1 + excess / total;
    // The two sums as they are usually taken round once for each vote, relative to the whole.
    Some(Bounded { error: mean.error + (votes.len() + 2) as f64 * ROUNDING * mean.value, ..mean })
}

/// Sum and count of the costs inside the hull over a row of the window.
pub fn sum_row(sweep: &SweepBlock, width: u32, costs: &[f32], pixel: u32, plane: u32) -> [Option<Bounded>; 2] {
    let row_start = pixel - pixel % width;
    let inside = window(pixel % width, WINDOW_REACH, width)
        .map(|column| costs[((row_start + column) * sweep.plane_count + plane) as usize])
        .filter(|cost| *cost >= 0.0);
    let (sum, count) = inside.fold((Bounded::ZERO, 0_u32), |(sum, count), cost| (sum + cost.into(), count + 1));
    [Some(sum), Some(count.into())]
}

/// Mean of all costs inside the hull over the window, from the costs themselves.
pub fn mean_column(sweep: &SweepBlock, width: u32, costs: &[f32], pixel: u32, plane: u32) -> Option<Bounded> {
    let cost = |column: u32, row: u32| costs[((row * width + column) * sweep.plane_count + plane) as usize];
    let (column, row) = (pixel % width, pixel / width);
    if cost(column, row) < 0.0 {
        return Some(OUT);
    }
    let rows = window(row, WINDOW_REACH, sweep.row_count);
    let all = rows.flat_map(|row| window(column, WINDOW_REACH, width).map(move |column| cost(column, row)));
    let inside: Vec<f32> = all.filter(|cost| *cost >= 0.0).collect();
    let sum = inside.iter().fold(Bounded::ZERO, |sum, cost| sum + (*cost).into());
    Some(sum / Bounded::from(inside.len() as u32))
}

/// Depth of the plane of least cost, moved to the vertex of the parabola through it and its neighbours.
pub fn pick_depth(
    object: &ObjectBlock,
    sweep: &SweepBlock,
    width: u32,
    means: &[f32],
    entries: &[f32],
    guess: &[f32],
    pixel: u32,
) -> Option<Bounded> {
    let entry = entries[pixel as usize];
    if entry >= NO_SURFACE {
        return Some(NOWHERE);
    }
    let (column, row) = (i64::from(pixel % width), i64::from(pixel / width));
    let beside = [[-1, 0], [1, 0], [0, -1], [0, 1]];
    let diagonal = [[-2, -2], [-2, 2], [2, -2], [2, 2]];
    let around: Vec<Bounded> = beside
        .into_iter()
        .chain(diagonal)
        .map(|[x, y]| [column + x, row + y])
        .filter(|[x, y]| (0..i64::from(width)).contains(x) && (0..i64::from(sweep.row_count)).contains(y))
        .map(|[x, y]| guess[(y * i64::from(width) + x) as usize])
        .filter(|depth| *depth < NO_SURFACE)
        .map(Bounded::from)
        .collect();
    let cost = |plane: u32| -> Option<Bounded> {
        let mean = means[(pixel * sweep.plane_count + plane) as usize];
        if mean < 0.0 {
            return None;
        }
        let depth = plane_depth(sweep, plane);
        let behind = (depth - Bounded::from(entry)).greater(Bounded::ZERO) / radius(object);
        let rough = |sum: Bounded, near: &Bounded| {
            let footprints = (depth - *near).magnitude() / Bounded::from(sweep.footprint);
            sum + footprints.lesser(MAX_ROUGHNESS.into())
        };
        let roughness = around.iter().fold(Bounded::ZERO, rough) / Bounded::from(around.len().max(1) as u32);
        Some(Bounded::from(mean) + Bounded::from(DEPTH_COST) * behind + Bounded::from(ROUGHNESS_COST) * roughness)
    };
    let costs: Vec<Option<Bounded>> = (0..sweep.plane_count).map(cost).collect();
    let known = costs.iter().enumerate().filter_map(|(plane, cost)| cost.map(|cost| (plane, cost)));
    let Some((best_plane, best)) = known.clone().min_by(|a, b| a.1.value.total_cmp(&b.1.value)) else {
        return Some(entry.into());
    };
    for (_, other) in known.filter(|(plane, _)| *plane != best_plane) {
        best.below(other)?;
    }
    let middle = plane_depth(sweep, best_plane as u32);
    let before = best_plane.checked_sub(1).and_then(|plane| costs[plane]);
    let after = costs.get(best_plane + 1).copied().flatten();
    let (Some(before), Some(after)) = (before, after) else {
        return Some(middle);
    };
    let curvature = (before - best) + (after - best);
    if !Bounded::from(1.0e-9).below(curvature)? {
        return Some(middle);
    }
    let offset = ((before - after) / curvature * Bounded::from(0.5)).clamped(-0.5, 0.5);
    Some(middle + offset * Bounded::from(sweep.plane_step))
}
