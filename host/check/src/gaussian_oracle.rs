//! Gaussians in `f64`, with bounds on the error of `f32`: projected, composited, and the derivatives of both.

use super::bounded::Bounded;
use super::camera_oracle::{Vector, axes as camera_axes, centre, dot};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::{DILATION, MARGIN, MAX_ALPHA, MIN_ALPHA};
use viewfuse_kernels::gaussians::{MIN_TRANSMITTANCE, SPLAT_TILE};
use viewfuse_kernels::rows::{GaussianBlock, ProjectedGaussian, SplatBlock, SplatGradient, TileBlock};

/// Relative error of [`falloff`](viewfuse_kernels::gaussians::lanes::falloff).
pub const FALLOFF_ERROR: f64 = 4.0e-6;

/// A Gaussian's ellipse in a picture; see [`Footprint`](viewfuse_kernels::gaussians::footprint::Footprint).
pub struct Ellipse {
    place: Vector,
    slopes: [Bounded; 2],
    limited: [Option<bool>; 2],
    jacobian: [Vector; 2],
    unit: [Bounded; 4],
    length: Bounded,
    axes: [Vector; 3],
    scales: Vector,
    image_axes: [Vector; 2],
}

fn scaled(vector: Vector, factor: Bounded) -> Vector {
    vector.map(|component| component * factor)
}

fn plus(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|axis| a[axis] + b[axis])
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn joined(rows: [[Bounded; 4]; 4]) -> [Bounded; 16] {
    std::array::from_fn(|index| rows[index / 4][index % 4])
}

fn two() -> Bounded {
    Bounded::from(2.0_f32)
}

impl Ellipse {
    /// Of a Gaussian before the camera, whose quaternion is neither zero nor huge.
    pub fn of(gaussian: &GaussianBlock, camera: &CameraBlock) -> Ellipse {
        let origin = centre(camera);
        let offset = [0, 1, 2].map(|axis| Bounded::from(gaussian.position[axis]) - origin[axis]);
        let [right, down, forward] = camera_axes(camera);
        let place = [dot(right, offset), dot(down, offset), dot(forward, offset)];
        let [focal_x, focal_y, principal_x, principal_y] = camera.intrinsics.map(Bounded::from);
        let limit = |slope: Bounded, size: u32, principal: Bounded, focal: Bounded| {
            let size = Bounded::from(size);
            let beyond = Bounded::from(0.5 * MARGIN) * size;
            let (low, high) = ((-beyond - principal) / focal, (size + beyond - principal) / focal);
            let limited = match (slope.below(low), high.below(slope)) {
                (Some(low), Some(high)) => Some(low || high),
                _ => None,
            };
            (slope.greater(low).lesser(high), limited)
        };
        let (across, across_limited) = limit(place[0] / place[2], camera.width, principal_x, focal_x);
        let (below, below_limited) = limit(place[1] / place[2], camera.height, principal_y, focal_y);
        let row = |axis: Vector, slope: Bounded, focal: Bounded| {
            scaled([0, 1, 2].map(|index| axis[index] - forward[index] * slope), focal / place[2])
        };
        let jacobian = [row(right, across, focal_x), row(down, below, focal_y)];
        let quaternion = gaussian.rotation.map(Bounded::from);
        let square = quaternion.iter().fold(Bounded::ZERO, |sum, part| sum + part.squared());
        // Two norms in a row, with a few roundings each.
        let mut length = square.square_root();
        length.error += 4.0e-7 * length.value;
        let unit = quaternion.map(|part| part / length);
        let [w, x, y, z] = unit;
        let one = |a: Bounded, b: Bounded| Bounded::ONE - two() * (a.squared() + b.squared());
        let axes = [
            [one(y, z), two() * (x * y + w * z), two() * (x * z - w * y)],
            [two() * (x * y - w * z), one(x, z), two() * (y * z + w * x)],
            [two() * (x * z + w * y), two() * (y * z - w * x), one(x, y)],
        ];
        let scales = gaussian.log_scales.map(|scale| Bounded::from(scale).exp());
        let along = |row: Vector| [0, 1, 2].map(|axis| dot(row, axes[axis]) * scales[axis]);
        // The code may turn the axes to the camera first: as many products, none larger.
        let image_axes = [along(jacobian[0]), along(jacobian[1])];
        Ellipse {
            place,
            slopes: [across, below],
            limited: [across_limited, below_limited],
            jacobian,
            unit,
            length,
            axes,
            scales,
            image_axes,
        }
    }
}

