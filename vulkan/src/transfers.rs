//! Arrays between host and device.

use crate::buffer::{Array, Buffer, Coming};
use crate::error::VulkanError;
use crate::gpu::{Gpu, State};
use crate::handle::Memory;
use crate::kernel::Access;
use crate::staging::{Places, Ring};
use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

/// Bytes of staging memory each way, where one allocation can have so many.
const STAGING: u64 = 16 << 20;
/// Most bytes that are recorded with the commands: the most of an update.
const INLINE: usize = 64 << 10;

impl Gpu {
    /// An array with these values.
    ///
    /// # Errors
    /// [`VulkanError::OutOfMemory`], or another if the device fails.
    pub fn upload<T: Pod>(&self, values: &[T]) -> Result<Buffer<T>, VulkanError> {
        let buffer = self.array::<T>(values.len())?;
        self.write(&buffer.array, bytemuck::cast_slice(values))?;
        Ok(buffer)
    }

    /// A short array with these values in memory that host and device share: the device reads them where they are
    /// written. `None` for one of more than 64 KiB, and for an empty one.
    ///
    /// # Errors
    /// As [`Gpu::upload`].
    pub fn table<T: Pod>(&self, values: &[T]) -> Result<Option<Buffer<T>>, VulkanError> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        if !(1..=INLINE).contains(&bytes.len()) {
            return Ok(None);
        }
        self.with_state(|_, state| {
            state.submissions.note(false);
            Ok(())
        })?;
        let mut memory = self.host_memory(bytes.len() as u64, MemoryLocation::CpuToGpu)?;
        memory.mapped().ok_or_else(|| self.hidden())?[..bytes.len()].copy_from_slice(bytes);
        Ok(Some(Buffer::new(Array::new(vec![memory], values.len(), values.len(), size_of::<T>()))))
    }

    /// Memory that the host sees. What was released while submissions in flight used it is free when they are done.
    fn host_memory(&self, bytes: u64, location: MemoryLocation) -> Result<Memory, VulkanError> {
        let bytes = bytes.next_multiple_of(4).max(4);
        match self.handle.memory(bytes, location) {
            Err(VulkanError::OutOfMemory { .. }) => {
                self.wait()?;
                self.handle.memory(bytes, location)
            }
            memory => memory,
        }
    }

    /// Writes all bytes of an array. Without the type of its elements, so that it is compiled once.
    fn write(&self, array: &Arc<Array>, bytes: &[u8]) -> Result<(), VulkanError> {
        let is_one_piece = array.chunks.len() == 1;
        self.with_state(|gpu, state| {
            if is_one_piece && (1..=INLINE).contains(&bytes.len()) {
                return gpu.update(state, array, bytes);
            }
            for_each_stretch(array, array.len, gpu.staging_bytes(), |memory, offset, range| {
                gpu.write_piece(state, array, memory, offset, &bytes[range])
            })
        })
    }

    /// Writes bytes of one of an array's buffers.
    pub(crate) fn write_piece(
        &self,
        state: &mut State,
        array: &Arc<Array>,
        memory: &Memory,
        offset: u64,
        bytes: &[u8],
    ) -> Result<(), VulkanError> {
        let (to, mut written) = (memory.buffer, 0);
        while written < bytes.len() {
            let (from, place) = self.stage(state, &bytes[written..])?;
            let submission = state.submissions.next();
            let copy = vk::BufferCopy {
                src_offset: place.start as u64,
                dst_offset: offset + written as u64,
                size: place.len() as u64,
            };
            self.record(state, &[(array, Access::Write)], |device, commands, _| {
                // SAFETY: both ranges exist; the submission is waited for before staging is written again there.
                unsafe { device.cmd_copy_buffer(commands.raw, from, to, &[copy]) };
                Ok(())
            })?;
            if let Some(ring) = &mut state.upload {
                ring.places.copied(submission);
            }
            written += place.len();
        }
        Ok(())
    }

    /// Records the bytes of a short array with the commands: nobody waits.
    fn update(&self, state: &mut State, array: &Arc<Array>, bytes: &[u8]) -> Result<(), VulkanError> {
        // Updates take multiples of four bytes only, of which buffers have enough.
        let mut padded = bytes.to_vec();
        padded.resize(bytes.len().next_multiple_of(4), 0);
        let to = array.chunks[0].buffer;
        self.record(state, &[(array, Access::Write)], |device, commands, _| {
            // SAFETY: the buffer is so long, and so is the longest update.
            unsafe { device.cmd_update_buffer(commands.raw, to, 0, &padded) };
            Ok(())
        })
    }

    /// An array of zeros.
    ///
    /// # Errors
    /// As [`Gpu::upload`].
    pub fn zeros<T: Pod>(&self, count: usize) -> Result<Buffer<T>, VulkanError> {
        let buffer = self.array::<T>(count)?;
        self.clear(&buffer.array)?;
        Ok(buffer)
    }

    fn clear(&self, array: &Arc<Array>) -> Result<(), VulkanError> {
        self.with_state(|gpu, state| {
            gpu.record(state, &[(array, Access::Write)], |device, commands, _| {
                for memory in &array.chunks {
                    // SAFETY: the buffer is a multiple of four bytes long.
                    unsafe { device.cmd_fill_buffer(commands.raw, memory.buffer, 0, vk::WHOLE_SIZE, 0) };
                }
                Ok(())
            })
        })
    }

    /// The values of an array after all earlier dispatches.
    ///
    /// # Errors
    /// If the device fails, or failed before; [`VulkanError::OtherDevice`].
    pub fn download<T: Pod>(&self, buffer: &Buffer<T>) -> Result<Vec<T>, VulkanError> {
        self.download_first(buffer, buffer.len())
    }

    /// The first `count` values, or all if there are fewer.
    ///
    /// # Errors
    /// As [`Gpu::download`].
    pub fn download_first<T: Pod>(&self, buffer: &Buffer<T>, count: usize) -> Result<Vec<T>, VulkanError> {
        buffer.array.check_owner(&self.handle)?;
        let mut values = vec![T::zeroed(); count.min(buffer.len())];
        self.read(&buffer.array, bytemuck::cast_slice_mut(&mut values))?;
        Ok(values)
    }

    /// Begins to copy the values that an array has after all earlier dispatches to the host; nobody waits. `None` for
    /// an array that is larger than staging memory.
    ///
    /// # Errors
    /// As [`Gpu::upload`]; [`VulkanError::OtherDevice`].
    pub fn download_later<T: Pod>(&self, buffer: &Buffer<T>) -> Result<Option<Coming<T>>, VulkanError> {
        let from = &buffer.array;
        from.check_owner(&self.handle)?;
        let (len, stride) = (from.len, from.stride);
        if len * stride > self.staging_bytes() {
            return Ok(None);
        }
        let chunk = self.host_memory((len * stride) as u64, MemoryLocation::GpuToCpu)?;
        let to = Arc::new(Array::new(vec![chunk], len.max(1), len, stride));
        let mut submission = 0;
        self.with_state(|gpu, state| {
            for_each_stretch(from, len, usize::MAX, |memory, offset, range| {
                submission = state.submissions.next();
                let (source, target, size) = (memory.buffer, to.chunks[0].buffer, range.len() as u64);
                let copy = vk::BufferCopy { src_offset: offset, dst_offset: range.start as u64, size };
                gpu.record(state, &[(from, Access::Read), (&to, Access::Write)], |device, commands, _| {
                    copy_to_host(device, commands.raw, source, target, copy);
                    Ok(())
                })
            })
        })?;
        Ok(Some(Coming { array: to, submission, kind: PhantomData }))
    }

    /// The values of [`Gpu::download_later`]; waits for them where they are not there yet.
    ///
    /// # Errors
    /// As [`Gpu::download`].
    pub fn arrived<T: Pod>(&self, coming: Coming<T>) -> Result<Vec<T>, VulkanError> {
        let Coming { array, submission, .. } = coming;
        array.check_owner(&self.handle)?;
        self.with_state(|_, state| state.wait_for(submission))?;
        let mut values = vec![T::zeroed(); array.len];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        let seen = array.chunks[0].seen().ok_or_else(|| self.hidden())?;
        bytes.copy_from_slice(&seen[..bytes.len()]);
        Ok(values)
    }

    /// Reads the first bytes of an array, whole elements.
    fn read(&self, array: &Arc<Array>, bytes: &mut [u8]) -> Result<(), VulkanError> {
        let count = bytes.len() / array.stride;
        self.with_state(|gpu, state| {
            for_each_stretch(array, count, gpu.staging_bytes(), |memory, offset, range| {
                gpu.read_piece(state, array, memory, offset, &mut bytes[range])
            })
        })
    }

    /// Reads bytes of one of an array's buffers, at most those of a staging buffer.
    pub(crate) fn read_piece(
        &self,
        state: &mut State,
        array: &Arc<Array>,
        memory: &Memory,
        offset: u64,
        bytes: &mut [u8],
    ) -> Result<(), VulkanError> {
        if state.download.is_none() {
            state.download = Some(self.handle.memory(self.staging_bytes() as u64, MemoryLocation::GpuToCpu)?);
        }
        let (to, _) = self.mapped(state.download.as_mut())?;
        let copy = vk::BufferCopy::default().src_offset(offset).size(bytes.len() as u64);
        let from = memory.buffer;
        self.record(state, &[(array, Access::Read)], |device, commands, _| {
            copy_to_host(device, commands.raw, from, to, copy);
            Ok(())
        })?;
        state.wait()?;
        let (_, mapped) = self.mapped(state.download.as_mut())?;
        bytes.copy_from_slice(&mapped[..bytes.len()]);
        Ok(())
    }

    /// Fills the first bytes of an array, whole words within its first buffer.
    pub(crate) fn fill_start(
        &self,
        state: &mut State,
        array: &Arc<Array>,
        bytes: usize,
        word: u32,
    ) -> Result<(), VulkanError> {
        let to = array.chunks[0].buffer;
        self.record(state, &[(array, Access::Write)], |device, commands, _| {
            // SAFETY: the range is the buffer's, and a multiple of four bytes long.
            unsafe { device.cmd_fill_buffer(commands.raw, to, 0, bytes as u64, word) };
            Ok(())
        })
    }

    /// Memory for an array: one buffer, or one a page if no allocation is large enough.
    fn array<T: Pod>(&self, len: usize) -> Result<Buffer<T>, VulkanError> {
        const { assert!(size_of::<T>() > 0, "elements without bytes cannot be counted on a device") };
        Ok(Buffer::new(self.array_of(len, size_of::<T>())?))
    }

    /// The same for elements of so many bytes.
    fn array_of(&self, len: usize, stride: usize) -> Result<Array, VulkanError> {
        let available = self.handle.limits.allocation;
        // An element goes through staging as a whole.
        let affordable = if stride > self.staging_bytes() {
            0
        } else {
            usize::try_from(available & !3).unwrap_or(usize::MAX) / stride
        };
        if affordable == 0 {
            let (what, needed) =
                (format!("an array of {stride} bytes an element"), (stride as u64).next_multiple_of(4));
            let limit = "maxMemoryAllocationSize";
            return Err(VulkanError::Limit { device: self.handle.name.clone(), what, limit, needed, available });
        }
        // Pages are short enough for elements that kernels bind in pages; wider ones are never bound so.
        let chunk_len = if len <= affordable { len.max(1) } else { affordable.min(1 << self.page_shift) };
        let chunks = match self.chunks(len, chunk_len, stride) {
            // Memory that was released while submissions in flight used it is free when they are done.
            Err(VulkanError::OutOfMemory { .. }) => {
                self.wait()?;
                self.chunks(len, chunk_len, stride)?
            }
            chunks => chunks?,
        };
        Ok(Array::new(chunks, chunk_len, len, stride))
    }

    /// Memory for `len` elements, but at least one, `chunk_len` in each piece. If the whole does not fit, no piece is
    /// allocated.
    fn chunks(&self, len: usize, chunk_len: usize, stride: usize) -> Result<Vec<Memory>, VulkanError> {
        // Fills take multiples of four bytes only.
        let bytes = |count: usize| (count as u64).saturating_mul(stride as u64).checked_next_multiple_of(4);
        let bytes = |count: usize| bytes(count).unwrap_or(u64::MAX);
        let len = len.max(1);
        if !self.handle.has_room(bytes(len)) {
            return Err(self.handle.out_of_memory(bytes(len)));
        }
        let chunk = |first: usize| self.handle.memory(bytes(chunk_len.min(len - first)), MemoryLocation::GpuOnly);
        (0..len).step_by(chunk_len).map(chunk).collect::<Result<_, _>>().map_err(|error| match error {
            // The pieces before it are freed: the error is about the array as a whole.
            VulkanError::OutOfMemory { .. } => self.handle.out_of_memory(bytes(len)),
            error => error,
        })
    }

    /// Most bytes of a download at a time, and of the uploads in flight.
    pub(crate) fn staging_bytes(&self) -> usize {
        STAGING.min(self.handle.limits.allocation) as usize
    }

    /// Copies bytes, as many as fit, to a place that the next submission is to read: the buffer and the place. It waits
    /// only where the device still copies from there.
    fn stage(&self, state: &mut State, bytes: &[u8]) -> Result<(vk::Buffer, Range<usize>), VulkanError> {
        if state.upload.is_none() {
            let bytes = self.staging_bytes();
            let memory = self.handle.memory(bytes as u64, MemoryLocation::CpuToGpu)?;
            state.upload = Some(Ring { memory, places: Places::new(bytes) });
        }
        let (place, copied_in) = state.upload.as_mut().map_or((0..0, 0), |ring| ring.places.take(bytes.len()));
        state.wait_for(copied_in)?;
        let (buffer, mapped) = self.mapped(state.upload.as_mut().map(|ring| &mut ring.memory))?;
        mapped[place.clone()].copy_from_slice(&bytes[..place.len()]);
        Ok((buffer, place))
    }

    /// Staging memory and its mapping on the host.
    fn mapped<'a>(&self, staging: Option<&'a mut Memory>) -> Result<(vk::Buffer, &'a mut [u8]), VulkanError> {
        let mapped = staging.and_then(|memory| Some((memory.buffer, memory.mapped()?)));
        mapped.ok_or_else(|| self.hidden())
    }

    fn hidden(&self) -> VulkanError {
        VulkanError::Memory(self.handle.name.clone(), "staging memory is not visible to the host".to_owned())
    }
}

