//! An opened device: its functions, its queue, its memory.

use crate::adapter::{Adapter, Identity, Limits};
use crate::error::VulkanError;
use crate::instance::Instance;
use crate::kernel::Form;
use ash::{khr, vk};
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationError, AllocationSizes, AllocatorDebugSettings};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of one allocation for many buffers; less than every device must support.
const BLOCK: u64 = 64 << 20;

/// The state that buffers and submissions share. Dropped last.
pub(crate) struct Handle {
    pub(crate) name: String,
    pub(crate) device: ash::Device,
    pub(crate) queue: vk::Queue,
    pub(crate) limits: Limits,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    /// Bytes of all existing buffers.
    used: AtomicU64,
    /// A submission may still run and is not waited for any more: its resources must not be freed.
    abandoned: AtomicBool,
    adapter: Adapter,
    /// Reports on pipelines, where the device has them.
    executables: Option<khr::pipeline_executable_properties::Device>,
    pub(crate) instance: Arc<Instance>,
}

impl Handle {
    pub(crate) fn open(instance: &Arc<Instance>, adapter: &Adapter, limits: Limits) -> Result<Handle, VulkanError> {
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(adapter.queue_family)
            .queue_priorities(&priorities)];
        let extensions: Vec<_> = adapter.extensions.iter().map(|name| name.as_ptr()).collect();
        let mut model = vk::PhysicalDeviceVulkanMemoryModelFeatures::default().vulkan_memory_model(true);
        let mut subgroups = vk::PhysicalDeviceSubgroupSizeControlFeaturesEXT::default()
            .subgroup_size_control(true)
            .compute_full_subgroups(true);
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut model);
        if adapter.subgroup_size.is_some() {
            info = info.push_next(&mut subgroups);
        }
        let mut matrices = vk::PhysicalDeviceCooperativeMatrixFeaturesKHR::default().cooperative_matrix(true);
        let mut floats = vk::PhysicalDeviceShaderFloat16Int8Features::default().shader_float16(true);
        if adapter.has_matrices {
            info = info.push_next(&mut matrices).push_next(&mut floats);
        }
        let mut executable =
            vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
        let reports = adapter.extensions.contains(&khr::pipeline_executable_properties::NAME);
        if reports {
            info = info.push_next(&mut executable);
        }
        // SAFETY: everything that `info` points to lives until the call returns; the adapter has what is enabled.
        let device = unsafe { instance.raw.create_device(adapter.raw, &info, None) }
            .map_err(|result| failure(&adapter.name, "vkCreateDevice", result))?;
        // SAFETY: one queue of this family was created.
        let queue = unsafe { device.get_device_queue(adapter.queue_family, 0) };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: device.clone(),
            physical_device: adapter.raw,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: AllocationSizes::new(BLOCK, BLOCK),
        });
        let allocator = match allocator {
            Ok(allocator) => allocator,
            Err(error) => {
                // SAFETY: nothing of the device is in use.
                unsafe { device.destroy_device(None) };
                return Err(unexpected(&adapter.name, &error));
            }
        };
        let executables = reports.then(|| khr::pipeline_executable_properties::Device::new(&instance.raw, &device));
        Ok(Handle {
            name: adapter.name.clone(),
            executables,
            device,
            queue,
            limits,
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            used: AtomicU64::new(0),
            abandoned: AtomicBool::new(false),
            adapter: adapter.clone(),
            instance: instance.clone(),
        })
    }

    /// What is remembered depends on.
    pub(crate) fn identity(&self) -> Identity {
        self.adapter.identity
    }

    /// Whether it has what a form of tiled kernels needs.
    pub(crate) fn runs(&self, form: Form) -> bool {
        self.adapter.runs(form)
    }

    /// Whether its workgroups have the invocations and the memory of a form.
    pub(crate) fn has_room_for(&self, form: Form) -> bool {
        self.adapter.has_room_for(form)
    }

    /// Invocations of a subgroup, where kernels may use them.
    pub(crate) fn subgroup_size(&self) -> Option<u32> {
        self.adapter.subgroup_size
    }

    /// Invocations of a subgroup of a compute pipeline, as the driver reports them; `None` where it does not.
    pub(crate) fn reported_subgroup_size(&self, pipeline: vk::Pipeline) -> Option<u32> {
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        // SAFETY: the pipeline is the device's, and the device has the extension and its feature.
        let reports = unsafe { self.executables.as_ref()?.get_pipeline_executable_properties(&info) }.ok()?;
        reports.first().map(|report| report.subgroup_size).filter(|size| *size > 0)
    }

    /// Whether the driver reports of pipelines.
    pub(crate) fn reports_pipelines(&self) -> bool {
        self.executables.is_some()
    }

    /// The statistics of a compute pipeline that was made to keep them, with the driver's names.
    pub(crate) fn statistics(&self, pipeline: vk::Pipeline) -> Vec<(String, f64)> {
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
        // SAFETY: the pipeline is the device's and keeps its statistics, and the device has the extension and its
        // feature. A compute pipeline has an executable 0.
        let found = self.executables.as_ref().map(|known| unsafe { known.get_pipeline_executable_statistics(&info) });
        let statistic = |known: &vk::PipelineExecutableStatisticKHR<'_>| {
            let name = known.name_as_c_str().map_or_else(|_| String::new(), |name| name.to_string_lossy().into_owned());
            use vk::PipelineExecutableStatisticFormatKHR as Kind;
            // SAFETY: the format says which of the numbers it is.
            let value = unsafe {
                match known.format {
                    Kind::BOOL32 => f64::from(known.value.b32),
                    Kind::INT64 => known.value.i64 as f64,
                    Kind::UINT64 => known.value.u64 as f64,
                    _ => known.value.f64,
                }
            };
            (name, value)
        };
        found.and_then(Result::ok).unwrap_or_default().iter().map(statistic).collect()
    }

    /// Whether this many more bytes are available.
    pub(crate) fn has_room(&self, bytes: u64) -> bool {
        self.used.load(Ordering::Relaxed).saturating_add(bytes) <= self.limits.memory
    }

    /// A buffer of this many bytes.
    pub(crate) fn memory(self: &Arc<Self>, bytes: u64, location: MemoryLocation) -> Result<Memory, VulkanError> {
        let out_of_memory = || self.out_of_memory(bytes);
        if !self.has_room(bytes) {
            return Err(out_of_memory());
        }
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage).sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: `info` is complete.
        let buffer = unsafe { self.device.create_buffer(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => out_of_memory(),
            result => self.failure("vkCreateBuffer", result),
        })?;
        // SAFETY: the buffer was just made.
        let requirements = unsafe { self.device.get_buffer_memory_requirements(buffer) };
        let allocation = self.lock_allocator().allocate(&AllocationCreateDesc {
            name: "viewfuse",
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        let mut memory = Memory { buffer, bytes, allocation: None, handle: self.clone() };
        self.used.fetch_add(bytes, Ordering::Relaxed);
        match allocation {
            // From here on, dropping `memory` gives everything back.
            Ok(allocation) => memory.allocation = Some(allocation),
            Err(AllocationError::OutOfMemory) => return Err(out_of_memory()),
            Err(error) => return Err(unexpected(&self.name, &error)),
        }
        if let Some(allocation) = &memory.allocation {
            // SAFETY: the allocation fits the buffer's requirements and is used by nothing else.
            unsafe { self.device.bind_buffer_memory(buffer, allocation.memory(), allocation.offset()) }
                .map_err(|result| self.failure("vkBindBufferMemory", result))?;
        }
        Ok(memory)
    }

    fn lock_allocator(&self) -> std::sync::MutexGuard<'_, Allocator> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn out_of_memory(&self, requested: u64) -> VulkanError {
        let total = self.limits.memory;
        let mut available = total.saturating_sub(self.used.load(Ordering::Relaxed));
        if self.adapter.has_memory_budget {
            let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
            let mut properties = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
            // SAFETY: the device has the extension ext::memory_budget.
            unsafe {
                self.instance.raw.get_physical_device_memory_properties2(self.adapter.raw, &mut properties);
            }
            let properties = properties.memory_properties;
            let free = properties.memory_heaps_as_slice().iter().enumerate();
            let free = free.filter(|(_, heap)| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
            let free = free.map(|(at, _)| budget.heap_budget[at].saturating_sub(budget.heap_usage[at])).max();
            available = available.min(free.unwrap_or(available));
        }
        let device = self.name.clone();
        VulkanError::OutOfMemory { device, requested, available, total }
    }

    /// A failed call as an error; a lost device has its own. After each of them the content of the device's memory is
    /// undefined, also after lack of memory: recorded commands that never ran may be dependencies of others.
    pub(crate) fn failure(&self, call: &'static str, result: vk::Result) -> VulkanError {
        failure(&self.name, call, result)
    }

    /// The oldest message of the validation layers, as an error.
    pub(crate) fn check_messages(&self) -> Result<(), VulkanError> {
        match self.instance.messages().first() {
            Some(message) => Err(VulkanError::Validation(message)),
            None => Ok(()),
        }
    }

    /// From now on no resource is freed.
    pub(crate) fn abandon(&self) {
        self.abandoned.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Relaxed)
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        if self.is_abandoned() {
            return;
        }
        // SAFETY: buffers and submissions hold the handle alive: none is left, and the allocator is not used again.
        unsafe {
            ManuallyDrop::drop(&mut self.allocator);
            self.device.destroy_device(None);
        }
    }
}

