//! One pipeline per kernel, form and specialisation, created at its first use.

use crate::error::VulkanError;
use crate::excerpt::excerpt;
use crate::handle::Handle;
use crate::kernel::{Form, Kernel};
use crate::matrices;
use ash::vk;
use std::collections::HashMap;
use std::ffi::CString;
use std::sync::Arc;

/// The kernels, as `cargo shaders` compiles them.
pub(crate) const MODULE: &[u8] = include_bytes!("kernels.spv");
/// Those that need operations of subgroups.
pub(crate) const SUBGROUPS: &[u8] = include_bytes!("subgroups.spv");

/// Those that need matrix units.
pub(crate) const MATRICES: &[u8] = include_bytes!("matrices.spv");

/// The pipeline of a kernel.
#[derive(Clone, Copy)]
pub(crate) struct Pipeline {
    pub(crate) raw: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
}

/// All pipelines of a device.
pub(crate) struct Pipelines {
    cache: vk::PipelineCache,
    layouts: HashMap<Kernel, (vk::DescriptorSetLayout, vk::PipelineLayout)>,
    /// The data that the cache began with.
    recalled: Vec<u8>,
    pipelines: HashMap<(Kernel, Form, u32), vk::Pipeline>,
    /// The size of subgroups that the driver reports of a pipeline, where it reports one.
    reported: HashMap<(Kernel, Form, u32), u32>,
    /// What takes the place of the driver's reports.
    pretended: Option<u32>,
    /// What takes the place of the module for matrix units.
    stand_ins: Option<&'static [u8]>,
    handle: Arc<Handle>,
}

