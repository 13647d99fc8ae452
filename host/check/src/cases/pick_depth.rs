//! [`Kernel::PickDepth`]: some rows of a band of every view, with and without depths from an earlier pass.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::hull_oracle;
use crate::world::{Numbers, World, costs};
use std::ops::Range;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, HullScene};
use viewfuse_kernels::visual_hull::NO_SURFACE;
use viewfuse_kernels::visual_hull::sweep::SweepBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The world, and each view's sweep with its mean costs.
#[derive(Clone, Debug)]
pub struct Inputs {
    world: World,
    /// `[view]`.
    bands: Vec<(SweepBlock, Vec<f32>)>,
    /// Two: none, and those of the world.
    guesses: [Vec<f32>; 2],
}

/// The same in a device's memory.
pub struct Loaded<D: Device> {
    scene: HullScene<D>,
    entries: D::Buffer<f32>,
    means: Vec<D::Buffer<f32>>,
    /// The picked depths with each guess.
    guesses: Vec<(D::Buffer<f32>, D::Buffer<f32>)>,
}

/// The rows of a band whose depths are picked: all but the first.
fn rows(sweep: &SweepBlock) -> Range<u32> {
    (sweep.row_count - 1).min(1)..sweep.row_count
}

/// See the module.
pub enum PickDepth {}

impl Case for PickDepth {
    const KERNEL: Kernel = Kernel::PickDepth;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    // Of the cameras it takes only where their pixels are.
    const SHAPES_ONLY: &'static [&'static str] = &["views"];
    const LIMITS: Limits = Limits { tolerance: 2.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis of costs, of the parabola through the least three and its quotient; \
        undecided where two planes cost the same to within it";
    const SPOILERS: &'static [Spoiler<Inputs>] = &[
        ("object", |inputs| inputs.world.object.radius *= 1.01),
        ("means", |inputs| {
            let means = inputs.bands.iter_mut().flat_map(|(_, means)| means);
            means.step_by(2).filter(|cost| **cost > 0.0).for_each(|cost| *cost *= 1.01);
        }),
        ("entries", |inputs| inputs.world.spoil_entries()),
        ("guess", |inputs| inputs.guesses[1].iter_mut().filter(|depth| **depth < NO_SURFACE).for_each(|d| *d *= 1.01)),
        ("parameters", |inputs| inputs.bands.iter_mut().for_each(|(sweep, _)| sweep.near *= 1.01)),
    ];

    type Inputs = Inputs;
    type Loaded<D: Device> = Loaded<D>;

    fn inputs(seed: u64, size: u32) -> Inputs {
        let world = World::of_size(seed, size);
        let numbers = &mut Numbers::new(seed);
        let band = |view| {
            let sweep = world.sweep(view);
            (sweep, costs(numbers, sweep.row_count * sweep.width, sweep.plane_count))
        };
        let bands = (0..world.object.view_count).map(band).collect();
        let guesses = [vec![NO_SURFACE; world.depths.len()], world.depths.clone()];
        Inputs { world, bands, guesses }
    }

    fn element_count(inputs: &Inputs) -> usize {
        let count = |(sweep, _): &(SweepBlock, Vec<f32>)| rows(sweep).len() * sweep.width as usize;
        2 * inputs.bands.iter().map(count).sum::<usize>()
    }

    fn load<D: Device>(device: &D, inputs: &Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let count = inputs.world.depths.len();
        let guess = |guess: &Vec<f32>| Ok::<_, DeviceError>((device.upload(guess)?, device.zeros(count)?));
        Ok(Loaded {
            scene: inputs.world.load(device)?,
            entries: device.upload(&inputs.world.entries)?,
            means: inputs.bands.iter().map(|(_, means)| device.upload(means)).collect::<Result<_, _>>()?,
            guesses: inputs.guesses.iter().map(guess).collect::<Result<_, _>>()?,
        })
    }

    fn run<D: Device>(device: &D, inputs: &Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let Loaded { scene, entries, means, guesses } = loaded;
        for (guess, picked) in guesses {
            for ((sweep, _), means) in inputs.bands.iter().zip(&*means) {
                let HullScene { object_buffer, views, .. } = &*scene;
                let (first, count) = (rows(sweep).start, rows(sweep).len() as u32);
                device.pick_depth(sweep, first, count, object_buffer, views, means, entries, guess, picked)?;
            }
        }
        Ok(())
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let maps: Vec<Vec<f32>> =
            loaded.guesses.iter().map(|(_, picked)| device.download(picked)).collect::<Result<_, _>>()?;
        Ok(maps.concat())
    }

    fn expected(inputs: &Inputs) -> Vec<Option<Bounded>> {
        let Inputs { world, bands, guesses } = inputs;
        let mut expected = Vec::new();
        for guess in guesses {
            // What no row covers stays as it was.
            let mut depths = vec![Some(Bounded::ZERO); world.depths.len()];
            for (sweep, means) in bands {
                let first = (world.views[sweep.view as usize].first_texel + sweep.first_row * sweep.width) as usize;
                let (entries, guess) = (&world.entries[first..], &guess[first..]);
                let pixels = rows(sweep).start * sweep.width..rows(sweep).end * sweep.width;
                let pick =
                    |pixel| hull_oracle::pick_depth(&world.object, sweep, sweep.width, means, entries, guess, pixel);
                let written = first + pixels.start as usize..first + pixels.end as usize;
                let picked = map(pixels.len(), 1, |index| pick(pixels.start + index as u32));
                depths[written].copy_from_slice(&picked);
            }
            expected.extend(depths);
        }
        expected
    }
}
