//! Variants of a field: what is encoded under one serves another exactly where the options say so.

use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::genvs::{self, Genvs, GenvsOptions};
use viewfuse::field::pixelnerf::{self, PixelNerf, PixelNerfOptions};
use viewfuse::field::render::{RenderOptions, Stage, open_album};
use viewfuse::field::training_free::hull::Hull;
use viewfuse::field::training_free::{Sweep, TrainingFree};
use viewfuse::field::{AnyField, AnyOptions, Purpose, Request, Variant};
use viewfuse::job::progress::Silent;
use viewfuse::scene::few_shot::Target;
use viewfuse::weighting::Weighting;
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::{job, sample};

/// Renders a target under the field's own options, then under each of its variants and under `others`, and back:
/// pictures must be those of a stage that was never under anything else. The first of `others` encodes views otherwise:
/// from views that were encoded under the field's own options its picture must be wrong, or there must be none.
fn assert_encodings_serve(
    field: &AnyField,
    folder: &str,
    [sources, targets]: [&str; 2],
    size: [u32; 2],
    others: Vec<AnyOptions>,
) {
    let scene = sample(folder);
    let job = job(&scene, sources, targets);
    let (device, weighting) = (AnyDevice::Cpu(Cpu), Weighting::open("error:alpha=1").expect("a scheme"));
    let options = RenderOptions { size: Some(size), leave_out: 0.0, ..RenderOptions::default() };
    let renderer = field.on(&device);
    let album = open_album(&scene, job.sources.clone(), renderer.as_ref(), &options, &Silent).expect("photographs");
    let target = Target { truth: None, ..job.targets[0].clone() };
    let weighed = |variant: &AnyOptions| {
        let stage = Stage::prepare(&scene, &album, &job.sources, renderer.as_ref(), &options, &Silent);
        let mut stage = stage.expect("a stage");
        stage.vary(Some(variant), None, &Silent).expect("a variant");
        stage.weigh(&weighting, &Silent).expect("weighed");
        stage
    };
    let picture = |stage: &mut Stage<'_>, variant: &AnyOptions| {
        stage.vary(Some(variant), None, &Silent).expect("a variant");
        stage.frame(&weighting, &target, &Silent).expect("a picture").colours
    };

    let base = renderer.options();
    let mut stage = weighed(&base);
    let expected = picture(&mut stage, &base);
    let mut prepared = renderer.prepare(&stage.images, &Silent).expect("prepared");
    let mut variants = others.clone();
    variants.extend(prepared.efforts(&base, 1).into_iter().map(|Variant { options, .. }| options));
    variants.extend((0..).map(|step| prepared.candidates(&base, step)).take_while(|some| !some.is_empty()).flatten());
    variants.extend(prepared.mixtures(&base).into_iter().flat_map(|mixture| mixture.options));
    variants.push(prepared.reduced(&base, Purpose::Trial));
    for variant in &variants {
        let alone = picture(&mut weighed(variant), variant);
        assert!(picture(&mut stage, variant) == alone, "{folder}: other encodings than those of {variant:?}");
        assert!(picture(&mut stage, &base) == expected, "{folder}: not as before {variant:?}");
    }

    let other = &others[0];
    assert!(!base.encodes_alike(other) && base.encodes_alike(&base));
    let relevance = stage.relevance(&weighting);
    prepared.weigh(&relevance).expect("weighed");
    let views: Vec<usize> = (0..job.sources.len()).collect();
    views.iter().for_each(|view| prepared.encode(*view, &Silent).expect("encoded"));
    prepared.set(other).expect("set");
    let camera = viewfuse_core::camera::Camera {
        pinhole: target.camera.pinhole.resized(size[0], size[1]).expect("a size"),
        ..target.camera
    };
    let weights = Weights::mean(views.len() as u32);
    let request = Request { camera: &camera, weights: &weights, views: &views, early_termination: 0.0 };
    let stale = prepared.render(&request, &Silent);
    let mut right = weighed(other);
    right.encode_all(&Silent).expect("encoded");
    let right = right.picture(&camera, &weights, 0.0, &Silent).expect("a picture");
    let is_wrong = stale.map_or(true, |stale| stale.colours != right.colours);
    assert!(is_wrong, "{folder}: {other:?} could say that it is alike");
}

#[test]
fn latents_of_a_pixelnerf() {
    let checkpoint = pixelnerf::test_networks::body(&pixelnerf::Architecture::small(16));
    let field = PixelNerf::new(&checkpoint, PixelNerfOptions::default()).expect("a network");
    let with = |omissions| AnyOptions::new(PixelNerfOptions { omissions, ..field.options() });
    let all = field.options().omissions;
    let others = vec![
        with(pixelnerf::Omissions { half_latents: true, ..all }),
        with(pixelnerf::Omissions { latent_layers: false, ..all }),
    ];
    assert_encodings_serve(&AnyField::new(field), "car", ["16,72,136", "48"], [24, 24], others);
}

#[test]
fn volumes_of_a_genvs() {
    let checkpoint = genvs::test_networks::deterministic(&genvs::Architecture::small());
    let field = Genvs::new(checkpoint, GenvsOptions::default()).expect("a network");
    let omissions = genvs::Omissions { half_volumes: true, ..field.options().omissions };
    let others = vec![AnyOptions::new(GenvsOptions { omissions, ..field.options() })];
    assert_encodings_serve(&AnyField::new(field), "car", ["16,72,136", "48"], [32, 32], others);
}

#[test]
fn disparities_of_a_sweep() {
    let sweep = Sweep { near_cost: 0.05, ..Sweep::default() };
    let others = vec![AnyOptions::new(TrainingFree { sweep, ..TrainingFree::default() })];
    assert_encodings_serve(&AnyField::default(), "room", ["0,2,3,5", "4"], [64, 48], others);
}

#[test]
fn depths_of_a_hull() {
    let hull = Hull { source_share: 0.5, ..Hull::default() };
    let others = vec![AnyOptions::new(TrainingFree { hull, ..TrainingFree::default() })];
    assert_encodings_serve(&AnyField::default(), "toy", ["0..19/4", "21"], [48, 48], others);
}
