//! [`Kernel::ProjectGaussians`], [`Kernel::BlendSplats`] and their derivatives: Gaussians of all shapes before a
//! camera, and splats in the lists of a picture's tiles.

use super::*;
use crate::gaussian_oracle;
use crate::world::{Numbers, World};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::project_as;
use viewfuse_kernels::gaussians::SPLAT_TILE;

/// Depth from which on Gaussians are seen.
pub(super) const NEAR: f32 = 0.5;
/// Splats of a picture, besides those of its pixels.
const SPLATS: usize = 24;

/// Gaussians in the middle of a world, some of them behind the camera or too faint to be seen.
pub(super) fn gaussians(numbers: &mut Numbers, count: u32) -> Vec<GaussianBlock> {
    let gaussian = |_| GaussianBlock {
        position: [0; 3].map(|_| numbers.between(-2.4, 2.4)),
        opacity: numbers.between(-7.0, 4.0),
        log_scales: [0; 3].map(|_| numbers.between(-5.0, -1.5)),
        padding: 0.0,
        rotation: [
            numbers.between(0.3, 2.0),
            numbers.between(-1.0, 1.0),
            numbers.between(-1.0, 1.0),
            numbers.between(-1.0, 1.0),
        ],
        colour: [0; 3].map(|_| numbers.between(0.1, 1.0)),
        padding_end: 0.0,
    };
    (0..count).map(gaussian).collect()
}

/// Without and with antialiasing.
pub(super) fn blocks(camera: CameraBlock, gaussian_count: u32) -> [SplatBlock; 2] {
    let camera = CameraBlock { first_texel: 0, ..camera };
    [0, 1].map(|is_antialiased| SplatBlock { camera, near: NEAR, gaussian_count, is_antialiased, padding: 0 })
}

/// Gaussians as the camera sees them.
pub(super) fn splats(block: &SplatBlock, gaussians: &[GaussianBlock]) -> Vec<ProjectedGaussian> {
    let SplatBlock { camera, near, is_antialiased, .. } = block;
    gaussians.iter().map(|gaussian| project_as(gaussian, camera, *near, *is_antialiased != 0)).collect()
}

/// Splats on a picture, the nearest first, and the lists of its tiles.
struct Picture {
    block: TileBlock,
    splats: Vec<ProjectedGaussian>,
    starts: Vec<u32>,
    entries: Vec<u32>,
}

/// A splat on a picture of this size, or beside it.
pub(super) fn splat(numbers: &mut Numbers, [width, height]: [u32; 2], depth: f32) -> ProjectedGaussian {
    let [right, down] = [numbers.between(0.8, 4.0), numbers.between(0.8, 4.0)];
    // The covariance of a correlation.
    let correlation = numbers.between(-0.7, 0.7);
    let rest = 1.0 / (1.0 - correlation * correlation);
    ProjectedGaussian {
        mean: [numbers.between(-2.0, width as f32 + 2.0), numbers.between(-2.0, height as f32 + 2.0)],
        depth,
        opacity: numbers.between(0.05, 1.0),
        conic: [rest / (right * right), -correlation * rest / (right * down), rest / (down * down)],
        padding: 0.0,
        colour: [0; 3].map(|_| numbers.between(0.1, 1.0)),
        padding_colour: 0.0,
        // Beyond this the opacity is below the least that counts.
        extent: [3.4 * right, 3.4 * down],
        padding_end: [0.0; 2],
    }
}

/// What a tile says of a splat.
pub(super) fn tile_sums(numbers: &mut Numbers) -> SplatGradient {
    let number = |most: f32| numbers.between(-most, most);
    SplatGradient::of([1.0, 2.0, 2.0, 4.0, 4.0, 4.0, 1.0, 1.0, 1.0].map(number))
}

