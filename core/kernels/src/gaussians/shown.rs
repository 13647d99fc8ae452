//! Pixels as they are shown: in bytes, with the depth of what they show.
//!
//! Colours are rounded as pictures are that were computed on the host: `floor(255 v + 1/2)` in `f32`. Opacities, which
//! are confidences, are rounded half away from zero.

/// A number in `[0, 1]`, others at the nearest end of it; 0 for NaN.
#[inline(always)]
fn unit(value: f32) -> f32 {
    if !(value > 0.0) {
        0.0
    } else if value < 1.0 {
        value
    } else {
        1.0
    }
}

/// A channel of a colour in 255ths.
#[inline(always)]
fn level(value: f32) -> u32 {
    (unit(value) * 255.0 + 0.5) as u32
}

/// An opacity in 255ths.
#[inline(always)]
fn opacity_level(value: f32) -> u32 {
    let exact = unit(value) * 255.0;
    let below = exact as u32;
    below + u32::from(exact - below as f32 >= 0.5)
}

/// Red, green, blue and opacity as bytes of one number, red the lowest.
#[inline(always)]
pub fn shown_pixel([red, green, blue, opacity]: [f32; 4]) -> u32 {
    level(red) | level(green) << 8 | level(blue) << 16 | opacity_level(opacity) << 24
}

/// The bytes of a pixel: red, green, blue, opacity.
pub fn bytes_of_pixel(shown: u32) -> [u8; 4] {
    shown.to_le_bytes()
}

/// The depth of a pixel from the weighted sum of its depths; 0 where the opacity is less than `least_opacity`, which is
/// above 0.
#[inline(always)]
pub fn surface_depth(depth: f32, opacity: f32, least_opacity: f32) -> f32 {
    if opacity >= least_opacity { depth / opacity } else { 0.0 }
}
