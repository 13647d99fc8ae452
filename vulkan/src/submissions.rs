//! Submissions to the queue.
//!
//! Up to [`MOST_IN_FLIGHT`] submissions are in flight at once, so that the device works while the host prepares the next
//! ones. A submission keeps its resources alive until its fence is signalled.

use crate::buffer::Array;
use crate::error::VulkanError;
use crate::handle::Handle;
use crate::kernel::Kernel;
use ash::vk;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The most submissions in flight.
const MOST_IN_FLIGHT: usize = 8;

/// The work of a submission, for statistics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Done {
    pub(crate) kernel: Kernel,
    /// Time on the device, if it has timestamps.
    pub(crate) time: Option<Duration>,
}

/// Commands that are being recorded or in flight.
pub(crate) struct Submission {
    pub(crate) commands: vk::CommandBuffer,
    pub(crate) descriptors: vk::DescriptorPool,
    queries: vk::QueryPool,
    fence: vk::Fence,
    held: Vec<Arc<Array>>,
    kernel: Option<Kernel>,
}

/// The queue's submissions, in order.
pub(crate) struct Submissions {
    pool: vk::CommandPool,
    free: Vec<Submission>,
    running: VecDeque<Submission>,
    /// Time limit of the oldest; `None` without a limit.
    time_limit: Option<Duration>,
    /// The least time that closing the device waits for submissions in flight.
    closing: Duration,
    /// One exceeded the time limit.
    is_late: bool,
    /// Nanoseconds of a timestamp's unit; `None` without timestamps.
    tick: Option<f32>,
    /// Valid bits of a timestamp.
    tick_mask: u64,
    handle: Arc<Handle>,
}

impl Submissions {
    pub(crate) fn new(
        handle: &Arc<Handle>,
        queue_family: u32,
        timestamps: Option<(f32, u32)>,
        time_limit: Option<Duration>,
        closing: Duration,
    ) -> Result<Submissions, VulkanError> {
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device has this family.
        let pool = unsafe { handle.device.create_command_pool(&info, None) }
            .map_err(|result| handle.failure("vkCreateCommandPool", result))?;
        Ok(Submissions {
            pool,
            free: Vec::new(),
            running: VecDeque::new(),
            time_limit,
            closing,
            is_late: false,
            tick: timestamps.map(|(period, _)| period),
            tick_mask: timestamps.map_or(0, |(_, bits)| u64::MAX >> (64 - bits.clamp(1, 64))),
            handle: handle.clone(),
        })
    }

    /// Starts recording. If all submissions are in flight, it waits for the oldest first.
    pub(crate) fn begin(&mut self, done: &mut impl FnMut(Done)) -> Result<Submission, VulkanError> {
        if self.running.len() >= MOST_IN_FLIGHT {
            self.wait_for_oldest(done)?;
        }
        let submission = match self.free.pop() {
            Some(submission) => submission,
            None => self.create()?,
        };
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the commands are not in flight; the pool allows to record them again.
        let begun = unsafe { self.handle.device.begin_command_buffer(submission.commands, &info) };
        match begun {
            Ok(()) => Ok(submission),
            Err(result) => {
                self.free.push(submission);
                Err(self.handle.failure("vkBeginCommandBuffer", result))
            }
        }
    }

    /// Takes back a submission whose recording failed.
    pub(crate) fn discard(&mut self, mut submission: Submission) {
        let no_flags = vk::DescriptorPoolResetFlags::empty();
        // A set that was allocated before the failure would leave no space for the next one. By the specification this call
        // cannot fail; if it does, the next allocation reports it.
        // SAFETY: the submission is not in flight.
        let _ = unsafe { self.handle.device.reset_descriptor_pool(submission.descriptors, no_flags) };
        submission.held.clear();
        submission.kernel = None;
        self.free.push(submission);
    }

    /// Submits recorded commands.
    pub(crate) fn submit(&mut self, submission: Submission) -> Result<(), VulkanError> {
        let commands = [submission.commands];
        let info = [vk::SubmitInfo::default().command_buffers(&commands)];
        let Handle { device, queue, .. } = &*self.handle;
        // SAFETY: the commands are recorded, and hold all that they use; the fence is not in use.
        let submitted = unsafe {
            device
                .end_command_buffer(submission.commands)
                .map_err(|result| self.handle.failure("vkEndCommandBuffer", result))
                .and_then(|()| {
                    let submitted = device.queue_submit(*queue, &info, submission.fence);
                    submitted.map_err(|result| self.handle.failure("vkQueueSubmit", result))
                })
        };
        match submitted {
            Ok(()) => self.running.push_back(submission),
            Err(_) => self.discard(submission),
        }
        submitted
    }

    /// Waits until all submissions are done.
    pub(crate) fn wait(&mut self, done: &mut impl FnMut(Done)) -> Result<(), VulkanError> {
        while !self.running.is_empty() {
            self.wait_for_oldest(done)?;
        }
        Ok(())
    }

