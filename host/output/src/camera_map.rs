//! The cameras of a scene on a map, seen from above.

use super::canvas::{BLUE, CHARACTER_WIDTH, Canvas, Colour, GREY, INK, LINE_HEIGHT, RED};
use image::RgbImage;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_kernels::visual_hull::ObjectBlock;
use viewfuse_scene::Scene;
use viewfuse_scene::inspect::Inspection;

/// Width of the map and the most that it is high.
const MAP_SIDE: i32 = 560;
const MAP_MARGIN: i32 = 60;
/// The brightest level of a point: white ones would be lost on the page.
const MAX_LEVEL: u8 = 210;

/// The share of the points that is on the map, as far as the map then reaches at most [`MAX_REACH`] times as far as the
/// cameras: single points are far away, and so are backgrounds.
const SHOWN_POINTS: f32 = 0.9;
const MAX_REACH: f32 = 2.0;

/// The cameras seen from above (along the up direction): sources blue, target poses red, the object's box grey;
/// reconstructed points in their colours. A name is written where it covers no camera and no other name.
pub fn camera_map(scene: &Scene, inspection: &Inspection) -> RgbImage {
    let focus = Vec3::from_array(inspection.focus);
    let up = Vec3::from_array(inspection.up);
    let right = up.any_orthonormal_vector();
    let back = up.cross(right);
    let flat = |point: Vec3| [(point - focus).dot(right), (point - focus).dot(back)];
    let centre_of = |camera: &Camera| flat(camera.pose.centre_world());
    let points: Vec<([f32; 2], Colour)> =
        scene.points.iter().map(|point| (flat(point.position_world), point.colour)).collect();
    // Of both axes: cameras in a row have no width across it, where what they pass is.
    let places = scene.views.iter().flat_map(|view| centre_of(&view.camera));
    let reach = places.fold(0.0_f32, |reach, place| reach.max(place.abs()));
    let shown = [0, 1].map(|axis| {
        let cameras = scene.views.iter().map(|view| centre_of(&view.camera)[axis]);
        shown_of(cameras, points.iter().map(|(place, _)| place[axis]), MAX_REACH * reach)
    });
    let extent = shown.iter().map(|[low, high]| high - low).fold(f32::MIN_POSITIVE, f32::max);
    let scale = (MAP_SIDE - 2 * MAP_MARGIN) as f32 / extent;
    let map_height = ((shown[1][1] - shown[1][0]) * scale) as i32 + 2 * MAP_MARGIN;
    let [middle_x, middle_y] = shown.map(|[low, high]| 0.5 * (low + high));
    // Points may be far beyond the map.
    let pixels = |length: f32| (length * scale).clamp(-1.0e6, 1.0e6) as i32;
    let at = |[x, y]: [f32; 2]| (MAP_SIDE / 2 + pixels(x - middle_x), map_height / 2 - pixels(y - middle_y));
    let legend = 2 * LINE_HEIGHT as i32 + 12;
    let mut canvas = Canvas::new(MAP_SIDE as u32, (map_height + legend) as u32);
    for (place, colour) in &points {
        let place = at(*place);
        if (0..MAP_SIDE).contains(&place.0) && (0..map_height - 1).contains(&place.1) {
            canvas.fill(place.0, place.1, 2, 2, colour.map(|level| level.min(MAX_LEVEL)));
        }
    }
    if let Some([low, high]) = inspection.object {
        let corners = ObjectBlock::new(Vec3::from_array(low), Vec3::from_array(high), 1).corners();
        for first in 0..8_usize {
            // Corners that differ in one bit share an edge.
            for second in [first ^ 1, first ^ 2, first ^ 4].into_iter().filter(|second| *second > first) {
                canvas.line(at(flat(corners[first])), at(flat(corners[second])), GREY);
            }
        }
    }
    let middle = at([0.0, 0.0]);
    canvas.line((middle.0 - 5, middle.1), (middle.0 + 5, middle.1), INK);
    canvas.line((middle.0, middle.1 - 5), (middle.0, middle.1 + 5), INK);
    // What names must not cover.
    let mut taken = Vec::new();
    for view in &scene.views {
        let colour = if view.image.is_some() { BLUE } else { RED };
        let pose = &view.camera.pose;
        let from = at(centre_of(&view.camera));
        let ahead = flat(pose.centre_world() + pose.forward_world() * (0.06 * extent));
        canvas.line(from, at(ahead), colour);
        canvas.disc(from, 7, colour);
        taken.push([from.0 - 3, from.1 - 3, from.0 + 4, from.1 + 4]);
    }
    for view in &scene.views {
        let from = at(centre_of(&view.camera));
        let label = short_name(&view.name);
        if let Some(place) = place_of_name(from, middle, label.chars().count() as i32, map_height, &taken) {
            canvas.text(place[0], place[1], &label, INK);
            taken.push(place);
        }
    }
    let points = if points.is_empty() { String::new() } else { format!("; {} points", points.len()) };
    let line = |number: i32| map_height + 4 + number * LINE_HEIGHT as i32;
    let count = format!(
        "{} photographs (blue), {} target poses (red), seen from above; + is the common focus",
        inspection.photograph_count, inspection.target_count
    );
    canvas.text(10, line(0), &count, INK);
    let size = format!(
        "distance {:.3} to {:.3}, object near {:.3}, far {:.3}{points}",
        inspection.distances[0], inspection.distances[1], inspection.near, inspection.far
    );
    canvas.text(10, line(1), &size, INK);
    canvas.into_image()
}

