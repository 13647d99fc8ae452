//! [`Kernel::CensusCost`]: a band of random greys, in two dispatches.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::sweep_oracle;
use crate::swept::{Swept, band};
use crate::world::Numbers;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_kernels::plane_sweep::evidence::ViewPair;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};
use viewfuse_vulkan::kernel::Kernel;

/// A frustum and what its views show.
#[derive(Clone, Debug)]
pub struct Inputs {
    swept: Swept,
    grey: Vec<Planes>,
    evidence: Vec<Planes>,
}

/// The same in a device's memory, and the costs.
pub struct Loaded<D: Device> {
    pairs: D::Buffer<ViewPair>,
    grey: D::Buffer<Planes>,
    evidence: D::Buffer<Planes>,
    costs: D::Buffer<Planes>,
}

/// See the module.
pub enum CensusCost {}

impl Case for CensusCost {
    const KERNEL: Kernel = Kernel::CensusCost;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "differences of grey in units of 0.04, each rounded; sums over twelve neighbours of all pairs; \
        three quotients";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        ("pairs", |inputs| inputs.swept.pairs[0].weight *= 1.01),
        ("grey", |inputs| inputs.grey.iter_mut().step_by(2).for_each(|grey| grey[0] *= 1.01)),
        ("evidence", |inputs| inputs.evidence.as_flattened_mut().iter_mut().for_each(|part| *part *= 1.01)),
        ("parameters", |inputs| inputs.swept.frustum.dissent_share *= 1.01),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = Loaded<D>;

    fn inputs(seed: u64, size: u32) -> Inputs {
        let swept = Swept::new(seed, size);
        let (grey, evidence) = band(&mut Numbers::new(seed), &swept);
        Inputs { swept, grey, evidence }
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.swept.band_len()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let volume = inputs.swept.volume();
        Ok(Loaded {
            pairs: device.upload(&inputs.swept.pairs)?,
            grey: device.upload(&inputs.grey)?,
            evidence: device.upload(&inputs.evidence)?,
            costs: device.zeros(2 * (volume.width * volume.height * volume.group_count) as usize)?,
        })
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let Loaded { pairs, grey, evidence, costs } = loaded;
        let frustum = &inputs.swept.frustum;
        let middle = frustum.row_count / 2;
        for (first_row, row_count) in [(0, middle), (middle, frustum.row_count - middle)] {
            if row_count > 0 {
                device.census_cost(frustum, first_row, row_count, pairs, grey, evidence, costs)?;
            }
        }
        Ok(())
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.costs)?.into_flattened())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { swept, grey, evidence } = inputs;
        let frustum = &swept.frustum;
        let costs = map(swept.band_len(), 8, |element| {
            let (pixel, group) = (element as u32 / frustum.group_count, element as u32 % frustum.group_count);
            sweep_oracle::census_cost(frustum, &swept.pairs, grey, evidence, pixel, group)
        });
        // Above the band nothing is written.
        let above = 2 * PLANES * (frustum.first_row * frustum.camera.width * frustum.group_count) as usize;
        let band = costs.iter().flat_map(|costs| costs.as_flattened()).map(|cost| Some(*cost));
        std::iter::repeat_n(Some(Bounded::ZERO), above).chain(band).collect()
    }
}
