//! The CPU: every kernel a loop over its elements, spread over all cores.

mod light;
mod matrices;
mod network;
mod normalise;
mod photo;
mod points;
mod product;
mod rays;
mod room;
mod sampler;
mod volumes;
mod weighting;
mod winograd;

use super::memory::{Element, KernelTime, Memory};
use std::convert::Infallible;

/// All cores of this machine. Buffers are vectors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

impl Memory for Cpu {
    type Buffer<T: Element> = Vec<T>;
    type Error = Infallible;

    fn name(&self) -> String {
        format!("cpu ({} threads)", rayon::current_num_threads())
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Vec<T>, Infallible> {
        Ok(values.to_vec())
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, Infallible> {
        Ok(vec![T::default(); count])
    }

    fn most_elements<T: Element>(&self) -> usize {
        usize::MAX
    }

    fn busy_elements(&self) -> usize {
        1
    }

    fn finish(&self) -> Result<(), Infallible> {
        Ok(())
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        Vec::new()
    }

    fn download<T: Element>(&self, buffer: &Vec<T>) -> Result<Vec<T>, Infallible> {
        Ok(buffer.clone())
    }
}
