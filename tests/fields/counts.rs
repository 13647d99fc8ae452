//! What the published and the included networks ask of a GPU, counted without one: dispatches, transfers, and how many workgroups each
//! matrix product has. The same counts are in `host/results/vulkan.md`.

mod device;
mod gpu;

use device::{Counted, Counting};
use std::sync::Arc;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Memory, Transfers};
use viewfuse::field::gaussians::{GivenGaussians, optimisation_by_host, optimisation_on_device};
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::field::render::{RenderError, RenderOptions, RenderRun, Stage};
use viewfuse::field::training_free::TrainingFree;
use viewfuse::field::{Field, On, auto, genvs, pixelnerf};
use viewfuse::job::progress::Silent;
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::scene::few_shot::Selection;
use viewfuse::scene::gaussians::{Gaussian, GaussianScene};
use viewfuse_core::random::uniform;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::weights::Weights;
use viewfuse_kernels::rows::{Form, GainBlock, HarmonicTerm, Kernel, SHARED_BYTES};
use viewfuse_tests::cloud::{small_recipe, toy_cloud};
use viewfuse_tests::fields;
use viewfuse_tests::lorry::{photographs, target};
use viewfuse_tests::places::repository;

const SIDE: u32 = 128;
const SOURCES: u32 = 3;
/// Twice the units of the GPU with the most that this project was run on.
const ENOUGH_WORKGROUPS: u32 = 264;
/// Most dispatches of an included network's picture.
const MAX_OF_PIXELNERF: u64 = 600;
const MAX_OF_GENVS: u64 = 1500;

/// A picture of 128x128 from three views, counted.
fn counted(field: &(impl Field + Sync)) -> Counted {
    let device = Counting::default();
    let weights = Weights::mean(SOURCES);
    fields::picture(&device, field, &photographs(SOURCES, SIDE), &weights, &target(SIDE), 0.0, &Silent)
        .expect("a picture");
    device.take()
}

/// The published PixelNeRF; nothing is omitted.
fn pixelnerf() -> Counted {
    let checkpoint = pixelnerf::test_networks::deterministic(&pixelnerf::Architecture::published());
    let options = pixelnerf::PixelNerfOptions { omissions: pixelnerf::Omissions::NONE, ..Default::default() };
    counted(&pixelnerf::PixelNerf::new(&checkpoint, options).expect("a network"))
}

/// The published GeNVS with so many calls of its denoiser; nothing is omitted.
fn genvs(level_count: u32) -> Counted {
    let checkpoint = genvs::test_networks::deterministic(&genvs::Architecture::published());
    let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count };
    let plan = Plan { steps, ..Plan::published(0) };
    let options = genvs::GenvsOptions { plan, omissions: genvs::Omissions::NONE, ..Default::default() };
    counted(&genvs::Genvs::new(checkpoint, options).expect("a network"))
}

/// Workgroups of a product in the form with the most: the smallest tile.
fn workgroups(kernel: Kernel, rows: u32, columns: u32) -> u32 {
    let in_form = |form: &Form| form.elements(rows, columns) / form.invocations();
    kernel.forms().iter().map(in_form).max().unwrap_or_default()
}

/// The share of all multiply-adds in products that fill a GPU, and the others: a line each.
fn filling(counted: &Counted) -> (f64, Vec<String>) {
    let mut work = [0.0; 2];
    let mut small = Vec::new();
    for (kernel, shape, count) in &counted.products {
        let products = f64::from(shape.row_count) * f64::from(shape.inner_count) * f64::from(shape.column_count);
        let workgroups = workgroups(*kernel, shape.row_count, shape.column_count);
        let fills = workgroups >= ENOUGH_WORKGROUPS;
        work[usize::from(fills)] += products * *count as f64;
        if !fills {
            let [rows, inner, columns] = [shape.row_count, shape.inner_count, shape.column_count];
            small.push(format!("{} {rows}x{inner}x{columns}, {count} times: {workgroups}", kernel.name()));
        }
    }
    (work[1] / (work[0] + work[1]), small)
}

/// A line for each kernel that is dispatched.
fn list(dispatches: impl IntoIterator<Item = u64>) {
    for (kernel, count) in Kernel::ALL.into_iter().zip(dispatches).filter(|(_, count)| *count > 0) {
        println!("  {count} {}", kernel.name());
    }
}

fn print(name: &str, counted: &Counted) {
    println!("{name}: {} dispatches, {:?}", counted.all(), counted.transfers.transfers());
    list(counted.dispatches.iter().copied());
    let (share, small) = filling(counted);
    println!("  {:.1} % of the multiply-adds in products with {ENOUGH_WORKGROUPS} workgroups or more", 100.0 * share);
    small.iter().for_each(|line| println!("  below: {line}"));
}

#[test]
fn a_picture_of_pixelnerf_is_few_dispatches() {
    let counted = pixelnerf();
    print("PixelNeRF, 128x128, three views, exact", &counted);
    assert!(counted.all() <= 2500, "{} dispatches", counted.all());
    assert!(counted.transfers.transfers().downloads <= 9, "{:?}", counted.transfers);
    let (share, small) = filling(&counted);
    assert!(share > 0.98, "{share}: {small:?}");
}

