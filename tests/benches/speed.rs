//! How fast, and against what limit: `cargo bench -p viewfuse-tests`.
//!
//! - `weights`: error weighting of 32 sources for 251 targets on one core (SRN's test trajectory).
//! - `sample`: the field at a point, on one core; the unit in which a render's time is counted. A sample asks `S`
//!   views; each view costs a projection (21 operations and a reciprocal), a bilinear look-up of 4 channels (4 texels
//!   of 16 bytes, 30 operations) and, for a view with a weight, one of the depths (4 of 4 bytes, 25 operations) and its
//!   fusion (25 operations): about 100 operations and 80 bytes a view. The maps of 15 views at 160x120 are 5.8 MB, so
//!   the look-ups hit the second-level cache: it is the chain of dependent operations that bounds a sample, not memory.
//! - `prepare`, `encode`, `render`: the stages of the sample scene at its own size, on all cores.
//! - `40 thousand Gaussians`: opening a file of them, from the system's cache.
//! - with `VIEWFUSE_BENCH_SCENE=FOLDER` (a full path): the first view of that scene from all others at 160 pixels
//!   across, from the photographs in memory to the picture, on the CPU and on each Vulkan device.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::path::Path;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::field::render::{RenderOptions, Stage};
use viewfuse::field::training_free::TrainingFree;
use viewfuse::field::{AnyField, On};
use viewfuse::job::progress::Silent;
use viewfuse::scene::few_shot::target_of;
use viewfuse::scene::gaussians::{Gaussian, GaussianScene};
use viewfuse::scene::photographs::Album;
use viewfuse::scene::photographs::object_box::find_object;
use viewfuse::scene::{Scene, SceneFrame};
use viewfuse::weighting::Weighting;
use viewfuse_core::Vec3;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_core::pose::Pose;
use viewfuse_core::random::uniform;
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{AngleKind, Scheme, weigh};
use viewfuse_core::weights::Weights;
use viewfuse_kernels::visual_hull::shade::sample;
use viewfuse_tests::devices::vulkan_devices;
use viewfuse_vulkan::GpuOptions;

/// Cameras spread over the upper part of a sphere, looking at the origin.
fn spiral(first: u32, count: u32) -> Vec<Pose> {
    (first..first + count)
        .map(|index| {
            let azimuth = index as f32 * 2.399_963;
            let height = 0.1 + 0.8 * (index % 97) as f32 / 97.0;
            let radius = (1.0 - height * height).sqrt();
            let centre = Vec3::new(radius * azimuth.cos(), radius * azimuth.sin(), height) * 1.3;
            Pose::look_at(centre, Vec3::ZERO, Vec3::Z).expect("a camera that looks at the origin")
        })
        .collect()
}

fn weights(criterion: &mut Criterion) {
    let sources = Sources::<32>::new(&spiral(0, 32)).expect("32 sources");
    let targets = spiral(100, 251);
    let mut group = criterion.benchmark_group("weights");
    group.throughput(Throughput::Elements(251));
    for (name, scheme) in [
        ("error alpha=1", Scheme::error(1.0, AngleKind::PrincipalAxis)),
        ("error alpha=0.5", Scheme::error(0.5, AngleKind::PrincipalAxis)),
        ("distance", Scheme::distance(1)),
        ("gaussian", Scheme::gaussian(1.0)),
    ] {
        let scheme = scheme.expect("a scheme in range");
        group.bench_function(format!("32 sources, 251 targets, {name}"), |bencher| {
            bencher.iter(|| {
                for target in &targets {
                    black_box(weigh(scheme, black_box(&sources), black_box(target)));
                }
            });
        });
    }
    group.finish();
}

