//! Three-dimensional Gaussians: projection to the image, opacity at a pixel, colour from a direction.
//!
//! A Gaussian has a mean, a covariance `R S S R^T` (rotation `R` of a unit quaternion, `S` the diagonal of its standard
//! deviations), an opacity and a colour. Its projection is the two-dimensional Gaussian of the first-order expansion of
//! the pinhole at the mean (EWA splatting: Zwicker et al. 2001), dilated by [`DILATION`] as in the published code of
//! "3D Gaussian Splatting" (Kerbl et al. 2023). Projected Gaussians, sorted by depth, are composited front to back with
//! [`crate::composite::Compositor::add_alpha`].
//!
//! All functions are total: what cannot be drawn (behind the near bound, transparent, a covariance that is not finite)
//! has the opacity 0 and covers no pixel.

use crate::camera::CameraBlock;
use crate::composite::Compositor;
use crate::fetch::Fetch;
use crate::math::{abs, clamp, exp, has_finite_bits, has_nan_bits, ln, max, min, norm3, sqrt};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Added to both variances of a projection, in square pixels: a Gaussian thinner than a pixel still covers one.
pub const DILATION: f32 = 0.3;
/// Least opacity at a pixel: below it a Gaussian adds nothing there.
pub const MIN_ALPHA: f32 = 1.0 / 255.0;
/// Greatest opacity at a pixel: something of what lies behind is always seen, and the backward pass can divide by the
/// rest.
pub const MAX_ALPHA: f32 = 0.99;
/// Transmittance at which what lies behind is left out: together it has at most this weight.
pub const MIN_TRANSMITTANCE: f32 = 1.0e-4;
/// Share of half the image by which the expansion may lie outside of it: further out the pinhole is not nearly linear.
pub const MARGIN: f32 = 0.3;
/// The spherical harmonic of degree 0, `1 / (2 sqrt(pi))`: the colour is `0.5 + SH_0 * f_dc`.
pub const SH_0: f32 = 0.282_094_8;

/// A Gaussian as plain data: what a kernel reads from a buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GaussianBlock {
    /// The mean in world coordinates.
    pub position: [f32; 3],
    /// Logit of the opacity: the opacity is `1 / (1 + exp(-x))`.
    pub opacity: f32,
    /// Natural logarithms of the standard deviations along its own axes, in world units.
    pub log_scales: [f32; 3],
    /// Zero.
    pub padding: f32,
    /// Rotation from its own axes to the world's: a quaternion `w, x, y, z` of any length.
    pub rotation: [f32; 4],
    /// Red, green, blue from the camera, in `[0, 1]` for what a screen shows.
    pub colour: [f32; 3],
    /// Zero.
    pub padding_end: f32,
}

const _: () = assert!(size_of::<GaussianBlock>() == 64);

/// A Gaussian in an image, as plain data. Made by [`project`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct ProjectedGaussian {
    /// Image coordinates x, y of the mean, in pixels.
    pub mean: [f32; 2],
    /// Depth of the mean along the principal axis, in world units.
    pub depth: f32,
    /// Opacity at the mean, in `[0, 1]`; 0 for what is not drawn.
    pub opacity: f32,
    /// The inverse of the covariance: `xx`, `xy`, `yy`, in reciprocal square pixels.
    pub conic: [f32; 3],
    /// Zero.
    pub padding: f32,
    /// Red, green, blue.
    pub colour: [f32; 3],
    /// Zero.
    pub padding_colour: f32,
    /// Half of the width and of the height of the box in which the opacity is at least [`MIN_ALPHA`], in pixels.
    pub extent: [f32; 2],
    /// Zero.
    pub padding_end: [f32; 2],
}

const _: () = assert!(size_of::<ProjectedGaussian>() == 64);

/// The rotation of a quaternion `w, x, y, z` of any length: the Gaussian's axes in world coordinates. The identity for
/// a quaternion that is zero or not finite.
#[inline]
pub fn axes(rotation: [f32; 4]) -> [Vec3; 3] {
    let [w, x, y, z] = rotation;
    // Quotients of subnormal numbers would be coarse, and the length of the largest numbers infinite.
    let largest = max(max(abs(w), abs(x)), max(abs(y), abs(z)));
    let scale = if largest < 1.0e-30 {
        1.0e38
    } else if largest > 1.0e37 {
        1.0e-30
    } else {
        1.0
    };
    let (w, x, y, z) = (scale * w, scale * x, scale * y, scale * z);
    let vector = norm3(x, y, z);
    let length = norm3(w, vector, 0.0);
    if !(length > 0.0 && has_finite_bits(length)) {
        return [Vec3::X, Vec3::Y, Vec3::Z];
    }
    let (w, x, y, z) = (w / length, x / length, y / length, z / length);
    [
        Vec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        Vec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        Vec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    ]
}

