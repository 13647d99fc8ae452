//! One pipeline per kernel, form and specialisation, created at its first use.

use crate::error::VulkanError;
use crate::excerpt::Index;
use crate::handle::Handle;
use crate::kernel::{Form, Kernel};
use crate::matrices;
use ash::vk;
use std::collections::HashMap;
use std::ffi::CString;
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, OnceLock, PoisonError, RwLock, RwLockReadGuard};

/// The kernels, as `cargo shaders` compiles them.
pub(crate) const MODULE: &[u8] = include_bytes!("kernels.spv");
/// Those that need operations of subgroups.
pub(crate) const SUBGROUPS: &[u8] = include_bytes!("subgroups.spv");

/// Those that need matrix units.
pub(crate) const MATRICES: &[u8] = include_bytes!("matrices.spv");

/// The modules, each looked at once a process, when its first kernel is compiled.
static INDICES: [LazyLock<Index>; 3] = [
    LazyLock::new(|| Index::new(MODULE)),
    LazyLock::new(|| Index::new(SUBGROUPS)),
    LazyLock::new(|| Index::new(MATRICES)),
];

/// The pipeline of a kernel.
#[derive(Clone, Copy)]
pub(crate) struct Pipeline {
    pub(crate) raw: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
}

/// A kernel, its form, and the logarithm of the elements of a page; 0 leaves the choice of pages out.
pub(crate) type Key = (Kernel, Form, u32);

/// A pipeline that is made once, by whoever needs it first; the others wait for it.
type Made = Arc<OnceLock<Result<vk::Pipeline, VulkanError>>>;

/// All pipelines of a device, which any thread may make.
pub(crate) struct Pipelines {
    /// Written to where a driver wants exclusive access; several threads make pipelines with it at a time.
    cache: RwLock<vk::PipelineCache>,
    layouts: Mutex<HashMap<Kernel, (vk::DescriptorSetLayout, vk::PipelineLayout)>>,
    /// The data that the cache began with.
    recalled: Mutex<Vec<u8>>,
    made: Mutex<HashMap<Key, Made>>,
    /// What takes the place of the driver's reports.
    pretended: Option<u32>,
    /// What takes the place of the module for matrix units.
    stand_ins: Option<Index>,
    handle: Arc<Handle>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Pipelines {
    /// `pretended` is a size of subgroups that takes the place of the driver's reports, `stand_ins` a module that takes
    /// the place of that for matrix units.
    pub(crate) fn new(
        handle: &Arc<Handle>,
        pretended: Option<u32>,
        stand_ins: Option<&'static [u8]>,
    ) -> Result<Pipelines, VulkanError> {
        // SAFETY: an empty cache needs nothing.
        let cache = unsafe { handle.device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None) }
            .map_err(|result| handle.failure("vkCreatePipelineCache", result))?;
        Ok(Pipelines {
            cache: RwLock::new(cache),
            layouts: Mutex::default(),
            recalled: Mutex::default(),
            made: Mutex::default(),
            pretended,
            stand_ins: stand_ins.map(Index::new),
            handle: handle.clone(),
        })
    }

    /// Begins with the data of another process's cache, which is of this device and driver. A driver that does not take
    /// it goes on without.
    pub(crate) fn recall(&self, data: &[u8]) {
        if let Some(new) = self.cache_of(data) {
            let mut cache = self.cache.write().unwrap_or_else(PoisonError::into_inner);
            // SAFETY: pipelines do not need the cache that they were created with, and nobody else uses it now.
            unsafe { self.handle.device.destroy_pipeline_cache(*cache, None) };
            *cache = new;
            *locked(&self.recalled) = data.to_vec();
        }
    }

    /// A cache with the data of another process's, which is of this device and driver.
    fn cache_of(&self, data: &[u8]) -> Option<vk::PipelineCache> {
        let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
        // SAFETY: the data has the header that the specification demands, of this device.
        unsafe { self.handle.device.create_pipeline_cache(&info, None) }.ok()
    }

    fn shared_cache(&self) -> RwLockReadGuard<'_, vk::PipelineCache> {
        self.cache.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the cache's data is other than the data that it began with.
    pub(crate) fn has_new(&self) -> bool {
        !locked(&self.made).is_empty() && self.cached() != *locked(&self.recalled)
    }

    /// The cache's data.
    pub(crate) fn cached(&self) -> Vec<u8> {
        let cache = self.shared_cache();
        // SAFETY: the cache is the device's.
        unsafe { self.handle.device.get_pipeline_cache_data(*cache) }.unwrap_or_default()
    }

