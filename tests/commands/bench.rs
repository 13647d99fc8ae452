//! `viewfuse bench`: what it prints and what it returns.

use super::{assert_wrong_arguments, done, list_of};
use serde_json::Value;
use viewfuse_tests::command::files_below;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![the_cpu_beside_its_limits,];

fn the_cpu_beside_its_limits() {
    let folder = Folder::new();
    let printed = done(&folder, "bench --device cpu --rounds 1 --json");
    let bench: Value = serde_json::from_str(&printed).expect("JSON");
    let device = &bench["devices"][0];
    assert!(device["device"].as_str().is_some_and(|name| name.starts_with("cpu")), "{device}");
    let number = |record: &Value, key: &str| record[key].as_f64().unwrap_or(f64::NAN);
    for key in ["copy_giga_bytes", "multiply_add_giga_operations", "giga_look_ups"] {
        assert!(number(device, key) > 0.0, "{key}: {device}");
    }
    assert_eq!(device["matrix_unit_giga_operations"], Value::Null, "a processor's");
    let kernels = list_of(&device["kernels"]);
    for name in ["census_cost", "compare_views", "composite", "convolve", "gather_latents", "linear", "matrix_product"]
    {
        assert!(kernels.iter().any(|kernel| kernel["kernel"] == name), "{name}: {printed}");
    }
    for kernel in kernels {
        let (share, time) = (number(kernel, "share"), number(kernel, "milliseconds"));
        let rate = match kernel["limit"].as_str() {
            Some("copy") => number(kernel, "giga_bytes"),
            Some("multiply_add") => number(kernel, "giga_operations"),
            Some("look_up") => number(kernel, "giga_look_ups"),
            other => panic!("the limit {other:?}"),
        };
        // How large they are depends on what else the machine does.
        for figure in [share, time, rate] {
            assert!(figure > 0.0 && figure.is_finite(), "{kernel}");
        }
    }
    assert_eq!(files_below(&folder), [], "it leaves nothing behind");
    let table = done(&folder, "bench --device cpu --rounds 1");
    assert!(table.contains("GB/s, multiplies and adds") && table.contains("share of it"), "{table}");
    assert_wrong_arguments(&folder, "bench --rounds 0", &["0"]);
    assert_wrong_arguments(&folder, "bench --device gpu", &["gpu", "cpu"]);
}
