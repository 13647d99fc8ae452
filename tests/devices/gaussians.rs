//! Gaussians of the sample scene on each device: derivatives, and pictures of a scene that is optimised.

use crate::candidate::{Candidate, tests};
use libtest_mimic::Failed;
use std::sync::OnceLock;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Memory};
use viewfuse::field::gaussians::{
    Drawn, Optimised, Recipe, Room, Splatted, Splatter, Tiles, optimisation_by_host, optimisation_on_device, optimised,
};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::to_rgb8;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::metrics::psnr;
use viewfuse_core::random::uniform;
use viewfuse_kernels::gaussians::lists::ListStatus;
use viewfuse_kernels::gaussians::{SplatBlock, TileBlock};
use viewfuse_kernels::rows::{GaussianBlock, ListBlock, ProjectedGaussian, TILE_RUN, WORKGROUP};
use viewfuse_tests::cloud::{small_recipe, toy_cloud};
use viewfuse_vulkan::GpuOptions;

tests!(
    derivatives_of_a_scene_are_the_cpus,
    a_scene_is_as_good_as_the_cpus,
    lists_of_tiles_are_the_hosts,
    lists_of_a_large_picture_are_the_hosts,
    iterations_of_a_device_are_the_hosts,
    a_devices_scene_depends_on_no_capacity_and_no_run,
    an_iteration_needs_no_transfer,
    a_picture_has_the_same_bits_with_lists_of_the_device,
);

/// Most splats of a tile: fewer than those whose loops Mesa's llvmpipe ends (`viewfuse_field::gaussians::optimised`).
const MAX_LISTED: u32 = 100;
/// Largest difference of derivatives, as a share of the norm of all: sums of at most 64 pixels and some 50 splats, in
/// another order and with other last digits of the exponential, differ by some 1e-5.
const MAX_DIFFERENCE: f64 = 1.0e-3;
/// Largest difference of scores, decibels: on another device the last digits differ, and the steps make them grow.
const MAX_LOSS: f64 = 0.5;

/// A short one.
fn recipe() -> Recipe {
    Recipe { iterations: [0, 24, 16, 16], ..Recipe::default() }
}

/// A scene of Gaussians that a device optimised.
fn scene<D: Device>(device: &D) -> Optimised {
    let (images, points) = toy_cloud();
    optimised(device, images, points, recipe(), &Silent).expect("steps").expect("enough points")
}

/// The CPU's.
fn cpus_scene() -> &'static Optimised {
    static SCENE: OnceLock<Optimised> = OnceLock::new();
    SCENE.get_or_init(|| scene(&Cpu))
}

/// The first source's camera.
fn camera() -> CameraBlock {
    toy_cloud().0.images[0].camera.block(0)
}

/// The longest list of splats of a tile.
fn longest_list(made: &Optimised) -> u32 {
    let (camera, gaussian_count) = (camera(), made.gaussians.len() as u32);
    let block = SplatBlock { camera, near: made.near, gaussian_count, ..SplatBlock::default() };
    let mut splats = Cpu.zeros(made.gaussians.len()).expect("memory");
    Cpu.project_gaussians(&block, &made.gaussians, &mut splats).expect("splats");
    let lists = Tiles::of(&TileBlock::new(camera.width, camera.height, made.background), &splats);
    lists.starts.windows(2).map(|part| part[1] - part[0]).max().unwrap_or(0)
}

/// Every so many Gaussians of the CPU's scene, so that no list is too long.
fn thinned() -> Optimised {
    let all = cpus_scene();
    let every =
        |step: usize| Optimised { gaussians: all.gaussians.iter().copied().step_by(step).collect(), ..all.clone() };
    (1..all.gaussians.len()).map(every).find(|cloud| longest_list(cloud) <= MAX_LISTED).expect("a step")
}

fn splatter<'d, D: Device>(device: &'d D, made: &Optimised) -> Splatter<'d, D> {
    let Optimised { near, background, is_antialiased, .. } = *made;
    Splatter { device, near, background, is_antialiased, harmonics: None }
}