    /// Adds what another process's cache has, unless the cache began with that. A driver that does not take it goes on
    /// without.
    pub(crate) fn merge(&self, data: &[u8]) {
        if data.is_empty() || data == &locked(&self.recalled)[..] {
            return;
        }
        let Some(other) = self.cache_of(data) else { return };
        let cache = self.cache.write().unwrap_or_else(PoisonError::into_inner);
        let Handle { device, .. } = &*self.handle;
        // SAFETY: two different caches of the device; nobody else uses the one, and access to the other is exclusive.
        unsafe {
            let _ = device.merge_pipeline_caches(*cache, &[other]);
            device.destroy_pipeline_cache(other, None);
        }
    }

    /// A pipeline, made now if it is not there.
    pub(crate) fn get(&self, key: Key) -> Result<Pipeline, VulkanError> {
        let (set_layout, layout) = self.layouts(key.0)?;
        let made = locked(&self.made).entry(key).or_default().clone();
        Ok(Pipeline {
            raw: made.get_or_init(|| self.create(key, layout, vk::PipelineCreateFlags::empty())).clone()?,
            layout,
            set_layout,
        })
    }

    /// Makes the pipelines that are not there side by side: a driver takes up to seconds for each.
    pub(crate) fn prepare(&self, keys: &[Key]) -> Result<(), VulkanError> {
        match keys {
            [key] => self.get(*key).map(drop),
            _ => std::thread::scope(|scope| {
                let threads: Vec<_> = keys.iter().map(|key| scope.spawn(|| self.get(*key).map(drop))).collect();
                // All are waited for, also if one fails.
                let made: Vec<_> = threads.into_iter().filter_map(|thread| thread.join().ok()).collect();
                made.into_iter().collect()
            }),
        }
    }

    /// Whether a pipeline is there.
    pub(crate) fn has(&self, key: Key) -> bool {
        locked(&self.made).get(&key).is_some_and(|made| made.get().is_some())
    }

    /// Whether a form has the subgroups that it demands, as far as the driver reports it of the pipeline, which is made
    /// if it is not there.
    pub(crate) fn fits(&self, key: Key) -> Result<bool, VulkanError> {
        if !key.1.needs_subgroups() {
            return Ok(true);
        }
        let reported = self.reported_of(self.get(key)?.raw);
        Ok(reported.is_none() || reported == self.handle.subgroup_size())
    }

    fn reported_of(&self, pipeline: vk::Pipeline) -> Option<u32> {
        self.pretended.or_else(|| self.handle.reported_subgroup_size(pipeline))
    }

    /// The size of subgroups that the driver reports of a kernel's pipelines, where it reports one.
    pub(crate) fn reported(&self, kernel: Kernel) -> Option<u32> {
        let made = locked(&self.made);
        let asked = made.iter().filter(|((of, form, _), _)| *of == kernel && form.needs_subgroups());
        asked.filter_map(|(_, made)| made.get()?.as_ref().ok()).find_map(|pipeline| self.reported_of(*pipeline))
    }

    /// What the driver says of a kernel as it compiles it, in its own words: registers of an invocation, for one. Empty
    /// where it says nothing.
    pub(crate) fn statistics(&self, kernel: Kernel, form: Form) -> Result<Vec<(String, f64)>, VulkanError> {
        if !self.handle.reports_pipelines() {
            return Ok(Vec::new());
        }
        let (_, layout) = self.layouts(kernel)?;
        let kept = vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR;
        let pipeline = self.create((kernel, form, 0), layout, kept)?;
        let statistics = self.handle.statistics(pipeline);
        // SAFETY: nothing else knows it.
        unsafe { self.handle.device.destroy_pipeline(pipeline, None) };
        Ok(statistics)
    }

