//! How many photographs show what a picture shows.

use crate::DepthMap;
use serde::{Deserialize, Serialize};
use viewfuse_core::camera::Camera;

/// Points of a picture that are looked at, along its longer side.
const POINTS: u32 = 64;
/// A photograph that is taken from as near as this, as a share of a point's depth, shows the point whatever its depth.
const SAME_PLACE: f32 = 1.0e-3;
/// Shares of a picture's surfaces, in `[0, 1]`, by the depths that the field found: an estimate, as good as these.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// That no photograph of a used source shows: they are filled from what lies beside them.
    pub by_none: f32,
    /// That a single one shows, from another place, so that nothing confirms their depth.
    pub by_one: f32,
}

/// Of a picture of this width and height with these depths (row-major, along the principal axis; 0: no surface, which
/// does not count), from the depth maps of the sources that were used. `None` without surfaces, or without maps.
pub(super) fn seen(camera: &Camera, [width, height]: [u32; 2], depths: &[f32], maps: &[DepthMap]) -> Option<Seen> {
    if maps.is_empty() || depths.len() != width as usize * height as usize {
        return None;
    }
    let camera = Camera { pinhole: camera.pinhole.resized(width, height).ok()?, ..*camera }.block(0);
    let step = width.max(height).div_ceil(POINTS).max(1) as usize;
    let (mut none, mut one, mut all) = (0, 0, 0);
    for row in (step as u32 / 2..height).step_by(step) {
        for column in (step as u32 / 2..width).step_by(step) {
            let depth = depths[(row * width + column) as usize];
            if depth > 0.0 {
                let point = camera.centre_world() + camera.towards(column as f32 + 0.5, row as f32 + 0.5) * depth;
                let away = |map: &DepthMap| (map.camera.centre_world() - camera.centre_world()).length();
                let confirms = |map: &DepthMap| match away(map) <= SAME_PLACE * depth {
                    true => 2 * u32::from(map.camera.project(point).in_image),
                    false => u32::from(map.shows(point)),
                };
                match maps.iter().map(confirms).filter(|shows| *shows > 0).take(2).sum::<u32>() {
                    0 => none += 1,
                    1 => one += 1,
                    _ => {}
                }
                all += 1;
            }
        }
    }
    let share = |count: u32| count as f32 / all as f32;
    (all > 0).then(|| Seen { by_none: share(none), by_one: share(one) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::Vec3;
    use viewfuse_core::camera::Pinhole;
    use viewfuse_core::pose::Pose;

    fn camera(x: f32) -> Camera {
        let pose = Pose::look_at(Vec3::new(x, 0.0, 0.0), Vec3::new(x, 0.0, 1.0), -Vec3::Y).expect("a pose");
        Camera { pose, pinhole: Pinhole::new([16.0; 2], [8.0; 2], 16, 16).expect("a pinhole") }
    }

    /// A photograph of a wall at this depth, as sure as this.
    fn map(x: f32, depth: f32, confidence: f32) -> DepthMap {
        DepthMap { camera: camera(x).block(0), depths: vec![depth; 256], confidences: vec![confidence; 256] }
    }

    fn of(depth: f32, maps: &[DepthMap]) -> [f32; 2] {
        let seen = seen(&camera(0.01), [16, 16], &[depth; 256], maps).expect("surfaces");
        [seen.by_none, seen.by_one]
    }

    #[test]
    fn photographs_that_show_a_wall_are_counted() {
        let far_away = map(100.0, 2.0, 1.0);
        assert_eq!(of(2.0, &[map(0.0, 2.0, 1.0), map(0.0, 2.05, 1.0)]), [0.0, 0.0]);
        assert_eq!(of(2.0, &[map(0.0, 2.0, 1.0), far_away.clone()]), [0.0, 1.0]);
        assert_eq!(of(2.0, &[far_away.clone(), far_away]), [1.0, 0.0]);
        // Beside it by half a picture: a half is not in it.
        assert_eq!(of(2.0, &[map(1.0, 2.0, 1.0)]), [0.5, 0.5]);
    }

    #[test]
    fn a_photograph_from_the_same_place_needs_no_other() {
        let far_away = map(100.0, 2.0, 1.0);
        for (x, by_one) in [(0.01, 0.0), (0.011, 0.0), (0.02, 1.0)] {
            assert_eq!(of(2.0, &[far_away.clone(), map(x, 2.0, 1.0)]), [0.0, by_one], "{x}");
        }
        // Its own depth may be wrong.
        assert_eq!(of(2.0, &[map(0.01, 1.0, 1.0)]), [0.0, 0.0]);
    }

    #[test]
    fn a_sure_surface_hides_what_lies_behind_it() {
        assert_eq!(of(2.0, &[map(0.0, 1.5, 1.0)]), [1.0, 0.0]);
        assert_eq!(of(2.0, &[DepthMap { confidences: Vec::new(), ..map(0.0, 1.5, 1.0) }]), [1.0, 0.0]);
        for shown in [map(0.0, 1.5, 0.25), map(0.0, 2.5, 1.0), map(0.0, 0.0, 1.0)] {
            assert_eq!(of(2.0, &[shown]), [0.0, 1.0]);
        }
    }

    #[test]
    fn without_surfaces_or_maps_there_is_nothing_to_say() {
        let maps = [map(0.0, 2.0, 1.0)];
        assert_eq!(seen(&camera(0.0), [16, 16], &[0.0; 256], &maps), None);
        assert_eq!(seen(&camera(0.0), [16, 16], &[], &maps), None);
        assert_eq!(seen(&camera(0.0), [16, 16], &[2.0; 256], &[]), None);
    }
}
