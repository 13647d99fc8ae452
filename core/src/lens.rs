//! Lenses: where a point of the ideal (pinhole) image appears in a photograph taken through a real lens, and back.
//!
//! Points are in normalised coordinates: `x / z`, `y / z` of a point in camera coordinates (x right, y down, z
//! forward), so that the pixel is `focal * point + principal`. [`Lens::distort`] maps the ideal point to the
//! photograph's, [`Lens::undistort`] is its inverse. Two families cover the models of COLMAP, OpenCV and nerfstudio
//! (OpenCV's documentation, "Camera Calibration and 3D Reconstruction" and "Fisheye camera model"); a model with fewer
//! coefficients leaves the others 0:
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
//! One source serves `f32` ([`LensBlock`], for kernels and firmware) and `f64` ([`Lens`], for undistorting
//! photographs): the functions are generic over [`Real`].
//!
//! Limits: a lens's polynomials are fitted to its image and may fold over outside it. [`Undistorted::residual`] detects
//! a point that no ideal point maps to; [`Lens::reach`] is the radius up to which the map is one to one, but for what a
//! large tangential part does.

use crate::math;
use bytemuck::{Pod, Zeroable};
use core::fmt;
use core::ops::{Add, Div, Mul, Sub};

/// Steps of Newton's method at most. Lenses of cameras take 3 to 6 in either precision.
const MAX_STEPS: u32 = 24;
/// Halvings of a step that does not reduce the residual, at most.
const MAX_HALVINGS: u32 = 12;
/// Radius from which on a start for Newton's method is looked for. Nearer to the centre, points themselves will do.
const WIDE: f32 = 1.0;
/// Radii at which it is looked for.
const STARTS: u32 = 64;
/// Squared residual of a guess that has not converged.
const FAR_SQUARED: f32 = 1.0e-8;
/// Greatest magnitude of a coefficient: powers of eight of them stay finite in `f32`.
pub const MAX_COEFFICIENT: f64 = 1.0e4;
/// Coefficients `[k1, k2, k3, k4, k5, k6, p1, p2, q4]`; a fisheye ignores all but the first four.
pub type Coefficients<T> = [T; 9];
/// Largest angle from the principal axis that an ideal image holds, in radians: 89.9 degrees.
const WIDEST: f32 = 1.569_051;

/// A number type in which lenses are computed: `f32` or `f64`.
pub trait Real:
    Copy + PartialOrd + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The nearest value.
    fn of(value: f32) -> Self;
    /// Square root.
    fn root(self) -> Self;
    /// Arc tangent of a number of at least 0.
    fn arc_tangent(self) -> Self;
    /// Tangent of an angle in `[0, pi / 2)`.
    fn tangent(self) -> Self;
}

impl Real for f32 {
    #[inline]
    fn of(value: f32) -> f32 {
        value
    }
    #[inline]
    fn root(self) -> f32 {
        math::sqrt(self)
    }
    #[inline]
    fn arc_tangent(self) -> f32 {
        math::angle_from_components(self, 1.0)
    }
    #[inline]
    fn tangent(self) -> f32 {
        let (sin, cos) = math::sin_cos(self);
        sin / cos
    }
}

impl Real for f64 {
    #[inline]
    fn of(value: f32) -> f64 {
        value as f64
    }
    #[inline]
    fn root(self) -> f64 {
        math::sqrt_f64(self)
    }
    #[inline]
    fn arc_tangent(self) -> f64 {
        math::arc_tangent_f64(self)
    }
    #[inline]
    fn tangent(self) -> f64 {
        math::tangent_f64(self)
    }
}

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
    coefficients: Coefficients<f64>,
}

/// An ideal point and its residual.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Undistorted<T> {
    /// The ideal point, normalised.
    pub point: [T; 2],
    /// Distance between the given point and where the lens maps `point`, normalised (times the focal length: pixels).
    pub residual: T,
}

