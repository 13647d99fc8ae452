//! Training scenes in memory: pictures over white at the training size, with their cameras.

use super::TrainError;
use image::imageops::{FilterType, crop_imm, resize};
use image::{Rgb, RgbImage};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::path::PathBuf;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole, PinholeError};
use viewfuse_field::learned::default_near_far;
use viewfuse_job::digest::hexadecimal;
use viewfuse_job::progress::Progress;
use viewfuse_job::text::listed;
use viewfuse_scene::Scene;
use viewfuse_scene::unit::RigUnit;

/// The whole work is so many parts of about the same time: reading the scenes is the first, training all others.
pub(crate) const STAGES: usize = 20;

/// Training and validation scenes.
pub(crate) struct Data {
    pub(crate) training: Vec<TrainingScene>,
    pub(crate) validation: Vec<TrainingScene>,
}

impl Data {
    /// Reads both lists, `[training, validation]`.
    pub(crate) fn open(
        lists: [&[PathBuf]; 2],
        side: u32,
        least_views: usize,
        progress: &dyn Progress,
    ) -> Result<Data, TrainError> {
        for (list, purpose) in lists.iter().zip(["learn from", "validate on"]) {
            if list.is_empty() {
                return Err(TrainError::NoScenes { purpose });
            }
        }
        progress.stage("reading the scenes", 0..1, STAGES);
        let [training, validation] = lists.map(|list| TrainingScene::open_all(list, side, least_views, progress));
        let data = Data { training: training?, validation: validation? };
        // Of one list for both its caller knows.
        if lists[0] != lists[1] {
            data.overlap().iter().for_each(|warning| progress.warn(warning));
        }
        Ok(data)
    }

    /// What is said of scenes of validation that are scenes of training, too, by what they show.
    fn overlap(&self) -> Option<String> {
        let known: HashSet<[u8; 32]> = self.training.iter().map(TrainingScene::digest).collect();
        let seen = self.validation.iter().filter(|scene| known.contains(&scene.digest()));
        let paths: Vec<String> = seen.map(|scene| scene.path.display().to_string()).collect();
        (!paths.is_empty()).then(|| {
            format!(
                "{} of the {} scenes of validation are scenes of training, too ({}): the score says less about other \
                 scenes",
                paths.len(),
                self.validation.len(),
                listed(&paths, 3)
            )
        })
    }

    /// SHA-256 of all cameras and pictures as training sees them.
    pub(crate) fn digest(&self) -> String {
        let mut digest = Sha256::new();
        for scene in self.training.iter().chain(&self.validation) {
            scene.add_to(&mut digest);
        }
        hexadecimal(&digest.finalize())
    }
}

/// A square part of a picture, and the side to which it is resampled, all in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cut {
    pub(crate) left: u32,
    pub(crate) top: u32,
    pub(crate) size: u32,
    pub(crate) side: u32,
}

/// One object with all its views.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TrainingScene {
    pub(crate) path: PathBuf,
    /// Cameras of the pictures at this size.
    pub(crate) cameras: Vec<Camera>,
    /// The same as kernels take them.
    pub(crate) blocks: Vec<CameraBlock>,
    /// Over white.
    pub(crate) pictures: Vec<RgbImage>,
    /// First and last column and row of each picture's pixels that are not white; the whole of an empty picture.
    pub(crate) bounds: Vec<[u32; 4]>,
    /// Near and far bounds.
    pub(crate) near_far: [f32; 2],
    /// The unit of weightings.
    pub(crate) unit: RigUnit,
}

impl TrainingScene {
    /// Adds its cameras and pictures.
    fn add_to(&self, digest: &mut Sha256) {
        digest.update((self.pictures.len() as u64).to_le_bytes());
        digest.update(bytemuck::cast_slice(&self.blocks));
        self.pictures.iter().for_each(|picture| digest.update(picture.as_raw()));
    }

    fn digest(&self) -> [u8; 32] {
        let mut digest = Sha256::new();
        self.add_to(&mut digest);
        digest.finalize().into()
    }