    /// Waits for the oldest submission, at most for the time limit: earlier ones are done, so all of that time is its
    /// own.
    fn wait_for_oldest(&mut self, done: &mut impl FnMut(Done)) -> Result<(), VulkanError> {
        let Some(oldest) = self.running.front() else { return Ok(()) };
        let nanoseconds = |limit: Duration| u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        let nanoseconds = self.time_limit.map_or(u64::MAX, nanoseconds);
        let Handle { device, .. } = &*self.handle;
        // SAFETY: the fence belongs to a submission that is in flight.
        let waited = unsafe { device.wait_for_fences(&[oldest.fence], true, nanoseconds) };
        self.is_late |= waited == Err(vk::Result::TIMEOUT);
        waited.map_err(|result| match result {
            vk::Result::TIMEOUT => VulkanError::TimeLimit {
                device: self.handle.name.clone(),
                work: oldest.kernel.map_or("a transfer".to_owned(), |kernel| format!("kernel {}", kernel.name())),
                limit: self.time_limit.unwrap_or_default(),
            },
            result => self.handle.failure("vkWaitForFences", result),
        })?;
        if let Some(kernel) = oldest.kernel {
            done(Done { kernel, time: self.time_of(oldest)? });
        }
        let no_flags = vk::DescriptorPoolResetFlags::empty();
        // SAFETY: the submission is done.
        let (fences, descriptors) = unsafe {
            (device.reset_fences(&[oldest.fence]), device.reset_descriptor_pool(oldest.descriptors, no_flags))
        };
        fences.map_err(|result| self.handle.failure("vkResetFences", result))?;
        descriptors.map_err(|result| self.handle.failure("vkResetDescriptorPool", result))?;
        if let Some(mut oldest) = self.running.pop_front() {
            oldest.held.clear();
            oldest.kernel = None;
            self.free.push(oldest);
        }
        self.handle.check_messages()
    }

    fn time_of(&self, submission: &Submission) -> Result<Option<Duration>, VulkanError> {
        let Some(tick) = self.tick else { return Ok(None) };
        let mut ticks = [0_u64; 2];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: both queries were written by the submission, which is done.
        unsafe { self.handle.device.get_query_pool_results(submission.queries, 0, &mut ticks, flags) }
            .map_err(|result| self.handle.failure("vkGetQueryPoolResults", result))?;
        let passed = ticks[1].wrapping_sub(ticks[0]) & self.tick_mask;
        Ok(Some(Duration::from_nanos((passed as f64 * f64::from(tick)) as u64)))
    }

    /// Writes the timestamp before a kernel.
    pub(crate) fn start_clock(&self, submission: &mut Submission, kernel: Kernel) {
        submission.kernel = Some(kernel);
        if self.tick.is_some() {
            let Handle { device, .. } = &*self.handle;
            // SAFETY: the commands are being recorded; the pool has two queries.
            unsafe {
                device.cmd_reset_query_pool(submission.commands, submission.queries, 0, 2);
                // After all earlier commands: waiting for them is not the kernel's time.
                let before = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
                device.cmd_write_timestamp(submission.commands, before, submission.queries, 0);
            }
        }
    }

    /// Writes the timestamp behind it.
    pub(crate) fn stop_clock(&self, submission: &Submission) {
        if self.tick.is_some() {
            let bottom = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
            // SAFETY: as above.
            unsafe { self.handle.device.cmd_write_timestamp(submission.commands, bottom, submission.queries, 1) };
        }
    }

    /// Keeps an array alive until the submission is done.
    pub(crate) fn hold(submission: &mut Submission, array: &Arc<Array>) {
        submission.held.push(array.clone());
    }

    fn create(&self) -> Result<Submission, VulkanError> {
        let Handle { device, .. } = &*self.handle;
        let failed = |call| move |result| self.handle.failure(call, result);
        let bindings = Kernel::ALL.into_iter().map(|kernel| kernel.binding_count()).max().unwrap_or(1);
        let sizes = [vk::DescriptorPoolSize::default()
            .ty(vk::DescriptorType::STORAGE_BUFFER)
            .descriptor_count(bindings as u32)];
        let pool = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        let queries = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2);
        let commands = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        let mut submission = Submission {
            commands: vk::CommandBuffer::null(),
            descriptors: vk::DescriptorPool::null(),
            queries: vk::QueryPool::null(),
            fence: vk::Fence::null(),
            held: Vec::new(),
            kernel: None,
        };
        // SAFETY: all infos are complete. What was made before a failure is destroyed.
        let made = unsafe {
            (|| {
                submission.commands =
                    device.allocate_command_buffers(&commands).map_err(failed("vkAllocateCommandBuffers"))?[0];
                submission.descriptors =
                    device.create_descriptor_pool(&pool, None).map_err(failed("vkCreateDescriptorPool"))?;
                submission.fence =
                    device.create_fence(&vk::FenceCreateInfo::default(), None).map_err(failed("vkCreateFence"))?;
                if self.tick.is_some() {
                    submission.queries =
                        device.create_query_pool(&queries, None).map_err(failed("vkCreateQueryPool"))?;
                }
                Ok(())
            })()
        };
        match made {
            Ok(()) => Ok(submission),
            Err(error) => {
                self.destroy(&submission);
                Err(error)
            }
        }
    }

    fn destroy(&self, submission: &Submission) {
        let Handle { device, .. } = &*self.handle;
        // SAFETY: the submission is not in flight; null handles are ignored. Commands go with their pool.
        unsafe {
            device.destroy_query_pool(submission.queries, None);
            device.destroy_fence(submission.fence, None);
            device.destroy_descriptor_pool(submission.descriptors, None);
        }
    }
}

impl Drop for Submissions {
    fn drop(&mut self) {
        // One that exceeded the time limit may still run: it gets a little longer, then its resources are not freed.
        let patience =
            if self.is_late { Some(self.closing) } else { self.time_limit.map(|limit| limit.max(self.closing)) };
        let deadline = patience.map(|patience| Instant::now() + patience);
        while !self.running.is_empty() {
            self.time_limit = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
            match self.wait_for_oldest(&mut |_| ()) {
                Ok(()) | Err(VulkanError::Validation { .. }) => {}
                Err(_) => {
                    self.handle.abandon();
                    self.running.drain(..).for_each(std::mem::forget);
                    return;
                }
            }
        }
        self.free.iter().for_each(|submission| self.destroy(submission));
        // SAFETY: no commands of the pool are in flight.
        unsafe { self.handle.device.destroy_command_pool(self.pool, None) };
    }
}
