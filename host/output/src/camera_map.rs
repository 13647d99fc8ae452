//! The cameras of a scene on a map, seen from above.

use super::canvas::{BLUE, Canvas, GREY, INK, LINE_HEIGHT, RED};
use image::RgbImage;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_kernels::visual_hull::ObjectBlock;
use viewfuse_scene::Scene;
use viewfuse_scene::inspect::Inspection;

const MAP_SIDE: i32 = 560;
const MAP_MARGIN: i32 = 60;

/// The cameras seen from above (along the up direction): sources blue, target poses red, the object's box grey.
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
    let scale = (MAP_SIDE / 2 - MAP_MARGIN) as f32 / reach;
    let at = |(x, y): (f32, f32)| (MAP_SIDE / 2 + (x * scale) as i32, MAP_SIDE / 2 - (y * scale) as i32);
    let legend = 2 * LINE_HEIGHT as i32 + 12;
    let mut canvas = Canvas::new(MAP_SIDE as u32, (MAP_SIDE + legend) as u32);
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
    let line = |number: i32| MAP_SIDE + 4 + number * LINE_HEIGHT as i32;
    let count = format!(
        "{} photographs (blue), {} target poses (red), seen from above; + is the common focus",
        inspection.photograph_count, inspection.target_count
    );
    canvas.text(10, line(0), &count, INK);
    let size = format!(
        "distance {:.3} to {:.3}, object near {:.3}, far {:.3}",
        inspection.distances[0], inspection.distances[1], inspection.near, inspection.far
    );
    canvas.text(10, line(1), &size, INK);
    canvas.into_image()
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
