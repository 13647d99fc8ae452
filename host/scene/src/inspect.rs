//! The contents of a scene and likely faults in it, to be checked before hours of rendering.

use crate::path::arc::Arc;
use crate::photographs::object_box::find_object;
use crate::photographs::{Album, BackgroundChoice};
use crate::rig::{Rig, gap_warning};
use crate::unit::SRN_DISTANCE;
use crate::{Scene, View};
use serde::Serialize;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::sources::MAX_SOURCES;
use viewfuse_job::progress::Interrupted;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::visual_hull::ObjectBlock;

/// Longest side at which photographs are read, in pixels: enough to find the object.
const LOOK_SIDE: u32 = 128;
/// A rig whose axes miss their common point by more than this share of the distance has no common subject.
const MAX_AXIS_MISS: f32 = 0.25;
/// Range of distances beyond which a unit is likely a mistake.
const USUAL_DISTANCES: (f32, f32) = (0.1, 100.0);

/// The findings about a scene. Lengths in world units, world coordinates.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// The path it was opened from.
    pub path: String,
    /// `srn`, `transforms`, `colmap` and so on: the name of its reader.
    pub layout: &'static str,
    /// Views with a photograph.
    pub photograph_count: usize,
    /// Target poses without one.
    pub target_count: usize,
    /// Views whose photograph is undistorted when it is read.
    pub lens_count: usize,
    /// Views with a mask.
    pub mask_count: usize,
    /// Reconstructed points.
    pub point_count: usize,
    /// What was subtracted from the coordinates of the files: `file = origin + unit * world`.
    pub origin: [f64; 3],
    /// The world's unit in the file's units.
    pub unit: f64,
    /// Width and height of the first view's image.
    pub size: [u32; 2],
    /// Focal lengths of the first view in pixels.
    pub focal: [f32; 2],
    /// Principal point of the first view in pixels from the outer corner of the top left pixel.
    pub principal: [f32; 2],
    /// The point nearest to all principal axes.
    pub focus: [f32; 3],
    /// Root mean square distance of the principal axes from it.
    pub axis_miss: f32,
    /// Least and greatest distance of a camera from it.
    pub distances: [f32; 2],
    /// The up direction.
    pub up: [f32; 3],
    /// The angle between a camera and the nearest other one, seen from the focus, in degrees: the median and the
    /// greatest of the photographs; null for fewer than two.
    pub gaps: Option<[f32; 2]>,
    /// How much of the circle around the focus the photographs cover, in degrees: 360, or the arc of `--orbit`.
    pub arc: f32,
    /// Least and greatest angle of a photograph's camera above the focus, in degrees.
    pub elevations: [f32; 2],
    /// Least and greatest corner of the bounding box of the visual hull; null where no object is cut out of the
    /// photographs.
    pub object: Option<[[f32; 3]; 2]>,
    /// Least depth of the object in any view, or of the ball that the cameras see.
    pub near: f32,
    /// Greatest depth.
    pub far: f32,
    /// Conventions of the files that were applied, one line each.
    pub conventions: Vec<String>,
    /// Keys and files that were not read, one line for each file or folder.
    pub unused: Vec<String>,
    /// Warnings, one line each.
    pub warnings: Vec<String>,
}

/// Inspects a scene. Photographs are read at a small size to find the object; if that fails, the reason is a warning.
///
/// # Errors
/// [`Interrupted`] if the work is stopped.
pub fn inspect(
    scene: &Scene,
    background: BackgroundChoice,
    progress: &dyn Progress,
) -> Result<Inspection, Interrupted> {
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let rig = Rig::of(&cameras);
    let mut warnings = scene.warnings.clone();
    warnings.extend(scene.pose_warnings());
    warnings.extend(rig_warnings(scene, &rig));
    let is_photographed = |view: &&View| view.image.is_some();
    let photographed: Vec<Camera> = scene.views.iter().filter(is_photographed).map(|view| view.camera).collect();
    let object = match object_of(scene, background, progress, &mut warnings) {
        Ok(object) => {
            if object.is_none() {
                warnings.extend(gap_warning(&photographed));
            }
            object
        }
        Err(reason) => {
            warnings.push(reason);
            None
        }
    };
    progress.check()?;
    let [near, far] = depth_range(&cameras, &rig, object.as_ref());
    let distance = |camera: &Camera| camera.pose.centre_world().distance(rig.focus);
    let pinhole = cameras[0].pinhole;
    let photograph_count = photographed.len();
    Ok(Inspection {
        path: scene.path.display().to_string(),
        layout: scene.layout,
        photograph_count,
        target_count: scene.views.len() - photograph_count,
        lens_count: scene.views.iter().filter(|view| view.lens.is_some()).count(),
        mask_count: scene.views.iter().filter(|view| view.mask.is_some()).count(),
        point_count: scene.points.len(),
        origin: scene.frame.origin.to_array(),
        unit: scene.frame.scale,
        size: [pinhole.width(), pinhole.height()],
        focal: pinhole.focal(),
        principal: pinhole.principal(),
        focus: rig.focus.to_array(),
        axis_miss: rig.axis_miss,
        distances: [
            cameras.iter().map(distance).fold(f32::INFINITY, f32::min),
            cameras.iter().map(distance).fold(0.0, f32::max),
        ],
        up: rig.up.to_array(),
        gaps: gaps(&rig, &photographed),
        arc: Arc::covered(&photographed).width.to_degrees(),
        elevations: elevations(&rig, &photographed),
        object: object.map(|object| [object.low, object.high].map(|c| [c[0], c[1], c[2]])),
        near,
        far,
        conventions: scene.conventions.clone(),
        unused: scene.unused.clone(),
        warnings,
    })
}

