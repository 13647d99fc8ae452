//! A device that runs kernels.

use crate::adapter::{Adapter, AdapterKind, Limits};
use crate::ahead::Ahead;
use crate::buffer::Array;
use crate::commands::{Commands, Done};
use crate::error::{Missing, VulkanError};
use crate::forms::Choices;
use crate::handle::{Handle, Memory};
use crate::instance::Instance;
use crate::kernel::{Access, Form, Kernel};
use crate::pipelines::{Key, Pipeline, Pipelines};
use crate::staging::Ring;
use crate::submissions::Submissions;
use crate::verdicts::Verdicts;
use ash::vk;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Bytes of the widest element of an array in pages.
pub(crate) const WIDEST_PAGED: u64 = 16;

/// [`GpuOptions::min_rounded_work`] where nothing else is said: a twentieth of a second of exact products on the
/// largest GPUs, half a second on those of a tenth of their rate.
const MIN_ROUNDED_WORK: u64 = 1 << 39;

/// [`GpuOptions::min_fused_gain`] where nothing else is said.
const MIN_FUSED_GAIN: f64 = 1.1;

/// Options of an opened device.
#[derive(Clone, Copy, Debug)]
pub struct GpuOptions {
    /// Time limit of a submission; `None` for the device's default: see [`GpuOptions::time_limit_on`].
    pub time_limit: Option<Duration>,
    /// Whether barriers separate dependent commands. Without them results are wrong; tests use that to show that the
    /// validation layers report it.
    pub barriers: bool,
    /// The least time that closing a device waits for its work. If the work continues after that, its resources are not
    /// freed.
    pub closing: Duration,
    /// Limits that apply where they are lower than the device's own, so that tests can split work on any device.
    pub limits: Limits,
    /// The form of all tiled kernels; `None` for the fastest, which is measured. The results of [`Form::ALL`] are the
    /// same bits. A form of [`Form::ROUNDED`] or [`Form::FUSED`] is that of the kernels that have it.
    pub form: Option<Form>,
    /// A module whose entry points take the place of those for matrix units, so that tests see the same places,
    /// barriers and roundings on any device; `None` for the device's own units. It goes to the driver as it is.
    #[doc(hidden)]
    pub stand_ins: Option<&'static [u8]>,
    /// Multiply-adds of a picture from which on forms of rounded factors are worth their trial, which compiles for
    /// seconds in a first process, and gains less than that for less work.
    pub min_rounded_work: u64,
    /// How much faster than two roundings a form of [`Form::FUSED`] has to be, in its trial, to be used. Of 0 it is used
    /// wherever it is right, also on a software driver; otherwise those do not try it.
    pub min_fused_gain: f64,
    /// The longest time that a piece of a dispatch may be expected to take; `None` for the device's default:
    /// [`GpuOptions::longest_piece_on`]. The results are the same bits.
    pub longest_piece: Option<Duration>,
    /// What the driver does wrong; nothing, but in tests.
    pub faults: Faults,
}

/// Faults that a driver has besides its own, so that tests see what is done about them on any device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// A form of tiled kernels of which the second half of the work is not done.
    pub half_done: Option<Form>,
    /// The size that is reported of the subgroups of every pipeline that needs them.
    pub reported_subgroup_size: Option<u32>,
}

impl Faults {
    /// What is done of these elements of a form: whole workgroups.
    pub(crate) fn done(self, form: Form, elements: Range<u32>) -> Range<u32> {
        let half = (elements.end - elements.start) / 2 / form.invocations() * form.invocations();
        if self.half_done == Some(form) { elements.start..elements.start + half } else { elements }
    }
}

impl Default for GpuOptions {
    /// The device's default time limit, a closing time of ten seconds, and the device's own limits.
    fn default() -> GpuOptions {
        let limits =
            Limits { buffer_range: u64::MAX, allocation: u64::MAX, workgroup_count: u32::MAX, memory: u64::MAX };
        GpuOptions {
            time_limit: None,
            barriers: true,
            closing: Duration::from_secs(10),
            limits,
            form: None,
            stand_ins: None,
            min_rounded_work: MIN_ROUNDED_WORK,
            min_fused_gain: MIN_FUSED_GAIN,
            longest_piece: None,
            faults: Faults::default(),
        }
    }
}

impl GpuOptions {
    /// Time limit of a submission on a device of this kind; `None` without a limit.
    ///
    /// The default of a GPU is two minutes. A software driver has no limit: its kernels share the processor with all
    /// other processes of the machine, and a busy machine is not a failure.
    pub fn time_limit_on(&self, kind: AdapterKind) -> Option<Duration> {
        self.time_limit.or((kind != AdapterKind::Software).then_some(Duration::from_secs(120)))
    }

