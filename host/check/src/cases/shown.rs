//! [`Kernel::ShowPixels`]: colours and opacities within their range and beyond it, some with the least opacity that
//! has a depth. A level is undecided where it depends on rounding.

use super::*;
use crate::world::Numbers;
use viewfuse_device::Memory;
use viewfuse_kernels::gaussians::shown::bytes_of_pixel;

/// A number in `[0, 1]`, or beyond it, in 255ths; `None` where that depends on rounding.
fn level(value: f32) -> Option<Bounded> {
    let exact = Bounded::from(value).clamped(0.0, 1.0) * Bounded::from(255.0_f32) + Bounded::from(0.5_f32);
    let [low, high] = [exact.value - exact.error, exact.value + exact.error].map(f64::floor);
    (low == high).then(|| Bounded::from(low as f32))
}

impl Case for ShowPixels {
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "whole numbers, undecided where they depend on rounding; a division";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("parameters", |case| case.least_opacity *= 1.01),
        ("colours", |case| increase(case.colours.as_flattened_mut())),
        ("depths", |case| increase(&mut case.depths)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ShowPixels> {
        let numbers = &mut Numbers::new(seed);
        let least_opacity = numbers.between(0.3, 0.6);
        let colour = |pixel: u32| {
            let [red, green, blue, opacity] = [0; 4].map(|_| numbers.between(-0.1, 1.1));
            [red, green, blue, if pixel.is_multiple_of(3) { least_opacity } else { opacity }]
        };
        let colours: Vec<[f32; 4]> = (0..size).map(colour).collect();
        let count = size as usize;
        vec![ShowPixels {
            least_opacity,
            pixel_count: size,
            colours,
            depths: (0..size).map(|_| numbers.between(0.1, 9.0)).collect(),
            shown: Output::Zeros(count),
            surfaces: Output::Zeros(count),
        }]
    }

    /// Of each pixel its bytes, then all depths.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let levels = self.colours.iter().flatten().map(|value| level(*value));
        let depth = |(colour, depth): (&[f32; 4], &f32)| match colour[3] >= self.least_opacity {
            true => Bounded::from(*depth) / Bounded::from(colour[3]),
            false => Bounded::ZERO,
        };
        levels.chain(self.colours.iter().zip(&self.depths).map(depth).map(Some)).collect()
    }

    fn read_one<D: Device>(
        device: &D,
        (_, _, shown, surfaces): &Self::Loaded<D>,
        index: usize,
    ) -> Result<Vec<f32>, DeviceError> {
        let (Some(shown), Some(surfaces)) = (&shown[index], &surfaces[index]) else { return Ok(Vec::new()) };
        let bytes = Memory::download(device, shown)?.into_iter().flat_map(bytes_of_pixel).map(f32::from);
        Ok(bytes.chain(Memory::download(device, surfaces)?).collect())
    }
}
