//! Loops over bodies that are written by hand: what elements write is not in their order, or a row's elements share work.

use crate::parallel::for_each_row;
use pulp::Arch;
use std::sync::Mutex;
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding, PoseEmbedding};
use viewfuse_core::depths::{FineBlock, merged_depth};
use viewfuse_core::pose::PoseBlock;
use viewfuse_kernels::network::attend::{softmax_scale, softmax_value};
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::evidence::{self, ViewPair};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};

pub(super) fn embed_pose(pose_count: u32, embedding: &[f32], poses: &[PoseBlock], embedded: &mut [f32]) {
    let embedding = FourierEmbedding::from_flat(embedding);
    for_each_row(&mut embedded[..pose_count as usize * EMBEDDING], EMBEDDING, 4 * EMBEDDING, |pose, row| {
        row.copy_from_slice(&embedding.embed(&poses[pose].pose()));
    });
}

pub(super) fn softmax_rows(column_count: &u32, row_count: u32, scores: &[f32], weights: &mut [f32]) {
    let columns = *column_count as usize;
    for_each_row(&mut weights[..row_count as usize * columns], columns, 4096, |row, weights| {
        let scores = &scores[row * columns..][..columns];
        let scale = softmax_scale(scores, 0, *column_count);
        Arch::new().dispatch(
            #[inline(always)]
            || weights.iter_mut().zip(scores).for_each(|(weight, score)| *weight = softmax_value(*score, scale)),
        );
    });
}

pub(super) fn merge_depths(block: &FineBlock, ray_count: u32, coarse: &[f32], fine: &[f32], merged: &mut [f32]) {
    let (coarse_count, fine_count) = (block.coarse_count as usize, block.fine_count() as usize);
    let count = coarse_count + fine_count;
    for_each_row(&mut merged[..ray_count as usize * count], count, 1024, |ray, merged| {
        let (coarse, fine) = (&coarse[ray * coarse_count..], &fine[ray * fine_count..]);
        for index in 0..count as u32 {
            let (depth, place) = merged_depth(coarse, fine, block.coarse_count, block.fine_count(), index);
            merged[place as usize] = depth;
        }
    });
}

pub(super) fn compare_views(
    block: &FrustumBlock,
    views: &[SweptView],
    pairs: &[ViewPair],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    grey: &mut [Planes],
    evidence: &mut [Planes],
) {
    let groups = block.group_count as usize;
    let row_len = block.camera.width as usize * groups;
    let slice = block.row_count as usize * row_len;
    // A row of the evidence, and the same row of each view's grey.
    let mut views_of_row: Vec<Vec<&mut [Planes]>> = (0..block.row_count).map(|_| Vec::new()).collect();
    for view in grey[..slice * block.view_count as usize].chunks_exact_mut(slice) {
        views_of_row.iter_mut().zip(view.chunks_exact_mut(row_len)).for_each(|(rows, row)| rows.push(row));
    }
    let views_of_row: Vec<Mutex<Vec<&mut [Planes]>>> = views_of_row.into_iter().map(Mutex::new).collect();
    for_each_row(&mut evidence[..4 * slice], 4 * row_len, 512, |row, evidence| {
        let Ok(mut grey) = views_of_row[row].lock() else { return };
        Arch::new().dispatch(|| {
            for (at, evidence) in evidence.chunks_exact_mut(4).enumerate() {
                let pixel = (block.first_row as usize + row) * block.camera.width as usize + at / groups;
                let group = (at % groups) as u32;
                let found = evidence::evidence(block, views, pairs, texels, disparities, pixel as u32, group);
                evidence.copy_from_slice(&[found.difference, found.weight, found.dissent, found.hull]);
                grey.iter_mut().zip(&found.grey).for_each(|(row, grey)| row[at] = *grey);
            }
        });
    });
}
