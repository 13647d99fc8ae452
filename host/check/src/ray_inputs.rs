//! Cameras, rays and points for kernels on rays: in front of cameras and behind them, at the borders of their images,
//! far outside, far away.

use super::poses::{Random, looking_at_origin};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::rays::{RayPoint, TargetRay};

/// Sides of images, pixels.
const SIDES: [u32; 5] = [1, 7, 33, 64, 128];

/// A camera about 2.5 from the origin that looks at it, or one turned and placed at random.
///
/// # Panics
/// Never: the intrinsics are sound.
pub fn camera(random: &mut Random) -> CameraBlock {
    let [width, height] = [0, 1].map(|_| SIDES[random.below(SIDES.len())]);
    let pose = if random.below(4) == 0 {
        random.pose(1.0)
    } else {
        let azimuth = random.range(0.0, std::f64::consts::TAU);
        let distance = random.range(2.0, 3.0);
        let centre = [distance * azimuth.cos(), distance * azimuth.sin(), random.range(-1.0, 1.0)];
        looking_at_origin(centre, random.range(-0.5, 0.5))
    };
    let focal = [0, 1].map(|_| (f64::from(width.max(height)) * random.range(0.8, 1.6)) as f32);
    let principal = [width, height].map(|side| (f64::from(side) * random.range(0.45, 0.55)) as f32);
    let pinhole = Pinhole::new(focal, principal, width, height)
        .unwrap_or_else(|error| panic!("{focal:?} {principal:?}: {error}"));
    Camera { pose, pinhole }.block(0)
}

/// A ray with near and far bounds, which are equal for some.
pub fn ray(random: &mut Random) -> TargetRay {
    let near = random.range(0.3, 1.5);
    let far = if random.below(16) == 0 { near } else { near + random.log_range(1.0e-2, 10.0) };
    TargetRay {
        origin: random.vector().map(|coordinate| coordinate as f32),
        near: near as f32,
        direction: direction(random),
        far: far as f32,
    }
}

/// A unit vector.
fn direction(random: &mut Random) -> [f32; 3] {
    random.rotation()[0].map(|coordinate| coordinate as f32)
}

/// A point around the origin, or somewhere special to one of the views.
pub fn point(random: &mut Random, views: &[CameraBlock]) -> RayPoint {
    let view = &views[random.below(views.len())];
    let [width, height] = [view.width, view.height].map(f64::from);
    let seen_at = |x: f64, y: f64, depth: f64| view.centre_world() + view.towards(x as f32, y as f32) * depth as f32;
    let near_origin = random.vector().map(|coordinate| 0.4 * coordinate as f32);
    let position = match random.below(12) {
        // Through the border of the image.
        0 => seen_at([0.0, width][random.below(2)], random.range(0.0, height), random.range(0.5, 3.0)),
        1 => seen_at(random.range(0.0, width), [0.0, height][random.below(2)], random.range(0.5, 3.0)),
        // Through the middle of a pixel.
        2 => seen_at(random.below(view.width as usize) as f64 + 0.5, 0.5, 2.0),
        // Far outside.
        3 => seen_at(width * random.range(-30.0, 30.0), height * random.range(-30.0, 30.0), 1.0),
        // Behind, and a little behind or in front of the camera's plane.
        4 => seen_at(random.range(0.0, width), random.range(0.0, height), random.range(-3.0, -0.1)),
        5 => {
            let side = [-1.0, 1.0][random.below(2)];
            seen_at(random.range(0.0, width), random.range(0.0, height), side * random.log_range(1.0e-3, 3.0e-2))
        }
        6 => view.centre_world(),
        7 => Vec3::from_array(near_origin) * random.log_range(1.0e2, 1.0e5) as f32,
        _ => Vec3::from_array(near_origin),
    };
    RayPoint {
        position: position.to_array(),
        length: random.log_range(1.0e-4, 1.0) as f32,
        direction: direction(random),
        sample: 0,
    }
}

/// Pixels of large pictures.
pub fn pixels(random: &mut Random, count: u32) -> Vec<u32> {
    (0..count).map(|_| random.below(1 << 20) as u32).collect()
}
