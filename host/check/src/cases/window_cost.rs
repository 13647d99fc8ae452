//! [`Kernel::RowSums`] and [`Kernel::WindowCost`]: costs of a whole frustum, some of which weigh nothing.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::sweep_oracle;
use crate::swept::{Swept, costs};
use crate::world::Numbers;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_kernels::plane_sweep::window::{WindowBlock, row_sums};
use viewfuse_kernels::plane_sweep::{PLANES, Planes};
use viewfuse_vulkan::kernel::Kernel;

/// Costs times weights, weights, and their sums over rows.
#[derive(Clone, Debug)]
pub struct Inputs {
    block: WindowBlock,
    costs: Vec<Planes>,
    sums: Vec<Planes>,
}

impl Inputs {
    fn new(seed: u64, size: u32) -> Inputs {
        let swept = Swept::new(seed, size);
        let numbers = &mut Numbers::new(seed);
        // Windows that the image's border cuts off on one side, on both, or not at all.
        let block = WindowBlock { reach: [1, 3, 6], ..WindowBlock::new(&swept.frustum, 0.02) };
        let mut weighted = Vec::new();
        for mut cost in costs(numbers, &swept.volume()) {
            let mut weights = [0.0; PLANES];
            for (cost, weight) in cost.iter_mut().zip(&mut weights) {
                *weight = if numbers.between(0.0, 1.0) < 0.2 { 0.0 } else { numbers.between(0.1, 1.0) };
                *cost *= *weight;
            }
            weighted.extend([cost, weights]);
        }
        let sum = |(pixel, group)| row_sums(&block, &weighted[..], pixel, group);
        let sums = elements(&block).flat_map(sum).flatten().collect();
        Inputs { block, costs: weighted, sums }
    }

    fn element_count(&self) -> usize {
        self.costs.len() / 2
    }

    /// An evaluation for each pixel and group of planes, on all cores.
    fn for_each<T: Send>(&self, evaluate: impl Fn(u32, u32) -> T + Sync) -> Vec<T> {
        let elements: Vec<(u32, u32)> = elements(&self.block).collect();
        map(elements.len(), 8, |at| evaluate(elements[at].0, elements[at].1))
    }
}

/// Pixels and groups of planes, in the order of the volume.
fn elements(block: &WindowBlock) -> impl Iterator<Item = (u32, u32)> {
    let group_count = block.group_count;
    (0..block.width * block.height).flat_map(move |pixel| (0..group_count).map(move |group| (pixel, group)))
}

/// See the module.
pub enum RowSums {}

impl Case for RowSums {
    const KERNEL: Kernel = Kernel::RowSums;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "at most thirteen additions of weights of at most 1";
    const SPOILERS: &'static [Spoiler<Inputs>] =
        &[("costs", |inputs| inputs.costs.iter_mut().step_by(2).flatten().for_each(|cost| *cost *= 1.01))];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<Planes>, D::Buffer<Planes>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        Inputs::new(seed, size)
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.element_count()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((device.upload(&inputs.costs)?, device.zeros(inputs.sums.len())?))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.row_sums(&inputs.block, &loaded.0, &mut loaded.1)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.1)?.into_flattened())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let sums = inputs.for_each(|pixel, group| sweep_oracle::row_sums(&inputs.block, &inputs.costs, pixel, group));
        sums.into_iter().flatten().flatten().map(Some).collect()
    }
}

/// See the module.
pub enum WindowCost {}

impl Case for WindowCost {
    const KERNEL: Kernel = Kernel::WindowCost;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "for each window at most thirteen additions of sums, and a quotient below 0.4";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        ("sums", |inputs| inputs.sums.iter_mut().step_by(2).flatten().for_each(|sum| *sum *= 1.01)),
        ("parameters", |inputs| inputs.block.near_cost *= 1.01),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<Planes>, D::Buffer<Planes>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        Inputs::new(seed, size)
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.element_count()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((device.upload(&inputs.sums)?, device.zeros(inputs.element_count())?))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.window_cost(&inputs.block, &loaded.0, &mut loaded.1)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.1)?.into_flattened())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let means =
            inputs.for_each(|pixel, group| sweep_oracle::window_cost(&inputs.block, &inputs.sums, pixel, group));
        means.into_iter().flatten().map(Some).collect()
    }
}
