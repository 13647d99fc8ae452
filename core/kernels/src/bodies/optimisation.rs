//! An iteration of the optimisation of Gaussians: lists of tiles, the loss and the steps. Where a picture's lists were
//! too long ([`ListStatus`](crate::gaussians::lists::ListStatus)), steps leave everything as it is.

use crate::gaussians::blend_gradient::SplatGradient;
use crate::gaussians::lists::{
    self, ListBlock, RUNS_TOGETHER, TILE_RUN, TILES_OF_BIN, entry_of, is_reached, rank, saturating,
};
use crate::gaussians::project_gradient;
use crate::gaussians::steps::{
    GainStepBlock, HarmonicTerm, ParticleBlock, ParticleState, StepBlock, TermState, by_colour, colour_along,
    corrections, direction, step_gain, step_particle, step_term,
};
use crate::gaussians::windows::{GainBlock, LossBlock, SHARE_RUN, moments, pixel_gradient, structure};
use crate::gaussians::{SPLAT_TILE, SplatBlock};
use crate::store::Store;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian, REST_COUNTS, harmonics, project_as};
use viewfuse_core::math::{has_finite_bits, ln};

/// A Gaussian as the camera sees it, with its colour along the direction.
#[inline(always)]
pub fn project_particles(
    block: &ParticleBlock,
    gaussians: &(impl Fetch<GaussianBlock> + ?Sized),
    terms: &(impl Fetch<HarmonicTerm> + ?Sized),
    states: &(impl Fetch<ParticleState> + ?Sized),
    splats: &mut (impl Store<ProjectedGaussian> + ?Sized),
    gaussian: u32,
) {
    let at = gaussian as usize;
    let mut seen = gaussians.fetch(at);
    if block.term_count > 0 {
        let mut count = block.term_count;
        if block.has_states != 0 {
            let there = states.fetch(at).rest_count;
            count = if there < count { there } else { count };
        }
        let unit = direction(&seen, &block.camera);
        seen.colour = colour_along(seen.colour, terms, gaussian * block.term_count, count, unit);
    }
    splats.store(at, project_as(&seen, &block.camera, block.near, block.is_antialiased != 0));
}

/// Which splats' boxes reach a bin.
#[inline(always)]
pub fn mark_bins(
    block: &ListBlock,
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    masks: &mut (impl Store<u32> + ?Sized),
    mask: u32,
) {
    masks.store(mask as usize, block.mask(splats, mask));
}

/// How many splats of a piece each tile of its bin shows.
#[inline(always)]
pub fn count_entries(
    block: &ListBlock,
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    masks: &[u32],
    counts: &mut (impl Store<u32> + ?Sized),
    piece: u32,
) {
    let mut tile = 0;
    while tile < TILES_OF_BIN {
        let count = block.fold_entries(splats, masks, piece, tile, 0, |count, _, _| count + 1);
        counts.store((piece * TILES_OF_BIN + tile) as usize, count);
        tile += 1;
    }
}

/// The entries of a run of tiles, before each part and up to each tile.
#[inline(always)]
pub fn sum_entries(
    block: &ListBlock,
    counts: &[u32],
    before: &mut (impl Store<u32> + ?Sized),
    sums: &mut (impl Store<u32> + ?Sized),
    run: u32,
) {
    let (mut tile, mut all) = (0, 0);
    while tile < TILE_RUN {
        let (mut part, mut sum) = (0, 0);
        while part < block.part_count() {
            before.store(block.before_at(run, part, tile) as usize, sum);
            sum += counts[block.count_at(run, part, tile) as usize];
            part += 1;
        }
        all += sum;
        sums.store((run * TILE_RUN + tile) as usize, all);
        tile += 1;
    }
}

