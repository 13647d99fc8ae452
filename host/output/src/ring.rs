//! How much the photographs show from the places around a subject: for pages, which dim the rest.

use serde::Serialize;
use viewfuse_core::camera::Camera;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::path::arc::Arc;
use viewfuse_scene::path::generated::orbit;

/// Places of the ring: one for every 10 degrees.
const PLACES: usize = 36;

/// A place on the circle around the cameras' focus, at their mean height and distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RingPlace {
    /// World coordinates.
    pub place: [f32; 3],
    /// Share of a picture from there that a photograph shows from within 30 degrees.
    pub seen: f32,
}

/// How much the photographs of these cameras show from each place, in order around the focus; empty if the cameras span
/// no circle.
pub fn ring(cameras: &[Camera]) -> Vec<RingPlace> {
    let Some(first) = cameras.first() else { return Vec::new() };
    let places = orbit(cameras, &Arc::full(cameras), first.pinhole, PLACES).unwrap_or_default();
    let coverage = Coverage::of(cameras);
    let place =
        |camera: &Camera| RingPlace { place: camera.pose.centre_world().to_array(), seen: coverage.seen(camera) };
    places.iter().map(place).collect()
}