/// What `project` gives, in the order of its fields; `None` where that depends on rounding.
pub fn project(block: &SplatBlock, gaussian: &GaussianBlock) -> Option<[Bounded; 16]> {
    let SplatBlock { camera, near, .. } = block;
    let odds = Bounded::from(gaussian.opacity).exp();
    let mut opacity = odds / (Bounded::ONE + odds);
    let offset = {
        let origin = centre(camera);
        [0, 1, 2].map(|axis| Bounded::from(gaussian.position[axis]) - origin[axis])
    };
    let depth = dot(camera_axes(camera)[2], offset);
    if opacity.below(MIN_ALPHA.into())? || depth.below((*near).into())? {
        return Some([Bounded::ZERO; 16]);
    }
    let Ellipse { place, image_axes: [u, v], .. } = Ellipse::of(gaussian, camera);
    let [focal_x, focal_y, principal_x, principal_y] = camera.intrinsics.map(Bounded::from);
    let mean = [focal_x * (place[0] / place[2]) + principal_x, focal_y * (place[1] / place[2]) + principal_y];
    let dilation = Bounded::from(DILATION);
    let (uu, vv, uv) = (dot(u, u), dot(v, v), dot(u, v));
    let area = cross(u, v);
    let determinant = dot(area, area) + dilation * (uu + vv) + dilation * dilation;
    if block.is_antialiased != 0 {
        opacity = opacity * (dot(area, area) / determinant).square_root();
        if opacity.below(MIN_ALPHA.into())? {
            return Some([Bounded::ZERO; 16]);
        }
    }
    let reach = (two() * (Bounded::from(255.0_f32) * opacity).ln()).greater(Bounded::ZERO);
    let extent = [(reach * (uu + dilation)).square_root(), (reach * (vv + dilation)).square_root()];
    let conic = [(vv + dilation) / determinant, -uv / determinant, (uu + dilation) / determinant, Bounded::ZERO];
    let [red, green, blue] = gaussian.colour.map(Bounded::from);
    let place = [mean[0], mean[1], place[2], opacity];
    Some(joined([
        place,
        conic,
        [red, green, blue, Bounded::ZERO],
        [extent[0], extent[1], Bounded::ZERO, Bounded::ZERO],
    ]))
}

/// A splat at a pixel.
pub struct Seen {
    alpha: Bounded,
    /// Whether a larger opacity at the centre is a larger one here.
    counts: bool,
    dx: Bounded,
    dy: Bounded,
}

/// A splat at a pixel's centre; `None` where it depends on rounding whether it counts.
fn seen(splat: &ProjectedGaussian, column: u32, row: u32) -> Option<Seen> {
    let (x, y) = (Bounded::from(column as f32 + 0.5), Bounded::from(row as f32 + 0.5));
    let (dx, dy) = (x - splat.mean[0].into(), y - splat.mean[1].into());
    let [xx, xy, yy] = splat.conic.map(Bounded::from);
    let half = Bounded::from(0.5_f32);
    let power = -(half * xx * dx.squared() + half * yy * dy.squared() + xy * dx * dy);
    let mut fall = power.clamped(-16.0, 0.0).exp();
    fall.error += FALLOFF_ERROR * fall.value;
    let full = Bounded::from(splat.opacity) * fall;
    if full.below(MIN_ALPHA.into())? {
        return Some(Seen { alpha: Bounded::ZERO, counts: false, dx, dy });
    }
    let limit = Bounded::from(MAX_ALPHA);
    Some(Seen { alpha: full.lesser(limit), counts: full.below(limit)?, dx, dy })
}

/// A pixel: red, green, blue, opacity, and the weighted sum of depths; `None` where it depends on rounding.
pub fn blend(
    block: &TileBlock,
    list: &[u32],
    splats: &[ProjectedGaussian],
    column: u32,
    row: u32,
) -> Option<[Bounded; 5]> {
    let mut sums = [Bounded::ZERO; 4];
    let mut transmittance = Bounded::ONE;
    for splat in list.iter().map(|index| &splats[*index as usize]) {
        if transmittance.below(MIN_TRANSMITTANCE.into())? {
            break;
        }
        let weight = seen(splat, column, row)?.alpha * transmittance;
        for (sum, value) in sums.iter_mut().zip(splat.colour.into_iter().chain([splat.depth])) {
            *sum = *sum + weight * value.into();
        }
        transmittance = transmittance - weight;
    }
    let over = [0, 1, 2].map(|channel| sums[channel] + transmittance * block.background[channel].into());
    Some([over[0], over[1], over[2], Bounded::ONE - transmittance, sums[3]])
}

/// What a pixel adds to the sums of a splat, in the order of [`sums_of`].
type Parts = [Bounded; 9];