/// Where the lists of some runs' tiles begin; the last element writes where the last list ends, and the status.
#[inline(always)]
pub fn start_tiles(
    block: &ListBlock,
    sums: &[u32],
    status: &[u32],
    starts: &mut (impl Store<u32> + ?Sized),
    next_status: &mut (impl Store<u32> + ?Sized),
    element: u32,
) {
    let (first, run_count) = (element * RUNS_TOGETHER, block.run_count());
    let (mut before, mut all, mut run) = (0, 0, 0);
    while run < run_count {
        before = if run == first { all } else { before };
        all = saturating(all, sums[(run * TILE_RUN + TILE_RUN - 1) as usize]);
        run += 1;
    }
    let is_over = all > block.capacity || status[0] != 0;
    run = first;
    while run < first + RUNS_TOGETHER && run < run_count {
        let mut tile = 0;
        while tile < block.tiles_of_run(run) {
            let start = ListBlock::start_of(sums, before, first, run, tile);
            starts.store((block.first_of_run(run) + tile) as usize, if is_over { 0 } else { start });
            tile += 1;
        }
        run += 1;
    }
    if run == run_count {
        starts.store(block.tile_count() as usize, if is_over { 0 } else { all });
        let numbers = lists::next_status([status[0], status[1], status[2]], all, is_over);
        next_status.store(0, numbers[0]);
        next_status.store(1, numbers[1]);
        next_status.store(2, numbers[2]);
    }
}

/// The keys of the splats of a piece that the tiles of its bin show: the bits of their depths and their indices.
#[inline(always)]
pub fn list_entries(
    block: &ListBlock,
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    masks: &[u32],
    starts: &[u32],
    before: &[u32],
    keys: &mut (impl Store<[u32; 2]> + ?Sized),
    piece: u32,
) {
    let mut tile = 0;
    while tile < TILES_OF_BIN {
        let place = block.tile_of_bin(block.bin_of_piece(piece), tile);
        if block.has_tile(place) {
            let list = (place[1] * block.tile_columns() + place[0]) as usize;
            let (part, end) = (piece % block.part_count(), starts[list + 1]);
            let first = starts[list] + before[block.before_at(block.run_of(place), part, tile % TILE_RUN) as usize];
            block.fold_entries(splats, masks, piece, tile, first, |place, depth, index| {
                if place < end {
                    keys.store(place as usize, [depth.to_bits(), index]);
                }
                place + 1
            });
        }
        tile += 1;
    }
}

/// Puts the splat of a key where it belongs in the list of its tile.
#[inline(always)]
pub fn sort_entries(
    block: &ListBlock,
    starts: &[u32],
    keys: &(impl Fetch<[u32; 2]> + ?Sized),
    entries: &mut (impl Store<u32> + ?Sized),
    entry: u32,
) {
    if entry < starts[block.tile_count() as usize] {
        let tile = block.tile_of_entry(starts, entry) as usize;
        let (start, end) = (starts[tile], starts[tile + 1]);
        entries.store((start + rank(keys, start, end, entry)) as usize, keys.fetch(entry as usize)[1]);
    }
}

/// Mean and variance of a photograph's window around a pixel.
#[inline(always)]
pub fn measure_windows(
    block: &LossBlock,
    photographs: &(impl Fetch<[f32; 4]> + ?Sized),
    means: &mut (impl Store<[f32; 4]> + ?Sized),
    variances: &mut (impl Store<[f32; 4]> + ?Sized),
    pixel: u32,
) {
    let ([red, green, blue], [of_red, of_green, of_blue]) = moments(block, photographs, pixel);
    means.store((block.first + pixel) as usize, [red, green, blue, 0.0]);
    variances.store((block.first + pixel) as usize, [of_red, of_green, of_blue, 0.0]);
}

/// The derivatives of `1 - SSIM` by the means of a pixel's window.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn compare_windows(
    block: &LossBlock,
    colours: &(impl Fetch<[f32; 4]> + ?Sized),
    photographs: &(impl Fetch<[f32; 4]> + ?Sized),
    means: &(impl Fetch<[f32; 4]> + ?Sized),
    variances: &(impl Fetch<[f32; 4]> + ?Sized),
    gains: &(impl Fetch<GainBlock> + ?Sized),
    by_windows: &mut (impl Store<[f32; 4]> + ?Sized),
    pixel: u32,
) {
    let gain = gains.fetch(block.source as usize).value;
    let by = structure(block, gain, colours, photographs, means, variances, pixel);
    let mut number = 0;
    while number < 3 {
        let [red, green, blue] = by[number];
        by_windows.store(3 * pixel as usize + number, [red, green, blue, 0.0]);
        number += 1;
    }
}

