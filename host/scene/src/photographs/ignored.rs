//! Pixels of a photograph that do not count: by an ignore mask, or by an alpha channel that is one.

use crate::scene::masks::has_alpha;
use crate::{MaskChoice, MaskMeaning, Photograph, Scene, SceneError};
use image::{GrayImage, Luma};

/// Alpha from which on a pixel counts.
const HALF: u8 = 128;
/// Share of the border that is opaque from which on an alpha channel shows no object.
const MAX_OBJECT_BORDER: f32 = 0.5;

/// How much of a photograph's border is opaque.
pub(super) fn border_share(photograph: &Photograph) -> f32 {
    let (width, height) = photograph.pixels.dimensions();
    let at_border = |x: u32, y: u32| x == 0 || y == 0 || x + 1 == width || y + 1 == height;
    let border = photograph.pixels.enumerate_pixels().filter(|(x, y, _)| at_border(*x, *y));
    let (opaque, count) =
        border.fold((0, 0), |(opaque, count), (_, _, pixel)| (opaque + u32::from(pixel[3] >= HALF), count + 1));
    opaque as f32 / count.max(1) as f32
}

/// Whether alpha channels with these shares of their borders say which pixels do not count: an object is seldom cut off
/// by most of the border.
pub(super) fn is_of_ignored(mut shares: Vec<f32>) -> bool {
    shares.sort_by(f32::total_cmp);
    shares.get(shares.len() / 2).is_some_and(|share| *share > MAX_OBJECT_BORDER)
}

/// Whether the alpha channels of a scene's photographs say where the object is: all together, as those of sources do,
/// since the object may be cut off by most of the border of a single one.
pub(crate) fn shows_object(scene: &Scene) -> Result<bool, SceneError> {
    if !matches!(scene.mask_choice, MaskChoice::Auto | MaskChoice::Object) {
        return Ok(false);
    }
    let mut shares = Vec::new();
    for (index, view) in scene.views.iter().enumerate() {
        if view.image.as_deref().is_some_and(has_alpha) && !scene.has_object_mask(view) {
            let photograph = scene.photograph(index)?;
            if photograph.has_alpha && scene.mask_choice == MaskChoice::Object {
                return Ok(true);
            }
            shares.extend(photograph.has_alpha.then(|| border_share(&photograph)));
        }
    }
    Ok(!shares.is_empty() && !is_of_ignored(shares))
}

impl Scene {
    /// The scene with whole photographs: neither masks nor alpha channels say where an object is. What does not count
    /// does not here either.
    ///
    /// # Errors
    /// [`SceneError`] if a photograph with an alpha channel cannot be read.
    pub fn without_silhouettes(&self) -> Result<Scene, SceneError> {
        let mut scene = self.clone();
        if scene.masks == MaskMeaning::Object {
            scene.views.iter_mut().for_each(|view| view.mask = None);
        }
        if shows_object(&scene)? {
            scene.mask_choice = MaskChoice::None;
        }
        Ok(scene)
    }

    /// The scene in which alpha channels that say where the object is do so in each photograph by itself, also in one
    /// whose border the object fills.
    ///
    /// # Errors
    /// [`SceneError`] if a photograph with an alpha channel cannot be read.
    pub fn with_silhouettes(&self) -> Result<Scene, SceneError> {
        let mask_choice = match self.mask_choice {
            _ if shows_object(self)? => MaskChoice::Object,
            // Nor does a single one say it that is transparent at most of its border.
            MaskChoice::Auto => MaskChoice::Ignore,
            given => given,
        };
        Ok(Scene { mask_choice, ..self.clone() })
    }
}

/// The whole photograph, of which what is transparent does not count.
pub(super) fn by_alpha(photograph: Photograph) -> Photograph {
    let counts = |x: u32, y: u32| {
        let is_seen = photograph.seen.as_ref().is_none_or(|seen| seen.get_pixel(x, y)[0] > 0);
        is_seen && photograph.pixels.get_pixel(x, y)[3] >= HALF
    };
    let (width, height) = photograph.pixels.dimensions();
    let seen = GrayImage::from_fn(width, height, |x, y| Luma([if counts(x, y) { u8::MAX } else { 0 }]));
    Photograph { seen: seen.as_raw().contains(&0).then_some(seen), ..photograph.without_alpha() }
}

/// The photograph with the nearest pixel of the row that counts in the place of those that do not; where none of the
/// row does, with the nearest row. So they are background before a background, and part of an object inside of it.
pub(super) fn filled(mut photograph: Photograph) -> Photograph {
    let Some(seen) = &photograph.seen else { return photograph };
    let (width, height) = photograph.pixels.dimensions();
    let mut rows = Vec::new();
    for y in 0..height {
        let known: Vec<u32> = (0..width).filter(|x| seen.get_pixel(*x, y)[0] > 0).collect();
        let (Some(&first), Some(&last)) = (known.first(), known.last()) else { continue };
        rows.push(y);
        for x in (0..width).filter(|_| known.len() < width as usize) {
            let after = known.partition_point(|other| *other < x);
            let (left, right) = (*known[..after].last().unwrap_or(&first), *known.get(after).unwrap_or(&last));
            let nearest = if left.abs_diff(x) <= right.abs_diff(x) { left } else { right };
            if seen.get_pixel(x, y)[0] == 0 {
                photograph.pixels.put_pixel(x, y, *photograph.pixels.get_pixel(nearest, y));
            }
        }
    }
    for y in (0..height).filter(|y| rows.binary_search(y).is_err()) {
        let Some(nearest) = rows.iter().min_by_key(|other| other.abs_diff(y)) else { break };
        for x in 0..width {
            photograph.pixels.put_pixel(x, y, *photograph.pixels.get_pixel(x, *nearest));
        }
    }
    photograph
}
