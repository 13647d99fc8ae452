//! From noise to a picture.

use super::Cpu;
use crate::kernels::sampler::SamplerKernels;
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::sampler::{MOST_RESULTS, Mix, NoiseBlock, mixed_element, noisy_element};

/// Elements that a thread takes at least: fewer are done before another one is awake.
const LEAST_ELEMENTS: usize = 4096;

impl SamplerKernels for Cpu {
    fn mix_pictures(
        &self,
        mix: &Mix,
        state: &Vec<f32>,
        results: [&Vec<f32>; MOST_RESULTS],
        mixed: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let [newest, second, third, fourth] = results.map(Vec::as_slice);
        mixed.par_iter_mut().with_min_len(LEAST_ELEMENTS).enumerate().for_each(|(element, mixed)| {
            *mixed = mixed_element(mix, &state[..], newest, second, third, fourth, element);
        });
        Ok(())
    }

    fn add_noise(&self, block: &NoiseBlock, picture: &Vec<f32>, noisy: &mut Vec<f32>) -> Result<(), Infallible> {
        noisy
            .par_iter_mut()
            .zip(picture)
            .with_min_len(LEAST_ELEMENTS)
            .enumerate()
            .for_each(|(element, (noisy, value))| *noisy = noisy_element(block, *value, element as u32));
        Ok(())
    }
}
