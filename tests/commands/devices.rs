//! `viewfuse devices`, the option `--device`, and `check` of all devices. What is there is asked of the library: on a
//! machine without Vulkan it is the CPU alone.

use super::{assert_refused, assert_wrong_arguments, done, list_of, read_json};
use serde_json::{Value, json};
use viewfuse_tests::command::{files_below, toy};
use viewfuse_tests::devices::vulkan_devices;
use viewfuse_tests::scenes::Folder;
use viewfuse_vulkan::{Adapter, Missing};

viewfuse_tests::trials![
    devices_lists_what_is_there, devices_as_json, devices_that_are_not_there_are_refused, the_device_is_in_the_record,
];

/// Every Vulkan device, or why there is none.
fn adapters() -> (Vec<Adapter>, Option<String>) {
    match vulkan_devices() {
        Ok((_, adapters)) => (adapters, None),
        Err(error) => (Vec::new(), Some(error.to_string())),
    }
}

fn devices_lists_what_is_there() {
    let folder = Folder::new();
    let (adapters, problem) = adapters();
    let printed = done(&folder, "devices");
    let row = |start: &str, name: &str| {
        let is_it = |line: &&str| line.split_whitespace().next() == Some(start) && line.contains(name);
        assert_eq!(printed.lines().filter(is_it).count(), 1, "{start} {name}:\n{printed}");
    };
    row("cpu", "threads");
    for adapter in &adapters {
        row(&format!("vulkan:{}", adapter.index), &adapter.name);
        for missing in &adapter.missing {
            assert!(printed.contains(&missing.to_string()), "{printed}");
        }
    }
    assert!(problem.is_none_or(|problem| printed.contains(&problem)), "{printed}");
    assert_eq!(files_below(&folder), [], "it leaves nothing behind");
}

fn devices_as_json() {
    let (adapters, problem) = adapters();
    let report: Value = serde_json::from_str(&done(Folder::new().path(), "devices --json")).expect("JSON");
    assert!(report["cpu"].as_str().is_some_and(|cpu| cpu.starts_with("cpu (")), "{report}");
    assert_eq!(report["vulkan_problem"], json!(problem));
    let listed = list_of(&report["vulkan"]);
    assert_eq!(listed.len(), adapters.len());
    for (device, adapter) in listed.iter().zip(&adapters) {
        assert_eq!(device["device"], format!("vulkan:{}", adapter.index));
        assert_eq!((&device["name"], &device["driver"]), (&json!(adapter.name), &json!(adapter.driver)));
        assert_eq!(device["missing"], json!(adapter.missing.iter().map(Missing::to_string).collect::<Vec<_>>()));
        assert_eq!(device["buffer_range_bytes"], json!(adapter.limits.buffer_range));
    }
}

fn devices_that_are_not_there_are_refused() {
    let scene = toy();
    let render = |device: &str| format!("render toy --targets 20 --size 16x16 -o out --device {device}");
    for device in ["nonsense", "gpu", "vulkan:", "vulkan0", "cpu:1", "VULKAN"] {
        let parts = [device, "auto, cpu, vulkan, vulkan:NUMBER, vulkan:NAME", "viewfuse devices"];
        assert_wrong_arguments(&scene, &render(device), &parts);
    }
    assert_wrong_arguments(&scene, &format!("{} --time-limit 0", render("cpu")), &["from 0.001 to 86400"]);
    let (adapters, problem) = adapters();
    // A number is an index, also where it stands in a device's name.
    let in_names = adapters.iter().flat_map(|adapter| adapter.name.split(|letter: char| !letter.is_ascii_digit()));
    let is_none = |number: &&str| number.parse().is_ok_and(|number: usize| number >= adapters.len());
    for wanted in in_names.filter(is_none).chain(["99", "'nonsense'", "'v'"]) {
        // Without any, that is what is said.
        let counted: Vec<String> =
            adapters.iter().map(|adapter| format!("{} {}", adapter.index, adapter.name)).collect();
        let are = if counted.len() == 1 { "is" } else { "are" };
        let said = format!("no Vulkan device {wanted}; there {are}: {}", counted.join(", "));
        let device = format!("vulkan:{}", wanted.trim_matches('\''));
        assert_refused(&scene, &render(&device), &[problem.as_deref().unwrap_or(&said)]);
    }
}

fn the_device_is_in_the_record() {
    let scene = toy();
    let (adapters, _) = adapters();
    let usable = adapters.iter().find(|adapter| adapter.missing.is_empty());
    let expected = usable.map(|adapter| (format!("vulkan:{}", adapter.index), format!("vulkan ({})", adapter.name)));
    for (device, name) in [("cpu".to_owned(), "cpu (".to_owned())].into_iter().chain(expected) {
        let arguments = format!("render toy --targets 20 --views 3 --size 16x16 --device {device} -o out");
        let printed = done(&scene, &arguments);
        assert!(printed.lines().any(|line| line.starts_with("device: ") && line.ends_with(", requested")), "{printed}");
        let record = read_json(scene.join("out/run.json"));
        assert!(record["device"].as_str().is_some_and(|device| device.starts_with(&name)), "{record}");
        assert_eq!(record["device_reason"], "requested");
        // Devices that count say what their kernels took.
        let kernels = record["kernels"].as_array().map_or(0, Vec::len);
        assert_eq!(kernels > 0, device != "cpu", "{record}");
    }
}
