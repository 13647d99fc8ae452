//! `viewfuse check`: what it prints and what it returns.

use super::{assert_refused, assert_wrong_arguments, done, list_of, run};
use serde_json::Value;
use viewfuse_tests::command::{files_below, toy};
use viewfuse_tests::scenes::Folder;
use viewfuse_vulkan::kernel::Kernel;

viewfuse_tests::trials![every_kernel_and_a_picture_on_the_cpu, json_says_the_same, what_is_not_there_is_refused,];

fn every_kernel_and_a_picture_on_the_cpu() {
    let folder = Folder::new();
    let printed = done(&folder, "check --device cpu --seeds 1");
    for kernel in Kernel::ALL {
        let is_it = |line: &str| line.split_whitespace().next() == Some(kernel.name());
        let row = |line: &&str| is_it(line) && line.trim().ends_with(" ok");
        assert_eq!(printed.lines().filter(row).count(), 1, "{printed}");
        assert!(printed.contains(&format!("  {}: ", kernel.name())), "a reason for {}:\n{printed}", kernel.name());
    }
    assert!(printed.contains("everything within tolerance") && !printed.contains("EXCEEDED"), "{printed}");
    assert!(printed.contains("picture: the synthetic lorry, view 000010 from 10 others at 64x64"), "{printed}");
    assert_eq!(files_below(&folder), [], "it leaves nothing behind");
}

fn json_says_the_same() {
    let folder = toy();
    let printed = done(&folder, "check --seeds 1 --scene toy --device cpu --json");
    let report: Value = serde_json::from_str(&printed).expect("JSON");
    assert_eq!((&report["seed_count"], report["devices"].as_array().map(Vec::len)), (&1.into(), Some(1)));
    let device = &report["devices"][0];
    assert!(device["device"].as_str().is_some_and(|name| name.starts_with("cpu")), "{device}");
    let kernels = list_of(&device["kernels"]);
    let names: Vec<&str> = kernels.iter().filter_map(|kernel| kernel["kernel"].as_str()).collect();
    assert_eq!(names, Kernel::ALL.map(Kernel::name));
    for kernel in kernels {
        let number = |key: &str| kernel[key].as_f64().unwrap_or(f64::NAN);
        assert!(number("compared") > 500.0 && number("undecided") <= 0.02, "{kernel}");
        assert!(number("absolute") <= number("tolerance") && number("of_bound") <= 1.0, "{kernel}");
        // Nothing that rounds agrees with f64 to the last bit, or something was compared with itself.
        let rounds = number("tolerance") > 0.0;
        for key in ["absolute", "relative", "ulps", "of_bound"] {
            assert_eq!(number(key) > 0.0, rounds, "{key}: {kernel}");
        }
        assert!(number("nanoseconds_per_element") > 0.0, "{kernel}");
        assert!(kernel["breach"].is_null() && kernel["versus_cpu"].is_null(), "{kernel}");
        assert!(kernel["reason"].as_str().is_some_and(|reason| reason.len() > 10), "{kernel}");
    }
    let picture = &device["picture"];
    assert_eq!((&picture["scene"], &picture["source_count"]), (&"toy".into(), &12.into()), "{picture}");
    assert!(picture["versus_cpu"].is_null(), "the CPU is not compared with itself: {picture}");
}

fn what_is_not_there_is_refused() {
    let folder = toy();
    assert_wrong_arguments(&folder, "check --device gpu", &["gpu", "cpu"]);
    assert_wrong_arguments(&folder, "check --seeds 0", &["0"]);
    assert_refused(&folder, "check --scene nowhere", &["picture of nowhere", "no such file"]);
    let help = run(&folder, "check --help").stdout;
    assert!(help.contains("Exit code 1 if a tolerance is exceeded or a device fails."), "{help}");
}
