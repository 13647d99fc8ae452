//! Operations of the denoiser's sampler on pictures.

use crate::parallel::for_each;
use viewfuse_core::sampler::{Mix, NoiseBlock, mixed_element, noisy_element};

/// The fewest elements for a thread: fewer take less time than waking a thread.
const MIN_ELEMENTS: usize = 4096;

#[allow(clippy::too_many_arguments)]
pub(super) fn mix_pictures(
    mix: &Mix,
    element_count: u32,
    state: &[f32],
    newest: &[f32],
    second: &[f32],
    third: &[f32],
    fourth: &[f32],
    mixed: &mut [f32],
) {
    for_each(&mut mixed[..element_count as usize], MIN_ELEMENTS, |element, mixed| {
        *mixed = mixed_element(mix, state, newest, second, third, fourth, element);
    });
}

pub(super) fn add_noise(block: &NoiseBlock, element_count: u32, picture: &[f32], noisy: &mut [f32]) {
    for_each(&mut noisy[..element_count as usize], MIN_ELEMENTS, |element, noisy| {
        *noisy = noisy_element(block, picture[element], element as u32);
    });
}
