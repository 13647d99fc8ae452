//! The contact sheet: sources and results on one page.
//!
//! Sources in the order of their weights, each with its weight as a number and a bar; below them the prediction, its
//! depth, and, if there is a ground truth, the ground truth and the error.

use crate::canvas::{BLUE, CHARACTER_WIDTH, Canvas, GREY, INK, LINE_HEIGHT, PAPER};
use image::{Rgb, RgbImage, imageops};
use std::sync::Arc;

/// One source on the sheet.
pub struct SheetSource {
    /// The view's name.
    pub name: String,
    /// Its weight; 0 for a view that was left out.
    pub weight: f32,
    /// Its photograph at working size.
    pub picture: Arc<RgbImage>,
}

/// The content of a sheet.
pub struct Sheet {
    /// First line: scene, target, scheme.
    pub title: String,
    /// Sources in any order.
    pub sources: Vec<SheetSource>,
    /// The rendered picture.
    pub prediction: RgbImage,
    /// Its depth map as grey levels, where depths are known.
    pub depth: Option<RgbImage>,
    /// The photograph at the target with PSNR in decibels and SSIM, where there is one.
    pub truth: Option<(RgbImage, f64, Option<f64>)>,
}

const MARGIN: u32 = 10;
const GAP: u32 = 8;
/// Least height of a source's picture. They fill the width of the results, and are at most as high as those.
const MIN_THUMBNAIL_HEIGHT: u32 = 96;
/// The page is wide enough for so many of the smallest sources beside one another, if there are as many.
const MIN_SOURCES_PER_ROW: usize = 6;
const BAR: u32 = 4;
/// The most shown sources; further ones have small weights and are only counted.
const SOURCES_SHOWN: usize = 24;
/// An absolute error of a quarter of the range is shown in the strongest colour.
const STRONGEST_ERROR: f32 = 0.25;

impl Sheet {
    /// Draws the page.
    pub fn draw(mut self) -> RgbImage {
        self.sources.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let hidden = self.sources.split_off(self.sources.len().min(SOURCES_SHOWN));
        let hidden_left_out = hidden.iter().filter(|source| source.weight == 0.0).count();
        let mut results: Vec<(String, RgbImage)> = vec![("prediction".to_owned(), self.prediction.clone())];
        if let Some((truth, psnr, ssim)) = &self.truth {
            let ssim = ssim.map_or(String::new(), |value| format!("  SSIM {value:.3}"));
            results.push(("truth".to_owned(), truth.clone()));
            results.push((format!("error  PSNR {psnr:.2} dB{ssim}"), error_map(&self.prediction, truth)));
        }
        if let Some(depth) = &self.depth {
            results.push(("depth (near is bright)".to_owned(), depth.clone()));
        }
        // Small results are enlarged by a whole factor, so that every pixel stays visible.
        let zoom = (256 / self.prediction.height().max(1)).clamp(1, 4);
        let (result_width, result_height) = (self.prediction.width() * zoom, self.prediction.height() * zoom);
        let result_cell = result_width.max(CHARACTER_WIDTH * 34) + GAP;

        let title_width = CHARACTER_WIDTH * self.title.len() as u32;
        let results_width = result_cell * results.len() as u32;
        let grid = Grid::of(&self.sources, results_width.max(title_width), result_height);
        let content_width = results_width.max(title_width).max(grid.cell_width * grid.columns as u32);
        let sources_top = MARGIN + LINE_HEIGHT + GAP;
        let more_height = if hidden.is_empty() { 0 } else { LINE_HEIGHT };
        let results_top = sources_top + grid.height(self.sources.len()) + more_height + GAP;
        let height = results_top + LINE_HEIGHT + result_height + MARGIN;
        let mut canvas = Canvas::new(content_width + 2 * MARGIN, height);

        canvas.text(MARGIN as i32, MARGIN as i32, &self.title, INK);
        self.draw_sources(&mut canvas, &grid, sources_top);
        if !hidden.is_empty() {
            canvas.text(
                MARGIN as i32,
                (results_top - LINE_HEIGHT - GAP) as i32,
                &format!("and {} more of smaller weight, {hidden_left_out} of them dropped", hidden.len()),
                GREY,
            );
        }
        for (index, (label, picture)) in results.iter().enumerate() {
            let x = (MARGIN + index as u32 * result_cell) as i32;
            canvas.text(x, results_top as i32, label, INK);
            let enlarged = imageops::resize(picture, result_width, result_height, imageops::FilterType::Nearest);
            canvas.picture(x, (results_top + LINE_HEIGHT) as i32, &enlarged);
            canvas.frame(x, (results_top + LINE_HEIGHT) as i32, result_width, result_height, GREY);
        }
        canvas.into_image()
    }

