//! Scenes: posed photographs on disk.
//!
//! [`Scene::open`] recognises the layout of a folder, reads every pose and every image *header* and checks them all:
//! counts, finite and rigid poses, sizes. The pixels of a view are read when they are first needed
//! ([`Scene::photograph`]), so that a command that needs only poses touches no image.

use std::path::{Path, PathBuf};
use viewfuse_core::camera::Camera;

/// Most pixels that an image may have on a side: a larger header is refused before anything is allocated.
pub const LARGEST_SIDE: u32 = 16_384;

/// How a scene is laid out on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// ShapeNet scenes of Scene Representation Networks: `rgb/`, `pose/`, `intrinsics.txt`, and `target_pose/`.
    Srn,
    /// NeRF's `transforms.json` (Blender, instant-ngp, nerfstudio).
    Transforms,
    /// Middlebury multi-view stereo: `*_par.txt` beside the images.
    Middlebury,
}

/// One camera of a scene, with the photograph it took if there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// What people call it: the file's stem.
    pub name: String,
    /// Where the camera was and how it maps the world to its image.
    pub camera: Camera,
    /// The photograph; `None` for a target pose without one.
    pub image: Option<PathBuf>,
}

/// A photograph in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// Straight (not premultiplied) 8-bit RGBA.
    pub pixels: image::RgbaImage,
    /// Whether the file had an alpha channel; if not, every alpha is 255.
    pub has_alpha: bool,
}

/// A scene whose poses and image headers have been read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The folder or file it was opened from.
    pub path: PathBuf,
    /// How it is laid out.
    pub layout: Layout,
    /// Views with photographs first, then target poses without; each group in the order of the files.
    pub views: Vec<View>,
}
