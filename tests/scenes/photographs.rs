//! Photographs on their way to a field: where they are kept and how large they are worked on changes what it should.

use serde_json::json;
use viewfuse::field::LONGEST_DEFAULT_SIDE;
use viewfuse::field::render::{RenderError, RenderOptions, picture_size, working_side};
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::photographs::{Album, BackgroundChoice, reduced_size, scaled_size};
use viewfuse_tests::command::toy;
use viewfuse_tests::scenes;

#[test]
fn photographs_that_are_not_kept_are_read_when_they_are_needed() {
    let folder = toy();
    let scene = Scene::open(folder.file("toy")).expect("a scene");
    let views: Vec<usize> = (0..6).collect();
    let kept = Album::open(&scene, views.iter().copied(), &Silent).expect("photographs");
    let none = Album::open(&scene, [], &Silent).expect("no photograph");
    let sources = |album: &Album| album.sources(&views, 48, BackgroundChoice::Auto, &Silent).expect("sources");
    assert_eq!(sources(&kept), sources(&none));
    let truth = |album: &Album| album.truth(7, [40, 40], Some([0.25; 3])).expect("a truth");
    assert_eq!(truth(&kept), truth(&none));
    assert_ne!(sources(&kept), kept.sources(&views, 47, BackgroundChoice::Auto, &Silent).expect("sources"));
}

#[test]
fn the_largest_photograph_decides_the_size_up_to_the_limit() {
    let side = |folder: &scenes::Folder, size: Option<[u32; 2]>| {
        let scene = Scene::open(folder).expect("a scene");
        let options = RenderOptions { size, ..RenderOptions::default() };
        working_side(&scene, &options, LONGEST_DEFAULT_SIDE).expect("a size")
    };
    let folder = scenes::srn();
    assert_eq!(side(&folder, None), 16);
    // The first view is small, a later one is not.
    folder.image("rgb/10.png", 1600, 1200);
    assert_eq!(side(&folder, None), LONGEST_DEFAULT_SIDE);
    assert_eq!(side(&folder, Some([32, 24])), 32);
    let scene = Scene::open(&folder).expect("a scene");
    let (small, large) = (&scene.views[0].camera, &scene.views[1].camera);
    assert_eq!((reduced_size(small, 512), reduced_size(large, 512)), ((16, 12), (512, 384)));
    assert_eq!(scaled_size(small, 512), (512, 384));
}

/// A size is that of the cameras of its shape, whichever is the first.
#[test]
fn a_size_of_any_shape_in_the_scene() {
    let folder = scenes::Folder::new();
    folder.image("wide.png", 16, 12).image("high.png", 12, 16);
    let frame = |name: &str, [width, height]: [u32; 2]| json!({ "file_path": name, "w": width, "h": height, "fl_x": 20, "transform_matrix": scenes::opengl_matrix() });
    let frames = [frame("wide.png", [16, 12]), frame("high.png", [12, 16])];
    folder.write("transforms.json", json!({ "frames": frames }).to_string());
    let scene = Scene::open(&folder).expect("a scene");
    let sizes = |size| {
        let options = RenderOptions { size: Some(size), ..RenderOptions::default() };
        let at = |view: usize| picture_size(&scene, &options, LONGEST_DEFAULT_SIDE, &scene.views[view].camera);
        Ok::<_, RenderError>([at(0)?, at(1)?])
    };
    for size in [[8, 6], [6, 8]] {
        assert_eq!(sizes(size).expect("a size"), [[8, 6], [6, 8]], "{size:?}");
    }
    let error = sizes([8, 8]).expect_err("of no view").to_string();
    assert!(error.contains("does not keep the shape of the views (16x12)"), "{error}");
}
