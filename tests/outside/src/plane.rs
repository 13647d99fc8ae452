//! A field: everything lies on a plane before the target.

use viewfuse::core::camera::{Camera, CameraBlock};
use viewfuse::core::fuse::FuseBlock;
use viewfuse::device::{Device, DeviceError};
use viewfuse::field::{About, Field, FieldError, Prepared, Rendered, Request};
use viewfuse::job::progress::Progress;
use viewfuse::scene::photographs::{SourceImage, SourceImages};

/// Channels of a texel: red, green, blue times opacity, and opacity.
const CHANNELS: usize = 4;

/// Everything lies at this depth along the target's principal axis: each pixel is the weighted sum of what the sources
/// show there.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// World units.
    pub depth: f32,
}

/// Photographs in memory. Nothing else is ever known of a view.
struct Photographs<'a, D> {
    plane: &'a Plane,
    device: &'a D,
    images: Vec<SourceImage>,
    background: [f32; 3],
}

impl Field for Plane {
    fn about(&self) -> About {
        About::new("plane")
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        _progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        let SourceImages { images, background, .. } = sources;
        Ok(Box::new(Photographs { plane: self, device, images: images.clone(), background: *background }))
    }
}

impl<'a, D: Device> Prepared<'a> for Photographs<'a, D> {
    fn encode(&mut self, _view: usize, _progress: &dyn Progress) -> Result<(), FieldError> {
        Ok(())
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        progress.check()?;
        let camera = request.camera;
        let (width, height) = (camera.pinhole.width(), camera.pinhole.height());
        let shown = request.views.iter().flat_map(|view| self.shown(&self.images[*view], camera)).collect::<Vec<f32>>();
        let fused = self.fused(&request.view_weights(), &shown)?;
        let colour = |texel: &[f32]| {
            let [red, green, blue] = [0, 1, 2].map(|c| texel[c] + (1.0 - texel[3]) * self.background[c]);
            [red, green, blue, texel[3]]
        };
        let colours: Vec<[f32; 4]> = fused.chunks_exact(CHANNELS).map(colour).collect();
        let depths = colours.iter().map(|colour| if colour[3] > 0.0 { self.plane.depth } else { 0.0 }).collect();
        Ok(Rendered { colours, depths, confidences: Vec::new(), width, height })
    }
}

impl<D: Device> Photographs<'_, D> {
    /// What a source shows of the plane, `[pixel][channel]`: the texel that a point falls into, nothing outside of the
    /// image.
    fn shown(&self, image: &SourceImage, target: &Camera) -> Vec<f32> {
        let source: CameraBlock = image.camera.block(0);
        let texel = |row: u32, column: u32| {
            let ray = target.ray(column as f32 + 0.5, row as f32 + 0.5);
            let along_axis = ray.direction_world.dot(target.pose.forward_world());
            let seen = source.project(ray.origin_world + ray.direction_world * (self.plane.depth / along_axis));
            let is_inside = seen.in_front
                && (0.0..source.width as f32).contains(&seen.x)
                && (0.0..source.height as f32).contains(&seen.y);
            match is_inside {
                true => image.texels[seen.y as usize * source.width as usize + seen.x as usize],
                false => [0.0; CHANNELS],
            }
        };
        let (width, height) = (target.pinhole.width(), target.pinhole.height());
        (0..height).flat_map(|row| (0..width).flat_map(move |column| texel(row, column))).collect()
    }

    /// The weighted sum over views of `shown[view][pixel][channel]`, by the device's kernel.
    fn fused(&self, weights: &[f32], shown: &[f32]) -> Result<Vec<f32>, DeviceError> {
        let (view_count, element_count) = (weights.len(), shown.len() / weights.len().max(1));
        let block = FuseBlock {
            view_count: view_count as u32,
            stride: element_count as u32,
            channel_count: CHANNELS as u32,
            weight_stride: 0,
        };
        let (weights, shown) = (self.device.upload(weights)?, self.device.upload(shown)?);
        let mut fused = self.device.zeros(element_count)?;
        self.device.fuse_views(&block, element_count as u32, &weights, &shown, &mut fused)?;
        self.device.download(&fused)
    }
}