/// The median and the greatest angle to the nearest other camera.
fn gaps(rig: &Rig, cameras: &[Camera]) -> Option<[f32; 2]> {
    let gaps = rig.gaps(cameras);
    Some([*gaps.get(gaps.len() / 2)?, *gaps.last()?])
}

/// Least and greatest angle above the focus, degrees; zeros without a camera.
fn elevations(rig: &Rig, cameras: &[Camera]) -> [f32; 2] {
    let above = |camera: &Camera| {
        let direction = (camera.pose.centre_world() - rig.focus).normalize_or_zero();
        direction.dot(rig.up).clamp(-1.0, 1.0).asin().to_degrees()
    };
    let mut all = cameras.iter().map(above);
    let first = all.next().unwrap_or_default();
    all.fold([first; 2], |[least, most], angle| [least.min(angle), most.max(angle)])
}

/// Warnings about the cameras.
fn rig_warnings(scene: &Scene, rig: &Rig) -> Vec<String> {
    let mut warnings = Vec::new();
    if rig.axis_miss > MAX_AXIS_MISS * rig.distance {
        warnings.push(format!(
            "the cameras do not look at a common point: their axes miss the nearest one by {:.3} at a distance of \
                {:.3}",
            rig.axis_miss, rig.distance
        ));
    }
    if !(USUAL_DISTANCES.0..=USUAL_DISTANCES.1).contains(&rig.distance) {
        warnings.push(format!(
            "the cameras are {:.3e} units from what they look at, usual are {} to {}: weightings and networks measure \
             in units in which this is {SRN_DISTANCE}",
            rig.distance, USUAL_DISTANCES.0, USUAL_DISTANCES.1
        ));
    }
    let first = &scene.views[0].camera.pinhole;
    if let Some(view) = scene.views.iter().find(|view| {
        let pinhole = &view.camera.pinhole;
        (pinhole.width(), pinhole.height()) != (first.width(), first.height())
    }) {
        warnings.push(format!("view '{}' has another size than the first", view.name));
    }
    warnings
}

/// The bounding box of the visual hull, or why there is none.
fn object_of(
    scene: &Scene,
    background: BackgroundChoice,
    progress: &dyn Progress,
    warnings: &mut Vec<String>,
) -> Result<Option<ObjectBlock>, String> {
    let views: Vec<usize> =
        (0..scene.views.len()).filter(|&view| scene.views[view].image.is_some()).take(MAX_SOURCES).collect();
    if views.len() < 2 {
        return Err("fewer than two photographs: the object cannot be found".to_owned());
    }
    let album = Album::open_at(scene, views.iter().copied(), LOOK_SIDE, progress).map_err(|error| error.to_string())?;
    let images = album.sources(&views, LOOK_SIDE, background, progress).map_err(|error| error.to_string())?;
    warnings.extend(images.warnings.clone());
    if !images.has_silhouettes {
        return Ok(None);
    }
    let nothing = "the silhouettes have no common object: wrong poses, or a background that is not of one colour";
    find_object(&images).map(Some).ok_or_else(|| nothing.to_owned())
}

/// Least and greatest depth of the object's box, or of the rig's ball, over the cameras.
fn depth_range(cameras: &[Camera], rig: &Rig, object: Option<&ObjectBlock>) -> [f32; 2] {
    let depth = |camera: &Camera, point: Vec3| camera.pose.to_camera(point).z;
    let mut range = [f32::INFINITY, 0.0_f32];
    let mut include = |depth: f32| range = [range[0].min(depth), range[1].max(depth)];
    for camera in cameras {
        match object {
            Some(object) => object.corners().into_iter().for_each(|corner| include(depth(camera, corner))),
            None => {
                include(depth(camera, rig.focus) - rig.subject_radius);
                include(depth(camera, rig.focus) + rig.subject_radius);
            }
        }
    }
    // Cameras that look away from everything have nothing in front of them: the range is then empty, not inverted.
    range[0] = range[0].max(0.01 * rig.distance);
    range[1] = range[1].max(range[0]);
    range
}