/// The opacity of a logit, in `[0, 1]`; NaN gives 0.
#[inline]
pub fn opacity(logit: f32) -> f32 {
    let odds = exp(logit);
    odds / (1.0 + odds)
}

/// The rows of the matrix that takes a Gaussian's own axes, each of its standard deviation's length, to the image:
/// pixels along x and y. `place` is the mean in the camera's axes, its `z` positive. The covariance in the image is
/// this matrix times its transpose.
#[inline]
pub fn image_axes(gaussian: &GaussianBlock, camera: &CameraBlock, place: Vec3) -> [Vec3; 2] {
    let [focal_x, focal_y, principal_x, principal_y] = camera.intrinsics;
    let (half_width, half_height) = (0.5 * camera.width as f32, 0.5 * camera.height as f32);
    let (margin_x, margin_y) = (MARGIN * half_width, MARGIN * half_height);
    let depth = place.z;
    // The expansion at the mean, or at the nearest place beside the image where it still holds.
    let across = clamp(
        place.x / depth,
        (-principal_x - margin_x) / focal_x,
        (2.0 * half_width - principal_x + margin_x) / focal_x,
    );
    let below = clamp(
        place.y / depth,
        (-principal_y - margin_y) / focal_y,
        (2.0 * half_height - principal_y + margin_y) / focal_y,
    );
    let (scale_x, scale_y) = (focal_x / depth, focal_y / depth);
    let [first, second, third] = axes(gaussian.rotation);
    let [a, b, c] = [
        camera.pose.rotate_to_camera(first) * exp(gaussian.log_scales[0]),
        camera.pose.rotate_to_camera(second) * exp(gaussian.log_scales[1]),
        camera.pose.rotate_to_camera(third) * exp(gaussian.log_scales[2]),
    ];
    [
        Vec3::new(a.x - across * a.z, b.x - across * b.z, c.x - across * c.z) * scale_x,
        Vec3::new(a.y - below * a.z, b.y - below * b.z, c.y - below * c.z) * scale_y,
    ]
}

/// A Gaussian in a camera's image. What is nearer than `near` (depth along the principal axis, world units) is not
/// drawn.
///
/// The determinant of the covariance is a sum of squares (Lagrange's identity for the two rows of [`image_axes`]),
/// which loses nothing for a long and thin Gaussian, where the difference of two products would.
#[inline]
pub fn project(gaussian: &GaussianBlock, camera: &CameraBlock, near: f32) -> ProjectedGaussian {
    project_as(gaussian, camera, near, false)
}

/// The same; if it is antialiased, fainter by as much as [`DILATION`] widens it, so that its integral over the image
/// remains. The opacity is multiplied by the square root of the covariance's determinant before the dilation over that
/// after it: the 2D filter of "Mip-Splatting" (Yu et al. 2024, section 5.2), with the published dilation.
#[inline]
pub fn project_as(
    gaussian: &GaussianBlock,
    camera: &CameraBlock,
    near: f32,
    is_antialiased: bool,
) -> ProjectedGaussian {
    let hidden = ProjectedGaussian::default();
    let mut opacity = opacity(gaussian.opacity);
    let [x, y, z] = gaussian.position;
    let offset = Vec3::new(x, y, z) - camera.centre_world();
    let place = camera.pose.rotate_to_camera(offset);
    // The smallest depth whose reciprocal stays finite, as for points.
    if !(opacity >= MIN_ALPHA && place.z >= max(near, 1.0e-20)) {
        return hidden;
    }
    let [focal_x, focal_y, principal_x, principal_y] = camera.intrinsics;
    let mean = [focal_x * (place.x / place.z) + principal_x, focal_y * (place.y / place.z) + principal_y];
    let [u, v] = image_axes(gaussian, camera, place);
    let [width, height, thickness] = gaussian.log_scales;
    // The exponential of NaN is 0: a Gaussian without thickness.
    if has_nan_bits(width) || has_nan_bits(height) || has_nan_bits(thickness) {
        return hidden;
    }
    let cross = u.cross(v);
    let (u_square, v_square, uv) = (u.dot(u), v.dot(v), u.dot(v));
    let determinant = cross.dot(cross) + DILATION * (u_square + v_square) + DILATION * DILATION;
    if is_antialiased {
        opacity *= sqrt(cross.dot(cross) / determinant);
        // Also for NaN.
        if !(opacity >= MIN_ALPHA) {
            return hidden;
        }
    }
    // `opacity >= 1 / 255`: the logarithm is at least 0, also after rounding.
    let reach = max(2.0 * ln(255.0 * opacity), 0.0);
    let extent = [sqrt(reach * (u_square + DILATION)), sqrt(reach * (v_square + DILATION))];
    if !(has_finite_bits(determinant) && has_finite_bits(mean[0]) && has_finite_bits(mean[1])) {
        return hidden;
    }
    let inverse = 1.0 / determinant;
    ProjectedGaussian {
        mean,
        depth: place.z,
        opacity,
        conic: [(v_square + DILATION) * inverse, -uv * inverse, (u_square + DILATION) * inverse],
        colour: gaussian.colour,
        extent,
        ..hidden
    }
}

