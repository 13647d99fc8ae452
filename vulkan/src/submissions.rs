//! Submissions to the queue.
//!
//! Commands are recorded one behind the other into the open command buffer, which is submitted when somebody waits for
//! it, or when it is full: of dispatches, of time that they are expected to take, or of memory that they hold. Up to
//! [`MAX_IN_FLIGHT`] submissions are in flight at once, so that the device works while the host prepares the next ones.
//! Commands keep their resources alive until the fence of their submission is signalled.
//!
//! Commands of a [recording](crate::Recording) stay when they are done. They are submitted again with what was recorded
//! before them and what comes behind them: one submission.

use crate::commands::{Commands, Done, MAX_TIME, work};
use crate::error::VulkanError;
use crate::handle::Handle;
use crate::kernel::Kernel;
use ash::vk;
use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

/// The most submissions in flight.
const MAX_IN_FLIGHT: usize = 4;

/// Commands that are in flight; the fence of the last of them is signalled when all are done.
type InFlight = Vec<Commands>;

/// What is being recorded to be submitted again.
struct Recorder {
    /// What it is known by.
    mark: Arc<()>,
    thread: ThreadId,
    /// Whether it holds nothing but dispatches of this thread.
    is_whole: bool,
}

/// The queue's submissions, in order.
pub(crate) struct Submissions {
    pool: vk::CommandPool,
    free: Vec<Commands>,
    /// What the next submission begins with.
    queued: Vec<Commands>,
    /// Those that commands are recorded into, behind what is queued.
    open: Option<Commands>,
    running: VecDeque<InFlight>,
    /// Parts of recordings that are done, each recording's in its order.
    kept: Vec<Commands>,
    recorder: Option<Recorder>,
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
            queued: Vec::new(),
            open: None,
            running: VecDeque::new(),
            kept: Vec::new(),
            recorder: None,
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

    /// The open commands, or new ones. If all submissions are in flight, it waits for the oldest first. They come back
    /// through [`Submissions::go_on`].
    pub(crate) fn take_open(&mut self, done: &mut dyn FnMut(Done)) -> Result<Commands, VulkanError> {
        if let Some(open) = self.open.take() {
            return Ok(open);
        }
        self.wait_for_room(done)?;
        self.release();
        let mut commands = match self.free.pop() {
            Some(commands) => commands,
            None => Commands::new(&self.handle, self.pool, self.has_clock())?,
        };
        let flags = match self.recorder {
            Some(_) => vk::CommandBufferUsageFlags::empty(),
            None => vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT,
        };
        let info = vk::CommandBufferBeginInfo::default().flags(flags);
        // SAFETY: the commands are not in flight; the pool allows to record them again.
        let begun = unsafe { self.handle.device.begin_command_buffer(commands.raw, &info) };
        match begun {
            Ok(()) => {
                if self.has_clock() {
                    let Handle { device, .. } = &*self.handle;
                    // SAFETY: the commands are being recorded; the pool has so many queries.
                    unsafe { device.cmd_reset_query_pool(commands.raw, commands.queries, 0, Commands::QUERIES) };
                }
                let whole = self.recorder.as_ref().filter(|recorder| recorder.is_whole);
                commands.part_of = whole.map(|recorder| Arc::downgrade(&recorder.mark));
                Ok(commands)
            }
            Err(result) => {
                self.free.push(commands);
                Err(self.handle.failure("vkBeginCommandBuffer", result))
            }
        }
    }

    /// Takes back the open commands, and submits them if they are full. What was recorded before a failure stays
    /// recorded: a command that failed was not.
    pub(crate) fn go_on(&mut self, commands: Commands) -> Result<(), VulkanError> {
        // Where there is no time limit, there is no display either.
        let queued = self.queued_time().filter(|_| self.time_limit.is_some());
        let is_full = commands.is_full() || queued.is_some_and(|queued| queued + commands.expected >= MAX_TIME);
        self.open = Some(commands);
        if is_full { self.flush() } else { Ok(()) }
    }

    /// Submits what is recorded.
    pub(crate) fn flush(&mut self) -> Result<(), VulkanError> {
        self.queue_open()?;
        self.submit_queued()
    }

    /// Queues the open commands, if there are any in them.
    fn queue_open(&mut self) -> Result<(), VulkanError> {
        let Some(open) = self.open.take_if(|open| open.is_used) else { return Ok(()) };
        // SAFETY: the commands are being recorded.
        let ended = unsafe { self.handle.device.end_command_buffer(open.raw) };
        match ended {
            Ok(()) => self.queued.push(open),
            Err(_) => self.discard(open),
        }
        ended.map_err(|result| self.handle.failure("vkEndCommandBuffer", result))
    }

