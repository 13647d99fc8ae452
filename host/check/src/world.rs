//! Small random worlds for kernels: cameras of unequal sizes around a box, smooth blobs for pictures, depths of a ball
//! with dents and holes.

use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_core::random::uniform;
use viewfuse_kernels::visual_hull::sweep::{OUTSIDE, SweepBlock};
use viewfuse_kernels::visual_hull::{NO_SURFACE, ObjectBlock};

/// The kernels' inputs.
#[derive(Clone, Debug)]
pub struct World {
    /// The box.
    pub object: ObjectBlock,
    /// Four to six cameras around it.
    pub views: Vec<CameraBlock>,
    /// `[view]`: a pixel's side at the middle of the box.
    pub footprints: Vec<f32>,
    /// `[view][row][column]`: premultiplied RGBA.
    pub texels: Vec<[f32; 4]>,
    /// `[view][row][column]`: depths of surfaces.
    pub depths: Vec<f32>,
    /// `[view][row][column]`: depths of entry into the hull: somewhat in front of the surfaces.
    pub entries: Vec<f32>,
    /// `[view]`: for a target.
    pub weights: Vec<f32>,
    /// `[view][other]`.
    pub pair_weights: Vec<f32>,
    /// A target camera.
    pub target: CameraBlock,
}

/// Random numbers in an interval, one after another.
#[derive(Clone, Debug)]
pub struct Numbers {
    seed: u64,
    next: u32,
}

impl Numbers {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Numbers {
        Numbers { seed, next: 0 }
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        self.next += 1;
        low + (high - low) * uniform(self.seed, self.next, 77)
    }
}

/// A camera on a wobbly ring. It is valid for all random draws.
fn camera(numbers: &mut Numbers, index: usize, size: [u32; 2]) -> Camera {
    let azimuth = 1.1 * index as f32 + numbers.between(-0.2, 0.2);
    let distance = numbers.between(2.2, 2.8);
    let centre = Vec3::new(azimuth.cos(), azimuth.sin(), numbers.between(-0.5, 0.9)) * distance;
    let aim = Vec3::new(numbers.between(-0.1, 0.1), numbers.between(-0.1, 0.1), numbers.between(-0.1, 0.1));
    let [width, height] = size.map(|side| side as f32);
    let focal = [1.2 * width * numbers.between(0.95, 1.05), 1.2 * width * numbers.between(0.95, 1.05)];
    let principal = [0.5 * width + numbers.between(-1.0, 1.0), 0.5 * height + numbers.between(-1.0, 1.0)];
    let pinhole = Pinhole::new(focal, principal, size[0], size[1]).expect("sound intrinsics");
    Camera { pose: Pose::look_at(centre, aim, Vec3::Z).expect("a camera off the pole"), pinhole }
}

/// Width and height of an image of about `size` pixels.
fn image_size(size: u32) -> [u32; 2] {
    let width = f64::from(size).sqrt().ceil() as u32;
    [width, size.div_ceil(width)]
}

impl World {
    /// The world of a seed, with images of about 500 pixels.
    pub fn new(seed: u64) -> World {
        World::of_size(seed, 500)
    }

    /// The world of a seed, with images of about `size` pixels, at least 1.
    ///
    /// # Panics
    /// Never: cameras stand off the pole, intrinsics are sound.
    pub fn of_size(seed: u64, size: u32) -> World {
        let numbers = &mut Numbers::new(seed);
        let view_count = 4 + (seed % 3) as usize;
        let corner = |numbers: &mut Numbers| {
            Vec3::new(numbers.between(0.6, 0.8), numbers.between(0.6, 0.8), numbers.between(0.6, 0.8))
        };
        let object = ObjectBlock::new(-corner(numbers), corner(numbers), view_count as u32);
        let mut world = World {
            object,
            views: Vec::new(),
            footprints: Vec::new(),
            texels: Vec::new(),
            depths: Vec::new(),
            entries: Vec::new(),
            weights: Vec::new(),
            pair_weights: Vec::new(),
            target: camera(numbers, 17, image_size(size.div_ceil(2))).block(0),
        };
        for index in 0..view_count {
            let [width, height] = image_size(size);
            let size = [width + width / 7 * (index as u32 % 3), height + height / 10 * (index as u32 % 4)];
            let block = camera(numbers, index, size).block(world.texels.len() as u32);
            world.footprints.push(block.project(object.middle()).depth / block.intrinsics[0]);
            world.views.push(block);
            world.paint(numbers, &block);
        }
        world.weights = simplex(numbers, view_count, None);
        world.pair_weights = (0..view_count).flat_map(|view| simplex(numbers, view_count, Some(view))).collect();
        world
    }

