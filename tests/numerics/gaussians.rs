//! Gaussians: the fast exponential, derivatives against differences of the `f64` evaluation, lists of tiles, and the
//! same bytes for any number of threads.

use viewfuse::check::gaussian_oracle::{blend, project};
use viewfuse::device::Memory;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::gaussians::{Splatter, Tiles};
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::{SH_0, colour_along};
use viewfuse_core::pose::{Pose, PoseBlock};
use viewfuse_kernels::gaussians::lanes::falloff;
use viewfuse_kernels::gaussians::shown::{bytes_of_pixel, shown_pixel, surface_depth};
use viewfuse_kernels::gaussians::{SplatBlock, TileBlock};
use viewfuse_kernels::rows::{GaussianBlock, HarmonicTerm, ProjectedGaussian};

const SIZE: [u32; 2] = [21, 18];
const NEAR: f32 = 0.2;
const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.4];

fn camera() -> CameraBlock {
    let [width, height] = SIZE;
    CameraBlock {
        pose: Pose::IDENTITY.block(),
        intrinsics: [20.0, 22.0, 10.0, 9.5],
        width,
        height,
        first_texel: 0,
        padding: 0,
    }
}

/// Four Gaussians before the camera that hide one another in part, all within the picture.
fn gaussians() -> Vec<GaussianBlock> {
    let gaussian = |position: [f32; 3], opacity: f32, log_scales: [f32; 3], rotation: [f32; 4], colour: [f32; 3]| {
        GaussianBlock { position, opacity, log_scales, rotation, colour, ..GaussianBlock::default() }
    };
    vec![
        gaussian([0.1, 0.0, 2.0], 0.4, [-1.6, -2.2, -2.0], [1.0, 0.2, -0.3, 0.4], [0.9, 0.1, 0.3]),
        gaussian([-0.2, 0.1, 2.5], 0.9, [-1.2, -1.5, -2.1], [0.7, -0.1, 0.5, 0.2], [0.2, 0.8, 0.5]),
        gaussian([0.2, 0.2, 3.0], -0.3, [-1.0, -1.3, -1.9], [1.3, 0.3, 0.1, -0.6], [0.4, 0.3, 0.9]),
        gaussian([0.0, -0.2, 3.4], 1.2, [-0.9, -1.4, -1.1], [0.5, 0.5, -0.2, 0.1], [0.7, 0.6, 0.2]),
    ]
}

/// The derivative of the loss by a pixel: any smooth pattern.
fn by_pixel(column: u32, row: u32) -> [f32; 4] {
    let wave = |share: f32| (share * column as f32 + 0.7 * row as f32).sin();
    [wave(0.9), wave(0.5), wave(0.3), 0.5 * wave(0.2)]
}

/// The loss, a sum over pixels and channels, in `f64`. The opacity at which splats begin to count is a step of the
/// loss: pixels where a splat's is near it are excluded, the same for all evaluations.
fn loss(gaussians: &[GaussianBlock], counted: &[bool], is_antialiased: bool) -> f64 {
    let [width, height] = SIZE;
    let splats: Vec<ProjectedGaussian> = gaussians.iter().map(|gaussian| rounded(gaussian, is_antialiased)).collect();
    let list: Vec<u32> = (0..splats.len() as u32).collect();
    let block = TileBlock::new(width, height, BACKGROUND);
    let pixels = (0..width * height).filter(|pixel| counted[*pixel as usize]);
    pixels
        .map(|pixel| {
            let (column, row) = (pixel % width, pixel / width);
            let by = by_pixel(column, row);
            let blended = blend(&block, &list, &splats, column, row).expect("no pixel at a threshold");
            (0..4).map(|channel| f64::from(by[channel]) * blended[channel].value).sum::<f64>()
        })
        .sum()
}

