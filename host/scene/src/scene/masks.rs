//! Masks: images that state which pixels of the photographs count, or where the object is ([`meaning`]).
//!
//! A mask is 0 where the photograph does not count and has the greatest value where it does: in NeuS's data objects are
//! white on black, in COLMAP's and nerfstudio's ignored pixels are black. Some programs write 1 or 128 for the greatest value, or a
//! colour.
//! Values between are fractions of a pixel of an object; of an ignore mask, pixels count from half of the greatest on.
//! instant-ngp's `dynamic_mask_NAME.png` beside the photograph is inverted: 0 where it counts. A mask has the
//! photograph's size, or another of the same shape; of a photograph that carries an orientation (EXIF), it may be a
//! mask of the stored or of the upright picture.
//!
//! A layout may name masks itself. Otherwise they are searched in a folder `mask` or `masks` in the scene, beside the
//! photograph's folder or one above it: `images/left/1.jpg` has `masks/left/1.jpg.png` (COLMAP) or `masks/left/1.png`
//! (nerfstudio), or one of another extension, or with `_mask` behind the name.

pub(crate) mod meaning;

use std::path::{Path, PathBuf};

use image::imageops::{FilterType, resize};
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, Luma, Rgb};

use super::Photograph;
use super::View;
use super::check::same_shape;
use super::error::{SceneError, SceneFault};
use super::fault::{FilePlace, ImageFault};
use super::files::{self, IMAGE_EXTENSIONS};
use super::images::{self, Turn};
use meaning::MaskMeaning;

const FOLDERS: [&str; 2] = ["mask", "masks"];

/// What the names of instant-ngp's masks begin with.
const INVERTED: &str = "dynamic_mask_";

/// Below this level all of a compressed mask is black.
const MIN_LOSSY: u8 = 32;
/// Most by which the channels of a grey pixel differ: compression changes them by less.
const MAX_GREY_SPREAD: u8 = 48;

/// From this share of the greatest level on a pixel counts, of 255.
const HALF: u8 = 128;

/// Gives views without a mask the one in a folder of masks or beside the photograph; `root` is the scene's folder or a
/// file in it. The warning counts photographs without a mask if others have one, or tells of pictures that seem to be
/// masks and fit none.
pub(super) fn find(root: &Path, views: &mut [View]) -> Option<String> {
    let root = if root.is_dir() { root } else { root.parent()? };
    // Two photographs of one name in two folders may not share a mask.
    let mut taken: std::collections::HashSet<PathBuf> = views.iter().filter_map(|view| view.mask.clone()).collect();
    for view in views.iter_mut().filter(|view| view.mask.is_none()) {
        let mask = view.image.as_deref().and_then(|image| beside(root, image).or_else(|| dynamic(image)));
        view.mask = mask.filter(|mask| taken.insert(mask.clone()));
    }
    let photographs = || views.iter().filter(|view| view.image.is_some());
    let mut without = photographs().filter(|view| view.mask.is_none());
    let first = without.next()?.image.as_deref()?;
    let (without, all) = (1 + without.count(), photographs().count());
    let first = files::exact(first.file_name().unwrap_or_default());
    if without == all {
        return unmatched(root, views);
    }
    Some(format!("{}: {without} of {all} photographs have no mask, {first} the first", root.display()))
}

/// Where the masks of most photographs say where the object is, those of the others are wanting: they are no photographs
/// of it, neither as sources nor to compare with, but those that say it in their alpha channel. The warning counts them.
pub(super) fn exclude_unmasked(root: &Path, views: &mut [View]) -> Option<String> {
    let photographs = || views.iter().filter(|view| view.image.is_some());
    let (masked, all) = (photographs().filter(|view| view.mask.is_some()).count(), photographs().count());
    if 2 * masked < all {
        return None;
    }
    let says_nothing =
        |view: &&mut View| view.mask.is_none() && view.image.as_deref().is_some_and(|file| !has_alpha(file));
    let excluded: Vec<PathBuf> = views.iter_mut().filter(says_nothing).filter_map(|view| view.image.take()).collect();
    let first = files::exact(excluded.first()?.file_name().unwrap_or_default());
    Some(format!(
        "{}: {} of {all} photographs are excluded ({first} is the first): they have no mask, and those of the others say \
         where the object is",
        root.display(),
        excluded.len()
    ))
}

/// Whether a photograph's file has an alpha channel. The error of one that cannot be read comes with its pixels.
pub(crate) fn has_alpha(file: &Path) -> bool {
    images::header(file).is_ok_and(|header| header.has_alpha)
}

