//! No loader, no driver, no such device: the error says what, the automatic choice goes to the CPU and says why, and a
//! command that failed leaves nothing behind.

use crate::BINARY;
use libtest_mimic::Failed;
use std::path::PathBuf;
use std::process::Command;
use viewfuse_tests::command::{self, Outcome, assert_command_refused, names_in, toy};
use viewfuse_vulkan::{Instance, InstanceOptions, VulkanError};

viewfuse_tests::trials![
    a_missing_loader_is_named, a_file_that_is_no_loader_is_named, without_a_loader_commands_say_so,
    without_a_driver_commands_say_so, automatic_without_a_driver_is_the_cpu,
];

const NO_LOADER: &str = "/nonexistent/libvulkan.so.1";
const NO_DRIVER: &str = "/nonexistent/icd.json";
const RENDER: &str = "render toy --targets 20 --views 4 --size 16x16 -o out";

fn load(loader: &str) -> Option<VulkanError> {
    Instance::load(&InstanceOptions { loader: Some(PathBuf::from(loader)), validation: false }).err()
}

fn a_missing_loader_is_named() -> Result<(), Failed> {
    match load(NO_LOADER) {
        Some(VulkanError::NoLoader(detail)) if detail.contains(NO_LOADER) => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// A library that can be loaded has no Vulkan in it, and a text cannot even be loaded.
fn a_file_that_is_no_loader_is_named() -> Result<(), Failed> {
    let text = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    for file in [text, "libc.so.6"] {
        match load(file) {
            Some(VulkanError::NoLoader(detail)) if file != text || detail.contains(text) => {}
            other => return Err(format!("{file}: {other:?}").into()),
        }
    }
    Ok(())
}

/// The command in a folder with the sample scene, where Vulkan has this loader or these drivers only.
fn with(variable: &str, value: &str, arguments: &str, folder: &std::path::Path) -> Command {
    let mut command = command::command(BINARY, folder, arguments);
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_ADD_DRIVER_FILES", "VIEWFUSE_VULKAN_LOADER"] {
        command.env_remove(name);
    }
    command.env(variable, value);
    command
}

fn without_a_loader_commands_say_so() -> Result<(), Failed> {
    let scene = toy();
    let with = |arguments: &str| with("VIEWFUSE_VULKAN_LOADER", NO_LOADER, arguments, scene.path());
    for command in [format!("{RENDER} --device vulkan"), "check --seeds 1 --device vulkan:0".to_owned()] {
        assert_command_refused(with(&command), scene.path(), &["no Vulkan loader", NO_LOADER, "libvulkan1"]);
    }
    let listed = Outcome::of(with("devices"));
    assert_eq!((listed.code, listed.stderr.as_str()), (Some(0), ""));
    assert!(listed.stdout.contains("cpu") && listed.stdout.contains(NO_LOADER), "{}", listed.stdout);
    Ok(())
}

fn without_a_driver_commands_say_so() -> Result<(), Failed> {
    let scene = toy();
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        let with = |arguments: &str| with(variable, NO_DRIVER, arguments, scene.path());
        let parts = ["no Vulkan device", NO_DRIVER, variable];
        assert_command_refused(with(&format!("{RENDER} --device vulkan")), scene.path(), &parts);
        assert_command_refused(with("check --seeds 1 --device vulkan:0"), scene.path(), &parts);
        let listed = Outcome::of(with("devices --json"));
        let json: serde_json::Value = serde_json::from_str(&listed.stdout)?;
        assert_eq!(json["vulkan"], serde_json::json!([]));
        assert!(json["vulkan_problem"].as_str().is_some_and(|problem| problem.contains(NO_DRIVER)), "{json}");
    }
    Ok(())
}

fn automatic_without_a_driver_is_the_cpu() -> Result<(), Failed> {
    for (variable, value) in [("VK_DRIVER_FILES", NO_DRIVER), ("VIEWFUSE_VULKAN_LOADER", NO_LOADER)] {
        let scene = toy();
        let outcome = Outcome::of(with(variable, value, &format!("{RENDER} --device auto"), scene.path()));
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
        let device = outcome.stdout.lines().find_map(|line| line.strip_prefix("device: ")).unwrap_or_default();
        let (name, reason) = device.split_once(", ").unwrap_or_default();
        let says_why = reason.starts_with("because there is no Vulkan") && reason.contains(value);
        assert!(name.starts_with("cpu (") && says_why, "{}", outcome.stdout);
        let output = scene.path().join("out");
        assert_eq!(names_in(&output), ["000020.png", "000020_depth.png", "000020_sheet.png", "run.json"]);
        let record: serde_json::Value = serde_json::from_slice(&std::fs::read(output.join("run.json"))?)?;
        assert!(record["device"].as_str().is_some_and(|device| device.starts_with("cpu")), "{record}");
        assert_eq!(record["device_reason"], reason);
    }
    Ok(())
}