/// The derivatives of the loss by a pixel, and what it adds to that by the gain.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn compare_pixels(
    block: &LossBlock,
    colours: &(impl Fetch<[f32; 4]> + ?Sized),
    photographs: &(impl Fetch<[f32; 4]> + ?Sized),
    by_windows: &(impl Fetch<[f32; 4]> + ?Sized),
    gains: &(impl Fetch<GainBlock> + ?Sized),
    by_pixels: &mut (impl Store<[f32; 4]> + ?Sized),
    shares: &mut (impl Store<[f32; 4]> + ?Sized),
    pixel: u32,
) {
    let gain = gains.fetch(block.source as usize).value;
    let (by, share) = pixel_gradient(block, gain, colours, photographs, by_windows, pixel);
    by_pixels.store(pixel as usize, by);
    shares.store(pixel as usize, share);
}

/// What a run of pixels adds to the derivative by the gain, in their order.
#[inline(always)]
pub fn sum_shares(
    pixel_count: &u32,
    shares: &(impl Fetch<[f32; 4]> + ?Sized),
    sums: &mut (impl Store<[f32; 4]> + ?Sized),
    run: u32,
) {
    let mut sum = [0.0; 4];
    let mut pixel = run * SHARE_RUN;
    let end = if pixel + SHARE_RUN < *pixel_count { pixel + SHARE_RUN } else { *pixel_count };
    while pixel < end {
        let [red, green, blue, _] = shares.fetch(pixel as usize);
        sum = [sum[0] + red, sum[1] + green, sum[2] + blue, 0.0];
        pixel += 1;
    }
    sums.store(run as usize, sum);
}

/// A photograph's gain after the step of that of the picture's: their mean stays 1. `sums` are of the runs of pixels.
#[inline(always)]
pub fn step_gains(
    block: &GainStepBlock,
    sums: &(impl Fetch<[f32; 4]> + ?Sized),
    status: &[u32],
    gains: &(impl Fetch<GainBlock> + ?Sized),
    next_gains: &mut (impl Store<GainBlock> + ?Sized),
    gain: u32,
) {
    if status[0] != 0 {
        next_gains.store(gain as usize, gains.fetch(gain as usize));
        return;
    }
    let (mut sum, mut run) = ([0.0; 3], 0);
    while run < block.run_count {
        let [red, green, blue, _] = sums.fetch(run as usize);
        sum = [sum[0] + red, sum[1] + green, sum[2] + blue];
        run += 1;
    }
    let by_gain = [block.factor * sum[0], block.factor * sum[1], block.factor * sum[2]];
    let stepped = step_gain(&gains.fetch(block.source as usize), by_gain, block.rate);
    let (mut all, mut source) = ([0.0; 3], 0);
    while source < block.gain_count {
        let value = if source == block.source { stepped.value } else { gains.fetch(source as usize).value };
        all = [all[0] + value[0], all[1] + value[1], all[2] + value[2]];
        source += 1;
    }
    let mut next = gains.fetch(gain as usize);
    if gain == block.source {
        next = stepped;
    }
    let count = block.gain_count as f32;
    next.value = [next.value[0] / (all[0] / count), next.value[1] / (all[1] / count), next.value[2] / (all[2] / count)];
    next_gains.store(gain as usize, next);
}

