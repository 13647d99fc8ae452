//! Silhouettes: the separation of a photograph into object and background.
//!
//! A photograph's alpha channel is used if it has one. Otherwise the background is the region that is connected to the
//! image's border and near to one colour (given, or the median of the border's pixels), so that dark parts inside an
//! object on black stay part of it; pixels on the edge of the object get a fractional alpha from the colours around
//! them.

use crate::Photograph;
use crate::scene::masks::meaning::flood;
use std::fmt;
use std::str::FromStr;
use viewfuse_job::medians::upper_median;

/// Least and greatest threshold on the distance from the background colour, and its ratio to the border's noise.
const THRESHOLD: (f32, f32) = (0.03, 0.12);
const NOISE_FACTOR: f32 = 1.5;
/// The noise of a border is this quantile of its pixels' distances from its colour.
const NOISE_SHARE: f64 = 0.95;
/// Rows and columns that make up the border.
const BORDER: u32 = 2;
/// Reach, in pixels, of the search for solid neighbours of an edge pixel.
const EDGE_REACH: i64 = 2;
/// Least alpha of an edge pixel that the flood did not reach.
const MIN_EDGE_ALPHA: f32 = 0.05;

/// The choice of the background.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum BackgroundChoice {
    /// From the borders of the photographs; white behind photographs with an alpha channel.
    #[default]
    Auto,
    /// This colour, red green blue in `[0, 1]`.
    Colour([f32; 3]),
    /// Nothing is background: photographs of whole scenes.
    None,
}

/// The text is not a background.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown background '{0}'; the choices are auto, none, black, white, and RED,GREEN,BLUE with whole numbers from 0 \
        to 255"
)]
pub struct BackgroundError(String);

impl FromStr for BackgroundChoice {
    type Err = BackgroundError;

    fn from_str(text: &str) -> Result<BackgroundChoice, BackgroundError> {
        match text {
            "auto" => return Ok(BackgroundChoice::Auto),
            "none" => return Ok(BackgroundChoice::None),
            "black" => return Ok(BackgroundChoice::Colour([0.0; 3])),
            "white" => return Ok(BackgroundChoice::Colour([1.0; 3])),
            _ => {}
        }
        let levels: Vec<u8> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
        match (levels.as_slice(), text.split(',').count()) {
            (&[r, g, b], 3) => Ok(BackgroundChoice::Colour([r, g, b].map(|level| f32::from(level) / 255.0))),
            _ => Err(BackgroundError(text.to_owned())),
        }
    }
}

impl fmt::Display for BackgroundChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BackgroundChoice::Auto => f.write_str("auto"),
            BackgroundChoice::None => f.write_str("none"),
            BackgroundChoice::Colour(colour) => {
                let [r, g, b] = colour.map(|value| (value * 255.0).round() as u8);
                write!(f, "{r},{g},{b}")
            }
        }
    }
}

/// The border of a photograph: its colour and the deviation of its pixels from that colour.
pub(super) struct Border {
    colour: [f32; 3],
    noise: f32,
}

impl Border {
    /// `None` for a photograph whose alpha channel says what is background.
    pub(super) fn of(photograph: &Photograph, choice: BackgroundChoice) -> Option<Border> {
        let given = match choice {
            BackgroundChoice::Colour(colour) => Some(colour),
            BackgroundChoice::Auto | BackgroundChoice::None => None,
        };
        (!photograph.has_alpha).then(|| look_at_border(photograph, given))
    }
}

/// The background of all photographs of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Backdrop {
    /// Red, green, blue in `[0, 1]`.
    pub(super) colour: [f32; 3],
    /// Pixels nearer to their background's colour than this can be background.
    threshold: f32,
    /// Whether each photograph's own border colour is its background.
    from_border: bool,
    /// The deviation of the typical border from one colour.
    noise: f32,
}

/// The largest deviation of the typical border from one colour with which an object can be separated, of 255.
pub(super) const MAX_NOISE_LEVEL: f32 = THRESHOLD.1 / NOISE_FACTOR * 255.0;

impl Backdrop {
    /// Estimates the background from the borders of all photographs: the colour is their median, and the threshold is
    /// proportional to the median noise.
    pub(super) fn of<'a>(borders: impl Iterator<Item = &'a Border>, choice: BackgroundChoice) -> Backdrop {
        let borders: Vec<&Border> = borders.collect();
        let median_colour = || [0, 1, 2].map(|channel| median(borders.iter().map(|border| border.colour[channel])));
        let (colour, from_border) = match choice {
            BackgroundChoice::Colour(colour) => (colour, false),
            _ if borders.is_empty() => ([1.0; 3], false),
            BackgroundChoice::Auto | BackgroundChoice::None => (median_colour(), true),
        };
        let noise = median(borders.iter().map(|border| border.noise));
        Backdrop { colour, threshold: (NOISE_FACTOR * noise).clamp(THRESHOLD.0, THRESHOLD.1), from_border, noise }
    }

    /// Whether an object can be separated from it: the noise of the borders is small enough for a threshold.
    pub(super) fn can_be_told(&self) -> bool {
        NOISE_FACTOR * self.noise <= THRESHOLD.1
    }
}

impl fmt::Display for Backdrop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.colour.map(|value| (value * 255.0).round() as u8);
        write!(f, "colour {r},{g},{b} to within {:.0} of 255", self.threshold * 255.0)
    }
}

