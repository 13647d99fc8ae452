//! Lenses: where a point of the ideal (pinhole) image appears in a photograph taken through a real lens.
//!
//! Points are in normalised coordinates: `x / z`, `y / z` of a point in camera coordinates (x right, y down, z
//! forward), so that the pixel is `focal * point + principal`. [`Lens::distort`] maps the ideal point to the
//! photograph's. Two families cover the models of COLMAP, OpenCV and nerfstudio (OpenCV's documentation, "Camera
//! Calibration and 3D Reconstruction" and "Fisheye camera model"); a model with fewer coefficients leaves the others 0:
//!
//! ```text
//! perspective   r2 = x^2 + y^2,  g = (1 + k1 r2 + k2 r2^2 + k3 r2^3 + q4 r2^4) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
//!               x' = g x + 2 p1 x y + p2 (r2 + 2 x^2)        SIMPLE_RADIAL (k1), RADIAL (k1 k2), OPENCV (k1 k2 p1 p2),
//!               y' = g y + p1 (r2 + 2 y^2) + 2 p2 x y        FULL_OPENCV (k1 .. k6 p1 p2)
//! fisheye       a = atan(r),  a' = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8)
//!               (x', y') = (x, y) a' / r                     SIMPLE_RADIAL_FISHEYE (k1), RADIAL_FISHEYE (k1 k2),
//!                                                            OPENCV_FISHEYE (k1 .. k4)
//! ```
//!
//! nerfstudio and Metashape call `q4` their k4: their polynomial goes on where OpenCV's has a denominator.
//!
//! Limits: a lens's polynomials are fitted to its image and may fold over outside it; [`Lens::reach`] is the radius up
//! to which the map is one to one.

use crate::math;
use core::fmt;

/// Greatest magnitude of a coefficient.
pub const MAX_COEFFICIENT: f64 = 1.0e4;
/// Coefficients `[k1, k2, k3, k4, k5, k6, p1, p2, q4]`; a fisheye ignores all but the first four.
pub type Coefficients = [f64; 9];

/// How a lens maps angles to radii before its own distortion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Projection {
    /// The tangent of the angle: straight lines stay straight.
    Perspective,
    /// The angle itself (equidistant).
    Fisheye,
}

/// Why coefficients are not a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LensError {
    /// The coefficient with this index is not finite, or larger than [`MAX_COEFFICIENT`].
    Coefficient(usize),
}

impl fmt::Display for LensError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let LensError::Coefficient(index) = self;
        let name = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "k4 (of r^8)"].get(*index).copied().unwrap_or("?");
        write!(f, "the lens's coefficient {name} is not a number of at most {MAX_COEFFICIENT:e}")
    }
}

impl core::error::Error for LensError {}

/// A lens, checked when built.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Lens {
    projection: Projection,
    coefficients: Coefficients,
}

impl Lens {
    /// From its coefficients.
    ///
    /// # Errors
    /// [`LensError`] names the first one that is not usable.
    pub fn new(projection: Projection, coefficients: Coefficients) -> Result<Lens, LensError> {
        let mut index = 0;
        while index < coefficients.len() {
            let value = coefficients[index];
            if !(-MAX_COEFFICIENT..=MAX_COEFFICIENT).contains(&value) {
                return Err(LensError::Coefficient(index));
            }
            index += 1;
        }
        Ok(Lens { projection, coefficients })
    }

    /// How angles become radii.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Its coefficients.
    pub fn coefficients(&self) -> Coefficients {
        self.coefficients
    }

    /// Whether the lens changes nothing: it is a pinhole.
    pub fn is_pinhole(&self) -> bool {
        self.projection == Projection::Perspective && self.coefficients == [0.0; 9]
    }

    /// Where an ideal point appears in the photograph. Normalised coordinates.
    pub fn distort(&self, point: [f64; 2]) -> [f64; 2] {
        distort(self.projection == Projection::Fisheye, &self.coefficients, point)
    }

    /// Distance from the centre of the ideal image, normalised, up to which the radial part of the map grows, at most
    /// `most`: beyond it an image folds over. Found in 4096 steps.
    pub fn reach(&self, most: f64) -> f64 {
        let is_fisheye = self.projection == Projection::Fisheye;
        let mut step = 1;
        while step <= 4096 {
            let radius = most * step as f64 / 4096.0;
            if !(radial_slope(is_fisheye, &self.coefficients, radius) > 0.0) {
                return most * (step - 1) as f64 / 4096.0;
            }
            step += 1;
        }
        most
    }
}

/// Where an ideal point appears in the photograph. Total: a denominator of 0 and points that are not finite give the
/// result of IEEE arithmetic.
#[inline]
pub fn distort(is_fisheye: bool, coefficients: &Coefficients, point: [f64; 2]) -> [f64; 2] {
    let [x, y] = point;
    let squared = x * x + y * y;
    let [k1, k2, k3, k4, k5, k6, p1, p2, q4] = *coefficients;
    if is_fisheye {
        let radius = math::sqrt_f64(squared);
        // The centre is a fixed point: there the factor is 1.
        if !(radius > 1.0e-12) {
            return point;
        }
        let angle = math::arc_tangent_f64(radius);
        let s = angle * angle;
        let factor = angle * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))) / radius;
        return [x * factor, y * factor];
    }
    let factor = (1.0 + squared * (k1 + squared * (k2 + squared * (k3 + squared * q4))))
        / (1.0 + squared * (k4 + squared * (k5 + squared * k6)));
    [
        x * factor + 2.0 * p1 * x * y + p2 * (squared + 2.0 * x * x),
        y * factor + p1 * (squared + 2.0 * y * y) + 2.0 * p2 * x * y,
    ]
}

/// How fast the photograph's radius grows with the ideal one, without the tangential part; not positive where a
/// rational factor's denominator is not.
fn radial_slope(is_fisheye: bool, coefficients: &Coefficients, radius: f64) -> f64 {
    let [k1, k2, k3, k4, k5, k6, _, _, q4] = *coefficients;
    if is_fisheye {
        let angle = math::arc_tangent_f64(radius);
        let s = angle * angle;
        return 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)));
    }
    let squared = radius * radius;
    let below = 1.0 + squared * (k4 + squared * (k5 + squared * k6));
    if !(below > 0.0) {
        return 0.0;
    }
    let above = 1.0 + squared * (k1 + squared * (k2 + squared * (k3 + squared * q4)));
    let above_slope = k1 + squared * (2.0 * k2 + squared * (3.0 * k3 + squared * 4.0 * q4));
    let below_slope = k4 + squared * (2.0 * k5 + squared * 3.0 * k6);
    above / below + 2.0 * squared * ((above_slope * below - above * below_slope) / (below * below))
}
