//! Renders one novel view: `cargo run --release -p viewfuse --example render -- tests/data/toy view.png`.

use viewfuse::prelude::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let [folder, picture] = std::array::from_fn(|_| arguments.next().expect("arguments: a scene and a picture"));
    let scene = Scene::open(folder)?;
    // All photographs are sources; the target is the first of an orbit around the object.
    let job = Selection { path: Some(PathChoice::Orbit(1)), ..Selection::default() }.resolve(&scene, 2)?;
    let renderer = On { device: &Cpu, field: &TrainingFree::default() };
    let frames = render_all(&scene, &job, &Weighting::default_scheme(), &renderer, &RenderOptions::default())?;
    frames[0].picture.save(picture)?;
    Ok(())
}
