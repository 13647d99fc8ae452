//! A command buffer with what belongs to it: the arrays that it holds, its descriptor sets, its timestamps.

use crate::buffer::Array;
use crate::error::VulkanError;
use crate::handle::Handle;
use crate::kernel::{Access, Kernel};
use ash::vk;
use std::sync::{Arc, Weak};
use std::time::Duration;

/// The most dispatches of a command buffer.
const MAX_DISPATCHES: usize = 128;
/// The longest time that a submission to the queue is expected to take: far below the time limit, and short enough that
/// a display that shares the device is not stopped.
pub(crate) const MAX_TIME: Duration = Duration::from_millis(200);
/// The most bytes of arrays that a command buffer holds, counted at each use.
const MAX_HELD: u64 = 256 << 20;

/// A dispatch that is done, for statistics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Done {
    pub(crate) kernel: Kernel,
    pub(crate) elements: u64,
    /// Time on the device, if it has timestamps.
    pub(crate) time: Option<Duration>,
}

/// Commands that are being recorded, in flight, or kept to be submitted again.
pub(crate) struct Commands {
    pub(crate) raw: vk::CommandBuffer,
    pub(crate) descriptors: vk::DescriptorPool,
    pub(crate) queries: vk::QueryPool,
    pub(crate) fence: vk::Fence,
    held: Vec<(Arc<Array>, Access)>,
    held_bytes: u64,
    /// The kernels that are dispatched, and for how many elements.
    pub(crate) dispatched: Vec<(Kernel, u64)>,
    /// The time that they are expected to take.
    pub(crate) expected: Duration,
    /// Whether anything is recorded.
    pub(crate) is_used: bool,
    /// The recording that they are a part of.
    pub(crate) part_of: Option<Weak<()>>,
}

impl Commands {
    /// Of this pool of command buffers; with timestamps if the device has a clock.
    pub(crate) fn new(handle: &Handle, pool: vk::CommandPool, has_clock: bool) -> Result<Commands, VulkanError> {
        let device = &handle.device;
        let failed = |call| move |result| handle.failure(call, result);
        let bindings = Kernel::ALL.into_iter().map(|kernel| kernel.binding_count()).max().unwrap_or(1);
        let sizes = [vk::DescriptorPoolSize::default()
            .ty(vk::DescriptorType::STORAGE_BUFFER)
            .descriptor_count((bindings * MAX_DISPATCHES) as u32)];
        let descriptors = vk::DescriptorPoolCreateInfo::default().max_sets(MAX_DISPATCHES as u32).pool_sizes(&sizes);
        let queries =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(Self::QUERIES);
        let buffer = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let mut made = Commands {
            raw: vk::CommandBuffer::null(),
            descriptors: vk::DescriptorPool::null(),
            queries: vk::QueryPool::null(),
            fence: vk::Fence::null(),
            held: Vec::new(),
            held_bytes: 0,
            dispatched: Vec::new(),
            expected: Duration::ZERO,
            is_used: false,
            part_of: None,
        };
        // SAFETY: all infos are complete. What was made before a failure is destroyed.
        let outcome = unsafe {
            (|| {
                made.raw = device.allocate_command_buffers(&buffer).map_err(failed("vkAllocateCommandBuffers"))?[0];
                made.descriptors =
                    device.create_descriptor_pool(&descriptors, None).map_err(failed("vkCreateDescriptorPool"))?;
                made.fence =
                    device.create_fence(&vk::FenceCreateInfo::default(), None).map_err(failed("vkCreateFence"))?;
                if has_clock {
                    made.queries = device.create_query_pool(&queries, None).map_err(failed("vkCreateQueryPool"))?;
                }
                Ok(())
            })()
        };
        match outcome {
            Ok(()) => Ok(made),
            Err(error) => {
                made.destroy(handle);
                Err(error)
            }
        }
    }

    /// Timestamps: two for each dispatch.
    pub(crate) const QUERIES: u32 = 2 * MAX_DISPATCHES as u32;

    /// Destroys the handles. They are not in flight.
    pub(crate) fn destroy(&self, handle: &Handle) {
        // SAFETY: the commands are not in flight; null handles are ignored. Command buffers go with their pool.
        unsafe {
            handle.device.destroy_query_pool(self.queries, None);
            handle.device.destroy_fence(self.fence, None);
            handle.device.destroy_descriptor_pool(self.descriptors, None);
        }
    }

    /// Keeps an array, which they read or write, alive until they are done.
    pub(crate) fn hold(&mut self, array: &Arc<Array>, access: Access) {
        self.held_bytes += (array.len * array.stride) as u64;
        self.held.push((array.clone(), access));
        self.is_used = true;
    }

    /// They are submitted again, and write their arrays: what was kept of the numbers in these is out of date.
    pub(crate) fn outdate_written(&self) {
        let written = self.held.iter().filter(|(_, access)| *access == Access::Write);
        written.for_each(|(array, _)| array.halves.outdate());
    }

    /// Forgets what they did.
    pub(crate) fn clear(&mut self) {
        self.held.clear();
        self.held_bytes = 0;
        self.dispatched.clear();
        self.expected = Duration::ZERO;
        (self.is_used, self.part_of) = (false, None);
    }

    pub(crate) fn is_full(&self) -> bool {
        self.dispatched.len() >= MAX_DISPATCHES || self.expected >= MAX_TIME || self.held_bytes >= MAX_HELD
    }

    /// Whether they are a part of the recording of this mark.
    pub(crate) fn is_of(&self, mark: &Arc<()>) -> bool {
        self.part_of.as_ref().is_some_and(|recording| std::ptr::eq(recording.as_ptr(), Arc::as_ptr(mark)))
    }

    /// Whether somebody may submit them again.
    pub(crate) fn is_kept(&self) -> bool {
        self.part_of.as_ref().is_some_and(|recording| recording.strong_count() > 0)
    }
}

/// What the commands of a submission do, for an error.
pub(crate) fn work(parts: &[Commands]) -> String {
    let all = || parts.iter().flat_map(|part| &part.dispatched).map(|(kernel, _)| kernel);
    match (all().next(), all().next_back()) {
        (Some(first), Some(last)) if all().any(|kernel| kernel != first) => {
            format!("{} kernels, from {} to {},", all().count(), first.name(), last.name())
        }
        (Some(only), _) => format!("kernel {}", only.name()),
        (None, _) => "a transfer".to_owned(),
    }
}
