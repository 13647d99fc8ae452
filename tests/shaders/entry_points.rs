//! Entry points, run as the functions that they are on the host: they unpack their arguments, look whether their element
//! exists, and store in the right place what core computes. Bits, not tolerances. Kernels whose invocations wait for
//! one another at barriers cannot run so: their cases of parity cover them.

mod limits;
mod lists;
mod networks;
mod plane_sweep;
mod vectors;
mod visual_hull;
mod volumes;

use viewfuse::check::poses::Random;
use viewfuse::check::world::{Numbers, World};
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding, PoseEmbedding};
use viewfuse_core::composite::{CompositeBlock, composite_samples};
use viewfuse_core::depths::{CoarseBlock, FineBlock, coarse_depth, fine_depth, merged_depth, random_draw};
use viewfuse_core::fetch::StartingAt;
use viewfuse_core::fuse::{FuseBlock, fuse_element};
use viewfuse_core::half_precision::packed_f16;
use viewfuse_core::pose::{Pose, PoseBlock};
use viewfuse_core::rays::{CastBlock, PlaceBlock, RayPoint, TargetRay, cast_ray, place_point};
use viewfuse_core::sampler::{Mix, NoiseBlock, noisy_element};
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{MAX_WEIGHED, Scheme, WeighBlock, weigh};
use viewfuse_kernels::pixelnerf::{
    EmbedBlock, GatherBlock, embedded_value, gathered_value, gathered_value_f16, radiance, visible_weight,
};
use viewfuse_kernels::sample_mask::{RaysBlock, SampleMaskBlock, is_sampled, weigh_sample};
use viewfuse_shaders::{Piece, Push};

/// What an element holds before anything is written.
const UNTOUCHED: f32 = -77.0;

fn id(x: u32) -> glam::UVec3 {
    glam::UVec3::new(x, 0, 0)
}

/// Runs a kernel for all its elements in two pieces, with some invocations beyond each piece's end, as a device does.
fn dispatch<P: Copy>(parameters: P, count: u32, mut entry: impl FnMut(glam::UVec3, &Push<P>)) {
    let cut = count / 3;
    for piece in [Piece { first: 0, count: cut }, Piece { first: cut, count: count - cut }] {
        for x in 0..piece.count.next_multiple_of(64) {
            entry(id(x), &Push { parameters, piece });
        }
    }
}

fn poses(count: usize) -> Vec<Pose> {
    let mut random = Random::new(5);
    (0..count).map(|_| random.pose(3.0)).collect()
}

fn blocks(poses: &[Pose]) -> Vec<PoseBlock> {
    poses.iter().map(Pose::block).collect()
}

fn numbers(seed: u64, count: usize) -> Vec<f32> {
    let numbers = &mut Numbers::new(seed);
    (0..count).map(|_| numbers.between(-1.0, 1.0)).collect()
}

#[test]
fn weigh_is_core_s() {
    let (sources, targets) = (poses(7), poses(70));
    let block = WeighBlock { scheme: Scheme::ERROR.block(), source_count: 7 };
    let mut weights = vec![[UNTOUCHED; MAX_WEIGHED]; 70];
    dispatch(block, 70, |id, push| {
        viewfuse_shaders::weigh(id, push, &blocks(&sources), &blocks(&targets), &mut weights);
    });
    let sources = Sources::<MAX_WEIGHED>::new(&sources).expect("sources");
    let expected: Vec<_> = targets.iter().map(|target| *weigh(Scheme::ERROR, &sources, target).values()).collect();
    assert_eq!(weights, expected);
}