    fn layouts(&self, kernel: Kernel) -> Result<(vk::DescriptorSetLayout, vk::PipelineLayout), VulkanError> {
        let mut known = locked(&self.layouts);
        if let Some(layouts) = known.get(&kernel) {
            return Ok(*layouts);
        }
        let bindings: Vec<_> = (0..kernel.binding_count() as u32)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let Handle { device, .. } = &*self.handle;
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the number of bindings was checked against the device's limit.
        let set_layout = unsafe { device.create_descriptor_set_layout(&info, None) }
            .map_err(|result| self.handle.failure("vkCreateDescriptorSetLayout", result))?;
        let sets = [set_layout];
        let constants = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(kernel.push_bytes() as u32)];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&constants);
        // SAFETY: the layout was just made; the size was checked against the device's limit.
        let layout = match unsafe { device.create_pipeline_layout(&info, None) } {
            Ok(layout) => layout,
            Err(result) => {
                // SAFETY: nothing uses it.
                unsafe { device.destroy_descriptor_set_layout(set_layout, None) };
                return Err(self.handle.failure("vkCreatePipelineLayout", result));
            }
        };
        known.insert(kernel, (set_layout, layout));
        Ok((set_layout, layout))
    }

    fn create(
        &self,
        (kernel, form, page_shift): Key,
        layout: vk::PipelineLayout,
        flags: vk::PipelineCreateFlags,
    ) -> Result<vk::Pipeline, VulkanError> {
        let subgroup_size = match form.needs_matrices() {
            true => matrices::SUBGROUP,
            false => self.handle.subgroup_size().unwrap_or_default(),
        };
        let data: [u32; 2] = [page_shift, subgroup_size];
        let entry = |constant_id: u32| vk::SpecializationMapEntry {
            constant_id,
            offset: constant_id * size_of::<u32>() as u32,
            size: size_of::<u32>(),
        };
        let entries = [entry(0), entry(1)];
        let used = if form.needs_subgroups() { &entries[1..] } else { &entries[..1] };
        let specialization = vk::SpecializationInfo::default().map_entries(used).data(bytemuck::bytes_of(&data));
        let mut required =
            vk::PipelineShaderStageRequiredSubgroupSizeCreateInfoEXT::default().required_subgroup_size(subgroup_size);
        let stand_ins = self.stand_ins.as_ref().filter(|_| form.needs_matrices());
        let entry_point = kernel.entry_point(form).to_owned() + if stand_ins.is_some() { "_stand_in" } else { "" };
        let index = match form {
            _ if form.needs_matrices() => stand_ins.unwrap_or(&INDICES[2]),
            Form::Subgroup => &INDICES[1],
            _ => &INDICES[0],
        };
        let module = self.module(&index.excerpt(&entry_point, form.may_fuse()))?;
        // No kernel's name has a zero in it.
        let name = CString::new(entry_point).unwrap_or_default();
        let mut stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(&name);
        if kernel.has_pages() || form.needs_subgroups() {
            stage = stage.specialization_info(&specialization);
        }
        if form.needs_subgroups() || form.needs_matrices() && stand_ins.is_none() {
            let full = vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS_EXT;
            stage = stage.flags(full).push_next(&mut required);
        }
        let info = [vk::ComputePipelineCreateInfo::default().flags(flags).stage(stage).layout(layout)];
        let cache = self.shared_cache();
        // SAFETY: the module has an entry point of this name with these bindings: a test reads it back. The cache may
        // be used by several threads.
        let created = unsafe { self.handle.device.create_compute_pipelines(*cache, &info, None) };
        // SAFETY: pipelines do not need the module that they were created with.
        unsafe { self.handle.device.destroy_shader_module(module, None) };
        match created {
            Ok(pipelines) => Ok(pipelines[0]),
            Err((_, result)) => Err(self.handle.failure("vkCreateComputePipelines", result)),
        }
    }

    fn module(&self, code: &[u32]) -> Result<vk::ShaderModule, VulkanError> {
        let info = vk::ShaderModuleCreateInfo::default().code(code);
        // SAFETY: the whole module was validated when it was made, and a part that nothing else refers to stays valid;
        // the device has the features that it needs.
        unsafe { self.handle.device.create_shader_module(&info, None) }
            .map_err(|result| self.handle.failure("vkCreateShaderModule", result))
    }
}

impl Drop for Pipelines {
    fn drop(&mut self) {
        if self.handle.is_abandoned() {
            return;
        }
        let Handle { device, .. } = &*self.handle;
        // SAFETY: submissions are waited for before the pipelines are dropped; null handles are ignored.
        unsafe {
            for pipeline in locked(&self.made).values().filter_map(|made| made.get()?.as_ref().ok()) {
                device.destroy_pipeline(*pipeline, None);
            }
            for (set_layout, layout) in locked(&self.layouts).values() {
                device.destroy_pipeline_layout(*layout, None);
                device.destroy_descriptor_set_layout(*set_layout, None);
            }
            device.destroy_pipeline_cache(*self.shared_cache(), None);
        }
    }
}
