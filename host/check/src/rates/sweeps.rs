//! Kernels of the plane sweep, on a frustum about as large as the training-free field's.

use super::Work;
use crate::swept::{Swept, band, costs};
use crate::world::Numbers;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::path::DIRECTIONS;
use viewfuse_kernels::plane_sweep::window::WindowBlock;
use viewfuse_vulkan::kernel::Kernel;

/// Groups of planes of all pixels together.
const GROUPS: u32 = 24_000;
/// A seed whose frustum has photographs and three groups of planes.
const SEED: u64 = 2;
/// Bytes of a group.
const GROUP: f64 = size_of::<Planes>() as f64;

pub(super) fn works<D: Device>(device: &D) -> Result<Vec<Work<'_>>, DeviceError> {
    let swept = Swept::new(SEED, GROUPS);
    let volume = swept.volume();
    let group_count = (volume.width * volume.height * volume.group_count) as usize;
    let (band_len, view_count) = (swept.band_len(), swept.views.len());
    let (frustum, views) = (swept.frustum, swept.views.len());
    let size = format!("{}x{}, {} planes", volume.width, volume.height, 16 * volume.group_count);
    let seen = format!("{size}, {views} views");
    let numbers = &mut Numbers::new(SEED);
    let (grey, evidence) = band(numbers, &swept);
    let loaded = swept.load(device)?;
    let texel_bytes = 16.0 * swept.texels.len() as f64 + 8.0 * swept.disparities.len() as f64;
    let (mut grey_out, mut evidence_out) =
        (device.zeros::<Planes>(view_count * band_len)?, device.zeros::<Planes>(4 * band_len)?);
    let compare = Work {
        kernel: Kernel::CompareViews,
        size: seen.clone(),
        operations: None,
        bytes: texel_bytes + GROUP * ((view_count + 4) * band_len) as f64,
        run: Box::new(move || {
            device.compare_views(
                &frustum,
                &loaded.views,
                &loaded.pairs,
                &loaded.texels,
                &loaded.disparities,
                &mut grey_out,
                &mut evidence_out,
            )
        }),
    };
    let (grey, evidence, pairs) = (device.upload(&grey)?, device.upload(&evidence)?, device.upload(&swept.pairs)?);
    let mut weighted = device.zeros::<Planes>(2 * group_count)?;
    let census = Work {
        kernel: Kernel::CensusCost,
        size: seen,
        operations: None,
        bytes: GROUP * ((view_count + 4 + 2) * band_len) as f64,
        run: Box::new(move || {
            device.census_cost(&frustum, 0, frustum.row_count, &pairs, &grey, &evidence, &mut weighted)
        }),
    };
    let single = costs(numbers, &volume);
    let doubled: Vec<Planes> = single.iter().flat_map(|cost| [*cost, *cost]).collect();
    let windows = WindowBlock::new(&frustum, 0.01);
    let (given, mut sums) = (device.upload(&doubled)?, device.zeros::<Planes>(6 * group_count)?);
    let rows = Work {
        kernel: Kernel::RowSums,
        size: size.clone(),
        operations: None,
        bytes: GROUP * (8 * group_count) as f64,
        run: Box::new(move || device.row_sums(&windows, &given, &mut sums)),
    };
    let sixfold: Vec<Planes> = single.iter().flat_map(|cost| [*cost; 6]).collect();
    let (sums, mut means) = (device.upload(&sixfold)?, device.zeros::<Planes>(group_count)?);
    let window = Work {
        kernel: Kernel::WindowCost,
        size: size.clone(),
        operations: None,
        bytes: GROUP * (7 * group_count) as f64,
        run: Box::new(move || device.window_cost(&windows, &sums, &mut means)),
    };
    let directions = DIRECTIONS as usize;
    let (means, mut paths) = (device.upload(&single)?, device.zeros::<Planes>(directions * group_count)?);
    let follow = Work {
        kernel: Kernel::FollowPaths,
        size,
        operations: None,
        bytes: GROUP * ((1 + directions) * group_count) as f64,
        run: Box::new(move || device.follow_paths(&volume, &means, &mut paths)),
    };
    Ok(vec![compare, census, rows, window, follow])
}
