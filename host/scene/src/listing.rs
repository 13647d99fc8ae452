//! The views of a scene as a list, each with its neighbours: by which names and numbers a person can choose them.

use crate::Scene;
use crate::rig::Rig;
use serde::Serialize;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;

/// Neighbours that are listed for each view.
const NEIGHBOURS: usize = 3;

/// A view.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ListedView {
    /// Where it stands in the scene, from 0: `#3` names the view of index 3.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// Width and height of its picture.
    pub size: [u32; 2],
    /// Whether it has a photograph, or is a target pose alone.
    pub has_photograph: bool,
    /// The views nearest to it, the nearest first.
    pub neighbours: Vec<Neighbour>,
}

/// A view beside another one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Neighbour {
    /// Its index.
    pub index: usize,
    /// The angle between the two, seen from what the cameras look at, in degrees.
    pub degrees: f32,
    /// Distance of the two cameras in world units.
    #[serde(skip)]
    distance: f32,
}

/// All views, in the scene's order. Neighbours are sorted by angle; of equal angles, by distance.
pub fn list_views(scene: &Scene) -> Vec<ListedView> {
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let focus = Rig::of(&cameras).focus;
    let centres: Vec<Vec3> = cameras.iter().map(|camera| camera.pose.centre_world()).collect();
    let directions: Vec<Vec3> = centres.iter().map(|centre| (*centre - focus).normalize_or_zero()).collect();
    let neighbours = |view: usize| -> Vec<Neighbour> {
        let to = |other: usize| {
            // Of nearly equal directions the cosine has lost the angle, the sine has not.
            let (sine, cosine) =
                (directions[view].cross(directions[other]).length(), directions[view].dot(directions[other]));
            let distance = centres[view].distance(centres[other]);
            Neighbour { index: other, degrees: sine.atan2(cosine).to_degrees(), distance }
        };
        let mut others: Vec<Neighbour> = (0..cameras.len()).filter(|other| *other != view).map(to).collect();
        let order =
            |a: &Neighbour, b: &Neighbour| a.degrees.total_cmp(&b.degrees).then(a.distance.total_cmp(&b.distance));
        others.sort_by(order);
        others.truncate(NEIGHBOURS);
        others
    };
    let listed = |(index, view): (usize, &crate::View)| ListedView {
        index,
        name: view.name.clone(),
        size: [view.camera.pinhole.width(), view.camera.pinhole.height()],
        has_photograph: view.image.is_some(),
        neighbours: neighbours(index),
    };
    scene.views.iter().enumerate().map(listed).collect()
}
