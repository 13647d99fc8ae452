//! [`Kernel::MatchCost`]: a band of one view's sweep through a small world.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::hull_oracle;
use crate::world::World;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, HullScene};
use viewfuse_kernels::visual_hull::sweep::SweepBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The world and the sweep.
#[derive(Clone, Debug)]
pub struct Inputs {
    world: World,
    sweep: SweepBlock,
}

/// A sweep in a device's memory.
pub struct Loaded<D: Device> {
    scene: HullScene<D>,
    entries: D::Buffer<f32>,
    pair_weights: D::Buffer<f32>,
    costs: D::Buffer<f32>,
}

/// See the module.
pub enum MatchCost {}

impl Case for MatchCost {
    const KERNEL: Kernel = Kernel::MatchCost;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "colours as a look-up (ten roundings of an image coordinate, times the image's slope) over \
        an alpha of at least 0.3, times shares of at most 1 / NO_WITNESS";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        ("object", |inputs| inputs.world.object.radius *= 1.01),
        ("views", |inputs| inputs.world.spoil_focal()),
        ("texels", |inputs| inputs.world.spoil_texels()),
        ("entries", |inputs| inputs.world.spoil_entries()),
        ("pair_weights", |inputs| inputs.world.pair_weights.iter_mut().step_by(2).for_each(|weight| *weight *= 1.01)),
        ("parameters", |inputs| inputs.sweep.near *= 1.01),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = Loaded<D>;

    fn inputs(seed: u64, size: u32) -> Inputs {
        let world = World::of_size(seed, size);
        let sweep = world.sweep((seed % u64::from(world.object.view_count)) as u32);
        Inputs { world, sweep }
    }

    fn element_count(inputs: &Inputs) -> usize {
        (inputs.sweep.row_count * inputs.sweep.width) as usize
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let world = &inputs.world;
        Ok(Loaded {
            scene: world.load(device)?,
            entries: device.upload(&world.entries)?,
            pair_weights: device.upload(&world.pair_weights)?,
            costs: device.zeros(Self::element_count(inputs) * inputs.sweep.plane_count as usize)?,
        })
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let Loaded { scene, entries, pair_weights, costs } = loaded;
        let HullScene { object_buffer, views, texels, .. } = scene;
        device.match_cost(&inputs.sweep, object_buffer, views, texels, entries, pair_weights, costs)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        device.download(&loaded.costs)
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { world, sweep } = inputs;
        let first = sweep.first_row * sweep.width;
        let pixels = first..first + sweep.row_count * sweep.width;
        let cost = |pixel, plane| {
            hull_oracle::match_cost(&world.scene(), sweep, &world.entries, &world.pair_weights, pixel, plane)
        };
        let costs = |index: usize| -> Vec<_> {
            (0..sweep.plane_count).map(|plane| cost(pixels.start + index as u32, plane)).collect()
        };
        map(pixels.len(), 1, costs).concat()
    }
}
