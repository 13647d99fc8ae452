//! Gaussians of the sample scene on each device: lists of tiles, and pictures of a scene that is optimised.

use crate::candidate::{Candidate, tests};
use libtest_mimic::Failed;
use std::sync::OnceLock;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, DeviceError, Memory};
use viewfuse::field::gaussians::{
    Drawn, Optimised, Recipe, Splatter, Tiles, optimisation_by_host, optimisation_on_device, optimised,
};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::to_rgb8;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::metrics::psnr;
use viewfuse_core::random::uniform;
use viewfuse_kernels::gaussians::TileBlock;
use viewfuse_kernels::rows::{ListBlock, ProjectedGaussian, TILE_RUN, WORKGROUP};
use viewfuse_tests::cloud::toy_cloud;
use viewfuse_vulkan::GpuOptions;

tests!(
    a_scene_is_as_good_as_the_cpus,
    lists_of_a_large_picture_are_the_hosts,
    iterations_of_a_device_are_the_hosts,
    a_devices_scene_depends_on_no_capacity_and_no_run,
    an_iteration_needs_no_transfer,
    a_picture_has_the_same_bits_with_lists_of_the_device,
);

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

fn splatter<'d, D>(device: &'d D, made: &Optimised) -> Splatter<'d, D> {
    let Optimised { near, background, is_antialiased, .. } = *made;
    Splatter { device, near, background, is_antialiased }
}

/// The PSNR of the Gaussians at the sources, decibels.
fn score(made: &Optimised) -> f64 {
    let images = &toy_cloud().0;
    let splatter = splatter(&Cpu, made);
    let score = |index: usize| {
        let camera = images.images[index].camera.block(0);
        let rendered =
            splatter.rendered(&made.gaussians, made.gaussians.len(), &[camera], 0.5).expect("a picture").remove(0);
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

/// A device's lists of a picture's tiles: where each begins, and the entries of all.
fn lists_on(device: &Vulkan, block: ListBlock, splats: &[ProjectedGaussian]) -> Result<[Vec<u32>; 2], DeviceError> {
    let zeros = |count: u32| device.zeros(count as usize);
    let splats = device.upload(splats)?;
    let mut masks = zeros(block.bin_count() * block.mask_count())?;
    let (mut counts, mut before) = (zeros(block.most_counts())?, zeros(block.most_counts())?);
    let mut sums = zeros(block.run_count() * TILE_RUN)?;
    let (mut starts, status, mut after) = (zeros(block.tile_count() + 1)?, zeros(3)?, zeros(3)?);
    let (mut keys, mut entries) = (device.zeros(block.capacity as usize)?, zeros(block.capacity)?);
    device.mark_bins(&block, &splats, &mut masks)?;
    device.count_entries(&block, &splats, &masks, &mut counts)?;
    device.sum_entries(&block, &counts, &mut before, &mut sums)?;
    device.start_tiles(&block, &sums, &status, &mut starts, &mut after)?;
    device.list_entries(&block, &splats, &masks, &starts, &before, &mut keys)?;
    device.sort_entries(&block, &starts, &keys, &mut entries)?;
    Ok([device.download(&starts)?, device.download(&entries)?])
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
    let [starts, entries] = lists_on(&device, block, &splats)?;
    assert!(starts == expected.starts && entries == expected.entries);
    Ok(())
}

/// Few Gaussians on small pictures, in all that an optimisation has: levels, harmonics, growth.
fn small_recipe() -> Recipe {
    let small = Recipe { side: 32, iterations: [0, 6, 6, 30], cell: 8.0, random_count: 100, ..Recipe::default() };
    Recipe { max_per_pixel: 0.5, degree: 3, grows: true, ..small }
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
/// nearly 0, so that only scores are compared. On the CPU all but the sums for the gains are the host's, bit by bit.
fn iterations_of_a_device_are_the_hosts(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let recipe = small_recipe();
    let mut constant = recipe;
    constant.rates[5] = 0.0;
    let all = recipe.iterations.iter().sum();
    let (cpus, hosts) = (on_device(&Cpu, constant, all, None), by_host(&Cpu, constant, all));
    assert_eq!(hosts.degree, 3, "all that an optimisation has");
    assert!(cpus == hosts, "on the CPU, without gains");
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

/// At one level: 12 bytes are read after 32 iterations.
fn an_iteration_needs_no_transfer(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let (images, points) = toy_cloud();
    for degree in [0, 1] {
        let recipe = Recipe { iterations: [0, 0, 0, 200], grows: false, degree, ..small_recipe() };
        let optimisation = optimisation_on_device(&device, images, points, recipe, None)?;
        let mut optimisation = optimisation.expect("enough points");
        // From here on there are harmonics, if there are any at all.
        optimisation.run_to(64, &Silent)?;
        let dispatches = |device: &Vulkan| device.kernel_times().iter().map(|time| time.dispatches).sum::<u64>();
        let (before, dispatched) = (device.transfers(), dispatches(&device));
        optimisation.run_to(64 + 31, &Silent)?;
        assert_eq!(device.transfers(), before, "no transfer in 31 iterations");
        optimisation.run_to(64 + 32, &Silent)?;
        let after = device.transfers();
        assert_eq!(after.uploads, before.uploads);
        assert_eq!((after.downloads - before.downloads, after.downloaded_bytes - before.downloaded_bytes), (1, 12));
        let a_piece = (dispatches(&device) - dispatched) as f64 / 32.0;
        assert_eq!(a_piece, 15.0 + f64::from(degree), "dispatches an iteration");
    }
    Ok(())
}

fn a_picture_has_the_same_bits_with_lists_of_the_device(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let made = cpus_scene();
    let uploaded = device.upload(&made.gaussians)?;
    let splatter = splatter(&device, made);
    let before = device.transfers();
    let [ours, hosts] = [true, false].map(|are_lists_on_device| {
        let drawn = splatter.drawn(&uploaded, made.gaussians.len(), &camera(), are_lists_on_device);
        let Drawn { colours, depths } = drawn.expect("a picture");
        let transfers = device.transfers();
        (device.download(&colours).expect("colours"), device.download(&depths).expect("depths"), transfers)
    });
    assert!(ours.0 == hosts.0 && ours.1 == hosts.1);
    assert!(ours.0.iter().any(|colour| colour[3] > 0.5), "something is seen");
    let downloaded = ours.2.downloaded_bytes - before.downloaded_bytes;
    assert!(downloaded == 12 && ours.2.uploads == before.uploads, "{downloaded} bytes");
    Ok(())
}
