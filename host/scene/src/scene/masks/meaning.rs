//! What masks say: which pixels do not count (an ignore mask: what moves, a tripod, a car's bonnet), or where the
//! object is (an object mask: its silhouette).
//!
//! A person says it ([`MaskChoice`]), or the layout does ([`Reader::masks`](super::super::reader::Reader::masks)).
//! Otherwise the masks themselves do. A silhouette is one region, in at least half of the photographs away from the
//! border; silhouettes are not alike, as masks that are fixed to the camera are; and the rays through their middles meet
//! in the object.
//! All other masks say which pixels do not count. Where these leave little of the photographs, they may be inverted, or
//! of an object that reaches the border: then it is unclear, and asked.

use glam::DVec3;
use image::GrayImage;
use rayon::prelude::*;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;

use super::super::View;
use super::super::frame::nearest_point_to_lines;
use super::super::images::{self, Turn};
use super::{INVERTED, is_inverted};

/// What a person says of masks and alpha channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MaskChoice {
    /// Their layout and what they show say what they mean.
    #[default]
    Auto,
    /// They say where the object is.
    Object,
    /// They say which pixels do not count.
    Ignore,
    /// They are not used.
    None,
}

viewfuse_job::named! {
    pub MaskChoice: "a meaning of masks" {
        Auto => "auto",
        Object => "object",
        Ignore => "ignore",
        None => "none",
    }
}

/// What the masks of a scene say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MaskMeaning {
    /// Where the object is.
    #[default]
    Object,
    /// Which pixels do not count.
    Ignore,
    /// That is not known: they leave so little that they may be inverted.
    Unclear {
        /// How much they leave of the photographs.
        percent: u32,
    },
}

/// Most masks that are looked at, spread over all.
const MAX_LOOKED_AT: usize = 32;
/// Most cells along a side of the grid in which regions are told apart.
const CELLS: usize = 96;
/// Least share of what counts that the largest region of a silhouette has: the rest are specks.
const MIN_REGION: f64 = 0.9;
/// Greatest share of the border that counts in a silhouette.
const MAX_BORDER: f64 = 0.05;
/// Greatest share of what counts by which masks that are alike differ.
const MAX_DIFFERENCE: f64 = 0.02;
/// Least share of the photographs that ignore masks leave. A fisheye's circle leaves 0.44 of a 16:9 picture.
const MIN_LEFT: f64 = 0.4;
/// Below this share, masks that touch the border may also be of an object that is near: what they are taken for is
/// said.
const MAX_DOUBTFUL: f64 = 0.7;

/// What masks mean, with a line that says it, and a warning where it was guessed and may be wrong.
#[derive(Default)]
pub(in super::super) struct Decision {
    pub meaning: MaskMeaning,
    pub line: Option<String>,
    pub warning: Option<String>,
}

/// What masks mean; `layout` is what their layout says. Masks that cannot be read say nothing: the error comes with
/// their photographs.
pub(in super::super) fn decide(views: &[View], choice: MaskChoice, layout: Option<MaskMeaning>) -> Decision {
    let masked: Vec<&View> = views.iter().filter(|view| view.mask.is_some()).collect();
    if masked.is_empty() {
        return Decision::default();
    }
    let step = masked.len().div_ceil(MAX_LOOKED_AT);
    let looks: Vec<Look> = masked.par_iter().step_by(step).filter_map(|view| Look::of(view)).collect();
    let left = looks.iter().map(|look| look.share).sum::<f64>() / looks.len().max(1) as f64;
    let inverted = masked.iter().filter(|view| view.mask.as_deref().is_some_and(is_inverted)).count();
    let meaning = match (choice, layout) {
        (MaskChoice::Object, _) => MaskMeaning::Object,
        (MaskChoice::Ignore, _) => MaskMeaning::Ignore,
        (_, Some(layout)) => layout,
        _ if inverted == 0 && are_silhouettes(&looks) => MaskMeaning::Object,
        _ if looks.is_empty() || left >= MIN_LEFT => MaskMeaning::Ignore,
        _ => MaskMeaning::Unclear { percent: (100.0 * left).round() as u32 },
    };
    let (what, share) = match meaning {
        MaskMeaning::Object => ("where the object is", left),
        MaskMeaning::Ignore => ("pixels that do not count", 1.0 - left),
        MaskMeaning::Unclear { .. } => ("unclear whether of an object or of pixels that do not count", left),
    };
    let mut line = format!("masks: {what}, {} files, {:.0} % of the pixels", masked.len(), 100.0 * share);
    if inverted > 0 {
        line += &format!(", white where they do not count ({INVERTED}*.png, {inverted} files)");
    }
    let is_guessed = choice == MaskChoice::Auto && layout.is_none() && inverted == 0;
    let is_doubtful = is_guessed && !looks.is_empty() && left < MAX_DOUBTFUL;
    let warning = (meaning == MaskMeaning::Ignore && is_doubtful).then(|| {
        format!(
            "masks that leave {:.0} % of the pixels are taken to say which pixels do not count (ignore): if they show \
             the object instead, choose object",
            100.0 * left
        )
    });
    Decision { meaning, line: Some(line), warning }
}

/// What is seen of a mask.
struct Look {
    /// The share of the pixels that count.
    share: f64,
    /// Whether a cell of a coarse grid holds a pixel that counts, row by row, and the cells of a row.
    cells: Vec<bool>,
    columns: usize,
    /// Whether it is one region, and whether it is away from the border.
    is_region: bool,
    is_inside: bool,
    /// Least and greatest place of what counts, x and y, as shares of the sides.
    bounds: [[f64; 2]; 2],
    /// The camera's centre, and the direction of the middle of what counts.
    ray: (DVec3, DVec3),
    camera: Camera,
}

