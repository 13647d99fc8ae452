//! What goes into PixelNeRF's network for points, and what comes out.

use super::Cpu;
use crate::kernels::points::PointKernels;
use pulp::Arch;
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pixelnerf::{EmbedBlock, GatherBlock, GridPlace, in_view_axes, radiance, visible_weight, waves};
use viewfuse_core::rays::RayPoint;

impl PointKernels for Cpu {
    fn embed_points(
        &self,
        block: &EmbedBlock,
        view_count: u32,
        views: &Vec<CameraBlock>,
        points: &Vec<RayPoint>,
        embedded: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (row_len, point_count) = (block.row_len() as usize, block.point_count as usize);
        let row_count = view_count as usize * point_count;
        // A row at a time: its rotations are needed once, and a sine comes with its cosine.
        embedded[..row_count * row_len].par_chunks_mut(row_len).enumerate().for_each(|(row, embedded)| {
            let (view, point) = (&views[row / point_count], &points[row % point_count]);
            let position = in_view_axes(view, point.position);
            embedded[..3].copy_from_slice(&position);
            for (octave, values) in embedded[3..row_len - 3].chunks_exact_mut(6).enumerate() {
                for (axis, coordinate) in position.into_iter().enumerate() {
                    (values[axis], values[axis + 3]) = waves(coordinate, octave as u32, block);
                }
            }
            embedded[row_len - 3..].copy_from_slice(&in_view_axes(view, point.direction));
        });
        Ok(())
    }

    fn visible_weights(
        &self,
        view_count: u32,
        point_count: u32,
        views: &Vec<CameraBlock>,
        weights: &Vec<f32>,
        points: &Vec<RayPoint>,
        visible: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let count = view_count as usize;
        visible[..point_count as usize * count].par_chunks_mut(count).zip(points).for_each(|(visible, point)| {
            for (visible, view) in visible.iter_mut().zip(0..) {
                *visible = visible_weight(&views[..], &weights[..], view_count, point, view);
            }
        });
        Ok(())
    }

    fn gather_latents(
        &self,
        block: &GatherBlock,
        views: &Vec<CameraBlock>,
        points: &Vec<RayPoint>,
        grid: &Vec<f32>,
        addend: Option<&Vec<f32>>,
        gathered: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (first, channels, point_count) = (block.first(), block.channel_count as usize, block.point_count as usize);
        let gathered = &mut gathered[first..first + point_count * channels];
        gathered.par_chunks_mut(channels).enumerate().for_each(|(point, gathered)| {
            let place = GridPlace::of(&views[block.view as usize], &points[point], block);
            let nodes = place.nodes.map(|node| &grid[node..node + channels]);
            // As wide as the machine can.
            Arch::new().dispatch(|| {
                look_up(&place, nodes, gathered);
                if let Some(addend) = addend {
                    let addend = &addend[first + point * channels..];
                    gathered.iter_mut().zip(addend).for_each(|(value, addend)| *value += addend);
                }
            });
        });
        Ok(())
    }

    fn radiance(
        &self,
        point_count: u32,
        raw: &Vec<f32>,
        points: &Vec<RayPoint>,
        samples: &mut Vec<[f32; 4]>,
    ) -> Result<(), Infallible> {
        for (raw, point) in raw.chunks_exact(4).zip(&points[..point_count as usize]) {
            samples[point.sample as usize] = radiance(raw, point);
        }
        Ok(())
    }
}

/// [`GridPlace::value`] for all channels together, from the four nodes.
#[inline(always)]
fn look_up(place: &GridPlace, nodes: [&[f32]; 4], values: &mut [f32]) {
    let [upper_left, upper_right, lower_left, lower_right] = nodes;
    let upper = upper_left.iter().zip(upper_right);
    let lower = lower_left.iter().zip(lower_right);
    for (value, ((a, b), (c, d))) in values.iter_mut().zip(upper.zip(lower)) {
        let upper = a + (b - a) * place.share_x;
        let lower = c + (d - c) * place.share_x;
        *value = upper + (lower - upper) * place.share_y;
    }
}
