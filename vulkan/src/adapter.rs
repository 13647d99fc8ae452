//! A device before it is opened: its properties, and whether it fulfils the requirements.

use crate::error::{Missing, VulkanError, failed};
use crate::instance::Instance;
use crate::kernel::{Form, Kernel, WORKGROUP};
use crate::matrices;
use crate::subgroups::fitting_size;
use ash::{ext, khr, vk};
use std::ffi::{CStr, FromBytesUntilNulError};
use std::fmt;

/// The kind of a device, the preferred kinds first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A discrete GPU.
    Discrete,
    /// An integrated GPU, which shares the machine's memory.
    Integrated,
    /// A virtual GPU.
    Virtual,
    /// Another kind.
    Other,
    /// A software driver on the CPU.
    Software,
}

impl AdapterKind {
    fn of(kind: vk::PhysicalDeviceType) -> AdapterKind {
        match kind {
            vk::PhysicalDeviceType::DISCRETE_GPU => AdapterKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => AdapterKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => AdapterKind::Virtual,
            vk::PhysicalDeviceType::CPU => AdapterKind::Software,
            _ => AdapterKind::Other,
        }
    }

    /// Whether it is a GPU.
    pub fn is_gpu(self) -> bool {
        self <= AdapterKind::Virtual
    }
}

impl fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            AdapterKind::Discrete => "discrete",
            AdapterKind::Integrated => "integrated",
            AdapterKind::Virtual => "virtual",
            AdapterKind::Other => "other",
            AdapterKind::Software => "software",
        })
    }
}

/// Limits by which work is split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most bytes of a storage buffer that a kernel can bind (`maxStorageBufferRange`).
    pub buffer_range: u64,
    /// Most bytes of an allocation (`maxMemoryAllocationSize`).
    pub allocation: u64,
    /// Most workgroups of a dispatch (`maxComputeWorkGroupCount[0]`).
    pub workgroup_count: u32,
    /// Bytes of usable memory, staging included.
    pub memory: u64,
}

/// A device that could be opened.
#[derive(Clone, Debug)]
pub struct Adapter {
    pub(crate) raw: vk::PhysicalDevice,
    pub(crate) instance_number: u64,
    /// Its number in the list of [`Instance::adapters`].
    pub index: usize,
    /// The driver's name for it.
    pub name: String,
    /// Its kind.
    pub kind: AdapterKind,
    /// The driver and its version.
    pub driver: String,
    /// Its version of Vulkan, packed.
    pub api_version: u32,
    /// Bytes of its largest local heap.
    pub memory: u64,
    /// The limits by which work is split.
    pub limits: Limits,
    /// Invocations of a subgroup in [`Form::Subgroup`](crate::kernel::Form::Subgroup); `None` if the device cannot run
    /// that form.
    pub subgroup_size: Option<u32>,
    /// Whether it has matrix units for [`Form::ROUNDED`](crate::kernel::Form::ROUNDED): f16 matrices of 16x16x16 with
    /// f32 sums (`VK_KHR_cooperative_matrix`) in subgroups of 32 invocations.
    pub has_matrices: bool,
    /// Missing requirements; if there are any, it cannot be opened.
    pub missing: Vec<Missing>,
    /// Most invocations of a workgroup, and bytes of the memory that they share.
    pub(crate) workgroup: [u32; 2],
    pub(crate) queue_family: u32,
    pub(crate) timestamp_bits: u32,
    pub(crate) timestamp_period: f32,
    pub(crate) offset_alignment: u64,
    pub(crate) extensions: Vec<&'static CStr>,
    pub(crate) has_memory_budget: bool,
    pub(crate) identity: Identity,
}

impl Adapter {
    /// The same as the driver describes it now, by the instance that it is of.
    pub(crate) fn again(&self, instance: &Instance) -> Adapter {
        Adapter { index: self.index, ..Adapter::new(instance, self.raw) }
    }
}

/// What compiled pipelines and measurements depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    pub(crate) vendor: u32,
    pub(crate) device: u32,
    pub(crate) driver: u32,
    /// `pipelineCacheUUID`.
    pub(crate) cache: [u8; 16],
}

impl Instance {
    /// Every device, the preferred ones first: discrete, integrated, virtual, other, software; among equals the one
    /// with more memory, then in the order of the loader.
    ///
    /// # Errors
    /// [`VulkanError::NoDevice`] if there is none.
    pub fn adapters(&self) -> Result<Vec<Adapter>, VulkanError> {
        // SAFETY: no requirements.
        let devices = unsafe { self.raw.enumerate_physical_devices() }.map_err(failed("vkEnumeratePhysicalDevices"))?;
        if devices.is_empty() {
            return Err(VulkanError::NoDevice("the installed drivers have no device".to_owned()));
        }
        let mut adapters: Vec<Adapter> = devices.into_iter().map(|raw| Adapter::new(self, raw)).collect();
        adapters.sort_by_key(|adapter| (adapter.kind, std::cmp::Reverse(adapter.memory)));
        adapters.iter_mut().enumerate().for_each(|(index, adapter)| adapter.index = index);
        Ok(adapters)
    }
}

