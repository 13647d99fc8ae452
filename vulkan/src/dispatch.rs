//! Dispatches of kernels: arguments checked, split to fit the device, in the fastest form of their tiles.

use crate::buffer::{self, Array, Bound, ranges};
use crate::commands::Commands;
use crate::error::VulkanError;
use crate::forms::Class;
use crate::gpu::{Gpu, State, WIDEST_PAGED, barrier};
use crate::kernel::{Access, Form, Kernel, Layout, Piece};
use crate::pipelines::Pipeline;
use ash::vk;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;
use viewfuse_kernels::pages::MAX_PAGES;

/// The time that a dispatch of an unknown kernel is expected to take.
const UNKNOWN: Duration = Duration::from_millis(20);

/// The most bindings of a kernel, and bytes of push constants: the latter are those that every device has.
const MAX_BINDINGS: usize = 24;
const MAX_CONSTANTS: usize = 128;
const _: () = {
    let mut index = 0;
    while index < Kernel::ALL.len() {
        let kernel = Kernel::ALL[index];
        assert!(kernel.binding_count() <= MAX_BINDINGS && kernel.push_bytes() <= MAX_CONSTANTS);
        index += 1;
    }
};

/// Whether forms that read fours of numbers can take the place of the others: all that the kernel uses lies in whole
/// fours. What is beyond an array's end they take from its last four, others from its last number.
pub(crate) fn lies_in_fours(kernel: Kernel, parameters: &[u8], arrays: &[Bound<'_>]) -> bool {
    let has = |(bound, used): (&Bound<'_>, u64)| {
        let fours = bound.0.len * bound.0.stride / size_of::<[f32; 4]>();
        4 * fours as u64 >= used
    };
    kernel.used_in_fours(parameters).is_some_and(|used| arrays.iter().zip(used).all(has))
}

/// A dispatch whose arguments are right.
pub(crate) struct DispatchJob<'a> {
    pub(crate) kernel: Kernel,
    parameters: &'a [u8],
    arrays: &'a [Bound<'a>],
    pub(crate) page_shift: u32,
}

impl<'a> DispatchJob<'a> {
    /// The arrays that it writes.
    pub(crate) fn outputs(&self) -> Vec<&'a Arc<Array>> {
        let listed = self.kernel.arrays().iter().zip(self.arrays);
        listed.filter(|(array, _)| array.access == Access::Write).map(|(_, bound)| bound.0).collect()
    }
}

