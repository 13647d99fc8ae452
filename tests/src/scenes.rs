//! Small scenes on disk, in each layout that viewfuse reads.

use std::fs;
use std::io::Cursor;
use std::ops::Deref;
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

/// A folder that is deleted with this value; where its path is asked for, it is that.
#[derive(Debug)]
pub struct Folder {
    folder: TempDir,
}

impl Deref for Folder {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.path()
    }
}

impl AsRef<Path> for Folder {
    fn as_ref(&self) -> &Path {
        self.path()
    }
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

    /// Writes a script of the shell that can be called.
    pub fn script(&self, name: &str, lines: &str) -> &Folder {
        self.write(name, format!("#!/bin/sh\n{lines}"));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(self.file(name), fs::Permissions::from_mode(0o755)).expect("permissions");
        }
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

/// EXIF's tag of how a picture must be turned to be upright.
pub const ORIENTATION: u16 = 0x0112;
/// EXIF's tag of the focal length in millimetres of a 35 mm camera.
pub const FILM: u16 = 0xa405;

/// A JPEG file with short numbers as EXIF.
pub fn with_exif(jpeg: &[u8], tags: &[(u16, u16)]) -> Vec<u8> {
    let mut tiff = b"MM\0*\0\0\0\x08".to_vec();
    let entry = |out: &mut Vec<u8>, tag: u16, kind: u16, value: [u8; 4]| {
        out.extend([tag.to_be_bytes(), kind.to_be_bytes()].concat());
        out.extend([0, 0, 0, 1]);
        out.extend(value);
    };
    let short = |value: u16| [value.to_be_bytes(), [0, 0]].concat().try_into().expect("four bytes");
    let (of_exif, of_image): (Vec<_>, Vec<_>) = tags.iter().partition(|(tag, _)| *tag == FILM);
    // The first directory: its own tags, then where the second begins.
    tiff.extend((of_image.len() as u16 + 1).to_be_bytes());
    of_image.iter().for_each(|(tag, value)| entry(&mut tiff, *tag, 3, short(*value)));
    let behind = (tiff.len() + 12 + 4) as u32;
    entry(&mut tiff, 0x8769, 4, behind.to_be_bytes());
    tiff.extend([0; 4]);
    tiff.extend((of_exif.len() as u16).to_be_bytes());
    of_exif.iter().for_each(|(tag, value)| entry(&mut tiff, *tag, 3, short(*value)));
    tiff.extend([0; 4]);
    let length = (2 + 6 + tiff.len()) as u16;
    [&jpeg[..2], &[0xff, 0xe1], &length.to_be_bytes(), b"Exif\0\0", &tiff, &jpeg[2..]].concat()
}

/// A picture as a JPEG whose tag says how it must be turned to be upright.
pub fn with_tag(picture: &DynamicImage, orientation: u8) -> Vec<u8> {
    let mut jpeg = Cursor::new(Vec::new());
    picture.write_to(&mut jpeg, ImageFormat::Jpeg).expect("a JPEG");
    with_exif(jpeg.get_ref(), &[(ORIENTATION, orientation.into())])
}

/// The checksum of a PNG's pieces.
pub fn png_checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg()))
    })
}

/// A piece of a PNG.
pub fn png_chunk(kind: &[u8], content: &[u8]) -> Vec<u8> {
    let chunk = [kind, content].concat();
    [&(content.len() as u32).to_be_bytes()[..], &chunk, &png_checksum(&chunk).to_be_bytes()].concat()
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

/// A `.npy` file of 64-bit numbers in C order.
pub fn npy(shape: &[usize], numbers: &[f64]) -> Vec<u8> {
    npy_of("<f8", false, shape, &numbers.iter().copied().flat_map(f64::to_le_bytes).collect::<Vec<u8>>())
}

/// A `.npy` file of any kind.
pub fn npy_of(kind: &str, fortran: bool, shape: &[usize], data: &[u8]) -> Vec<u8> {
    let shape: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let order = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': ({shape}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(data);
    bytes
}

/// The first bytes of a PNG whose header promises 100000 x 100000 pixels of 8-bit RGB.
pub fn huge_png() -> Vec<u8> {
    let side = 100_000_u32.to_be_bytes();
    let header = png_chunk(b"IHDR", &[&side[..], &side, &[8, 2, 0, 0, 0]].concat());
    [b"\x89PNG\r\n\x1a\n".as_slice(), &header, &png_chunk(b"IDAT", b"")].concat()
}