/// A warning where a folder of masks has pictures, and none of them is named as a photograph.
fn unmatched(root: &Path, views: &[View]) -> Option<String> {
    let files = || views.iter().filter_map(|view| view.image.as_deref());
    let mut folders: Vec<&Path> = files().filter_map(Path::parent).collect();
    folders.push(root);
    folders.sort_unstable();
    folders.dedup();
    let of_masks = folders.iter().flat_map(|folder| FOLDERS.map(|masks| folder.join(masks)));
    let is_of_photographs = |folder: &PathBuf| files().any(|file| file.starts_with(folder));
    for folder in of_masks.filter(|folder| !is_of_photographs(folder)) {
        let entries = folder.read_dir().into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let mut pictures: Vec<PathBuf> = entries.filter(|path| files::has_extension(path, &IMAGE_EXTENSIONS)).collect();
        pictures.sort_unstable();
        if let Some(first) = pictures.first() {
            let (count, first) = (pictures.len(), files::exact(first.file_name().unwrap_or_default()));
            let photograph = files::exact(files().next()?.file_name().unwrap_or_default());
            return Some(format!(
                "{}: {count} pictures are no masks of any photograph: {first} would be the mask of {photograph} if it \
                 were called so, or with _mask behind the name",
                folder.display()
            ));
        }
    }
    None
}

/// instant-ngp's mask of a photograph, if there is one.
fn dynamic(image: &Path) -> Option<PathBuf> {
    let names = [image.file_stem()?, image.file_name()?];
    let masks = names.map(|name| image.with_file_name(format!("{INVERTED}{}.png", name.to_string_lossy())));
    masks.into_iter().find(|mask| mask.is_file())
}

/// Whether a mask is 0 where its photograph counts.
fn is_inverted(mask: &Path) -> bool {
    mask.file_name().is_some_and(|name| name.to_string_lossy().starts_with(INVERTED))
}

/// The mask of a photograph, if there is one.
fn beside(root: &Path, image: &Path) -> Option<PathBuf> {
    for folder in image.ancestors().skip(1).take_while(|folder| folder.starts_with(root)) {
        let inside = image.strip_prefix(folder).ok()?;
        // `images/left/1.jpg` is `left/1.jpg` in `masks`; `1.jpg` beside `masks` is `1.jpg`.
        let without_first: PathBuf = inside.components().skip(1).collect();
        let names = [without_first.as_path(), inside];
        for name in names.into_iter().filter(|name| !name.as_os_str().is_empty()) {
            for masks in FOLDERS.map(|masks| folder.join(masks)).into_iter().filter(|masks| masks.is_dir()) {
                let appended = |extension: &&str| files::appended(&masks.join(name), extension);
                let replaced = |extension: &&str| masks.join(name).with_extension(extension);
                let marked = |extension: &&str| {
                    let stem = name.file_stem().unwrap_or_default().to_string_lossy();
                    masks.join(name).with_file_name(format!("{stem}_mask.{extension}"))
                };
                let all = || IMAGE_EXTENSIONS.iter();
                let mut candidates = all().map(appended).chain(all().map(replaced)).chain(all().map(marked));
                if let Some(mask) = candidates.find(|mask| mask.is_file()) {
                    return Some(mask);
                }
            }
        }
    }
    None
}

/// A mask at its own size, turned like the pixels of its photograph in memory: 255 where they count. Of an object's
/// mask values between are fractions; of an ignore mask there are none.
///
/// A mask with an orientation of its own is turned by it if it then has the upright photograph's shape. Otherwise its
/// stored size decides whether it is a mask of the stored or of the upright photograph.
///
/// # Errors
/// [`SceneError`] if it cannot be decoded or does not have the photograph's shape.
pub(super) fn read(path: &Path, photograph: &Turn, meaning: MaskMeaning) -> Result<GrayImage, SceneError> {
    let (mut decoded, stated) = images::pixels(path)?;
    let stored = [decoded.width(), decoded.height()];
    let Turn { orientation, is_applied, .. } = *photograph;
    let is_turned = stated != Orientation::NoTransforms;
    let is_upright = if is_turned && same_shape(images::turned(stored, stated), photograph.upright()) {
        decoded.apply_orientation(stated);
        true
    } else {
        // Of photographs with an orientation not both: those that have one shape either way are refused.
        match (same_shape(stored, photograph.upright()), same_shape(stored, photograph.stored)) {
            (false, false) => {
                let (declared, declared_in) = (photograph.size(), "the photograph that it is for".to_string());
                return Err(FilePlace::file(path).fault(ImageFault::SizeMismatch {
                    size: stored,
                    declared,
                    declared_in,
                }));
            }
            (is_upright, _) => is_upright,
        }
    };
    match (is_upright, is_applied) {
        (false, true) => decoded.apply_orientation(orientation),
        (true, false) => decoded.apply_orientation(images::inverse(orientation)),
        _ => {}
    }
    // Cut-outs used as masks have the mask in their alpha channel; their colours are ignored.
    let has_alpha = decoded.color().has_alpha();
    let rgba = decoded.to_rgba8();
    let speaks = has_alpha && rgba.pixels().any(|pixel| pixel[3] < u8::MAX);
    let mut mask = match speaks {
        true => GrayImage::from_fn(rgba.width(), rgba.height(), |x, y| Luma([rgba.get_pixel(x, y)[3]])),
        false => levels(decoded),
    };
    let is_lossy = meaning == MaskMeaning::Object && files::has_extension(path, &["jpg", "jpeg"]);
    if is_lossy && mask.iter().all(|level| *level < MIN_LOSSY) {
        // A mask of nothing, and what compression made of it.
        mask.fill(0);
    }
    let greatest = mask.iter().copied().max().unwrap_or(0);
    let (is_inverted, is_object) = (is_inverted(path), meaning == MaskMeaning::Object);
    for level in mask.iter_mut() {
        let counts = if *level > greatest / 2 { u8::MAX } else { 0 };
        *level = match (is_inverted, is_object) {
            (true, _) => u8::MAX - counts,
            // The greatest value counts whole, whatever it is.
            (false, true) => ((u32::from(*level) * 255 + u32::from(greatest) / 2) / u32::from(greatest).max(1)) as u8,
            (false, false) => counts,
        };
    }
    Ok(mask)
}

