//! Light on a point of a scenery: lamps with soft shadows, highlights, and light from around with one bounce.
//!
//! ```text
//! light = albedo * (around(n) * open + sum over lamps (light * max(n . l, 0) * (reach / d)^2 * lit)) + highlights
//! ```
//!
//! Every ray tries one random point of each lamp and one random direction around the normal: a pixel's many rays make
//! shadows soft. `open` is 1 where the direction is free for [`AROUND_REACH`], and otherwise goes down to what the
//! surface there gives back, in its colour: nooks are dark, and a red book reddens the shelf. Of all terms only the
//! highlight (Blinn and Phong's) depends on where one looks from.

use crate::scenes::lamp::{across, on_disc};
use crate::scenes::scenery::Scenery;
use crate::scenes::shade::{TEXTURE_DEPTH, to_the_32nd};
use crate::scenes::texture::light_from_display;
use crate::scenes::trace::{Hit, first, is_blocked};
use viewfuse_core::Vec3;
use viewfuse_core::camera::Ray;
use viewfuse_core::math::{max, sqrt};

/// Rays leave a surface from this far above it, in world units.
const LIFT: f32 = 2.0e-3;

/// Surfaces farther away than this, in world units, take away none of the light from around.
pub const AROUND_REACH: f32 = 2.2;

/// Of the light from around, what reaches a point from a surface right beside it, times that surface's colour.
const BOUNCE: f32 = 0.8;

/// Random numbers for one ray: pairs in `[0, 1)`.
pub trait Chances {
    /// The pair for a purpose: 0 for the light from around, then one for each lamp.
    fn pair(&self, purpose: usize) -> [f32; 2];
}

/// Light (not a display value) that comes along `ray` from the point where it met the scenery.
pub fn illuminate(scenery: &Scenery, ray: &Ray, hit: &Hit, chances: &impl Chances) -> Vec3 {
    let object = scenery.object();
    let part = &object.parts()[hit.part];
    let albedo = light_from_display(part.finish.texture.colour(hit.point_local - hit.normal_local * TEXTURE_DEPTH));
    if scenery.glows(hit.part) {
        return albedo;
    }
    let normal = part.placement.rotate_to_world(hit.normal_local);
    let start = ray.at(hit.distance) + normal * LIFT;
    let mut diffuse = from_around(scenery, start, normal, chances.pair(0));
    let mut highlights = Vec3::ZERO;
    for (index, lamp) in scenery.lamps().iter().enumerate() {
        let towards = lamp.point_on_disc(start, chances.pair(index + 1)) - start;
        let distance = towards.length();
        let direction = towards / distance;
        let facing = normal.dot(direction);
        let shadow_ray = Ray { origin_world: start, direction_world: direction };
        if !(facing > 0.0) || is_blocked(object, &shadow_ray, distance) {
            continue;
        }
        let nearness = lamp.reach / distance;
        let light = lamp.light * (nearness * nearness);
        diffuse += light * facing;
        let half = direction - ray.direction_world;
        let half_length = half.length();
        if part.finish.gloss > 0.0 && half_length > 0.0 {
            highlights += light * (part.finish.gloss * to_the_32nd(max(normal.dot(half / half_length), 0.0)));
        }
    }
    albedo * diffuse + highlights
}

/// Light from around along one random direction of the half space, drawn as its cosine says.
fn from_around(scenery: &Scenery, start: Vec3, normal: Vec3, pair: [f32; 2]) -> Vec3 {
    let [x, y] = on_disc(pair);
    let [right, up] = across(normal);
    let direction = right * x + up * y + normal * sqrt(max(1.0 - x * x - y * y, 0.0));
    let light = scenery.around(normal.z);
    let ray = Ray { origin_world: start, direction_world: direction };
    let Some((distance, index)) = first(scenery.object(), &ray, AROUND_REACH) else {
        return light;
    };
    let part = &scenery.object().parts()[index];
    let point_local = part.placement.to_local(ray.at(distance + TEXTURE_DEPTH));
    let bounced = light_from_display(part.finish.texture.colour(point_local)) * BOUNCE;
    let open = distance / AROUND_REACH;
    light * (bounced + (Vec3::ONE - bounced) * open)
}