#[test]
fn attention_is_core_s() {
    let poses = poses(9);
    let embedding = FourierEmbedding::from_flat(&numbers(3, FourierEmbedding::PARAMETERS));
    let mut embedded = vec![[UNTOUCHED; EMBEDDING]; 9];
    dispatch((), 9, |id, push| {
        viewfuse_shaders::embed_pose(id, &push.piece, &embedding, &blocks(&poses), &mut embedded)
    });
    let expected: Vec<_> = poses.iter().map(|pose| embedding.embed(pose)).collect();
    assert_eq!(embedded, expected);

    let (queries, keys) = (numbers(4, 70 * EMBEDDING), numbers(5, 6 * EMBEDDING));
    let mut weights = vec![[UNTOUCHED; MAX_WEIGHED]; 70];
    dispatch(6, 70, |id, push| viewfuse_shaders::attend(id, push, &queries, &keys, &mut weights));
    let expected: Vec<_> = queries
        .chunks(EMBEDDING)
        .map(|query| *viewfuse_core::attention::attend::<MAX_WEIGHED>(query, &keys[..], 6).values())
        .collect();
    assert_eq!(weights, expected);
}

#[test]
fn light_is_core_s() {
    let (weights, latents) = (numbers(6, 5), numbers(7, 5 * 90));
    let block = FuseBlock { view_count: 5, stride: 90, ..FuseBlock::default() };
    let mut fused = vec![UNTOUCHED; 90];
    dispatch(block, 90, |id, push| viewfuse_shaders::fuse_views(id, push, &weights, &latents, &mut fused));
    let expected: Vec<f32> = (0..90).map(|at| fuse_element(&weights[..], &latents[at..], &block)).collect();
    assert_eq!(fused, expected);

    // Fifteen points of six channels, each with its own weights.
    let weights = numbers(6, 15 * 5);
    let block = FuseBlock { channel_count: 6, weight_stride: 5, ..block };
    dispatch(block, 90, |id, push| viewfuse_shaders::fuse_views(id, push, &weights, &latents, &mut fused));
    let expected: Vec<f32> = (0..90).map(|at| fuse_element(&weights[at / 6 * 5..], &latents[at..], &block)).collect();
    assert_eq!(fused, expected);

    let samples: Vec<[f32; 4]> = numbers(8, 80 * 4 * 6).chunks(4).map(|s| [s[0], s[1], s[2], s[3]]).collect();
    let sample_depths = numbers(9, 80 * 6);
    let block = CompositeBlock { background: [0.1, 0.2, 0.3], empty_depth: 9.0, sample_count: 6 };
    let (mut colours, mut depths) = (vec![[UNTOUCHED; 4]; 80], vec![UNTOUCHED; 80]);
    dispatch(block, 80, |id, push| {
        viewfuse_shaders::composite(id, push, &samples, &sample_depths, &mut colours, &mut depths);
    });
    for (ray, (colour, depth)) in colours.iter().zip(&depths).enumerate() {
        let seen = composite_samples(&samples[ray * 6..], &sample_depths[ray * 6..], &block);
        assert_eq!(*colour, [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity]);
        assert_eq!(*depth, seen.depth);
    }
}

#[test]
fn samplers_are_core_s() {
    let arrays: Vec<Vec<f32>> = (30..35).map(|seed| numbers(seed, 90)).collect();
    let [state, newest, second, third, fourth] = [0, 1, 2, 3, 4].map(|index| &arrays[index][..]);
    let mix = Mix { state: 0.7, results: [0.5, -0.25, 0.125, 3.0] };
    // Not read: nothing of the last.
    for (mix, fourth) in [(mix, fourth), (Mix { results: [0.5, -0.25, 0.125, 0.0], ..mix }, &[][..])] {
        let mut mixed = vec![UNTOUCHED; 90];
        dispatch(mix, 90, |id, push| {
            viewfuse_shaders::mix_pictures(id, push, state, newest, second, third, fourth, &mut mixed);
        });
        let last = |at| fourth.get(at).copied().unwrap_or(f32::NAN);
        let expected: Vec<f32> =
            (0..90).map(|at| mix.of(state[at], &[newest[at], second[at], third[at], last(at)])).collect();
        assert_eq!(mixed, expected);
    }

    let block = NoiseBlock { seed: [7, 8], stream: 3, scale: 0.5 };
    let mut noisy = vec![UNTOUCHED; 90];
    dispatch(block, 90, |id, push| viewfuse_shaders::add_noise(id, push, state, &mut noisy));
    let expected: Vec<f32> = (0..90).map(|at| noisy_element(&block, state[at as usize], at)).collect();
    assert_eq!(noisy, expected);
}