fn stages(criterion: &mut Criterion) {
    let scene = Scene::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("data/toy")).expect("the sample scene");
    let sources: Vec<usize> = (0..20).collect();
    let album = Album::open(&scene, 0..scene.views.len(), &Silent).expect("its photographs");
    let options = RenderOptions::default();
    let weighting = Weighting::default_scheme();
    let progress = Silent;
    let field = TrainingFree::default();
    let renderer = On { device: &Cpu, field: &field };
    let stage = || Stage::prepare(&scene, &album, &sources, &renderer, &options, &progress).expect("prepared");
    let mut group = criterion.benchmark_group("sample scene 128x128, 20 sources");
    group.sample_size(10);
    group.bench_function("prepare", |bencher| bencher.iter(stage));
    group.bench_function("encode", |bencher| {
        bencher.iter_batched_ref(
            stage,
            |stage| stage.weigh(&weighting, &progress).expect("encoded"),
            BatchSize::PerIteration,
        );
    });
    let mut stage = stage();
    stage.weigh(&weighting, &progress).expect("encoded");
    let target = target_of(&scene, 20);
    group.bench_function("render", |bencher| {
        bencher.iter(|| black_box(stage.frame(&weighting, &target, &progress).expect("rendered")));
    });
    group.finish();

    let relevance = vec![Weights::mean(sources.len() as u32); sources.len()];
    let depths = field.hull.depth_maps(&Cpu, &stage.images, &relevance, &progress).expect("depths");
    let object = find_object(&stage.images).expect("an object");
    let mut texels = Vec::new();
    let mut views = Vec::new();
    for image in &stage.images.images {
        views.push(image.camera.block(texels.len() as u32));
        texels.extend_from_slice(&image.texels);
    }
    let footprints: Vec<f32> =
        views.iter().map(|view| view.project(object.middle()).depth / view.intrinsics[0]).collect();
    let poses: Vec<Pose> = sources.iter().map(|&view| scene.views[view].camera.pose).collect();
    let all = Sources::new(&poses).expect("20 sources");
    let weights = weighting.weigh(&all, &target.camera.pose);
    let weights = &weights.values()[..sources.len()];
    let (low, high) = (Vec3::from_slice(&object.low[..3]), Vec3::from_slice(&object.high[..3]));
    let points: Vec<Vec3> = (0..4096)
        .map(|i| low + (high - low) * Vec3::new(uniform(7, i, 0), uniform(7, i, 1), uniform(7, i, 2)))
        .collect();
    let mut group = criterion.benchmark_group("sample, one core");
    group.throughput(Throughput::Elements(points.len() as u64));
    group.bench_function("random points of the object's box, 20 views", |bencher| {
        bencher.iter(|| {
            for point in &points {
                black_box(sample(&object, &views[..], &footprints, &texels[..], &depths[..], weights, *point));
            }
        });
    });
    group.finish();
}

/// The whole way for a scene of one's own.
fn own_scene(criterion: &mut Criterion) {
    let Some(path) = std::env::var_os("VIEWFUSE_BENCH_SCENE") else { return };
    let scene = Scene::open(Path::new(&path)).expect("the scene of VIEWFUSE_BENCH_SCENE");
    let sources: Vec<usize> = (1..scene.views.len()).collect();
    let progress = Silent;
    let album = Album::open(&scene, 0..scene.views.len(), &progress).expect("its photographs");
    let pinhole = scene.views[0].camera.pinhole;
    let size = [160, (160.0 * pinhole.height() as f32 / pinhole.width() as f32).round() as u32];
    let options = RenderOptions { size: Some(size), ..RenderOptions::default() };
    let mut devices = vec![("cpu".to_owned(), AnyDevice::Cpu(Cpu))];
    if let Ok((instance, adapters)) = vulkan_devices() {
        for adapter in adapters.iter().filter(|adapter| adapter.missing.is_empty()) {
            let device = Vulkan::open(&instance, adapter, &GpuOptions::default()).expect("a device that lacks nothing");
            devices.push((adapter.name.clone(), AnyDevice::Vulkan(Box::new(device))));
        }
    }
    let (field, target, weighting) = (AnyField::default(), target_of(&scene, 0), Weighting::default_scheme());
    let mut group = criterion.benchmark_group(format!("own scene, {} sources, {}x{}", sources.len(), size[0], size[1]));
    group.sample_size(10);
    for (name, device) in &devices {
        let renderer = field.on(device);
        // From photographs to a picture.
        let picture = || {
            let stage = Stage::prepare(&scene, &album, &sources, renderer.as_ref(), &options, &progress);
            let mut stage = stage.expect("prepared");
            stage.weigh(&weighting, &progress).expect("encoded");
            black_box(stage.frame(&weighting, &target, &progress).expect("rendered"))
        };
        group.bench_function(name, |bencher| bencher.iter(picture));
    }
    group.finish();
}

/// Opening a file of 40 thousand Gaussians, of degree 0 and of degree 3.
fn gaussian_files(criterion: &mut Criterion) {
    const COUNT: usize = 40_000;
    let folder = tempfile::tempdir().expect("a folder");
    let mut group = criterion.benchmark_group("40 thousand Gaussians");
    for degree in [0, 3] {
        let gaussian = Gaussian {
            position: [0.5, -0.25, 2.0],
            log_scales: [-4.0, -5.0, -6.0],
            rotation: [1.0, 0.0, 0.25, 0.0],
            opacity: 1.0,
            f_dc: [0.25, 0.5, 0.75],
        };
        let f_rest = vec![0.125; COUNT * 3 * REST_COUNTS[degree] as usize];
        let scene =
            GaussianScene { gaussians: vec![gaussian; COUNT], degree: degree as u32, f_rest, is_antialiased: false };
        let path = folder.path().join(format!("{degree}.ply"));
        scene.write(&path, &SceneFrame::FILE).expect("a file");
        let open = || GaussianScene::read(&path, &SceneFrame::FILE).expect("the file");
        group.bench_function(format!("opened, degree {degree}"), |bencher| bencher.iter(open));
    }
    group.finish();
}

criterion_group!(benches, weights, stages, gaussian_files, own_scene);
criterion_main!(benches);
