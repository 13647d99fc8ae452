//! A solution as a scene, by the interface of a layout's reader: the scene's own checks apply, and nothing is written.

use crate::focal::Cameras;
use crate::intake::Photo;
use crate::solution::{Solution, SolvedPoint};
use std::path::{Path, PathBuf};
use viewfuse_core::lens::{Lens, Projection};
use viewfuse_scene::reader::{ImageFile, PoseForm, RawIntrinsics, RawPoint, RawPose, RawScene, RawView, Reader};
use viewfuse_scene::{FaultLocation, FilePlace, Scene, SceneError};

/// Points with a larger mean reprojection error, in pixels at working size, are dropped.
const MAX_POINT_ERROR: f64 = 4.0;

/// Reads a solution.
struct Posed<'a> {
    photos: &'a [Photo],
    cameras: &'a Cameras,
    solution: &'a Solution,
    /// Ascending.
    taken: &'a [usize],
}

/// The scene of the photographs `taken`, ascending, which must have poses; its views are in their order.
///
/// # Errors
/// [`SceneError`], of a photograph that changed or of poses that are none.
pub(crate) fn scene(
    folder: &Path,
    photos: &[Photo],
    cameras: &Cameras,
    solution: &Solution,
    taken: &[usize],
) -> Result<Scene, SceneError> {
    Scene::open_with(folder, &[&Posed { photos, cameras, solution, taken }])
}

impl Posed<'_> {
    /// Pixels of a photograph for each of its pixels at working size.
    fn scale(&self, photo: usize) -> [f64; 2] {
        let Photo { size, working_size, .. } = &self.photos[photo];
        [0, 1].map(|axis| f64::from(size[axis]) / f64::from(working_size[axis]))
    }

    fn view(&self, index: usize) -> Result<RawView, SceneError> {
        let photo = &self.photos[index];
        let camera = &self.solution.cameras[self.cameras.of_photo[index]];
        let [x, y, z] = self.solution.photographs[index].camera_from_world.unwrap_or_default();
        let matrix = [x, y, z, [0.0, 0.0, 0.0, 1.0]];
        let (scale, place) = (self.scale(index), FilePlace::file(&photo.path));
        let lens = Lens::new(Projection::Perspective, [camera.k1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let focal = scale.map(|scale| scale * camera.focal);
        let principal = [0, 1].map(|axis| scale[axis] * camera.principal[axis]);
        let intrinsics = RawIntrinsics {
            size: Some(photo.size),
            lens: lens.ok().filter(|lens| !lens.is_pinhole()),
            ..RawIntrinsics::of_photograph(focal, principal, place.clone())
        };
        let pose = RawPose { matrix, form: PoseForm::OpenCvFromWorld, place };
        Ok(RawView::new(photo.name.clone(), Some(ImageFile::open(&photo.upright)?), pose, Some(intrinsics)))
    }

    fn point(&self, point: &SolvedPoint) -> Option<RawPoint> {
        let place = |photo: &usize| self.taken.binary_search(photo).ok();
        let mut views: Vec<u32> = point.seen.iter().filter_map(|(photo, _)| Some(place(photo)? as u32)).collect();
        views.sort_unstable();
        views.dedup();
        if views.len() < 2 || point.error > MAX_POINT_ERROR {
            return None;
        }
        let (photo, at) = point.seen.iter().find(|(photo, _)| place(photo).is_some())?;
        let Photo { copy, working_size, .. } = &self.photos[*photo];
        let pixel = |axis: usize, side: u32| {
            let share = at[axis] / f64::from(working_size[axis]);
            ((share * f64::from(side)) as u32).min(side.saturating_sub(1))
        };
        let colour = copy.get_pixel(pixel(0, copy.width()), pixel(1, copy.height())).0;
        let error = point.error * self.scale(*photo)[0];
        Some(RawPoint { position: point.position, error, colour, views, location: FaultLocation::File })
    }
}

impl Reader for Posed<'_> {
    fn name(&self) -> &'static str {
        "posed"
    }

    fn form(&self) -> &'static str {
        "photographs whose poses were found"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        Ok(Some(path.to_path_buf()))
    }

    fn read(&self, found: &Path) -> Result<RawScene, SceneError> {
        let views = self.taken.iter().map(|photo| self.view(*photo)).collect::<Result<_, _>>()?;
        let points = self.solution.points.iter().filter_map(|point| self.point(point)).collect();
        Ok(RawScene { views, points, points_path: found.to_path_buf(), ..RawScene::default() })
    }
}
