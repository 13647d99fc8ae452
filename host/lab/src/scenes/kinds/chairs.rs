//! Chairs: seats on legs or other bases, with backs of panels, slats and rails, some with arms and cushions.
//!
//! A chair faces along world x.

use super::build::{Build, place};
use super::draws::Draws;
use super::half_sizes;
use super::paint::{contrast, gloss, grey, paint, pattern, plain};
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, Texture};
use viewfuse_core::Vec3;
use viewfuse_core::math::sin_cos;

/// A chair under construction: its measures, in world units.
struct Chair {
    /// Half of depth and width of the seat.
    seat: [f32; 2],
    /// Upper side of the seat, and half of its thickness.
    top: f32,
    half_thickness: f32,
    half_height: f32,
    frame: Finish,
    /// Whether the seat is a disc. What stands below it then stands closer together.
    round: bool,
}

/// Adds a chair.
pub(super) fn chair(draws: &mut Draws, build: &mut Build) {
    let stool = draws.chance(0.12);
    let proportions = [draws.between(0.42, 0.6), draws.between(0.42, 0.62), draws.between(0.8, 1.15)];
    let [depth, width, half_height] = half_sizes(proportions, draws.between(0.85, 0.98));
    let seat_at = if stool { 0.95 } else { draws.between(0.4, 0.54) };
    let frame_colour = wood_or_paint(draws);
    let frame = Finish { texture: grained(draws, frame_colour), gloss: gloss(draws) };
    let chair = Chair {
        seat: [depth, width],
        top: half_height * (2.0 * seat_at - 1.0),
        half_thickness: draws.between(0.012, 0.045),
        half_height,
        frame,
        round: draws.chance(if stool { 0.7 } else { 0.12 }),
    };
    let cover_colour = if draws.chance(0.4) { frame_colour } else { contrast(draws, frame_colour) };
    let size = draws.between(0.02, 0.06);
    let cover = Finish { texture: pattern(draws, cover_colour, size), gloss: gloss(draws) };
    seat(&chair, build, draws, cover);
    base(&chair, build, draws);
    if !stool {
        back(&chair, build, draws, cover);
        if draws.chance(0.4) {
            arms(&chair, build, draws, cover);
        }
    }
}

fn wood_or_paint(draws: &mut Draws) -> Vec3 {
    let amount = draws.between(0.25, 1.0);
    if draws.chance(0.5) { Vec3::new(0.85, 0.6, 0.36) * amount } else { paint(draws) }
}

fn grained(draws: &mut Draws, colour: Vec3) -> Texture {
    if draws.chance(0.5) {
        return Texture::Plain { colour };
    }
    Texture::Mottle { colours: [colour, colour * 0.65], cell: Vec3::new(0.02, 0.02, 0.15), seed: draws.below(1 << 20) }
}

fn seat(chair: &Chair, build: &mut Build, draws: &mut Draws, cover: Finish) {
    let [depth, width] = chair.seat;
    let centre = [0.0, 0.0, chair.top - chair.half_thickness];
    if chair.round {
        let radius = 0.5 * (depth + width);
        let rounding = 0.6 * chair.half_thickness;
        build.add(Shape::Cylinder { radius, half_height: chair.half_thickness, rounding }, place(centre), cover);
    } else {
        let rounding = chair.half_thickness * draws.between(0.2, 0.9);
        build.block(centre, [depth, width, chair.half_thickness], rounding, cover);
    }
    if draws.chance(0.35) {
        let colour = paint(draws);
        let size = draws.between(0.02, 0.05);
        let cushion = Finish { texture: pattern(draws, colour, size), gloss: 0.0 };
        let half = [0.85 * depth, 0.85 * width, 0.02];
        build.block([0.01, 0.0, chair.top + 0.012], half, 0.02, cushion);
    }
}

