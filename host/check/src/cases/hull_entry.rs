//! [`Kernel::HullEntry`]: every pixel of every view of a small world.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::hull_oracle;
use crate::world::World;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, HullScene};
use viewfuse_vulkan::kernel::Kernel;

/// See the module.
pub enum HullEntry {}

impl Case for HullEntry {
    const KERNEL: Kernel = Kernel::HullEntry;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "up to 60 additions of a step to a depth of 3";
    const SPOILERS: &'static [Spoiler<World>] =
        &[("object", World::spoil_box), ("views", World::spoil_focal), ("texels", World::spoil_texels)];

    type Inputs = World;
    type Loaded<D: Device> = (HullScene<D>, D::Buffer<f32>);

    fn inputs(seed: u64, size: u32) -> World {
        World::of_size(seed, size)
    }

    fn element_count(world: &World) -> usize {
        world.texels.len()
    }

    fn load<D: Device>(device: &D, world: &World) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((world.load(device)?, device.zeros(world.texels.len())?))
    }

    fn run<D: Device>(device: &D, _: &World, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let (HullScene { object_buffer, views, texels, cameras, .. }, entries) = loaded;
        (0..).zip(&*cameras).try_for_each(|(view, camera)| {
            device.hull_entry(&view, camera.width * camera.height, object_buffer, views, texels, entries)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        device.download(&loaded.1)
    }

    fn expected(world: &World) -> Vec<Option<Bounded>> {
        let scene = world.scene();
        let pixels: Vec<(u32, u32)> = world.pixels().collect();
        map(pixels.len(), 1, |at| hull_oracle::hull_entry(&scene, pixels[at].0, pixels[at].1))
    }
}