impl ProjectedGaussian {
    /// The opacity at the image coordinate `(x, y)`: in `[MIN_ALPHA, MAX_ALPHA]`, or 0. A coordinate that is NaN gives
    /// 0.
    #[inline]
    pub fn alpha(&self, x: f32, y: f32) -> f32 {
        let (right, down) = (x - self.mean[0], y - self.mean[1]);
        let [xx, xy, yy] = self.conic;
        let power = -0.5 * (xx * right * right + yy * down * down) - xy * right * down;
        // The form is positive; its rounded value may not be.
        let alpha = min(MAX_ALPHA, self.opacity * exp(min(0.0, power)));
        if alpha >= MIN_ALPHA { alpha } else { 0.0 }
    }

    /// The pixels of an image whose centres are in the box of [`ProjectedGaussian::extent`]: first column, column
    /// behind the last, first row, row behind the last. Nothing is covered where a first one is not below its end.
    #[inline]
    pub fn pixels(&self, width: u32, height: u32) -> [u32; 4] {
        if !(self.opacity > 0.0) {
            return [0; 4];
        }
        let [x, y] = self.mean;
        let [right, down] = self.extent;
        // Conversions to u32 saturate; a limit on the left keeps them from depending on it.
        let edge = |coordinate: f32, end: u32| clamp(coordinate + 0.5, 0.0, end as f32) as u32;
        [edge(x - right, width), edge(x + right, width), edge(y - down, height), edge(y + down, height)]
    }

    /// Whether the opacity may reach [`MIN_ALPHA`] at a pixel's centre of these columns and rows (each first and last):
    /// the least value that the exponent's quadratic form takes in their rectangle, against the one that the opacity at
    /// the mean allows. Never false where [`ProjectedGaussian::alpha`] is above 0: the comparison has a margin of 1 %
    /// of [`MIN_ALPHA`], and of eight roundings of the form's greatest terms in the rectangle.
    #[inline]
    pub fn reaches(&self, columns: [u32; 2], rows: [u32; 2]) -> bool {
        let [xx, xy, yy] = self.conic;
        let (left, right) = (columns[0] as f32 + 0.5 - self.mean[0], columns[1] as f32 + 0.5 - self.mean[0]);
        let (top, bottom) = (rows[0] as f32 + 0.5 - self.mean[1], rows[1] as f32 + 0.5 - self.mean[1]);
        // The nearest edge across and down; both 0 if the mean is inside.
        let (dx, dy) = (clamp(0.0, left, right), clamp(0.0, top, bottom));
        let form = |x: f32, y: f32| xx * x * x + yy * y * y + 2.0 * xy * x * y;
        // Along each of these edges the least value is where the derivative vanishes, or at an end.
        let across = form(dx, clamp(-xy * dx / yy, top, bottom));
        let down = form(clamp(-xy * dy / xx, left, right), dy);
        let least = match (dx == 0.0, dy == 0.0) {
            (true, _) => down,
            (false, true) => across,
            (false, false) => min(across, down),
        };
        let (far_x, far_y) = (max(-left, right), max(-top, bottom));
        let rounding = 1.0e-6 * (xx * far_x * far_x + yy * far_y * far_y);
        !(least > 2.0 * ln(255.0 * self.opacity) + 0.02 + rounding)
    }
}