    /// The longest time that a piece of a dispatch may be expected to take on a device of this kind; `None` where work
    /// is cut by the device's limits alone.
    ///
    /// The default of a GPU is 0.2 s: systems end what takes seconds (two on Windows). Nobody watches a software
    /// driver.
    pub fn longest_piece_on(&self, kind: AdapterKind) -> Option<Duration> {
        self.longest_piece.or((kind != AdapterKind::Software).then_some(Duration::from_millis(200)))
    }
}

/// The dispatches of a kernel so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// How many times it was dispatched; split work counts once a piece.
    pub dispatches: u64,
    /// How many elements it computed.
    pub elements: u64,
    /// Its time on the device; 0 where the device has no timestamps.
    pub time: Duration,
}

/// An opened device. Kernels run in the order in which they are dispatched; independent ones
/// may overlap.
pub struct Gpu {
    // Dropped in this order: submissions finish before their resources are freed.
    pub(crate) ahead: Ahead,
    state: Mutex<State>,
    pub(crate) pipelines: Arc<Pipelines>,
    pub(crate) handle: Arc<Handle>,
    pub(crate) page_shift: u32,
    pub(crate) barriers: bool,
    pub(crate) form: Option<Form>,
    pub(crate) is_software: bool,
    pub(crate) longest_piece: Option<Duration>,
    pub(crate) faults: Faults,
    pub(crate) has_stand_ins: bool,
    min_rounded_work: u64,
    /// [`GpuOptions::min_fused_gain`].
    pub(crate) min_fused_gain: f64,
}

pub(crate) struct State {
    pub(crate) submissions: Submissions,
    /// Pipelines that were used, at hand without the lock of those that are made.
    pub(crate) used: HashMap<Key, Pipeline>,
    /// Forms of tiled kernels, as far as they are known.
    pub(crate) choices: Choices,
    /// Forms that are not used, because their results or their subgroups were others.
    pub(crate) refused: Vec<(Kernel, Form)>,
    /// Whether forms of rounded factors are used, as far as it was asked.
    pub(crate) verdicts: Verdicts,
    /// How long elements took.
    pub(crate) rates: [Rate; Kernel::ALL.len()],
    pub(crate) upload: Option<Ring>,
    pub(crate) download: Option<Memory>,
    /// The number of the interval of commands since the last barrier.
    stretch: u64,
    pub(crate) tallies: [Tally; Kernel::ALL.len()],
    /// Whether the device failed: then the content of its memory is undefined.
    failed: Option<VulkanError>,
}

impl Gpu {
    /// Opens a device.
    ///
    /// # Errors
    /// [`VulkanError::Missing`] if it lacks a requirement, also of [`GpuOptions::form`], and others if Vulkan fails.
    pub fn open(instance: &Arc<Instance>, adapter: &Adapter, options: &GpuOptions) -> Result<Gpu, VulkanError> {
        if adapter.instance_number != instance.number {
            return Err(VulkanError::NoDevice(format!("{} was found by another instance of Vulkan", adapter.name)));
        }
        // What a caller may have changed of it says nothing of the device.
        let now = adapter.again(instance);
        if let Some(missing) = [adapter, &now].map(|found| &found.missing).into_iter().find(|found| !found.is_empty()) {
            return Err(VulkanError::Missing(adapter.name.clone(), missing.clone()));
        }
        let adapter = &now;
        let (limits, lower) = (adapter.limits, options.limits);
        let limits = Limits {
            buffer_range: limits.buffer_range.min(lower.buffer_range),
            allocation: limits.allocation.min(lower.allocation),
            workgroup_count: limits.workgroup_count.min(lower.workgroup_count).max(1),
            memory: limits.memory.min(lower.memory),
        };
        if let Some(form) = options.form.filter(|form| {
            let stands_in = form.needs_matrices() && options.stand_ins.is_some();
            !stands_in && !adapter.runs(*form)
        }) {
            let missing = vec![Missing::Feature(match form {
                Form::Subgroup => "subgroups of 8 to 64 invocations",
                _ if form.needs_matrices() => "matrix units of 16x16x16 f16 with f32 sums",
                _ => "workgroups of 256 invocations that share 48 KiB",
            })];
            return Err(VulkanError::Missing(adapter.name.clone(), missing));
        }
        let handle = Arc::new(Handle::open(instance, adapter, limits)?);
        let timestamps = (adapter.timestamp_bits > 0).then_some((adapter.timestamp_period, adapter.timestamp_bits));
        let time_limit = options.time_limit_on(adapter.kind);
        let submissions = Submissions::new(&handle, adapter.queue_family, timestamps, time_limit, options.closing)?;
        let pipelines = Pipelines::new(&handle, options.faults.reported_subgroup_size, options.stand_ins)?;
        // The longest page that is within the limits in every array, but long enough to start at allowed offsets.
        let page_len =
            (limits.buffer_range.min(limits.allocation) / WIDEST_PAGED).max(adapter.offset_alignment).max(64);
        let state = State {
            submissions,
            used: HashMap::new(),
            choices: Choices::default(),
            refused: Vec::new(),
            verdicts: Verdicts::default(),
            rates: [Rate::default(); Kernel::ALL.len()],
            upload: None,
            download: None,
            stretch: 1,
            tallies: [Tally::default(); Kernel::ALL.len()],
            failed: None,
        };
        Ok(Gpu {
            ahead: Ahead::default(),
            state: Mutex::new(state),
            pipelines: Arc::new(pipelines),
            handle,
            page_shift: page_len.ilog2().min(31),
            barriers: options.barriers,
            form: options.form,
            is_software: adapter.kind == AdapterKind::Software,
            longest_piece: options.longest_piece_on(adapter.kind),
            faults: options.faults,
            has_stand_ins: options.stand_ins.is_some(),
            min_rounded_work: options.min_rounded_work,
            min_fused_gain: options.min_fused_gain,
        })
    }

