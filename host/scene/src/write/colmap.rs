//! COLMAP's text model: one camera for each image, points with the images that saw them.

use std::fmt::Write;

use glam::{DMat3, DQuat, DVec3};
use viewfuse_core::lens::{Lens, Projection};

use super::{Draft, WriteSceneError, camera_from_world, words};
use crate::{Scene, View};

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let scene = out.scene;
    let mut cameras = String::from("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n");
    let mut images = String::from("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# X Y POINT3D_ID of each point\n");
    let mut points = String::from("# POINT3D_ID X Y Z R G B ERROR TRACK[] as (IMAGE_ID POINT2D_IDX)\n");
    let seen = observations(scene);
    for (index, view) in scene.views.iter().enumerate() {
        let id = index + 1;
        let photograph = out.stored_photograph(index, "images")?;
        out.mask(index, &photograph)?;
        let pinhole = &view.camera.pinhole;
        let (model, parameters) = parameters(view);
        // Writing to a text cannot fail.
        let _ = writeln!(cameras, "{id} {model} {} {} {}", pinhole.width(), pinhole.height(), words(parameters));
        let (rotation, translation) = rigid(scene, view);
        let [x, y, z, w] = rotation.to_array();
        let pose = words([w, x, y, z].into_iter().chain(translation.to_array()));
        let _ = writeln!(images, "{id} {pose} {id} {photograph}");
        let line = seen[index].iter().map(|&(point, [x, y])| format!("{x} {y} {}", point + 1)).collect::<Vec<_>>();
        let _ = writeln!(images, "{}", line.join(" "));
    }
    let mut next = vec![0; scene.views.len()];
    for (index, point) in scene.points.iter().enumerate() {
        let position = scene.frame.file(point.position_world.as_dvec3());
        let [red, green, blue] = point.colour;
        let error = point.error.map_or(-1.0, f64::from);
        let _ = write!(points, "{} {} {red} {green} {blue} {error}", index + 1, words(position.to_array()));
        for &view in &point.views {
            let place: &mut usize = &mut next[view as usize];
            let _ = write!(points, " {} {place}", view + 1);
            *place += 1;
        }
        points.push('\n');
    }
    out.put("sparse/0/cameras.txt", cameras)?;
    out.put("sparse/0/images.txt", images)?;
    out.put("sparse/0/points3D.txt", points)?;
    Ok(scene.views.len())
}

/// For each view the points that it saw, in their order, with their image coordinates in the stored photograph.
fn observations(scene: &Scene) -> Vec<Vec<(usize, [f64; 2])>> {
    let mut seen = vec![Vec::new(); scene.views.len()];
    for (index, point) in scene.points.iter().enumerate() {
        for &view in &point.views {
            let View { camera, lens, .. } = &scene.views[view as usize];
            let projected = camera.project(point.position_world);
            let (focal, principal) = (camera.pinhole.focal().map(f64::from), camera.pinhole.principal().map(f64::from));
            let pixel = [f64::from(projected.x), f64::from(projected.y)];
            let pixel = match lens {
                None => pixel,
                Some(lens) => {
                    let [x, y] = lens.distort([0, 1].map(|axis| (pixel[axis] - principal[axis]) / focal[axis]));
                    [x * focal[0] + principal[0], y * focal[1] + principal[1]]
                }
            };
            seen[view as usize].push((index, pixel));
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

/// Model and parameters of a view's camera.
fn parameters(view: &View) -> (&'static str, Vec<f64>) {
    let pinhole = &view.camera.pinhole;
    let ([fx, fy], [cx, cy]) = (pinhole.focal().map(f64::from), pinhole.principal().map(f64::from));
    let Some(lens) = &view.lens else { return ("PINHOLE", vec![fx, fy, cx, cy]) };
    let [k1, k2, k3, k4, k5, k6, p1, p2] = Lens::coefficients(lens);
    match (lens.projection(), [k3, k4, k5, k6] == [0.0; 4]) {
        (Projection::Fisheye, _) => ("OPENCV_FISHEYE", vec![fx, fy, cx, cy, k1, k2, k3, k4]),
        (Projection::Perspective, true) => ("OPENCV", vec![fx, fy, cx, cy, k1, k2, p1, p2]),
        (Projection::Perspective, false) => ("FULL_OPENCV", vec![fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]),
    }
}