/// Derivatives by the Gaussians of a loss whose derivatives by the first source's pixels have all signs.
fn derivatives<D: Device>(device: &D, made: &Optimised) -> Vec<GaussianBlock> {
    let splatter = splatter(device, made);
    let camera = camera();
    let uploaded = device.upload(&made.gaussians).expect("Gaussians");
    let picture = splatter.picture(&uploaded, made.gaussians.len(), &camera).expect("a picture");
    let by = |index: usize| [0, 1, 2, 3].map(|channel| ((index * 7 + channel * 5) % 11) as f32 / 5.0 - 1.0);
    let by_pixels: Vec<[f32; 4]> = (0..(camera.width * camera.height) as usize).map(by).collect();
    splatter.gradients(&uploaded, &picture, &by_pixels).expect("derivatives")
}

/// Some of a Gaussian's parameters.
type Part = fn(&GaussianBlock) -> Vec<f32>;

fn derivatives_of_a_scene_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let made = thinned();
    let (cpu, ours) = (derivatives(&Cpu, &made), derivatives(&device, &made));
    let groups: [(&str, Part); 5] = [
        ("position", |gaussian| gaussian.position.to_vec()),
        ("opacity", |gaussian| vec![gaussian.opacity]),
        ("scales", |gaussian| gaussian.log_scales.to_vec()),
        ("rotation", |gaussian| gaussian.rotation.to_vec()),
        ("colour", |gaussian| gaussian.colour.to_vec()),
    ];
    let norm = |values: &[f32]| values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt();
    for (name, part) in groups {
        let [a, b] = [&cpu, &ours].map(|all| all.iter().flat_map(part).collect::<Vec<f32>>());
        let apart: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let (difference, all) = (norm(&apart), norm(&a));
        assert!(
            all > 0.0 && difference <= MAX_DIFFERENCE * all,
            "{name}: {difference:e} of {all:e}, {} Gaussians",
            made.gaussians.len()
        );
    }
    Ok(())
}

/// The PSNR of the Gaussians at the sources, decibels.
fn score(made: &Optimised) -> f64 {
    let images = &toy_cloud().0;
    let (splatter, room) = (splatter(&Cpu, made), Room::default());
    let score = |index: usize| {
        let camera = images.images[index].camera.block(0);
        let begun = splatter.begin(&made.gaussians, made.gaussians.len(), &camera, &room).expect("memory");
        let rendered = splatter.rendered(&made.gaussians, made.gaussians.len(), begun, &room, 0.5).expect("a picture");
        let picture = to_rgb8(&rendered.colours, [rendered.width, rendered.height]);
        psnr(picture.as_raw(), images.picture(index).as_raw())
    };
    (0..images.images.len()).map(score).sum::<f64>() / images.images.len() as f64
}

fn a_scene_is_as_good_as_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let ours = scene(&device);
    if device.is_software() {
        assert_eq!(&ours, cpus_scene(), "by the CPU's own loops");
    }
    let (score, cpus) = (score(&ours), score(cpus_scene()));
    assert!(score > 15.0 && score > cpus - MAX_LOSS, "{score} dB, on the CPU {cpus} dB");
    Ok(())
}

/// A device's lists of a picture's tiles.
fn lists_on<D: Device>(device: &D, block: ListBlock, splats: &[ProjectedGaussian]) -> (Vec<u32>, Vec<u32>, ListStatus) {
    let zeros = |count: u32| device.zeros(count as usize).expect("memory");
    let splats = device.upload(splats).expect("splats");
    let mut masks = zeros(block.bin_count() * block.mask_count());
    let (mut counts, mut before) = (zeros(block.most_counts()), zeros(block.most_counts()));
    let mut sums = zeros(block.run_count() * TILE_RUN);
    let (mut starts, status, mut after) = (zeros(block.tile_count() + 1), zeros(3), zeros(3));
    let (mut keys, mut entries) = (device.zeros(block.capacity as usize).expect("memory"), zeros(block.capacity));
    let mut run = || {
        device.mark_bins(&block, &splats, &mut masks)?;
        device.count_entries(&block, &splats, &masks, &mut counts)?;
        device.sum_entries(&block, &counts, &mut before, &mut sums)?;
        device.start_tiles(&block, &sums, &status, &mut starts, &mut after)?;
        device.list_entries(&block, &splats, &masks, &starts, &before, &mut keys)?;
        device.sort_entries(&block, &starts, &keys, &mut entries)?;
        let status = device.download(&after)?;
        Ok::<_, viewfuse::device::DeviceError>((device.download(&starts)?, device.download(&entries)?, status))
    };
    let (starts, mut entries, status) = run().expect("lists");
    entries.truncate(starts[starts.len() - 1] as usize);
    (starts, entries, ListStatus::of([status[0], status[1], status[2]]))
}

