//! Renders one novel view: `cargo run --release -p viewfuse --example render -- tests/data/toy view.png`.

use viewfuse::device::cpu::Cpu;
use viewfuse::field::On;
use viewfuse::field::render::{RenderOptions, render};
use viewfuse::field::training_free::TrainingFree;
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::weighting::Weighting;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(folder), Some(picture)) = (arguments.next(), arguments.next()) else {
        return Err("which scene, and which file for the picture?".into());
    };
    let scene = Scene::open(folder)?;
    // All photographs are sources; the target is the first of an orbit around what they show.
    let job = Selection { orbit: Some(1), ..Selection::default() }.resolve(&scene, 2)?;
    let (weighting, options) = (Weighting::open("error:alpha=1")?, RenderOptions::default());
    let renderer = On { device: &Cpu, field: &TrainingFree::default() };
    render(&scene, &job, &weighting, &renderer, &options, &Silent, |_sources, frame| {
        frame.picture.save(&picture)?;
        Ok::<(), Box<dyn std::error::Error>>(())
    })?;
    Ok(())
}