/// What a pixel says of each splat of a list, from its colour and the derivatives by it.
fn pixel_parts(
    list: &[u32],
    splats: &[ProjectedGaussian],
    [column, row]: [u32; 2],
    colour: [f32; 4],
    by: [f32; 4],
) -> Option<Vec<Parts>> {
    if by == [0.0; 4] {
        // Whatever counts there: it adds nothing.
        return Some(vec![[Bounded::ZERO; 9]; list.len()]);
    }
    let by = by.map(Bounded::from);
    let mut rest = (0..4).fold(Bounded::ZERO, |sum, channel| sum + by[channel] * colour[channel].into());
    let mut transmittance = Bounded::ONE;
    let mut parts = Vec::with_capacity(list.len());
    for splat in list.iter().map(|index| &splats[*index as usize]) {
        let is_over = transmittance.below(MIN_TRANSMITTANCE.into())?;
        let seen = if is_over { None } else { Some(seen(splat, column, row)?) };
        let Some(Seen { alpha, counts, dx, dy }) = seen.filter(|seen| seen.alpha.value > 0.0) else {
            parts.push([Bounded::ZERO; 9]);
            continue;
        };
        let weight = alpha * transmittance;
        let [red, green, blue] = splat.colour.map(Bounded::from);
        let share = by[0] * red + by[1] * green + by[2] * blue + by[3];
        rest = rest - weight * share;
        let by_alpha = transmittance * share - rest / (Bounded::ONE - alpha);
        let p = if counts { alpha * by_alpha } else { Bounded::ZERO };
        transmittance = transmittance - weight;
        let (px, py) = (p * dx, p * dy);
        parts.push([p, px, py, px * dx, px * dy, py * dy, weight * by[0], weight * by[1], weight * by[2]]);
    }
    Some(parts)
}

/// What a tile's pixels say of each splat of its list, 12 numbers each in the order of [`SplatGradient`]'s fields;
/// `None` where it depends on rounding.
pub fn blend_gradient(
    block: &TileBlock,
    list: &[u32],
    splats: &[ProjectedGaussian],
    colours: &[[f32; 4]],
    gradients: &[[f32; 4]],
    tile: u32,
) -> Vec<Option<Bounded>> {
    let side = SPLAT_TILE as u32;
    let (first_column, first_row) = (tile % block.tile_columns * side, tile / block.tile_columns * side);
    let rows = first_row..block.height.min(first_row + side);
    let pixels =
        rows.flat_map(|row| (first_column..block.width.min(first_column + side)).map(move |column| [column, row]));
    let parts: Option<Vec<Vec<Parts>>> = pixels
        .map(|[column, row]| {
            let pixel = (row * block.width + column) as usize;
            pixel_parts(list, splats, [column, row], colours[pixel], gradients[pixel])
        })
        .collect();
    let Some(parts) = parts else { return vec![None; 12 * list.len()] };
    let of_splat = |splat: usize| {
        let sum = |index: usize| {
            let summands = parts.iter().map(|pixel| pixel[splat][index]);
            let mut sum = Bounded::sum(summands.clone().map(|part| part.value));
            sum.error += summands.map(|part| part.error).sum::<f64>();
            Some(sum)
        };
        let zero = Some(Bounded::ZERO);
        [sum(0), sum(1), sum(2), zero, sum(3), sum(4), sum(5), zero, sum(6), sum(7), sum(8), zero]
    };
    (0..list.len()).flat_map(of_splat).collect()
}

/// The sum of what several tiles say of a splat, in the order of the fields that are no padding.
pub fn sums_of(parts: &[SplatGradient]) -> [Bounded; 9] {
    let numbers = |gradient: &SplatGradient| {
        let ([x, y], [xx, xy, yy], [red, green, blue]) = (gradient.along, gradient.squares, gradient.colour);
        [gradient.opacity, x, y, xx, xy, yy, red, green, blue]
    };
    [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|index| Bounded::sum(parts.iter().map(|part| f64::from(numbers(part)[index]))))
}

