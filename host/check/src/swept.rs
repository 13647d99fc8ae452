//! Small random frusta with views around them, for the kernels of the plane sweep.

use super::world::{Numbers, World};
use viewfuse_kernels::plane_sweep::blend::BlendBlock;
use viewfuse_kernels::plane_sweep::evidence::{UNSEEN, ViewPair};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::path::CostBlock;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};
use viewfuse_kernels::visual_hull::NO_SURFACE;

/// The common inputs.
#[derive(Clone, Debug)]
pub struct Swept {
    /// The frustum of a target; a band of all rows but the first.
    pub frustum: FrustumBlock,
    /// Four to six views.
    pub views: Vec<SweptView>,
    /// All pairs of them.
    pub pairs: Vec<ViewPair>,
    /// `[view][row][column]`: premultiplied RGBA.
    pub texels: Vec<[f32; 4]>,
    /// `[view][row][column]`: disparity and confidence.
    pub disparities: Vec<[f32; 2]>,
}

impl Swept {
    /// The frustum of a seed, with about `size` groups of planes in all. Every other seed has photographs in the place
    /// of silhouettes and a view without a map; every fourth has its farthest plane infinitely far away.
    pub fn new(seed: u64, size: u32) -> Swept {
        let numbers = &mut Numbers::new(seed ^ 0x5eed);
        let group_count = 1 + (seed % 3) as u32;
        let world = World::of_size(seed, (2 * size / group_count).max(1));
        let has_silhouettes = seed % 2 == 1;
        let (camera, plane_count) = (world.target, group_count * PLANES as u32);
        let far_disparity = if seed.is_multiple_of(4) { 0.0 } else { numbers.between(0.25, 0.3) };
        let disparity_step = (0.7 - far_disparity) / plane_count as f32;
        let first_row = u32::from(camera.height > 1);
        let texels = if has_silhouettes { world.texels.clone() } else { photographs(numbers, &world) };
        let view_of = |(index, camera)| SweptView {
            camera,
            gain: [numbers.between(0.9, 1.0), numbers.between(0.9, 1.0), numbers.between(0.9, 1.0), 0.0],
            weight: world.weights[index],
            disparity_step: if index == 0 && !has_silhouettes { 0.0 } else { numbers.between(0.01, 0.03) },
            first_disparity: camera.first_texel,
            map_width: camera.width,
            map_height: camera.height,
            padding: [0; 3],
        };
        let views: Vec<SweptView> = world.views.iter().copied().enumerate().map(view_of).collect();
        let disparity_of = |depth: &f32| match *depth {
            depth if depth < NO_SURFACE => [1.0 / depth, numbers.between(0.3, 1.0)],
            _ => [numbers.between(0.25, 0.7), numbers.between(0.0, 0.3)],
        };
        let disparities = world.depths.iter().map(disparity_of).collect();
        let pairs = pairs(&views);
        let frustum = FrustumBlock {
            camera,
            far_disparity,
            disparity_step,
            group_count,
            view_count: views.len() as u32,
            pair_count: pairs.len() as u32,
            has_silhouettes: has_silhouettes.into(),
            dissent_share: 0.0625,
            first_row,
            row_count: camera.height - first_row,
        };
        Swept { frustum, views, pairs, texels, disparities }
    }

    /// Groups of planes of the band.
    pub fn band_len(&self) -> usize {
        (self.frustum.camera.width * self.frustum.row_count * self.frustum.group_count) as usize
    }

    /// A volume of costs of the whole frustum.
    pub fn volume(&self) -> CostBlock {
        let FrustumBlock { camera, group_count, .. } = self.frustum;
        CostBlock { width: camera.width, height: camera.height, group_count, padding: 0 }
    }

    /// A target picture from a volume of half its size, with maps of about half the views' size.
    pub fn halved(mut self, volume: &CostBlock) -> (Swept, BlendBlock) {
        let mut disparities = Vec::new();
        for view in &mut self.views {
            let (width, height) = (view.map_width.div_ceil(2), view.map_height.div_ceil(2));
            let first = disparities.len() as u32;
            for pixel in 0..width * height {
                let (row, column) = (pixel / width * 2, pixel % width * 2);
                let place = row * view.map_width + column;
                disparities.push(self.disparities[(view.first_disparity + place) as usize]);
            }
            (view.first_disparity, view.map_width, view.map_height) = (first, width, height);
        }
        let FrustumBlock { camera, far_disparity, disparity_step, view_count, has_silhouettes, .. } = self.frustum;
        let block = BlendBlock {
            target: camera,
            far_disparity,
            disparity_step,
            volume_width: volume.width,
            volume_height: volume.height,
            group_count: volume.group_count,
            view_count,
            sharpness: 125.0,
            has_silhouettes,
        };
        (Swept { disparities, ..self }, block)
    }
}

