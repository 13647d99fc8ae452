//! Kernels of the plane sweep, on a frustum about as large as the training-free field's.

use super::{Operations, Work};
use crate::dispatch::*;
use crate::swept::{Swept, band, costs, opacities};
use crate::world::Numbers;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::plane_sweep::front::FrontBlock;
use viewfuse_kernels::plane_sweep::path::DIRECTIONS;
use viewfuse_kernels::plane_sweep::window::WindowBlock;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// Groups of planes of all pixels together.
const GROUPS: u32 = 24_000;
/// A seed whose frustum has photographs and three groups of planes.
const SEED: u64 = 2;

pub(super) fn works<D: Device>(device: &D) -> Result<Vec<Work<'_>>, DeviceError> {
    let swept = Swept::new(SEED, GROUPS);
    let volume = swept.volume();
    let group_count = (volume.width * volume.height * volume.group_count) as usize;
    let band_len = swept.band_len();
    let numbers = &mut Numbers::new(SEED);
    let (grey, evidence) = band(numbers, &swept);
    let single = costs(numbers, &volume);
    let Swept { frustum, views, pairs, texels, disparities } = swept;
    let size = format!("{}x{}, {} planes", volume.width, volume.height, 16 * volume.group_count);
    let of_views = format!("{size}, {} views", views.len());
    let texel_bytes = 16.0 * texels.len() as f64 + 8.0 * disparities.len() as f64;
    let bytes = |group_count: usize| (size_of::<Planes>() * group_count) as f64;
    let census = CensusCost {
        block: frustum,
        first_row: 0,
        row_count: frustum.row_count,
        pairs: pairs.clone(),
        grey,
        evidence,
        costs: Output::Zeros(2 * group_count),
    };
    let look_ups = (views.len() * PLANES * group_count) as f64;
    // Of each plane and each of the twelve pixels of half a census window: of a view a difference, a product, two
    // limits and an amount; of a pair a difference, its amount, a limit, a greater one, two products and three sums.
    let comparisons = (12 * (5 * views.len() + 9 * pairs.len()) * PLANES * group_count) as f64;
    // Of a plane and a view: 19 of the projection, 23 of support and free space. Not counted: that three of them are
    // divisions, and that each look-up of 8 bytes is a scattered load of its own.
    let opacity_operations = 42.0 * look_ups;
    let census_bytes = bytes((views.len() + 4 + 2) * band_len);
    let compare_bytes = texel_bytes + bytes((views.len() + 4) * band_len);
    let grey = Output::Zeros(views.len() * band_len);
    let evidence = Output::Zeros(4 * band_len);
    let opacity = PlaneOpacity {
        block: frustum,
        views: views.clone(),
        disparities: disparities.clone(),
        opacities: Output::Zeros(group_count),
    };
    let front = FrontCost {
        block: FrontBlock {
            width: volume.width,
            height: volume.height,
            group_count: volume.group_count,
            front_share: 0.1,
        },
        opacities: opacities(numbers, &volume),
        means: single.clone(),
        costs: Output::Zeros(group_count),
    };
    let opacity_bytes = 8.0 * disparities.len() as f64 + bytes(group_count);
    let compare = CompareViews { block: frustum, views, pairs, texels, disparities, grey, evidence };
    let block = WindowBlock::new(&frustum, 0.01);
    let costs = single.iter().flat_map(|cost| [*cost; 2]).collect();
    let rows = RowSums { block, costs, sums: Output::Zeros(6 * group_count) };
    let sums = single.iter().flat_map(|cost| [*cost; 6]).collect();
    let window = WindowCost { block, sums, means: Output::Zeros(group_count) };
    let directions = DIRECTIONS as usize;
    let follow = FollowPaths { block: volume, means: single, paths: Output::Zeros(directions * group_count) };
    Ok(vec![
        Work::new(device, compare, of_views.clone(), Operations::LookUps(look_ups), compare_bytes)?,
        Work::new(device, census, of_views.clone(), Operations::Single(comparisons), census_bytes)?,
        Work::new(device, opacity, of_views, Operations::Single(opacity_operations), opacity_bytes)?,
        Work::new(device, front, size.clone(), Operations::Uncounted, bytes(3 * group_count))?,
        Work::new(device, rows, size.clone(), Operations::Uncounted, bytes(8 * group_count))?,
        Work::new(device, window, size.clone(), Operations::Uncounted, bytes(7 * group_count))?,
        Work::new(device, follow, size, Operations::Uncounted, bytes((1 + directions) * group_count))?,
    ])
}