/// What stands on the floor.
fn base(chair: &Chair, build: &mut Build, draws: &mut Draws) {
    let [depth, width] = chair.seat.map(|half| if chair.round { 0.7 * half } else { half });
    let (floor, under) = (-chair.half_height, chair.top - 2.0 * chair.half_thickness);
    let thickness = draws.between(0.011, 0.026);
    let tips = if draws.chance(0.25) { plain(paint(draws), 0.2) } else { chair.frame };
    match draws.below(8) {
        // A column on a star or a disc.
        0 | 1 => {
            build.rod(Vec3::new(0.0, 0.0, floor + 0.03), Vec3::new(0.0, 0.0, under), thickness * 1.3, chair.frame);
            if draws.chance(0.4) {
                let radius = depth * draws.between(0.6, 0.9);
                let plate = Shape::Cylinder { radius, half_height: 0.012, rounding: 0.008 };
                build.add(plate, place([0.0, 0.0, floor + 0.012]), tips);
            } else {
                let count = 3 + draws.below(3);
                for arm in 0..count {
                    let (sine, cosine) = sin_cos(core::f32::consts::TAU * arm as f32 / count as f32);
                    let reach = depth * 0.95;
                    let end = Vec3::new(reach * cosine, reach * sine, floor + 0.022);
                    build.rod(Vec3::new(0.0, 0.0, floor + 0.05), end, thickness * 0.8, chair.frame);
                    build.ellipsoid(end.to_array(), [0.022; 3], tips);
                }
            }
        }
        // Two bent runners.
        2 => {
            let closed = draws.chance(0.5);
            for side in [1.0, -1.0] {
                let y = side * (width - thickness);
                let (front, rear) = (depth - thickness, thickness - depth);
                let low = floor + thickness;
                build.rod(Vec3::new(front, y, under), Vec3::new(front, y, low), thickness, chair.frame);
                build.rod(Vec3::new(front, y, low), Vec3::new(rear, y, low), thickness, chair.frame);
                if closed {
                    build.rod(Vec3::new(rear, y, low), Vec3::new(rear, y, under), thickness, chair.frame);
                }
            }
        }
        // A box, as of armchairs.
        3 => {
            let half = 0.5 * (under - floor);
            build.block([0.0, 0.0, floor + half], [depth * 0.96, width * 0.96, half], 0.015, chair.frame);
        }
        // Four legs, straight or splayed, with or without bars.
        _ => {
            let splay = if draws.chance(0.5) { 0.0 } else { draws.between(0.0, 0.05) };
            let square = draws.chance(0.4) && splay == 0.0;
            let foot = |x: f32, y: f32| {
                [x * (depth - thickness + 0.5 * splay), y * (width - thickness + 0.5 * splay), floor + thickness]
            };
            let head = |x: f32, y: f32| [x * (depth - thickness - splay), y * (width - thickness - splay), under];
            for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)] {
                if square {
                    let centre = [head(x, y)[0], head(x, y)[1], 0.5 * (floor + under)];
                    build.block(centre, [thickness, thickness, 0.5 * (under - floor)], 0.003, chair.frame);
                } else {
                    build.rod(foot(x, y).into(), head(x, y).into(), thickness, chair.frame);
                }
            }
            if draws.chance(0.5) {
                let t = draws.between(0.25, 0.6);
                let at = |x: f32, y: f32| Vec3::from(foot(x, y)).lerp(head(x, y).into(), t);
                for side in [1.0, -1.0] {
                    build.rod(at(side, 1.0), at(side, -1.0), thickness * 0.6, tips);
                    build.rod(at(1.0, side), at(-1.0, side), thickness * 0.6, tips);
                }
            }
        }
    }
}

/// Panel, slats, rails or spindles between two posts; it leans back a little.
fn back(chair: &Chair, build: &mut Build, draws: &mut Draws, cover: Finish) {
    let [depth, width] = chair.seat;
    let post = draws.between(0.011, 0.022);
    let lean = draws.between(0.0, 0.05);
    let (low, high) = (chair.top - 0.01, chair.half_height - post);
    let height = high - low;
    // A point of the back: across from -1 to 1, and up from 0 to 1.
    let at = |across: f32, up: f32| Vec3::new(post - depth - lean * up, across * (width - post), low + height * up);
    let turn = -(lean / height);
    let style = draws.below(6);
    if style == 0 || style == 5 {
        // A whole panel, thick or thin, with or without a gap below.
        let from = draws.one_of([0.0, 0.0, 0.2, 0.4]);
        let half = Vec3::new(draws.between(0.01, 0.035), width, 0.5 * height * (1.0 - from) + 0.5 * post);
        let middle = at(0.0, 0.5 * (1.0 + from));
        let panel = Shape::Block { half_size: half, rounding: half.x * draws.between(0.2, 0.9) };
        build.add(panel, place(middle.to_array()).turned_about_y(turn), cover);
        if from == 0.0 {
            return;
        }
    }
    for side in [1.0, -1.0] {
        build.rod(at(side, 0.0), at(side, 1.0), post, chair.frame);
    }
    let slat = if draws.chance(0.5) { chair.frame } else { cover };
    match style {
        1 | 2 => {
            let count = 2 + draws.below(4);
            let half_height = draws.between(0.25, 0.42) * height / count as f32;
            for index in 0..count {
                let up = (index as f32 + 0.8) / (count as f32 + 0.1);
                let half_size = Vec3::new(0.5 * post + 0.002, width - post, half_height.min(0.06));
                let block = Shape::Block { half_size, rounding: 0.003 };
                build.add(block, place(at(0.0, up).to_array()).turned_about_y(turn), slat);
            }
        }
        3 | 4 => {
            build.rod(at(-1.0, 1.0), at(1.0, 1.0), post, slat);
            let from = draws.one_of([0.0, 0.25]);
            if from > 0.0 {
                build.rod(at(-1.0, from), at(1.0, from), post, slat);
            }
            let count = 3 + draws.below(5);
            for index in 0..count {
                let across = 2.0 * (index as f32 + 1.0) / (count as f32 + 1.0) - 1.0;
                build.rod(at(across, from), at(across, 1.0), post * 0.6, slat);
            }
        }
        _ => {}
    }
}

fn arms(chair: &Chair, build: &mut Build, draws: &mut Draws, cover: Finish) {
    let [depth, width] = chair.seat;
    let up = chair.top + draws.between(0.09, 0.16);
    let closed = draws.chance(0.3);
    let finish = if draws.chance(0.5) { cover } else { plain(grey(draws.between(0.05, 0.6)), gloss(draws)) };
    for side in [1.0, -1.0] {
        let y = side * (width - 0.012);
        if closed {
            let half = 0.5 * (up - chair.top) + 0.01;
            build.block([0.0, y, up - half], [depth * 0.95, 0.025, half], 0.015, finish);
            continue;
        }
        build.block([0.0, y, up], [depth * 0.9, 0.02, 0.012], 0.008, finish);
        build.rod(Vec3::new(0.7 * depth, y, chair.top - 0.02), Vec3::new(0.7 * depth, y, up), 0.012, chair.frame);
        build.rod(Vec3::new(0.012 - depth, y, up), Vec3::new(-0.8 * depth, y, up), 0.012, chair.frame);
    }
}
