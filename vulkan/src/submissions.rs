//! Submissions to the queue.
//!
//! Commands are recorded one behind the other into the open submission, which is submitted when somebody waits for it,
//! or when it is full: of dispatches, of time that they are expected to take, or of memory that they hold. Up to
//! [`MAX_IN_FLIGHT`] submissions are in flight at once, so that the device works while the host prepares the next ones.
//! A submission keeps its resources alive until its fence is signalled.

use crate::buffer::Array;
use crate::error::VulkanError;
use crate::handle::Handle;
use crate::kernel::Kernel;
use ash::vk;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The most submissions in flight.
const MAX_IN_FLIGHT: usize = 4;
/// The most dispatches of a submission.
const MAX_DISPATCHES: usize = 128;
/// The longest time that a submission is expected to take: far below the time limit, and short enough that a display
/// that shares the device is not stopped.
const MAX_TIME: Duration = Duration::from_millis(200);
/// The most bytes of arrays that a submission holds, counted at each use.
const MAX_HELD: u64 = 256 << 20;

/// A dispatch that is done, for statistics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Done {
    pub(crate) kernel: Kernel,
    pub(crate) elements: u64,
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
    held_bytes: u64,
    /// The kernels that are dispatched, and for how many elements.
    dispatched: Vec<(Kernel, u64)>,
    /// The time that they are expected to take.
    expected: Duration,
    /// Whether anything is recorded.
    is_used: bool,
}

impl Submission {
    fn clear(&mut self) {
        self.held.clear();
        self.held_bytes = 0;
        self.dispatched.clear();
        self.expected = Duration::ZERO;
        self.is_used = false;
    }

    fn is_full(&self) -> bool {
        self.dispatched.len() >= MAX_DISPATCHES || self.expected >= MAX_TIME || self.held_bytes >= MAX_HELD
    }

    /// What it does, for an error.
    fn work(&self) -> String {
        match (self.dispatched.first(), self.dispatched.last()) {
            (Some((first, _)), Some((last, _))) if self.dispatched.iter().any(|(kernel, _)| kernel != first) => {
                format!("{} kernels, from {} to {},", self.dispatched.len(), first.name(), last.name())
            }
            (Some((only, _)), _) => format!("kernel {}", only.name()),
            (None, _) => "a transfer".to_owned(),
        }
    }
}