/// What is on the map along an axis: the focus, at 0, all cameras, and of the points as many as [`SHOWN_POINTS`] lets
/// on it, as far as `most`.
fn shown_of(cameras: impl Iterator<Item = f32>, points: impl Iterator<Item = f32>, most: f32) -> [f32; 2] {
    let [low, high] = cameras.fold([0.0_f32; 2], |[low, high], place| [low.min(place), high.max(place)]);
    let mut points: Vec<f32> = points.collect();
    points.sort_by(f32::total_cmp);
    let beyond = (0.5 * (1.0 - SHOWN_POINTS) * points.len() as f32) as usize;
    let (Some(first), Some(last)) = (points.get(beyond), points.iter().rev().nth(beyond)) else { return [low, high] };
    [low.min(first.max(-most)), high.max(last.min(most))]
}

/// Left, top, right and bottom of a name of so many characters beside its camera: outwards from the middle if it is
/// free there, otherwise on another side. `None` where no side is free: it would be read as another camera's.
fn place_of_name(
    (x, y): (i32, i32),
    middle: (i32, i32),
    characters: i32,
    map_height: i32,
    taken: &[[i32; 4]],
) -> Option<[i32; 4]> {
    let (width, height) = (characters * CHARACTER_WIDTH as i32, LINE_HEIGHT as i32);
    let [right, left] = [(x + 8, y - 5), (x - 8 - width, y - 5)];
    let [above, below] = [(x - width / 2, y - 5 - height), (x - width / 2, y + 6)];
    let sides = if x >= middle.0 { [right, left] } else { [left, right] };
    let ends = if y <= middle.1 { [above, below] } else { [below, above] };
    let places = sides.into_iter().chain(ends).map(|(left, top)| [left, top, left + width, top + height]);
    let is_free = |place: &[i32; 4]| {
        let is_on_map = place[0] >= 0 && place[1] >= 0 && place[2] <= MAP_SIDE && place[3] <= map_height;
        let is_apart = |other: &[i32; 4]| {
            place[0] >= other[2] || other[0] >= place[2] || place[1] >= other[3] || other[1] >= place[3]
        };
        is_on_map && taken.iter().all(is_apart)
    };
    places.into_iter().find(is_free)
}

/// The number at the end of a name without leading zeros, or the whole name if there is none.
fn short_name(name: &str) -> String {
    let digits = name.len() - name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let number = name[name.len() - digits..].trim_start_matches('0');
    match (digits, number) {
        (0, _) => name.to_owned(),
        (_, "") => "0".to_owned(),
        (_, number) => number.to_owned(),
    }
}
