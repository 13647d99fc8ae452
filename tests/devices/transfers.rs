//! Arrays there and back.

use crate::candidate::{Candidate, tests};
use bytemuck::{Pod, bytes_of};
use libtest_mimic::Failed;
use std::fmt::Debug;
use viewfuse_core::sampler::Mix;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, Gpu, GpuOptions, Limits, VulkanError};

tests!(
    arrays_of_any_length_come_back, arrays_larger_than_a_transfer_come_back, arrays_in_pieces_come_back,
    tables_are_read_where_they_are_written, uploads_do_not_wait_for_one_another,
);

/// The sum of two arrays.
const SUM: Mix = Mix { state: 1.0, results: [1.0, 0.0, 0.0, 0.0] };

/// Numbers without a pattern that a shifted or repeated stretch would share.
fn number(index: usize) -> u64 {
    (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

fn come_back<T: Pod + PartialEq + Debug>(gpu: &Gpu, length: usize, value: fn(u64) -> T) -> Result<(), VulkanError> {
    let values: Vec<T> = (0..length).map(|index| value(number(index))).collect();
    let buffer = gpu.upload(&values)?;
    assert_eq!((buffer.len(), buffer.is_empty()), (length, length == 0));
    assert!(gpu.download(&buffer)? == values, "{length} elements of {} bytes", size_of::<T>());
    drop(buffer);
    // The memory that was just given back is not zero.
    let zeros = gpu.download(&gpu.zeros::<T>(length)?)?;
    assert!(zeros.len() == length && zeros.iter().all(|zero| *zero == T::zeroed()), "{length}: {zeros:?}");
    Ok(())
}

/// Of every width, to elements that are wider than any that lie in pages.
fn of_every_width(gpu: &Gpu, length: usize) -> Result<(), VulkanError> {
    come_back::<u8>(gpu, length, |number| (number >> 56) as u8)?;
    come_back::<u16>(gpu, length, |number| (number >> 48) as u16)?;
    come_back::<u32>(gpu, length, |number| (number >> 32) as u32)?;
    come_back::<[u32; 3]>(gpu, length, |number| [number as u32, (number >> 32) as u32, 3])?;
    come_back::<[u64; 2]>(gpu, length, |number| [number, !number])?;
    come_back::<[u64; 6]>(gpu, length, |number| [number, 1, !number, 2, number << 1, 3])
}

fn arrays_of_any_length_come_back(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    for length in [0, 1, 2, 3, 5, 7, 63, 64, 65, 1001] {
        of_every_width(&gpu, length)?;
    }
    Ok(())
}

fn arrays_larger_than_a_transfer_come_back(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    // Transfers take 16 MiB at once; the second length is no multiple of anything.
    come_back::<u32>(&gpu, 9_000_001, |number| (number >> 32) as u32)?;
    come_back::<[u32; 3]>(&gpu, 2_800_001, |number| [number as u32, (number >> 32) as u32, 3])?;
    Ok(())
}

fn arrays_in_pieces_come_back(candidate: &Candidate) -> Result<(), Failed> {
    for allocation in [1 << 12, 5000] {
        let limits = Limits { allocation, ..GpuOptions::default().limits };
        let gpu = candidate.gpu(&GpuOptions { limits, ..GpuOptions::default() })?;
        of_every_width(&gpu, 1)?;
        of_every_width(&gpu, 10_001)?;
    }
    Ok(())
}

/// A kernel reads two tables while later ones are written; nothing is submitted for a table alone.
fn tables_are_read_where_they_are_written(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    for length in [1, 3, 1000, 16_384] {
        let values = |table: usize| -> Vec<f32> { (0..length).map(|at| (at + 7 * table) as f32 / 64.0).collect() };
        let before = gpu.submission_count();
        let tables = (0..20).map(|table| gpu.table(&values(table))).collect::<Result<Vec<_>, _>>()?;
        let tables: Vec<Buffer<f32>> = tables.into_iter().map(|table| table.expect("a short one")).collect();
        assert_eq!(gpu.submission_count(), before);
        gpu.submit()?;
        assert_eq!(gpu.submission_count(), before, "nothing is recorded");
        let sums = (1..tables.len())
            .map(|table| {
                let sums = gpu.zeros::<f32>(length)?;
                let [a, b] = [table - 1, table].map(|table| tables[table].bind());
                gpu.dispatch(Kernel::MixPictures, bytes_of(&SUM), 0..length as u32, &[a, b, a, a, a, sums.bind()])?;
                Ok(sums)
            })
            .collect::<Result<Vec<_>, VulkanError>>()?;
        drop(tables);
        // Behind all of these, so that something is recorded however many were submitted.
        let last = gpu.zeros::<u32>(1)?;
        let submitted = gpu.submission_count();
        gpu.submit()?;
        assert_eq!(gpu.submission_count(), submitted + 1, "the device begins");
        drop(last);
        for (table, sums) in (1..).zip(&sums) {
            let expected: Vec<f32> = values(table - 1).iter().zip(values(table)).map(|(a, b)| a + b).collect();
            assert!(gpu.download(sums)? == expected, "tables of {length}");
        }
    }
    assert!(gpu.table(&[0_u8; (64 << 10) + 1])?.is_none() && gpu.table::<u8>(&[])?.is_none());
    assert!(gpu.table(&[1_u8, 2, 3])?.is_some_and(|table| gpu.download(&table).is_ok_and(|read| read == [1, 2, 3])));
    Ok(())
}

/// More than staging memory holds, so that its parts are written again while the device works.
fn uploads_do_not_wait_for_one_another(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    let values = |array: usize| -> Vec<u64> { (0..50_000 + array).map(|index| number(index + 7 * array)).collect() };
    let arrays = (0..100).map(|array| gpu.upload(&values(array))).collect::<Result<Vec<_>, _>>()?;
    let submissions = gpu.submission_count();
    // 40 MB pass through 16 MiB in parts of four: each time that a part is written again.
    assert!(submissions <= 12, "{submissions} submissions for 100 uploads");
    for (index, array) in arrays.iter().enumerate() {
        assert!(gpu.download(array)? == values(index), "array {index}");
    }
    Ok(())
}
