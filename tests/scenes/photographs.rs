//! Photographs on their way to a field: where they are kept and how large they are worked on changes what it should.

use viewfuse::field::LONGEST_DEFAULT_SIDE;
use viewfuse::field::render::{RenderOptions, working_side};
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
