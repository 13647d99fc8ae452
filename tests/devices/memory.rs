//! Out of memory: the error says the requested and the available memory, and the device goes on working.

use crate::candidate::{Candidate, assert_works, tests};
use libtest_mimic::Failed;
use std::env;
use std::path::PathBuf;
use viewfuse_vulkan::{Adapter, Gpu, GpuOptions, Instance, InstanceOptions, Limits, VulkanError};

tests!(memory_that_is_not_there_is_refused, memory_that_the_driver_refuses_is_refused, memory_is_given_back);

fn lowered(candidate: &Candidate, allocation: u64, memory: u64) -> Result<Gpu, VulkanError> {
    let limits = Limits { allocation, memory, ..GpuOptions::default().limits };
    candidate.gpu(&GpuOptions { limits, ..GpuOptions::default() })
}

/// Asked for, available and in all, of what must be a lack of memory.
fn numbers<T>(outcome: Result<T, VulkanError>) -> Result<[u64; 3], Failed> {
    match outcome {
        Err(VulkanError::OutOfMemory { requested, available, total, .. }) => Ok([requested, available, total]),
        Err(error) => Err(format!("another error: {error}").into()),
        Ok(_) => Err("there was room".into()),
    }
}

fn memory_that_is_not_there_is_refused(candidate: &Candidate) -> Result<(), Failed> {
    // In one piece, and in several.
    for allocation in [1 << 19, 1 << 16] {
        let gpu = lowered(candidate, allocation, 3 << 20)?;
        assert_works(&gpu)?;
        let kept = gpu.zeros::<u32>(1 << 18)?;
        let first = numbers(gpu.zeros::<u32>(1 << 20))?;
        let [requested, available, total] = first;
        // The staging buffers and the array that is kept are in use.
        assert_eq!((requested, total), (4 << 20, 3 << 20));
        assert!(available > 1 << 19 && available <= 2 << 20, "{available}");
        // Nothing was taken by the attempt.
        assert_eq!(numbers(gpu.upload(&vec![1_u32; 1 << 20]))?, first);
        assert_works(&gpu)?;
        assert!(gpu.download(&kept)?.iter().all(|value| *value == 0));
    }
    // More than there is, and more than can be counted.
    let gpu = candidate.gpu(&GpuOptions::default())?;
    for length in [1_usize << 45, usize::MAX / 2] {
        let [requested, available, total] = numbers(gpu.zeros::<[u32; 4]>(length))?;
        assert_eq!(requested, (length as u64).saturating_mul(16).checked_next_multiple_of(4).unwrap_or(u64::MAX));
        assert!(available <= total && total == candidate.adapter.memory, "{available} of {total}");
    }
    assert_works(&gpu)?;
    Ok(())
}

/// An adapter that promises more than there is: the driver itself has to say no.
fn memory_that_the_driver_refuses_is_refused(candidate: &Candidate) -> Result<(), Failed> {
    // Validation layers would say that nobody may ask for so much: Vulkan anew, without them.
    let loader = env::var_os("VIEWFUSE_VULKAN_LOADER").map(PathBuf::from);
    let instance = Instance::load(&InstanceOptions { loader, validation: false })?;
    let adapters = instance.adapters()?;
    let mut boastful = Adapter::choose(&adapters, &candidate.adapter.index.to_string())?.clone();
    (boastful.limits.allocation, boastful.limits.memory) = (u64::MAX, u64::MAX);
    let gpu = Gpu::open(&instance, &boastful, &GpuOptions::default())?;
    for _ in 0..2 {
        let [requested, available, _] = numbers(gpu.zeros::<u32>(1 << 50))?;
        assert!(requested == 1 << 52 && available > 0, "{requested}, {available}");
        assert_works(&gpu)?;
    }
    Ok(())
}

/// A loop that needs the memory again and again, without waiting in between.
fn memory_is_given_back(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = lowered(candidate, 1 << 16, 1 << 20)?;
    for round in 0..20 {
        let values = vec![round; 100_000];
        assert!(gpu.download(&gpu.upload(&values)?)? == values);
        gpu.zeros::<u32>(150_000)?;
    }
    Ok(())
}