/// Some pixels of a world's target, not in order, and their rays.
fn rays_of(world: &World) -> (Vec<u32>, Vec<TargetRay>, CastBlock) {
    let count = world.target.width * world.target.height;
    let pixels: Vec<u32> = (0..70).map(|ray| ray * 31 % count).collect();
    let block = CastBlock { camera: world.target, near: 0.5, far: 4.0, pixel_centre: 0.5, along_axis: 0 };
    let rays = pixels.iter().map(|pixel| cast_ray(&block, *pixel)).collect();
    (pixels, rays, block)
}

/// Optical depths of samples, half of which are empty.
fn optical_depths(count: usize) -> Vec<f32> {
    numbers(12, count).iter().map(|depth| depth * depth * depth * 2.0).collect()
}

/// Weights and transmittances, as a first pass of so many parts on every ray sees them.
fn seen_by(ray_count: usize, part_count: usize) -> Vec<[f32; 2]> {
    let optical_depths = optical_depths(ray_count * part_count);
    let rows = optical_depths.chunks(part_count).flat_map(|row| {
        let mut sum = 0.0;
        row.iter().map(move |optical_depth| {
            let (seen, next) = weigh_sample(sum, *optical_depth);
            sum = next;
            seen
        })
    });
    rows.collect()
}

#[test]
fn rays_are_core_s() {
    let world = World::new(1);
    let (pixels, expected, block) = rays_of(&world);
    let mut cast = vec![TargetRay::default(); 70];
    dispatch(block, 70, |id, push| viewfuse_shaders::cast_rays(id, push, &pixels, &mut cast));
    assert_eq!(cast, expected);

    let block = CoarseBlock { seed: [3, 4], sample_count: 5, jitter: 0.8 };
    let mut depths = vec![UNTOUCHED; 350];
    dispatch(block, 350, |id, push| viewfuse_shaders::coarse_depths(id, push, &cast, &pixels, &mut depths));
    let place = |at: usize| (at / 5, at as u32 % 5);
    let coarse = |(ray, sample): (usize, u32)| coarse_depth(&cast[ray], pixels[ray], sample, &block);
    assert_eq!(depths, (0..350).map(place).map(coarse).collect::<Vec<f32>>());

    let samples: Vec<u32> = (0..350).filter(|sample| sample % 3 != 1).collect();
    let mut placed = vec![RayPoint::default(); samples.len()];
    let block = PlaceBlock { sample_count: 5, first: 0, has_samples: 1 };
    dispatch(block, samples.len() as u32, |id, push| {
        viewfuse_shaders::place_points(id, push, &samples, &cast, &depths, &mut placed)
    });
    let expected: Vec<RayPoint> =
        samples.iter().map(|sample| place_point(&cast[..], &depths[..], 5, *sample)).collect();
    assert_eq!(placed, expected);
    // Without a list, from a place on.
    let block = PlaceBlock { sample_count: 5, first: 40, has_samples: 0 };
    let mut placed = vec![RayPoint::default(); 310];
    dispatch(block, 310, |id, push| viewfuse_shaders::place_points(id, push, &[0], &cast, &depths, &mut placed));
    let expected: Vec<RayPoint> = (40..350).map(|sample| place_point(&cast[..], &depths[..], 5, sample)).collect();
    assert_eq!(placed, expected);
}