/// Of all Gaussians of the CPU's scene from several places, and of none of them.
fn lists_of_tiles_are_the_hosts(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let made = cpus_scene();
    for image in toy_cloud().0.images.iter().step_by(3) {
        let camera = image.camera.block(0);
        for gaussians in [&made.gaussians[..], &made.gaussians[..1]] {
            let gaussian_count = gaussians.len() as u32;
            let block = SplatBlock { camera, near: made.near, gaussian_count, ..SplatBlock::default() };
            let mut splats = Cpu.zeros(gaussians.len())?;
            Cpu.project_gaussians(&block, &gaussians.to_vec(), &mut splats)?;
            let expected = Tiles::of(&TileBlock::new(camera.width, camera.height, made.background), &splats);
            let total = expected.entries.len() as u32;
            let CameraBlock { width, height, .. } = camera;
            let block = ListBlock { width, height, splat_count: gaussian_count, capacity: total.max(1) };
            let on_cpu = lists_on(&Cpu, block, &splats);
            let status = ListStatus { is_over: false, done: 1, most: total };
            assert_eq!(on_cpu, (expected.starts.clone(), expected.entries.clone(), status), "on the CPU");
            assert!(lists_on(&device, block, &splats) == on_cpu, "{gaussian_count} Gaussians");
            if total > 1 {
                let (starts, entries, status) = lists_on(&device, ListBlock { capacity: total - 1, ..block }, &splats);
                assert!(starts.iter().all(|start| *start == 0) && entries.is_empty());
                assert_eq!(status, ListStatus { is_over: true, done: 0, most: total });
            }
        }
    }
    Ok(())
}

/// Of so many splats on so large a picture that a part of them has more masks than a workgroup has invocations.
fn lists_of_a_large_picture_are_the_hosts(candidate: &Candidate) -> Result<(), Failed> {
    const COUNT: u32 = 60_000;
    let device = candidate.vulkan(&GpuOptions::default())?;
    let (width, height) = (1021, 643);
    let splat = |index: u32| {
        let [x, y, depth, size] = [0, 1, 2, 3].map(|stream| uniform(7, index, stream));
        let (right, down) = (0.5 + 3.0 * size, 3.5 - 3.0 * size);
        ProjectedGaussian {
            mean: [x * width as f32, y * height as f32],
            // Many of the same depth.
            depth: 1.0 + (depth * 500.0).floor(),
            opacity: 0.1 + 0.8 * depth,
            conic: [1.0 / (right * right), 0.0, 1.0 / (down * down)],
            extent: [3.4 * right, 3.4 * down],
            ..ProjectedGaussian::default()
        }
    };
    let splats: Vec<ProjectedGaussian> = (0..COUNT).map(splat).collect();
    let expected = Tiles::of(&TileBlock::new(width, height, [0.0; 3]), &splats);
    let block = ListBlock { width, height, splat_count: COUNT, capacity: expected.entries.len() as u32 };
    assert!(block.mask_count() / block.part_count() > WORKGROUP, "parts of few masks");
    let (starts, entries, _) = lists_on(&device, block, &splats);
    assert!(starts == expected.starts && entries == expected.entries);
    Ok(())
}

/// What becomes of a recipe on a device, after so many iterations.
fn on_device<D: Device>(device: &D, recipe: Recipe, end: u32, capacity: Option<usize>) -> Optimised {
    let (images, points) = toy_cloud();
    let optimisation = optimisation_on_device(device, images, points, recipe, capacity).expect("a device");
    let mut optimisation = optimisation.expect("enough points");
    optimisation.run_to(end, &Silent).expect("steps");
    optimisation.optimised().expect("Gaussians")
}

/// The same by the host's lists, loss and steps.
fn by_host<D: Device>(device: &D, recipe: Recipe, end: u32) -> Optimised {
    let (images, points) = toy_cloud();
    let mut optimisation = optimisation_by_host(device, images, points, recipe).expect("a device").expect("points");
    optimisation.run_to(end, &Silent).expect("steps");
    optimisation.optimised().expect("Gaussians")
}

