//! NeuS's layout, as its preprocessed DTU scenes have it: `cameras_sphere.npz`, `image/`, `mask/`.
//!
//! `world_mat_N` is the projection `K [R | t]` from the coordinates of the scene's own files, with `(0, 0)` at the
//! centre of the top left pixel. `scale_mat_N`, the same for all views, maps the unit sphere to what the cameras have
//! in common: the ball around the point nearest to their principal axes ([`Rig::subject_radius`]). A scene that was
//! read in this layout is in the sphere's coordinates already, and keeps them.
//!
//! `N` is the photograph's place in the order of the files' names, byte by byte, from 0, where NeuS's own program looks
//! for it; it reads PNGs alone. Where our reader would take a name's number for another one, photographs are numbered.
//! PNGs of a pinhole and their masks are copied; others are written undistorted, with the mask as a picture of its own,
//! which an alpha channel that says where the object is becomes, too.

use std::io::{Cursor, Write};

use glam::DVec3;
use viewfuse_core::camera::Camera;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::{Draft, Layout, WriteSceneError, camera_from_world};
use crate::numpy::npy;
use crate::photographs::ignored::shows_object;
use crate::rig::Rig;
use crate::scene::files::natural_order;
use crate::scene::neus::matrices_of;
use crate::{Scene, View};

/// Whether the scene is in the coordinates of a unit sphere that this layout gave it.
pub(super) fn has_unit_sphere(scene: &Scene) -> bool {
    // Depths come from the sphere: an archive without one has none.
    scene.layout == Layout::Neus.reader() && scene.views.iter().any(|view| view.near_far.is_some())
}

/// Refuses masks that do not say where an object is.
pub(super) fn fits(scene: &Scene) -> Result<(), String> {
    match scene.views.iter().find(|view| view.mask.is_some() && !scene.has_object_mask(view)) {
        Some(view) => {
            let name = &view.name;
            Err(format!("its masks say where the object is, and that of view {name:?} says which pixels do not count"))
        }
        None => Ok(()),
    }
}

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let count = out.scene.views.len();
    let has_masks = out.scene.views.iter().any(|view| out.scene.has_object_mask(view)) || shows_object(out.scene)?;
    (0..count).try_for_each(|view| photograph(out, view, has_masks))?;
    let numbers = places(&out.names);
    let (centre, radius) = sphere(out.scene);
    let scale = [
        [radius, 0.0, 0.0, centre.x],
        [0.0, radius, 0.0, centre.y],
        [0.0, 0.0, radius, centre.z],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let path = out.file("cameras_sphere.npz")?;
    let failed = |cause: std::io::Error| WriteSceneError::Io(path.clone(), cause);
    for (view, number) in out.scene.views.iter().zip(numbers) {
        for (name, matrix) in [("world_mat", projection(out.scene, view)), ("scale_mat", scale)] {
            let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
            archive.start_file(format!("{name}_{number}.npy"), stored).map_err(|cause| failed(cause.into()))?;
            archive.write_all(&npy(&[4, 4], matrix.as_flattened())).map_err(failed)?;
        }
    }
    let bytes = archive.finish().map_err(|cause| failed(cause.into()))?.into_inner();
    out.put("cameras_sphere.npz", bytes)?;
    Ok(count)
}

/// The only format that NeuS's own program reads.
const PNG: [&str; 1] = ["png"];

/// Writes the photograph of a view and its mask. If any has one, or an alpha channel that says where the object is,
/// each gets one (`has_masks`): NeuS's own program counts masks as it counts photographs.
fn photograph(out: &Draft, index: usize, has_masks: bool) -> Result<(), WriteSceneError> {
    let View { lens, mask, .. } = &out.scene.views[index];
    match (lens, mask) {
        (_, None) if has_masks => {
            out.pinhole_photograph_and_mask(index, "image", ["mask", &out.names[index]])?;
        }
        (None, _) => {
            out.stored_photograph(index, "image", &PNG)?;
            out.mask(index, "mask", &out.names[index], &PNG)?;
        }
        (Some(_), None) => drop(out.pinhole_photograph(index, "image")?),
        (Some(_), Some(_)) => drop(out.pinhole_photograph_and_mask(index, "image", ["mask", &out.names[index]])?),
    }
    Ok(())
}

/// The place of each name in the order of the files, byte by byte.
fn places(names: &[String]) -> Vec<u64> {
    let files: Vec<String> = names.iter().map(|name| format!("{name}.png")).collect();
    let mut order: Vec<usize> = (0..files.len()).collect();
    order.sort_by(|&a, &b| files[a].cmp(&files[b]));
    let mut places = vec![0; files.len()];
    order.into_iter().enumerate().for_each(|(place, view)| places[view] = place as u64);
    places
}

/// Names of a scene's views that are numbers, in natural order of their own; `None` where they can keep these.
pub(super) fn numbered(scene: &Scene) -> Option<Vec<String>> {
    let given: Vec<String> = scene.views.iter().map(|view| view.name.clone()).collect();
    let mut order: Vec<usize> = (0..given.len()).collect();
    order.sort_by(|&a, &b| natural_order(&format!("{}.png", given[a]), &format!("{}.png", given[b])));
    let listed: Vec<&str> = order.iter().map(|&view| given[view].as_str()).collect();
    let places = places(&given);
    let read = matrices_of(&listed, &(0..given.len() as u64).collect());
    if read.is_some_and(|read| order.iter().zip(read).all(|(&view, number)| places[view] == number)) {
        return None;
    }
    let mut names = vec![String::new(); given.len()];
    order.into_iter().enumerate().for_each(|(place, view)| names[view] = format!("{place:06}"));
    Some(names)
}

/// Centre and radius of the sphere in the coordinates of the scene's files.
pub(super) fn sphere(scene: &Scene) -> (DVec3, f64) {
    if has_unit_sphere(scene) {
        return (DVec3::ZERO, 1.0);
    }
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let Rig { focus, subject_radius, .. } = Rig::of(&cameras);
    let radius = if subject_radius > 0.0 { f64::from(subject_radius) } else { 1.0 };
    (scene.frame.file(focus.as_dvec3()), radius * scene.frame.scale)
}

/// Whether the sphere is so far from the origin that matrices in f32, which NeuS's own program takes, are wrong by a
/// thousandth of its radius.
pub(super) fn is_far(scene: &Scene) -> bool {
    let (centre, radius) = sphere(scene);
    centre.length() > 1.0e4 * radius
}

/// `K [R | t]` with the last row `0 0 0 1`; pixel centres at whole numbers.
fn projection(scene: &Scene, view: &View) -> [[f64; 4]; 4] {
    let pinhole = &view.camera.pinhole;
    let ([fx, fy], [cx, cy]) = (pinhole.focal().map(f64::from), pinhole.principal().map(f64::from));
    let [right, down, forward] = camera_from_world(scene, view);
    let row = |focal: f64, axis: [f64; 4], principal: f64| {
        std::array::from_fn(|column| focal * axis[column] + (principal - 0.5) * forward[column])
    };
    [row(fx, right, cx), row(fy, down, cy), forward, [0.0, 0.0, 0.0, 1.0]]
}
