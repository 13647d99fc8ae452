//! Pixels of a row at a time: on a CPU the eight of a tile's row, a vector; on a GPU one an invocation.

use super::SPLAT_TILE;
use viewfuse_core::gaussian::{MAX_ALPHA, MIN_ALPHA, ProjectedGaussian};
use viewfuse_core::math::{clamp, exact_power_of_two, min};

/// A number a pixel.
pub type Lanes<const N: usize> = [f32; N];

/// A splat at `N` pixels of a row.
#[derive(Clone, Copy, Debug)]
pub struct SplatLanes<const N: usize> {
    /// Opacities in `[0, MAX_ALPHA]`.
    pub alpha: Lanes<N>,
    /// 1 where a larger opacity at the centre is a larger one here; 0 where it is limited or does not count.
    pub slope: Lanes<N>,
    /// From the splat's centre to the pixels' to the right, pixels.
    pub dx: Lanes<N>,
    /// Downwards, pixels.
    pub dy: f32,
}

impl<const N: usize> SplatLanes<N> {
    /// At the pixels whose first has its centre at image coordinate `x`, in the row of centre `y`: as
    /// [`ProjectedGaussian::alpha`], to the error of [`falloff`].
    #[inline(always)]
    pub fn of(splat: &ProjectedGaussian, x: f32, y: f32) -> SplatLanes<N> {
        let dy = y - splat.mean[1];
        let [xx, xy, yy] = splat.conic;
        let (half, cross, rest) = (-0.5 * xx, xy * dy, 0.5 * yy * dy * dy);
        let first = x - splat.mean[0];
        let (mut alpha, mut slope, mut dx) = ([0.0; N], [0.0; N], [0.0; N]);
        let mut lane = 0;
        while lane < N {
            dx[lane] = first + lane as f32;
            let full = splat.opacity * falloff(dx[lane] * (half * dx[lane] - cross) - rest);
            let counts = if full >= MIN_ALPHA { 1.0 } else { 0.0 };
            alpha[lane] = counts * min(full, MAX_ALPHA);
            slope[lane] = if full < MAX_ALPHA { counts } else { 0.0 };
            lane += 1;
        }
        SplatLanes { alpha, slope, dx, dy }
    }
}

/// `e^x` for `x` from -16 to 0, limited to that interval; relative error at most 4e-6. For loops that become vectors,
/// where [`exp`](viewfuse_core::math::exp) takes half as long again for its last digits.
#[inline(always)]
pub fn falloff(x: f32) -> f32 {
    // 1.5 * 2^23: adding rounds to a whole number, whose bits are the last ones.
    const WHOLE: f32 = 12_582_912.0;
    let y = clamp(x, -16.0, 0.0) * core::f32::consts::LOG2_E;
    let shifted = y + WHOLE;
    let r = y - (shifted - WHOLE);
    let power = shifted.to_bits().wrapping_sub(WHOLE.to_bits()) as i32;
    // 2^r for r from -0.5 to 0.5.
    let p = 1.333_558_1e-3;
    let p = p * r + 9.618_129e-3;
    let p = p * r + 5.550_411e-2;
    let p = p * r + 2.402_265e-1;
    let p = p * r + 6.931_472e-1;
    let p = p * r + 1.0;
    p * exact_power_of_two(power)
}

/// The greatest of all lanes.
#[inline(always)]
pub fn greatest<const N: usize>(lanes: &Lanes<N>) -> f32 {
    let mut greatest = lanes[0];
    let mut lane = 1;
    while lane < N {
        greatest = if lanes[lane] > greatest { lanes[lane] } else { greatest };
        lane += 1;
    }
    greatest
}

/// The sum of a tile's row: of neighbours, of those sums' neighbours, and so on.
#[inline(always)]
pub fn sum(lanes: &Lanes<SPLAT_TILE>) -> f32 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