/// The photograph as premultiplied RGBA with the background's share removed; `border` is its own, `None` where its
/// alpha channel says what is background.
pub(super) fn premultiplied(photograph: &Photograph, border: Option<&Border>, backdrop: &Backdrop) -> Vec<[f32; 4]> {
    let Some(border) = border else {
        return photograph.pixels.pixels().map(|pixel| premultiplied_by_alpha(pixel.0)).collect();
    };
    let behind = if backdrop.from_border { border.colour } else { backdrop.colour };
    let alphas = silhouette(photograph, behind, backdrop.threshold);
    photograph
        .pixels
        .pixels()
        .zip(alphas)
        .map(|(pixel, alpha)| {
            let colour = colour_of(pixel);
            let [r, g, b] = [0, 1, 2].map(|c| (colour[c] - (1.0 - alpha) * behind[c]).clamp(0.0, alpha));
            [r, g, b, alpha]
        })
        .collect()
}

/// A pixel as premultiplied RGBA.
#[inline(always)]
pub(super) fn premultiplied_by_alpha(pixel: [u8; 4]) -> [f32; 4] {
    let [r, g, b, alpha] = pixel.map(|level| f32::from(level) / 255.0);
    [r * alpha, g * alpha, b * alpha, alpha]
}

/// The photograph over a background, alpha 1 everywhere.
pub(super) fn laid_over(photograph: &Photograph, background: [f32; 3]) -> Vec<[f32; 4]> {
    let over = |pixel: &image::Rgba<u8>| {
        let alpha = f32::from(pixel[3]) / 255.0;
        let colour = colour_of(pixel);
        let [r, g, b] = [0, 1, 2].map(|c| colour[c] * alpha + background[c] * (1.0 - alpha));
        [r, g, b, 1.0]
    };
    photograph.pixels.pixels().map(over).collect()
}

/// Colour of a photograph's border (the median of each channel, unless given) and its noise around it.
fn look_at_border(photograph: &Photograph, given: Option<[f32; 3]>) -> Border {
    let (width, height) = photograph.pixels.dimensions();
    let at_border = |x: u32, y: u32| x < BORDER || y < BORDER || x + BORDER >= width || y + BORDER >= height;
    let pixels: Vec<[f32; 3]> = photograph
        .pixels
        .enumerate_pixels()
        .filter(|(x, y, _)| at_border(*x, *y))
        .map(|(_, _, pixel)| colour_of(pixel))
        .collect();
    let colour = given.unwrap_or_else(|| [0, 1, 2].map(|channel| median(pixels.iter().map(|pixel| pixel[channel]))));
    let mut distances: Vec<f32> = pixels.iter().map(|pixel| distance(*pixel, colour)).collect();
    distances.sort_by(f32::total_cmp);
    let noise = distances[((distances.len() as f64 * NOISE_SHARE) as usize).min(distances.len() - 1)];
    Border { colour, noise }
}

/// Alpha of every pixel: 0 for background, 1 inside the object, fractions on its edge.
fn silhouette(photograph: &Photograph, behind: [f32; 3], threshold: f32) -> Vec<f32> {
    let (width, height) = photograph.pixels.dimensions();
    let (width, height) = (i64::from(width), i64::from(height));
    let colours: Vec<[f32; 3]> = photograph.pixels.pixels().map(colour_of).collect();
    let is_near = |at: usize| distance(colours[at], behind) < threshold;

    let at_border = |at: &usize| {
        let (x, y) = (*at as i64 % width, *at as i64 / width);
        x == 0 || y == 0 || x == width - 1 || y == height - 1
    };
    let mut background = vec![false; colours.len()];
    flood((0..colours.len()).filter(at_border), [width as usize, height as usize], |at| {
        let is_new = !background[at] && is_near(at);
        background[at] |= is_new;
        is_new
    });

    // A pixel of the object next to the background may be a mixture of both: project its colour on the line from the
    // background's to that of the solid pixels nearby.
    let around = |at: usize, reach: i64| {
        let (x, y) = (at as i64 % width, at as i64 / width);
        let (rows, columns) =
            ((y - reach).max(0)..=(y + reach).min(height - 1), (x - reach).max(0)..=(x + reach).min(width - 1));
        rows.flat_map(move |j| {
            columns.clone().map(move |i| ((j * width + i) as usize, ((i - x).pow(2) + (j - y).pow(2)) as f32))
        })
    };
    let solid: Vec<bool> =
        (0..colours.len()).map(|at| !background[at] && around(at, 1).all(|(near, _)| !background[near])).collect();
    (0..colours.len())
        .map(|at| {
            if background[at] {
                return 0.0;
            }
            if solid[at] {
                return 1.0;
            }
            let (mut sum, mut share_sum) = ([0.0; 3], 0.0);
            for (near, squared_distance) in around(at, EDGE_REACH).filter(|(near, _)| solid[*near]) {
                let share = 1.0 / squared_distance;
                share_sum += share;
                for channel in 0..3 {
                    sum[channel] += share * colours[near][channel];
                }
            }
            if share_sum == 0.0 {
                return 1.0;
            }
            let (mut along, mut length) = (0.0, 1e-6);
            for channel in 0..3 {
                let contrast = sum[channel] / share_sum - behind[channel];
                along += contrast * (colours[at][channel] - behind[channel]);
                length += contrast * contrast;
            }
            (along / length).clamp(MIN_EDGE_ALPHA, 1.0)
        })
        .collect()
}

fn colour_of(pixel: &image::Rgba<u8>) -> [f32; 3] {
    [pixel[0], pixel[1], pixel[2]].map(|level| f32::from(level) / 255.0)
}

/// Largest difference of a channel.
fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs()).max((a[2] - b[2]).abs())
}

/// The upper median; 0 of nothing.
fn median(values: impl Iterator<Item = f32>) -> f32 {
    upper_median(values, f32::total_cmp).unwrap_or(0.0)
}
