//! Photographs of the sample scene and points on its surfaces: what an optimisation of Gaussians begins with.

use std::sync::OnceLock;
use viewfuse::device::choice::AnyDevice;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::AnyField;
use viewfuse::field::gaussians::Recipe;
use viewfuse::field::point_cloud::{CloudPoint, point_cloud};
use viewfuse::field::render::{RenderOptions, Stage, open_album};
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::scene::photographs::SourceImages;
use viewfuse::weighting::Weighting;

use crate::places::data;

/// Ten photographs of 64 by 64 pixels.
///
/// # Panics
/// If the scene cannot be read.
pub fn toy_cloud() -> &'static (SourceImages, Vec<CloudPoint>) {
    static CLOUD: OnceLock<(SourceImages, Vec<CloudPoint>)> = OnceLock::new();
    CLOUD.get_or_init(|| {
        let scene = Scene::open(data("toy")).expect("a scene");
        let selection = Selection { sources: Some("0..19/2".to_owned()), ..Selection::default() };
        let sources = selection.sources_without(&scene, &[], 2).expect("sources");
        let options = RenderOptions { size: Some([64; 2]), ..RenderOptions::default() };
        let (field, device) = (AnyField::default(), AnyDevice::Cpu(Cpu));
        let renderer = field.on(&device);
        let album = open_album(&scene, sources.clone(), renderer.as_ref(), &options, &Silent).expect("photographs");
        let stage = Stage::prepare(&scene, &album, &sources, renderer.as_ref(), &options, &Silent);
        let mut stage = stage.expect("a stage");
        let weighting = Weighting::open("distance:power=2").expect("a scheme");
        let points = point_cloud(&mut stage, &weighting, Recipe::cloud(sources.len()), &Silent).expect("points");
        (stage.images.as_ref().clone(), points)
    })
}

/// Few Gaussians on small pictures, in all that an optimisation has: levels, harmonics, growth.
pub fn small_recipe() -> Recipe {
    let small = Recipe { side: 32, iterations: [0, 6, 6, 30], cell: 8.0, ..Recipe::default() };
    Recipe { max_per_pixel: 0.5, degree: 3, grows: true, ..small }
}
