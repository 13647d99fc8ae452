//! The checks that every reader shares: numbers become poses and pinholes here, and nowhere else.
//!
//! All arithmetic is in f64; values passed to core are rounded once.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use image::metadata::Orientation;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::{MAX_COORDINATE, Pose, PoseError, RIGID_TOLERANCE};

use super::error::{SceneError, SceneFault};
use super::fault::{FileFault, FilePlace, ImageFault, IntrinsicsFault};
use super::frame;
use super::images;
use super::reader::{ImageFile, PoseForm, RawIntrinsics, RawPoint, RawPose, RawScene, RawView};
use super::{SceneFrame, ScenePoint, View};

/// Most bytes of a view's name: file systems take 255, and results have endings such as `_confidence.png`.
const MAX_NAME: usize = 240;

/// Whether a view may be called so: results are files of its name.
pub(crate) fn is_name(name: &str) -> bool {
    let is_no_part = |letter: char| std::path::is_separator(letter) || letter == '\0';
    !name.is_empty() && name.len() <= MAX_NAME && !name.contains(is_no_part)
}

/// A scene whose numbers were checked.
pub(super) struct Checked {
    pub(super) views: Vec<View>,
    pub(super) points: Vec<ScenePoint>,
    pub(super) warnings: Vec<String>,
    pub(super) conventions: Vec<String>,
    pub(super) unused: Vec<String>,
    /// The files of cameras and points that were read.
    pub(super) lists: BTreeSet<PathBuf>,
    pub(super) frame: SceneFrame,
}

/// The scene, its views with photographs first.
pub(super) fn scene(found: &Path, form: &'static str, raw: RawScene) -> Result<Checked, SceneError> {
    let RawScene { views: raw_views, points, points_path, mut warnings, conventions, unused } = raw;
    let mut order: Vec<usize> = (0..raw_views.len()).collect();
    // Stable: photographs first, otherwise in their order.
    order.sort_by_key(|&view| raw_views[view].image.is_none());
    let no_views = || FilePlace::file(found).fault(SceneFault::NoViews(form));

    let mut views: Vec<View> = Vec::with_capacity(raw_views.len());
    for raw in order.iter().map(|&view| &raw_views[view]) {
        if !is_name(&raw.name) {
            return Err(FilePlace::file(found).fault(SceneFault::Name(raw.name.clone())));
        }
        let pinhole = match (&raw.intrinsics, views.first()) {
            (Some(intrinsics), _) => pinhole_of(intrinsics, raw.image.as_ref())?,
            (None, Some(first)) => first.camera.pinhole,
            (None, None) => return Err(no_views()),
        };
        views.push(View {
            name: raw.name.clone(),
            camera: Camera { pose: pose(&raw.pose, &SceneFrame::FILE)?, pinhole },
            image: raw.image.as_ref().map(|image| image.path().to_path_buf()),
            lens: raw.intrinsics.as_ref().and_then(|intrinsics| intrinsics.lens).filter(|lens| !lens.is_pinhole()),
            mask: raw.mask.clone(),
            near_far: None,
            split: raw.split,
        });
    }
    if views.first().is_none_or(|view| view.image.is_none()) {
        return Err(no_views());
    }

    let axes: Vec<_> = raw_views.iter().map(|view| axis(&world_from_camera(&view.pose))).collect();
    let (frame, warning) = frame::of(&axes);
    warnings.extend(warning.map(|warning| format!("{}: {warning}", found.display())));
    for (view, raw) in views.iter_mut().zip(order.iter().map(|&view| &raw_views[view])) {
        if frame != SceneFrame::FILE {
            view.camera.pose = pose(&raw.pose, &frame)?;
        }
        view.near_far = near_far(raw, &frame)?;
    }
    let mut place = vec![0; order.len()];
    for (now, &before) in order.iter().enumerate() {
        place[before] = now as u32;
    }
    let intrinsics = raw_views.iter().filter_map(|view| view.intrinsics.as_ref()).map(|raw| &raw.place.path);
    let poses = raw_views.iter().map(|view| &view.pose.place.path);
    let lists = poses.chain(intrinsics).chain([&points_path]).cloned().collect();
    let points = points.into_iter().map(|raw| point(&points_path, raw, &frame, &place)).collect::<Result<_, _>>()?;
    Ok(Checked { views, points, warnings, conventions, unused, lists, frame })
}