    /// Takes back commands that are not in flight.
    fn discard(&mut self, mut commands: Commands) {
        let no_flags = vk::DescriptorPoolResetFlags::empty();
        // By the specification this call cannot fail; if it does, the next allocation reports it.
        // SAFETY: the commands are not in flight.
        let _ = unsafe { self.handle.device.reset_descriptor_pool(commands.descriptors, no_flags) };
        commands.clear();
        self.free.push(commands);
    }

    /// Takes back parts of recordings that nobody has any more.
    pub(crate) fn release(&mut self) {
        let (kept, gone): (Vec<_>, Vec<_>) = std::mem::take(&mut self.kept).into_iter().partition(Commands::is_kept);
        self.kept = kept;
        gone.into_iter().for_each(|commands| self.discard(commands));
    }

    fn submit_queued(&mut self) -> Result<(), VulkanError> {
        let parts = std::mem::take(&mut self.queued);
        let Some(last) = parts.last() else { return Ok(()) };
        let commands: Vec<_> = parts.iter().map(|part| part.raw).collect();
        let info = [vk::SubmitInfo::default().command_buffers(&commands)];
        let Handle { device, queue, .. } = &*self.handle;
        // SAFETY: the commands are recorded, and hold all that they use; none is in flight, nor is the fence.
        let submitted = unsafe { device.queue_submit(*queue, &info, last.fence) };
        match submitted {
            Ok(()) => {
                self.count += 1;
                self.running.push_back(parts);
            }
            Err(_) => parts.into_iter().for_each(|part| self.discard(part)),
        }
        submitted.map_err(|result| self.handle.failure("vkQueueSubmit", result))
    }

    /// The time that what is queued is expected to take, if there is anything.
    fn queued_time(&self) -> Option<Duration> {
        (!self.queued.is_empty()).then(|| self.queued.iter().map(|part| part.expected).sum())
    }

    /// Begins to keep what is recorded from now on: what the recording is known by. `None` if that is already done.
    pub(crate) fn begin_recording(&mut self) -> Result<Option<Arc<()>>, VulkanError> {
        if self.recorder.is_some() {
            return Ok(None);
        }
        self.flush()?;
        // Commands that were begun to be submitted once.
        if let Some(mut open) = self.open.take() {
            open.is_used = true;
            self.open = Some(open);
            self.queue_open()?;
            self.queued.pop().into_iter().for_each(|open| self.discard(open));
        }
        let mark = Arc::new(());
        self.recorder = Some(Recorder { mark: mark.clone(), thread: thread::current().id(), is_whole: true });
        Ok(Some(mark))
    }

    /// Notes that commands are recorded: dispatches, or others, which cannot be submitted again.
    pub(crate) fn note(&mut self, are_dispatches: bool) {
        if let Some(recorder) = &mut self.recorder
            && !(are_dispatches && recorder.thread == thread::current().id())
        {
            recorder.is_whole = false;
        }
    }

    /// Submits what is recorded, and ends a recording: whether it can be submitted again.
    pub(crate) fn end_recording(&mut self, mark: &Arc<()>) -> Result<bool, VulkanError> {
        let ended = self.flush();
        let is_whole = self.drop_recording(mark);
        ended.map(|()| is_whole && (self.has_pending(mark) || self.kept.iter().any(|part| part.is_of(mark))))
    }

    /// Ends a recording, if it is under way. Returns whether it holds nothing but dispatches.
    pub(crate) fn drop_recording(&mut self, mark: &Arc<()>) -> bool {
        let ended = self.recorder.take_if(|recorder| Arc::ptr_eq(&recorder.mark, mark));
        ended.is_some_and(|recorder| recorder.is_whole)
    }

    /// Whether a part of a recording is queued or in flight.
    fn has_pending(&self, mark: &Arc<()>) -> bool {
        self.queued.iter().chain(self.running.iter().flatten()).any(|part| part.is_of(mark))
    }