impl Picture {
    fn new(numbers: &mut Numbers, size: u32) -> Picture {
        let width = f64::from(size).sqrt().ceil() as u32;
        let height = size.div_ceil(width);
        let background = [0; 3].map(|_| numbers.between(0.2, 0.9));
        let block = TileBlock::new(width, height, background);
        let count = SPLATS + size as usize / 16;
        let splat = |index: usize| splat(numbers, [width, height], 1.0 + 0.01 * index as f32);
        let splats: Vec<ProjectedGaussian> = (0..count).map(splat).collect();
        let side = SPLAT_TILE as u32;
        let (mut starts, mut entries) = (vec![0], Vec::new());
        for tile in 0..block.tile_count() {
            let (column, row) = (tile % block.tile_columns * side, tile / block.tile_columns * side);
            let shows = |splat: &ProjectedGaussian| {
                let [left, right, top, bottom] = splat.pixels(width, height);
                left < right
                    && top < bottom
                    && left < column + side
                    && right > column
                    && top < row + side
                    && bottom > row
            };
            entries.extend((0..count as u32).filter(|index| shows(&splats[*index as usize])));
            starts.push(entries.len() as u32);
        }
        entries.push(0);
        Picture { block, splats, starts, entries }
    }

    /// The list of a tile.
    fn list<'a>(starts: &[u32], entries: &'a [u32], tile: u32) -> &'a [u32] {
        &entries[starts[tile as usize] as usize..starts[tile as usize + 1] as usize]
    }

    fn tile_of(block: &TileBlock, column: u32, row: u32) -> u32 {
        row / SPLAT_TILE as u32 * block.tile_columns + column / SPLAT_TILE as u32
    }
}

impl Case for ProjectGaussians {
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-3 };
    const REASON: &'static str = "running error analysis from the camera's axes through the covariance to its inverse \
        and to the pixels where the opacity counts";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("gaussians", |case| increase(case.gaussians.iter_mut().flat_map(|gaussian| &mut gaussian.log_scales))),
        ("parameters", |case| case.block.camera.intrinsics[0] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ProjectGaussians> {
        let target = World::new(seed).target;
        let gaussians = gaussians(&mut Numbers::new(seed), size);
        let splats = || Output::Zeros(gaussians.len());
        blocks(target, size)
            .map(|block| ProjectGaussians { block, splats: splats(), gaussians: gaussians.clone() })
            .to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let project = |index: usize| {
            let splat = gaussian_oracle::project(&self.block, &self.gaussians[index]);
            splat.map_or([None; 16], |splat| splat.map(Some))
        };
        map(self.gaussians.len(), 16, project).into_iter().flatten().collect()
    }
}

