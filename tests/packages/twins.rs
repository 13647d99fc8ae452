//! The marks of kernels' rows that no compiler checks: `measured` says that no production code calls a kernel, `twin`
//! that the CPU does not call its body.

use viewfuse_kernels::rows::Kernel;
use viewfuse_kernels::{for_each_kernel, has_mark};
use viewfuse_tests::places::repository;
use viewfuse_tests::source::{Source, files};

macro_rules! marks {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt block $block:tt counts $counts:tt arrays $arrays:tt elements $elements:tt
        marks { $($mark:ident)* }
    })+) => {
        /// Kernels that production code does not call, by their rows.
        fn without_caller(kernel: Kernel) -> bool {
            match kernel {
                $(Kernel::$Kernel => has_mark!(measured: $($mark)*),)+
            }
        }
    };
}

for_each_kernel!(marks);

/// Crates that make pictures: what calls a kernel here calls it for a user. What checks and measures devices does not.
const PRODUCTION: [&str; 7] =
    ["host/weighting", "host/nn", "host/field", "host/evaluate", "host/pose", "host/view", "host/lab"];

fn sources(folders: &[&str]) -> Vec<Source> {
    let paths = folders.iter().flat_map(|folder| files(&repository().join(folder).join("src"), "rs"));
    let is_test = |path: &std::path::Path| {
        path.components().any(|part| part.as_os_str() == "tests" || part.as_os_str() == "tests.rs")
    };
    paths.filter(|path| !is_test(path)).map(|path| Source::read(&path)).collect()
}

/// Whether code calls a method of what is called a device, or that of a layer in a precision.
fn calls(sources: &[Source], method: &str) -> bool {
    let calls = ["device", "device()"].map(|device| ["", "_in"].map(|form| format!("{device}.{method}{form}(")));
    sources.iter().any(|source| {
        let code = source.code.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let code: String = code.split_whitespace().collect();
        calls.iter().flatten().any(|call| code.contains(call))
    })
}

/// Whether the backend dispatches a kernel by itself, for others.
fn dispatches(backend: &[Source], kernel: Kernel) -> bool {
    let call = format!("dispatch(Kernel::{kernel:?},");
    backend.iter().any(|source| source.code.contains(&call))
}

/// What is wrong with the mark of a kernel.
fn fault(sources: &[Source], method: &str, is_marked: bool) -> Option<String> {
    match (calls(sources, method), is_marked) {
        (true, true) => Some(format!("{method} is marked measured, but production code calls it")),
        (false, false) => Some(format!("{method} has no caller in production, and no mark that says so")),
        _ => None,
    }
}

#[test]
fn kernels_without_a_caller_are_marked() {
    let sources = sources(&PRODUCTION);
    let backend = self::sources(&["vulkan"]);
    let others = || Kernel::ALL.into_iter().filter(|kernel| !dispatches(&backend, *kernel));
    let faults: Vec<String> =
        others().filter_map(|kernel| fault(&sources, kernel.name(), without_caller(kernel))).collect();
    assert!(faults.is_empty(), "{faults:#?}");
    assert_eq!(others().count() + 1, Kernel::ALL.len(), "weights in f16");
    // A missing and a wrong mark are found.
    let called = [Source::new("fn a() { self.device\n    .add(x) }\n// device.subtract(x)\nmodel.subtract(y)\n")];
    assert!(fault(&called, "add", false).is_none() && fault(&called, "subtract", true).is_none());
    assert!(fault(&called, "add", true).is_some() && fault(&called, "subtract", false).is_some());
}

/// Whether a body's function is called.
fn calls_body(sources: &[Source], kernel: Kernel) -> bool {
    let call = format!("bodies::{}(", kernel.name());
    sources.iter().any(|source| source.code.contains(&call))
}

/// The loops that are made from the rows name no body of a twin, so that only what is written by hand could call one.
#[test]
fn no_twin_calls_the_body_that_it_is_tested_against() {
    let sources = sources(&["host/device"]);
    let called: Vec<&str> = Kernel::ALL
        .into_iter()
        .filter(|kernel| kernel.has_twin() && calls_body(&sources, *kernel))
        .map(Kernel::name)
        .collect();
    assert!(called.is_empty(), "{called:?}");
    let twins = Kernel::ALL.into_iter().filter(|kernel| kernel.has_twin()).count();
    assert!((1..Kernel::ALL.len()).contains(&twins), "{twins} twins");
    assert!(calls_body(&[Source::new("fn a() { bodies::linear(block) }")], Kernel::Linear));
}
