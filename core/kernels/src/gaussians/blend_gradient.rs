//! Derivatives of a tile's pixels by its splats.
//!
//! With the weight `w_i = T_i a_i` and `s_i`, the derivative of the loss by `w_i` alone, the derivative by the opacity is
//! `T_i s_i - R_i / (1 - a_i)`, where `R_i` is what all that lies behind, the background included, adds to `sum w s`: it begins as the
//! whole sum, which the pixel's own colour gives, and loses each splat's part as the tile is gone through again front to back.

use super::lanes::{Lanes, SplatLanes, greatest, sum};
use super::{MIN_TRANSMITTANCE, SPLAT_TILE, TileBlock};
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;
use viewfuse_core::math::abs;

/// What a tile's pixels say of one of its splats, as plain data. `p` is the derivative by the opacity times the opacity, `(dx, dy)` from
/// the splat's centre to the pixel's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SplatGradient {
    /// Sum of `p`.
    pub opacity: f32,
    /// Sums of `p dx` and `p dy`.
    pub along: [f32; 2],
    /// Zero.
    pub padding: f32,
    /// Sums of `p dx dx`, `p dx dy` and `p dy dy`.
    pub squares: [f32; 3],
    /// Zero.
    pub unused: f32,
    /// Derivatives by red, green, blue.
    pub colour: [f32; 3],
    /// Zero.
    pub behind: f32,
}

const _: () = assert!(size_of::<SplatGradient>() == 48);

impl SplatGradient {
    /// Adds what another tile says.
    #[inline(always)]
    pub fn add(&mut self, other: &SplatGradient) {
        self.opacity += other.opacity;
        self.along[0] += other.along[0];
        self.along[1] += other.along[1];
        let mut index = 0;
        while index < 3 {
            self.squares[index] += other.squares[index];
            self.colour[index] += other.colour[index];
            index += 1;
        }
    }
}

/// A tile that is gone through front to back.
#[derive(Clone, Copy, Debug)]
pub struct TileGradient {
    /// Derivatives of the loss by each row's red, green, blue and opacity.
    by: [[Lanes; 4]; SPLAT_TILE],
    /// What is seen behind the splats so far.
    transmittance: [Lanes; SPLAT_TILE],
    /// What lies behind adds so much to the sum of weights times derivatives.
    rest: [Lanes; SPLAT_TILE],
    first_row: u32,
    x: f32,
}

impl TileGradient {
    /// A tile whose pixels are `colours[row][column]` (red, green, blue, opacity) and whose derivatives are
    /// `gradients[row][column]`; outside of the picture both are 0.
    #[inline(always)]
    pub fn begin(
        block: &TileBlock,
        colours: &(impl Fetch<[f32; 4]> + ?Sized),
        gradients: &(impl Fetch<[f32; 4]> + ?Sized),
        tile: u32,
    ) -> TileGradient {
        let tile_column = tile % block.tile_columns;
        let first_row = tile / block.tile_columns * SPLAT_TILE as u32;
        let mut own = TileGradient {
            by: [[[0.0; SPLAT_TILE]; 4]; SPLAT_TILE],
            transmittance: [[1.0; SPLAT_TILE]; SPLAT_TILE],
            rest: [[0.0; SPLAT_TILE]; SPLAT_TILE],
            first_row,
            x: (tile_column * SPLAT_TILE as u32) as f32 + 0.5,
        };
        let columns = block.columns_in(tile_column) as usize;
        let mut row = 0;
        while row < SPLAT_TILE && first_row + (row as u32) < block.height {
            let first = ((first_row + row as u32) * block.width + tile_column * SPLAT_TILE as u32) as usize;
            let mut lane = 0;
            while lane < columns {
                let (colour, by) = (colours.fetch(first + lane), gradients.fetch(first + lane));
                let mut channel = 0;
                while channel < 4 {
                    own.by[row][channel][lane] = by[channel];
                    own.rest[row][lane] += by[channel] * colour[channel];
                    channel += 1;
                }
                lane += 1;
            }
            row += 1;
        }
        own
    }

    /// What the pixels say of the next splat. Sums run over the rows in each column, then over the columns.
    #[inline(always)]
    pub fn next(&mut self, splat: &ProjectedGaussian) -> SplatGradient {
        let mut sums = Sums::START;
        let mut row = 0;
        while row < SPLAT_TILE {
            let y = (self.first_row + row as u32) as f32 + 0.5;
            if abs(y - splat.mean[1]) <= splat.extent[1] {
                self.row(row, y, splat, &mut sums);
            }
            row += 1;
        }
        sums.gradient()
    }

    /// Whether nothing behind is seen.
    #[inline(always)]
    pub fn is_over(&self) -> bool {
        let mut most = 0.0;
        let mut row = 0;
        while row < SPLAT_TILE {
            let own = greatest(&self.transmittance[row]);
            most = if own > most { own } else { most };
            row += 1;
        }
        most < MIN_TRANSMITTANCE
    }

    #[inline(always)]
    fn row(&mut self, row: usize, y: f32, splat: &ProjectedGaussian, sums: &mut Sums) {
        let seen = SplatLanes::of(splat, self.x, y);
        if greatest(&seen.alpha) <= 0.0 {
            return;
        }
        let (by, [red, green, blue]) = (&self.by[row], splat.colour);
        let (transmittance, rest) = (&mut self.transmittance[row], &mut self.rest[row]);
        let mut lane = 0;
        while lane < SPLAT_TILE {
            let before = transmittance[lane];
            let alpha = if before >= MIN_TRANSMITTANCE { seen.alpha[lane] } else { 0.0 };
            let weight = alpha * before;
            let share = by[0][lane] * red + by[1][lane] * green + by[2][lane] * blue + by[3][lane];
            rest[lane] -= weight * share;
            let by_alpha = before * share - rest[lane] / (1.0 - alpha);
            transmittance[lane] = before - weight;
            let p = seen.slope[lane] * alpha * by_alpha;
            let (px, py) = (p * seen.dx[lane], p * seen.dy);
            sums.opacity[lane] += p;
            sums.along[0][lane] += px;
            sums.along[1][lane] += py;
            sums.squares[0][lane] += px * seen.dx[lane];
            sums.squares[1][lane] += px * seen.dy;
            sums.squares[2][lane] += py * seen.dy;
            sums.colour[0][lane] += weight * by[0][lane];
            sums.colour[1][lane] += weight * by[1][lane];
            sums.colour[2][lane] += weight * by[2][lane];
            lane += 1;
        }
    }
}

/// The sums of a splat, a column of the tile each.
struct Sums {
    opacity: Lanes,
    along: [Lanes; 2],
    squares: [Lanes; 3],
    colour: [Lanes; 3],
}

impl Sums {
    const START: Sums = Sums {
        opacity: [0.0; SPLAT_TILE],
        along: [[0.0; SPLAT_TILE]; 2],
        squares: [[0.0; SPLAT_TILE]; 3],
        colour: [[0.0; SPLAT_TILE]; 3],
    };

    #[inline(always)]
    fn gradient(&self) -> SplatGradient {
        let Sums { opacity, along, squares, colour } = self;
        SplatGradient {
            opacity: sum(opacity),
            along: [sum(&along[0]), sum(&along[1])],
            padding: 0.0,
            squares: [sum(&squares[0]), sum(&squares[1]), sum(&squares[2])],
            unused: 0.0,
            colour: [sum(&colour[0]), sum(&colour[1]), sum(&colour[2])],
            behind: 0.0,
        }
    }
}
