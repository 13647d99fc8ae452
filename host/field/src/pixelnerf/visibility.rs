//! Which views see a point. Behind its camera a view's weight is 0: nothing of the view is looked up or computed there.
//!
//! Points are evaluated in groups that the same views see, each with these views alone and their weights at its points.
//! Rows of the network do not depend on one another and sums over views run in the same order, so outputs have the same
//! bits.

use super::network::{Network, Views, Workspace};
use std::collections::BTreeMap;
use std::mem::replace;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::{CastBlock, RayPoint, cast_ray};
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::pixelnerf::{is_in_front, visible_weight};

/// Cameras and weights of a target's views.
pub(super) struct Visibility {
    pub(super) cameras: Vec<CameraBlock>,
    pub(super) weights: Vec<f32>,
}

/// Points that the same views are in front of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    /// Views whose weight is not 0.
    pub(super) views: Vec<usize>,
    /// Their weights there.
    pub(super) weights: Vec<f32>,
    /// Indices of the points.
    pub(super) points: Vec<usize>,
}

impl Visibility {
    /// Whether a view has weight 0 somewhere on a target's rays: everywhere, or because an end of a ray is behind it.
    pub(super) fn is_partial(&self, cast: &CastBlock) -> bool {
        if self.weights.contains(&0.0) {
            return true;
        }
        let in_front = |point: &Vec3| self.cameras.iter().all(|camera| is_in_front(camera, *point));
        // Where the frustum around the rays is in front of all views, no ray has to be looked at.
        if frustum(cast).iter().all(in_front) {
            return false;
        }
        let width = cast.camera.width;
        let is_behind = |row: usize| {
            let mut pixels = row as u32 * width..(row as u32 + 1) * width;
            pixels.any(|pixel| {
                let ray = cast_ray(cast, pixel);
                let (origin, direction) = (Vec3::from_array(ray.origin), Vec3::from_array(ray.direction));
                [ray.near, ray.far].iter().any(|depth| !in_front(&(origin + direction * *depth)))
            })
        };
        map(cast.camera.height as usize, 64, is_behind).contains(&true)
    }

    /// Points by the views in front of which they are.
    pub(super) fn groups(&self, points: &[RayPoint]) -> Vec<Group> {
        let mut groups: BTreeMap<Vec<bool>, Vec<usize>> = BTreeMap::new();
        let mut front = vec![false; self.cameras.len()];
        for (index, point) in points.iter().enumerate() {
            let position = Vec3::from_array(point.position);
            front.iter_mut().zip(&self.cameras).for_each(|(front, camera)| *front = is_in_front(camera, position));
            if let Some(group) = groups.get_mut(&front) {
                group.push(index);
            } else {
                groups.insert(front.clone(), vec![index]);
            }
        }
        groups.into_values().map(|indices| self.group(points, indices)).collect()
    }

    fn group(&self, points: &[RayPoint], indices: Vec<usize>) -> Group {
        let (cameras, weights, count) = (&self.cameras[..], &self.weights[..], self.cameras.len() as u32);
        let point = indices.first().map(|index| points[*index]).unwrap_or_default();
        let weight = |view| visible_weight(cameras, weights, count, &point, view as u32);
        let (mut views, mut shares): (Vec<usize>, Vec<f32>) =
            (0..self.cameras.len()).map(|view| (view, weight(view))).filter(|(_, weight)| *weight != 0.0).unzip();
        if views.is_empty() {
            // All weights are 0.
            (views, shares) = ((0..self.cameras.len()).collect(), self.weights.clone());
        }
        Group { views, weights: shares, points: indices }
    }
}

/// Corners of the frustum that holds all rays between their bounds.
fn frustum(cast: &CastBlock) -> [Vec3; 8] {
    let camera = &cast.camera;
    let (width, height) = (camera.width as f32, camera.height as f32);
    let towards = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)].map(|(x, y)| camera.towards(x, y));
    // Bounds are along rays, whose depths along the principal axis are smaller.
    let longest = towards.iter().map(|towards| towards.length()).fold(1.0, f32::max);
    let depths = [cast.near / longest, cast.far];
    std::array::from_fn(|corner| camera.centre_world() + towards[corner % 4] * depths[corner / 4])
}

impl<D: Device> Network<'_, D> {
    /// As [`Network::evaluate`], without views at points where their weight is 0. Returns how many views of points were
    /// left out.
    pub(super) fn evaluate_visible(
        &self,
        workspace: &mut Workspace<D>,
        views: &Views<'_, D>,
        point_count: u32,
    ) -> Result<u64, DeviceError> {
        let Some(visibility) = &views.visibility else {
            self.evaluate(workspace, views, point_count)?;
            return Ok(0);
        };
        let points = self.device.download(&workspace.points)?;
        let groups = visibility.groups(&points[..point_count as usize]);
        if let [Group { views: seeing, .. }] = &groups[..]
            && seeing.len() == views.latents.len()
        {
            self.evaluate(workspace, views, point_count)?;
            return Ok(0);
        }
        let mut raw = vec![0.0; workspace.point_count as usize * 4];
        let mut left_out = 0;
        for Group { views: seeing, weights, points: indices } in groups {
            let cameras: Vec<CameraBlock> = seeing.iter().map(|view| visibility.cameras[*view]).collect();
            let seeing_views = Views {
                cameras: self.device.upload(&cameras)?,
                weights: self.device.upload(&weights)?,
                latents: seeing.iter().map(|view| views.latents[*view]).collect(),
                visibility: None,
            };
            let some: Vec<RayPoint> = indices.iter().map(|index| points[*index]).collect();
            let all = replace(&mut workspace.points, self.device.upload(&some)?);
            let evaluated = self.evaluate(workspace, &seeing_views, some.len() as u32);
            workspace.points = all;
            evaluated?;
            left_out += ((views.latents.len() - seeing.len()) * some.len()) as u64;
            let outputs = self.device.download(&workspace.raw)?;
            for (index, output) in indices.iter().zip(outputs.as_chunks::<4>().0) {
                raw[4 * index..4 * index + 4].copy_from_slice(output);
            }
        }
        workspace.raw = self.device.upload(&raw)?;
        Ok(left_out)
    }
}
