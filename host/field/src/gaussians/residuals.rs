//! What Gaussians leave of the source photographs, carried to a target along their own depths.
//!
//! ```text
//! residual_s(q) = photograph_s(q) - gain_s splats_s(q)
//! added(p)      = share sum_s w_s v_s residual_s(q_s) / (sum_s w_s v_s + LEAST sum_s w_s)
//! v_s           = exp(-((depth_s(q_s) - z_s) / (TOLERANCE z_s))^2)
//! ```
//!
//! `q_s` is where source `s` sees the surface point of the target's pixel `p`, `z_s` its depth there, `w_s` the weight
//! of the source for the target. Gaussians of a few hundred iterations are softer than the photographs; what they lack
//! there is what they lack beside it. Where no source sees the point nothing is added.

use crate::Rendered;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::lookup::bilinear;
use viewfuse_device::parallel::for_each_row;
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// Relative difference of the depths of a point and of the surface that a source sees, at which the source counts by `1
/// / e`.
const TOLERANCE: f32 = 0.03;
/// Share of all weights from which on sources that see a point count nearly in full: residuals that few sources tell
/// are less sure.
const LEAST: f32 = 0.2;
/// Fewest values of a picture that are work for a thread.
const MIN_PIXELS: usize = 256;

/// The residuals of sources, each made when it is first needed.
#[derive(Clone, Debug)]
pub struct Residuals {
    views: Vec<Option<View>>,
    /// How much of them is added.
    share: f32,
}

/// What the Gaussians leave of a source, as far as it is added.
#[derive(Clone, Debug)]
struct View {
    camera: CameraBlock,
    /// `[row][column]`: red, green, blue.
    residual: Vec<[f32; 3]>,
    /// `[row][column]`: along the principal axis, world units; 0 where the Gaussians have no surface.
    depths: Vec<f32>,
}

impl Residuals {
    /// Those of so many sources, of which this share is added.
    pub fn new(count: usize, share: f32) -> Residuals {
        Residuals { views: vec![None; count], share }
    }

    /// Whether that of a source is not there yet.
    pub fn is_missing(&self, view: usize) -> bool {
        self.views.get(view).is_some_and(Option::is_none)
    }

    /// Makes that of a source from the Gaussians' picture of it: `gain` is how much brighter the source is than they
    /// are.
    pub fn add_source(&mut self, view: usize, picture: Rendered, images: &SourceImages, gain: [f32; 3]) {
        let (Some(place), Some(image)) = (self.views.get_mut(view), images.images.get(view)) else { return };
        let residual = residual(&picture.colours, image, images, gain);
        *place = Some(View { camera: image.camera.block(0), residual, depths: picture.depths });
    }

    /// Adds what these sources, by their weights, show and the Gaussians do not; `picture` is theirs from the camera.
    pub fn add(&self, camera: &CameraBlock, weights: &[(usize, f32)], picture: &mut Rendered) {
        let found = |(view, weight): &(usize, f32)| Some((self.views.get(*view)?.as_ref()?, *weight));
        let views: Vec<(&View, f32)> = weights.iter().filter_map(found).collect();
        let least = LEAST * views.iter().map(|(_, weight)| weight).sum::<f32>();
        let (width, depths) = (picture.width as usize, &picture.depths);
        for_each_row(&mut picture.colours, width, MIN_PIXELS, |row, colours| {
            for (column, colour) in colours.iter_mut().enumerate() {
                let depth = depths[row * width + column];
                if depth > 0.0 {
                    let towards = camera.towards(column as f32 + 0.5, row as f32 + 0.5);
                    let added = at(&views, least, camera.centre_world() + towards * depth);
                    let add =
                        |(colour, added): (&mut f32, f32)| *colour = (*colour + self.share * added).clamp(0.0, 1.0);
                    colour.iter_mut().zip(added).for_each(add);
                }
            }
        });
    }
}

