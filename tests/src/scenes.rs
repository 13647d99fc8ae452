//! Small scenes on disk, in each layout that viewfuse reads.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat, Rgb, RgbImage};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A row-major camera-to-world matrix in OpenCV axes: at (1, 2, 3), image x along world y, image y along world z,
/// looking along world x. No axis is where it started, so that a transposed or swapped matrix shows.
pub const WORLD_FROM_CAMERA: [f64; 16] =
    [0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0];

/// A world point; by hand, that camera sees it at (0.5, -0.25, 2).
pub const POINT_WORLD: [f32; 3] = [3.0, 2.5, 2.75];

/// A folder that is deleted with this value.
#[derive(Debug)]
pub struct Folder {
    folder: TempDir,
}

impl Folder {
    /// An empty folder.
    #[expect(clippy::new_without_default, reason = "making a folder is no default value")]
    pub fn new() -> Folder {
        Folder { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The path of a file in it, whose folder is made.
    pub fn file(&self, name: &str) -> PathBuf {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().expect("a file stands in a folder")).expect("a folder");
        path
    }

    /// Writes a file.
    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> &Folder {
        fs::write(self.file(name), contents).expect("a file");
        self
    }

    /// Writes an image of one colour.
    pub fn image(&self, name: &str, width: u32, height: u32) -> &Folder {
        RgbImage::from_pixel(width, height, Rgb([10, 20, 30])).save(self.file(name)).expect("an image");
        self
    }

    /// Deletes a file.
    pub fn remove(&self, name: &str) -> &Folder {
        fs::remove_file(self.path().join(name)).expect("a file to delete");
        self
    }
}

/// A picture as a JPEG whose tag (EXIF) says how it must be turned to be upright.
pub fn with_tag(picture: &DynamicImage, orientation: u8) -> Vec<u8> {
    let mut jpeg = Cursor::new(Vec::new());
    picture.write_to(&mut jpeg, ImageFormat::Jpeg).expect("a JPEG");
    let mut exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
    exif.extend([orientation, 0, 0, 0, 0, 0, 0, 0]);
    let mut bytes = jpeg.into_inner();
    let mut segment = vec![0xff, 0xe1];
    segment.extend((exif.len() as u16 + 2).to_be_bytes());
    segment.extend(exif);
    bytes.splice(2..2, segment);
    bytes
}

/// Numbers with blanks between them.
pub fn words(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// An SRN scene: photographs `2` and `10` of 16 x 12 pixels, target pose `1`, focal length 20, centre (8, 6).
pub fn srn() -> Folder {
    let folder = Folder::new();
    for name in ["10", "2"] {
        folder.image(&format!("rgb/{name}.png"), 16, 12);
        folder.write(&format!("pose/{name}.txt"), words(&WORLD_FROM_CAMERA));
    }
    folder.write("target_pose/1.txt", words(&WORLD_FROM_CAMERA));
    folder.write("intrinsics.txt", "20. 8. 6. 0.\n0. 0. 0.\n1.\n12 16\n");
    folder
}

/// `transforms.json` with one frame, of the instant-ngp flavour: `images/0001.png`, 16 x 12, focal lengths 20 and 24,
/// centre (7.5, 6.5).
pub fn transforms() -> Value {
    json!({
        "fl_x": 20.0, "fl_y": 24.0, "cx": 7.5, "cy": 6.5, "w": 16, "h": 12, "camera_angle_x": 0.76,
        "k1": 0.0, "k2": 0, "p1": 0, "p2": 0, "is_fisheye": false, "aabb_scale": 16,
        "frames": [{ "file_path": "./images/0001.png", "sharpness": 30.0, "transform_matrix": opengl_matrix() }],
    })
}

/// [`WORLD_FROM_CAMERA`] with the y and z axes of the camera turned around.
pub fn opengl_matrix() -> Value {
    let m = WORLD_FROM_CAMERA;
    let row = |r: usize| json!([m[4 * r], -m[4 * r + 1], -m[4 * r + 2], m[4 * r + 3]]);
    json!([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]])
}

/// A folder with this `transforms.json` and `images/0001.png` of 16 x 12.
pub fn transforms_folder(transforms: &Value) -> Folder {
    let folder = Folder::new();
    folder.image("images/0001.png", 16, 12).write("transforms.json", transforms.to_string());
    folder
}

/// K of the Middlebury scene: focal lengths 20 and 24, centre (7, 5).
pub const MIDDLEBURY_K: [f64; 9] = [20.0, 0.0, 7.0, 0.0, 24.0, 5.0, 0.0, 0.0, 1.0];

/// A line of a Middlebury list for the camera of [`WORLD_FROM_CAMERA`], inverted by hand.
pub fn middlebury_line(name: &str, k: &[f64; 9]) -> String {
    let r = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
    format!("{name} {} {} {}", words(k), words(&r), words(&[-2.0, -3.0, -1.0]))
}

/// A Middlebury scene: `toy0001.png` and `toy0002.png` of 16 x 12 pixels and `toy_par.txt`.
pub fn middlebury() -> Folder {
    let folder = Folder::new();
    folder.image("toy0001.png", 16, 12).image("toy0002.png", 16, 12);
    let line = |name| middlebury_line(name, &MIDDLEBURY_K);
    folder.write("toy_par.txt", format!("2\n{}\n{}\n", line("toy0001.png"), line("toy0002.png")));
    folder
}

/// The first bytes of a PNG whose header promises 100000 x 100000 pixels of 8-bit RGB.
pub fn huge_png() -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    let side = 100_000_u32.to_be_bytes();
    bytes.extend(side.into_iter().chain(side).chain([8, 2, 0, 0, 0]));
    // Checksums take a table: they are given.
    bytes.extend(0x2730_9c9f_u32.to_be_bytes());
    bytes.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e");
    bytes
}
