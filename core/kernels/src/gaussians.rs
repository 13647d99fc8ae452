//! Gaussians of a scene: projected to a camera, composited front to back, and the derivatives by their parameters.
//!
//! A picture is made of tiles of [`SPLAT_TILE`] by [`SPLAT_TILE`] pixels. Each tile has a list of the splats that cover
//! pixels of it, the nearest first; the host sorts and lists them, or kernels do ([`lists`]). An iteration of an
//! optimisation is a sequence of kernels whose data stay on the device. Stages, each a data-parallel kernel:
//!
//! ```text
//! lists               which splats each tile shows                ListBlock, is_reached, rank
//! lanes               pixels of a row, and a splat's opacity there        Lanes, SplatLanes
//! blend               pixels from the splats of their tile                BlendedLanes
//! shown               pixels in bytes, with depths             shown_pixel, surface_depth
//! blend_gradient      derivatives of a tile's pixels by its splats        TileGradient
//! footprint           a Gaussian's ellipse, with what its derivatives need   Footprint
//! project_gradient    ... and of the splats by their Gaussians            project_gradient
//! windows             how far a picture is from a photograph, and the derivatives   LossBlock, pixel_gradient
//! adam                a step against the derivative                       adam_step
//! steps               ... of Gaussians, harmonics and gains               step_particle, step_term, step_gain
//! ```
//!
//! Forward: [`viewfuse_core::gaussian`]. Backward: the chain rule by hand, as in "3D Gaussian Splatting" (Kerbl et al.
//! 2023). All sums run in one order, so that results do not depend on the number of threads.

pub mod adam;
pub mod blend;
pub mod blend_gradient;
pub mod footprint;
pub mod lanes;
pub mod lists;
pub mod project_gradient;
pub mod shown;
pub mod steps;
pub mod windows;

use bytemuck::{Pod, Zeroable};
use viewfuse_core::camera::CameraBlock;

/// Early termination: what lies behind this transmittance does not count.
pub const MIN_TRANSMITTANCE: f32 = 1.0e-3;
/// Pixels of a tile's side.
pub const SPLAT_TILE: usize = 8;

/// A camera and the number of Gaussians that it sees, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SplatBlock {
    /// The camera.
    pub camera: CameraBlock,
    /// Depth along the principal axis from which on Gaussians are seen, world units, above 0.
    pub near: f32,
    /// Number of Gaussians.
    pub gaussian_count: u32,
    /// 1 if splats keep their integral when they are dilated, otherwise 0.
    pub is_antialiased: u32,
    /// Zero.
    pub padding: u32,
}

const _: () = assert!(size_of::<SplatBlock>() == 96);

/// A picture in tiles, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TileBlock {
    /// Columns of pixels.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
    /// Columns of tiles.
    pub tile_columns: u32,
    /// Zero.
    pub padding: u32,
    /// What is seen where nothing is: red, green, blue; the fourth number is unused.
    pub background: [f32; 4],
}

const _: () = assert!(size_of::<TileBlock>() == 32);

impl TileBlock {
    /// A picture of this size, over a background.
    #[inline]
    pub fn new(width: u32, height: u32, [red, green, blue]: [f32; 3]) -> TileBlock {
        let tile_columns = width.div_ceil(SPLAT_TILE as u32);
        TileBlock { width, height, tile_columns, padding: 0, background: [red, green, blue, 0.0] }
    }

    /// How many tiles it has, row by row.
    #[inline]
    pub fn tile_count(&self) -> u32 {
        self.tile_columns * self.height.div_ceil(SPLAT_TILE as u32)
    }

    /// The tile of a pixel.
    #[inline]
    pub fn tile_of(&self, column: u32, row: u32) -> u32 {
        row / SPLAT_TILE as u32 * self.tile_columns + column / SPLAT_TILE as u32
    }

    /// A tile's first pixel: column and row.
    #[inline]
    pub fn first_of(&self, tile: u32) -> [u32; 2] {
        [tile % self.tile_columns * SPLAT_TILE as u32, tile / self.tile_columns * SPLAT_TILE as u32]
    }

    /// Column and row of a pixel of a tile, row by row, whole tiles at the borders, too; `None` outside of the picture.
    #[inline]
    pub fn pixel_of_tile(&self, tile: u32, pixel: u32) -> Option<[u32; 2]> {
        const SIDE: u32 = SPLAT_TILE as u32;
        let [column, row] = self.first_of(tile);
        let (column, row) = (column + pixel % SIDE, row + pixel / SIDE);
        if column < self.width && row < self.height { Some([column, row]) } else { None }
    }

    /// How many parts of rows: each is a tile's part of a row of pixels.
    #[inline]
    pub fn part_count(&self) -> u32 {
        self.tile_columns * self.height
    }

    /// The first pixel of a part; behind the last part, that behind the last pixel.
    #[inline]
    pub fn first_pixel(&self, part: u32) -> u32 {
        part / self.tile_columns * self.width + part % self.tile_columns * SPLAT_TILE as u32
    }

    /// How many columns of a column of tiles are in the picture.
    #[inline]
    pub fn columns_in(&self, tile_column: u32) -> u32 {
        let first = tile_column * SPLAT_TILE as u32;
        if self.width - first < SPLAT_TILE as u32 { self.width - first } else { SPLAT_TILE as u32 }
    }
}