#[test]
fn what_was_seen_is_core_s() {
    let samples: Vec<[f32; 4]> = optical_depths(70 * 6).iter().map(|depth| [9.0, 9.0, 9.0, *depth]).collect();
    let mut seen = vec![[UNTOUCHED; 2]; 420];
    let block = RaysBlock { sample_count: 6, first_ray: 0 };
    dispatch(block, 70, |id, push| viewfuse_shaders::weigh_samples(id, push, &samples, &mut seen));
    assert_eq!(seen, seen_by(70, 6));

    let (pixels, cast, _) = rays_of(&World::new(1));
    let depths: Vec<f32> = numbers(13, 70 * 4).iter().map(|depth| 2.2 + 1.7 * depth).collect();
    let block = SampleMaskBlock {
        sample_count: 4,
        part_count: 6,
        least_share: 0.3,
        termination: 0.2,
        least_opacity: 0.3,
        ..SampleMaskBlock::default()
    };
    let nearby = SampleMaskBlock { step: 8, seen_columns: 7, seen_rows: 10, width: 48, ..block };
    for block in [block, nearby] {
        let mut wanted = vec![77; 280];
        dispatch(block, 280, |id, push| {
            viewfuse_shaders::sample_mask(id, push, &seen, &cast, &pixels, &depths, &mut wanted)
        });
        let expected: Vec<u32> = (0..280)
            .map(|at| {
                let ray = at / 4;
                is_sampled(&seen[..], &cast[ray], depths[at], ray as u32, pixels[ray], &block).into()
            })
            .collect();
        assert_eq!(wanted, expected);
        assert!(expected.contains(&0) && expected.contains(&1));
    }
}

#[test]
fn fine_depths_are_core_s() {
    let (pixels, cast, _) = rays_of(&World::new(1));
    let block = FineBlock {
        seed: [5, 6],
        coarse_count: 6,
        importance_count: 4,
        depth_count: 3,
        depth_deviation: 0.1,
        depth_times_opacity: 1,
    };
    let mut draws = vec![[UNTOUCHED; 2]; 490];
    dispatch(block, 490, |id, push| viewfuse_shaders::random_draws(id, push, &pixels, &mut draws));
    let place = |at: usize| (at / 7, at as u32 % 7);
    let drawn = |(ray, sample): (usize, u32)| random_draw(pixels[ray], sample, &block);
    assert_eq!(draws, (0..490).map(place).map(drawn).collect::<Vec<[f32; 2]>>());

    let (seen, pixel_depths) = (seen_by(70, 6), numbers(14, 70));
    let colours: Vec<[f32; 4]> = numbers(15, 70).iter().map(|opacity| [9.0, 9.0, 9.0, *opacity]).collect();
    let mut fine = vec![UNTOUCHED; 490];
    dispatch(block, 490, |id, push| {
        viewfuse_shaders::fine_depths(id, push, &seen, &cast, &colours, &pixel_depths, &draws, &mut fine);
    });
    let expected: Vec<f32> = (0..490)
        .map(|at| {
            let (ray, sample) = place(at);
            let (depth, opacity) = (pixel_depths[ray], colours[ray][3]);
            fine_depth(&seen[ray * 6..], &cast[ray], depth, opacity, draws[at], sample, &block)
        })
        .collect();
    assert_eq!(fine, expected);

    let coarse = numbers(16, 70 * 6);
    let mut merged = vec![UNTOUCHED; 70 * 13];
    dispatch(block, 70 * 13, |id, push| viewfuse_shaders::merge_depths(id, push, &coarse, &fine, &mut merged));
    let mut expected = vec![UNTOUCHED; 70 * 13];
    for at in 0..70 * 13 {
        let ray = at / 13;
        let (depth, place) = merged_depth(&coarse[ray * 6..], &fine[ray * 7..], 6, 7, at as u32 % 13);
        expected[ray * 13 + place as usize] = depth;
    }
    assert_eq!(merged, expected);
    assert!(merged.chunks(13).all(|depths| depths.is_sorted()));
}