impl Lens {
    /// From its coefficients.
    ///
    /// # Errors
    /// [`LensError`] names the first one that is not usable.
    pub fn new(projection: Projection, coefficients: Coefficients<f64>) -> Result<Lens, LensError> {
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
    pub fn coefficients(&self) -> Coefficients<f64> {
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

    /// The ideal point that appears at a point of the photograph. Normalised coordinates.
    pub fn undistort(&self, point: [f64; 2]) -> Undistorted<f64> {
        undistort(self.projection == Projection::Fisheye, &self.coefficients, point)
    }

    /// Distance from the centre of the ideal image, normalised, up to which the radial part of the map grows, at most
    /// `most`, a finite number: beyond it an image folds over. Found in 4096 steps.
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

    /// The lens as plain data for kernels, in `f32`.
    pub fn block(&self) -> LensBlock {
        let c = self.coefficients;
        LensBlock {
            first: [c[0] as f32, c[1] as f32, c[2] as f32, c[3] as f32],
            second: [c[4] as f32, c[5] as f32, c[6] as f32, c[7] as f32],
            is_fisheye: (self.projection == Projection::Fisheye) as u32,
            fourth: c[8] as f32,
            padding: [0; 2],
        }
    }
}

/// A lens as plain data: what a kernel reads from a buffer. Made from a checked [`Lens`] by [`Lens::block`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LensBlock {
    /// `k1 k2 k3 k4`.
    pub first: [f32; 4],
    /// `k5 k6 p1 p2`; unused by a fisheye.
    pub second: [f32; 4],
    /// 1 for a fisheye, 0 for a perspective lens.
    pub is_fisheye: u32,
    /// `q4`; unused by a fisheye.
    pub fourth: f32,
    /// Zeros.
    pub padding: [u32; 2],
}

const _: () = assert!(size_of::<LensBlock>() == 48);

impl LensBlock {
    fn coefficients(&self) -> Coefficients<f32> {
        let (a, b) = (self.first, self.second);
        [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3], self.fourth]
    }

    /// Where an ideal point appears in the photograph. Normalised coordinates.
    #[inline]
    pub fn distort(&self, point: [f32; 2]) -> [f32; 2] {
        distort(self.is_fisheye != 0, &self.coefficients(), point)
    }

    /// The ideal point that appears at a point of the photograph. Normalised coordinates.
    #[inline]
    pub fn undistort(&self, point: [f32; 2]) -> Undistorted<f32> {
        undistort(self.is_fisheye != 0, &self.coefficients(), point)
    }
}

/// Where an ideal point appears in the photograph. Total: a denominator of 0 and points that are not finite give the
/// result of IEEE arithmetic.
#[inline]
pub fn distort<T: Real>(is_fisheye: bool, coefficients: &Coefficients<T>, point: [T; 2]) -> [T; 2] {
    let [x, y] = point;
    let squared = x * x + y * y;
    if is_fisheye {
        let radius = squared.root();
        // The centre is a fixed point: there the factor is 1.
        if !(radius > T::of(1.0e-12)) {
            return point;
        }
        let factor = bent(coefficients, radius.arc_tangent()) / radius;
        return [x * factor, y * factor];
    }
    let [k1, k2, k3, k4, k5, k6, p1, p2, q4] = *coefficients;
    let (one, two) = (T::of(1.0), T::of(2.0));
    let factor = (one + squared * (k1 + squared * (k2 + squared * (k3 + squared * q4))))
        / (one + squared * (k4 + squared * (k5 + squared * k6)));
    [
        x * factor + two * p1 * x * y + p2 * (squared + two * x * x),
        y * factor + p1 * (squared + two * y * y) + two * p2 * x * y,
    ]
}

/// A fisheye's radius at an angle from the principal axis.
#[inline]
fn bent<T: Real>(coefficients: &Coefficients<T>, angle: T) -> T {
    let s = angle * angle;
    let [k1, k2, k3, k4, ..] = *coefficients;
    angle * (T::of(1.0) + s * (k1 + s * (k2 + s * (k3 + s * k4))))
}

/// The slope of [`bent`].
#[inline]
fn bent_slope<T: Real>(coefficients: &Coefficients<T>, angle: T) -> T {
    let s = angle * angle;
    let [k1, k2, k3, k4, ..] = *coefficients;
    let (three, five, seven, nine) = (T::of(3.0), T::of(5.0), T::of(7.0), T::of(9.0));
    T::of(1.0) + s * (three * k1 + s * (five * k2 + s * (seven * k3 + s * nine * k4)))
}

/// A perspective lens's factor `g` at a squared radius, and its slope in the squared radius.
#[inline]
fn factor_and_slope<T: Real>(coefficients: &Coefficients<T>, squared: T) -> (T, T) {
    let [k1, k2, k3, k4, k5, k6, _, _, q4] = *coefficients;
    let (one, two, three, four) = (T::of(1.0), T::of(2.0), T::of(3.0), T::of(4.0));
    let above = one + squared * (k1 + squared * (k2 + squared * (k3 + squared * q4)));
    let below = one + squared * (k4 + squared * (k5 + squared * k6));
    let above_slope = k1 + squared * (two * k2 + squared * (three * k3 + squared * four * q4));
    let below_slope = k4 + squared * (two * k5 + squared * three * k6);
    (above / below, (above_slope * below - above * below_slope) / (below * below))
}