/// The derivative by a Gaussian, from the entries of its splat in the lists of the tiles that show it, tile by tile.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn gather_gradients(
    block: &SplatBlock,
    gaussians: &(impl Fetch<GaussianBlock> + ?Sized),
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    starts: &[u32],
    entries: &[u32],
    sums: &(impl Fetch<SplatGradient> + ?Sized),
    gradients: &mut (impl Store<GaussianBlock> + ?Sized),
    gaussian: u32,
) {
    let at = gaussian as usize;
    let splat = splats.fetch(at);
    let side = SPLAT_TILE as u32;
    let [left, right, top, bottom] = splat.pixels(block.camera.width, block.camera.height);
    let tile_columns = block.camera.width.div_ceil(side);
    let mut all = SplatGradient::ZERO;
    // Nothing is covered where an end is not behind its first one.
    let (mut row, end_row) = (top / side, if left < right { bottom.div_ceil(side) } else { 0 });
    while row < end_row {
        let (mut column, end_column) = (left / side, right.div_ceil(side));
        while column < end_column {
            if is_reached(&splat, [left, right, top, bottom], column, row) {
                let tile = (row * tile_columns + column) as usize;
                let end = starts[tile + 1];
                let entry = entry_of(entries, splats, starts[tile], end, gaussian, splat.depth);
                if entry < end {
                    all.add(&sums.fetch(entry as usize));
                }
            }
            column += 1;
        }
        row += 1;
    }
    let gradient = project_gradient::project_gradient(block, &gaussians.fetch(at), &splat, &all);
    gradients.store(at, gradient);
}

/// Whether a splat has pixels of the picture.
#[inline(always)]
fn is_in_sight(splat: &ProjectedGaussian, block: &StepBlock) -> bool {
    let [left, right, top, bottom] = splat.pixels(block.camera.width, block.camera.height);
    left < right && top < bottom
}

/// A Gaussian and its state after the step, which it takes if it is in the picture.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn step_particles(
    block: &StepBlock,
    gaussians: &(impl Fetch<GaussianBlock> + ?Sized),
    states: &(impl Fetch<ParticleState> + ?Sized),
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    gradients: &(impl Fetch<GaussianBlock> + ?Sized),
    status: &[u32],
    next_gaussians: &mut (impl Store<GaussianBlock> + ?Sized),
    next_states: &mut (impl Store<ParticleState> + ?Sized),
    gaussian: u32,
) {
    let at = gaussian as usize;
    let (mut next, mut after) = (gaussians.fetch(at), states.fetch(at));
    let splat = splats.fetch(at);
    if status[0] == 0 && is_in_sight(&splat, block) {
        (next, after) = step_particle(&next, &after, &gradients.fetch(at), splat.colour, block, ln);
    }
    next_gaussians.store(at, next);
    next_states.store(at, after);
}

/// A term of a Gaussian's spherical harmonics after the step, which it takes if the Gaussian is in the picture and the
/// term's degree is optimised.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn step_harmonics(
    block: &StepBlock,
    gaussians: &(impl Fetch<GaussianBlock> + ?Sized),
    states: &(impl Fetch<ParticleState> + ?Sized),
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    gradients: &(impl Fetch<GaussianBlock> + ?Sized),
    status: &[u32],
    terms: &(impl Fetch<HarmonicTerm> + ?Sized),
    term_states: &(impl Fetch<TermState> + ?Sized),
    next_terms: &mut (impl Store<HarmonicTerm> + ?Sized),
    next_term_states: &mut (impl Store<TermState> + ?Sized),
    term: u32,
) {
    let at = (term / block.term_count()) as usize;
    let number = term % block.term_count();
    let (mut next, mut after) = (terms.fetch(term as usize), term_states.fetch(term as usize));
    let (splat, state) = (splats.fetch(at), states.fetch(at));
    let of_degree = REST_COUNTS[block.degree as usize];
    let count = if state.rest_count > of_degree { state.rest_count } else { of_degree };
    if status[0] == 0 && number < count && is_in_sight(&splat, block) {
        let by = by_colour(gradients.fetch(at).colour, splat.colour, block.degree);
        if has_finite_bits(by[0]) && has_finite_bits(by[1]) && has_finite_bits(by[2]) {
            let basis = harmonics(direction(&gaussians.fetch(at), &block.camera))[number as usize];
            (next, after) = step_term(&next, &after, by, basis, block.rates[4], corrections(state.step_count + 1));
        }
    }
    next_terms.store(term as usize, next);
    next_term_states.store(term as usize, after);
}