/// Smooth waves, transparent in a corner.
fn photographs(numbers: &mut Numbers, world: &World) -> Vec<[f32; 4]> {
    let mut texels = Vec::new();
    for camera in &world.views {
        let waves = [0; 3].map(|_| [numbers.between(-0.4, 0.4), numbers.between(-0.4, 0.4), numbers.between(0.0, 6.0)]);
        for pixel in 0..camera.width * camera.height {
            let (x, y) = ((pixel % camera.width) as f32, (pixel / camera.width) as f32);
            let alpha = if x + y < 0.25 * camera.width as f32 { 0.0 } else { 1.0 };
            let [red, green, blue] =
                waves.map(|[across, below, phase]| 0.5 + 0.4 * (across * x + below * y + phase).sin());
            texels.push([red * alpha, green * alpha, blue * alpha, alpha]);
        }
    }
    texels
}

/// All pairs with the products of their weights, over the sum of those.
fn pairs(views: &[SweptView]) -> Vec<ViewPair> {
    let mut pairs = Vec::new();
    for (second, b) in views.iter().enumerate() {
        for (first, a) in views[..second].iter().enumerate() {
            let (first, second) = (first as u32, second as u32);
            pairs.push(ViewPair { first, second, weight: a.weight * b.weight, padding: 0 });
        }
    }
    let all: f32 = pairs.iter().map(|pair| pair.weight).sum();
    pairs.iter_mut().for_each(|pair| pair.weight /= all);
    pairs
}

/// `[row][column][group]`: costs with a valley that bends over the image, of unequal depth.
pub fn costs(numbers: &mut Numbers, volume: &CostBlock) -> Vec<Planes> {
    let plane_count = (volume.group_count * PLANES as u32) as f32;
    let phases = [0; 3].map(|_| numbers.between(0.0, 6.0));
    let mut costs = Vec::new();
    for pixel in 0..volume.width * volume.height {
        let (x, y) = ((pixel % volume.width) as f32, (pixel / volume.width) as f32);
        let valley = plane_count * (0.5 + 0.35 * (0.21 * x + phases[0]).sin() * (0.17 * y + phases[1]).cos());
        let bottom = 0.15 + 0.12 * (0.1 * (x + y) + phases[2]).sin();
        for group in 0..volume.group_count as usize {
            costs.push(std::array::from_fn(|plane| {
                let away = ((group * PLANES + plane) as f32 - valley).abs() / plane_count;
                bottom + 0.12 * away + numbers.between(0.0, 0.004)
            }));
        }
    }
    costs
}

/// `[view][row][column][group]` greys and `[row][column][group][4]` evidence of a band: little contrast, a tenth
/// unseen, some places where nothing is compared, some outside the silhouettes.
pub fn band(numbers: &mut Numbers, swept: &Swept) -> (Vec<Planes>, Vec<Planes>) {
    let count = swept.band_len();
    let mut grey = Vec::new();
    for _ in 0..count * swept.views.len() {
        let level = numbers.between(0.4, 0.45);
        let of_plane = |numbers: &mut Numbers| match numbers.between(0.0, 1.0) {
            unseen if unseen < 0.1 => UNSEEN,
            _ => level + numbers.between(0.0, 0.05),
        };
        grey.push(std::array::from_fn(|_| of_plane(numbers)));
    }
    let mut evidence = Vec::new();
    for _ in 0..count {
        let mut of_plane = || {
            let weight = if numbers.between(0.0, 1.0) < 0.1 { 0.0 } else { numbers.between(0.05, 1.0) };
            let difference = weight * numbers.between(0.0, 0.25);
            [difference, weight, numbers.between(0.0, 1.0), numbers.between(-0.5, 1.5).clamp(0.0, 1.0)]
        };
        let planes: [[f32; 4]; PLANES] = std::array::from_fn(|_| of_plane());
        evidence.extend((0..4).map(|part| planes.map(|parts| parts[part])));
    }
    (grey, evidence)
}

/// `[row][column][group]`: opacities of planes, half of them low, so that some hide nothing and some hide the most.
pub fn opacities(numbers: &mut Numbers, volume: &CostBlock) -> Vec<Planes> {
    let mut opacity =
        || if numbers.between(0.0, 1.0) < 0.5 { numbers.between(0.0, 0.3) } else { numbers.between(0.2, 0.95) };
    // Neighbouring pixels differ little: a mean of independent numbers would always be near a half.
    let mut planes: Vec<Planes> = (0..volume.group_count).map(|_| [0; PLANES].map(|_| opacity())).collect();
    let mut opacities = Vec::new();
    for _ in 0..volume.width * volume.height {
        for number in planes.as_flattened_mut() {
            *number = 0.8 * *number + 0.2 * opacity();
        }
        opacities.extend_from_slice(&planes);
    }
    opacities
}
