//! What the page has to know of the scene before the first picture: cameras, their arrangement, schemes.

use crate::Viewed;
use crate::pace::Pace;
use crate::video::Videos;
use serde::Serialize;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::ROWS;
use viewfuse_field::About;
use viewfuse_job::shell::quoted;
use viewfuse_output::ring::{RingPlace, ring};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::item_of;
use viewfuse_scene::rig::Rig;
use viewfuse_weighting::scheme_names;

/// A greater limit of a parameter than this is none.
const MAX_LIMIT: f32 = 1.0e9;

/// The scene as the page gets it. World coordinates; poses are world from camera, row-major, in OpenCV axes.
#[derive(Debug, Serialize)]
pub(crate) struct Subject {
    name: String,
    field: &'static str,
    /// Whether pictures depend on the weights.
    is_weighted: bool,
    device: String,
    /// Width and height of full pictures.
    size: [u32; 2],
    /// Longest side of pictures while the camera moves.
    moving_side: u32,
    /// Intrinsics of full pictures.
    lens: Intrinsics,
    start: [[f32; 4]; 4],
    focus: [f32; 3],
    up: [f32; 3],
    /// Mean distance of the cameras from the focus.
    distance: f32,
    /// The world's place in the coordinates of the scene's files.
    origin: [f64; 3],
    scale: f64,
    /// Places on the circle around the focus at the sources' mean height and distance, in order.
    ring: Vec<RingPlace>,
    sources: Vec<CameraRow>,
    /// The scene's other views.
    others: Vec<CameraRow>,
    schemes: Vec<SchemeRow>,
    /// The one that the page begins with.
    scheme: String,
    /// Whether another one may be chosen for the scene.
    chooses: bool,
    commands: Commands,
    pub(crate) video: Videos,
}

/// A camera.
#[derive(Debug, Serialize)]
struct CameraRow {
    name: String,
    /// The name as a shell takes it.
    word: String,
    pose: [[f32; 4]; 4],
    lens: Intrinsics,
}

/// In pixels of `size`.
#[derive(Clone, Copy, Debug, Serialize)]
struct Intrinsics {
    focal: [f32; 2],
    principal: [f32; 2],
    size: [u32; 2],
}

/// A scheme with what can be chosen of it.
#[derive(Debug, Serialize)]
struct SchemeRow {
    name: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    parameter: Option<ParameterRow>,
    #[serde(skip_serializing_if = "Option::is_none")]
    choice: Option<ChoiceRow>,
}

#[derive(Debug, Serialize)]
struct ParameterRow {
    key: &'static str,
    least: f32,
    /// `None` if there is no limit.
    most: Option<f32>,
    default: f32,
}

#[derive(Debug, Serialize)]
struct ChoiceRow {
    key: &'static str,
    options: &'static [&'static str],
}

/// The parts of a command line that renders what is seen. Behind `render` comes the target, then `options`, then the
/// weighting; every part is text for a shell already ([`viewfuse_job::shell::quoted`]), and nothing is replaced in it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Commands {
    /// The command and the scene; none is shown if this is empty.
    pub render: String,
    /// All other options, with a blank before each.
    pub options: String,
    /// The weighting that the page begins with. Every other one is a word as it is.
    pub first_weights: String,
}

impl Subject {
    /// `full` is a camera of the size of full pictures.
    pub(crate) fn of(viewed: &Viewed<'_>, full: &Camera, about: &About, device: String, commands: Commands) -> Subject {
        let Viewed { scene, sources, weighting, chooses, .. } = *viewed;
        let cameras: Vec<Camera> = sources.iter().map(|&view| scene.views[view].camera).collect();
        let rig = Rig::of(&cameras);
        let size = [full.pinhole.width(), full.pinhole.height()];
        let others = (0..scene.views.len()).filter(|view| !sources.contains(view));
        Subject {
            name: scene.name(),
            field: about.name,
            is_weighted: !about.is_live,
            device,
            size,
            moving_side: Pace::of(about.is_live, size[0].max(size[1])).largest,
            lens: Intrinsics::of(full),
            start: start(&cameras, &rig).to_opencv(),
            focus: rig.focus.to_array(),
            up: rig.up.to_array(),
            distance: rig.distance,
            origin: scene.frame.origin.to_array(),
            scale: scene.frame.scale,
            ring: ring(&cameras),
            sources: sources.iter().map(|&view| CameraRow::of(scene, view)).collect(),
            others: others.map(|view| CameraRow::of(scene, view)).collect(),
            schemes: scheme_rows(),
            scheme: weighting.to_string(),
            chooses,
            commands,
            video: Videos::of_machine(),
        }
    }
}

