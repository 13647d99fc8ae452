//! Small random worlds for kernels: cameras of unequal sizes around a box, smooth blobs for pictures, depths of a ball
//! with dents and holes.

use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::photo::{NO_SURFACE, ObjectBlock};
use viewfuse_core::pose::Pose;
use viewfuse_core::random::uniform;
use viewfuse_tests::bounded::Bounded;
use viewfuse_tests::photo_oracle::Scene;

/// What kernels read.
#[derive(Clone)]
pub(crate) struct World {
    pub(crate) object: ObjectBlock,
    pub(crate) views: Vec<CameraBlock>,
    pub(crate) footprints: Vec<f32>,
    pub(crate) texels: Vec<[f32; 4]>,
    /// Depths of surfaces.
    pub(crate) depths: Vec<f32>,
    /// Depths of entry into the hull: somewhat in front of the surfaces.
    pub(crate) entries: Vec<f32>,
    /// For a target.
    pub(crate) weights: Vec<f32>,
    /// `[view][other]`.
    pub(crate) pair_weights: Vec<f32>,
    pub(crate) target: CameraBlock,
}

/// Random numbers in an interval, one after another.
pub(crate) struct Numbers {
    seed: u64,
    next: u32,
}

impl Numbers {
    pub(crate) fn new(seed: u64) -> Numbers {
        Numbers { seed, next: 0 }
    }

    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        self.next += 1;
        low + (high - low) * uniform(self.seed, self.next, 77)
    }
}

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

impl World {
    pub(crate) fn new(seed: u64) -> World {
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
            target: camera(numbers, 17, [14, 12]).block(0),
        };
        for index in 0..view_count {
            let size = [22 + 3 * (index as u32 % 3), 20 + 2 * (index as u32 % 4)];
            let block = camera(numbers, index, size).block(world.texels.len() as u32);
            world.footprints.push(block.project(object.middle()).depth / block.intrinsics[0]);
            world.views.push(block);
            world.paint(numbers, &block);
        }
        world.weights = simplex(numbers, view_count, None);
        world.pair_weights = (0..view_count).flat_map(|own| simplex(numbers, view_count, Some(own))).collect();
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

    /// The same for the oracle.
    pub(crate) fn scene(&self) -> Scene<'_> {
        Scene { object: &self.object, views: &self.views, texels: &self.texels }
    }

    /// Some rows of a view's sweep.
    pub(crate) fn sweep(&self, view: u32) -> SweepBlock {
        let whole = SweepBlock::new(&self.object, &self.views[view as usize], view);
        SweepBlock { first_row: 3, row_count: whole.row_count - 5, ..whole }
    }

    /// Points all over the box and a little around it.
    pub(crate) fn points(&self, count: u32) -> Vec<Vec3> {
        let numbers = &mut Numbers::new(99);
        (0..count)
            .map(|_| Vec3::new(numbers.between(-0.8, 0.8), numbers.between(-0.8, 0.8), numbers.between(-0.8, 0.8)))
            .collect()
    }
}

/// Random weights that sum to 1; one of them, and that of `own`, is 0.
fn simplex(numbers: &mut Numbers, count: usize, own: Option<usize>) -> Vec<f32> {
    let mut weights: Vec<f32> = (0..count).map(|_| numbers.between(0.05, 1.0)).collect();
    let zero = own.map_or(count - 1, |own| (own + 2) % count);
    weights[zero] = 0.0;
    if let Some(own) = own {
        weights[own] = 0.0;
    }
    let sum: f32 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

/// What a kernel computed and what was expected.
#[derive(Default)]
pub(crate) struct Results {
    pub(crate) actual: Vec<f32>,
    pub(crate) expected: Vec<Option<Bounded>>,
}

impl Results {
    pub(crate) fn push(&mut self, actual: f32, expected: Option<Bounded>) {
        self.actual.push(actual);
        self.expected.push(expected);
    }
}