/// Points in front of a world's views, and behind.
fn points_of(world: &World, count: usize) -> Vec<RayPoint> {
    let (_, cast, _) = rays_of(world);
    let depths: Vec<f32> = numbers(17, 70).iter().map(|depth| 2.0 + 6.0 * depth).collect();
    let points = (0..count as u32).map(|sample| place_point(&cast[..], &depths[..], 1, sample));
    // Every point is another sample.
    points.zip(0..).map(|(point, at)| RayPoint { sample: at * 7 % count as u32, length: 0.3, ..point }).collect()
}

#[test]
fn points_are_core_s() {
    let world = World::new(1);
    let (views, view_count) = (&world.views, world.views.len() as u32);
    let there = points_of(&world, 40);
    let (words, at) = (vectors::cameras(views), vectors::points(&there));
    let block = EmbedBlock { point_count: 40, frequency_count: 3, frequency: 1.5 };
    let count = view_count * 40 * block.row_len();
    let mut embedded = vec![UNTOUCHED; count as usize];
    dispatch(block, count, |id, push| viewfuse_shaders::embed_points(id, push, &words, &at, &mut embedded));
    let expected: Vec<f32> = (0..count as usize).map(|at| embedded_value(&views[..], &there[..], &block, at)).collect();
    assert_eq!(embedded, expected);

    let (weights, count) = (numbers(18, view_count as usize), 40 * view_count);
    let mut visible = vec![UNTOUCHED; count as usize];
    dispatch(view_count, count, |id, push| {
        viewfuse_shaders::visible_weights(id, push, &words, &weights, &at, &mut visible)
    });
    let weight = |at: u32| {
        let point = &there[(at / view_count) as usize];
        visible_weight(&views[..], &weights[..], view_count, point, at % view_count)
    };
    assert_eq!(visible, (0..count).map(weight).collect::<Vec<f32>>());

    let raw = numbers(19, 160);
    let mut samples = vec![[UNTOUCHED; 4]; 40];
    dispatch((), 40, |id, push| viewfuse_shaders::radiance(id, &push.piece, &raw, &at, &mut samples));
    for (at, point) in there.iter().enumerate() {
        assert_eq!(samples[point.sample as usize], radiance(&raw[at * 4..], point));
    }
}

#[test]
fn gather_latents_is_core_s() {
    let world = World::new(1);
    let (views, there, grid) = (&world.views, points_of(&world, 40), numbers(20, 5 * 6 * 6));
    let (cameras, at) = (vectors::cameras(views), vectors::points(&there));
    let residual = numbers(21, views.len() * 240);
    for has_residual in [0, 1] {
        let block = GatherBlock {
            view: 1,
            point_count: 40,
            // A four and two more.
            channel_count: 6,
            height: 5,
            width: 6,
            has_residual,
            pixel_centre: 0.0,
        };
        let mut gathered = vec![UNTOUCHED; views.len() * 240];
        dispatch(block, 80, |id, push| {
            viewfuse_shaders::gather_latents(id, push, &cameras, &at, &grid, &residual, &mut gathered);
        });
        let own = StartingAt { all: &residual[..], first: 240 };
        let expected: Vec<f32> =
            (0..240).map(|at| gathered_value(&views[..], &there[..], &grid[..], &own, &block, at)).collect();
        assert_eq!(gathered[240..480], expected);
        assert_eq!(gathered.iter().filter(|value| **value == UNTOUCHED).count(), gathered.len() - 240);

        let words: Vec<u32> = (0..90).map(|word| packed_f16(&grid[..], 180, word)).collect();
        let mut gathered = vec![UNTOUCHED; views.len() * 240];
        dispatch(block, 80, |id, push| {
            viewfuse_shaders::gather_latents_f16(id, push, &cameras, &at, &words, &residual, &mut gathered);
        });
        let expected: Vec<f32> =
            (0..240).map(|at| gathered_value_f16(&views[..], &there[..], &words[..], &own, &block, at)).collect();
        assert_eq!(gathered[240..480], expected);
        assert_eq!(gathered.iter().filter(|value| **value == UNTOUCHED).count(), gathered.len() - 240);
    }
}
