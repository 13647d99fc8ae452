//! [`Kernel::PickDisparity`]: the second of a few views.

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
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::path::CostBlock;
use viewfuse_vulkan::kernel::Kernel;

/// A view's frustum and its costs.
#[derive(Clone, Debug)]
pub struct Inputs {
    frustum: FrustumBlock,
    costs: Vec<Planes>,
}

impl Inputs {
    fn pixel_count(&self) -> usize {
        (self.frustum.camera.width * self.frustum.camera.height) as usize
    }
}

/// See the module.
pub enum PickDisparity {}

impl Case for PickDisparity {
    const KERNEL: Kernel = Kernel::PickDisparity;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 5.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a difference of costs in units of the temperature, under an exponential; the quotient of two \
        sums of these; the vertex of a parabola in steps of a plane; undecided where all three costs are nearly equal";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        ("costs", |inputs| inputs.costs.as_flattened_mut().iter_mut().step_by(2).for_each(|cost| *cost *= 1.01)),
        ("parameters", |inputs| inputs.frustum.disparity_step *= 1.01),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = (D::Buffer<Planes>, D::Buffer<[f32; 2]>);

    fn inputs(seed: u64, size: u32) -> Inputs {
        let swept = Swept::new(seed, size);
        let frustum = FrustumBlock { camera: swept.views[1].camera, ..swept.frustum };
        let mut inputs = Inputs { frustum, costs: Vec::new() };
        // The map begins behind that of a smaller view.
        inputs.frustum.camera.first_texel = 5;
        let (width, height) = (frustum.camera.width, frustum.camera.height);
        let volume = CostBlock { width, height, ..swept.volume() };
        inputs.costs = costs(&mut Numbers::new(seed), &volume);
        inputs
    }

    fn element_count(inputs: &Inputs) -> usize {
        inputs.pixel_count()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let count = inputs.frustum.camera.first_texel as usize + inputs.pixel_count();
        Ok((device.upload(&inputs.costs)?, device.zeros(count)?))
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.pick_disparity(&inputs.frustum, &loaded.0, &mut loaded.1)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.1)?.into_flattened())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let pick = |pixel: usize| sweep_oracle::pick_disparity(&inputs.frustum, &inputs.costs, pixel as u32);
        let before = vec![[Some(Bounded::ZERO); 2]; inputs.frustum.camera.first_texel as usize];
        let picked = map(inputs.pixel_count(), 16, pick);
        before.into_iter().chain(picked).flatten().collect()
    }
}