impl Case for BlendSplats {
    const LIMITS: Limits = Limits { tolerance: 1.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from a pixel's distance to its sums of colours and depths; \
        undecided where it depends on rounding whether a splat counts";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("starts", |case| case.starts.iter_mut().skip(1).for_each(|start| *start = start.saturating_sub(1))),
        ("entries", |case| case.entries.reverse()),
        ("splats", |case| increase(case.splats.iter_mut().map(|splat| &mut splat.opacity))),
        ("parameters", |case| increase(&mut case.block.background[..3])),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<BlendSplats> {
        let Picture { block, splats, starts, entries } = Picture::new(&mut Numbers::new(seed), size);
        let pixel_count = (block.width * block.height) as usize;
        let (colours, depths) = (Output::Zeros(pixel_count), Output::Zeros(pixel_count));
        vec![BlendSplats { block, starts, entries, splats, colours, depths }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let BlendSplats { block, starts, entries, splats, .. } = self;
        let pixels = map((block.width * block.height) as usize, 1, |pixel| {
            let (column, row) = (pixel as u32 % block.width, pixel as u32 / block.width);
            let list = Picture::list(starts, entries, Picture::tile_of(block, column, row));
            gaussian_oracle::blend(block, list, splats, column, row)
        });
        let colours = pixels.iter().flat_map(|pixel| (0..4).map(move |channel| pixel.map(|pixel| pixel[channel])));
        colours.chain(pixels.iter().map(|pixel| pixel.map(|pixel| pixel[4]))).collect()
    }
}

impl Case for BlendGradient {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0e-2, least: 1.0e-1 };
    const REASON: &'static str = "running error analysis of what lies behind a splat, divided by its transmittance, \
        and of sums over the pixels of a tile; a tile with a pixel where it depends on rounding whether a splat counts \
        is undecided";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("starts", |case| case.starts.iter_mut().skip(1).for_each(|start| *start = start.saturating_sub(1))),
        ("entries", |case| case.entries.reverse()),
        ("splats", |case| increase(case.splats.iter_mut().map(|splat| &mut splat.opacity))),
        ("colours", |case| increase(case.colours.as_flattened_mut())),
        ("gradients", |case| increase(case.gradients.as_flattened_mut())),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<BlendGradient> {
        let numbers = &mut Numbers::new(seed);
        let Picture { block, splats, starts, entries } = Picture::new(numbers, size);
        let blended = BlendSplats {
            block,
            starts: starts.clone(),
            entries: entries.clone(),
            splats: splats.clone(),
            colours: Output::Zeros(0),
            depths: Output::Zeros(0),
        };
        let pixel_count = (block.width * block.height) as usize;
        let blended = blended.expected();
        let all: Vec<f32> = blended.iter().map(|value| value.map_or(0.5, |value| value.value as f32)).collect();
        let colours: Vec<[f32; 4]> = all[..4 * pixel_count].as_chunks::<4>().0.to_vec();
        // No derivative where it depends on rounding what counts: one such pixel would leave its whole tile undecided.
        let mut by =
            |pixel: usize| [0; 4].map(|_| if blended[4 * pixel].is_some() { numbers.between(-1.0, 1.0) } else { 0.0 });
        let gradients = (0..pixel_count).map(&mut by).collect();
        let sums = Output::Zeros(entries.len());
        vec![BlendGradient { block, starts, entries, splats, colours, gradients, sums }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let BlendGradient { block, starts, entries, splats, colours, gradients, .. } = self;
        let sums = map(block.tile_count() as usize, 1, |tile| {
            let list = Picture::list(starts, entries, tile as u32);
            gaussian_oracle::blend_gradient(block, list, splats, colours, gradients, tile as u32)
        });
        // Behind the last list is one entry that no tile shows.
        sums.into_iter().flatten().chain([Some(Bounded::ZERO); 12]).collect()
    }
}

impl Case for ProjectGradients {
    const LIMITS: Limits = Limits { tolerance: 1.0, least: 1.0 };
    const REASON: &'static str = "running error analysis of the chain rule, from sums over tiles through the inverse \
        of the covariance to scales, rotation and position; undecided where the projection's slope is limited or not \
        by rounding";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("gaussians", |case| increase(case.gaussians.iter_mut().flat_map(|gaussian| &mut gaussian.log_scales))),
        ("splats", |case| increase(case.splats.iter_mut().flat_map(|splat| &mut splat.conic))),
        ("use_starts", |case| case.use_starts.iter_mut().skip(1).for_each(|start| *start = start.saturating_sub(1))),
        ("uses", |case| case.uses.reverse()),
        ("sums", |case| increase(case.sums.iter_mut().map(|sums| &mut sums.opacity))),
        ("parameters", |case| case.block.camera.intrinsics[0] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ProjectGradients> {
        let numbers = &mut Numbers::new(seed);
        let gaussians = gaussians(numbers, size);
        let (mut use_starts, mut uses) = (vec![0], Vec::new());
        for gaussian in 0..size {
            // Entries of each Gaussian are neighbours here, and not of the last one.
            uses.extend(3 * gaussian..3 * gaussian + 1 + gaussian % 3);
            use_starts.push(uses.len() as u32);
        }
        let sums: Vec<SplatGradient> = (0..3 * size).map(|_| tile_sums(numbers)).collect();
        let dispatch = |block: SplatBlock| {
            let (gaussians, splats) = (gaussians.clone(), splats(&block, &gaussians));
            let (use_starts, uses, sums) = (use_starts.clone(), uses.clone(), sums.clone());
            let gradients = Output::Zeros(gaussians.len());
            ProjectGradients { block, gaussians, splats, use_starts, uses, sums, gradients }
        };
        blocks(World::new(seed).target, size).map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let ProjectGradients { block, gaussians, splats, use_starts, uses, sums, .. } = self;
        let gradient = |index: usize| {
            let entries = &uses[use_starts[index] as usize..use_starts[index + 1] as usize];
            let parts: Vec<SplatGradient> = entries.iter().map(|entry| sums[*entry as usize]).collect();
            let sums = gaussian_oracle::sums_of(&parts);
            let gradient = gaussian_oracle::project_gradient(block, &gaussians[index], &splats[index], &sums);
            gradient.map_or([None; 16], |gradient| gradient.map(Some))
        };
        map(gaussians.len(), 16, gradient).into_iter().flatten().collect()
    }
}
