//! [`Kernel::SumRow`] and [`Kernel::MeanColumn`]: costs of a plausible sweep, a quarter of them outside the visual hull.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::hull_oracle;
use crate::world::{Numbers, World, costs};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_kernels::visual_hull::sweep::{SweepBlock, sum_row};
use viewfuse_vulkan::kernel::Kernel;

/// A band's costs and their sums over rows.
#[derive(Clone, Debug)]
pub struct Inputs {
    sweep: SweepBlock,
    costs: Vec<f32>,
    row_sums: Vec<[f32; 2]>,
}

impl Inputs {
    fn new(seed: u64, size: u32) -> Inputs {
        let sweep = World::of_size(seed, size).sweep(0);
        let costs = costs(&mut Numbers::new(seed), sweep.row_count * sweep.width, sweep.plane_count);
        let row_sums = elements(&sweep).map(|(pixel, plane)| sum_row(&sweep, &costs, pixel, plane)).collect();
        Inputs { sweep, costs, row_sums }
    }

    /// Increased by 1 %, except those outside.
    fn spoil_costs(&mut self) {
        self.costs.iter_mut().filter(|cost| **cost > 0.0).for_each(|cost| *cost *= 1.01);
    }
}

/// Pixels and planes in the order of costs.
fn elements(sweep: &SweepBlock) -> impl Iterator<Item = (u32, u32)> {
    let plane_count = sweep.plane_count;
    (0..sweep.row_count * sweep.width).flat_map(move |pixel| (0..plane_count).map(move |plane| (pixel, plane)))
}

/// See the module.
pub enum SumRow {}

impl Case for SumRow {
    const KERNEL: Kernel = Kernel::SumRow;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "at most five additions of costs of at most 0.2";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[("costs", Inputs::spoil_costs)];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<f32>, D::Buffer<[f32; 2]>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        Inputs::new(seed, size)
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.costs.len()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((device.upload(&inputs.costs)?, device.zeros(inputs.costs.len())?))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.sum_row(&inputs.sweep, &loaded.0, &mut loaded.1)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.1)?.into_flattened())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { sweep, costs, .. } = inputs;
        let sum = |(pixel, plane)| hull_oracle::sum_row(sweep, sweep.width, costs, pixel, plane);
        let elements: Vec<_> = elements(sweep).collect();
        map(elements.len(), 64, |at| sum(elements[at])).into_iter().flatten().collect()
    }
}

/// See the module.
pub enum MeanColumn {}

impl Case for MeanColumn {
    const KERNEL: Kernel = Kernel::MeanColumn;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-6, least: 1.0e-2 };
    const REASON: &'static str = "at most 25 additions of costs of at most 0.2, a division of 2.5 ULP";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        // What is outside the hull and what is not: the values themselves come in through the sums.
        ("costs", |inputs| inputs.costs.iter_mut().step_by(100).for_each(|cost| *cost = -*cost)),
        ("row_sums", |inputs| inputs.row_sums.iter_mut().for_each(|[sum, _]| *sum *= 1.01)),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<f32>, D::Buffer<[f32; 2]>, D::Buffer<f32>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        Inputs::new(seed, size)
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.costs.len()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((device.upload(&inputs.costs)?, device.upload(&inputs.row_sums)?, device.zeros(inputs.costs.len())?))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.mean_column(&inputs.sweep, &loaded.0, &loaded.1, &mut loaded.2)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        device.download(&loaded.2)
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { sweep, costs, .. } = inputs;
        let mean = |(pixel, plane)| hull_oracle::mean_column(sweep, sweep.width, costs, pixel, plane);
        let elements: Vec<_> = elements(sweep).collect();
        map(elements.len(), 16, |at| mean(elements[at]))
    }
}
