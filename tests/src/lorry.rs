//! Photographs of the lorry in memory, as fields are given them, and cameras around it.

use viewfuse::scene::photographs::SourceImages;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_lab::scenes::{Orbit, sources, toy};

/// Cameras at distance 1.3 whose pictures have this side; the focal length is that of SRN's cars.
///
/// # Panics
/// If the side is 0.
pub fn orbit(side: u32) -> Orbit {
    let pinhole = Pinhole::new([1.025 * side as f32; 2], [0.5 * side as f32; 2], side, side);
    Orbit { radius: 1.3, pinhole: pinhole.expect("sound intrinsics") }
}

/// The lorry from some sides, on white.
///
/// # Panics
/// If the side is 0.
pub fn photographs(count: u32, side: u32) -> SourceImages {
    let cameras = orbit(side).spiral(count, [-0.4, 0.8]).expect("cameras off the pole");
    sources(&toy::lorry(), &cameras)
}

/// A camera that is none of the sources.
///
/// # Panics
/// If the side is 0.
pub fn target(side: u32) -> Camera {
    orbit(side).camera(2.0, 0.35).expect("a camera off the pole")
}
