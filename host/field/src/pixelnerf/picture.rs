//! A target's picture from rays: which pixels have a ray of their own, and which are interpolated.

use super::network::Workspace;
use super::pass::{Evaluated, Probes, Renderer, pieces, rays_at_once};
use crate::{FieldError, Rendered};
use viewfuse_device::Device;

/// Rows and columns that a grid of rays has at least before pixels between are interpolated.
const MIN_GRID: u32 = 32;
/// The widest grid, in pixels.
const WIDEST_STEP: u32 = 8;
/// Depths of neighbours that differ by more than this share of the far bound are not on one surface.
const SAME_SURFACE: f32 = 1.0 / 32.0;

impl<D: Device> Renderer<'_, D> {
    /// The whole picture; depths are along the rays.
    pub(super) fn picture(
        &self,
        workspace: &mut Workspace<D>,
        probes: Option<&Probes<D>>,
        evaluated: &mut [Evaluated; 2],
    ) -> Result<Rendered, FieldError> {
        let mut picture = self.empty_picture();
        if self.omissions.interpolation > 0.0 {
            self.render_grids(workspace, probes, evaluated, &mut picture)?;
        } else {
            let all: Vec<u32> = (0..picture.width * picture.height).collect();
            self.render_into(workspace, &all, probes, evaluated, &mut picture)?;
        }
        Ok(picture)
    }

    /// A picture without colours and depths so far.
    pub(super) fn empty_picture(&self) -> Rendered {
        let (width, height) = (self.cast.camera.width, self.cast.camera.height);
        let count = (width * height) as usize;
        Rendered { colours: vec![[0.0; 4]; count], depths: vec![0.0; count], confidences: Vec::new(), width, height }
    }

    /// A wide grid of rays, then grids of half the width, whose rays are left out where those around them are alike.
    fn render_grids(
        &self,
        workspace: &mut Workspace<D>,
        probes: Option<&Probes<D>>,
        evaluated: &mut [Evaluated; 2],
        picture: &mut Rendered,
    ) -> Result<(), FieldError> {
        let (width, height) = (picture.width, picture.height);
        let (most_difference, far_difference) = self.interpolation();
        let mut step = widest_step(width.min(height));
        let first: Vec<u32> = grid([width, height], step).map(|[column, row]| row * width + column).collect();
        let mut ray_count = first.len();
        self.render_into(workspace, &first, probes, evaluated, picture)?;
        while step > 1 {
            let half = step / 2;
            let mut rays = Vec::new();
            for [column, row] in between_grids([width, height], step) {
                let pixel = row * width + column;
                match between(picture, [column, row], step, most_difference, far_difference) {
                    Some((colour, depth)) => {
                        picture.colours[pixel as usize] = colour;
                        picture.depths[pixel as usize] = depth;
                    }
                    None => rays.push(pixel),
                }
            }
            ray_count += rays.len();
            self.render_into(workspace, &rays, probes, evaluated, picture)?;
            step = half;
        }
        let interpolated = picture.colours.len().saturating_sub(ray_count) as u64;
        for (evaluated, samples) in evaluated.iter_mut().zip(self.sampling.counts()) {
            evaluated.samples += interpolated * u64::from(samples);
        }
        Ok(())
    }

    /// The most that pixels may differ from one another in any channel, and in depth, for a pixel between to be
    /// interpolated.
    pub(super) fn interpolation(&self) -> (f32, f32) {
        (self.omissions.interpolation, SAME_SURFACE * self.cast.far)
    }

    /// Renders some pixels of a picture.
    fn render_into(
        &self,
        workspace: &mut Workspace<D>,
        pixels: &[u32],
        probes: Option<&Probes<D>>,
        evaluated: &mut [Evaluated; 2],
        picture: &mut Rendered,
    ) -> Result<(), FieldError> {
        let (colours, depths) = self.pixels_at(workspace, pixels, probes, evaluated)?;
        for ((pixel, colour), depth) in pixels.iter().zip(colours).zip(depths) {
            picture.colours[*pixel as usize] = colour;
            picture.depths[*pixel as usize] = depth;
        }
        Ok(())
    }

    /// Colours and depths (along the rays) of some pixels, in their order.
    pub(super) fn pixels_at(
        &self,
        workspace: &mut Workspace<D>,
        pixels: &[u32],
        probes: Option<&Probes<D>>,
        evaluated: &mut [Evaluated; 2],
    ) -> Result<(Vec<[f32; 4]>, Vec<f32>), FieldError> {
        let device = self.device;
        let at_once = rays_at_once(device, &self.sampling);
        let of_rays = |rays: usize| self.sampling.counts().map(|count| pieces(workspace, rays as u32 * count));
        self.progress.expect(pixels.chunks(at_once).flat_map(|some| of_rays(some.len())).sum());
        // Nothing is downloaded before all rays are dispatched.
        let mut tiles = Vec::new();
        for some in pixels.chunks(at_once) {
            tiles.push(self.render(workspace, some, probes, evaluated)?);
        }
        let (mut colours, mut depths) = (Vec::with_capacity(pixels.len()), Vec::with_capacity(pixels.len()));
        for tile in tiles {
            colours.extend(device.download(&tile.colours)?);
            depths.extend(device.download(&tile.depths)?);
        }
        Ok((colours, depths))
    }
}

