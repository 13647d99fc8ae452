//! [`Kernel::MarchRays`]: every pixel of a target, in two bands; with early termination for every other seed.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::hull_oracle;
use crate::world::World;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, HullScene, Pixels};
use viewfuse_kernels::visual_hull::ray_marching::MarchBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The world and the target.
#[derive(Clone, Debug)]
pub struct Inputs {
    world: World,
    block: MarchBlock,
}

/// The same in a device's memory, and the picture.
pub struct Loaded<D: Device> {
    scene: HullScene<D>,
    depths: D::Buffer<f32>,
    weights: D::Buffer<f32>,
    pixels: Pixels<D>,
}

/// See the module.
pub enum MarchRays {}

impl Case for MarchRays {
    const KERNEL: Kernel = Kernel::MarchRays;
    const SEED_COUNT: u64 = 3;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 4.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from the image coordinates to the sum along the ray; numbers whose \
        bound is larger than a step of 8 bits are undecided";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        ("object", |inputs| inputs.world.spoil_box()),
        ("views", |inputs| inputs.world.spoil_focal()),
        ("footprints", |inputs| inputs.world.footprints.iter_mut().for_each(|footprint| *footprint *= 1.01)),
        ("texels", |inputs| inputs.world.spoil_texels()),
        ("depths", |inputs| inputs.world.spoil_depths()),
        ("weights", |inputs| inputs.world.weights[1] *= 1.01),
        ("parameters", |inputs| inputs.block.target.intrinsics[0] *= 1.01),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = Loaded<D>;

    fn inputs(seed: u64, size: u32) -> Inputs {
        let world = World::of_size(seed, size);
        let termination = if seed.is_multiple_of(2) { 0.1 } else { 0.0 };
        let block = MarchBlock { target: world.target, background: [1.0, 0.5, 0.25], termination };
        Inputs { world, block }
    }

    fn element_count(inputs: &Inputs) -> usize {
        (inputs.block.target.width * inputs.block.target.height) as usize
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let count = Self::element_count(inputs);
        Ok(Loaded {
            scene: inputs.world.load(device)?,
            depths: device.upload(&inputs.world.depths)?,
            weights: device.upload(&inputs.world.weights)?,
            pixels: Pixels { colours: device.zeros(count)?, depths: device.zeros(count)? },
        })
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let Loaded { scene, depths, weights, pixels } = loaded;
        let height = inputs.block.target.height;
        let middle = height / 2;
        for (first_row, row_count) in [(0, middle), (middle, height - middle)] {
            if row_count > 0 {
                let HullScene { object_buffer, views, footprints, texels, .. } = &*scene;
                device.march_rays(
                    &inputs.block,
                    first_row,
                    row_count,
                    object_buffer,
                    views,
                    footprints,
                    texels,
                    depths,
                    weights,
                    &mut pixels.colours,
                    &mut pixels.depths,
                )?;
            }
        }
        Ok(())
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = device.download(&loaded.pixels.colours)?.into_flattened();
        values.extend(device.download(&loaded.pixels.depths)?);
        Ok(values)
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { world, block: MarchBlock { target, background, termination } } = inputs;
        let World { footprints, depths, weights, .. } = world;
        let pixel = |pixel: u32| {
            let at = [(pixel % target.width) as f32 + 0.5, (pixel / target.width) as f32 + 0.5];
            hull_oracle::march_ray(&world.scene(), footprints, depths, weights, target, at, *background, *termination)
        };
        let pixels = map((target.width * target.height) as usize, 1, |index| pixel(index as u32));
        let mut expected = Vec::new();
        for pixel in &pixels {
            expected.extend((0..3).map(|channel| pixel.map(|pixel| pixel.colour[channel])));
            expected.push(pixel.map(|pixel| pixel.opacity));
        }
        expected.extend(pixels.iter().map(|pixel| pixel.and_then(|pixel| pixel.depth)));
        expected
    }
}
