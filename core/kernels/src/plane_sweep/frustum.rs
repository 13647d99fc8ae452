//! A camera's frustum with its planes, and the projection of their points into other views.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::math::{max, min};

/// A point is in front of a view where its depth there is at least this share of its depth in the frustum.
pub const MIN_DEPTH: f32 = 1.0e-4;

/// A frustum, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FrustumBlock {
    /// The camera, of the size in which views are compared.
    pub camera: CameraBlock,
    /// Disparity of plane 0, the farthest; at least 0.
    pub far_disparity: f32,
    /// From a plane's disparity to the next one's; above 0.
    pub disparity_step: f32,
    /// Groups of planes, from 1 to [`super::MAX_GROUPS`].
    pub group_count: u32,
    /// Views that are compared, from 1 to [`super::MAX_MATCHED`].
    pub view_count: u32,
    /// Pairs of views that are compared.
    pub pair_count: u32,
    /// 1 if alpha is a silhouette; 0 if it says where a photograph has pixels.
    pub has_silhouettes: u32,
    /// Cost of contradicting the views' own disparities.
    pub dissent_share: f32,
    /// First row of the current band.
    pub first_row: u32,
    /// Rows of the band.
    pub row_count: u32,
}

const _: () = assert!(size_of::<FrustumBlock>() == 116);

impl FrustumBlock {
    /// Disparity of a plane.
    #[inline(always)]
    pub fn disparity(&self, plane: usize) -> f32 {
        self.far_disparity + plane as i32 as f32 * self.disparity_step
    }

    /// The track of a pixel's points in a view: `pixel` is counted row by row in the whole image.
    #[inline(always)]
    pub fn track(&self, view: &CameraBlock, pixel: u32) -> Track {
        let (column, row) = (pixel % self.camera.width, pixel / self.camera.width);
        Track::new(&self.camera, view, column as f32 + 0.5, row as f32 + 0.5)
    }
}

/// A source view in a frustum, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SweptView {
    /// Its camera, with the offset of its texels.
    pub camera: CameraBlock,
    /// Factors on red, green and blue that make exposures equal; the fourth number is unused.
    pub gain: [f32; 4],
    /// The camera weight for this frustum.
    pub weight: f32,
    /// From a disparity of its map to the next plane's; 0 if it has no map yet.
    pub disparity_step: f32,
    /// Offset of its map.
    pub first_disparity: u32,
    /// Columns of its map.
    pub map_width: u32,
    /// Rows of its map.
    pub map_height: u32,
    /// Zeros.
    pub padding: [u32; 3],
}

const _: () = assert!(size_of::<SweptView>() == 128);

impl SweptView {
    /// Where a point of the view's image lies in the view's map of disparities, of the same size as the image.
    #[inline(always)]
    pub fn map_texel(&self, x: f32, y: f32) -> usize {
        let column = min(x, self.camera.width as f32 - 1.0) as usize;
        let row = min(y, self.camera.height as f32 - 1.0) as usize;
        self.first_disparity as usize + row * self.map_width as usize + column
    }
}

/// Where a ray's points lie in a view: a line through its camera coordinates, by disparity.
#[derive(Clone, Copy, Debug)]
pub struct Track {
    /// The point at infinity, and the change for each unit of disparity; both in the view's axes, scaled such that the
    /// depth in the frustum is 1.
    far: Vec3,
    slope: Vec3,
    intrinsics: [f32; 4],
    size: [f32; 2],
}

/// A point's projection into a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Image coordinate to the right, in pixels.
    pub x: f32,
    /// Image coordinate downwards, in pixels.
    pub y: f32,
    /// The point's disparity in the view over its disparity in the frustum.
    pub disparity_ratio: f32,
    /// Whether it is in front of the view and inside its image.
    pub in_image: bool,
}

impl Track {
    /// The ray through the image coordinate `(x, y)` of `camera`, as `view` sees it.
    #[inline(always)]
    pub fn new(camera: &CameraBlock, view: &CameraBlock, x: f32, y: f32) -> Track {
        Track {
            far: view.pose.rotate_to_camera(camera.towards(x, y)),
            slope: view.pose.rotate_to_camera(camera.centre_world() - view.centre_world()),
            intrinsics: view.intrinsics,
            size: [view.width as f32, view.height as f32],
        }
    }

    /// The ray's point of this disparity. For a point behind the view, the coordinates are those of a point just in
    /// front of it.
    #[inline(always)]
    pub fn at(&self, disparity: f32) -> Sight {
        let [focal_x, focal_y, principal_x, principal_y] = self.intrinsics;
        let depth = self.far.z + self.slope.z * disparity;
        let inverse = 1.0 / max(depth, MIN_DEPTH);
        let x = focal_x * ((self.far.x + self.slope.x * disparity) * inverse) + principal_x;
        let y = focal_y * ((self.far.y + self.slope.y * disparity) * inverse) + principal_y;
        // Without branches, so that a loop over planes can become vectors.
        let in_image = (depth > MIN_DEPTH) & (x >= 0.0) & (y >= 0.0) & (x <= self.size[0]) & (y <= self.size[1]);
        Sight { x, y, disparity_ratio: inverse, in_image }
    }
}