impl Pipelines {
    /// `pretended` is a size of subgroups that takes the place of the driver's reports, `stand_ins` a module that takes
    /// the place of that for matrix units.
    pub(crate) fn new(
        handle: &Arc<Handle>,
        pretended: Option<u32>,
        stand_ins: Option<&'static [u8]>,
    ) -> Result<Pipelines, VulkanError> {
        let mut pipelines = Pipelines {
            cache: vk::PipelineCache::null(),
            layouts: HashMap::new(),
            recalled: Vec::new(),
            pipelines: HashMap::new(),
            reported: HashMap::new(),
            pretended,
            stand_ins,
            handle: handle.clone(),
        };
        // SAFETY: an empty cache needs nothing.
        pipelines.cache = unsafe { handle.device.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None) }
            .map_err(|result| handle.failure("vkCreatePipelineCache", result))?;
        Ok(pipelines)
    }

    /// Begins with the data of another process's cache, which is of this device and driver. A driver that does not take
    /// it goes on without.
    pub(crate) fn recall(&mut self, data: &[u8]) {
        if let Some(cache) = self.cache_of(data) {
            // SAFETY: pipelines do not need the cache that they were created with.
            unsafe { self.handle.device.destroy_pipeline_cache(self.cache, None) };
            self.cache = cache;
            self.recalled = data.to_vec();
        }
    }

    /// A cache with the data of another process's, which is of this device and driver.
    fn cache_of(&self, data: &[u8]) -> Option<vk::PipelineCache> {
        let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
        // SAFETY: the data has the header that the specification demands, of this device.
        unsafe { self.handle.device.create_pipeline_cache(&info, None) }.ok()
    }

    /// Whether the cache's data is other than the data that it began with.
    pub(crate) fn has_new(&self) -> bool {
        !self.pipelines.is_empty() && self.cached() != self.recalled
    }

    /// The cache's data.
    pub(crate) fn cached(&self) -> Vec<u8> {
        // SAFETY: the cache is the device's.
        unsafe { self.handle.device.get_pipeline_cache_data(self.cache) }.unwrap_or_default()
    }

    /// Adds what another process's cache has, unless the cache began with that. A driver that does not take it goes on
    /// without.
    pub(crate) fn merge(&mut self, data: &[u8]) {
        if data.is_empty() || data == self.recalled {
            return;
        }
        let Some(cache) = self.cache_of(data) else { return };
        let Handle { device, .. } = &*self.handle;
        // SAFETY: two different caches of the device; nobody else uses this one, and all access to the other is
        // exclusive.
        unsafe {
            let _ = device.merge_pipeline_caches(self.cache, &[cache]);
            device.destroy_pipeline_cache(cache, None);
        }
    }

    /// The pipeline of a kernel for pages of `2^page_shift` elements; 0 leaves the choice of pages out.
    pub(crate) fn get(&mut self, kernel: Kernel, form: Form, page_shift: u32) -> Result<Pipeline, VulkanError> {
        let (set_layout, layout) = self.layouts(kernel)?;
        self.prepare(kernel, &[form], page_shift)?;
        Ok(Pipeline { raw: self.pipelines[&(kernel, form, page_shift)], layout, set_layout })
    }

    /// Makes the pipelines of some forms of a kernel that are not there, side by side: a driver takes up to seconds for
    /// each.
    pub(crate) fn prepare(&mut self, kernel: Kernel, forms: &[Form], page_shift: u32) -> Result<(), VulkanError> {
        let (_, layout) = self.layouts(kernel)?;
        let is_missing = |form: &&Form| !self.pipelines.contains_key(&(kernel, **form, page_shift));
        let missing: Vec<Form> = forms.iter().filter(is_missing).copied().collect();
        let this = &*self;
        let create = |form: Form| (form, this.create(kernel, form, layout, page_shift));
        let created: Vec<_> = match missing[..] {
            [form] => vec![create(form)],
            _ => std::thread::scope(|scope| {
                let threads: Vec<_> = missing.iter().map(|form| scope.spawn(move || create(*form))).collect();
                threads.into_iter().filter_map(|thread| thread.join().ok()).collect()
            }),
        };
        // Of several that were made none is lost, also if one fails.
        let mut outcome = Ok(());
        for (form, pipeline) in created {
            match pipeline {
                Ok(pipeline) => self.keep(kernel, form, page_shift, pipeline),
                Err(error) => outcome = Err(error),
            }
        }
        outcome
    }

    fn keep(&mut self, kernel: Kernel, form: Form, page_shift: u32, pipeline: vk::Pipeline) {
        self.pipelines.insert((kernel, form, page_shift), pipeline);
        if form.needs_subgroups()
            && let Some(size) = self.pretended.or_else(|| self.handle.reported_subgroup_size(pipeline))
        {
            self.reported.insert((kernel, form, page_shift), size);
        }
    }

    /// Whether a form has the subgroups that it demands, as far as the driver reports it of the pipeline, which is made
    /// if it is not there.
    pub(crate) fn fits(&mut self, kernel: Kernel, form: Form, page_shift: u32) -> Result<bool, VulkanError> {
        if !form.needs_subgroups() {
            return Ok(true);
        }
        self.get(kernel, form, page_shift)?;
        let reported = self.reported.get(&(kernel, form, page_shift)).copied();
        Ok(reported.is_none() || reported == self.handle.subgroup_size())
    }

    /// The size of subgroups that the driver reports of a kernel's pipelines, where it reports one.
    pub(crate) fn reported(&self, kernel: Kernel) -> Option<u32> {
        self.reported.iter().find(|((reported, ..), _)| *reported == kernel).map(|(_, size)| *size)
    }

    fn layouts(&mut self, kernel: Kernel) -> Result<(vk::DescriptorSetLayout, vk::PipelineLayout), VulkanError> {
        if let Some(layouts) = self.layouts.get(&kernel) {
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
        self.layouts.insert(kernel, (set_layout, layout));
        Ok((set_layout, layout))
    }

    fn create(
        &self,
        kernel: Kernel,
        form: Form,
        layout: vk::PipelineLayout,
        page_shift: u32,
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
        let stand_ins = self.stand_ins.filter(|_| form.needs_matrices());
        let entry_point = kernel.entry_point(form).to_owned() + if stand_ins.is_some() { "_stand_in" } else { "" };
        let bytes = match form {
            _ if form.needs_matrices() => stand_ins.unwrap_or(MATRICES),
            Form::Subgroup => SUBGROUPS,
            _ => MODULE,
        };
        let module = self.module(bytes, &entry_point)?;
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
        let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
        // SAFETY: the module has an entry point of this name with these bindings: a test reads it back. The cache may
        // be used by several threads.
        let created = unsafe { self.handle.device.create_compute_pipelines(self.cache, &info, None) };
        // SAFETY: pipelines do not need the module that they were created with.
        unsafe { self.handle.device.destroy_shader_module(module, None) };
        match created {
            Ok(pipelines) => Ok(pipelines[0]),
            Err((_, result)) => Err(self.handle.failure("vkCreateComputePipelines", result)),
        }
    }

    /// A module of this entry point alone.
    fn module(&self, bytes: &[u8], entry_point: &str) -> Result<vk::ShaderModule, VulkanError> {
        let code: Vec<u32> = bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        let code = excerpt(&code, entry_point);
        let info = vk::ShaderModuleCreateInfo::default().code(&code);
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
            self.pipelines.values().for_each(|pipeline| device.destroy_pipeline(*pipeline, None));
            for (set_layout, layout) in self.layouts.values() {
                device.destroy_pipeline_layout(*layout, None);
                device.destroy_descriptor_set_layout(*set_layout, None);
            }
            device.destroy_pipeline_cache(self.cache, None);
        }
    }
}