/// Records a copy between ranges that exist, to memory that the host reads after it waited for the submission.
fn copy_to_host(
    device: &ash::Device,
    commands: vk::CommandBuffer,
    from: vk::Buffer,
    to: vk::Buffer,
    copy: vk::BufferCopy,
) {
    let seen = [vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(vk::AccessFlags::HOST_READ)];
    let (transfer, host) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
    // SAFETY: both ranges exist, and both buffers live until the submission is done.
    unsafe {
        device.cmd_copy_buffer(commands, from, to, &[copy]);
        let none = vk::DependencyFlags::empty();
        device.cmd_pipeline_barrier(commands, transfer, host, none, &seen, &[], &[]);
    }
}

/// Calls with each range of at most `most` bytes of the first `len` elements of an array within one chunk: the chunk,
/// the byte in it, and the bytes of the whole array.
fn for_each_stretch(
    array: &Array,
    len: usize,
    most: usize,
    mut work: impl FnMut(&Memory, u64, Range<usize>) -> Result<(), VulkanError>,
) -> Result<(), VulkanError> {
    let most_elements = (most / array.stride).max(1);
    let mut first = 0;
    while first < len {
        let (memory, offset, there) = array.place(first);
        let count = there.min(most_elements).min(len - first);
        work(memory, offset, first * array.stride..(first + count) * array.stride)?;
        first += count;
    }
    Ok(())
}
