//! How bright and how coloured photographs are, and warnings where some are much darker than others, or grey, or all of
//! them nearly black.

use super::SourceImage;

/// Ratio of the brightness of two photographs, in linear light, from which on their exposures are warned of. Views of
/// one scene seldom differ by half of that; gains between sources are equalised up to 2 in stored values, which is
/// about 5.
const MAX_RATIO: f64 = 6.0;

/// Most by which the channels of grey pixels differ: what a lossy file rounds.
const MAX_GREY_SPREAD: f32 = 6.0 / 255.0;

/// Greatest value of photographs that are all nearly black: 14 bits in the place of 16 reach it, and errors are as
/// small as the values are, so that scores are too good.
const MAX_DARK: f32 = 0.26;

/// Brightness of a black photograph: half a step of 8 bits, in linear light.
const BLACK: f64 = 1.0e-6;

/// Fewest pixels from which a photograph's brightness is taken, unless it has fewer.
const MIN_SAMPLES: usize = 4096;

/// Exponent of stored values, about that of sRGB.
const GAMMA: f64 = 2.2;

/// Every so many pixels count, from the first on, row by row. A power takes most of the time, and a mean needs few; no
/// usual width is a multiple of it, which would leave columns out.
const STRIDE: usize = 13;

/// The mean of red, green and blue over what a photograph shows, in linear light; `None` if it shows nothing.
fn brightness(image: &SourceImage) -> Option<f64> {
    let (mut sum, mut opacity) = (0.0, 0.0);
    // Of the few pixels of a small picture all count.
    let stride = STRIDE.min(image.texels.len() / MIN_SAMPLES + 1);
    for [colours @ .., alpha] in image.texels.iter().step_by(stride).map(|texel| texel.map(f64::from)) {
        if alpha > 0.0 {
            sum += alpha * colours.map(|colour| (colour / alpha).max(0.0).powf(GAMMA)).iter().sum::<f64>() / 3.0;
            opacity += alpha;
        }
    }
    (opacity > 0.0).then(|| (sum / opacity).max(BLACK))
}

/// The greatest difference of the channels that a photograph shows.
fn greatest_colour(image: &SourceImage) -> f32 {
    let spread = |[red, green, blue, _]: &[f32; 4]| red.max(*green).max(*blue) - red.min(*green).min(*blue);
    image.texels.iter().map(spread).fold(0.0, f32::max)
}

/// A warning that names the first photograph without colours among others that have them; `names` in their order.
pub(super) fn grey_warning<'a>(images: &[SourceImage], names: impl Iterator<Item = &'a str>) -> Option<String> {
    let grey: Vec<&str> = images
        .iter()
        .zip(names)
        .filter(|(image, _)| brightness(image).is_some() && greatest_colour(image) <= MAX_GREY_SPREAD)
        .map(|(_, name)| name)
        .collect();
    (!grey.is_empty() && grey.len() < images.len()).then(|| {
        format!(
            "{} of {} photographs are grey ('{}' is the first) and the others in colour: pictures become partly grey; \
             exclude them",
            grey.len(),
            images.len(),
            grey[0]
        )
    })
}

/// A warning where no photograph has a bright pixel.
pub(super) fn dark_warning(images: &[SourceImage]) -> Option<String> {
    let brightest = |image: &SourceImage| {
        let colours = image.texels.iter().flat_map(|[red, green, blue, _]| [*red, *green, *blue]);
        colours.fold(0.0, f32::max)
    };
    let greatest = images.iter().map(brightest).fold(0.0, f32::max);
    (!images.is_empty() && greatest <= MAX_DARK).then(|| {
        format!(
            "no pixel of the photographs is brighter than {:.0} of 255: they are nearly black, and scores of their \
             pictures too good; 16-bit files whose values have fewer bits are read so, develop them to the whole range",
            255.0 * greatest
        )
    })
}

/// A warning that names the darkest and the brightest of photographs, if they are far apart; `names` in their order.
pub(super) fn warning<'a>(images: &[SourceImage], names: impl Iterator<Item = &'a str>) -> Option<String> {
    let known: Vec<(f64, &str)> =
        images.iter().zip(names).filter_map(|(image, name)| Some((brightness(image)?, name))).collect();
    let darkest = known.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let brightest = known.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let ratio = brightest.0 / darkest.0;
    (ratio > MAX_RATIO).then(|| {
        format!(
            "photograph '{}' is {ratio:.0} times as bright as '{}' (the mean, in linear light): with other exposures \
             surfaces are not recognised and pictures become patchy; develop all photographs with one exposure",
            brightest.1, darkest.1
        )
    })
}