impl Adapter {
    pub(crate) fn new(instance: &Instance, raw: vk::PhysicalDevice) -> Adapter {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut maintenance = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut properties =
            vk::PhysicalDeviceProperties2::default().push_next(&mut maintenance).push_next(&mut driver);
        // SAFETY: the chained structs are known to 1.1, or ignored.
        unsafe { instance.raw.get_physical_device_properties2(raw, &mut properties) };
        let properties = properties.properties;
        let limits = &properties.limits;
        // SAFETY: the device is the instance's.
        let (families, memory_types, offered) = unsafe {
            (
                instance.raw.get_physical_device_queue_family_properties(raw),
                instance.raw.get_physical_device_memory_properties(raw),
                instance.raw.enumerate_device_extension_properties(raw).unwrap_or_default(),
            )
        };
        let has = |name: &CStr| offered.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
        let subgroup_size = match has(ext::subgroup_size_control::NAME) {
            true if properties.api_version >= vk::API_VERSION_1_1 => fitting_size(instance, raw),
            _ => None,
        };
        let has_matrices = subgroup_size.is_some()
            && properties.api_version >= vk::API_VERSION_1_2
            && has(khr::cooperative_matrix::NAME)
            && matrices::fit(instance, raw);
        let heaps = memory_types.memory_heaps_as_slice().iter();
        let memory = heaps
            .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|heap| heap.size)
            .max()
            .unwrap_or(0);
        let family = best_family(&families);
        let has_model = memory_model(instance, raw, properties.api_version, has(khr::vulkan_memory_model::NAME));
        Adapter {
            raw,
            instance_number: instance.number,
            index: 0,
            name: text(properties.device_name_as_c_str()),
            kind: AdapterKind::of(properties.device_type),
            driver: match text(driver.driver_name_as_c_str()) {
                name if name.is_empty() => format!("version {:#x}", properties.driver_version),
                name => format!("{name} {}", text(driver.driver_info_as_c_str())).trim_end().to_owned(),
            },
            api_version: properties.api_version,
            memory,
            workgroup: [
                limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]),
                limits.max_compute_shared_memory_size,
            ],
            limits: Limits {
                buffer_range: limits.max_storage_buffer_range.into(),
                // Devices may say 0 where they mean no limit.
                allocation: match maintenance.max_memory_allocation_size {
                    0 => u64::MAX,
                    size => size,
                },
                workgroup_count: limits.max_compute_work_group_count[0],
                memory,
            },
            subgroup_size,
            has_matrices,
            missing: missing(&properties, has_model, family.is_some()),
            queue_family: family.unwrap_or(0),
            timestamp_bits: family.map_or(0, |family| families[family as usize].timestamp_valid_bits),
            timestamp_period: limits.timestamp_period,
            offset_alignment: limits.min_storage_buffer_offset_alignment,
            extensions: extensions(
                properties.api_version,
                subgroup_size.is_some(),
                has_matrices,
                has(khr::pipeline_executable_properties::NAME) && reports_pipelines(instance, raw),
                has,
            ),
            has_memory_budget: has(ext::memory_budget::NAME),
            identity: Identity {
                vendor: properties.vendor_id,
                device: properties.device_id,
                driver: properties.driver_version,
                cache: properties.pipeline_cache_uuid,
            },
        }
    }

    /// Whether it has what a form of tiled kernels needs.
    pub fn runs(&self, form: Form) -> bool {
        (!form.needs_subgroups() || self.subgroup_size.is_some())
            && (!form.needs_matrices() || self.has_matrices)
            && self.has_room_for(form)
    }

    /// Whether its workgroups have the invocations and the memory of a form.
    pub fn has_room_for(&self, form: Form) -> bool {
        let [invocations, shared_bytes] = self.workgroup;
        invocations >= form.invocations() && shared_bytes as usize >= form.shared_bytes()
    }

    /// A name for what the device remembers: letters, digits and hyphens. Another driver has another one.
    pub fn memory_name(&self) -> String {
        let Identity { vendor, device, cache, .. } = self.identity;
        let cache: String = cache.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{vendor:x}-{device:x}-{cache}")
    }

    /// Chooses among [`Instance::adapters`]: by number, by whole words of the name (in any case), or, for an empty
    /// text, any. Of several, the first usable one. A number is always the device's: a name may hold numbers, too.
    ///
    /// # Errors
    /// [`VulkanError::NoSuchDevice`] if none matches, [`VulkanError::Missing`] if the matching one cannot be used.
    pub fn choose<'a>(adapters: &'a [Adapter], wanted: &str) -> Result<&'a Adapter, VulkanError> {
        let is_number = !wanted.is_empty() && wanted.bytes().all(|byte| byte.is_ascii_digit());
        let lower = wanted.to_lowercase();
        let fits = |adapter: &&Adapter| match is_number {
            true => wanted.parse() == Ok(adapter.index),
            false => has_words(&adapter.name.to_lowercase(), &lower),
        };
        let fitting = || adapters.iter().filter(fits);
        let Some(adapter) = fitting().find(|adapter| adapter.missing.is_empty()).or(fitting().next()) else {
            let wanted = if is_number { wanted.to_owned() } else { format!("'{wanted}'") };
            let there = adapters.iter().map(|adapter| format!("{} {}", adapter.index, adapter.name)).collect();
            return Err(VulkanError::NoSuchDevice(wanted, there));
        };
        match adapter.missing.is_empty() {
            true => Ok(adapter),
            false => Err(VulkanError::Missing(adapter.name.clone(), adapter.missing.clone())),
        }
    }
}

