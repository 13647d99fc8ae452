//! Light on a point: soft light from all around, two lamps and a weak highlight.
//!
//! ```text
//! light = albedo * (around * openness + lamps) + gloss * highlight
//! lamps = key_light * lit * max(n . key, 0) + fill_light * max(n . fill, 0)
//! ```
//!
//! The lamps are fixed to the world and infinitely far away. The key lamp casts shadows (`lit` is 0 or 1; supersampling
//! softens their rims); the light from around is brighter from above (world z) and dimmed in nooks. Only the highlight
//! (Blinn and Phong's, J. Blinn 1977) depends on where one looks from: views differ, but mildly, as with real toys.

use crate::scenes::light::Light;
use crate::scenes::object::Object;
use crate::scenes::texture::{display_from_light, light_from_display};
use crate::scenes::trace::{Hit, is_blocked};
use viewfuse_core::Vec3;
use viewfuse_core::camera::Ray;
use viewfuse_core::math::{clamp, max};

/// Shadow rays start this far above the surface, in world units: past the normal's error, below a pixel.
const LIFT: f32 = 1.0e-3;
/// The texture is read this far below the surface, in world units, so that a face that coincides with the border of two
/// cells shows one of them and not rounding errors.
pub(super) const TEXTURE_DEPTH: f32 = 1.0e-3;
/// Spacing of the four points above the surface that look for a nook, in world units.
const NOOK_STEP: f32 = 0.02;

/// Display colour of the point where `ray` met `object`.
pub fn shade(object: &Object, ray: &Ray, hit: &Hit) -> Vec3 {
    let part = &object.parts()[hit.part];
    let normal = part.placement.rotate_to_world(hit.normal_local);
    let point = ray.at(hit.distance);
    let Light { key, fill, .. } = *object.light();
    let key = key / key.length();
    let fill = fill / fill.length();

    let above = 0.5 + 0.5 * normal.z;
    let around = object.light().around[0] * (1.0 - above) + object.light().around[1] * above;
    let towards_key = max(normal.dot(key), 0.0);
    let in_shadow = towards_key > 0.0
        && is_blocked(object, &Ray { origin_world: point + normal * LIFT, direction_world: key }, f32::MAX);
    let key_light = if in_shadow { 0.0 } else { object.light().key_light * towards_key };
    let fill_light = object.light().fill_light * max(normal.dot(fill), 0.0);

    let half = key - ray.direction_world;
    let half_length = half.length();
    let aligned = if half_length > 0.0 { max(normal.dot(half / half_length), 0.0) } else { 0.0 };
    let highlight = if key_light > 0.0 { part.finish.gloss * to_the_32nd(aligned) } else { 0.0 };

    let albedo = light_from_display(part.finish.texture.colour(hit.point_local - hit.normal_local * TEXTURE_DEPTH));
    let light = albedo * (around * openness(object, point, normal) + key_light + fill_light) + Vec3::splat(highlight);
    display_from_light(Vec3::new(clamp(light.x, 0.0, 1.0), clamp(light.y, 0.0, 1.0), clamp(light.z, 0.0, 1.0)))
}

/// How much of the surroundings a point sees, 0.35 to 1: by how far the object comes closer, going up along the normal,
/// than the surface one left (A. Evans, "Fast approximations for global illumination on dynamic scenes", 2006).
fn openness(object: &Object, point: Vec3, normal: Vec3) -> f32 {
    let mut closed = 0.0;
    let mut weight = 0.5;
    for step in 1..=4 {
        let height = NOOK_STEP * step as f32;
        let shortfall = height - object.distance(point + normal * height, height);
        closed += weight * max(shortfall, 0.0) / height;
        weight *= 0.7;
    }
    clamp(1.0 - 0.7 * closed, 0.35, 1.0)
}

/// By repeated squaring: a power function would not be the same everywhere.
pub(super) fn to_the_32nd(x: f32) -> f32 {
    let x2 = x * x;
    let x4 = x2 * x2;
    let x8 = x4 * x4;
    let x16 = x8 * x8;
    x16 * x16
}