/// The first iterations differ by last digits at most; then these make steps of other signs where derivatives are
/// nearly 0, so that only scores are compared. On the CPU all but the sums for the gains are the host's, bit by bit
/// (`tests/fields/counts.rs`).
fn iterations_of_a_device_are_the_hosts(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let recipe = small_recipe();
    let all = recipe.iterations.iter().sum();
    let (cpus, hosts) = (on_device(&Cpu, recipe, all, None), by_host(&Cpu, recipe, all));
    assert!((score(&cpus) - score(&hosts)).abs() < MAX_LOSS, "{} and {} dB", score(&cpus), score(&hosts));
    assert!(hosts.gains != vec![[1.0; 3]; hosts.gains.len()], "gains are optimised");
    let apart = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f32::max);
    let gains = cpus.gains.iter().zip(&hosts.gains).map(|(a, b)| apart(a, b)).fold(0.0, f32::max);
    assert!(gains < 0.01, "gains are {gains} apart");

    for is_antialiased in [false, true] {
        let recipe = Recipe { is_antialiased, ..recipe };
        let (ours, hosts) = (on_device(&device, recipe, all, None), by_host(&Cpu, recipe, all));
        assert!(score(&ours) > score(&hosts) - MAX_LOSS, "{} dB, by the host {} dB", score(&ours), score(&hosts));
        assert!(ours == on_device(&device, recipe, all, None), "the same in every run");
    }
    Ok(())
}

fn a_devices_scene_depends_on_no_capacity_and_no_run(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let (recipe, end) = (small_recipe(), u32::MAX);
    let once = on_device(&device, recipe, end, None);
    assert!(once == on_device(&device, recipe, end, Some(1)), "with lists that are too short at first");
    assert!(on_device(&Cpu, recipe, end, None) == on_device(&Cpu, recipe, end, Some(100)), "on the CPU, too");
    Ok(())
}

/// At one level: 12 bytes are read after 128 iterations.
fn an_iteration_needs_no_transfer(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let (images, points) = toy_cloud();
    for degree in [0, 1] {
        let recipe = Recipe { iterations: [0, 0, 0, 300], grows: false, degree, ..small_recipe() };
        let optimisation = optimisation_on_device(&device, images, points, recipe, None)?;
        let mut optimisation = optimisation.expect("enough points");
        // From here on there are harmonics, if there are any at all.
        optimisation.run_to(128, &Silent)?;
        let dispatches = |device: &viewfuse::device::vulkan::Vulkan| {
            device.kernel_times().iter().map(|time| time.dispatches).sum::<u64>()
        };
        let (before, dispatched) = (device.transfers(), dispatches(&device));
        optimisation.run_to(128 + 127, &Silent)?;
        assert_eq!(device.transfers(), before, "no transfer in 127 iterations");
        optimisation.run_to(128 + 128, &Silent)?;
        let after = device.transfers();
        assert_eq!(after.uploads, before.uploads);
        assert_eq!((after.downloads - before.downloads, after.downloaded_bytes - before.downloaded_bytes), (1, 12));
        let a_piece = (dispatches(&device) - dispatched) as f64 / 128.0;
        assert_eq!(a_piece, 15.0 + f64::from(degree), "dispatches an iteration");
    }
    Ok(())
}

fn a_picture_has_the_same_bits_with_lists_of_the_device(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let made = cpus_scene();
    let uploaded = device.upload(&made.gaussians)?;
    let splatter = splatter(&device, made);
    let Splatted { lists, colours, depths, .. } = splatter.picture(&uploaded, made.gaussians.len(), &camera())?;
    let (colours, depths) = (device.download(&colours)?, device.download(&depths)?);
    assert!(colours.iter().any(|colour| colour[3] > 0.5), "something is seen");
    let needed = lists.entries.len();
    for (capacity, has_room) in [(needed, true), (2 * needed, true), (needed - 1, false)] {
        let before = device.transfers();
        let Drawn { colours: ours, depths: our_depths, status } =
            splatter.drawn(&uploaded, made.gaussians.len(), &camera(), capacity)?;
        let numbers = status.expect("lists of the device").get()?;
        let after = device.transfers();
        assert!(after.uploads == before.uploads && after.downloaded_bytes == before.downloaded_bytes + 12);
        assert_eq!(numbers, [u32::from(!has_room), u32::from(has_room), needed as u32], "room for {capacity}");
        let (ours, our_depths) = (device.download(&ours)?, device.download(&our_depths)?);
        match has_room {
            true => assert!(ours == colours && our_depths == depths, "room for {capacity}"),
            false => assert!(ours.iter().all(|colour| colour[3] == 0.0), "an empty picture"),
        }
    }
    Ok(())
}