/// The derivative by a Gaussian's parameters, in the order of its fields; `None` where it depends on rounding.
pub fn project_gradient(
    block: &SplatBlock,
    gaussian: &GaussianBlock,
    splat: &ProjectedGaussian,
    sums: &[Bounded; 9],
) -> Option<[Bounded; 16]> {
    let (zero, camera) = (Bounded::ZERO, &block.camera);
    if splat.opacity <= 0.0 {
        return Some([zero; 16]);
    }
    let ellipse = Ellipse::of(gaussian, camera);
    let mut by_axes = by_axes(&ellipse, splat, sums);
    if block.is_antialiased != 0 {
        let [a, b, c] = splat.conic.map(Bounded::from);
        let [u, v] = ellipse.image_axes;
        let area = cross(u, v);
        let inverse = Bounded::ONE / dot(area, area);
        let by = [
            plus(scaled(cross(v, area), inverse), scaled(plus(scaled(u, a), scaled(v, b)), -Bounded::ONE)),
            plus(scaled(cross(area, u), inverse), scaled(plus(scaled(u, b), scaled(v, c)), -Bounded::ONE)),
        ];
        by_axes = [0, 1].map(|row| plus(by_axes[row], scaled(by[row], sums[0])));
    }
    let across = [0, 1, 2].map(|axis| {
        let [first, second] = [by_axes[0][axis], by_axes[1][axis]];
        let sum = plus(scaled(ellipse.jacobian[0], first), scaled(ellipse.jacobian[1], second));
        let by_scale = first * ellipse.image_axes[0][axis] + second * ellipse.image_axes[1][axis];
        (scaled(sum, ellipse.scales[axis]), by_scale)
    });
    let by_jacobian = [0, 1].map(|row: usize| {
        let part = |axis: usize| scaled(ellipse.axes[axis], by_axes[row][axis] * ellipse.scales[axis]);
        plus(plus(part(0), part(1)), part(2))
    });
    let [x, y, z] = by_place(&ellipse, camera, splat, sums, by_jacobian)?;
    let [right, down, forward] = camera_axes(camera);
    let position = plus(plus(scaled(right, x), scaled(down, y)), scaled(forward, z));
    let rotation = by_quaternion(&ellipse, across.map(|(by_axis, _)| by_axis));
    let odds = Bounded::from(gaussian.opacity).exp();
    let opacity = sums[0] * (Bounded::ONE - odds / (Bounded::ONE + odds));
    let scales = across.map(|(_, by_scale)| by_scale);
    let four = |[a, b, c]: Vector, last| [a, b, c, last];
    Some(joined([four(position, opacity), four(scales, zero), rotation, [sums[6], sums[7], sums[8], zero]]))
}

fn by_axes(ellipse: &Ellipse, splat: &ProjectedGaussian, sums: &[Bounded; 9]) -> [Vector; 2] {
    let [a, b, c] = splat.conic.map(Bounded::from);
    let half = Bounded::from(-0.5_f32);
    let [xx, xy, yy] = [half * sums[3], half * sums[4], half * sums[5]];
    let (left, middle) = (a * xx + b * xy, a * xy + b * yy);
    let (lower, last) = (b * xx + c * xy, b * xy + c * yy);
    let covariance = [-(left * a + middle * b), -(left * b + middle * c), -(lower * b + last * c)];
    let [right, down] = ellipse.image_axes;
    let product = |first: Bounded, second: Bounded| scaled(plus(scaled(right, first), scaled(down, second)), two());
    [product(covariance[0], covariance[1]), product(covariance[1], covariance[2])]
}

fn by_place(
    ellipse: &Ellipse,
    camera: &CameraBlock,
    splat: &ProjectedGaussian,
    sums: &[Bounded; 9],
    by_jacobian: [Vector; 2],
) -> Option<Vector> {
    let [focal_x, focal_y, ..] = camera.intrinsics.map(Bounded::from);
    let [a, b, c] = splat.conic.map(Bounded::from);
    let [x, y, z] = ellipse.place;
    let mut slopes = [(a * sums[1] + b * sums[2]) * focal_x, (b * sums[1] + c * sums[2]) * focal_y];
    let mut depth = -(slopes[0] * x + slopes[1] * y) / z / z;
    let [.., forward] = camera_axes(camera);
    depth = depth - (dot(by_jacobian[0], ellipse.jacobian[0]) + dot(by_jacobian[1], ellipse.jacobian[1])) / z;
    for (axis, focal) in [focal_x, focal_y].into_iter().enumerate() {
        if !ellipse.limited[axis]? {
            let by = -dot(by_jacobian[axis], forward) * (focal / z);
            slopes[axis] = slopes[axis] + by;
            depth = depth - by * ellipse.slopes[axis] / z;
        }
    }
    Some([slopes[0] / z, slopes[1] / z, depth])
}

fn by_quaternion(ellipse: &Ellipse, [first, second, third]: [Vector; 3]) -> [Bounded; 4] {
    let [w, x, y, z] = ellipse.unit;
    // The derivatives of the rotation's entries, by w, x, y and z.
    let by = [
        z * (first[1] - second[0]) + y * (third[0] - first[2]) + x * (second[2] - third[1]),
        y * (first[1] + second[0]) + z * (first[2] + third[0]) + w * (second[2] - third[1])
            - two() * x * (second[1] + third[2]),
        x * (first[1] + second[0]) + z * (second[2] + third[1]) + w * (third[0] - first[2])
            - two() * y * (first[0] + third[2]),
        x * (first[2] + third[0]) + y * (second[2] + third[1]) + w * (first[1] - second[0])
            - two() * z * (first[0] + second[1]),
    ];
    let along = by[0] * w + by[1] * x + by[2] * y + by[3] * z;
    let factor = two() / ellipse.length;
    [0, 1, 2, 3].map(|index| (by[index] - along * ellipse.unit[index]) * factor)
}