impl CameraRow {
    fn of(scene: &Scene, index: usize) -> CameraRow {
        let view = &scene.views[index];
        CameraRow {
            name: view.name.clone(),
            word: quoted(item_of(scene, index)),
            pose: view.camera.pose.to_opencv(),
            lens: Intrinsics::of(&view.camera),
        }
    }
}

impl Intrinsics {
    fn of(camera: &Camera) -> Intrinsics {
        let pinhole = &camera.pinhole;
        Intrinsics { focal: pinhole.focal(), principal: pinhole.principal(), size: [pinhole.width(), pinhole.height()] }
    }
}

/// The first pose: half-way between the camera nearest to the middle of all and its nearest neighbour, so that it is a
/// novel view. The first camera's own pose if there is no such pose.
fn start(cameras: &[Camera], rig: &Rig) -> Pose {
    let Some(first) = cameras.first() else { return Pose::IDENTITY };
    let centre = |camera: &Camera| camera.pose.centre_world();
    let middle = cameras.iter().map(centre).sum::<Vec3>() / cameras.len() as f32;
    let nearest = |point: Vec3, excluded: Option<usize>| {
        let others = (0..cameras.len()).filter(|other| Some(*other) != excluded);
        others.min_by(|a, b| centre(&cameras[*a]).distance(point).total_cmp(&centre(&cameras[*b]).distance(point)))
    };
    let pair = nearest(middle, None)
        .and_then(|nearest_view| Some([nearest_view, nearest(centre(&cameras[nearest_view]), Some(nearest_view))?]));
    let Some(pair) = pair.map(|pair| pair.map(|view| &cameras[view])) else { return first.pose };
    let place = 0.5 * (centre(pair[0]) + centre(pair[1]));
    let ahead = pair[0].pose.forward_world() + pair[1].pose.forward_world();
    Pose::look_at(place, place + ahead, rig.up).unwrap_or(pair[0].pose)
}

/// The formulas, and attention that needs no file.
fn scheme_rows() -> Vec<SchemeRow> {
    let formulas = ROWS.iter().map(|row| SchemeRow {
        name: row.name,
        parameter: row.parameter.map(|parameter| ParameterRow {
            key: parameter.key,
            least: parameter.least,
            most: (parameter.most < MAX_LIMIT).then_some(parameter.most),
            default: parameter.default,
        }),
        choice: row.choice.map(|choice| ChoiceRow { key: choice.key, options: choice.options }),
    });
    let is_formula = |name: &&str| ROWS.iter().any(|row| row.tables.contains(name));
    let others = scheme_names().into_iter().filter(|name| !is_formula(name));
    formulas.chain(others.map(|name| SchemeRow { name, parameter: None, choice: None })).collect()
}

#[cfg(test)]
mod tests {
    use super::{quoted, scheme_rows, start};
    use viewfuse_core::Vec3;
    use viewfuse_core::camera::{Camera, Pinhole};
    use viewfuse_core::pose::Pose;
    use viewfuse_scene::rig::Rig;
    use viewfuse_weighting::Weighting;

    #[test]
    fn every_scheme_of_the_menu_can_be_opened() {
        let rows = scheme_rows();
        assert!(rows.len() >= 8 && rows.iter().any(|row| row.name == "cross-attention"));
        for row in rows {
            let parameter = row.parameter.iter().map(|parameter| format!("{}={}", parameter.key, parameter.default));
            let choices = row
                .choice
                .iter()
                .flat_map(|choice| choice.options.iter().map(move |is| format!("{}={is}", choice.key)));
            for pair in parameter.chain(choices) {
                assert_eq!(quoted(&pair), pair, "the page puts it on a command line as it is");
                Weighting::open(&format!("{}:{pair}", row.name)).expect("a scheme");
            }
            Weighting::open(row.name).expect("a scheme");
        }
    }

    #[test]
    fn the_first_pose_is_between_two_cameras() {
        let pinhole = Pinhole::new([50.0; 2], [32.0, 24.0], 64, 48).expect("a pinhole");
        let camera = |x: f32| {
            let pose = Pose::look_at(Vec3::new(x, 0.0, -4.0), Vec3::ZERO, Vec3::NEG_Y).expect("a pose");
            Camera { pose, pinhole }
        };
        let cameras = [-2.0, -1.0, 0.25, 1.0].map(camera);
        let pose = start(&cameras, &Rig::of(&cameras));
        // The middle is at -0.4375; the camera nearest to it is at -1, and the one nearest to that at -2.
        assert_eq!(pose.centre_world(), Vec3::new(-1.5, 0.0, -4.0));
        assert!(pose.forward_world().dot(Vec3::Z) > 0.9 && pose.down_world().y > 0.99);
        assert_eq!(start(&cameras[..1], &Rig::of(&cameras[..1])), cameras[0].pose);
    }
}
