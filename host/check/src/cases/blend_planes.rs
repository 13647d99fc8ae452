//! [`Kernel::BlendPlanes`]: every pixel of a target, in two bands, from a volume of half its size.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::sweep_oracle;
use crate::swept::{LoadedSwept, Swept, costs};
use crate::world::Numbers;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::blend::BlendBlock;
use viewfuse_kernels::plane_sweep::path::CostBlock;
use viewfuse_vulkan::kernel::Kernel;

/// A target, the views and the costs.
#[derive(Clone, Debug)]
pub struct Inputs {
    swept: Swept,
    block: BlendBlock,
    costs: Vec<Planes>,
}

/// The same in a device's memory, and the picture.
pub struct Loaded<D: Device> {
    swept: LoadedSwept<D>,
    costs: D::Buffer<Planes>,
    colours: D::Buffer<[f32; 4]>,
    pixel_depths: D::Buffer<f32>,
    confidences: D::Buffer<f32>,
}

/// See the module.
pub enum BlendPlanes {}

impl Case for BlendPlanes {
    const KERNEL: Kernel = Kernel::BlendPlanes;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 4.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from the image coordinates to the sum over planes; numbers whose bound \
        is larger than a step of 8 bits are undecided";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        ("views", |inputs| inputs.swept.views[1].camera.intrinsics[0] *= 1.01),
        ("texels", |inputs| inputs.swept.spoil_texels()),
        ("disparities", |inputs| inputs.swept.disparities.iter_mut().for_each(|[disparity, _]| *disparity *= 1.01)),
        ("costs", |inputs| inputs.costs.as_flattened_mut().iter_mut().step_by(2).for_each(|cost| *cost *= 1.01)),
        ("parameters", |inputs| inputs.block.target.intrinsics[0] *= 1.01),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = Loaded<D>;

    fn inputs(seed: u64, size: u32) -> Inputs {
        let swept = Swept::new(seed, size);
        let CostBlock { width, height, group_count, .. } = swept.volume();
        let half = CostBlock { width: width.div_ceil(2), height: height.div_ceil(2), group_count, padding: 0 };
        let (swept, block) = swept.halved(&half);
        Inputs { swept, block, costs: costs(&mut Numbers::new(seed), &half) }
    }

    fn element_count(inputs: &Inputs) -> usize {
        (inputs.block.target.width * inputs.block.target.height) as usize
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let count = Self::element_count(inputs);
        Ok(Loaded {
            swept: inputs.swept.load(device)?,
            costs: device.upload(&inputs.costs)?,
            colours: device.zeros(count)?,
            pixel_depths: device.zeros(count)?,
            confidences: device.zeros(count)?,
        })
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let Loaded { swept, costs, colours, pixel_depths, confidences } = loaded;
        let LoadedSwept { views, texels, disparities, .. } = swept;
        let height = inputs.block.target.height;
        let middle = height / 2;
        for (first_row, row_count) in [(0, middle), (middle, height - middle)] {
            if row_count > 0 {
                device.blend_planes(
                    &inputs.block,
                    first_row,
                    row_count,
                    views,
                    texels,
                    disparities,
                    costs,
                    colours,
                    pixel_depths,
                    confidences,
                )?;
            }
        }
        Ok(())
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = device.download(&loaded.colours)?.into_flattened();
        values.extend(device.download(&loaded.pixel_depths)?);
        values.extend(device.download(&loaded.confidences)?);
        Ok(values)
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { swept: Swept { views, texels, disparities, .. }, block, costs } = inputs;
        let pixels = map(Self::element_count(inputs), 1, |pixel| {
            let (column, row) = (pixel as u32 % block.target.width, pixel as u32 / block.target.width);
            let at = [column as f32 + 0.5, row as f32 + 0.5];
            sweep_oracle::blend(block, views, texels, disparities, costs, at)
        });
        let mut expected = Vec::new();
        for pixel in &pixels {
            expected.extend((0..4).map(|channel| pixel.map(|pixel| pixel.colour[channel])));
        }
        expected.extend(pixels.iter().map(|pixel| pixel.and_then(|pixel| pixel.depth)));
        expected.extend(pixels.iter().map(|pixel| pixel.map(|pixel| pixel.confidence)));
        expected
    }
}
