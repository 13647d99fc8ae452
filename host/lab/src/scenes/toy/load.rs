//! What the toy lorry carries: a ball, a crate, a ring with a small ball in it, a log and a skittle.

use super::{BLUE, GREEN, ORANGE, PINK, PURPLE, RED, WHITE, WOOD, YELLOW, ball, block, part};
use crate::scenes::part::Part;
use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, Texture, rgb};
use core::f32::consts::FRAC_PI_2;
use viewfuse_core::Vec3;

/// Adds the load, standing on the bed's floor.
pub(super) fn load(parts: &mut Vec<Part>) {
    let slices = Texture::Slices { colours: [WHITE, RED], pair_count: 3 };
    let beach_ball = Placement::at(-0.1, 0.048, 0.057).turned_about_x(-0.5).turned_about_y(0.4);
    parts.push(part(ball(0.082), beach_ball, Finish { texture: slices, gloss: 0.25 }));

    let squares = Texture::Checker { colours: [ORANGE, rgb(252, 226, 150)], size: 0.06 };
    let crate_place = Placement::at(-0.215, -0.058, 0.035).turned_about_z(0.35);
    parts.push(part(block(0.06, 0.06, 0.06, 0.012), crate_place, Finish { texture: squares, gloss: 0.1 }));
    let apple = Texture::Spots { colours: [GREEN, YELLOW], cell: 0.045, radius: 0.4, seed: 5 };
    let apple_place = Placement::at(-0.215, -0.058, 0.133);
    parts.push(part(ball(0.042), apple_place, Finish { texture: apple, gloss: 0.25 }));

    let icing = Texture::Spots { colours: [PINK, WHITE], cell: 0.042, radius: 0.36, seed: 11 };
    let ring = Shape::Torus { ring_radius: 0.058, tube_radius: 0.03 };
    let ring_place = Placement::at(-0.27, 0.055, 0.008);
    parts.push(part(ring, ring_place, Finish { texture: icing, gloss: 0.2 }));
    let marble = Texture::Mottle { colours: [PURPLE, rgb(214, 180, 240)], cell: Vec3::splat(0.03), seed: 7 };
    parts.push(part(ball(0.042), Placement::at(-0.27, 0.055, 0.04), Finish { texture: marble, gloss: 0.3 }));

    let bark = Texture::Stripes { colours: [WOOD[1], WOOD[0]], across: Vec3::Z, width: 0.05 };
    let log = Shape::Cylinder { radius: 0.034, half_height: 0.11, rounding: 0.01 };
    // It leans on the front wall, its upper end above the right side.
    let log_place = Placement::at(-0.06, -0.07, 0.075).turned_about_z(0.3).turned_about_x(FRAC_PI_2 - 0.45);
    parts.push(part(log, log_place, Finish { texture: bark, gloss: 0.0 }));
    let skin = Texture::Plain { colour: BLUE };
    let skittle_place = Placement::at(-0.335, -0.1, 0.04);
    let skittle = Shape::Capsule { half_length: 0.055, radius: 0.024 };
    parts.push(part(skittle, skittle_place, Finish { texture: skin, gloss: 0.3 }));
}
