//! Frames per second.

/// Frames per second, from 0.1 to 240.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRate(f64);

impl Default for FrameRate {
    /// 30.
    fn default() -> FrameRate {
        FrameRate::DEFAULT
    }
}

impl FrameRate {
    /// The default.
    pub const DEFAULT: FrameRate = FrameRate(30.0);

    /// `None` outside of the range.
    pub fn new(per_second: f64) -> Option<FrameRate> {
        (0.1..=240.0).contains(&per_second).then_some(FrameRate(per_second))
    }

    /// Frames per second.
    pub fn per_second(self) -> f64 {
        self.0
    }

    /// The same as numerator and denominator, to within a thousandth.
    pub fn ratio(self) -> [u32; 2] {
        if self.0.fract() == 0.0 { [self.0 as u32, 1] } else { [(1000.0 * self.0).round() as u32, 1000] }
    }
}