    /// Reads all photographs of a scene at `side` x `side`.
    pub(crate) fn open(path: &PathBuf, side: u32, progress: &dyn Progress) -> Result<TrainingScene, TrainError> {
        let scene = Scene::open(path)?;
        let (mut cameras, mut pictures) = (Vec::new(), Vec::new());
        for (index, view) in scene.views.iter().enumerate().filter(|(_, view)| view.image.is_some()) {
            progress.check()?;
            let pinhole = &view.camera.pinhole;
            if pinhole.width() != pinhole.height() {
                let (path, view) = (path.clone(), view.name.clone());
                return Err(TrainError::NotSquare { path, view, width: pinhole.width(), height: pinhole.height() });
            }
            let mut picture = over_white(&scene.photograph(index)?.pixels);
            if pinhole.width() != side {
                picture = resize(&picture, side, side, FilterType::Triangle);
            }
            let pinhole =
                pinhole.resized(side, side).map_err(|error| TrainError::Pinhole { path: path.clone(), error })?;
            cameras.push(Camera { pose: view.camera.pose, pinhole });
            pictures.push(picture);
        }
        // As the field shows them to a network where the photographs look at one point.
        let network_unit = RigUnit::of_network(&cameras);
        cameras.iter_mut().for_each(|camera| *camera = network_unit.camera(camera));
        Ok(TrainingScene {
            path: path.clone(),
            blocks: cameras.iter().map(|camera| camera.block(0)).collect(),
            bounds: pictures.iter().map(bounds).collect(),
            near_far: default_near_far(&cameras),
            unit: RigUnit::of(&cameras),
            cameras,
            pictures,
        })
    }

    /// Reads several scenes, on all cores.
    pub(crate) fn open_all(
        paths: &[PathBuf],
        side: u32,
        least_views: usize,
        progress: &dyn Progress,
    ) -> Result<Vec<TrainingScene>, TrainError> {
        progress.expect(paths.len());
        let open = |path: &PathBuf| {
            let scene = TrainingScene::open(path, side, progress)?;
            if scene.cameras.len() < least_views {
                let (path, view_count) = (path.clone(), scene.cameras.len());
                return Err(TrainError::FewViews { path, view_count, least_views });
            }
            progress.step();
            Ok(scene)
        };
        // The first error in the order of the scenes, not any of several.
        paths.par_iter().map(open).collect::<Vec<_>>().into_iter().collect()
    }

    /// Red, green, blue in `[0, 1]`.
    pub(crate) fn colour(&self, view: usize, column: u32, row: u32) -> [f32; 3] {
        self.pictures[view].get_pixel(column, row).0.map(|value| f32::from(value) / 255.0)
    }

    /// A part of a view as a source: its camera and its picture.
    pub(crate) fn source(&self, view: usize, cut: Cut) -> Result<(Camera, RgbImage), PinholeError> {
        let Cut { left, top, size, side } = cut;
        let (camera, picture) = (self.cameras[view], &self.pictures[view]);
        if (left, top, size, side) == (0, 0, picture.width(), picture.width()) {
            return Ok((camera, picture.clone()));
        }
        let [x, y] = camera.pinhole.principal();
        let principal = [x - left as f32, y - top as f32];
        let pinhole = Pinhole::new(camera.pinhole.focal(), principal, size, size)?.resized(side, side)?;
        let part = crop_imm(picture, left, top, size, size).to_image();
        let part = if size == side { part } else { resize(&part, side, side, FilterType::Triangle) };
        Ok((Camera { pinhole, ..camera }, part))
    }
}

/// A picture as a network's input: `[row][column][channel]`, in `[-1, 1]`.
pub(crate) fn inputs(picture: &RgbImage) -> impl Iterator<Item = f32> + '_ {
    picture.as_raw().iter().map(|value| f32::from(*value) / 127.5 - 1.0)
}

fn over_white(pixels: &image::RgbaImage) -> RgbImage {
    RgbImage::from_fn(pixels.width(), pixels.height(), |column, row| {
        let [red, green, blue, alpha] = pixels.get_pixel(column, row).0.map(u32::from);
        Rgb([red, green, blue].map(|colour| ((colour * alpha + 255 * (255 - alpha) + 127) / 255) as u8))
    })
}

fn bounds(picture: &RgbImage) -> [u32; 4] {
    let mut bounds = [u32::MAX, u32::MAX, 0, 0];
    for (column, row, pixel) in picture.enumerate_pixels() {
        // The rest of a white background after resampling is not part of the object.
        if pixel.0.iter().any(|value| *value < 250) {
            bounds = [bounds[0].min(column), bounds[1].min(row), bounds[2].max(column), bounds[3].max(row)];
        }
    }
    if bounds[0] > bounds[2] { [0, 0, picture.width() - 1, picture.height() - 1] } else { bounds }
}
