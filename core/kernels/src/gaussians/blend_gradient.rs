//! Derivatives of a tile's pixels by its splats.
//!
//! With the weight `w_i = T_i a_i` and `s_i`, the derivative of the loss by `w_i` alone, the derivative by the opacity
//! is `T_i s_i - R_i / (1 - a_i)`, where `R_i` is what all that lies behind, the background included, adds to `sum w
//! s`: it begins as the whole sum, which the pixel's own colour gives, and loses each splat's part as the tile is gone
//! through again front to back.

use super::lanes::{Lanes, SplatLanes, greatest, sum};
use super::{MIN_TRANSMITTANCE, SPLAT_TILE, TileBlock};
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;
use viewfuse_core::math::abs;

/// What a tile's pixels say of one of its splats, as plain data. `p` is the derivative by the opacity times the
/// opacity, `(dx, dy)` from the splat's centre to the pixel's.
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

/// Numbers of a [`SplatGradient`] that are no padding.
pub const NUMBERS: usize = 9;

impl SplatGradient {
    /// Nothing said.
    pub const ZERO: SplatGradient = SplatGradient::of([0.0; NUMBERS]);

    /// These numbers, in the order of the fields.
    #[inline(always)]
    pub const fn of([opacity, x, y, xx, xy, yy, red, green, blue]: [f32; NUMBERS]) -> SplatGradient {
        SplatGradient {
            opacity,
            along: [x, y],
            padding: 0.0,
            squares: [xx, xy, yy],
            unused: 0.0,
            colour: [red, green, blue],
            behind: 0.0,
        }
    }

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

/// Pixels of a row that are gone through front to back.
#[derive(Clone, Copy, Debug)]
pub struct GradientLanes<const N: usize> {
    /// Derivatives of the loss by red, green, blue and opacity.
    by: [Lanes<N>; 4],
    /// What is seen behind the splats so far.
    transmittance: Lanes<N>,
    /// What lies behind adds so much to the sum of weights times derivatives.
    rest: Lanes<N>,
}

impl<const N: usize> GradientLanes<N> {
    /// Pixels outside of the picture: no derivatives, and nothing that is seen.
    pub const OUTSIDE: GradientLanes<N> = GradientLanes { by: [[0.0; N]; 4], transmittance: [0.0; N], rest: [0.0; N] };

    /// Makes a pixel that of this colour (red, green, blue, opacity), with the derivatives by these.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, colour: [f32; 4], by: [f32; 4]) {
        self.transmittance[lane] = 1.0;
        let mut channel = 0;
        while channel < 4 {
            self.by[channel][lane] = by[channel];
            self.rest[lane] += by[channel] * colour[channel];
            channel += 1;
        }
    }

    /// Adds what the pixels, the first of which has its centre at image coordinates `x` and `y`, say of the next splat.
    #[inline(always)]
    pub fn add(&mut self, x: f32, y: f32, splat: &ProjectedGaussian, sums: &mut GradientSums<N>) {
        if abs(y - splat.mean[1]) > splat.extent[1] {
            return;
        }
        let seen = SplatLanes::<N>::of(splat, x, y);
        if greatest(&seen.alpha) <= 0.0 {
            return;
        }
        self.add_seen(&seen, splat.colour, sums);
    }

    /// Adds what the pixels say of the next splat, of this colour, which they see so.
    #[inline(always)]
    pub fn add_seen(&mut self, seen: &SplatLanes<N>, [red, green, blue]: [f32; 3], sums: &mut GradientSums<N>) {
        let by = &self.by;
        let (transmittance, rest) = (&mut self.transmittance, &mut self.rest);
        let mut lane = 0;
        while lane < N {
            let before = transmittance[lane];
            let alpha = if before >= MIN_TRANSMITTANCE { seen.alpha[lane] } else { 0.0 };
            let weight = alpha * before;
            let share = by[0][lane] * red + by[1][lane] * green + by[2][lane] * blue + by[3][lane];
            rest[lane] -= weight * share;
            let by_alpha = before * share - rest[lane] / (1.0 - alpha);
            transmittance[lane] = before - weight;
            let p = seen.slope[lane] * alpha * by_alpha;
            let (px, py) = (p * seen.dx[lane], p * seen.dy);
            sums.0[0][lane] += p;
            sums.0[1][lane] += px;
            sums.0[2][lane] += py;
            sums.0[3][lane] += px * seen.dx[lane];
            sums.0[4][lane] += px * seen.dy;
            sums.0[5][lane] += py * seen.dy;
            sums.0[6][lane] += weight * by[0][lane];
            sums.0[7][lane] += weight * by[1][lane];
            sums.0[8][lane] += weight * by[2][lane];
            lane += 1;
        }
    }

    /// The most of what is seen behind.
    #[inline(always)]
    pub fn most_seen(&self) -> f32 {
        greatest(&self.transmittance)
    }
}

/// The nine numbers of a [`SplatGradient`] in their order, a number a pixel, of one row or summed over rows.
#[derive(Clone, Copy, Debug)]
pub struct GradientSums<const N: usize>(pub [Lanes<N>; NUMBERS]);

impl<const N: usize> GradientSums<N> {
    /// Nothing added yet.
    pub const ZERO: GradientSums<N> = GradientSums([[0.0; N]; NUMBERS]);
}

/// A tile that is gone through front to back.
#[derive(Clone, Copy, Debug)]
pub struct TileGradient {
    rows: [GradientLanes<SPLAT_TILE>; SPLAT_TILE],
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
        let [first_column, first_row] = block.first_of(tile);
        let mut gradients_of_rows =
            TileGradient { rows: [GradientLanes::OUTSIDE; SPLAT_TILE], first_row, x: first_column as f32 + 0.5 };
        let columns = block.columns_in(tile % block.tile_columns) as usize;
        let mut row = 0;
        while row < SPLAT_TILE && first_row + (row as u32) < block.height {
            let first = ((first_row + row as u32) * block.width + first_column) as usize;
            let mut lane = 0;
            while lane < columns {
                gradients_of_rows.rows[row].set(lane, colours.fetch(first + lane), gradients.fetch(first + lane));
                lane += 1;
            }
            row += 1;
        }
        gradients_of_rows
    }

    /// What the pixels say of the next splat. Sums run over the rows in each column, then over the columns.
    #[inline(always)]
    pub fn next(&mut self, splat: &ProjectedGaussian) -> SplatGradient {
        let mut sums = GradientSums::<SPLAT_TILE>::ZERO;
        let mut row = 0;
        while row < SPLAT_TILE {
            let y = (self.first_row + row as u32) as f32 + 0.5;
            self.rows[row].add(self.x, y, splat, &mut sums);
            row += 1;
        }
        let mut numbers = [0.0; NUMBERS];
        let mut number = 0;
        while number < NUMBERS {
            numbers[number] = sum(&sums.0[number]);
            number += 1;
        }
        SplatGradient::of(numbers)
    }

    /// Whether nothing behind is seen.
    #[inline(always)]
    pub fn is_over(&self) -> bool {
        let mut most = 0.0;
        let mut row = 0;
        while row < SPLAT_TILE {
            let most_of_row = self.rows[row].most_seen();
            most = if most_of_row > most { most_of_row } else { most };
            row += 1;
        }
        most < MIN_TRANSMITTANCE
    }
}