impl Look {
    fn of(view: &View) -> Option<Look> {
        let pinhole = &view.camera.pinhole;
        let size = [pinhole.width(), pinhole.height()];
        let turn = Turn::of(&images::header(view.image.as_deref()?).ok()?, size);
        let mask = super::read(view.mask.as_deref()?, &turn, MaskMeaning::Ignore).ok()?;
        let (cells, columns) = grid(&mask);
        let sides = [mask.width(), mask.height()].map(f64::from);
        let (mut count, mut sums, mut low, mut high) = (0.0, [0.0; 2], [1.0_f64; 2], [0.0_f64; 2]);
        for (x, y, _) in mask.enumerate_pixels().filter(|(_, _, level)| level[0] > 0) {
            count += 1.0;
            for (axis, at) in [x, y].into_iter().enumerate() {
                let place = (f64::from(at) + 0.5) / sides[axis];
                sums[axis] += place;
                (low[axis], high[axis]) = (low[axis].min(place), high[axis].max(place));
            }
        }
        let middle = [0, 1].map(|axis| (sums[axis] / f64::max(count, 1.0) * f64::from(size[axis])) as f32);
        let block = view.camera.block(0);
        let direction = block.towards(middle[0], middle[1]).normalize_or_zero().as_dvec3();
        Some(Look {
            share: count / (sides[0] * sides[1]),
            is_region: is_region(&cells, columns),
            is_inside: is_inside(&cells, columns),
            cells,
            columns,
            bounds: [low, high],
            ray: (block.centre_world().as_dvec3(), direction),
            camera: view.camera,
        })
    }

    /// Whether it shows a point of the world within the bounds of what counts.
    fn surrounds(&self, point: Vec3) -> bool {
        let (seen, pinhole) = (self.camera.project(point), &self.camera.pinhole);
        let place = [seen.x / pinhole.width() as f32, seen.y / pinhole.height() as f32].map(f64::from);
        seen.in_front && (0..2).all(|axis| (self.bounds[0][axis]..=self.bounds[1][axis]).contains(&place[axis]))
    }

    /// Whether another mask shows the same.
    fn is_like(&self, other: &Look) -> bool {
        let differing = self.cells.iter().zip(&other.cells).filter(|(a, b)| a != b).count() as f64;
        let counting = self.cells.iter().filter(|cell| **cell).count() as f64;
        (self.columns, self.cells.len()) == (other.columns, other.cells.len()) && differing <= MAX_DIFFERENCE * counting
    }
}

/// Whether all are silhouettes of one object.
fn are_silhouettes(looks: &[Look]) -> bool {
    let Some((first, others)) = looks.split_first() else { return false };
    let are_fixed = !others.is_empty() && others.iter().all(|look| first.is_like(look));
    let rays: Vec<(DVec3, DVec3)> = looks.iter().map(|look| look.ray).collect();
    // Where the object is near, some of its silhouettes reach the border.
    let inside = looks.iter().filter(|look| look.is_inside).count();
    looks.iter().all(|look| look.is_region)
        && 2 * inside >= looks.len()
        && !are_fixed
        && nearest_point_to_lines(&rays).is_none_or(|point| looks.iter().all(|look| look.surrounds(point.as_vec3())))
}

/// A coarse grid over a mask: whether a cell holds a pixel that counts, row by row, and the cells of a row.
fn grid(mask: &GrayImage) -> (Vec<bool>, usize) {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let cell = width.max(height).div_ceil(CELLS).max(1);
    let (columns, rows) = (width.div_ceil(cell), height.div_ceil(cell));
    let mut cells = vec![false; columns * rows];
    for (x, y, _) in mask.enumerate_pixels().filter(|(_, _, level)| level[0] > 0) {
        cells[y as usize / cell * columns + x as usize / cell] = true;
    }
    (cells, columns)
}

/// Whether what counts is one region.
fn is_region(cells: &[bool], columns: usize) -> bool {
    let counting = cells.iter().filter(|cell| **cell).count();
    counting > 0 && largest_region(cells, columns) as f64 >= MIN_REGION * counting as f64
}

/// Whether what counts is away from the border.
fn is_inside(cells: &[bool], columns: usize) -> bool {
    let rows = cells.len() / columns.max(1);
    let at_border = |cell: usize| {
        let (column, row) = (cell % columns, cell / columns);
        column == 0 || row == 0 || column + 1 == columns || row + 1 == rows
    };
    let border: Vec<bool> = (0..cells.len()).filter(|cell| at_border(*cell)).map(|cell| cells[cell]).collect();
    border.iter().filter(|counts| **counts).count() as f64 <= MAX_BORDER * border.len() as f64
}

/// The cells of the largest region of connected ones that count.
fn largest_region(cells: &[bool], columns: usize) -> usize {
    let mut open = cells.to_vec();
    let mut region = |start| flood([start], [columns, cells.len() / columns], |cell| std::mem::take(&mut open[cell]));
    (0..cells.len()).map(&mut region).max().unwrap_or(0)
}

/// Takes cells of a grid, row by row: of the first ones those that `take` accepts, then on and on of their neighbours.
/// Returns how many were taken; `take` must accept a cell once.
pub(crate) fn flood(
    first: impl IntoIterator<Item = usize>,
    [columns, rows]: [usize; 2],
    mut take: impl FnMut(usize) -> bool,
) -> usize {
    let mut front: Vec<usize> = first.into_iter().filter(|cell| take(*cell)).collect();
    let mut count = front.len();
    while let Some(cell) = front.pop() {
        let (x, y) = (cell % columns, cell / columns);
        for (x, y) in [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)] {
            if x < columns && y < rows && take(y * columns + x) {
                front.push(y * columns + x);
                count += 1;
            }
        }
    }
    count
}