/// How fast the photograph's radius grows with the ideal one, without the tangential part; not positive where a
/// rational factor's denominator is not.
fn radial_slope(is_fisheye: bool, coefficients: &Coefficients<f64>, radius: f64) -> f64 {
    if is_fisheye {
        return bent_slope(coefficients, radius.arc_tangent());
    }
    let squared = radius * radius;
    let [_, _, _, k4, k5, k6, ..] = *coefficients;
    if !(1.0 + squared * (k4 + squared * (k5 + squared * k6)) > 0.0) {
        return 0.0;
    }
    let (factor, slope) = factor_and_slope(coefficients, squared);
    factor + 2.0 * squared * slope
}

/// The ideal point that appears at a point of the photograph: Newton's method, each step halved until it reduces the
/// residual, from the point itself, and beyond a radius of 1 from where the lens, seen from the centre, is about to reach
/// it; where that ends far from the point, once more from half of it. It ends if no step helps, after 24 steps at most.
/// Total: if no ideal point maps to the given one, or it is not finite, the residual is large or not finite.
///
/// Inside [`Lens::reach`] the residual is a few units in the last place of the point (below 1e-14 of its length or of 1
/// in `f64`, below 2e-6 of it in `f32`), but close to a fold, where the inverse has no slope, to a pole of a rational
/// factor, and at ideal radii above 3 of lenses that grow with the eighth power. A small residual does not say that the
/// point is inside: beyond a fold other ones map to the same.
#[inline]
pub fn undistort<T: Real>(is_fisheye: bool, coefficients: &Coefficients<T>, point: [T; 2]) -> Undistorted<T> {
    let guess = if is_fisheye { unbent(coefficients, point) } else { straightened(coefficients, point) };
    let miss = missed(is_fisheye, coefficients, guess, point);
    Undistorted { point: guess, residual: miss.root() }
}

/// Squared distance between a point and where the lens maps a guess.
#[inline]
fn missed<T: Real>(is_fisheye: bool, coefficients: &Coefficients<T>, guess: [T; 2], point: [T; 2]) -> T {
    let at = distort(is_fisheye, coefficients, guess);
    let (x, y) = (at[0] - point[0], at[1] - point[1]);
    x * x + y * y
}

/// Where Newton's method starts: the last of some radii up to `most` at which `value`, which rises from the centre to a
/// fold, is below `radius`.
#[inline]
fn start_of<T: Real>(radius: T, most: T, value: impl Fn(T) -> T) -> T {
    let zero = T::of(0.0);
    if !(radius > T::of(WIDE)) {
        return most;
    }
    let (mut start, mut before) = (zero, zero);
    let mut step = 1;
    while step <= STARTS {
        let at = most * T::of(step as f32 / STARTS as f32);
        let now = value(at);
        if now > before && now < radius {
            (start, before) = (at, now);
            step += 1;
        } else {
            step = STARTS + 1;
        }
    }
    start
}

/// Newton's method on a fisheye's angle.
#[inline]
fn unbent<T: Real>(coefficients: &Coefficients<T>, point: [T; 2]) -> [T; 2] {
    let zero = T::of(0.0);
    let radius = (point[0] * point[0] + point[1] * point[1]).root();
    if !(radius > T::of(1.0e-12)) {
        return point;
    }
    let widest = T::of(WIDEST);
    let most = if radius < widest { radius } else { widest };
    let mut angle = start_of(radius, if radius > T::of(WIDE) { widest } else { most }, |at| bent(coefficients, at));
    let mut miss = bent(coefficients, angle) - radius;
    let mut step = 0;
    while step < MAX_STEPS {
        let slope = bent_slope(coefficients, angle);
        // Beyond the fold: back towards the centre, where the slope is 1.
        let move_by = if slope > T::of(1.0e-3) { miss / slope } else { angle * T::of(0.5) };
        let mut share = T::of(1.0);
        let mut halving = 0;
        let mut moved = false;
        while halving < MAX_HALVINGS && !moved {
            let next = angle - share * move_by;
            let next = if next > widest { widest } else { next };
            let next = if next > zero { next } else { zero };
            let next_miss = bent(coefficients, next) - radius;
            if next_miss * next_miss < miss * miss {
                angle = next;
                miss = next_miss;
                moved = true;
            }
            share = share * T::of(0.5);
            halving += 1;
        }
        step = if moved { step + 1 } else { MAX_STEPS };
    }
    let factor = angle.tangent() / radius;
    [point[0] * factor, point[1] * factor]
}