/// A splat of the evaluation in `f64`, rounded.
fn rounded(gaussian: &GaussianBlock, is_antialiased: bool) -> ProjectedGaussian {
    let is_antialiased = u32::from(is_antialiased);
    let block = SplatBlock { camera: camera(), near: NEAR, gaussian_count: 1, is_antialiased, padding: 0 };
    let values = project(&block, gaussian).expect("no Gaussian at a threshold").map(|bounded| bounded.value as f32);
    let [x, y, depth, opacity, xx, xy, yy, _, red, green, blue, _, right, down, ..] = values;
    ProjectedGaussian {
        mean: [x, y],
        depth,
        opacity,
        conic: [xx, xy, yy],
        colour: [red, green, blue],
        extent: [right, down],
        ..ProjectedGaussian::default()
    }
}

/// Pixels where no splat's opacity is near the least that counts.
fn counted(gaussians: &[GaussianBlock], is_antialiased: bool) -> Vec<bool> {
    let splats: Vec<ProjectedGaussian> = gaussians.iter().map(|gaussian| rounded(gaussian, is_antialiased)).collect();
    let [width, height] = SIZE;
    let is_far = |splat: &ProjectedGaussian, column: u32, row: u32| {
        let (dx, dy) = (column as f32 + 0.5 - splat.mean[0], row as f32 + 0.5 - splat.mean[1]);
        let [xx, xy, yy] = splat.conic;
        let alpha = splat.opacity * (-0.5 * (xx * dx * dx + yy * dy * dy) - xy * dx * dy).exp();
        !(0.8 / 255.0..1.25 / 255.0).contains(&alpha)
    };
    let all = (0..width * height).map(|pixel| splats.iter().all(|splat| is_far(splat, pixel % width, pixel / width)));
    all.collect()
}

/// The 14 parameters of a Gaussian, in the order of its fields.
fn parameters(gaussian: &mut GaussianBlock) -> [&mut f32; 14] {
    let ([x, y, z], [a, b, c]) = (&mut gaussian.position, &mut gaussian.log_scales);
    let ([w, i, j, k], [red, green, blue]) = (&mut gaussian.rotation, &mut gaussian.colour);
    [x, y, z, &mut gaussian.opacity, a, b, c, w, i, j, k, red, green, blue]
}

#[test]
fn the_fast_exponential_is_within_its_error() {
    for step in 0..=200_000 {
        let x = -16.0 * (step as f32 / 200_000.0);
        let exact = f64::from(x).exp();
        assert!((f64::from(falloff(x)) / exact - 1.0).abs() < 4.0e-6, "{x}");
    }
    assert_eq!((falloff(1.0), falloff(-1.0e9)), (falloff(0.0), falloff(-16.0)));
}

#[test]
fn derivatives_are_those_of_differences() {
    derivatives_of(&gaussians(), false);
}

/// Also of Gaussians as thin as a pixel, whose opacities follow from their sizes.
#[test]
fn antialiased_derivatives_are_those_of_differences() {
    derivatives_of(&gaussians(), true);
    let thin = |gaussian: GaussianBlock| {
        let [first, second, third] = gaussian.log_scales;
        GaussianBlock { log_scales: [first, second - 0.7, third - 0.7], ..gaussian }
    };
    derivatives_of(&gaussians().into_iter().map(thin).collect::<Vec<_>>(), true);
}