/// The levels of a picture. Those of 16 bits are as shares of the greatest; of colours (a palette's, a label's) all count
/// that are not black.
fn levels(picture: DynamicImage) -> GrayImage {
    if let DynamicImage::ImageLuma16(wide) = &picture {
        let greatest = u32::from(wide.iter().copied().max().unwrap_or(0)).max(u32::from(u8::MAX));
        let level = |value: u16| ((u32::from(value) * 255 + greatest / 2) / greatest) as u8;
        return GrayImage::from_fn(wide.width(), wide.height(), |x, y| Luma([level(wide.get_pixel(x, y)[0])]));
    }
    let rgb = match picture.color().has_color() {
        true => picture.to_rgb8(),
        false => return picture.into_luma8(),
    };
    let [least, greatest] = [|a: u8, b: u8| a.min(b), |a: u8, b: u8| a.max(b)];
    let channel = |pixel: &Rgb<u8>, pick: fn(u8, u8) -> u8| pick(pick(pixel[0], pixel[1]), pixel[2]);
    let is_coloured = rgb.pixels().any(|pixel| channel(pixel, greatest) - channel(pixel, least) > MAX_GREY_SPREAD);
    if !is_coloured {
        return picture.into_luma8();
    }
    GrayImage::from_fn(rgb.width(), rgb.height(), |x, y| {
        Luma([if channel(rgb.get_pixel(x, y), greatest) > MAX_GREY_SPREAD { u8::MAX } else { 0 }])
    })
}

/// Whether a mask's file is one of the photograph's pixels in memory as it is stored: neither carries an orientation,
/// and it is not inverted.
pub(super) fn is_as_stored(path: &Path, photograph: &Turn) -> Result<bool, SceneError> {
    let none = Orientation::NoTransforms;
    Ok(!is_inverted(path) && photograph.orientation == none && images::header(path)?.orientation == none)
}

/// A mask at a size.
fn at_size(
    path: &Path,
    photograph: &Turn,
    meaning: MaskMeaning,
    [width, height]: [u32; 2],
) -> Result<GrayImage, SceneError> {
    let mask = read(path, photograph, meaning)?;
    let is_so = mask.dimensions() == (width, height);
    Ok(if is_so { mask } else { resize(&mask, width, height, FilterType::Triangle) })
}

/// An ignore mask at a size: 0 for what does not count, 255 elsewhere.
///
/// # Errors
/// As [`read`].
pub(super) fn ignoring(path: &Path, photograph: &Turn, size: [u32; 2]) -> Result<GrayImage, SceneError> {
    let mut mask = at_size(path, photograph, MaskMeaning::Ignore, size)?;
    mask.iter_mut().for_each(|share| *share = if *share >= HALF { u8::MAX } else { 0 });
    Ok(mask)
}

/// Multiplies the photograph's alpha channel by an object's mask, or marks what an ignore mask takes away as not seen.
///
/// # Errors
/// As [`read`]; [`SceneFault::UnclearMasks`] if it is not known which of both the mask is.
pub(super) fn apply(
    path: &Path,
    photograph: &mut Photograph,
    turn: &Turn,
    meaning: MaskMeaning,
) -> Result<(), SceneError> {
    if let MaskMeaning::Unclear { percent } = meaning {
        return Err(FilePlace::file(path).fault(SceneFault::UnclearMasks(percent)));
    }
    let size = photograph.pixels.dimensions().into();
    if meaning == MaskMeaning::Ignore {
        let mask = ignoring(path, turn, size)?;
        photograph.seen = mask.as_raw().contains(&0).then_some(mask);
        return Ok(());
    }
    let mask = at_size(path, turn, meaning, size)?;
    for (pixel, share) in photograph.pixels.pixels_mut().zip(mask.pixels()) {
        let product = u32::from(pixel[3]) * u32::from(share[0]);
        pixel[3] = ((product + 127) / 255) as u8;
    }
    photograph.has_alpha = true;
    Ok(())
}