    /// Queues the parts of a recording behind what is recorded. Returns `false` if there are none.
    pub(crate) fn queue_again(&mut self, mark: &Arc<()>, done: &mut dyn FnMut(Done)) -> Result<bool, VulkanError> {
        self.queue_open()?;
        while self.has_pending(mark) {
            self.submit_queued()?;
            self.wait_for_oldest(done)?;
        }
        let (parts, others): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.kept).into_iter().partition(|part| part.is_of(mark));
        self.kept = others;
        let (is_there, mut parts) = (!parts.is_empty(), VecDeque::from(parts));
        while let Some(part) = parts.pop_front() {
            let queued = self.queued_time().filter(|_| self.time_limit.is_some());
            if queued.is_some_and(|queued| queued + part.expected > MAX_TIME)
                && let Err(error) = self.wait_for_room(done).and_then(|()| self.submit_queued())
            {
                self.kept.extend([part].into_iter().chain(parts));
                return Err(error);
            }
            part.outdate_written();
            self.queued.push(part);
        }
        Ok(is_there)
    }

    /// Submits what is recorded, and waits until all submissions are done.
    pub(crate) fn wait(&mut self, done: &mut dyn FnMut(Done)) -> Result<(), VulkanError> {
        self.flush()?;
        while !self.running.is_empty() {
            self.wait_for_oldest(done)?;
        }
        self.release();
        Ok(())
    }

    /// Waits for the oldest submission if no more may be in flight.
    fn wait_for_room(&mut self, done: &mut dyn FnMut(Done)) -> Result<(), VulkanError> {
        if self.running.len() >= MAX_IN_FLIGHT { self.wait_for_oldest(done) } else { Ok(()) }
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
        let Some(fence) = oldest.last().map(|last| last.fence) else { return Ok(()) };
        let nanoseconds = |limit: Duration| u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        let Handle { device, .. } = &*self.handle;
        // SAFETY: the fence belongs to a submission that is in flight.
        let waited = unsafe { device.wait_for_fences(&[fence], true, self.time_limit.map_or(u64::MAX, nanoseconds)) };
        self.is_late |= waited == Err(vk::Result::TIMEOUT);
        waited.map_err(|result| match result {
            vk::Result::TIMEOUT => VulkanError::TimeLimit {
                device: self.handle.name.clone(),
                work: work(oldest),
                limit: self.time_limit.unwrap_or_default(),
            },
            result => self.handle.failure("vkWaitForFences", result),
        })?;
        let mut took = Vec::with_capacity(oldest.len());
        for part in oldest {
            let ticks = self.ticks(part)?;
            let mut all = Some(Duration::ZERO);
            for (index, (kernel, elements)) in part.dispatched.iter().enumerate() {
                let time = ticks.get(2 * index..2 * index + 2).map(|ticks| self.time_between(ticks[0], ticks[1]));
                done(Done { kernel: *kernel, elements: *elements, time });
                all = all.zip(time).map(|(all, time)| all + time);
            }
            took.push(all);
        }
        // SAFETY: the submission is done.
        unsafe { device.reset_fences(&[fence]) }.map_err(|result| self.handle.failure("vkResetFences", result))?;
        for (mut part, took) in self.running.pop_front().into_iter().flatten().zip(took) {
            match part.is_kept() {
                true => {
                    // What it took is a better guess of the next time.
                    part.expected = took.unwrap_or(part.expected);
                    self.kept.push(part);
                }
                false => self.discard(part),
            }
        }
        self.handle.check_messages()
    }

    /// The timestamps of commands that are done, two for each dispatch; none where the device has none.
    fn ticks(&self, commands: &Commands) -> Result<Vec<u64>, VulkanError> {
        if self.tick.is_none() || commands.dispatched.is_empty() {
            return Ok(Vec::new());
        }
        let mut ticks = vec![0_u64; 2 * commands.dispatched.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: these queries were written by the commands, which are done.
        unsafe { self.handle.device.get_query_pool_results(commands.queries, 0, &mut ticks, flags) }
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
    pub(crate) fn start_clock(&self, commands: &Commands) {
        self.write_timestamp(commands, 0);
    }

    /// Writes the timestamp behind it, and counts it. `expected` is the time that it is expected to take.
    pub(crate) fn stop_clock(&self, commands: &mut Commands, kernel: Kernel, elements: u64, expected: Duration) {
        self.write_timestamp(commands, 1);
        commands.dispatched.push((kernel, elements));
        commands.expected += expected;
    }

    fn write_timestamp(&self, commands: &Commands, place: u32) {
        if self.tick.is_some() {
            let query = 2 * commands.dispatched.len() as u32 + place;
            let bottom = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
            // SAFETY: the commands are being recorded; the pool has two queries for each dispatch, which were reset.
            unsafe { self.handle.device.cmd_write_timestamp(commands.raw, bottom, commands.queries, query) };
        }
    }
}

impl Drop for Submissions {
    fn drop(&mut self) {
        // Nobody waits for what is recorded only.
        let recorded = self.queued.drain(..).chain(self.open.take()).chain(self.kept.drain(..)).collect::<Vec<_>>();
        recorded.into_iter().for_each(|commands| self.discard(commands));
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
        // Parts of recordings that were in flight.
        self.free.append(&mut self.kept);
        self.free.iter().for_each(|commands| commands.destroy(&self.handle));
        // SAFETY: no commands of the pool are in flight.
        unsafe { self.handle.device.destroy_command_pool(self.pool, None) };
    }
}
