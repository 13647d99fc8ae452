//! Scenes: of every layout, each file that is not a photograph.

use super::files::Files;
use super::{Target, Verdict, verdict};
use image::{Rgb, RgbImage};
use std::fs;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use viewfuse::scene::Scene;
use viewfuse_tests::command::files_below;
use viewfuse_tests::scenes::{self as made, Folder};
use zip::write::SimpleFileOptions;

/// A scene one of whose files is broken at a time.
pub(crate) struct Broken(Files);

impl Broken {
    /// A scene of these files, and photographs of 16 x 12.
    fn new(files: &[(&str, Vec<u8>)], photographs: &[&str]) -> Broken {
        Broken::with(Files::new(files), photographs)
    }

    fn with(files: Files, photographs: &[&str]) -> Broken {
        for name in photographs {
            let path = files.path().join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            RgbImage::from_pixel(16, 12, Rgb([10, 20, 30])).save(path).expect("a photograph");
        }
        Scene::open(files.path()).unwrap_or_else(|error| panic!("it is right as it is: {error}"));
        Broken(files)
    }

    /// A copy of a scene that a test made: of its files, those that are no photographs are broken.
    pub(crate) fn of(scene: &Folder) -> Broken {
        let names: Vec<(String, PathBuf)> = files_below(scene.path())
            .into_iter()
            .filter(|(path, _)| path.is_file())
            .map(|(path, _)| (path.strip_prefix(scene.path()).expect("inside").to_string_lossy().into_owned(), path))
            .collect();
        let (photographs, files): (Vec<_>, Vec<_>) = names.into_iter().partition(|(name, _)| name.ends_with(".png"));
        let files: Vec<(&str, Vec<u8>)> =
            files.iter().map(|(name, path)| (name.as_str(), fs::read(path).expect("a file"))).collect();
        Broken::new(&files, &photographs.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>())
    }
}

pub(crate) fn transforms() -> Broken {
    let mut scene = made::transforms();
    scene["frames"][0]["mask_path"] = "masks/0001.png".into();
    let folder = made::transforms_folder(&scene);
    folder.image("masks/0001.png", 16, 12);
    Broken::of(&folder)
}

pub(crate) fn llff() -> Broken {
    let file = include_bytes!("../../data/fuzz/seeds/poses_bounds.npy");
    Broken::new(&[("poses_bounds.npy", file.to_vec())], &["images_8/a.png", "images_8/b.png"])
}

const NEUS: [&str; 3] = ["image/000.png", "image/001.png", "mask/000.png"];

pub(crate) fn neus() -> Broken {
    let file = include_bytes!("../../data/fuzz/seeds/cameras_sphere.npz");
    Broken::new(&[("cameras_sphere.npz", file.to_vec())], &NEUS)
}

/// An array in an archive that is right.
pub(crate) fn neus_array() -> Broken {
    let array = include_bytes!("../../data/fuzz/seeds/world_mat.npy").to_vec();
    Broken::with(Files::wrapped(&[("cameras_sphere.npz", array)], archive), &NEUS[..2])
}

fn archive(array: &[u8]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let right = include_bytes!("../../data/fuzz/seeds/world_mat.npy").as_slice();
    for (name, bytes) in [("world_mat_0.npy", array), ("world_mat_1.npy", right)] {
        let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        archive.start_file(name, stored).expect("an entry");
        archive.write_all(bytes).expect("an entry");
    }
    archive.finish().expect("an archive").into_inner()
}

pub(crate) fn colmap_binary() -> Broken {
    let files = [
        ("sparse/0/cameras.bin", include_bytes!("../../data/fuzz/seeds/cameras.bin").to_vec()),
        ("sparse/0/images.bin", include_bytes!("../../data/fuzz/seeds/images.bin").to_vec()),
        ("sparse/0/points3D.bin", include_bytes!("../../data/fuzz/seeds/points3D.bin").to_vec()),
    ];
    Broken::new(&files, &["images/a.png", "images/b.png"])
}

pub(crate) fn colmap_text() -> Broken {
    let pose = "0.5 -0.5 -0.5 -0.5 -2 -3 -1";
    let images = format!("# of two\n1 {pose} 7 a.png\n1.5 2.5 -1 3 4 1\n2 {pose} 7 b.png\n\n");
    let cameras = "7 PINHOLE 16 12 20 24 7.5 6.5\n8 OPENCV 16 12 20 24 7.5 6.5 0.1 0 0 0\n";
    let files = [
        ("sparse/0/cameras.txt", cameras.as_bytes().to_vec()),
        ("sparse/0/images.txt", images.into_bytes()),
        ("sparse/0/points3D.txt", b"1 3 2.5 2.75 10 20 30 0.25 1 0 2 0\n".to_vec()),
    ];
    Broken::new(&files, &["images/a.png", "images/b.png"])
}

impl Target for Broken {
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.0.seeds()
    }

    fn words(&self) -> &'static [&'static str] {
        &[
            "\"k1\":0.5,", "\"camera_model\":\"OPENCV_FISHEYE\",", "\"fl_x\":", "\"w\":", "\"frames\":[", "../",
            "/dev/null", "null", "[]", "{}", "\n", " ", "#", "SIMPLE_RADIAL", "FULL_OPENCV", "FOV", "'<f4'", "'>f8'",
            "True", "(1000000000, 17)", "..",
        ]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        self.0.write(bytes);
        let opened = Scene::open(self.0.path());
        if let Ok(scene) = &opened {
            let is_sound = |view: &viewfuse::scene::View| {
                view.camera.pose.to_opencv().iter().flatten().all(|number| number.is_finite())
            };
            if scene.views.is_empty() || !scene.views.iter().all(is_sound) {
                return Err("a scene without views, or with a pose that is not finite".to_owned());
            }
            // With its lens and mask; a refusal is as good as a picture.
            return verdict(scene.photograph(0), self.0.path());
        }
        verdict(opened, self.0.path())
    }
}
