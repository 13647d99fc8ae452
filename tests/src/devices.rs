//! The Vulkan devices of the machine that tests run on.

use crate::places::repository;
use std::env;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};
use viewfuse::vulkan::{Adapter, Instance, InstanceOptions, VulkanError};

/// All of them, with the loader and the validation layers that the environment asks for (`VIEWFUSE_VULKAN_LOADER`,
/// `VIEWFUSE_VALIDATION=1`), as the command does it.
///
/// # Errors
/// [`VulkanError`] without a loader, a driver or a device.
pub fn vulkan_devices() -> Result<(Arc<Instance>, Vec<Adapter>), VulkanError> {
    viewfuse::device::choice::vulkan_devices(&InstanceOptions {
        loader: env::var_os("VIEWFUSE_VULKAN_LOADER").map(PathBuf::from),
        validation: env::var_os("VIEWFUSE_VALIDATION").is_some_and(|value| value == "1"),
    })
}

/// What stands in for matrix units (`GpuOptions::stand_ins`).
///
/// # Panics
/// If the module is not there.
pub fn stand_ins() -> &'static [u8] {
    static MODULE: LazyLock<Vec<u8>> =
        LazyLock::new(|| std::fs::read(repository().join("vulkan/src/stand_ins.spv")).expect("the module"));
    &MODULE
}

/// The same as a driver that compiles linear layers wrongly: in tiles of the next smaller size than are asked for, and
/// in the largest where the smallest are.
///
/// # Panics
/// If the module is none.
pub fn exchanged_stand_ins() -> &'static [u8] {
    static EXCHANGED: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let mut module = rspirv::dr::load_bytes(stand_ins()).expect("SPIR-V");
        for entry in &mut module.entry_points {
            let renamed = match entry.operands[2].unwrap_literal_string() {
                "linear::half_small_stand_in" => "linear::half_stand_in",
                "linear::half_tiny_stand_in" => "linear::half_small_stand_in",
                "linear::half_stand_in" => "linear::half_tiny_stand_in",
                "linear::two_halves_small_stand_in" => "linear::two_halves_stand_in",
                "linear::two_halves_tiny_stand_in" => "linear::two_halves_small_stand_in",
                "linear::two_halves_stand_in" => "linear::two_halves_tiny_stand_in",
                other => other,
            };
            entry.operands[2] = rspirv::dr::Operand::LiteralString(renamed.to_owned());
        }
        rspirv::binary::Assemble::assemble(&module).iter().flat_map(|word| word.to_le_bytes()).collect()
    });
    &EXCHANGED
}

/// Whether what stands in for matrix units is tested on this device: on SwiftShader the first of these pipelines had
/// not finished after 200 s.
pub fn takes_stand_ins(adapter: &Adapter) -> bool {
    adapter.name.starts_with("llvmpipe") || adapter.has_matrices
}
