//! Which photographs of a scene are a set.

use viewfuse_core::pose::Pose;
use viewfuse_scene::Scene;
use viewfuse_scene::rig::Rig;

/// Aimed angle between neighbours, degrees.
const APART: f32 = 12.0;

/// What an angle to the first photograph counts beside a difference from [`APART`]: sets stay together.
const TOGETHER: f32 = 0.15;

/// A set of a scene.
#[derive(Debug)]
pub(super) struct Set {
    /// Photographs.
    pub(super) count: usize,
    /// Seed, and with it the first photograph.
    pub(super) seed: u64,
    /// What is said of the focal length.
    pub(super) focal: Focal,
}

/// What is said of a focal length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Focal {
    /// It is given.
    Known,
    /// Nothing, and what the files state is taken out.
    Unknown,
    /// The files state it as cameras do: EXIF, in whole millimetres of a 35 mm camera.
    Exif,
}

impl Focal {
    pub(super) fn name(self) -> &'static str {
        match self {
            Focal::Known => "known",
            Focal::Unknown => "unknown",
            Focal::Exif => "EXIF",
        }
    }
}

const fn known(count: usize, seed: u64) -> Set {
    Set { count, seed, focal: Focal::Known }
}

const fn unknown(count: usize, seed: u64) -> Set {
    Set { count, seed, focal: Focal::Unknown }
}

const fn exif(count: usize, seed: u64) -> Set {
    Set { count, seed, focal: Focal::Exif }
}

/// The sets of which pictures are rendered.
pub(super) const PICTURE_SETS: [Set; 6] = [exif(3, 1), exif(5, 1), exif(9, 1), exif(15, 1), exif(3, 2), exif(5, 2)];

/// The sets whose poses are refined.
pub(super) const REFINED_SETS: [Set; 3] = [known(3, 1), known(3, 2), known(5, 1)];

/// The sets of every scene.
pub(super) const SETS: [Set; 15] = [
    known(3, 0),
    known(3, 1),
    known(3, 2),
    known(3, 3),
    known(5, 1),
    known(5, 2),
    known(5, 3),
    known(8, 1),
    known(8, 4),
    unknown(3, 0),
    unknown(3, 1),
    unknown(3, 2),
    unknown(5, 1),
    unknown(5, 3),
    unknown(8, 4),
];

/// The photographs of a set, ascending: the first by the seed, then again and again the one whose nearest chosen one is about
/// [`APART`] away.
pub(super) fn neighbours(scene: &Scene, set: &Set) -> Vec<usize> {
    let cameras: Vec<_> = scene.views.iter().filter(|view| view.image.is_some()).map(|view| view.camera).collect();
    let focus = Rig::of(&cameras).focus;
    let direction = |pose: &Pose| (pose.centre_world() - focus).normalize_or_zero();
    let angle = |a: usize, b: usize| {
        let (a, b) = (&cameras[a].pose, &cameras[b].pose);
        let around = direction(a).dot(direction(b)).clamp(-1.0, 1.0).acos();
        around.max(0.5 * a.rotation_angle(b)).to_degrees()
    };
    let start = (5 + 7 * set.seed as usize) % cameras.len();
    let mut chosen = vec![start];
    while chosen.len() < set.count {
        let cost = |view: &usize| {
            let nearest = chosen.iter().map(|own| angle(*view, *own)).fold(f32::INFINITY, f32::min);
            (nearest - APART).abs() + TOGETHER * angle(*view, start)
        };
        let rest = (0..cameras.len()).filter(|view| !chosen.contains(view));
        let Some(next) = rest.min_by(|a, b| cost(a).total_cmp(&cost(b))) else { break };
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen
}
