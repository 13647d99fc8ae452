//! [`Kernel::GatherVolume`] and [`Kernel::GatherVolumeF16`]: volumes of any size over images of any size, with points
//! inside, between the last nodes and the zeros around them, far outside and behind the camera; volumes of odd and even
//! numbers of features in half precision. A dispatch for each view gathers its part.

use super::half_precision::{packed, unpacked};
use super::*;
use crate::ray_inputs::{camera, point};
use crate::volume_oracle;

/// The views of a job, which gather into one array.
fn job(random: &mut Random, size: u32, [view_count, feature_count]: [u32; 2]) -> Vec<GatherVolume> {
    let views: Vec<CameraBlock> = (0..view_count).map(|_| camera(random)).collect();
    let point_count = size.div_ceil(feature_count);
    let points: Vec<RayPoint> = (0..point_count).map(|_| point(random, &views)).collect();
    let [height, width, depth_count] = [0, 1, 2].map(|_| [1, 2, 5, 16, 24][random.below(5)]);
    let near = random.range(0.5, 2.5);
    let far = (near + random.range(0.5, 2.0)) as f32;
    let node_count = (height * width * depth_count * feature_count) as usize;
    let of_view = |view| GatherVolume {
        block: VolumeBlock { view, point_count, feature_count, height, width, depth_count, near: near as f32, far },
        views: views.clone(),
        points: points.clone(),
        volume: numbers(node_count, || random.normal()),
        gathered: match view {
            0 => Output::Zeros((view_count * point_count * feature_count) as usize + 1),
            _ => Output::Continued,
        },
    };
    (0..view_count).map(of_view).collect()
}

/// Jobs with odd and even numbers of features.
fn jobs(random: &mut Random, size: u32) -> Vec<GatherVolume> {
    let kinds = [[1, 1], [2, 3], [3, 16], [1, 5], [2, 33], [1, 2]];
    kinds.into_iter().flat_map(|kind| job(random, size, kind)).collect()
}

impl Case for GatherVolume {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "errors of a projection and of the depth, in nodes, times the change of the volume \
        over a node; eight products; undecided where a point is on the view's plane to within rounding";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views.iter_mut().for_each(|view| view.intrinsics[0] *= 1.01)),
        ("points", |case| case.points.iter_mut().for_each(|point| point.position[1] *= 1.01)),
        // Of the first view.
        ("volume", |case| increase(case.volume.iter_mut().filter(|_| case.block.view == 0))),
        ("parameters", |case| case.block.near *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<GatherVolume> {
        jobs(&mut random(33, seed, size), size)
    }

    /// The gathered values, and behind the last view's a number that stays.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let GatherVolume { block, views, points, volume, .. } = self;
        let view = block.view as usize;
        let row = |point: usize| match volume_oracle::gather(&views[view], volume, &points[point], block) {
            Some(values) => values.into_iter().map(Some).collect(),
            None => vec![None; block.feature_count as usize],
        };
        let behind = (view + 1 == views.len()).then_some(Some(Bounded::ZERO));
        map(points.len(), 1, row).into_iter().flatten().chain(behind).collect()
    }
}

impl Case for GatherVolumeF16 {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = GatherVolume::LIMITS;
    const REASON: &'static str = "as gather_volume: numbers in half precision are read exactly";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views.iter_mut().for_each(|view| view.intrinsics[0] *= 1.01)),
        ("points", |case| case.points.iter_mut().for_each(|point| point.position[1] *= 1.01)),
        // Of the first view.
        ("volume", |case| {
            if case.block.view == 0 {
                half_precision::increase_packed(&mut case.volume)
            }
        }),
        ("parameters", |case| case.block.near *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<GatherVolumeF16> {
        let half = |GatherVolume { block, views, points, volume, gathered }| GatherVolumeF16 {
            block,
            views,
            points,
            volume: packed(&volume),
            gathered,
        };
        jobs(&mut random(42, seed, size), size).into_iter().map(half).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let GatherVolumeF16 { block, views, points, volume, gathered } = self.clone();
        GatherVolume { block, views, points, volume: unpacked(&volume), gathered }.expected()
    }
}