/// The indices of projected Gaussians, nearest first, those of equal depth in their own order. Those that are not drawn
/// come first and cover nothing. `order` has the length of `projected`; what is beyond the shorter of both is left
/// alone.
///
/// Rust's own sort of slices: at most a multiple of `N log N` comparisons, and it recurses at most `2 log N` deep. On a
/// GPU the host sorts.
pub fn nearest_first(projected: &[ProjectedGaussian], order: &mut [u32]) {
    let count = if order.len() < projected.len() { order.len() } else { projected.len() };
    let order = &mut order[..count];
    for (index, place) in order.iter_mut().enumerate() {
        *place = index as u32;
    }
    // Depths are positive or 0: their bits have their order.
    order.sort_unstable_by_key(|index| (projected[*index as usize].depth.to_bits(), *index));
}

/// A row of an image of `W` columns: pixel by pixel what is in front of what. `order` are `count` indices, nearest
/// first ([`nearest_first`]). A pixel whose transmittance is at most [`MIN_TRANSMITTANCE`] takes nothing more. Channels
/// are summed in the order of the depths.
#[inline]
pub fn composite_row<const W: usize>(
    projected: &(impl Fetch<ProjectedGaussian> + ?Sized),
    order: &(impl Fetch<u32> + ?Sized),
    count: u32,
    row: u32,
) -> [Compositor<3>; W] {
    let mut pixels = [Compositor::<3>::START; W];
    let y = row as f32 + 0.5;
    let mut index = 0;
    while index < count as usize {
        let gaussian = projected.fetch(order.fetch(index) as usize);
        let [first, end, top, bottom] = gaussian.pixels(W as u32, row + 1);
        let mut column = if top <= row && row < bottom { first } else { end };
        while column < end {
            let pixel = &mut pixels[column as usize];
            if !pixel.is_terminated(MIN_TRANSMITTANCE) {
                pixel.add_alpha(&gaussian.colour, gaussian.alpha(column as f32 + 0.5, y), gaussian.depth);
            }
            column += 1;
        }
        index += 1;
    }
    pixels
}

/// Numbers of a channel's coefficients beyond degree 0, for degrees 0 to 3.
pub const REST_COUNTS: [u32; 4] = [0, 3, 8, 15];

/// The colour of a Gaussian seen along `direction` (from the camera to the mean; any length, zero leaves degree 0
/// alone), red, green, blue, at least 0: `0.5` plus the spherical harmonics up to `degree` (at most 3) of the published
/// code.
///
/// `f_dc` are the coefficients of degree 0; `f_rest` those of the higher degrees, `[channel][coefficient]` with
/// [`REST_COUNTS`]`[degree]` coefficients a channel. Terms are added in the order of the coefficients.
#[inline]
pub fn colour_along(f_dc: [f32; 3], f_rest: &(impl Fetch<f32> + ?Sized), degree: u32, direction: Vec3) -> [f32; 3] {
    let length = norm3(direction.x, direction.y, direction.z);
    let unit = if length > 0.0 && has_finite_bits(length) { direction / length } else { Vec3::ZERO };
    let basis = harmonics(unit);
    let count = REST_COUNTS[degree.min(3) as usize] as usize;
    let mut colour = [0.0; 3];
    let mut channel = 0;
    while channel < 3 {
        let mut sum = 0.5 + SH_0 * f_dc[channel];
        let mut index = 0;
        // A direction of no length has no harmonics beyond the first.
        while index < count && length > 0.0 {
            sum += basis[index] * f_rest.fetch(channel * count + index);
            index += 1;
        }
        colour[channel] = max(sum, 0.0);
        channel += 1;
    }
    colour
}

/// The spherical harmonics of degrees 1 to 3 along a unit vector (the derivatives of [`colour_along`] by its
/// coefficients, where the colour is above 0), with the signs and the order of the published code.
#[inline]
pub fn harmonics(unit: Vec3) -> [f32; 15] {
    let Vec3 { x, y, z } = unit;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        -0.488_602_52 * y,
        0.488_602_52 * z,
        -0.488_602_52 * x,
        1.092_548_5 * x * y,
        -1.092_548_5 * y * z,
        0.315_391_57 * (2.0 * zz - xx - yy),
        -1.092_548_5 * x * z,
        0.546_274_24 * (xx - yy),
        -0.590_043_6 * y * (3.0 * xx - yy),
        2.890_611_4 * x * y * z,
        -0.457_045_8 * y * (4.0 * zz - xx - yy),
        0.373_176_34 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_8 * x * (4.0 * zz - xx - yy),
        1.445_305_7 * z * (xx - yy),
        -0.590_043_6 * x * (xx - 3.0 * yy),
    ]
}
