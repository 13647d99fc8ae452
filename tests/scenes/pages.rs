//! A scene of Gaussians as one page: its size, what is in it, and the viewer that it carries.

use super::gaussians::drawn;
use serde_json::Value;
use viewfuse::job::digest::sha256;
use viewfuse::output::gaussian_page::{GaussianPage, write_html};
use viewfuse::scene::gaussians::GaussianScene;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_tests::places::repository;

/// Most bytes of a page of 40 thousand Gaussians.
const MAX_BYTES: usize = 4_000_000;

fn page(title: &str, scene: &GaussianScene) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.html");
    let camera = |x: f32| {
        let pose = Pose::look_at(Vec3::new(x, 0.0, -4.0), Vec3::ZERO, Vec3::NEG_Y).expect("a pose");
        Camera { pose, pinhole: Pinhole::new([50.0; 2], [32.0, 24.0], 64, 48).expect("a pinhole") }
    };
    let cameras = [-1.0, 0.1, 1.0].map(|x| (format!("</script> {x}"), camera(x)));
    write_html(&path, &GaussianPage { title, scene, cameras: &cameras, background: [0.0, 0.5, 1.0] }).expect("a page");
    std::fs::read_to_string(path).expect("text")
}

/// What the page's scripts are told.
fn told(page: &str) -> Value {
    let (_, rest) = page.split_once("<script type=\"application/json\" id=\"scene\">").expect("the scene");
    serde_json::from_str(rest.split_once("</script>").expect("its end").0).expect("JSON")
}

#[test]
fn a_page_of_forty_thousand_gaussians_is_small() {
    let page = page("many", &drawn(40_000, 0, 8));
    assert!((1_500_000..MAX_BYTES).contains(&page.len()), "{} bytes", page.len());
    assert!(!page.contains("{{"), "a value is missing");
    // Whatever it refers to is in it.
    let outside = ["src=\"http", "href=\"http", "@import", "<link rel=\"stylesheet"];
    assert!(outside.iter().all(|word| !page.contains(word)));
}

#[test]
fn names_from_files_are_text_in_a_page() {
    let page = page("</title><script>&\"", &drawn(3, 1, 9));
    assert!(page.contains("<title>&lt;/title&gt;&lt;script&gt;&amp;&quot;</title>"));
    let told = told(&page);
    assert_eq!(told["cameras"][2]["name"], "</script> 1");
    assert_eq!((&told["start"], &told["gaussians"]["count"]), (&Value::from(1), &Value::from(3)));
    assert!(page.contains("background: rgb(0 128 255)") && page.contains("aspect-ratio: 64 / 48"));
    // Three elements of scripts that end, one for the viewer, and none more.
    assert_eq!((page.matches("<script").count(), page.matches("</script>").count()), (3, 3));
}

#[test]
fn an_empty_scene_is_a_page() {
    let told = told(&page("nothing", &GaussianScene::default()));
    assert_eq!((told["gaussians"]["count"].as_u64(), told["unit"].as_f64()), (Some(0), Some(1.0)));
    assert_eq!(told["gaussians"]["means"], "");
}

/// The viewer is the published file, and its document names it.
#[test]
fn the_viewer_is_the_published_one() {
    let folder = repository().join("host/output/vendor");
    let document = std::fs::read_to_string(folder.join("gsplat.md")).expect("a document");
    let hash = sha256(&std::fs::read(folder.join("gsplat.js")).expect("the viewer"));
    assert!(document.contains(&format!("`{hash}`")), "{hash}");
    let licence = std::fs::read_to_string(folder.join("gsplat.LICENSE")).expect("a licence");
    assert!(licence.starts_with("MIT License") && licence.contains("Dylan Ebert"));
    assert!(page("any", &GaussianScene::default()).contains("Copyright (c) 2023 Dylan Ebert"));
}
