//! [`Kernel::CompareViews`]: a band of a target's frustum, with silhouettes and with photographs.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::sweep_oracle;
use crate::swept::{LoadedSwept, Swept};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_vulkan::kernel::Kernel;

/// A frustum in a device's memory, and what views show there.
pub struct Loaded<D: Device> {
    swept: LoadedSwept<D>,
    grey: D::Buffer<Planes>,
    evidence: D::Buffer<Planes>,
}

/// See the module.
pub enum CompareViews {}

impl Case for CompareViews {
    const KERNEL: Kernel = Kernel::CompareViews;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 4.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "colours as a look-up (fifteen roundings of an image coordinate, times the image's slope) \
        over an alpha of at least 0.3; a disparity's error over two steps, times the bell's slope";
    const SPOILERS: &'static [Spoiler<Swept>] = &[
        ("views", |swept| swept.views[1].camera.intrinsics[0] *= 1.01),
        ("pairs", |swept| swept.pairs[0].weight *= 1.01),
        ("texels", Swept::spoil_texels),
        ("disparities", |swept| swept.disparities.iter_mut().for_each(|[disparity, _]| *disparity *= 1.01)),
        ("parameters", |swept| swept.frustum.disparity_step *= 1.01),
    ];

    type Inputs = Swept;
    type Loaded<D: Device> = Loaded<D>;

    fn inputs(seed: u64, size: u32) -> Swept {
        Swept::new(seed, size)
    }

    fn element_count(swept: &Swept) -> usize {
        swept.band_len()
    }

    fn load<D: Device>(device: &D, swept: &Swept) -> Result<Self::Loaded<D>, DeviceError> {
        Ok(Loaded {
            swept: swept.load(device)?,
            grey: device.zeros(swept.views.len() * swept.band_len())?,
            evidence: device.zeros(4 * swept.band_len())?,
        })
    }

    fn run<D: Device>(device: &D, swept: &Swept, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let Loaded { swept: LoadedSwept { views, pairs, texels, disparities }, grey, evidence } = loaded;
        device.compare_views(&swept.frustum, views, pairs, texels, disparities, grey, evidence)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = device.download(&loaded.grey)?.into_flattened();
        values.extend(device.download(&loaded.evidence)?.into_flattened());
        Ok(values)
    }

    fn expected(swept: &Swept) -> Vec<Option<Bounded>> {
        let Swept { frustum, views, pairs, texels, disparities } = swept;
        let first = frustum.first_row * frustum.camera.width;
        let found = map(swept.band_len(), 1, |element| {
            let (pixel, group) = (element as u32 / frustum.group_count, element as u32 % frustum.group_count);
            sweep_oracle::evidence(frustum, views, pairs, texels, disparities, first + pixel, group)
        });
        let grey = (0..views.len()).flat_map(|view| found.iter().flat_map(move |found| found.grey[view]));
        let evidence = found.iter().flat_map(|found| found.evidence.as_flattened().iter().copied());
        grey.chain(evidence).collect()
    }
}
