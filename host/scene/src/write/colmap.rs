//! COLMAP's model, as text or binary: one camera for each image, points with the images that saw them.
//!
//! Numbers of cameras and images are one more than the view's index, those of points one more than the point's.

mod binary;
mod text;

use glam::{DMat3, DQuat, DVec3};
use viewfuse_core::lens::{Lens, Projection};

use super::{Draft, WriteSceneError, camera_from_world};
use crate::{Scene, ScenePoint, View};

/// The two forms of a model's files.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    Text,
    Binary,
}

/// A view as a camera and an image of the model.
struct ModelView {
    /// Number of the camera and of the image.
    id: u32,
    model: ModelName,
    size: [u32; 2],
    parameters: Vec<f64>,
    /// World to camera, `w x y z`.
    rotation: [f64; 4],
    translation: [f64; 3],
    /// The photograph in `images`.
    name: String,
    /// What it saw: image coordinates and the point's number.
    observations: Vec<([f64; 2], u64)>,
}

/// A reconstructed point of the model.
struct WrittenPoint {
    id: u64,
    position: [f64; 3],
    colour: [u8; 3],
    /// -1 if it is not known.
    error: f64,
    /// Numbers of the images that saw it, and which of the image's observations it is.
    track: Vec<[u32; 2]>,
}

/// A camera model: COLMAP's name and number.
struct ModelName(&'static str, u32);

pub(super) fn write(out: &mut Draft, form: Form) -> Result<usize, WriteSceneError> {
    let (scene, mut seen) = (out.scene, observations(out.scene));
    let mut views = Vec::with_capacity(scene.views.len());
    for (index, view) in scene.views.iter().enumerate() {
        let name = match &view.lens {
            Some(lens) if !holds(lens) => out.pinhole_photograph_and_ignore_mask(index)?.0,
            _ => out.stored_photograph_and_mask(index)?.0,
        };
        let pinhole = &view.camera.pinhole;
        let (model, parameters) = parameters(view);
        let (rotation, translation) = rigid(scene, view);
        let [x, y, z, w] = rotation.to_array();
        views.push(ModelView {
            id: index as u32 + 1,
            model,
            size: [pinhole.width(), pinhole.height()],
            parameters,
            rotation: [w, x, y, z],
            translation: translation.to_array(),
            name,
            observations: std::mem::take(&mut seen[index]),
        });
    }
    let points = points(scene);
    let files = match form {
        Form::Text => [
            ("cameras.txt", text::cameras(&views).into_bytes()),
            ("images.txt", text::images(&views).into_bytes()),
            ("points3D.txt", text::points(&points).into_bytes()),
        ],
        Form::Binary => [
            ("cameras.bin", binary::cameras(&views)),
            ("images.bin", binary::images(&views)),
            ("points3D.bin", binary::points(&points)),
        ],
    };
    for (name, contents) in files {
        out.put(&format!("sparse/0/{name}"), contents)?;
    }
    Ok(views.len())
}

/// The scene's points in the coordinates of its files.
fn points(scene: &Scene) -> Vec<WrittenPoint> {
    let mut next = vec![0; scene.views.len()];
    let point = |(index, point): (usize, &ScenePoint)| {
        let place = |view: u32| {
            let place = next[view as usize];
            next[view as usize] += 1;
            [view + 1, place]
        };
        WrittenPoint {
            id: index as u64 + 1,
            position: scene.frame.file(point.position_world.as_dvec3()).to_array(),
            colour: point.colour,
            error: point.error.map_or(-1.0, f64::from),
            track: seen_by(scene, point).map(place).collect(),
        }
    };
    scene.points.iter().enumerate().map(point).collect()
}

/// The views that saw a point, but for those that it lies behind: it has no place in their photographs.
fn seen_by<'a>(scene: &'a Scene, point: &'a ScenePoint) -> impl Iterator<Item = u32> + 'a {
    let is_before = |view: &u32| scene.views[*view as usize].camera.project(point.position_world).depth > 0.0;
    point.views.iter().copied().filter(is_before)
}

/// For each view the points that it saw, in their order, with their image coordinates in the stored photograph.
fn observations(scene: &Scene) -> Vec<Vec<([f64; 2], u64)>> {
    let mut seen = vec![Vec::new(); scene.views.len()];
    for (index, point) in scene.points.iter().enumerate() {
        for view in seen_by(scene, point) {
            let View { camera, lens, .. } = &scene.views[view as usize];
            let projected = camera.project(point.position_world);
            let (focal, principal) = (camera.pinhole.focal().map(f64::from), camera.pinhole.principal().map(f64::from));
            let pixel = [f64::from(projected.x), f64::from(projected.y)];
            let pixel = match lens.as_ref().filter(|lens| holds(lens)) {
                None => pixel,
                Some(lens) => {
                    let [x, y] = lens.distort([0, 1].map(|axis| (pixel[axis] - principal[axis]) / focal[axis]));
                    [x * focal[0] + principal[0], y * focal[1] + principal[1]]
                }
            };
            seen[view as usize].push((pixel, index as u64 + 1));
        }
    }
    seen
}

/// World-to-camera rotation and translation. The translation is computed for the rotation as written, so that the
/// centre is unchanged.
fn rigid(scene: &Scene, view: &View) -> (DQuat, DVec3) {
    let rows = camera_from_world(scene, view);
    let [x, y, z] = rows.map(|row| DVec3::new(row[0], row[1], row[2]));
    let rotation = DQuat::from_mat3(&DMat3::from_cols(x, y, z).transpose()).normalize();
    let centre = scene.frame.file(view.camera.pose.centre_world().as_dvec3());
    (rotation, -(rotation * centre))
}

/// Whether a model has all of a lens's coefficients; photographs through other lenses are undistorted.
pub(super) fn holds(lens: &Lens) -> bool {
    let [.., fourth] = lens.coefficients();
    lens.projection() == Projection::Fisheye || fourth == 0.0
}

/// Model and parameters of a view's camera.
fn parameters(view: &View) -> (ModelName, Vec<f64>) {
    let pinhole = &view.camera.pinhole;
    let ([fx, fy], [cx, cy]) = (pinhole.focal().map(f64::from), pinhole.principal().map(f64::from));
    let Some(lens) = view.lens.as_ref().filter(|lens| holds(lens)) else {
        return (ModelName("PINHOLE", 1), vec![fx, fy, cx, cy]);
    };
    let [k1, k2, k3, k4, k5, k6, p1, p2, _] = lens.coefficients();
    match (lens.projection(), [k3, k4, k5, k6] == [0.0; 4]) {
        (Projection::Fisheye, _) => (ModelName("OPENCV_FISHEYE", 5), vec![fx, fy, cx, cy, k1, k2, k3, k4]),
        (Projection::Perspective, true) => (ModelName("OPENCV", 4), vec![fx, fy, cx, cy, k1, k2, p1, p2]),
        (Projection::Perspective, false) => {
            (ModelName("FULL_OPENCV", 6), vec![fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6])
        }
    }
}
