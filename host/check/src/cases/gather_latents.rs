//! [`Kernel::GatherLatents`] and [`Kernel::GatherLatentsF16`]: grids of any size under images of any size, with points
//! inside, at borders, far outside and behind the camera; grids of odd and even numbers of channels in half precision.
//! A dispatch for each view gathers its part.

use super::half_precision::{packed, unpacked};
use super::*;
use crate::point_oracle;
use crate::ray_inputs::{camera, point};

/// The views of a job, which gather into one array.
fn job(random: &mut Random, size: u32, index: usize, [view_count, channel_count]: [u32; 2]) -> Vec<GatherLatents> {
    let views: Vec<CameraBlock> = (0..view_count).map(|_| camera(random)).collect();
    let point_count = size.div_ceil(channel_count);
    let points: Vec<RayPoint> = (0..point_count).map(|_| point(random, &views)).collect();
    let [height, width] = [0, 1].map(|_| [1, 2, 5, 16, 64][random.below(5)]);
    let pixel_centre = [0.5, 0.0][index % 2];
    let block = GatherBlock { point_count, channel_count, height, width, pixel_centre, ..GatherBlock::default() };
    let node_count = (height * width * channel_count) as usize;
    let grids: Vec<_> = views.iter().map(|_| numbers(node_count, || random.normal())).collect();
    let count = (view_count * point_count * channel_count) as usize;
    let residual = (index % 4 < 2).then(|| numbers(count, || random.normal()));
    let of_view = |(view, grid)| GatherLatents {
        block: GatherBlock { view, ..block },
        views: views.clone(),
        points: points.clone(),
        grid,
        residual: residual.clone(),
        gathered: if view == 0 { Output::Zeros(count) } else { Output::Continued },
    };
    (0..).zip(grids).map(of_view).collect()
}

/// Jobs with odd and even numbers of channels.
fn jobs(random: &mut Random, size: u32) -> Vec<GatherLatents> {
    let kinds = [[1, 1], [2, 3], [3, 64], [1, 5], [2, 65], [1, 2], [4, 16], [2, 1]];
    kinds.into_iter().enumerate().flat_map(|(index, kind)| job(random, size, index, kind)).collect()
}

impl Case for GatherLatents {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "errors of a projection, in pixels, times the change of the grid over a node; two \
        mixtures; undecided where a point is on the view's plane to within rounding";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views.iter_mut().for_each(|view| view.intrinsics[0] *= 1.01)),
        ("points", |case| case.points.iter_mut().for_each(|point| point.position[1] *= 1.01)),
        // Of the first view.
        ("grid", |case| increase(case.grid.iter_mut().filter(|_| case.block.view == 0))),
        ("residual", |case| increase(case.residual.iter_mut().flatten())),
        ("parameters", |case| case.block.pixel_centre *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<GatherLatents> {
        jobs(&mut random(16, seed, size), size)
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let GatherLatents { block, views, points, grid, residual, .. } = self;
        let (view, channels) = (block.view as usize, block.channel_count as usize);
        let row = |point: usize| match point_oracle::gather(&views[view], grid, &points[point], block) {
            Some(values) => values.into_iter().map(Some).collect(),
            None => vec![None; channels],
        };
        let mut gathered = map(points.len(), 1, row).concat();
        if let Some(residual) = residual {
            let residuals = &residual[view * gathered.len()..];
            let with = |(value, residual): (&mut Option<Bounded>, &f32)| {
                *value = value.map(|value| value + Bounded::from(*residual));
            };
            gathered.iter_mut().zip(residuals).for_each(with);
        }
        gathered
    }
}

impl Case for GatherLatentsF16 {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = GatherLatents::LIMITS;
    const REASON: &'static str = "as gather_latents: numbers in half precision are read exactly";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views.iter_mut().for_each(|view| view.intrinsics[0] *= 1.01)),
        ("points", |case| case.points.iter_mut().for_each(|point| point.position[1] *= 1.01)),
        // Of the first view.
        ("grid", |case| {
            if case.block.view == 0 {
                half_precision::increase_packed(&mut case.grid)
            }
        }),
        ("residual", |case| increase(case.residual.iter_mut().flatten())),
        ("parameters", |case| case.block.pixel_centre *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<GatherLatentsF16> {
        let half = |GatherLatents { block, views, points, grid, residual, gathered }| {
            // With a number behind the last.
            let gathered = match gathered {
                Output::Zeros(count) => Output::Zeros(count + 1),
                other => other,
            };
            GatherLatentsF16 { block, views, points, grid: packed(&grid), residual, gathered }
        };
        jobs(&mut random(43, seed, size), size).into_iter().map(half).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let GatherLatentsF16 { block, views, points, grid, residual, gathered } = self.clone();
        let behind = (block.view as usize + 1 == views.len()).then_some(Some(Bounded::ZERO));
        let single = GatherLatents { block, views, points, grid: unpacked(&grid), residual, gathered };
        single.expected().into_iter().chain(behind).collect()
    }
}
