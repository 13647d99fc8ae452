//! What the tests need of the drivers that they know; and dispatches that are small before a kernel's time is known.

use crate::candidate::{Candidate, tests};
use bytemuck::bytes_of;
use libtest_mimic::Failed;
use std::time::Duration;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Gpu, GpuOptions, VulkanError};

tests!(a_known_driver_has_what_tests_need, an_unknown_kernel_begins_with_a_small_dispatch);

/// Elements of a dispatch that has more than one piece, if pieces are short.
const MANY: u32 = 1 << 17;

/// Where one of the drivers that the tests know is, no test is skipped for what the driver lacks.
fn a_known_driver_has_what_tests_need(candidate: &Candidate) -> Result<(), Failed> {
    let name = &candidate.adapter.name;
    let is_mesa = name.contains("llvmpipe");
    assert!(candidate.adapter.subgroup_size.is_some() || !is_mesa, "{name} has no subgroups that kernels can use");
    let gpu = candidate.gpu(&GpuOptions::default())?;
    fused(&gpu, MANY)?;
    let is_known = is_mesa || name.contains("SwiftShader");
    assert!(!gpu.tally(Kernel::FuseViews).time.is_zero() || !is_known, "{name} does not tell the time of a dispatch");
    Ok(())
}

/// Two views with the weights 0.25 and 0.75, as bits.
fn fused(gpu: &Gpu, count: u32) -> Result<Vec<u32>, VulkanError> {
    let latents: Vec<f32> = (0..2 * count).map(|at| (at % 1009) as f32).collect();
    let (weights, latents) = (gpu.upload(&[0.25_f32, 0.75])?, gpu.upload(&latents)?);
    let fused = gpu.zeros::<f32>(count as usize)?;
    let block = FuseBlock { view_count: 2, stride: count, channel_count: count, weight_stride: 0 };
    gpu.dispatch(Kernel::FuseViews, bytes_of(&block), 0..count, &[weights.bind(), latents.bind(), fused.bind()])?;
    Ok(gpu.download(&fused)?.into_iter().map(f32::to_bits).collect())
}

fn an_unknown_kernel_begins_with_a_small_dispatch(candidate: &Candidate) -> Result<(), Failed> {
    let whole = candidate.gpu(&GpuOptions { longest_piece: Some(Duration::MAX), ..GpuOptions::default() })?;
    let expected = fused(&whole, MANY)?;
    // The first piece is small although nothing is too long: its time is not known yet. The rest is one piece.
    assert_eq!(whole.tally(Kernel::FuseViews).dispatches, 2);
    assert!(fused(&whole, MANY)? == expected);
    assert_eq!(whole.tally(Kernel::FuseViews).dispatches, 3, "its time is known now");
    let short = candidate.gpu(&GpuOptions { longest_piece: Some(Duration::from_nanos(1)), ..GpuOptions::default() })?;
    assert!(fused(&short, MANY)? == expected, "pieces changed the result");
    let tally = short.tally(Kernel::FuseViews);
    assert!(tally.dispatches > 4 && tally.elements == u64::from(MANY), "{tally:?}");
    Ok(())
}