fn failure(device: &str, call: &'static str, result: vk::Result) -> VulkanError {
    match result {
        vk::Result::ERROR_DEVICE_LOST => VulkanError::DeviceLost(device.to_owned(), call),
        result => VulkanError::Call(call, result),
    }
}

fn unexpected(device: &str, error: &AllocationError) -> VulkanError {
    VulkanError::Memory(device.to_owned(), error.to_string())
}

/// A buffer with its memory.
pub(crate) struct Memory {
    pub(crate) buffer: vk::Buffer,
    pub(crate) bytes: u64,
    allocation: Option<Allocation>,
    handle: Arc<Handle>,
}

impl Memory {
    /// Its device.
    pub(crate) fn owner(&self) -> &Handle {
        &self.handle
    }

    /// Its mapping on the host, if it is host-visible.
    pub(crate) fn mapped(&mut self) -> Option<&mut [u8]> {
        self.allocation.as_mut().and_then(Allocation::mapped_slice_mut)
    }

    /// The same, to be read.
    pub(crate) fn seen(&self) -> Option<&[u8]> {
        self.allocation.as_ref().and_then(Allocation::mapped_slice)
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if self.handle.is_abandoned() {
            return;
        }
        // SAFETY: submissions that use the buffer hold it alive: none is left.
        unsafe { self.handle.device.destroy_buffer(self.buffer, None) };
        if let Some(allocation) = self.allocation.take() {
            // It was allocated here; freeing what was allocated here cannot fail.
            let _ = self.handle.lock_allocator().free(allocation);
        }
        self.handle.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}