fn derivatives_of(gaussians: &[GaussianBlock], is_antialiased: bool) {
    let (gaussians, [width, height]) = (gaussians.to_vec(), SIZE);
    let counted = counted(&gaussians, is_antialiased);
    assert!(counted.iter().filter(|counted| **counted).count() > counted.len() / 2, "most pixels are compared");
    let splatter = Splatter { device: &Cpu, near: NEAR, background: BACKGROUND, is_antialiased, harmonics: None };
    let uploaded = Cpu.upload(&gaussians).expect("memory");
    let picture = splatter.picture(&uploaded, gaussians.len(), &camera()).expect("a picture");
    let pixels = 0..width * height;
    let by_pixels: Vec<[f32; 4]> = pixels
        .map(|pixel| if counted[pixel as usize] { by_pixel(pixel % width, pixel / width) } else { [0.0; 4] })
        .collect();
    let mut gradients = splatter.gradients(&uploaded, &picture, &by_pixels).expect("derivatives");
    assert!(picture.lists.in_sight.iter().all(|in_sight| *in_sight));
    for index in 0..gaussians.len() {
        let analytic = parameters(&mut gradients[index]).map(|value| f64::from(*value));
        let largest = analytic.iter().map(|value| value.abs()).fold(0.0, f64::max);
        for (parameter, analytic) in analytic.into_iter().enumerate() {
            let at = |offset: f32| {
                let mut moved = gaussians.clone();
                let value = &mut *parameters(&mut moved[index])[parameter];
                *value += offset;
                (f64::from(*value), loss(&moved, &counted, is_antialiased))
            };
            let ((low, before), (high, after)) = (at(-4.0e-3), at(4.0e-3));
            let difference = (after - before) / (high - low);
            // The differences' own error: of third order in the step, and the splats' rounding.
            let bound = 2.0e-3 * largest + 2.0e-3;
            assert!(
                (analytic - difference).abs() < bound,
                "Gaussian {index}, parameter {parameter}: {analytic} by the chain rule, {difference} by differences"
            );
        }
    }
}

#[test]
fn tiles_list_splats_front_to_back() {
    let all = gaussians();
    let splats: Vec<ProjectedGaussian> = all.iter().rev().map(|gaussian| rounded(gaussian, false)).collect();
    let block = TileBlock::new(SIZE[0], SIZE[1], BACKGROUND);
    let Tiles { starts, entries, in_sight } = Tiles::of(&block, &splats);
    assert!(in_sight.iter().all(|in_sight| *in_sight));
    assert_eq!(starts.len(), block.tile_count() as usize + 1);
    assert_eq!(starts.last().copied(), Some(entries.len() as u32));
    let has_box_in = |splat: &ProjectedGaussian, [left, top]: [u32; 2]| {
        let [first, end, top_row, bottom] = splat.pixels(SIZE[0], SIZE[1]);
        first < left + 8 && end > left && top_row < top + 8 && bottom > top
    };
    let mut in_boxes = 0;
    for (tile, bounds) in starts.windows(2).enumerate() {
        let depths: Vec<f32> =
            entries[bounds[0] as usize..bounds[1] as usize].iter().map(|splat| splats[*splat as usize].depth).collect();
        assert!(depths.is_sorted(), "tile {tile}: {depths:?}");
        // Each splat that is seen at a pixel of the tile.
        let [left, top] = block.first_of(tile as u32);
        let pixels = (top..top + 8).flat_map(|row| (left..left + 8).map(move |column| (column, row)));
        let pixels: Vec<(u32, u32)> = pixels.filter(|(column, row)| *column < SIZE[0] && *row < SIZE[1]).collect();
        let is_seen = |splat: &ProjectedGaussian| {
            pixels.iter().any(|(column, row)| splat.alpha(*column as f32 + 0.5, *row as f32 + 0.5) > 0.0)
        };
        let listed = &entries[bounds[0] as usize..bounds[1] as usize];
        let seen = (0..splats.len() as u32).filter(|index| is_seen(&splats[*index as usize]));
        assert!(seen.clone().all(|index| listed.contains(&index)), "tile {tile} lacks a splat");
        in_boxes += splats.iter().filter(|splat| has_box_in(splat, [left, top])).count();
    }
    assert!(entries.len() < in_boxes, "{} entries of {in_boxes}: corners of boxes are listed", entries.len());
    assert!(entries.len() > all.len(), "they reach over several tiles");
}

