//! The mark `twin` of a kernel's row: a kernel with the mark has a form of its own on the CPU, which does not call the
//! body; the form of a kernel without the mark calls it.

use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::Kernel;
use viewfuse_tests::places::repository;
use viewfuse_tests::source::{Source, files};

macro_rules! bodies {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt block $block:tt counts $counts:tt arrays $arrays:tt elements $elements:tt marks $marks:tt
        body { $first:ident $(:: $body:ident)* }
    })+) => {
        /// Each kernel with the last name of its body's path.
        fn bodies() -> Vec<(Kernel, &'static str)> {
            vec![$((Kernel::$Kernel, [stringify!($first) $(, stringify!($body))*].last().expect("a name"))),+]
        }
    };
}

for_each_kernel!(bodies);

/// Whether code uses a name. Where a function of that name is declared does not count.
fn uses(code: &str, name: &str) -> bool {
    let is_part = |character: char| character.is_alphanumeric() || character == '_';
    code.match_indices(name).any(|(place, _)| {
        let (before, after) = (&code[..place], &code[place + name.len()..]);
        !before.ends_with(is_part) && !after.starts_with(is_part) && !before.ends_with("fn ")
    })
}

/// The form of this name: its function, from the name to the brace that ends it.
fn form<'a>(sources: &'a [Source], name: &str) -> Option<&'a str> {
    let head = format!("\npub(super) fn {name}(");
    sources
        .iter()
        .find_map(|source| source.code.split(&head).nth(1))
        .map(|rest| rest.split("\n}\n").next().unwrap_or(rest))
}

/// What is wrong with the mark of a kernel.
fn fault(sources: &[Source], name: &str, body: &str, has_twin: bool) -> Option<String> {
    let Some(form) = form(sources, name) else { return Some(format!("{name} has no form on the CPU")) };
    // What a form calls may call the body: no file may name the body of a kernel with a twin.
    let of_twin = has_twin.then(|| sources.iter().any(|source| uses(&source.code, body)));
    match of_twin {
        Some(true) => Some(format!("{name} is marked twin, but {body} is called")),
        None if !uses(form, body) => Some(format!("{name} is not marked twin, but does not call {body}")),
        _ => None,
    }
}

#[test]
fn forms_of_the_cpu_are_as_their_rows_say() {
    let folder = repository().join("host/device/src/cpu");
    let sources: Vec<Source> = files(&folder, "rs").iter().map(|path| Source::read(path)).collect();
    let faults: Vec<String> = bodies()
        .into_iter()
        .filter_map(|(kernel, body)| fault(&sources, kernel.name(), body, kernel.has_twin()))
        .collect();
    assert!(faults.is_empty(), "{faults:#?}");
    let twins = Kernel::ALL.into_iter().filter(|kernel| kernel.has_twin()).count();
    assert!((1..Kernel::ALL.len()).contains(&twins), "{twins} twins");
}

#[test]
fn a_wrong_mark_is_found() {
    let source = |body: &str| {
        let text = format!(
            "use x::y;\n\npub(super) fn add(block: &Block) {{\n    {body}\n}}\n\nfn other() {{ subtract() }}\n"
        );
        [Source::new(&text)]
    };
    for (body, has_twin, is_right) in [
        ("added(block)", false, true),
        ("core::added::<4>(block)", false, true),
        ("// added(block)", false, false),
        ("added_fast(block)", false, false),
        ("\"added\";", false, false),
        ("added_fast(block)", true, true),
        ("map(added)", true, false),
    ] {
        let fault = fault(&source(body), "add", "added", has_twin);
        assert_eq!(fault.is_none(), is_right, "{body}: {fault:?}");
    }
    // A form of its body's name, the body of a twin in another function, and no form.
    assert!(fault(&source("core::add(block)"), "add", "add", false).is_none());
    assert!(fault(&source("self.0"), "add", "add", false).is_some());
    assert!(fault(&source(""), "add", "subtract", true).is_some());
    assert!(fault(&source(""), "subtract", "subtracted", true).is_some());
}
