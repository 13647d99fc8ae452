//! What is expected of the drivers that the tests know, and that it is neither less nor more: a driver that begins to
//! do what it did not do fails as well, so that the table stays true and what was left out for it comes back.
//!
//! With it: dispatches that are small before a kernel's time is known, which holds on every device.

use crate::candidate::{Candidate, Test};
use crate::forms::linear;
use bytemuck::bytes_of;
use libtest_mimic::Failed;
use std::time::Duration;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_vulkan::kernel::{Form, Kernel};
use viewfuse_vulkan::{Gpu, GpuOptions, VulkanError};

pub(crate) const TESTS: &[Test] = &[
    Test::new("the_driver_is_as_expected", the_driver_is_as_expected),
    Test::new("an_unknown_kernel_begins_with_a_small_dispatch", an_unknown_kernel_begins_with_a_small_dispatch),
];

/// A property of a driver.
type Property = fn(&Candidate) -> Result<bool, VulkanError>;

/// What is looked at, in the order of the columns of [`EXPECTED`].
const PROPERTIES: [(&str, Property); 4] = [
    ("has subgroups that kernels can use", |candidate| Ok(candidate.adapter.subgroup_size.is_some())),
    ("reports the size of a pipeline's subgroups", |candidate| {
        let options = GpuOptions { form: Some(Form::Subgroup), ..GpuOptions::default() };
        if candidate.adapter.subgroup_size.is_none() {
            return Ok(false);
        }
        let gpu = candidate.gpu(&options)?;
        linear(&gpu)?;
        Ok(gpu.reported_subgroup_size(Kernel::Linear).is_some())
    }),
    ("tells the time of a dispatch", |candidate| {
        let gpu = candidate.gpu(&GpuOptions::default())?;
        fused(&gpu, MANY)?;
        Ok(!gpu.tally(Kernel::FuseViews).time.is_zero())
    }),
    ("keeps compiled pipelines from one process to the next", |candidate| {
        let gpu = candidate.gpu(&GpuOptions::default())?;
        fused(&gpu, 1)?;
        Ok(gpu.remembered().is_some())
    }),
];

/// A part of a device's name, and which of [`PROPERTIES`] hold there.
const EXPECTED: [(&str, [bool; PROPERTIES.len()]); 2] =
    [("llvmpipe", [true, false, true, true]), ("SwiftShader", [false, false, true, true])];

/// Elements of a dispatch that has more than one piece, if pieces are short.
const MANY: u32 = 1 << 17;

fn the_driver_is_as_expected(candidate: &Candidate) -> Result<(), Failed> {
    let name = &candidate.adapter.name;
    let row = EXPECTED.iter().find(|(part, _)| name.contains(part));
    let mut others = Vec::new();
    for (index, (what, property)) in PROPERTIES.into_iter().enumerate() {
        let found = property(candidate)?;
        println!("{name}: {what}: {found}");
        if row.is_some_and(|(_, expected)| expected[index] != found) {
            others.push(format!("{what}: {found}"));
        }
    }
    match others.is_empty() {
        true => Ok(()),
        false => Err(format!("{name} is not as EXPECTED says: {}", others.join("; ")).into()),
    }
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