    /// The driver's name for it.
    pub fn name(&self) -> &str {
        &self.handle.name
    }

    /// Whether it has what a form of tiled kernels needs, or what stands in for it.
    pub(crate) fn runs(&self, form: Form) -> bool {
        self.handle.runs(form) || form.needs_matrices() && self.has_stand_ins && self.handle.has_room_for(form)
    }

    /// What the driver says of a kernel in a form as it compiles it, in its own words: registers of an invocation, for
    /// one. Empty where it says nothing, or does not run that form.
    ///
    /// # Errors
    /// If it does not compile.
    pub fn statistics(&self, kernel: Kernel, form: Form) -> Result<Vec<(String, f64)>, VulkanError> {
        if self.runs(form) { self.pipelines.statistics(kernel, form) } else { Ok(Vec::new()) }
    }

    /// [`GpuOptions::min_rounded_work`].
    pub fn min_rounded_work(&self) -> u64 {
        self.min_rounded_work
    }

    /// The limits by which work is split.
    pub fn limits(&self) -> Limits {
        self.handle.limits
    }

    /// Most elements of `bytes` bytes each in an array that is bound as a whole.
    pub fn most_elements(&self, bytes: usize) -> usize {
        let most = self.handle.limits.buffer_range.min(self.handle.limits.allocation);
        usize::try_from(most).unwrap_or(usize::MAX) / bytes.max(1)
    }

    /// Submits what is recorded: the device begins with it, and nobody waits.
    ///
    /// # Errors
    /// If the device fails, or failed before.
    pub fn submit(&self) -> Result<(), VulkanError> {
        self.with_state(|_, state| state.submissions.flush())
    }

    /// Waits until all work is done.
    ///
    /// # Errors
    /// If the device fails, or failed before.
    pub fn wait(&self) -> Result<(), VulkanError> {
        self.with_state(|_, state| state.wait())
    }

    /// The dispatches of each kernel, up to the last submission that was waited for.
    pub fn tally(&self, kernel: Kernel) -> Tally {
        self.lock().tallies[kernel as usize]
    }

    /// How many times commands were submitted so far. Dispatches are collected until somebody waits for them.
    pub fn submission_count(&self) -> u64 {
        self.lock().submissions.count()
    }