    fn paint(&mut self, numbers: &mut Numbers, block: &CameraBlock) {
        let middle = block.project(self.object.middle());
        let radius = 0.28 * block.width as f32;
        let waves: Vec<[f32; 3]> = (0..3)
            .map(|_| [numbers.between(-0.5, 0.5), numbers.between(-0.5, 0.5), numbers.between(0.0, 6.0)])
            .collect();
        let lobes = numbers.between(0.0, 6.0);
        for row in 0..block.height {
            for column in 0..block.width {
                let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
                let (across, below) = (x - middle.x, y - middle.y);
                let distance = across.hypot(below);
                let rim = radius * (1.0 + 0.1 * (3.0 * below.atan2(across) + lobes).sin());
                let alpha = ((rim - distance) / 3.0 + 0.5).clamp(0.0, 1.0) * numbers.between(0.9, 1.0);
                let colour = [0, 1, 2].map(|c| 0.5 + 0.4 * (waves[c][0] * x + waves[c][1] * y + waves[c][2]).sin());
                self.texels.push([colour[0] * alpha, colour[1] * alpha, colour[2] * alpha, alpha]);
                let bulge = (1.0 - (distance / rim).min(1.0).powi(2)).sqrt() * 0.55;
                let step = if across + below > 4.0 { 0.35 } else { 0.0 };
                let hole = distance > rim + 1.0 || numbers.between(0.0, 1.0) < 0.01;
                let depth = middle.depth - bulge + step + numbers.between(-0.01, 0.01);
                self.depths.push(if hole { NO_SURFACE } else { depth });
                self.entries.push(if hole { NO_SURFACE } else { depth - numbers.between(0.0, 0.2) });
            }
        }
    }

    /// Some rows of a view's sweep; all of a small view's.
    pub fn sweep(&self, view: u32) -> SweepBlock {
        let whole = SweepBlock::new(&self.object, &self.views[view as usize], view);
        if whole.row_count < 10 { whole } else { SweepBlock { first_row: 3, row_count: whole.row_count - 5, ..whole } }
    }
}

/// Changes red and alpha by 1 %, in opposite directions: equal changes would not change the colour.
pub fn change_texels(texels: &mut [[f32; 4]]) {
    for [red, _, _, alpha] in texels {
        (*red, *alpha) = (*red * 1.01, *alpha * 0.99);
    }
}

/// Changes the depths of surfaces by 1 %.
pub fn change_depths(depths: &mut [f32]) {
    depths.iter_mut().filter(|depth| **depth < NO_SURFACE).for_each(|depth| *depth *= 1.01);
}

/// Random weights that sum to 1; one of them, and that of `own`, is 0.
fn simplex(numbers: &mut Numbers, count: usize, single: Option<usize>) -> Vec<f32> {
    let mut weights: Vec<f32> = (0..count).map(|_| numbers.between(0.05, 1.0)).collect();
    let zero = single.map_or(count - 1, |single| (single + 2) % count);
    weights[zero] = 0.0;
    if let Some(single) = single {
        weights[single] = 0.0;
    }
    let sum: f32 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

/// `[pixel][plane]`: costs of a plausible sweep: smooth with a valley, a quarter of them outside the hull.
pub fn costs(numbers: &mut Numbers, pixel_count: u32, plane_count: u32) -> Vec<f32> {
    let mut costs = Vec::new();
    for _ in 0..pixel_count {
        let valley = numbers.between(0.0, plane_count as f32);
        for plane in 0..plane_count {
            let away = (plane as f32 - valley) / plane_count as f32;
            let cost = 0.02 + 0.15 * away.abs() + numbers.between(0.0, 0.01);
            costs.push(if numbers.between(0.0, 1.0) < 0.25 { OUTSIDE } else { cost });
        }
    }
    costs
}
