//! A device with lowered limits: work is cut into pieces, and the picture is the same; where nothing can be cut any
//! finer, the error names the limit.

use crate::candidate::{Candidate, assert_works, tests};
use crate::picture::{KERNELS, Rendering, SIDE, SOURCE_COUNT};
use bytemuck::bytes_of;
use libtest_mimic::Failed;
use viewfuse::device::DeviceError;
use viewfuse::field::FieldError;
use viewfuse::field::render::RenderError;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{GpuOptions, Limits, VulkanError};

tests!(
    a_lower_buffer_range_gives_the_same_picture,
    a_lower_allocation_gives_the_same_picture,
    fewer_workgroups_give_the_same_picture,
    all_limits_lowered_give_the_same_picture,
    what_cannot_be_cut_names_the_limit,
    a_picture_that_cannot_be_cut_names_the_limit
);

/// Ten rows or more of a sweep's widest array: a band with its halo of eight. No power of two, so that pages are
/// shorter.
const BYTES: u64 = 96 << 10;
/// A page of the scene then.
const PAGE_BYTES: u64 = 64 << 10;
/// Workgroups of a piece.
const WORKGROUP_COUNT: u32 = 8;
/// Kernels whose work is cut into bands of rows.
const IN_BANDS: [Kernel; 4] = [Kernel::MatchCost, Kernel::SumRow, Kernel::MeanColumn, Kernel::PickDepth];

fn device_limits() -> Limits {
    GpuOptions::default().limits
}

/// All that a picture stands.
fn all_lowered() -> Limits {
    Limits { buffer_range: BYTES, allocation: BYTES, workgroup_count: WORKGROUP_COUNT, ..device_limits() }
}

/// Each limit in bytes lowered alone, with its name in Vulkan.
fn lowered(bytes: u64) -> [(Limits, &'static str); 2] {
    [
        (Limits { buffer_range: bytes, ..device_limits() }, "maxStorageBufferRange"),
        (Limits { allocation: bytes, ..device_limits() }, "maxMemoryAllocationSize"),
    ]
}

fn under(limits: Limits) -> GpuOptions {
    GpuOptions { limits, ..GpuOptions::default() }
}

fn same_picture(candidate: &Candidate, limits: Limits, in_pieces: &[Kernel]) -> Result<(), Failed> {
    let device = candidate.vulkan(&under(limits))?;
    let cut = Rendering::on_vulkan(&device).map_err(|error| format!("{error:?}"))?;
    let whole = candidate.rendering()?;
    assert!(cut.is_the_same_as(whole), "another picture under {limits:?}");
    cut.assert_is_the_cpus()?;
    for kernel in KERNELS {
        let (cut, whole) = (cut.tally(kernel), whole.tally(kernel));
        let has_more = cut.dispatches > whole.dispatches;
        assert_eq!(has_more, in_pieces.contains(&kernel), "{}: {cut:?}, {whole:?}", kernel.name());
        // Bands overlap.
        let overlaps = limits.buffer_range.min(limits.allocation) == BYTES && IN_BANDS.contains(&kernel);
        assert_eq!(cut.elements > whole.elements, overlaps, "{}: {cut:?}, {whole:?}", kernel.name());
    }
    Ok(())
}

/// The texels of all sources take all four pages of this length, and fit.
const _: () = {
    let bytes = (SIDE * SIDE) as u64 * SOURCE_COUNT as u64 * 16;
    assert!(bytes > 3 * PAGE_BYTES && bytes <= 4 * PAGE_BYTES);
};

fn a_lower_buffer_range_gives_the_same_picture(candidate: &Candidate) -> Result<(), Failed> {
    same_picture(candidate, Limits { buffer_range: BYTES, ..device_limits() }, &IN_BANDS)
}

fn a_lower_allocation_gives_the_same_picture(candidate: &Candidate) -> Result<(), Failed> {
    same_picture(candidate, Limits { allocation: BYTES, ..device_limits() }, &IN_BANDS)
}

fn fewer_workgroups_give_the_same_picture(candidate: &Candidate) -> Result<(), Failed> {
    same_picture(candidate, Limits { workgroup_count: WORKGROUP_COUNT, ..device_limits() }, &KERNELS)
}

fn all_limits_lowered_give_the_same_picture(candidate: &Candidate) -> Result<(), Failed> {
    same_picture(candidate, all_lowered(), &KERNELS)
}

/// Under limits that are far too low, something is refused that needs more than there is.
fn refused(outcome: Result<(), VulkanError>, name: &str, lowered: u64) -> Result<String, Failed> {
    match outcome {
        Err(VulkanError::Limit { what, limit, needed, available, .. }) => {
            assert_eq!((limit, available), (name, lowered), "{what}");
            assert!(needed > available, "{what}: {needed} of {available}");
            Ok(what)
        }
        other => Err(format!("{other:?}").into()),
    }
}

fn what_cannot_be_cut_names_the_limit(candidate: &Candidate) -> Result<(), Failed> {
    // An array that a kernel needs in one piece.
    for (limits, name) in lowered(1024) {
        let gpu = candidate.gpu(&under(limits))?;
        let (few, many) = (gpu.upload(&[1.0_f32; 256])?, gpu.upload(&[1.0_f32; 257])?);
        let fused = gpu.zeros::<f32>(256)?;
        let block = FuseBlock { view_count: 1, ..FuseBlock::default() };
        let run = |array: &viewfuse_vulkan::Buffer<f32>| {
            gpu.dispatch(Kernel::FuseViews, bytes_of(&block), 0..256, &[few.bind(), array.bind(), fused.bind()])
        };
        assert_eq!(refused(run(&many), name, 1024)?, "array latents of kernel fuse_views");
        run(&few)?;
        assert_works(&gpu)?;
    }
    // An element that is larger than any allocation.
    let gpu = candidate.gpu(&under(Limits { allocation: 12, ..device_limits() }))?;
    assert_eq!(
        refused(gpu.zeros::<[f32; 4]>(1).map(|_| ()), "maxMemoryAllocationSize", 12)?,
        "an array of 16 bytes an element"
    );
    assert_eq!(gpu.download(&gpu.upload(&[[1.0_f32; 3]; 9])?)?, [[1.0; 3]; 9]);
    let nothing = candidate.gpu(&under(Limits { allocation: 0, buffer_range: 0, ..device_limits() }))?;
    refused(nothing.upload(&[1_u8]).map(|_| ()), "maxMemoryAllocationSize", 0)?;
    Ok(())
}

fn a_picture_that_cannot_be_cut_names_the_limit(candidate: &Candidate) -> Result<(), Failed> {
    // Too short for a row of a sweep with its halo, for the scene in four pages, and for the shortest page.
    for (bytes, array) in [(64 << 10, "row_sums"), (32 << 10, "texels"), (512, "texels")] {
        for (limits, name) in lowered(bytes) {
            let device = candidate.vulkan(&under(limits))?;
            let outcome = match Rendering::on_vulkan(&device) {
                Err(RenderError::Field(FieldError::Device(DeviceError::Vulkan(error)))) => Err(error),
                Err(error) => return Err(error.to_string().into()),
                Ok(_) => Ok(()),
            };
            let what = refused(outcome, name, bytes)?;
            assert!(what.contains(&format!("array {array} of kernel")), "{bytes}: {what}");
        }
    }
    Ok(())
}
