//! Surface points of a scene whose files do not tell its depths: a coarse sweep of some sources, checked between them.

use super::kept::Kept;
use super::matching::{Images, Matching, Range, swept};
use super::scratch::Scratch;
use crate::FieldError;
use crate::training_free::space::{Space, first_guess};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImage;
use viewfuse_scene::rig::spread;

/// Longest side of the photographs, in pixels (`host/results/front_to_back.md`, "The search for depths").
pub(super) const SIDE: u32 = 96;
/// Planes of a frustum.
const PLANE_COUNT: u32 = 128;
/// Most sources that are swept, as far apart as possible: the run time does not grow with further ones.
const MAX_SWEPT: usize = 12;
/// Neighbours that each is compared with (the same page).
const NEIGHBOURS: usize = 4;
/// Most points: a pixel of a source that is swept has one.
const MAX_POINTS: usize = MAX_SWEPT * (SIDE * SIDE) as usize;
/// Confidence from which on a pixel counts.
const MIN_CONFIDENCE: f32 = 0.6;
/// Most planes between the disparities of two views at the same point.
const MAX_DIFFERENCE: f32 = 1.5;

impl<D: Device> Matching<'_, D> {
    /// As [`Matching::find_space`], from its points if they were kept.
    pub(super) fn kept_space(
        &self,
        images: &[SourceImage],
        kept: Option<&Kept>,
        progress: &dyn Progress,
    ) -> Result<Space, FieldError> {
        let cameras: Vec<Camera> = images.iter().map(|image| image.camera).collect();
        let key = kept.map(|kept| kept.of_scene(images));
        let points = |(kept, key): (&Kept, &_)| kept.read::<[f32; 3]>(key, 1..=MAX_POINTS, progress);
        if let Some(points) = kept.zip(key.as_ref()).and_then(points) {
            return Ok(Space::of_points(points.into_iter().map(Vec3::from).collect(), &cameras));
        }
        let space = self.find_space(images, progress)?;
        if let Some((kept, key)) = kept.zip(key) {
            let points: Vec<[f32; 3]> = space.surfaces().points.iter().map(Vec3::to_array).collect();
            kept.write(&key, &points, progress);
        }
        Ok(space)
    }

    /// The depths of a scene, from all its sources at a longest side of [`SIDE`].
    pub(super) fn find_space(&self, images: &[SourceImage], progress: &dyn Progress) -> Result<Space, FieldError> {
        let device = self.device;
        let small = Images::upload(device, images)?;
        let cameras: Vec<Camera> = images.iter().map(|image| image.camera).collect();
        let centres: Vec<Vec3> = cameras.iter().map(|camera| camera.pose.centre_world()).collect();
        let range = Range::new(first_guess(&cameras), PLANE_COUNT);
        let mut maps = device.zeros(images.iter().map(|image| image.texels.len()).sum())?;
        let chosen = spread(&centres, MAX_SWEPT);
        let mut scratch = Scratch::default();
        for &view in &chosen {
            progress.check()?;
            let mut near: Vec<(usize, f32)> = (0..cameras.len())
                .filter(|other| *other != view)
                .map(|other| (other, centres[view].distance(centres[other])))
                .collect();
            near.sort_by(|a, b| a.1.total_cmp(&b.1));
            near.truncate(NEIGHBOURS);
            let mut weights: Vec<(usize, f32)> =
                near.iter().map(|(other, gap)| (*other, 1.0 / (gap * gap + 1.0e-12))).collect();
            let sum: f32 = weights.iter().map(|(_, weight)| weight).sum();
            weights.iter_mut().for_each(|(_, weight)| *weight /= sum);
            weights.push((view, 1.0));
            let swept = swept(&small.cameras, &small.cameras, &weights, None, None);
            let frustum = self.frustum(small.cameras[view], range, &swept);
            let means = self.compared_means(&frustum, &swept, &small.texels, &maps, &mut scratch, progress)?;
            let costs = self.costs(frustum, &means, &[], &maps, &mut scratch)?;
            device.pick_disparity(&frustum, &costs, &mut maps)?;
        }
        let maps = device.download(&maps)?;
        let swept: Vec<CameraBlock> = chosen.iter().map(|&view| small.cameras[view]).collect();
        Ok(Space::of_points(consistent_points(&swept, &maps, range.step), &cameras))
    }
}

/// Points of confident pixels whose disparity another view's map confirms.
fn consistent_points(cameras: &[CameraBlock], maps: &[[f32; 2]], step: f32) -> Vec<Vec3> {
    let mut points = Vec::new();
    for (view, camera) in cameras.iter().enumerate() {
        for row in 2..camera.height.saturating_sub(2) {
            for column in 2..camera.width.saturating_sub(2) {
                let [disparity, confidence] = maps[(camera.first_texel + row * camera.width + column) as usize];
                if confidence < MIN_CONFIDENCE || disparity < 0.5 * step {
                    continue;
                }
                let towards = camera.towards(column as f32 + 0.5, row as f32 + 0.5);
                let point = camera.centre_world() + towards / disparity;
                let confirms = |other: &CameraBlock| {
                    let seen = other.project(point);
                    let difference = || (maps[other.texel_at(seen.x, seen.y)][0] - 1.0 / seen.depth).abs();
                    seen.in_image && difference() < MAX_DIFFERENCE * step
                };
                if cameras.iter().enumerate().any(|(other, camera)| other != view && confirms(camera)) {
                    points.push(point);
                }
            }
        }
    }
    points
}
