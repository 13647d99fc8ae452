//! The cameras of a scene on a map, seen from above.

use super::canvas::{BLUE, Canvas, Colour, GREY, INK, LINE_HEIGHT, RED};
use image::RgbImage;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_kernels::visual_hull::ObjectBlock;
use viewfuse_scene::Scene;
use viewfuse_scene::inspect::Inspection;

const MAP_SIDE: i32 = 560;
const MAP_MARGIN: i32 = 60;
/// The brightest level of a point: white ones would be lost on the page.
const MAX_LEVEL: u8 = 210;

/// The share of the points that is on the map, as far as the map then reaches at most [`MAX_REACH`] times as far as the
/// cameras: single points are far away, and so are backgrounds.
const SHOWN_POINTS: f32 = 0.9;
const MAX_REACH: f32 = 2.0;

/// The cameras seen from above (along the up direction): sources blue, target poses red, the object's box grey;
/// reconstructed points in their colours.
pub fn camera_map(scene: &Scene, inspection: &Inspection) -> RgbImage {
    let focus = Vec3::from_array(inspection.focus);
    let up = Vec3::from_array(inspection.up);
    let right = up.any_orthonormal_vector();
    let back = up.cross(right);
    let flat = |point: Vec3| ((point - focus).dot(right), (point - focus).dot(back));
    let centre_of = |camera: &Camera| flat(camera.pose.centre_world());
    let reach = scene
        .views
        .iter()
        .map(|view| centre_of(&view.camera))
        .fold(0.0_f32, |reach, (x, y)| reach.max(x.abs()).max(y.abs()))
        .max(f32::MIN_POSITIVE);
    let points: Vec<((f32, f32), Colour)> =
        scene.points.iter().map(|point| (flat(point.position_world), point.colour)).collect();
    let reach = reach.max(reach_of(&points).min(MAX_REACH * reach));
    let scale = (MAP_SIDE / 2 - MAP_MARGIN) as f32 / reach;
    let at = |(x, y): (f32, f32)| (MAP_SIDE / 2 + (x * scale) as i32, MAP_SIDE / 2 - (y * scale) as i32);
    let legend = 2 * LINE_HEIGHT as i32 + 12;
    let mut canvas = Canvas::new(MAP_SIDE as u32, (MAP_SIDE + legend) as u32);
    for (place, colour) in &points {
        let place = at(*place);
        if (0..MAP_SIDE).contains(&place.0) && (0..MAP_SIDE - 1).contains(&place.1) {
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
    let middle = at((0.0, 0.0));
    canvas.line((middle.0 - 5, middle.1), (middle.0 + 5, middle.1), INK);
    canvas.line((middle.0, middle.1 - 5), (middle.0, middle.1 + 5), INK);
    for view in &scene.views {
        let colour = if view.image.is_some() { BLUE } else { RED };
        let pose = &view.camera.pose;
        let from = at(centre_of(&view.camera));
        let ahead = flat(pose.centre_world() + pose.forward_world() * (0.12 * reach));
        canvas.line(from, at(ahead), colour);
        canvas.disc(from, 7, colour);
        // Names are drawn outside the ring.
        let outwards = (from.0 - middle.0, from.1 - middle.1);
        let label = short_name(&view.name);
        let width = label.len() as i32 * 6;
        let x = if outwards.0 >= 0 { from.0 + 8 } else { from.0 - 8 - width };
        canvas.text(x, from.1 - 5, &label, INK);
    }
    let points = if points.is_empty() { String::new() } else { format!("; {} points", points.len()) };
    let line = |number: i32| MAP_SIDE + 4 + number * LINE_HEIGHT as i32;
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

/// How far [`SHOWN_POINTS`] of the points reach along either axis; 0 without points.
fn reach_of(points: &[((f32, f32), Colour)]) -> f32 {
    let mut all: Vec<f32> = points.iter().map(|((x, y), _)| x.abs().max(y.abs())).collect();
    all.sort_by(f32::total_cmp);
    let last = (SHOWN_POINTS * all.len() as f32) as usize;
    all.get(last.min(all.len().saturating_sub(1))).copied().unwrap_or(0.0)
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