/// Spherical harmonics make the colours that core's function gives for the camera's place, from wherever it looks.
#[test]
fn colours_depend_on_the_direction() {
    const TERMS: usize = 15;
    let all = gaussians();
    let value = |term: usize, channel: usize| 0.3 * ((5 * term + 3 * channel) as f32).sin();
    let term = |term: usize| HarmonicTerm { value: [0, 1, 2].map(|channel| value(term, channel)), padding: 0.0 };
    let terms: Vec<HarmonicTerm> = (0..all.len() * TERMS).map(term).collect();
    let with = Splatter {
        device: &Cpu,
        near: NEAR,
        background: BACKGROUND,
        is_antialiased: false,
        harmonics: Some((&terms, TERMS as u32)),
    };
    let without = Splatter { harmonics: None, ..with };
    let mut shown = Vec::new();
    for centre in [[0.0, 0.0, 0.0], [0.3, -0.2, -0.4]] {
        let mut camera = camera();
        let PoseBlock { right, down, forward } = &mut camera.pose;
        [right[3], down[3], forward[3]] = centre;
        let coloured = |(index, gaussian): (usize, &GaussianBlock)| {
            let f_dc = gaussian.colour.map(|level| (level - 0.5) / SH_0);
            let rest: Vec<f32> =
                (0..3).flat_map(|channel| (0..TERMS).map(move |term| value(index * TERMS + term, channel))).collect();
            let towards = Vec3::from(gaussian.position) - camera.centre_world();
            GaussianBlock { colour: colour_along(f_dc, &rest[..], 3, towards), ..*gaussian }
        };
        let expected: Vec<GaussianBlock> = all.iter().enumerate().map(coloured).collect();
        let [ours, expected] = [(&with, &all), (&without, &expected)].map(|(splatter, gaussians)| {
            splatter.picture(gaussians, gaussians.len(), &camera).expect("a picture").colours
        });
        for (ours, expected) in ours.iter().zip(&expected) {
            assert_eq!(ours[3], expected[3]);
            // Two directions of unit length, each within some roundings, and a sum of sixteen terms below 2.
            let apart = (0..3).map(|channel| (ours[channel] - expected[channel]).abs()).fold(0.0, f32::max);
            assert!(apart < 64.0 * f32::EPSILON, "{ours:?} {expected:?}");
        }
        shown.push(ours);
    }
    assert_ne!(shown[0], shown[1]);
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let all = gaussians();
    let picture = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let splatter =
                Splatter { device: &Cpu, near: NEAR, background: BACKGROUND, is_antialiased: false, harmonics: None };
            let uploaded = Cpu.upload(&all).expect("memory");
            let picture = splatter.picture(&uploaded, all.len(), &camera()).expect("a picture");
            let by_pixels = vec![[0.3, -0.2, 0.1, 0.4]; (SIZE[0] * SIZE[1]) as usize];
            let gradients = splatter.gradients(&uploaded, &picture, &by_pixels).expect("derivatives");
            (Cpu.download(&picture.colours).expect("colours"), gradients)
        })
    };
    assert_eq!(picture(1), picture(3));
}

/// Bytes of shown pixels are those that the host's conversions make.
#[test]
fn shown_pixels_are_rounded_as_on_the_host() {
    let steps = (0..=510_u32).flat_map(|half| {
        let near = half as f32 / 510.0;
        [near.next_down(), near, near.next_up()]
    });
    for value in steps.chain([-1.0, 2.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0]) {
        let clamped = value.clamp(0.0, 1.0);
        let [colour, opacity] = [(clamped * 255.0 + 0.5) as u8, (clamped * 255.0).round() as u8];
        assert_eq!(bytes_of_pixel(shown_pixel([value, 0.0, 1.0, value])), [colour, 0, 255, opacity], "{value}");
    }
    assert_eq!([0.5, 0.49, f32::NAN].map(|opacity| surface_depth(3.0, opacity, 0.5)), [6.0, 0.0, 0.0]);
}
