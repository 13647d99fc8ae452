//! Whether a device's subgroups fit the kernels that pass numbers between their invocations ([`Form::Subgroup`]).
//!
//! These kernels rely on full subgroups of one known size. Vulkan promises both only by `VK_EXT_subgroup_size_control`.

use crate::instance::Instance;
use crate::kernel::WORKGROUP;
use ash::vk;

/// Invocations of the smallest subgroup: those that need the same eight rows of a tile.
const MIN_SIZE: u32 = 8;

/// The size of the subgroups that kernels demand on a device with the extension; `None` if there is none that fits.
///
/// A size that fits is a power of two from 8 to the invocations of a workgroup; the device's usual size, if that fits.
pub(crate) fn fitting_size(instance: &Instance, raw: vk::PhysicalDevice) -> Option<u32> {
    let control: vk::PhysicalDeviceSubgroupSizeControlFeaturesEXT<'_> = instance.features(raw);
    let mut usual = vk::PhysicalDeviceSubgroupProperties::default();
    let mut sizes = vk::PhysicalDeviceSubgroupSizeControlPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut usual).push_next(&mut sizes);
    // SAFETY: the device knows the chained structs.
    unsafe { instance.raw.get_physical_device_properties2(raw, &mut properties) };
    let operations =
        vk::SubgroupFeatureFlags::BASIC | vk::SubgroupFeatureFlags::BALLOT | vk::SubgroupFeatureFlags::SHUFFLE;
    let is_able = control.subgroup_size_control == vk::TRUE
        && control.compute_full_subgroups == vk::TRUE
        && usual.supported_operations.contains(operations)
        && usual.supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
        && sizes.required_subgroup_size_stages.contains(vk::ShaderStageFlags::COMPUTE);
    let size = size_within(usual.subgroup_size, sizes.min_subgroup_size, sizes.max_subgroup_size)?;
    (is_able && sizes.max_compute_workgroup_subgroups >= WORKGROUP / size).then_some(size)
}

/// The size nearest to the usual one that a device offers and that fits.
fn size_within(usual: u32, least: u32, most: u32) -> Option<u32> {
    let (least, most) = (least.max(MIN_SIZE), most.min(WORKGROUP));
    // Bounds of a device and ours are powers of two.
    (least <= most).then(|| usual.clamp(least, most)).filter(|size| size.is_power_of_two())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_size_is_taken_where_it_fits() {
        assert_eq!(size_within(32, 32, 32), Some(32));
        assert_eq!(size_within(64, 32, 64), Some(64));
        assert_eq!(size_within(32, 8, 32), Some(32));
        // Subgroups that are larger than a workgroup, where smaller ones are to be had.
        assert_eq!(size_within(128, 32, 128), Some(64));
        assert_eq!(size_within(4, 4, 16), Some(8));
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        assert_eq!(size_within(4, 4, 4), None);
        assert_eq!(size_within(128, 128, 128), None);
        assert_eq!(size_within(0, 0, 0), None);
        assert_eq!(size_within(24, 8, 32), None);
    }
}