    /// Whether [`Tally::time`] is measured: the device has timestamps.
    pub fn has_timestamps(&self) -> bool {
        self.lock().submissions.has_clock()
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Accesses the state; a failure of the device is recorded.
    pub(crate) fn with_state<T>(
        &self,
        work: impl FnOnce(&Gpu, &mut State) -> Result<T, VulkanError>,
    ) -> Result<T, VulkanError> {
        let state = &mut *self.lock();
        if let Some(error) = &state.failed {
            return Err(error.clone());
        }
        let outcome = work(self, state).and_then(|value| self.handle.check_messages().map(|()| value));
        if let Err(error) = &outcome {
            // A lack of memory for an array is known before anything is recorded.
            use VulkanError::{Call, DeviceLost, TimeLimit, Validation};
            if matches!(error, Call { .. } | DeviceLost { .. } | TimeLimit { .. } | Validation { .. }) {
                state.failed = Some(error.clone());
            }
        }
        outcome
    }

    /// Records commands that use these arrays, after a barrier if they depend on commands since the last one. They are
    /// submitted once: what they transfer changes.
    pub(crate) fn record(
        &self,
        state: &mut State,
        uses: &[(&Arc<Array>, Access)],
        commands: impl FnOnce(&ash::Device, &mut Commands, &Submissions) -> Result<(), VulkanError>,
    ) -> Result<(), VulkanError> {
        state.submissions.note(false);
        self.record_into_open(state, uses, commands)
    }

    /// The same for a dispatch, which may be submitted again.
    pub(crate) fn record_dispatch(
        &self,
        state: &mut State,
        uses: &[(&Arc<Array>, Access)],
        commands: impl FnOnce(&ash::Device, &mut Commands, &Submissions) -> Result<(), VulkanError>,
    ) -> Result<(), VulkanError> {
        state.submissions.note(true);
        self.record_into_open(state, uses, commands)
    }

    fn record_into_open(
        &self,
        state: &mut State,
        uses: &[(&Arc<Array>, Access)],
        commands: impl FnOnce(&ash::Device, &mut Commands, &Submissions) -> Result<(), VulkanError>,
    ) -> Result<(), VulkanError> {
        let mut open = state.take_open()?;
        let stretch = &mut state.stretch;
        let depends = uses.iter().any(|(array, access)| {
            array.written_in.is(*stretch) || (*access == Access::Write && array.read_in.is(*stretch))
        });
        if depends {
            if self.barriers {
                barrier(&self.handle.device, open.raw);
            }
            *stretch += 1;
        }
        for (array, access) in uses {
            open.hold(array, *access);
            match access {
                Access::Read => array.read_in.set(*stretch),
                Access::Write => {
                    array.written_in.set(*stretch);
                    array.halves.outdate();
                }
            }
        }
        let recorded = commands(&self.handle.device, &mut open, &state.submissions);
        state.submissions.go_on(open).and(recorded)
    }

    /// Records a barrier behind everything before it, whatever comes.
    pub(crate) fn record_barrier(&self, state: &mut State) -> Result<(), VulkanError> {
        let mut open = state.take_open()?;
        if self.barriers {
            barrier(&self.handle.device, open.raw);
        }
        (open.is_used, state.stretch) = (true, state.stretch + 1);
        state.submissions.go_on(open)
    }
}

impl State {
    /// [`Submissions::take_open`].
    fn take_open(&mut self) -> Result<Commands, VulkanError> {
        let State { submissions, tallies, rates, .. } = self;
        submissions.take_open(&mut |done| count(tallies, rates, done))
    }

    /// [`Submissions::queue_again`].
    pub(crate) fn queue_again(&mut self, mark: &Arc<()>) -> Result<bool, VulkanError> {
        let State { submissions, tallies, rates, .. } = self;
        submissions.queue_again(mark, &mut |done| count(tallies, rates, done))
    }

    pub(crate) fn wait(&mut self) -> Result<(), VulkanError> {
        let State { submissions, tallies, rates, .. } = self;
        submissions.wait(&mut |done| count(tallies, rates, done))
    }

    /// Waits until the submission of this number is done.
    pub(crate) fn wait_for(&mut self, submission: u64) -> Result<(), VulkanError> {
        let State { submissions, tallies, rates, .. } = self;
        submissions.wait_for(submission, &mut |done| count(tallies, rates, done))
    }
}

fn count(tallies: &mut [Tally; Kernel::ALL.len()], rates: &mut [Rate; Kernel::ALL.len()], done: Done) {
    // Measurements of forms are not work that was asked for.
    if done.elements > 0 {
        let time = done.time.unwrap_or_default();
        tallies[done.kernel as usize].time += time;
        let rate = &mut rates[done.kernel as usize];
        *rate = Rate { elements: rate.elements + done.elements, time: rate.time + time };
    }
}

/// Elements of a kernel that are done, and the time that they took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rate {
    elements: u64,
    time: Duration,
}

impl Rate {
    /// The time of what was waited for, if the device did not tell one.
    pub(crate) fn or_took(&mut self, time: Duration) {
        if self.time.is_zero() {
            self.time = time;
        }
    }

    /// The time that so many elements are expected to take, if any have been measured.
    pub(crate) fn time_of(&self, elements: u64) -> Option<Duration> {
        let share = elements as f64 / self.elements as f64;
        (self.elements > 0 && !self.time.is_zero()).then(|| self.time.mul_f64(share))
    }
}

/// A barrier between all earlier and all later commands.
pub(crate) fn barrier(device: &ash::Device, commands: vk::CommandBuffer) {
    let stages = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
    let written = vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE;
    let used = written | vk::AccessFlags::SHADER_READ | vk::AccessFlags::TRANSFER_READ;
    let all = [vk::MemoryBarrier::default().src_access_mask(written).dst_access_mask(used)];
    // SAFETY: the commands are being recorded.
    unsafe {
        device.cmd_pipeline_barrier(commands, stages, stages, vk::DependencyFlags::empty(), &all, &[], &[]);
    }
}
