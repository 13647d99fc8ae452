//! Damaged files of every layout: cut at every length and with every byte changed, a scene opens or is refused with one
//! line that names a file in it. Nothing panics, and no count allocates what the file does not hold.

use super::made::*;
use viewfuse::scene::Scene;
use viewfuse_tests::scenes::{self, Folder};

/// Opens the scene with the file's bytes changed in every way; `every` says which of the bytes.
fn damage(folder: &Folder, name: &str, every: usize) {
    let path = folder.path().join(name);
    let whole = std::fs::read(&path).expect("a file");
    assert!(Scene::open(folder.path()).is_ok(), "{name} is good as it is");
    let mut opened = 0;
    let mut open = |bytes: &[u8], what: &str| {
        std::fs::write(&path, bytes).expect("a file");
        match Scene::open(folder.path()) {
            Ok(scene) => {
                opened += 1;
                assert!(!scene.views.is_empty());
            }
            Err(error) => {
                let message = error.to_string();
                let inside = message.starts_with(&folder.path().display().to_string());
                assert!(inside && !message.contains('\n') && message.len() < 1500, "{name}, {what}: {message:?}");
            }
        }
    };
    for length in (0..whole.len()).step_by(every) {
        open(&whole[..length], &format!("cut after {length}"));
    }
    for at in (0..whole.len()).step_by(every) {
        for value in [0xff, whole[at] ^ 0x01, whole[at] ^ 0x80] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            open(&bytes, &format!("byte {at} is {value}"));
        }
    }
    std::fs::write(&path, whole).expect("a file");
    assert!(opened > 0 || every > 1, "{name}: no change was harmless");
}

#[test]
fn colmap_binary_files() {
    let folder = colmap_binary();
    for name in ["cameras.bin", "images.bin", "points3D.bin"] {
        damage(&folder, &format!("sparse/0/{name}"), 1);
    }
}

#[test]
fn colmap_text_files() {
    let folder = colmap_text();
    for name in ["cameras.txt", "images.txt", "points3D.txt"] {
        damage(&folder, &format!("sparse/0/{name}"), 1);
    }
}

#[test]
fn arrays_and_archives() {
    damage(&llff(), "poses_bounds.npy", 1);
    damage(&neus(), "cameras_sphere.npz", 3);
}

#[test]
fn lists_of_the_older_layouts() {
    damage(&scenes::middlebury(), "toy_par.txt", 1);
    damage(&scenes::srn(), "intrinsics.txt", 1);
    damage(&scenes::transforms_folder(&scenes::transforms()), "transforms.json", 1);
}