/// The queue's submissions, in order.
pub(crate) struct Submissions {
    pool: vk::CommandPool,
    free: Vec<Submission>,
    /// The one that commands are recorded into.
    open: Option<Submission>,
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
    /// How many were submitted.
    count: u64,
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
            open: None,
            running: VecDeque::new(),
            time_limit,
            closing,
            is_late: false,
            tick: timestamps.map(|(period, _)| period),
            tick_mask: timestamps.map_or(0, |(_, bits)| u64::MAX >> (64 - bits.clamp(1, 64))),
            count: 0,
            handle: handle.clone(),
        })
    }

    /// How many were submitted so far.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// The number, from 1, of the submission that commands are recorded into now.
    pub(crate) fn next(&self) -> u64 {
        self.count + 1
    }

    /// The open submission, or a new one. If all are in flight, it waits for the oldest first. It comes back through
    /// [`Submissions::go_on`].
    pub(crate) fn take_open(&mut self, done: &mut dyn FnMut(Done)) -> Result<Submission, VulkanError> {
        if let Some(open) = self.open.take() {
            return Ok(open);
        }
        if self.running.len() >= MAX_IN_FLIGHT {
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
            Ok(()) => {
                if self.tick.is_some() {
                    let count = 2 * MAX_DISPATCHES as u32;
                    let Handle { device, .. } = &*self.handle;
                    // SAFETY: the commands are being recorded; the pool has so many queries.
                    unsafe { device.cmd_reset_query_pool(submission.commands, submission.queries, 0, count) };
                }
                Ok(submission)
            }
            Err(result) => {
                self.free.push(submission);
                Err(self.handle.failure("vkBeginCommandBuffer", result))
            }
        }
    }

    /// Takes back the open submission, and submits it if it is full. What was recorded before a failure stays recorded:
    /// a command that failed was not.
    pub(crate) fn go_on(&mut self, submission: Submission) -> Result<(), VulkanError> {
        let is_full = submission.is_full();
        self.open = Some(submission);
        if is_full { self.flush() } else { Ok(()) }
    }

    /// Submits what is recorded.
    pub(crate) fn flush(&mut self) -> Result<(), VulkanError> {
        match self.open.take() {
            Some(open) if open.is_used => self.submit(open),
            open => {
                self.open = open;
                Ok(())
            }
        }
    }

    /// Takes back a submission that could not be submitted.
    fn discard(&mut self, mut submission: Submission) {
        let no_flags = vk::DescriptorPoolResetFlags::empty();
        // By the specification this call cannot fail; if it does, the next allocation reports it.
        // SAFETY: the submission is not in flight.
        let _ = unsafe { self.handle.device.reset_descriptor_pool(submission.descriptors, no_flags) };
        submission.clear();
        self.free.push(submission);
    }

    fn submit(&mut self, submission: Submission) -> Result<(), VulkanError> {
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
            Ok(()) => {
                self.count += 1;
                self.running.push_back(submission);
            }
            Err(_) => self.discard(submission),
        }
        submitted
    }

    /// Submits what is recorded, and waits until all submissions are done.
    pub(crate) fn wait(&mut self, done: &mut dyn FnMut(Done)) -> Result<(), VulkanError> {
        self.flush()?;
        while !self.running.is_empty() {
            self.wait_for_oldest(done)?;
        }
        Ok(())
    }

    /// Waits until the submission of this number is done: at once for 0.
    pub(crate) fn wait_for(&mut self, number: u64, done: &mut dyn FnMut(Done)) -> Result<(), VulkanError> {
        if number > self.count {
            self.flush()?;
        }
        while !self.running.is_empty() && self.count - (self.running.len() as u64) < number {
            self.wait_for_oldest(done)?;
        }
        Ok(())
    }

    /// Waits for the oldest submission, at most for the time limit: earlier ones are done, so all of that time is its
    /// own.
    fn wait_for_oldest(&mut self, done: &mut dyn FnMut(Done)) -> Result<(), VulkanError> {
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
                work: oldest.work(),
                limit: self.time_limit.unwrap_or_default(),
            },
            result => self.handle.failure("vkWaitForFences", result),
        })?;
        let ticks = self.ticks(oldest)?;
        for (index, (kernel, elements)) in oldest.dispatched.iter().enumerate() {
            let time = ticks.get(2 * index..2 * index + 2).map(|ticks| self.time_between(ticks[0], ticks[1]));
            done(Done { kernel: *kernel, elements: *elements, time });
        }
        let no_flags = vk::DescriptorPoolResetFlags::empty();
        // SAFETY: the submission is done.
        let (fences, descriptors) = unsafe {
            (device.reset_fences(&[oldest.fence]), device.reset_descriptor_pool(oldest.descriptors, no_flags))
        };
        fences.map_err(|result| self.handle.failure("vkResetFences", result))?;
        descriptors.map_err(|result| self.handle.failure("vkResetDescriptorPool", result))?;
        if let Some(mut oldest) = self.running.pop_front() {
            oldest.clear();
            self.free.push(oldest);
        }
        self.handle.check_messages()
    }

    /// The timestamps of a submission that is done, two for each dispatch; none where the device has none.
    fn ticks(&self, submission: &Submission) -> Result<Vec<u64>, VulkanError> {
        if self.tick.is_none() || submission.dispatched.is_empty() {
            return Ok(Vec::new());
        }
        let mut ticks = vec![0_u64; 2 * submission.dispatched.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: these queries were written by the submission, which is done.
        unsafe { self.handle.device.get_query_pool_results(submission.queries, 0, &mut ticks, flags) }
            .map_err(|result| self.handle.failure("vkGetQueryPoolResults", result))?;
        Ok(ticks)
    }

    fn time_between(&self, start: u64, end: u64) -> Duration {
        let passed = end.wrapping_sub(start) & self.tick_mask;
        Duration::from_nanos((passed as f64 * f64::from(self.tick.unwrap_or_default())) as u64)
    }

    /// Whether the device has timestamps.
    pub(crate) fn has_clock(&self) -> bool {
        self.tick.is_some()
    }

    /// Writes the timestamp before a kernel, after all earlier commands: waiting for them is not its time.
    pub(crate) fn start_clock(&self, submission: &Submission) {
        self.write_timestamp(submission, 0);
    }

    /// Writes the timestamp behind it, and counts it. `expected` is the time that it is expected to take.
    pub(crate) fn stop_clock(&self, submission: &mut Submission, kernel: Kernel, elements: u64, expected: Duration) {
        self.write_timestamp(submission, 1);
        submission.dispatched.push((kernel, elements));
        submission.expected += expected;
    }

    fn write_timestamp(&self, submission: &Submission, place: u32) {
        if self.tick.is_some() {
            let query = 2 * submission.dispatched.len() as u32 + place;
            let bottom = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
            // SAFETY: the commands are being recorded; the pool has two queries for each dispatch, which were reset.
            unsafe { self.handle.device.cmd_write_timestamp(submission.commands, bottom, submission.queries, query) };
        }
    }

    /// Keeps an array alive until the submission is done.
    pub(crate) fn hold(submission: &mut Submission, array: &Arc<Array>) {
        submission.held_bytes += (array.len * array.stride) as u64;
        submission.held.push(array.clone());
        submission.is_used = true;
    }

    fn create(&self) -> Result<Submission, VulkanError> {
        let Handle { device, .. } = &*self.handle;
        let failed = |call| move |result| self.handle.failure(call, result);
        let bindings = Kernel::ALL.into_iter().map(|kernel| kernel.binding_count()).max().unwrap_or(1);
        let sizes = [vk::DescriptorPoolSize::default()
            .ty(vk::DescriptorType::STORAGE_BUFFER)
            .descriptor_count((bindings * MAX_DISPATCHES) as u32)];
        let pool = vk::DescriptorPoolCreateInfo::default().max_sets(MAX_DISPATCHES as u32).pool_sizes(&sizes);
        let queries = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(2 * MAX_DISPATCHES as u32);
        let commands = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        let mut submission = Submission {
            commands: vk::CommandBuffer::null(),
            descriptors: vk::DescriptorPool::null(),
            queries: vk::QueryPool::null(),
            fence: vk::Fence::null(),
            held: Vec::new(),
            held_bytes: 0,
            dispatched: Vec::new(),
            expected: Duration::ZERO,
            is_used: false,
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
        // Nobody waits for what is recorded only.
        if let Some(open) = self.open.take() {
            self.discard(open);
        }
        // One that exceeded the time limit may still run: it gets a little longer, then its resources are not freed.
        let patience =
            if self.is_late { Some(self.closing) } else { self.time_limit.map(|limit| limit.max(self.closing)) };
        let deadline = patience.and_then(|patience| Instant::now().checked_add(patience));
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
