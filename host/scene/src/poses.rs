//! What is wrong with a scene's poses as a whole.

use crate::rig::Rig;
use crate::{Scene, View};
use std::collections::HashSet;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_job::medians::upper_median;

/// Cameras nearer to one another than this share of their distance from what they look at show no depth: half a pixel
/// at a focal length of 500. Nor is that more than this share of their median distance from their middle: where axes
/// are nearly parallel, what they look at may seem to be anywhere, and a single wrong pose moves a mean.
const MIN_BASELINE: f32 = 1.0e-3;
/// Least cosine of the angle between the axes of two cameras with the same pose: of 0.6 degrees.
const MIN_COSINE: f32 = 0.999_95;

/// Tangent of half of the greatest angle of a photograph's width that is no fault: 75 degrees. What lenses see beyond, a
/// pinhole's picture does not show.
const MAX_HALF_ANGLE_TANGENT: f32 = 3.732;

/// Most by which the principal point of most photographs is off their middle, as a share of a side. That of photographs
/// half as large lies at a corner.
const MAX_OFF_MIDDLE: f32 = 0.2;

/// Which views of a scene have the same pose.
pub struct SamePoses<'a> {
    views: &'a [View],
    firsts: Vec<usize>,
}

impl SamePoses<'_> {
    /// Those of some views, in their order, that can be sources of these targets: photographs, one of each pose, and
    /// none of a target's own pose if that has a photograph, of which they would be another one.
    pub fn sources(&self, of: impl IntoIterator<Item = usize>, targets: &[usize]) -> Vec<usize> {
        let has_photograph = |view: &usize| self.views[*view].image.is_some();
        let scored = targets.iter().filter(|view| has_photograph(view));
        let mut poses: HashSet<usize> = scored.map(|view| self.firsts[*view]).collect();
        let is_source = |view: &usize| has_photograph(view) && !targets.contains(view);
        of.into_iter().filter(is_source).filter(|view| poses.insert(self.firsts[*view])).collect()
    }

    /// The first of some views that has the pose of another one.
    pub fn with_pose_of(&self, of: &[usize], other: usize) -> Option<usize> {
        of.iter().copied().find(|view| *view != other && self.firsts[*view] == self.firsts[other])
    }
}

impl Scene {
    /// Which of its views have the same pose.
    pub fn same_poses(&self) -> SamePoses<'_> {
        SamePoses { views: &self.views, firsts: firsts(&self.views) }
    }
}

/// The first of these views that has the same pose as each of them: that view itself, if it is the only one. A second
/// photograph of a pose shows nothing new, and next to it no depth is found; of a target it shows what is looked for.
fn firsts(views: &[View]) -> Vec<usize> {
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let centres = || cameras.iter().map(|camera| camera.pose.centre_world());
    let middle = Vec3::from_array([0, 1, 2].map(|axis| median(centres().map(|centre| centre[axis]))));
    let spread = median(centres().map(|centre| centre.distance(middle)));
    let baseline = MIN_BASELINE * Rig::of(&cameras).distance.min(spread);
    let same = |a: &Camera, b: &Camera| {
        let (a, b) = (&a.pose, &b.pose);
        a.centre_world().distance(b.centre_world()) <= baseline
            && a.forward_world().dot(b.forward_world()) >= MIN_COSINE
            && a.down_world().dot(b.down_world()) >= MIN_COSINE
    };
    let mut firsts: Vec<usize> = Vec::with_capacity(cameras.len());
    for (index, camera) in cameras.iter().enumerate() {
        let is_first = |other: &usize| firsts[*other] == *other && same(camera, &cameras[*other]);
        let first = (0..index).find(is_first);
        firsts.push(first.unwrap_or(index));
    }
    firsts
}

/// How far the principal point is from a photograph's middle, as a share of its sides, the larger one.
fn off_middle(pinhole: &Pinhole) -> f32 {
    let sides = [pinhole.width() as f32, pinhole.height() as f32];
    (0..2).map(|axis| (pinhole.principal()[axis] / sides[axis] - 0.5).abs()).fold(0.0, f32::max)
}

/// The upper one of the middle values; 0 of none.
fn median(values: impl Iterator<Item = f32>) -> f32 {
    upper_median(values, f32::total_cmp).unwrap_or(0.0)
}

impl Scene {
    /// Warnings about the poses as a whole, a line each: cameras that look away from everything, views of one pose.
    pub fn pose_warnings(&self) -> Vec<String> {
        warnings(&self.views)
    }
}

fn warnings(views: &[View]) -> Vec<String> {
    let mut warnings = Vec::new();
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let (rig, count) = (Rig::of(&cameras), cameras.len());
    let looks_away = |c: &&Camera| (rig.focus - c.pose.centre_world()).dot(c.pose.forward_world()) < 0.0;
    let away = cameras.iter().filter(looks_away).count();
    if count > 1 && 2 * away > count {
        warnings.push(format!(
            "{away} of {count} cameras look away from the point that their axes come nearest to: the axes look flipped \
             (OpenGL poses read as OpenCV, or the other way round), or the poses inverted"
        ));
    }
    let is_odd = |view: &&View| {
        let pinhole = &view.camera.pinhole;
        view.image.is_some() && pinhole.width() as f32 > 2.0 * MAX_HALF_ANGLE_TANGENT * pinhole.focal()[0]
    };
    if let Some(view) = views.iter().find(is_odd) {
        let (pinhole, odd) = (&view.camera.pinhole, views.iter().filter(is_odd).count());
        let [width, focal] = [pinhole.width() as f32, pinhole.focal()[0]];
        warnings.push(format!(
            "{odd} of {count} photographs would show more than 150 degrees: '{}' has a focal length of {focal} pixels at a \
             width of {width}; the intrinsics may be shares of the width, or millimetres, in place of pixels",
            view.name
        ));
    }
    // Of one photograph it may lie anywhere: it may be a part of a larger one.
    let is_off = |view: &&View| view.image.is_some() && off_middle(&view.camera.pinhole) > MAX_OFF_MIDDLE;
    let is_outside = |view: &&View| view.image.is_some() && off_middle(&view.camera.pinhole) > 0.5;
    let (off, outside) = (views.iter().filter(is_off).count(), views.iter().filter(is_outside).count());
    let photographs = views.iter().filter(|view| view.image.is_some()).count();
    let (told, view) = match outside {
        0 if 2 * off > photographs => (off, views.iter().find(is_off)),
        _ => (outside, views.iter().find(is_outside)),
    };
    if let Some(view) = view {
        let pinhole = &view.camera.pinhole;
        let ([x, y], width, height) = (pinhole.principal(), pinhole.width(), pinhole.height());
        let place = if outside > 0 { "outside of them" } else { "far from their middle" };
        warnings.push(format!(
            "the principal point of {told} of {count} photographs lies {place}: of '{}' at ({x}, {y}), {width} x {height} \
             pixels; the intrinsics may be those of photographs of another size",
            view.name
        ));
    }
    let firsts = firsts(views);
    let mut twins = firsts.iter().enumerate().filter(|(index, first)| index != *first);
    if let Some((second, first)) = twins.next() {
        let more = match twins.count() {
            0 => String::new(),
            more => format!(", and so have {more} more views"),
        };
        warnings.push(format!(
            "views '{}' and '{}' have the same pose{more}: unless sources are listed, one photograph of a pose is a \
             source, and none where another one is a target",
            views[*first].name, views[second].name
        ));
    }
    warnings
}
