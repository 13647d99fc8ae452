//! What the photographs show of the space around them: where a camera may go, and how much of its picture was seen.
//!
//! A point was seen from a camera if a photograph shows it from nearly the same side: the point is inside that
//! photograph, in front of it, and the directions from the point to the two cameras differ by at most
//! [`REACH_DEGREES`]. What stands between a point and a photograph is not asked for: it is a measure of cameras alone,
//! known before anything is rendered.

use crate::rig::{MAX_GAP_DEGREES, Rig};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock};

/// How far a camera may be from a photograph's, seen from a point, to show that point as the photograph does: twice the
/// angle between neighbours at which depths are found reliably.
pub const REACH_DEGREES: f32 = 2.0 * MAX_GAP_DEGREES;
/// A picture of which less was seen leaves what the photographs show.
pub const MIN_SEEN: f32 = 0.5;
/// Rays of a picture that are looked at, along its longer side.
const RAYS: u32 = 16;
/// Ranges of names that a warning has at most.
const MAX_RANGES: usize = 3;

/// What the photographs of some views show.
#[derive(Clone, Debug)]
pub struct Coverage {
    sources: Vec<CameraBlock>,
    rig: Rig,
}

impl Coverage {
    /// Of the cameras of photographs, at least one.
    pub fn of(cameras: &[Camera]) -> Coverage {
        Coverage { sources: cameras.iter().map(|camera| camera.block(0)).collect(), rig: Rig::of(cameras) }
    }

    /// The share of a camera's picture that was seen, in `[0, 1]`. Its points are taken where its rays come nearest to
    /// what the photographs look at; where they lead away from that, as far away as that is from the photographs.
    pub fn seen(&self, camera: &Camera) -> f32 {
        self.share(camera, |x, y| Some(self.looked_at(camera, x, y))).unwrap_or(0.0)
    }

    /// The point of a ray that is nearest to what the photographs look at.
    fn looked_at(&self, camera: &Camera, x: f32, y: f32) -> Vec3 {
        let ray = camera.ray(x, y);
        let along = (self.rig.focus - ray.origin_world).dot(ray.direction_world);
        ray.at(if along > 0.0 { along } else { self.rig.distance })
    }

    /// As [`Coverage::seen`], with the points of a depth map of this width and height (row-major, along the principal
    /// axis; 0: no surface, which does not count, or with `counts_gaps` counts as in [`Coverage::seen`]). `None` if
    /// nothing counts, or if it has another length.
    pub fn seen_surfaces(
        &self,
        camera: &Camera,
        [width, height]: [u32; 2],
        depths: &[f32],
        counts_gaps: bool,
    ) -> Option<f32> {
        let pinhole = camera.pinhole.resized(width, height).ok()?;
        let camera = Camera { pinhole, ..*camera };
        let point = |x: f32, y: f32| {
            let depth = *depths.get(y as usize * width as usize + x as usize)?;
            let ray = camera.ray(x, y);
            let slope = ray.direction_world.dot(camera.pose.forward_world());
            match depth > 0.0 && slope > 0.0 {
                true => Some(ray.at(depth / slope)),
                false => counts_gaps.then(|| self.looked_at(&camera, x, y)),
            }
        };
        self.share(&camera, point).filter(|_| depths.len() == width as usize * height as usize)
    }

    /// [`Coverage::seen_surfaces`] where a depth map has surfaces, otherwise [`Coverage::seen`].
    pub fn seen_in(&self, camera: &Camera, size: [u32; 2], depths: &[f32], counts_gaps: bool) -> f32 {
        self.seen_surfaces(camera, size, depths, counts_gaps).unwrap_or_else(|| self.seen(camera))
    }

    /// A line about pictures that leave what the photographs show, if there are any: how many of all, and their names.
    pub fn warning<'a>(&self, pictures: impl IntoIterator<Item = (&'a str, &'a Camera)>) -> Option<String> {
        let shares: Vec<(&str, f32)> = pictures.into_iter().map(|(name, camera)| (name, self.seen(camera))).collect();
        let leaves = |(_, seen): &(&str, f32)| *seen < MIN_SEEN;
        let count = shares.iter().filter(|share| leaves(share)).count();
        let (worst, least) = shares.iter().min_by(|a, b| a.1.total_cmp(&b.1)).filter(|share| leaves(share))?;
        let mut ranges: Vec<String> = Vec::new();
        for run in shares.chunk_by(|a, b| leaves(a) == leaves(b)).filter(|run| run.iter().all(leaves)) {
            ranges.push(match run {
                [(first, _), .., (last, _)] => format!("{first} to {last}"),
                run => run.iter().map(|(name, _)| *name).collect(),
            });
        }
        let more = if ranges.len() > MAX_RANGES { " and others" } else { "" };
        ranges.truncate(MAX_RANGES);
        Some(format!(
            "{count} of {} pictures leave what was photographed: {}{more}; of {worst}, {:.0} % is in a photograph \
             taken from within {REACH_DEGREES:.0} degrees",
            shares.len(),
            ranges.join(", "),
            100.0 * least
        ))
    }

    /// The share of points that were seen; `None` if there are none.
    fn share(&self, camera: &Camera, point: impl Fn(f32, f32) -> Option<Vec3>) -> Option<f32> {
        let (width, height) = (camera.pinhole.width() as f32, camera.pinhole.height() as f32);
        let step = width.max(height) / RAYS as f32;
        let [columns, rows] = [width, height].map(|side| (side / step).ceil().max(1.0) as u32);
        let (mut seen, mut count) = (0_u32, 0_u32);
        for row in 0..rows {
            for column in 0..columns {
                let at = |index: u32, of: u32, side: f32| (index as f32 + 0.5) * side / of as f32;
                if let Some(point) = point(at(column, columns, width), at(row, rows, height)) {
                    count += 1;
                    seen += u32::from(self.was_seen(point, camera.pose.centre_world()));
                }
            }
        }
        (count > 0).then(|| seen as f32 / count as f32)
    }

    /// Whether a photograph shows the point from nearly the side of `centre`.
    fn was_seen(&self, point: Vec3, centre: Vec3) -> bool {
        let least = REACH_DEGREES.to_radians().cos();
        let Some(direction) = (centre - point).try_normalize() else { return false };
        self.sources.iter().any(|source| {
            let towards = (source.centre_world() - point).normalize_or_zero();
            towards.dot(direction) >= least && source.project(point).in_image
        })
    }
}