/// A guess of Newton's method in the plane of a perspective lens.
#[derive(Clone, Copy)]
struct Guess<T> {
    point: [T; 2],
    /// The lens's factor there, and its slope in the squared radius.
    factor: [T; 2],
    /// From the given point to where the lens maps it.
    off: [T; 2],
    /// Squared length of that.
    miss: T,
    /// Whether the photograph's radius grows with the ideal one there, and the factor has no pole before: it is not
    /// beyond a fold.
    is_rising: bool,
}

impl<T: Real> Guess<T> {
    #[inline]
    fn at(coefficients: &Coefficients<T>, guess: [T; 2], point: [T; 2]) -> Guess<T> {
        let squared = guess[0] * guess[0] + guess[1] * guess[1];
        let (factor, slope) = factor_and_slope(coefficients, squared);
        let at = distort(false, coefficients, guess);
        let off = [at[0] - point[0], at[1] - point[1]];
        let [_, _, _, k4, k5, k6, ..] = *coefficients;
        let below = T::of(1.0) + squared * (k4 + squared * (k5 + squared * k6));
        let is_rising = below > T::of(0.0) && factor + T::of(2.0) * squared * slope > T::of(0.0);
        Guess { point: guess, factor: [factor, slope], off, miss: off[0] * off[0] + off[1] * off[1], is_rising }
    }
}

/// Newton's method in the plane of a perspective lens.
#[inline]
fn straightened<T: Real>(coefficients: &Coefficients<T>, point: [T; 2]) -> [T; 2] {
    let p1 = coefficients[6];
    let p2 = coefficients[7];
    let (zero, two, six) = (T::of(0.0), T::of(2.0), T::of(6.0));
    let radius = (point[0] * point[0] + point[1] * point[1]).root();
    let start = start_of(radius, radius, |at| at * factor_and_slope(coefficients, at * at).0);
    // Seen from the centre, the point is less than a radius beyond the start; a tangential part moves it a little.
    let (is_wide, end) = (start < radius, (start + radius * T::of(1.0 / STARTS as f32)) * T::of(1.5));
    let end = if is_wide { end * end } else { zero };
    let start = if start < radius { [point[0] * (start / radius), point[1] * (start / radius)] } else { point };
    let mut guess = Guess::at(coefficients, start, point);
    let mut given_up = None;
    let mut step = 0;
    while step < MAX_STEPS {
        let ([x, y], [factor, slope], [a, b]) = (guess.point, guess.factor, guess.off);
        // The Jacobian is symmetric.
        let xx = factor + two * x * x * slope + two * p1 * y + six * p2 * x;
        let xy = two * x * y * slope + two * p1 * x + two * p2 * y;
        let yy = factor + two * y * y * slope + six * p1 * y + two * p2 * x;
        let determinant = xx * yy - xy * xy;
        // Beyond the fold: back towards the centre, where the map is the identity.
        let (dx, dy) = if guess.is_rising && determinant > T::of(1.0e-6) {
            ((yy * a - xy * b) / determinant, (xx * b - xy * a) / determinant)
        } else {
            (x * T::of(0.5), y * T::of(0.5))
        };
        let mut share = T::of(1.0);
        let mut halving = 0;
        let mut moved = false;
        while halving < MAX_HALVINGS && !moved {
            let next = Guess::at(coefficients, [x - share * dx, y - share * dy], point);
            // No step leads beyond a fold, and from there any step back will do.
            let [x, y] = next.point;
            let is_inside = next.is_rising && !(is_wide && x * x + y * y > end);
            if !guess.is_rising || (is_inside && next.miss < guess.miss) {
                guess = next;
                moved = true;
            }
            share = share * T::of(0.5);
            halving += 1;
        }
        if !moved && given_up.is_none() && guess.miss > T::of(FAR_SQUARED) {
            // Just before a fold a step is so long that none of its shares helps: once more from nearer to the centre.
            given_up = Some(guess);
            guess = Guess::at(coefficients, [point[0] * T::of(0.5), point[1] * T::of(0.5)], point);
            moved = true;
        }
        step = if moved { step + 1 } else { MAX_STEPS };
    }
    match given_up {
        Some(first) if first.miss < guess.miss => first.point,
        _ => guess.point,
    }
}
