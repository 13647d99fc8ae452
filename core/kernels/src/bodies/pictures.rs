//! Operations on pictures and other numbers, and what a device can do at most.

use crate::limits::{ChainBlock, LookUpBlock, chained, copied, looked_up};
use crate::store::Store;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::half_precision;
use viewfuse_core::sampler::{Mix, NoiseBlock, mixed_element, noisy_element};

/// A word of two numbers in half precision.
#[inline]
pub fn pack_f16(number_count: &u32, numbers: &[f32], words: &mut (impl Store<u32> + ?Sized), word: u32) {
    words.store(word as usize, half_precision::packed_f16(numbers, *number_count, word as usize));
}

/// A word of two factors in half precision.
#[inline]
pub fn pack_factors(number_count: &u32, numbers: &[f32], words: &mut (impl Store<u32> + ?Sized), word: u32) {
    words.store(word as usize, half_precision::packed_factors(numbers, *number_count, word as usize));
}

/// A linear combination.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn mix_pictures(
    block: &Mix,
    state: &[f32],
    newest: &[f32],
    second: &[f32],
    third: &[f32],
    fourth: &[f32],
    mixed: &mut (impl Store<f32> + ?Sized),
    channel: u32,
) {
    let element = channel as usize;
    mixed.store(element, mixed_element(block, state, newest, second, third, fourth, element));
}

/// A noisy value.
#[inline]
pub fn add_noise(block: &NoiseBlock, picture: &[f32], noisy: &mut (impl Store<f32> + ?Sized), channel: u32) {
    noisy.store(channel as usize, noisy_element(block, picture[channel as usize], channel));
}

/// Four numbers.
#[inline]
pub fn copy_numbers(
    numbers: &(impl Fetch<[f32; 4]> + ?Sized),
    copies: &mut (impl Store<[f32; 4]> + ?Sized),
    four: u32,
) {
    copies.store(four as usize, copied(numbers, four as usize));
}

/// Several chains.
#[inline]
pub fn multiply_add(block: &ChainBlock, starts: &[f32], ends: &mut (impl Store<f32> + ?Sized), chain: u32) {
    ends.store(chain as usize, chained(block, starts[chain as usize]));
}

/// Several look-ups.
#[inline(always)]
pub fn look_up_texels(
    block: &LookUpBlock,
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    sums: &mut (impl Store<f32> + ?Sized),
    element: u32,
) {
    sums.store(element as usize, looked_up(block, texels, element));
}
