//! A device that runs kernels.

use crate::adapter::{Adapter, AdapterKind, Limits};
use crate::buffer::{Array, Bound, ranges};
use crate::error::VulkanError;
use crate::handle::{Handle, Memory};
use crate::instance::Instance;
use crate::kernel::{Access, Kernel, Layout, Piece, WORKGROUP};
use crate::pipelines::{Pipeline, Pipelines};
use crate::submissions::{Done, Submission, Submissions};
use ash::vk;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use viewfuse_core::pages::MOST_PAGES;

/// Bytes of the widest element of an array in pages.
const WIDEST_PAGED: u64 = 16;

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
}

impl Default for GpuOptions {
    /// The device's default time limit, a closing time of ten seconds, and the device's own limits.
    fn default() -> GpuOptions {
        let limits =
            Limits { buffer_range: u64::MAX, allocation: u64::MAX, workgroup_count: u32::MAX, memory: u64::MAX };
        GpuOptions { time_limit: None, barriers: true, closing: Duration::from_secs(10), limits }
    }
}

impl GpuOptions {
    /// Time limit of a submission on a device of this kind; `None` without a limit.
    ///
    /// The default of a GPU is two minutes. A software driver has no limit: its kernels share the processor with all other
    /// processes of the machine, and a busy machine is not a failure.
    pub fn time_limit_on(&self, kind: AdapterKind) -> Option<Duration> {
        let of_kind = match kind {
            AdapterKind::Software => None,
            _ => Some(Duration::from_secs(120)),
        };
        self.time_limit.or(of_kind)
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
    state: Mutex<State>,
    pub(crate) handle: Arc<Handle>,
    pub(crate) page_shift: u32,
    barriers: bool,
}

pub(crate) struct State {
    submissions: Submissions,
    pipelines: Pipelines,
    pub(crate) upload: Option<Memory>,
    pub(crate) download: Option<Memory>,
    /// The number of the interval of commands since the last barrier.
    stretch: u64,
    tallies: [Tally; Kernel::ALL.len()],
    /// Whether the device failed: then the content of its memory is undefined.
    failed: Option<VulkanError>,
}

impl Gpu {
    /// Opens a device.
    ///
    /// # Errors
    /// [`VulkanError::Missing`] if it lacks a requirement, and others if Vulkan fails.
    pub fn open(instance: &Arc<Instance>, adapter: &Adapter, options: &GpuOptions) -> Result<Gpu, VulkanError> {
        if adapter.instance_number != instance.number {
            let detail = format!("{} was found by another instance of Vulkan", adapter.name);
            return Err(VulkanError::NoDevice { detail });
        }
        if !adapter.missing.is_empty() {
            let (device, missing) = (adapter.name.clone(), adapter.missing.clone());
            return Err(VulkanError::Missing { device, missing });
        }
        let (own, lower) = (adapter.limits, options.limits);
        let limits = Limits {
            buffer_range: own.buffer_range.min(lower.buffer_range),
            allocation: own.allocation.min(lower.allocation),
            workgroup_count: own.workgroup_count.min(lower.workgroup_count).max(1),
            memory: own.memory.min(lower.memory),
        };
        let handle = Arc::new(Handle::open(instance, adapter, limits)?);
        let timestamps = (adapter.timestamp_bits > 0).then_some((adapter.timestamp_period, adapter.timestamp_bits));
        let time_limit = options.time_limit_on(adapter.kind);
        let submissions = Submissions::new(&handle, adapter.queue_family, timestamps, time_limit, options.closing)?;
        let pipelines = Pipelines::new(&handle)?;
        // The longest page that is within the limits in every array, but long enough to start at allowed offsets.
        let page_len =
            (limits.buffer_range.min(limits.allocation) / WIDEST_PAGED).max(adapter.offset_alignment).max(64);
        let state = State {
            submissions,
            pipelines,
            upload: None,
            download: None,
            stretch: 1,
            tallies: [Tally::default(); Kernel::ALL.len()],
            failed: None,
        };
        Ok(Gpu { state: Mutex::new(state), handle, page_shift: page_len.ilog2().min(31), barriers: options.barriers })
    }

    /// The driver's name for it.
    pub fn name(&self) -> &str {
        &self.handle.name
    }

    /// The limits by which work is split.
    pub fn limits(&self) -> Limits {
        self.handle.limits
    }

    /// Most elements of `bytes` bytes each in an array that is bound as a whole.
    pub fn most_elements(&self, bytes: usize) -> usize {
        let most = self.handle.limits.buffer_range.min(self.handle.limits.allocation);
        usize::try_from(most).unwrap_or(usize::MAX) / bytes
    }