/// The step of the widest grid whose pixels are interpolated.
pub(super) fn widest_step(side: u32) -> u32 {
    first_step(side, WIDEST_STEP, MIN_GRID)
}

/// The step of the first grid: a power of two up to `widest`, of at least so many rows and columns where it is not 2.
pub(super) fn first_step(side: u32, widest: u32, min_grid: u32) -> u32 {
    let mut step = 2;
    while step < widest && side >= 2 * step * min_grid {
        step *= 2;
    }
    step
}

/// Columns and rows of the grid of `step` in a picture.
pub(super) fn grid([width, height]: [u32; 2], step: u32) -> impl Iterator<Item = [u32; 2]> {
    let rows = (0..height).step_by(step as usize);
    rows.flat_map(move |row| (0..width).step_by(step as usize).map(move |column| [column, row]))
}

/// What the grid of half the step has more.
pub(super) fn between_grids(size: [u32; 2], step: u32) -> impl Iterator<Item = [u32; 2]> {
    grid(size, step / 2).filter(move |place| place.iter().any(|place| !place.is_multiple_of(step)))
}

/// The mean colour and a depth of a pixel's two or four neighbours on the grid of `step`, if all of them are in the
/// picture and alike.
pub(super) fn between(
    picture: &Rendered,
    [column, row]: [u32; 2],
    step: u32,
    most_difference: f32,
    far_difference: f32,
) -> Option<([f32; 4], f32)> {
    let around =
        |place: u32| if place.is_multiple_of(step) { [place; 2] } else { [place - step / 2, place + step / 2] };
    let ([left, right], [top, bottom]) = (around(column), around(row));
    if right >= picture.width || bottom >= picture.height {
        return None;
    }
    let pixels = [[left, top], [right, top], [left, bottom], [right, bottom]]
        .map(|[column, row]| (row * picture.width + column) as usize);
    let colours = pixels.map(|pixel| picture.colours[pixel]);
    let mut mean = [0.0; 4];
    for channel in 0..4 {
        let values = colours.map(|colour| colour[channel]);
        let (least, greatest) =
            values.iter().fold((f32::MAX, f32::MIN), |(l, g), value| (l.min(*value), g.max(*value)));
        // The least and the greatest pass over NaN.
        let is_finite = values.iter().all(|value| value.is_finite());
        if !is_finite || greatest - least > most_difference {
            return None;
        }
        mean[channel] = 0.25 * values.iter().sum::<f32>();
    }
    let depths = pixels.map(|pixel| picture.depths[pixel]);
    let depth = 0.25 * depths.iter().sum::<f32>();
    let is_one_surface = depths.iter().all(|other| (other - depth).abs() <= far_difference);
    // The mean of two surfaces' depths is on neither.
    Some((mean, if is_one_surface { depth } else { depths[0] }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(colour: impl Fn(u32, u32) -> f32) -> Rendered {
        let (width, height) = (9, 9);
        let colours: Vec<[f32; 4]> =
            (0..81).map(|index| [colour(index % width, index / width), 0.5, 0.5, 1.0]).collect();
        Rendered { depths: vec![1.0; 81], colours, confidences: Vec::new(), width, height }
    }

    #[test]
    fn a_slope_is_interpolated_and_an_edge_is_not() {
        let slope = picture(|column, row| 0.01 * (column + 2 * row) as f32);
        let (colour, depth) = between(&slope, [3, 5], 2, 0.1, 0.1).expect("alike");
        assert!((colour[0] - 0.13).abs() < 1.0e-6 && depth == 1.0, "{colour:?}");
        let edge = picture(|column, _| if column < 3 { 0.0 } else { 1.0 });
        assert_eq!(between(&edge, [3, 5], 2, 0.1, 0.1), None);
        assert!(between(&edge, [2, 5], 2, 0.1, 0.1).is_some());
    }

    #[test]
    fn the_border_and_nan_have_rays() {
        let slope = picture(|column, _| if column == 4 { f32::NAN } else { 0.0 });
        assert_eq!(between(&slope, [3, 0], 2, 0.1, 0.1), None);
        let flat = Rendered { width: 8, ..picture(|_, _| 0.0) };
        assert_eq!(between(&flat, [7, 0], 2, 0.1, 0.1), None);
    }

    #[test]
    fn a_grid_has_enough_rays() {
        assert_eq!([32, 64, 127, 128, 256, 1024].map(widest_step), [2, 2, 2, 4, 8, 8]);
    }
}