/// The residual of a source over the background; 0 where its lens saw nothing.
fn residual(colours: &[[f32; 4]], image: &SourceImage, images: &SourceImages, gain: [f32; 3]) -> Vec<[f32; 3]> {
    let behind = images.background;
    let left = |(colour, texel): (&[f32; 4], &[f32; 4])| {
        [0, 1, 2].map(|channel| match images.has_silhouettes {
            true => texel[channel] + (1.0 - texel[3]) * behind[channel] - gain[channel] * colour[channel],
            false if texel[3] < 0.999 => 0.0,
            false => texel[channel] - gain[channel] * colour[channel],
        })
    };
    colours.iter().zip(&image.texels).map(left).collect()
}

/// What is added at a point; the sum is in the order of the views. Nothing where no view sees it.
fn at(views: &[(&View, f32)], least: f32, point: Vec3) -> [f32; 3] {
    let (mut sums, mut sum) = ([0.0; 3], 0.0);
    for (View { camera, residual, depths }, weight) in views {
        let seen = camera.project(point);
        let depth = if seen.in_image { depths[camera.texel_at(seen.x, seen.y)] } else { 0.0 };
        if depth > 0.0 {
            let apart = (depth - seen.depth) / (TOLERANCE * seen.depth);
            let weight = weight * (-apart * apart).exp();
            let residual = bilinear(&residual[..], camera.width, camera.height, seen.x, seen.y);
            (0..3).for_each(|channel| sums[channel] += weight * residual[channel]);
            sum += weight;
        }
    }
    // Without any weight at all both are 0.
    sums.map(|value| value / (sum + least).max(f32::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::camera::{Camera, Pinhole};
    use viewfuse_core::pose::Pose;

    fn camera() -> CameraBlock {
        let pose = Pose::look_at(Vec3::new(0.0, 0.0, -2.0), Vec3::ZERO, Vec3::Y).expect("a pose");
        let pinhole = Pinhole::new([8.0; 2], [4.0, 3.0], 8, 6).expect("a pinhole");
        Camera { pose, pinhole }.block(0)
    }

    /// A picture that is grey everywhere, of a surface at this depth.
    fn grey(depth: f32) -> Rendered {
        let (width, height) = (8, 6);
        Rendered { colours: vec![[0.5; 4]; 48], depths: vec![depth; 48], confidences: vec![1.0; 48], width, height }
    }

    fn added(depth: f32, sources: &[(f32, f32)]) -> [f32; 4] {
        let view = |(depth, _): &(f32, f32)| View {
            camera: camera(),
            residual: vec![[0.2, -0.9, 0.0]; 48],
            depths: vec![*depth; 48],
        };
        let residuals = Residuals { views: sources.iter().map(|source| Some(view(source))).collect(), share: 1.0 };
        let weights: Vec<(usize, f32)> = sources.iter().map(|(_, weight)| *weight).enumerate().collect();
        let mut picture = grey(depth);
        residuals.add(&camera(), &weights, &mut picture);
        assert!(picture.colours.iter().all(|colour| colour == &picture.colours[0]));
        picture.colours[0]
    }

    #[test]
    fn what_a_source_sees_is_added_and_nothing_else() {
        let [red, green, blue, opacity] = added(2.0, &[(2.0, 1.0)]);
        assert!((red - (0.5 + 0.2 / (1.0 + LEAST))).abs() < 1.0e-6, "{red}");
        assert_eq!((green, blue, opacity), (0.0, 0.5, 0.5), "colours end at 0");
        assert_eq!(added(0.0, &[(2.0, 1.0)]), [0.5; 4], "no surface");
        assert_eq!(added(2.0, &[(0.0, 1.0)]), [0.5; 4], "none in the source");
        let hidden = added(2.0, &[(1.5, 1.0)]);
        assert!((hidden[0] - 0.5).abs() < 1.0e-6, "the source sees something nearer: {hidden:?}");
        // Half of the weight sees it.
        let half = added(2.0, &[(2.0, 0.5), (1.0, 0.5)]);
        assert!((half[0] - (0.5 + 0.2 * 0.5 / (0.5 + LEAST))).abs() < 1.0e-6, "{half:?}");
        assert_eq!(added(2.0, &[(2.0, 0.0)]), [0.5; 4], "no weight at all");
    }
}
