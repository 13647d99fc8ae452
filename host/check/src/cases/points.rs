//! [`Kernel::EmbedPoints`], [`Kernel::VisibleWeights`] and [`Kernel::Radiance`]: points around the origin and beyond,
//! seen by 1 to 32 views, some of which have them behind.

use super::*;
use crate::point_oracle;
use crate::ray_inputs::{camera, point};

/// The numbers of views and points.
fn views_and_points(random: &mut Random, view_count: u32, point_count: u32) -> (Vec<CameraBlock>, Vec<RayPoint>) {
    let views: Vec<CameraBlock> = (0..view_count).map(|_| camera(random)).collect();
    let points = (0..point_count).map(|_| point(random, &views)).collect();
    (views, points)
}

fn move_points(points: &mut [RayPoint]) {
    points.iter_mut().for_each(|point| point.position[0] *= 1.01);
}

impl Case for EmbedPoints {
    const LIMITS: Limits = Limits { tolerance: 1.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "a rotation: three products and their sum; an angle is its product with up to 48, a \
        sine adds 9e-8";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views[0].pose.right[0] *= 1.01),
        ("points", |case| move_points(&mut case.points)),
        ("parameters", |case| case.block.frequency *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<EmbedPoints> {
        let random = &mut random(13, seed, size);
        let dispatch = |(view_count, frequency_count): (u32, u32)| {
            let point_count = size.div_ceil(4 * view_count);
            let (views, mut points) = views_and_points(random, view_count, point_count);
            // Angles stay below 8192, and their errors say something.
            for point in &mut points {
                point.position = point.position.map(|coordinate| coordinate.clamp(-4.0, 4.0));
            }
            let block = EmbedBlock { point_count, frequency_count, frequency: 1.5 };
            let embedded = Output::Zeros((view_count * point_count * block.row_len()) as usize + 1);
            EmbedPoints { block, view_count, views, points, embedded }
        };
        [(1, 6), (2, 1), (3, 0), (32, 6)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let of_view =
            |view| map(self.points.len(), 1, |point| point_oracle::embed(view, &self.points[point], &self.block));
        decided(self.views.iter().flat_map(of_view).flatten(), 1)
    }
}

impl Case for VisibleWeights {
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-3 };
    const REASON: &'static str = "a sum over views and a division by it; undecided where a point is on a view's plane \
        to within a rotation's rounding";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views.iter_mut().for_each(|view| view.pose.right[3] *= 1.01)),
        ("weights", |case| case.weights[0] *= 1.01),
        ("points", |case| move_points(&mut case.points)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<VisibleWeights> {
        let random = &mut random(14, seed, size);
        let dispatch = |view_count: u32| {
            let (views, points) = views_and_points(random, view_count, size);
            // Some views count for nothing: where only they see a point, the weights stay as they are.
            let mut weights = numbers(views.len(), || random.range(0.1, 1.0));
            weights.iter_mut().step_by(3).skip(1).for_each(|weight| *weight = 0.0);
            let sum: f32 = weights.iter().sum();
            weights.iter_mut().for_each(|weight| *weight /= sum);
            let visible = Output::Zeros((view_count * size) as usize);
            VisibleWeights { view_count, point_count: size, views, weights, points, visible }
        };
        [1, 2, 5, 32].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let row = |point: usize| point_oracle::visible_weights(&self.views, &self.weights, &self.points[point]);
        map(self.points.len(), 16, row).into_iter().flatten().collect()
    }
}

/// Samples of which a point is the place of at most one.
fn sample_count(point_count: u32) -> usize {
    2 * point_count as usize + 1
}

impl Case for Radiance {
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "2 ULP of the exponential, an addition and a division; a product";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("raw", |case| increase(&mut case.raw)),
        ("points", |case| case.points.iter_mut().for_each(|point| point.length *= 1.01)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<Radiance> {
        let random = &mut random(15, seed, size);
        let (mut raw, mut points) = (Vec::new(), Vec::new());
        let view = camera(random);
        for index in 0..size {
            let scale = [1.0, 5.0, 100.0, 1.0e30][random.below(4)];
            raw.extend(numbers(4, || scale * random.normal()));
            // So that the largest densities stay within what can be compared.
            let length = random.log_range(1.0e-3, 1.0) / scale;
            // Some samples have no point, and the others come in another order.
            let sample = 2 * (size - 1 - index) + random.below(2) as u32;
            points.push(RayPoint { length: length as f32, sample, ..point(random, &[view]) });
        }
        vec![Radiance { point_count: size, raw, points, samples: Output::Zeros(sample_count(size)) }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let mut samples = vec![[Bounded::ZERO; 4]; sample_count(self.point_count)];
        for (raw, point) in self.raw.chunks_exact(4).zip(&self.points) {
            samples[point.sample as usize] = point_oracle::radiance(raw, point.length);
        }
        decided(samples.into_iter().flatten(), 0)
    }
}
