//! Pixels of a tile: splats come through the workgroup's memory, so that none is waited for alone.

use crate::gaussians::blend::BlendedLanes;
use crate::gaussians::{MIN_TRANSMITTANCE, TileBlock};
use crate::rows::WORKGROUP;
use crate::store::Store;
use crate::workgroup::Workgroup;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;

/// Numbers of a splat that its pixels need.
const NUMBERS: usize = 11;
/// Where it is said what is seen behind the splats, behind these, `[number][splat]`.
const SEEN: usize = NUMBERS * WORKGROUP as usize;

/// Words of the workgroup's memory that [`blend_splats`] takes.
pub const BLEND_SPLATS_SHARED: usize = SEEN + WORKGROUP as usize;

/// A pixel of a tile, invocation `invocation % 64` of the tile `invocation / 64`.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn blend_splats(
    block: &TileBlock,
    starts: &impl Fetch<u32>,
    entries: &impl Fetch<u32>,
    splats: &impl Fetch<ProjectedGaussian>,
    colours: &mut impl Store<[f32; 4]>,
    depths: &mut impl Store<f32>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (tile, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let place = block.pixel_of_tile(tile, thread);
    let [column, row] = place.unwrap_or([0; 2]);
    let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
    let mut blended = BlendedLanes::<1>::BEGUN;
    if place.is_none() {
        blended.transmittance = [0.0];
    }
    let (mut entry, end) = (starts.fetch(tile as usize), starts.fetch(tile as usize + 1));
    let mut is_over = false;
    // All invocations of the tile see the same here, so all come to the barriers.
    while entry < end && !is_over {
        let count = if end - entry < WORKGROUP { end - entry } else { WORKGROUP };
        if thread < count {
            put_splat(&mut group, thread, &splats.fetch(entries.fetch((entry + thread) as usize) as usize));
        }
        group.wait();
        let mut at = 0;
        while at < count {
            blended.add(&splat_at(&group, at), x, y);
            at += 1;
        }
        group.put(SEEN + thread as usize, blended.transmittance[0]);
        group.wait();
        let (mut most, mut pixel) = (0.0, 0);
        while pixel < WORKGROUP as usize {
            let seen = group.get(SEEN + pixel);
            most = if seen > most { seen } else { most };
            pixel += 1;
        }
        is_over = most < MIN_TRANSMITTANCE;
        entry += count;
    }
    if place.is_some() {
        blended.finish(block);
        let at = (row * block.width + column) as usize;
        colours.store(at, blended.pixel(0));
        depths.store(at, blended.depth[0]);
    }
}

/// Puts what pixels need of a splat.
#[inline(always)]
fn put_splat(group: &mut impl Workgroup, place: u32, splat: &ProjectedGaussian) {
    let ([x, y], [xx, xy, yy], [red, green, blue]) = (splat.mean, splat.conic, splat.colour);
    let numbers: [f32; NUMBERS] = [x, y, splat.depth, splat.opacity, xx, xy, yy, splat.extent[1], red, green, blue];
    let mut number = 0;
    while number < NUMBERS {
        group.put(number * WORKGROUP as usize + place as usize, numbers[number]);
        number += 1;
    }
}

/// The splat at a place; what pixels do not need of it is 0.
#[inline(always)]
fn splat_at(group: &impl Workgroup, place: u32) -> ProjectedGaussian {
    let get = |number: usize| group.get(number * WORKGROUP as usize + place as usize);
    ProjectedGaussian {
        mean: [get(0), get(1)],
        depth: get(2),
        opacity: get(3),
        conic: [get(4), get(5), get(6)],
        padding: 0.0,
        colour: [get(8), get(9), get(10)],
        padding_colour: 0.0,
        extent: [0.0, get(7)],
        padding_end: [0.0; 2],
    }
}