#[test]
fn a_call_of_the_denoiser_is_few_dispatches() {
    let [short, long] = [2, 3].map(genvs);
    print("GeNVS, 128x128, three views, two calls", &short);
    let call = long.all() - short.all();
    println!("a call: {call} dispatches");
    list(long.dispatches.iter().zip(&short.dispatches).map(|(long, short)| long - short));
    // A group norm takes two of them, and 117 of its layers are group norms.
    assert!(call <= 423, "{call} dispatches");
    let waits = |counted: &Counted| counted.transfers.transfers().downloads;
    assert!(waits(&long) - waits(&short) <= 1, "a call waits more than once");
    let (share, small) = filling(&long);
    assert!(share > 0.93, "{share}: {small:?}");
}

/// The included networks have the published ones' layers in a few channels: their products are small, and take forms
/// that every device's workgroups have room for.
#[test]
fn the_included_networks_fill_a_gpu_where_they_can() {
    let open = |name: &str| Checkpoint::open(&repository().join("host/models").join(name)).expect("a checkpoint");
    let options = pixelnerf::PixelNerfOptions { omissions: pixelnerf::Omissions::NONE, ..Default::default() };
    let network = pixelnerf::PixelNerf::new(&open("pixelnerf_cars.safetensors"), options).expect("a network");
    let options = genvs::GenvsOptions { omissions: genvs::Omissions::NONE, ..Default::default() };
    let denoising = genvs::Genvs::new(open("genvs_cars.safetensors"), options).expect("a network");
    for (name, counted, max_dispatches, min_share) in [
        ("included PixelNeRF, 128x128, three views, exact", counted(&network), MAX_OF_PIXELNERF, 0.99),
        // Nearly all of the rest has 256 workgroups, or is an encoder's.
        ("included GeNVS, 128x128, three views, exact", counted(&denoising), MAX_OF_GENVS, 0.6),
    ] {
        print(name, &counted);
        assert!(counted.all() <= max_dispatches, "{name}: {} dispatches", counted.all());
        let (share, small) = filling(&counted);
        assert!(share > min_share, "{name}: {share}: {small:?}");
    }
    // What Vulkan promises of a workgroup's memory, and what all but small devices have.
    let is_within = |form: &Form| form.shared_bytes() <= if form.needs_fours() { 32 << 10 } else { SHARED_BYTES };
    assert!(Form::ALL.iter().chain(&Form::FUSED).all(is_within));
    let wanting: Vec<&Form> = Form::ROUNDED.iter().filter(|form| !is_within(form)).collect();
    assert_eq!(wanting, [&Form::TwoHalves], "a stated need of 48 KiB");
}

/// `render tests/data/room` with its three targets under what is chosen for it, in small pictures: transfers do not
/// depend on their size.
#[test]
fn a_choice_and_three_pictures_are_few_transfers() {
    let (device, field, scene) = (gpu::CpuAsGpu::default(), TrainingFree::default(), fields::sample("room"));
    let (renderer, options) =
        (On { device: &device, field: &field }, RenderOptions { size: Some([64, 48]), ..RenderOptions::default() });
    let targets = Selection { targets: Some("2,5,8".to_owned()), ..Selection::default() };
    let job = targets.resolve(&scene, 2).expect("a job");
    let run = RenderRun { scene: &scene, job: &job, renderer: &renderer, options: &options, progress: &Silent };
    auto::render(&run, None, |_, frame, _| {
        assert_eq!(frame.shares.len(), 4, "three depths of the sweep and Gaussians");
        Ok::<(), RenderError>(())
    })
    .expect("three pictures");
    let transfers = device.transfers();
    println!("room, three targets: {transfers:?}");
    assert!(transfers.uploads <= 57 && transfers.downloads <= 38, "{transfers:?}");
}

/// Given Gaussians of this standard deviation, whose colours depend on the direction.
fn given(log_scale: f32) -> GivenGaussians {
    let place = |index: u32| [0, 1, 2].map(|axis| 0.7 * (uniform(0, index, axis) - 0.5));
    let gaussian = |index| Gaussian {
        position: place(index),
        log_scales: [log_scale; 3],
        rotation: [1.0, 0.0, 0.0, 0.0],
        opacity: 1.0,
        f_dc: place(index),
    };
    let gaussians: Vec<Gaussian> = (0..500).map(gaussian).collect();
    let f_rest = (0..500 * 45).map(|index| 0.2 * (index as f32).sin()).collect();
    let scene = GaussianScene { gaussians, degree: 3, f_rest, is_antialiased: false };
    GivenGaussians { scene, notes: Vec::new(), unit: 1.0 }
}

