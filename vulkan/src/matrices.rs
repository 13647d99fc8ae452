//! Whether a device's matrix units fit the kernels that multiply by them ([`Form::ROUNDED`]).
//!
//! [`Form::ROUNDED`]: crate::kernel::Form::ROUNDED

use crate::instance::Instance;
use ash::{khr, vk};

/// Rows, inner indices and columns of a matrix.
const SIDE: u32 = 16;
/// Invocations of a subgroup, of which a workgroup has four.
pub(crate) const SUBGROUP: u32 = 32;
const SUBGROUPS: u32 = 4;

/// Whether a device of 1.2 with the extension, which can choose the size of subgroups, has units that fit.
pub(crate) fn fit(instance: &Instance, raw: vk::PhysicalDevice) -> bool {
    let matrices: vk::PhysicalDeviceCooperativeMatrixFeaturesKHR<'_> = instance.features(raw);
    let floats: vk::PhysicalDeviceShaderFloat16Int8Features<'_> = instance.features(raw);
    if matrices.cooperative_matrix != vk::TRUE || floats.shader_float16 != vk::TRUE {
        return false;
    }
    let mut stages = vk::PhysicalDeviceCooperativeMatrixPropertiesKHR::default();
    let mut sizes = vk::PhysicalDeviceSubgroupSizeControlPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut stages).push_next(&mut sizes);
    // SAFETY: the device knows the chained structs.
    unsafe { instance.raw.get_physical_device_properties2(raw, &mut properties) };
    let compute = vk::ShaderStageFlags::COMPUTE;
    let has_size = (sizes.min_subgroup_size..=sizes.max_subgroup_size).contains(&SUBGROUP)
        && sizes.required_subgroup_size_stages.contains(compute)
        && sizes.max_compute_workgroup_subgroups >= SUBGROUPS;
    let functions = khr::cooperative_matrix::Instance::new(&instance.entry, &instance.raw);
    // SAFETY: the device has the extension.
    let kinds = unsafe { functions.get_physical_device_cooperative_matrix_properties(raw) }.unwrap_or_default();
    has_size && stages.cooperative_matrix_supported_stages.contains(compute) && kinds.iter().any(is_wanted)
}

fn is_wanted(kind: &vk::CooperativeMatrixPropertiesKHR<'_>) -> bool {
    let (half, single) = (vk::ComponentTypeKHR::FLOAT16, vk::ComponentTypeKHR::FLOAT32);
    [kind.m_size, kind.n_size, kind.k_size] == [SIDE; 3]
        && [kind.a_type, kind.b_type, kind.c_type, kind.result_type] == [half, half, single, single]
        && kind.scope == vk::ScopeKHR::SUBGROUP
}