/// Whether a name holds a text that neither begins nor ends within a word of it.
fn has_words(name: &str, text: &str) -> bool {
    let is_word = |character: Option<char>| character.is_some_and(char::is_alphanumeric);
    let begins_within = |at: usize| is_word(name[..at].chars().next_back()) && is_word(text.chars().next());
    let ends_within = |end: usize| is_word(name[end..].chars().next()) && is_word(text.chars().next_back());
    (text.is_empty() || text.contains(char::is_alphanumeric))
        && name.match_indices(text).any(|(at, _)| !begins_within(at) && !ends_within(at + text.len()))
}

fn text(name: Result<&CStr, FromBytesUntilNulError>) -> String {
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A compute queue, preferably one without graphics, which runs beside the desktop's.
fn best_family(families: &[vk::QueueFamilyProperties]) -> Option<u32> {
    let computes = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
    let draws = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::GRAPHICS);
    let alone = families.iter().position(|family| computes(family) && !draws(family));
    alone.or(families.iter().position(computes)).map(|index| index as u32)
}

/// Those to enable: what a device asks for, and what is used where it is offered.
fn extensions(
    api_version: u32,
    has_subgroups: bool,
    has_matrices: bool,
    has_reports: bool,
    has: impl Fn(&CStr) -> bool,
) -> Vec<&'static CStr> {
    let wanted = [
        (khr::portability_subset::NAME, true),
        (khr::vulkan_memory_model::NAME, api_version < vk::API_VERSION_1_2),
        (ext::memory_budget::NAME, true),
        (ext::subgroup_size_control::NAME, has_subgroups),
        (khr::cooperative_matrix::NAME, has_matrices),
        (khr::pipeline_executable_properties::NAME, has_subgroups && has_reports),
    ];
    wanted.into_iter().filter(|(name, is_used)| *is_used && has(name)).map(|(name, _)| name).collect()
}

/// Whether a device with the extension reports on its pipelines.
fn reports_pipelines(instance: &Instance, raw: vk::PhysicalDevice) -> bool {
    let features: vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR<'_> = instance.features(raw);
    features.pipeline_executable_info == vk::TRUE
}

fn memory_model(instance: &Instance, raw: vk::PhysicalDevice, api_version: u32, has_extension: bool) -> bool {
    let is_known = api_version >= vk::API_VERSION_1_2 || (api_version >= vk::API_VERSION_1_1 && has_extension);
    let features = || instance.features::<vk::PhysicalDeviceVulkanMemoryModelFeatures<'_>>(raw);
    is_known && features().vulkan_memory_model == vk::TRUE
}

fn missing(properties: &vk::PhysicalDeviceProperties, has_memory_model: bool, has_queue: bool) -> Vec<Missing> {
    let limits = &properties.limits;
    let mut missing = Vec::new();
    if properties.api_version < vk::API_VERSION_1_1 {
        missing.push(Missing::Version(properties.api_version));
    }
    if !has_queue {
        missing.push(Missing::ComputeQueue);
    }
    if !has_memory_model {
        missing.push(Missing::Feature("vulkanMemoryModel"));
    }
    let most = |count: fn(Kernel) -> usize| Kernel::ALL.into_iter().map(count).max().unwrap_or(0) as u64;
    let bindings = most(|kernel| kernel.binding_count());
    let mut need = |name, needed: u64, found: u32| {
        if u64::from(found) < needed {
            missing.push(Missing::Limit { name, needed, found: found.into() });
        }
    };
    need("maxPerStageDescriptorStorageBuffers", bindings, limits.max_per_stage_descriptor_storage_buffers);
    need("maxDescriptorSetStorageBuffers", bindings, limits.max_descriptor_set_storage_buffers);
    need("maxPushConstantsSize", most(|kernel| kernel.push_bytes()), limits.max_push_constants_size);
    need("maxComputeWorkGroupInvocations", WORKGROUP.into(), limits.max_compute_work_group_invocations);
    need("maxComputeWorkGroupSize[0]", WORKGROUP.into(), limits.max_compute_work_group_size[0]);
    missing
}