/// Two pictures of given Gaussians, with the transfers after each.
fn pictures_of_given<D: Device + Sync>(
    device: &D,
    field: &GivenGaussians,
    side: u32,
) -> [(Vec<[f32; 4]>, Transfers); 2] {
    let (renderer, options) = (On { device, field }, RenderOptions::default());
    let mut stage = Stage::of_sources(Arc::new(photographs(4, side)), &renderer, &options, &Silent).expect("a field");
    stage.weigh_by(&[], &Silent).expect("no weighting");
    [0, 1].map(|_| {
        let picture = stage.picture(&target(side), &Weights::mean(4), 0.0, &Silent).expect("a picture");
        (picture.colours, device.transfers())
    })
}

/// They are taken to the device once for all pictures, and what a picture shows is waited for once.
#[test]
fn pictures_of_gaussians_need_no_uploads() {
    let device = gpu::CpuAsGpu::default();
    let [(_, first), (_, second)] = pictures_of_given(&device, &given(-3.0), 48);
    assert_eq!(first.uploads, 2, "Gaussians and their terms");
    assert_eq!(second.uploads, first.uploads);
    assert_eq!([first.downloads, second.downloads], [3, 4], "two pictures show whether they are of the scene");
}

/// Each Gaussian fills the picture: lists have no room for all of them in the first picture, nor in the first larger one.
#[test]
fn lists_without_room_are_made_again() {
    let (device, field) = (gpu::CpuAsGpu::default(), given(1.0));
    let [(ours, first), (again, second)] = pictures_of_given(&device, &field, 128);
    let [(cpus, _), _] = pictures_of_given(&Cpu, &field, 128);
    assert!(ours == cpus && again == cpus);
    assert!(cpus.iter().all(|colour| colour[3] > 0.5), "all pixels show something");
    assert_eq!([first.downloads, second.downloads], [5, 6]);
}

/// An optimisation that goes as far as it can before it waits makes the same scene as one in one go, with a wait each
/// time that the Gaussians change.
#[test]
fn an_optimisation_in_pieces_is_the_same() {
    let (images, points) = toy_cloud();
    let begun = |device| optimisation_on_device(device, images, points, small_recipe(), None);
    let devices = [gpu::CpuAsGpu::default(), gpu::CpuAsGpu::default()];
    let [mut whole, mut ours] = [0, 1].map(|at| begun(&devices[at]).expect("memory").expect("points"));
    whole.run_to(u32::MAX, &Silent).expect("steps");
    let mut pieces = 0;
    while !ours.advance(&Silent).expect("steps") {
        pieces += 1;
        let waits = devices[1].transfers().downloads;
        assert!(waits < pieces, "{waits} waits before piece {pieces} was waited for");
    }
    assert!(pieces > 3, "{pieces}");
    // Lists without room are made again when the iterations so far are waited for: what was asked for is out of date.
    let cramped = optimisation_on_device(&devices[0], images, points, small_recipe(), Some(1));
    let mut cramped = cramped.expect("memory").expect("points");
    while !cramped.advance(&Silent).expect("steps") {
        cramped.finish().expect("steps");
    }
    assert!(whole.optimised().expect("Gaussians") == cramped.optimised().expect("Gaussians"));
    // So it is at the end, when more iterations follow.
    whole.extend(3);
    ours.extend(3);
    whole.run_to(u32::MAX, &Silent).expect("steps");
    ours.run_to(u32::MAX, &Silent).expect("steps");
    assert!(whole.optimised().expect("Gaussians") == ours.optimised().expect("Gaussians"));
    assert_eq!(devices[1].transfers().downloads, pieces, "one wait for each piece");
}

/// Of an optimisation with levels, growth and harmonics, after every third iteration: the host's Gaussians, of which
/// nothing comes from the device but what pictures need.
#[test]
fn gaussians_come_without_their_states() {
    let device = gpu::CpuAsGpu::default();
    let (images, points) = toy_cloud();
    // Gains' sums have another order on a device.
    let mut recipe = small_recipe();
    recipe.rates[5] = 0.0;
    let mut ours = optimisation_on_device(&device, images, points, recipe, None).expect("memory").expect("points");
    let mut hosts = optimisation_by_host(&Cpu, images, points, recipe).expect("memory").expect("points");
    let mut degrees = Vec::new();
    for end in (0..=ours.iteration_count()).step_by(3) {
        ours.run_to(end, &Silent).expect("steps");
        hosts.run_to(end, &Silent).expect("steps");
        let before = device.transfers();
        let seen = ours.optimised().expect("Gaussians");
        let after = device.transfers();
        assert!(seen == hosts.optimised().expect("Gaussians"), "after {end} iterations");
        // All terms come that there is room for.
        let room = if seen.degree == 0 { 0 } else { 15 * seen.gaussians.len() * size_of::<HarmonicTerm>() };
        let most = size_of_val(&seen.gaussians[..]) + room + 64 * size_of::<GainBlock>();
        let bytes = after.downloaded_bytes - before.downloaded_bytes;
        assert!(bytes <= most as u64, "{bytes} bytes of {most} after {end} iterations");
        assert!(after.downloads - before.downloads <= 1, "one wait");
        degrees.push(seen.degree);
    }
    println!("an optimisation of {} iterations: {:?}", ours.iteration_count(), device.transfers());
    assert!((0..=3).all(|degree| degrees.contains(&degree)), "{degrees:?}");
}