    /// The sources, each with its weight and its name, from `top` on.
    fn draw_sources(&self, canvas: &mut Canvas, grid: &Grid, top: u32) {
        let heaviest = self.sources.first().map_or(1.0, |source| source.weight.max(f32::MIN_POSITIVE));
        for (index, source) in self.sources.iter().enumerate() {
            let picture = thumbnail(&source.picture, grid.picture_height);
            let x = (MARGIN + (index % grid.columns) as u32 * grid.cell_width) as i32;
            let y = (top + (index / grid.columns) as u32 * grid.cell_height()) as i32;
            canvas.picture(x, y, &picture);
            canvas.frame(x, y, picture.width(), picture.height(), GREY);
            let below = y + grid.picture_height as i32 + 2;
            let length = (picture.width() as f32 * source.weight / heaviest).round() as u32;
            canvas.fill(x, below, length, BAR, BLUE);
            let weight = if source.weight > 0.0 { format!("{:.4}", source.weight) } else { "dropped".to_owned() };
            let text_top = below + BAR as i32 + 2;
            canvas.text(x, text_top, &weight, if source.weight > 0.0 { INK } else { GREY });
            let name = end_of(&source.name, ((grid.cell_width - GAP) / CHARACTER_WIDTH) as usize);
            canvas.text(x, text_top + LINE_HEIGHT as i32, &name, GREY);
        }
    }
}

/// Rows and columns of the sources.
struct Grid {
    columns: usize,
    cell_width: u32,
    picture_height: u32,
}

impl Grid {
    /// As few rows as fit into a width, with pictures as high as that leaves, at most `highest`.
    fn of(sources: &[SheetSource], width: u32, highest: u32) -> Grid {
        let shape = |source: &SheetSource| source.picture.width() as f32 / source.picture.height().max(1) as f32;
        let widest = sources.iter().map(shape).fold(0.0, f32::max).max(f32::MIN_POSITIVE);
        let least_width = (MIN_THUMBNAIL_HEIGHT as f32 * widest).ceil().max(1.0) as u32 + GAP;
        let count = sources.len().max(1);
        let width = width.max(least_width * count.min(MIN_SOURCES_PER_ROW) as u32);
        let rows = count.div_ceil((width / least_width).max(1) as usize);
        let columns = count.div_ceil(rows);
        let height = (width / columns as u32).saturating_sub(GAP) as f32 / widest;
        let picture_height = (height as u32).min(highest).max(MIN_THUMBNAIL_HEIGHT);
        Grid { columns, cell_width: (picture_height as f32 * widest).ceil().max(1.0) as u32 + GAP, picture_height }
    }

    /// Of a picture with what stands below it.
    fn cell_height(&self) -> u32 {
        self.picture_height + BAR + 2 * LINE_HEIGHT + GAP
    }

    /// Of all rows.
    fn height(&self, count: usize) -> u32 {
        count.div_ceil(self.columns) as u32 * self.cell_height()
    }
}

/// A name shortened to this many characters: the end of a long one, where names of one series differ.
fn end_of(name: &str, most: usize) -> String {
    let length = name.chars().count();
    if length <= most {
        return name.to_owned();
    }
    let kept: String = name.chars().skip(length + 2 - most.max(2)).collect();
    format!("..{kept}")
}

fn thumbnail(picture: &RgbImage, height: u32) -> RgbImage {
    let width = (picture.width() * height / picture.height().max(1)).max(1);
    imageops::resize(picture, width, height, imageops::FilterType::Triangle)
}

/// Mean absolute error over the channels of each pixel: white where equal, through red to black at a quarter of the
/// range.
///
/// # Panics
/// If the truth is smaller.
pub fn error_map(prediction: &RgbImage, truth: &RgbImage) -> RgbImage {
    RgbImage::from_fn(prediction.width(), prediction.height(), |x, y| {
        let (p, t) = (prediction.get_pixel(x, y), truth.get_pixel(x, y));
        let sum: u32 = p.0.iter().zip(&t.0).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        let level = (sum as f32 / (3.0 * 255.0 * STRONGEST_ERROR)).min(1.0);
        let fade = |start: f32, end: f32| {
            (f32::from(PAPER[0]) * (1.0 - ((level - start) / (end - start)).clamp(0.0, 1.0))) as u8
        };
        Rgb([fade(0.5, 1.0), fade(0.0, 0.5), fade(0.0, 0.5)])
    })
}

/// A depth map as grey levels, row-major, nearest brightest; pixels whose depth is not finite are black.
///
/// # Panics
/// If there are fewer depths than pixels.
pub fn depth_picture(depth: &[f32], width: u32, height: u32) -> RgbImage {
    let finite = || depth.iter().copied().filter(|z| z.is_finite());
    let (near, far) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
    let range = (far - near).max(f32::MIN_POSITIVE);
    RgbImage::from_fn(width, height, |x, y| {
        let z = depth[(y * width + x) as usize];
        let level = if z.is_finite() { 255.0 - 195.0 * ((z - near) / range) } else { 0.0 };
        Rgb([level as u8; 3])
    })
}