    /// Dispatches a kernel for some of its elements. `parameters` are the kernel's own push constants, `arrays` its
    /// bindings, both as in its row.
    ///
    /// # Errors
    /// [`VulkanError::Arguments`] if they are not, [`VulkanError::OtherDevice`], [`VulkanError::Limit`] if an array cannot
    /// be bound, and others if the device fails, or failed before.
    pub fn dispatch(
        &self,
        kernel: Kernel,
        parameters: &[u8],
        elements: Range<u32>,
        arrays: &[Bound<'_>],
    ) -> Result<(), VulkanError> {
        if elements.is_empty() {
            return Ok(());
        }
        self.check_arguments(kernel, parameters, arrays)?;
        let listed = kernel.arrays().iter().zip(arrays);
        let page_len = 1_usize << self.page_shift;
        let needs_pages = listed.clone().any(|(array, bound)| array.layout == Layout::Pages && bound.0.len > page_len);
        let page_shift = if needs_pages { self.page_shift } else { 0 };
        let uses: Vec<_> = listed.clone().map(|(array, bound)| (bound.0, array.access)).collect();
        self.with_state(|gpu, state| {
            let pipeline = state.pipelines.get(kernel, page_shift)?;
            let per_piece = gpu.handle.limits.workgroup_count.saturating_mul(WORKGROUP);
            let mut dispatches = 0;
            gpu.record(state, &uses, |device, submission, submissions| {
                let set = gpu.bind(submission, &pipeline, listed, page_shift)?;
                submissions.start_clock(submission, kernel);
                // SAFETY: pipeline, set and constants are of the kernel's layout; the counts are within the limits.
                unsafe {
                    let (commands, compute) = (submission.commands, vk::PipelineBindPoint::COMPUTE);
                    device.cmd_bind_pipeline(commands, compute, pipeline.raw);
                    device.cmd_bind_descriptor_sets(commands, compute, pipeline.layout, 0, &[set], &[]);
                    for first in elements.clone().step_by(per_piece as usize) {
                        let piece = Piece { first, count: per_piece.min(elements.end - first) };
                        let constants = [parameters, bytemuck::bytes_of(&piece)].concat();
                        let stage = vk::ShaderStageFlags::COMPUTE;
                        // Pieces write different elements, but the validation layers only see whole arrays. Pieces are
                        // large, so a barrier between them costs nothing.
                        if dispatches > 0 && gpu.barriers {
                            barrier(device, commands);
                        }
                        device.cmd_push_constants(commands, pipeline.layout, stage, 0, &constants);
                        device.cmd_dispatch(commands, piece.count.div_ceil(WORKGROUP), 1, 1);
                        dispatches += 1;
                    }
                }
                submissions.stop_clock(submission);
                Ok(())
            })?;
            let tally = &mut state.tallies[kernel as usize];
            tally.dispatches += dispatches;
            tally.elements += u64::from(elements.end - elements.start);
            Ok(())
        })
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

    fn lock(&self) -> MutexGuard<'_, State> {
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

    /// Records commands that use these arrays, after a barrier if they depend on commands since the last one, and submits
    /// them.
    pub(crate) fn record(
        &self,
        state: &mut State,
        uses: &[(&Arc<Array>, Access)],
        commands: impl FnOnce(&ash::Device, &mut Submission, &Submissions) -> Result<(), VulkanError>,
    ) -> Result<(), VulkanError> {
        let State { submissions, tallies, stretch, .. } = state;
        let mut submission = submissions.begin(&mut |done| count(tallies, done))?;
        let depends = uses.iter().any(|(array, access)| {
            array.written_in.is(*stretch) || (*access == Access::Write && array.read_in.is(*stretch))
        });
        if depends {
            if self.barriers {
                barrier(&self.handle.device, submission.commands);
            }
            *stretch += 1;
        }
        for (array, access) in uses {
            Submissions::hold(&mut submission, array);
            match access {
                Access::Read => array.read_in.set(*stretch),
                Access::Write => array.written_in.set(*stretch),
            }
        }
        match commands(&self.handle.device, &mut submission, submissions) {
            Ok(()) => submissions.submit(submission),
            Err(error) => {
                submissions.discard(submission);
                Err(error)
            }
        }
    }

    fn bind<'a>(
        &self,
        submission: &Submission,
        pipeline: &Pipeline,
        arrays: impl Iterator<Item = (&'a crate::kernel::Array, &'a Bound<'a>)>,
        page_shift: u32,
    ) -> Result<vk::DescriptorSet, VulkanError> {
        let layouts = [pipeline.set_layout];
        let info =
            vk::DescriptorSetAllocateInfo::default().descriptor_pool(submission.descriptors).set_layouts(&layouts);
        // SAFETY: the pool is as large as the largest set, and empty.
        let set = unsafe { self.handle.device.allocate_descriptor_sets(&info) }
            .map_err(|result| self.handle.failure("vkAllocateDescriptorSets", result))?[0];
        let infos: Vec<[vk::DescriptorBufferInfo; 1]> = arrays
            .flat_map(|(array, bound)| ranges(bound.0, array.layout, page_shift))
            .map(|range| [vk::DescriptorBufferInfo { buffer: range.buffer, offset: range.offset, range: range.bytes }])
            .collect();
        let writes: Vec<_> = (0..)
            .zip(&infos)
            .map(|(binding, info)| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .buffer_info(info)
            })
            .collect();
        // SAFETY: the ranges lie in their buffers, which the submission holds.
        unsafe { self.handle.device.update_descriptor_sets(&writes, &[]) };
        Ok(set)
    }

    fn check_arguments(&self, kernel: Kernel, parameters: &[u8], arrays: &[Bound<'_>]) -> Result<(), VulkanError> {
        let refuse = |detail| Err(VulkanError::Arguments { kernel: kernel.name(), detail });
        if parameters.len() != kernel.parameter_bytes() {
            return refuse(format!("{} bytes of parameters instead of {}", parameters.len(), kernel.parameter_bytes()));
        }
        let listed = kernel.arrays();
        if arrays.len() != listed.len() {
            return refuse(format!("{} arrays instead of {}", arrays.len(), listed.len()));
        }
        let (range, allocation) = (self.handle.limits.buffer_range, self.handle.limits.allocation);
        // What makes pages as short as they are.
        let (page_limit, most_page_bytes) = match range <= allocation {
            true => ("maxStorageBufferRange", range),
            false => ("maxMemoryAllocationSize", allocation),
        };
        for (array, bound) in listed.iter().zip(arrays) {
            bound.0.check_owner(&self.handle)?;
            let (len, stride) = (bound.0.len, bound.0.stride);
            // Pages are counted in elements: there they must be the kernel's own.
            let fits = match array.layout {
                Layout::Whole | Layout::One => array.stride % stride == 0,
                Layout::Pages => array.stride == stride,
            };
            if !fits {
                return refuse(format!("{} of {stride} bytes an element instead of {}", array.name, array.stride));
            }
            let limit = |limit, needed, available| {
                let pages = if array.layout == Layout::Pages { "a page of " } else { "" };
                let what = format!("{pages}array {} of kernel {}", array.name, kernel.name());
                Err(VulkanError::Limit { device: self.handle.name.clone(), what, limit, needed, available })
            };
            let bytes = (len * stride) as u64;
            if bytes < array.least_bytes as u64 {
                return refuse(format!("{} has {bytes} bytes instead of {}", array.name, array.least_bytes));
            }
            let shared = arrays.iter().filter(|other| Arc::ptr_eq(other.0, bound.0)).count() > 1;
            if shared && array.access == Access::Write {
                return refuse(format!("{} is written, and bound a second time", array.name));
            }
            let page_bytes = (len.min(1 << self.page_shift) * stride) as u64;
            match array.layout {
                Layout::Whole | Layout::One if bytes > range => return limit("maxStorageBufferRange", bytes, range),
                Layout::Whole | Layout::One if bound.0.chunks.len() > 1 => {
                    return limit("maxMemoryAllocationSize", bytes, allocation);
                }
                // Pages have a least length, for their offsets.
                Layout::Pages if page_bytes > most_page_bytes => {
                    return limit(page_limit, page_bytes, most_page_bytes);
                }
                Layout::Pages if len > MOST_PAGES << self.page_shift => {
                    let page_len = len.div_ceil(MOST_PAGES).next_power_of_two() as u64;
                    return limit(page_limit, page_len * WIDEST_PAGED, most_page_bytes);
                }
                _ => {}
            }
        }
        Ok(())
    }
}

impl State {
    pub(crate) fn wait(&mut self) -> Result<(), VulkanError> {
        let State { submissions, tallies, .. } = self;
        submissions.wait(&mut |done| count(tallies, done))
    }
}

fn count(tallies: &mut [Tally; Kernel::ALL.len()], done: Done) {
    tallies[done.kernel as usize].time += done.time.unwrap_or_default();
}

/// A barrier between all earlier and all later commands.
fn barrier(device: &ash::Device, commands: vk::CommandBuffer) {
    let stages = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
    let written = vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE;
    let used = written | vk::AccessFlags::SHADER_READ | vk::AccessFlags::TRANSFER_READ;
    let all = [vk::MemoryBarrier::default().src_access_mask(written).dst_access_mask(used)];
    // SAFETY: the commands are being recorded.
    unsafe {
        device.cmd_pipeline_barrier(commands, stages, stages, vk::DependencyFlags::empty(), &all, &[], &[]);
    }
}
