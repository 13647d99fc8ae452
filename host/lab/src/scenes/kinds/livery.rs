//! What is painted on a car's body: one colour or a pattern, panels, stripes, seams and numbers.

use super::draws::Draws;
use super::paint::{contrast, gloss, grey, pattern};
use crate::scenes::texture::{Finish, PATCH_COUNT, Patch, Texture};
use viewfuse_core::Vec3;

/// Where things are on a car, in world units.
pub(super) struct Places {
    /// Half of length, width and height.
    pub(super) half: [f32; 3],
    /// Height of the windows' lower edge.
    pub(super) belt: f32,
    /// Front and rear end of the doors along x.
    pub(super) doors: [f32; 2],
}

/// The finish of the body and the cabin, in world coordinates, on this colour.
pub(super) fn livery(draws: &mut Draws, colour: Vec3, places: &Places) -> Finish {
    let gloss = gloss(draws);
    if draws.chance(0.3) {
        let repeat = draws.between(0.02, 0.07);
        return Finish { texture: pattern(draws, colour, repeat), gloss };
    }
    let mut patches = [Patch::NOTHING; PATCH_COUNT];
    let mut free = patches.iter_mut();
    let mut put = |x: [f32; 2], y: [f32; 2], z: [f32; 2], colour: Vec3| {
        if let Some(patch) = free.next() {
            *patch = Patch { from: Vec3::new(x[0], y[0], z[0]), to: Vec3::new(x[1], y[1], z[1]), colour };
        }
    };
    let [length, width, height] = places.half;
    let all = [-1.0, 1.0];
    let second = contrast(draws, colour);
    // Another colour below, in front, or at the back.
    match draws.below(9) {
        0 => put(all, all, [-1.0, -height * draws.between(0.1, 0.5)], second),
        1 => put([length * draws.between(-0.1, 0.5), 1.0], all, all, second),
        2 => put([-1.0, length * draws.between(-0.6, 0.0)], all, all, second),
        3 => put(all, all, [-1.0, -height * draws.between(0.4, 0.7)], grey(draws.between(0.05, 0.3))),
        _ => {}
    }
    // One stripe along the middle, or two beside it.
    if draws.chance(0.35) {
        let stripe = if draws.chance(0.5) { second } else { contrast(draws, colour) };
        let half = width * draws.between(0.08, 0.3);
        if draws.chance(0.5) {
            put(all, [-half, half], all, stripe);
        } else {
            let gap = width * draws.between(0.04, 0.15);
            put(all, [gap, gap + half], all, stripe);
            put(all, [-gap - half, -gap], all, stripe);
        }
    }
    // A line or a band along the sides.
    if draws.chance(0.4) {
        let low = -height + 2.0 * height * draws.between(0.12, 0.4);
        let band = contrast(draws, colour);
        put(all, all, [low, low + height * draws.between(0.05, 0.22)], band);
    }
    // The seams of the doors.
    if draws.chance(0.6) {
        for x in places.doors {
            put([x - 0.003, x + 0.003], all, [-0.6 * height, places.belt], colour * 0.4);
        }
    }
    // A number on the doors.
    if draws.chance(0.35) {
        let x = draws.between(places.doors[1], places.doors[0]);
        let middle = -0.25 * height;
        let panel = draws.one_of([grey(0.95), grey(0.05), second]);
        let (panel_x, panel_z) = (draws.between(0.04, 0.07), height * draws.between(0.2, 0.35));
        put([x - panel_x, x + panel_x], all, [middle - panel_z, middle + panel_z], panel);
        let digit = contrast(draws, panel);
        for _ in 0..2 {
            let at = x + panel_x * draws.between(-0.5, 0.5);
            let (wide, high) = (panel_x * draws.between(0.12, 0.3), panel_z * draws.between(0.3, 0.75));
            put([at - wide, at + wide], all, [middle - high, middle + high], digit);
        }
    }
    Finish { texture: Texture::Patches { ground: colour, patches }, gloss }
}