/// The camera of a view without a photograph, in the world of a scene that is open; `pinhole` is that of a view without
/// intrinsics.
pub(crate) fn camera_in(raw: &RawView, pinhole: &Pinhole, frame: &SceneFrame) -> Result<Camera, SceneError> {
    let pinhole = raw.intrinsics.as_ref().map_or(Ok(*pinhole), |intrinsics| pinhole_of(intrinsics, None))?;
    Ok(Camera { pose: pose(&raw.pose, frame)?, pinhole })
}

/// Depths of a view in world units.
fn near_far(raw: &RawView, frame: &SceneFrame) -> Result<Option<[f32; 2]>, SceneError> {
    let Some([near, far]) = raw.near_far else { return Ok(None) };
    let [low, high] = [near, far].map(|depth| (depth / frame.scale) as f32);
    if low > 0.0 && low < high && high <= MAX_COORDINATE {
        return Ok(Some([low, high]));
    }
    Err(raw.pose.place.clone().fault(SceneFault::Depths(near, far)))
}

fn point(path: &Path, raw: RawPoint, frame: &SceneFrame, place: &[u32]) -> Result<ScenePoint, SceneError> {
    let position_world = frame.world(DVec3::from_array(raw.position)).as_vec3();
    if !(position_world.abs().max_element() <= MAX_COORDINATE) || position_world.is_nan() {
        let place = FilePlace { path: path.to_path_buf(), location: raw.location };
        return Err(place.fault(SceneFault::Point(raw.position)));
    }
    let mut views: Vec<u32> = raw.views.iter().filter_map(|&view| place.get(view as usize).copied()).collect();
    views.sort_unstable();
    views.dedup();
    let error = (raw.error >= 0.0).then_some(raw.error as f32).filter(|error| error.is_finite());
    Ok(ScenePoint { position_world, error, colour: raw.colour, views })
}

/// A pose from the 16 numbers of a row-major matrix, in the world of a frame.
fn pose(raw: &RawPose, frame: &SceneFrame) -> Result<Pose, SceneError> {
    let RawPose { matrix, form, place } = raw;
    let checked = if *frame == SceneFrame::FILE {
        match form {
            PoseForm::WorldFromOpenCv => Pose::from_opencv(&single(matrix)),
            PoseForm::WorldFromOpenGl => Pose::from_opengl(&single(matrix)),
            // Transposing inverts a rigid matrix only, so the matrix as given must pass too.
            PoseForm::OpenCvFromWorld => {
                Pose::from_opencv(&single(matrix)).and_then(|_| Pose::from_opencv(&single(&world_from_camera(raw))))
            }
        }
    } else {
        let mut moved = world_from_camera(raw);
        let centre = frame.world(axis(&moved).0);
        (moved[0][3], moved[1][3], moved[2][3]) = (centre.x, centre.y, centre.z);
        Pose::from_opencv(&single(&moved))
    };
    checked.map_err(|reason: PoseError| {
        place.clone().fault(match (reason, form, scale(matrix)) {
            (PoseError::NotRigid { .. }, PoseForm::WorldFromOpenCv | PoseForm::WorldFromOpenGl, Some(scale)) => {
                SceneFault::Scaled(scale)
            }
            _ => SceneFault::Pose(reason),
        })
    })
}

/// The scale of a matrix whose 3x3 block is a rotation times a number: of a camera below a scaled object.
fn scale(m: &[[f64; 4]; 4]) -> Option<f64> {
    let column = |at: usize| DVec3::new(m[0][at], m[1][at], m[2][at]);
    let block = DMat3::from_cols(column(0), column(1), column(2));
    let scale = block.determinant().cbrt();
    let rotation = block * (1.0 / scale);
    let is_rotation = (rotation.transpose() * rotation).abs_diff_eq(DMat3::IDENTITY, f64::from(RIGID_TOLERANCE));
    (scale > 0.0 && is_rotation).then_some(scale)
}

fn single(matrix: &[[f64; 4]; 4]) -> [[f32; 4]; 4] {
    matrix.map(|row| row.map(|value| value as f32))
}

/// The camera's centre and its principal axis, from a camera-to-world matrix.
fn axis(m: &[[f64; 4]; 4]) -> (DVec3, DVec3) {
    (DVec3::new(m[0][3], m[1][3], m[2][3]), DVec3::new(m[0][2], m[1][2], m[2][2]).normalize_or_zero())
}

