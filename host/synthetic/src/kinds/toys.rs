//! Toys: heaps, towers and rings of primitives of any form, size, turn and colour.

use super::build::Build;
use super::draws::Draws;
use super::paint::{gloss, paint, pattern};
use crate::placement::Placement;
use crate::prism::{Prism, Width};
use crate::shape::Shape;
use crate::texture::Finish;
use core::f32::consts::{PI, TAU};
use viewfuse_core::Vec3;
use viewfuse_core::math::{sin_cos, sqrt};

/// Farthest that the parts of a toy reach from the origin, in world units.
const REACH: f32 = 0.5;

/// Adds a toy: parts that overlap their neighbours.
pub(super) fn toy(draws: &mut Draws, build: &mut Build) {
    let count = 4 + draws.below(13);
    let arrangement = draws.below(3);
    let palette = [paint(draws), paint(draws), paint(draws), paint(draws)];
    let size = draws.between(0.07, 0.13);
    for index in 0..count {
        let colour = if draws.chance(0.75) { draws.one_of(palette) } else { paint(draws) };
        let wanted_size = size * draws.between(0.6, 1.6);
        let shape = shape(draws, wanted_size);
        let reach = shape.bounding_radius();
        let step = index as f32 / count as f32;
        let wanted = match arrangement {
            // A heap: near one of the parts before.
            0 => match build.parts.len() {
                0 => Vec3::ZERO,
                parts => {
                    let other = build.parts[draws.below(parts as u32) as usize];
                    let apart = draws.between(0.5, 0.85) * (reach + other.shape.bounding_radius());
                    other.placement.origin_world() + direction(draws) * apart
                }
            },
            // A tower.
            1 => Vec3::new(draws.between(-0.06, 0.06), draws.between(-0.06, 0.06), 0.8 * step - 0.4),
            // A ring, lying or leaning.
            _ => {
                let (sine, cosine) = sin_cos(TAU * step);
                Vec3::new(0.3 * cosine, 0.3 * sine, 0.12 * sine + draws.between(-0.05, 0.05))
            }
        };
        let limit = (REACH - reach).max(0.0);
        let centre = wanted * (limit / wanted.length().max(limit));
        let placement = Placement::at(centre.x, centre.y, centre.z);
        let turned = match draws.below(3) {
            0 => placement,
            1 => placement.turned_about_z(TAU * draws.unit()),
            _ => placement.turned_about_z(TAU * draws.unit()).turned_about_x(PI * draws.unit()),
        };
        let cell = draws.between(0.02, 0.07);
        let finish = Finish { texture: pattern(draws, colour, cell), gloss: gloss(draws) };
        build.add(shape, turned, finish);
    }
}

/// Evenly over all directions.
fn direction(draws: &mut Draws) -> Vec3 {
    let z = draws.between(-1.0, 1.0);
    let (sine, cosine) = sin_cos(TAU * draws.unit());
    let level = sqrt(1.0 - z * z);
    Vec3::new(level * cosine, level * sine, z)
}

/// Any primitive of about this size.
fn shape(draws: &mut Draws, size: f32) -> Shape {
    let mut side = || size * draws.between(0.35, 1.3);
    let [a, b, c] = [side(), side(), side()];
    match draws.below(8) {
        0 => Shape::Sphere { radius: size },
        1 => Shape::Ellipsoid { radii: Vec3::new(a, b, c) },
        2 | 3 => {
            let rounding = a.min(b).min(c) * draws.between(0.0, 0.8);
            Shape::Block { half_size: Vec3::new(a, b, c), rounding }
        }
        4 => Shape::Cylinder { radius: a, half_height: b, rounding: a.min(b) * draws.between(0.0, 0.8) },
        5 => Shape::Torus { ring_radius: size * 0.9, tube_radius: size * draws.between(0.2, 0.5) },
        6 => Shape::Capsule { half_length: b * 1.2, radius: 0.5 * a },
        _ => {
            // A star or a polygon.
            let corner_count = 3 + draws.below(9);
            let notch = draws.one_of([1.0, 1.0, 0.5, 0.7]);
            let corners: Vec<[f32; 2]> = (0..2 * corner_count)
                .map(|corner| {
                    let (sine, cosine) = sin_cos(PI * corner as f32 / corner_count as f32);
                    let radius = size * if corner % 2 == 0 { 1.0 } else { notch };
                    [radius * cosine, radius * sine]
                })
                .collect();
            Shape::Prism(Prism::new(&corners, Width::constant(0.6 * b, 0.1 * b)))
        }
    }
}
