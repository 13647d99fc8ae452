//! Which splats a tile shows, with bounds on what `f32` makes of it.

use super::bounded::Bounded;
use viewfuse_kernels::gaussians::SPLAT_TILE;
use viewfuse_kernels::rows::{ListBlock, ProjectedGaussian};

/// A coordinate as the first pixel whose centre is not below it, in a picture with so many; `None` where that depends
/// on rounding.
fn edge(coordinate: Bounded, end: u32) -> Option<u32> {
    let moved = (coordinate + Bounded::from(0.5_f32)).clamped(0.0, end as f32);
    let [low, high] = [moved.value - moved.error, moved.value + moved.error].map(|number| number.max(0.0) as u32);
    (low == high).then_some(low)
}

/// The pixels of a splat's box, as [`ProjectedGaussian::pixels`]; `None` where they depend on rounding.
pub fn pixels(splat: &ProjectedGaussian, width: u32, height: u32) -> Option<[u32; 4]> {
    if !(splat.opacity > 0.0) {
        return Some([0; 4]);
    }
    let ([x, y], [right, down]) = (splat.mean.map(Bounded::from), splat.extent.map(Bounded::from));
    Some([edge(x - right, width)?, edge(x + right, width)?, edge(y - down, height)?, edge(y + down, height)?])
}

/// A number in an interval.
fn limited(number: Bounded, low: Bounded, high: Bounded) -> Bounded {
    number.greater(low).lesser(high)
}

/// Whether the opacity may reach the least that counts at pixels of these columns and rows, as
/// [`ProjectedGaussian::reaches`].
fn reaches(splat: &ProjectedGaussian, columns: [u32; 2], rows: [u32; 2]) -> Option<bool> {
    let [xx, xy, yy] = splat.conic.map(Bounded::from);
    let from = |pixel: u32, mean: f32| Bounded::from(pixel as f32 + 0.5) - mean.into();
    let [left, right] = columns.map(|column| from(column, splat.mean[0]));
    let [top, bottom] = rows.map(|row| from(row, splat.mean[1]));
    let (dx, dy) = (limited(Bounded::ZERO, left, right), limited(Bounded::ZERO, top, bottom));
    let two = Bounded::from(2.0_f32);
    let form = |x: Bounded, y: Bounded| xx * x * x + yy * y * y + two * xy * x * y;
    let across = form(dx, limited(-xy * dx / yy, top, bottom));
    let down = form(limited(-xy * dy / xx, left, right), dy);
    let is_inside = |number: Bounded| match (number.value == 0.0, number.error == 0.0) {
        (true, true) => Some(true),
        _ if number.value.abs() > number.error => Some(false),
        _ => None,
    };
    let least = match (is_inside(dx)?, is_inside(dy)?) {
        (true, _) => down,
        (false, true) => across,
        (false, false) => across.lesser(down),
    };
    let (far_x, far_y) = ((-left).greater(right), (-top).greater(bottom));
    let rounding = Bounded::from(1.0e-6_f32) * (xx * far_x * far_x + yy * far_y * far_y);
    let allowed = two * (Bounded::from(255.0_f32) * splat.opacity.into()).ln() + Bounded::from(0.02_f32) + rounding;
    allowed.below(least).map(|is_beyond| !is_beyond)
}

/// Whether a splat may be seen in a tile; `None` where that depends on rounding.
pub fn is_reached(splat: &ProjectedGaussian, [width, height]: [u32; 2], column: u32, row: u32) -> Option<bool> {
    let side = SPLAT_TILE as u32;
    let [left, right, top, bottom] = pixels(splat, width, height)?;
    let (first, above) = (column * side, row * side);
    let [columns, rows] = [[left.max(first), right.min(first + side)], [top.max(above), bottom.min(above + side)]];
    if columns[0] >= columns[1] || rows[0] >= rows[1] {
        return Some(false);
    }
    reaches(splat, [columns[0], columns[1] - 1], [rows[0], rows[1] - 1])
}

/// The lists of all tiles, by the kernels' own test and a sort on the host: what kernels behind them are given.
pub fn lists(block: &ListBlock, splats: &[ProjectedGaussian]) -> (Vec<u32>, Vec<u32>) {
    let (mut starts, mut entries) = (vec![0], Vec::new());
    for tile in 0..block.tile_count() {
        let (column, row) = (tile % block.tile_columns(), tile / block.tile_columns());
        let shown = |splat: &ProjectedGaussian| {
            let pixels = splat.pixels(block.width, block.height);
            viewfuse_kernels::gaussians::lists::is_reached(splat, pixels, column, row)
        };
        let mut list: Vec<u32> = (0..splats.len() as u32).filter(|index| shown(&splats[*index as usize])).collect();
        list.sort_by_key(|index| (splats[*index as usize].depth.to_bits(), *index));
        entries.extend(list);
        starts.push(entries.len() as u32);
    }
    (starts, entries)
}
