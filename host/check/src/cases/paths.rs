//! [`Kernel::FollowPaths`] and [`Kernel::JoinPaths`]: costs with a bent valley.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::sweep_oracle;
use crate::swept::{Swept, costs};
use crate::world::Numbers;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::path::CostBlock;
use viewfuse_vulkan::kernel::Kernel;

/// A volume of costs; four behind one another, of the directions, for [`JoinPaths`].
#[derive(Clone, Debug)]
pub struct Inputs {
    block: CostBlock,
    costs: Vec<Planes>,
}

impl Inputs {
    /// Some volumes of a seed, each of about `size` groups of planes.
    fn new(seed: u64, size: u32, volume_count: usize) -> Inputs {
        let block = Swept::new(seed, size).volume();
        let numbers = &mut Numbers::new(seed);
        Inputs { block, costs: (0..volume_count).flat_map(|_| costs(numbers, &block)).collect() }
    }

    fn volume_len(&self) -> usize {
        (self.block.width * self.block.height * self.block.group_count) as usize
    }

    /// Increases the costs of every other group by 1 %.
    fn spoil(&mut self) {
        self.costs.iter_mut().step_by(2).flatten().for_each(|cost| *cost *= 1.01);
    }
}

/// See the module.
pub enum FollowPaths {}

impl Case for FollowPaths {
    const KERNEL: Kernel = Kernel::FollowPaths;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 4.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "three roundings of costs below 0.5 a step; their differences among planes add up along a \
        line";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[("means", Inputs::spoil)];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<Planes>, D::Buffer<Planes>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        Inputs::new(seed, size, 1)
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.block.line_count() as usize
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((device.upload(&inputs.costs)?, device.zeros(4 * inputs.volume_len())?))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.follow_paths(&inputs.block, &loaded.0, &mut loaded.1)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.1)?.into_flattened())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { block, costs } = inputs;
        let lines: Vec<(u32, u32)> = [block.height, block.height, block.width, block.width]
            .into_iter()
            .zip(0..)
            .flat_map(|(count, direction)| (0..count).map(move |number| (direction, number)))
            .collect();
        let follow = |line: usize| sweep_oracle::follow_path(block, costs, lines[line].0, lines[line].1);
        map(lines.len(), 1, follow).into_iter().flatten().map(Some).collect()
    }
}

/// See the module.
pub enum JoinPaths {}

impl Case for JoinPaths {
    const KERNEL: Kernel = Kernel::JoinPaths;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "three additions of costs below 0.5, a quarter of their sum";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[("paths", Inputs::spoil)];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<Planes>, D::Buffer<Planes>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        Inputs::new(seed, size, 4)
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.volume_len()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((device.upload(&inputs.costs)?, device.zeros(inputs.volume_len())?))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.join_paths(&inputs.block, &loaded.0, &mut loaded.1)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.1)?.into_flattened())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let groups = inputs.block.group_count;
        let joined = map(inputs.volume_len(), 64, |element| {
            let (pixel, group) = (element as u32 / groups, element as u32 % groups);
            sweep_oracle::joined_cost(&inputs.block, &inputs.costs, pixel, group)
        });
        joined.into_iter().flatten().map(Some).collect()
    }
}