impl Gpu {
    /// Dispatches a kernel for some of its elements. `parameters` are the kernel's own push constants, `arrays` its
    /// bindings, both as in its row. Elements of a tiled kernel are counted in [`Form::Single`], and are all of them:
    /// the device takes the form that was the fastest when it was measured, at the first use of such a size.
    /// No elements are no work: nothing else is looked at then.
    ///
    /// # Errors
    /// [`VulkanError::Arguments`] if they are not, [`VulkanError::OtherDevice`], [`VulkanError::Limit`] if an array
    /// cannot be bound, and others if the device fails, or failed before.
    pub fn dispatch(
        &self,
        kernel: Kernel,
        parameters: &[u8],
        elements: Range<u32>,
        arrays: &[Bound<'_>],
    ) -> Result<(), VulkanError> {
        self.dispatch_in(kernel, None, parameters, elements, arrays)
    }

    /// Dispatches a tiled kernel in a form, or in the one that is chosen for it.
    pub(crate) fn dispatch_in(
        &self,
        kernel: Kernel,
        form: Option<Form>,
        parameters: &[u8],
        elements: Range<u32>,
        arrays: &[Bound<'_>],
    ) -> Result<(), VulkanError> {
        if elements.is_empty() {
            return Ok(());
        }
        self.check_arguments(kernel, parameters, arrays)?;
        let page_len = 1_usize << self.page_shift;
        let needs_pages = kernel
            .arrays()
            .iter()
            .zip(arrays)
            .any(|(array, bound)| array.layout == Layout::Pages && bound.0.len > page_len);
        let page_shift = if needs_pages { self.page_shift } else { 0 };
        let is_in_fours = lies_in_fours(kernel, parameters, arrays);
        let job = DispatchJob { kernel, parameters, arrays, page_shift };
        // A form that is fixed for all is used of arrays in fours, too.
        if !is_in_fours || !form.or(self.form).is_some_and(Form::has_f16_weights) {
            return self.dispatch_job(&job, form, is_in_fours, elements);
        }
        let arrays = self.with_weights_in_f16(kernel, arrays)?;
        let arrays: Vec<Bound<'_>> = arrays.iter().map(Bound).collect();
        self.dispatch_job(&DispatchJob { arrays: &arrays, ..job }, form, is_in_fours, elements)
    }

    /// Dispatches a job whose arrays are as the form needs them.
    fn dispatch_job(
        &self,
        job: &DispatchJob<'_>,
        form: Option<Form>,
        is_in_fours: bool,
        elements: Range<u32>,
    ) -> Result<(), VulkanError> {
        let DispatchJob { kernel, parameters, .. } = *job;
        self.with_state(|gpu, state| {
            let (form, of_form) = match kernel.shape(parameters) {
                Some(shape) => {
                    let form = match form {
                        Some(form) => form,
                        None => gpu.form(state, job, &Class::new(kernel, shape, is_in_fours))?,
                    };
                    (form, 0..form.elements(shape.row_count, shape.column_count))
                }
                None => {
                    let of = |elements: u32| elements.checked_mul(kernel.invocations());
                    let (Some(start), Some(end)) = (of(elements.start), of(elements.end)) else {
                        let detail = format!("elements {elements:?} of {} invocations each", kernel.invocations());
                        return Err(VulkanError::Arguments(kernel.name(), detail));
                    };
                    (Form::Single, start..end)
                }
            };
            let count = u64::from(elements.end - elements.start);
            let dispatches = gpu.record_in_pieces(state, job, form, of_form, count)?;
            let tally = &mut state.tallies[kernel as usize];
            tally.dispatches += dispatches;
            tally.elements += count;
            Ok(())
        })
    }

    /// Records a dispatch, in as many pieces as the device's limits demand, and returns how many these are. `counted`
    /// elements are counted for the time that later ones are expected to take.
    pub(crate) fn record_job(
        &self,
        state: &mut State,
        job: &DispatchJob<'_>,
        form: Form,
        elements: Range<u32>,
        counted: u64,
    ) -> Result<u64, VulkanError> {
        let DispatchJob { kernel, parameters, arrays, page_shift } = *job;
        let elements = self.faults.done(form, elements);
        let listed = kernel.arrays().iter().zip(arrays);
        let mut constants = [0; MAX_CONSTANTS];
        let constants = &mut constants[..kernel.push_bytes()];
        constants[..parameters.len()].copy_from_slice(parameters);
        let uses: Vec<_> = listed.clone().map(|(array, bound)| (bound.0, array.access)).collect();
        let key = (kernel, form, page_shift);
        let pipeline = match state.used.get(&key) {
            Some(pipeline) => *pipeline,
            None => *state.used.entry(key).or_insert(self.pipelines.get(key)?),
        };
        let per_piece = self.handle.limits.workgroup_count.saturating_mul(form.invocations());
        let expected = state.rates[kernel as usize].time_of(counted).unwrap_or(UNKNOWN);
        let mut dispatches = 0;
        self.record_dispatch(state, &uses, |device, open, submissions| {
            let set = self.bind(open, &pipeline, listed, page_shift)?;
            submissions.start_clock(open);
            // SAFETY: pipeline, set and constants are of the kernel's layout; the counts are within the limits.
            unsafe {
                let (commands, compute) = (open.raw, vk::PipelineBindPoint::COMPUTE);
                device.cmd_bind_pipeline(commands, compute, pipeline.raw);
                device.cmd_bind_descriptor_sets(commands, compute, pipeline.layout, 0, &[set], &[]);
                for first in elements.clone().step_by(per_piece as usize) {
                    let piece = Piece { first, count: per_piece.min(elements.end - first) };
                    constants[parameters.len()..].copy_from_slice(bytemuck::bytes_of(&piece));
                    let stage = vk::ShaderStageFlags::COMPUTE;
                    // Pieces write different elements, but the validation layers only see whole arrays. Pieces are
                    // large, so a barrier between them costs nothing.
                    if dispatches > 0 && self.barriers {
                        barrier(device, commands);
                    }
                    device.cmd_push_constants(commands, pipeline.layout, stage, 0, constants);
                    device.cmd_dispatch(commands, piece.count.div_ceil(form.invocations()), 1, 1);
                    dispatches += 1;
                }
            }
            submissions.stop_clock(open, kernel, counted, expected);
            Ok(())
        })?;
        Ok(dispatches)
    }

    fn bind<'a>(
        &self,
        commands: &Commands,
        pipeline: &Pipeline,
        arrays: impl Iterator<Item = (&'a crate::kernel::Array, &'a Bound<'a>)>,
        page_shift: u32,
    ) -> Result<vk::DescriptorSet, VulkanError> {
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(commands.descriptors).set_layouts(&layouts);
        // SAFETY: the pool has room for a largest set of each of the commands' dispatches, and is reset with them.
        let set = unsafe { self.handle.device.allocate_descriptor_sets(&info) }
            .map_err(|result| self.handle.failure("vkAllocateDescriptorSets", result))?[0];
        let mut infos = [[vk::DescriptorBufferInfo::default()]; MAX_BINDINGS];
        let all = arrays.flat_map(|(array, bound)| ranges(bound.0, array.layout, page_shift));
        let mut count = 0;
        for (info, buffer::Range { buffer, offset, bytes }) in infos.iter_mut().zip(all) {
            *info = [vk::DescriptorBufferInfo { buffer, offset, range: bytes }];
            count += 1;
        }
        let mut writes = [vk::WriteDescriptorSet::default(); MAX_BINDINGS];
        for ((binding, info), write) in (0..).zip(&infos[..count]).zip(&mut writes) {
            *write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .buffer_info(info);
        }
        // SAFETY: the ranges lie in their buffers, which the commands hold.
        unsafe { self.handle.device.update_descriptor_sets(&writes[..count], &[]) };
        Ok(set)
    }

    fn check_arguments(&self, kernel: Kernel, parameters: &[u8], arrays: &[Bound<'_>]) -> Result<(), VulkanError> {
        let refuse = |detail| Err(VulkanError::Arguments(kernel.name(), detail));
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
                Layout::Pages if len > MAX_PAGES << self.page_shift => {
                    let page_len = len.div_ceil(MAX_PAGES).next_power_of_two() as u64;
                    return limit(page_limit, page_len * WIDEST_PAGED, most_page_bytes);
                }
                _ => {}
            }
        }
        Ok(())
    }
}