/// The camera-to-world matrix in OpenCV axes; of a world-to-camera one, `[R^T | -R^T t]`.
fn world_from_camera(raw: &RawPose) -> [[f64; 4]; 4] {
    let mut m = raw.matrix;
    match raw.form {
        PoseForm::WorldFromOpenCv => m,
        PoseForm::WorldFromOpenGl => {
            m[..3].iter_mut().for_each(|row| (row[1], row[2]) = (-row[1], -row[2]));
            m
        }
        PoseForm::OpenCvFromWorld => {
            let centre = |axis: usize| -(m[0][axis] * m[0][3] + m[1][axis] * m[1][3] + m[2][axis] * m[2][3]);
            let row = |axis: usize| [m[0][axis], m[1][axis], m[2][axis], centre(axis)];
            [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
        }
    }
}

/// The pinhole of a view: of the intrinsics' own size, or of a photograph that may be a resampled copy of such an
/// image.
///
/// # Errors
/// [`ImageFault::SizeMismatch`] if the photograph cannot be the whole image at another scale,
/// [`ImageFault::Orientation`] if it is ambiguous whether the camera is that of the stored or of the upright picture.
fn pinhole_of(raw: &RawIntrinsics, image: Option<&ImageFile>) -> Result<Pinhole, SceneError> {
    let RawIntrinsics { focal, principal, size: stated, lens: _, place, size_place } = raw;
    let image_size = image.map(|image| upright_size(image, *stated)).transpose()?;
    let Some(size) = (*stated).or(image_size) else {
        return Err(FilePlace::file(&place.path).fault(FileFault::MissingKey("the size of the image".to_string())));
    };
    let stated = pinhole(place, *focal, *principal, size)?;
    let (Some(image), Some(image_size)) = (image, image_size) else { return Ok(stated) };
    if !same_shape(size, image_size) {
        let declared_in = size_place.to_string();
        let fault = ImageFault::SizeMismatch { size: image_size, declared: size, declared_in };
        return Err(FilePlace::file(image.path()).fault(fault));
    }
    let scale = [0, 1].map(|axis| f64::from(image_size[axis]) / f64::from(size[axis]));
    let scaled = |pair: &[f64; 2]| [pair[0] * scale[0], pair[1] * scale[1]];
    pinhole(size_place, scaled(focal), scaled(principal), image_size)
}

/// The size of the camera's picture: the stored one, or the upright one if the file's orientation tag says that it must
/// be turned.
fn upright_size(image: &ImageFile, stated: Option<[u32; 2]>) -> Result<[u32; 2], SceneError> {
    let stored = image.size();
    if image.orientation() == Orientation::NoTransforms {
        return Ok(stored);
    }
    let turned = images::turned(stored, image.orientation());
    let fits = |size: [u32; 2]| stated.is_some_and(|stated| same_shape(stated, size));
    match (fits(stored), fits(turned)) {
        (true, false) => Ok(stored),
        (false, true) => Ok(turned),
        _ => Err(FilePlace::file(image.path()).fault(ImageFault::Orientation(image.orientation()))),
    }
}

/// The pinhole of images of this size, if the numbers are a pinhole camera.
fn pinhole(place: &FilePlace, focal: [f64; 2], principal: [f64; 2], size: [u32; 2]) -> Result<Pinhole, SceneError> {
    let single = |pair: [f64; 2]| pair.map(|value| value as f32);
    let pinhole = Pinhole::new(single(focal), single(principal), size[0], size[1]);
    pinhole.map_err(|error| place.clone().fault(IntrinsicsFault::from_pinhole(error, focal, principal, size)))
}

/// A width and a height from numbers of a file.
pub(crate) fn size(place: &FilePlace, width: f64, height: f64) -> Result<[u32; 2], SceneError> {
    let whole = |side: f64| (1.0..=f64::from(1u32 << 20)).contains(&side) && side.fract() == 0.0;
    match whole(width) && whole(height) {
        true => Ok([width as u32, height as u32]),
        false => Err(place.clone().fault(IntrinsicsFault::Size(width, height))),
    }
}

/// Whether one size is the other at another scale, each side rounded to a whole pixel up or down.
///
/// An image that keeps one side and changes the other is a crop, for any change.
pub(super) fn same_shape(a: [u32; 2], b: [u32; 2]) -> bool {
    if a[0] == b[0] || a[1] == b[1] {
        return a == b;
    }
    let (wide, tall) = (u64::from(a[0]) * u64::from(b[1]), u64::from(a[1]) * u64::from(b[0]));
    wide.abs_diff(tall) < u64::from(a[0].max(a[1]))
}
