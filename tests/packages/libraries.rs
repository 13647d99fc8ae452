//! What a library leaves to whoever calls it: printing, ending the process, environment variables, and the names of the
//! command's options.

use std::path::Path;
use viewfuse_tests::places::repository;
use viewfuse_tests::source::{Source, files};

/// What no library has in its code.
const NOT_IN_CODE: [&str; 7] = ["println!", "eprintln!", "print!", "eprint!", "dbg!", "process::exit", "env::"];

/// Where something of it remains: the end of the file's path, what, and why.
const ALLOWED: [(&str, &str, &str); 1] = [(
    "vulkan/src/instance.rs",
    "env::",
    "Vulkan's own loader reads VK_DRIVER_FILES; the error of a driver that is not found says what it was told",
)];

/// Where programs begin: only the command and the laboratory's print, among what is installed.
const PROGRAMS: [&str; 4] = ["host/cli/", "host/lab/src/command", "host/pose/openmvg/", "vulkan/compiler/"];

/// What a file has that a library must not have, with its line.
fn faults(path: &str, source: &Source) -> Vec<String> {
    let mut faults = Vec::new();
    for (line, code) in source.lines() {
        for found in NOT_IN_CODE.into_iter().filter(|found| has_word(code, found)) {
            if !ALLOWED.iter().any(|(end, what, _)| path.ends_with(end) && *what == found) {
                faults.push(format!("{path}:{line}: {found}"));
            }
        }
    }
    for (line, text) in &source.strings {
        // An option of the command, by name.
        let is_option = |(place, _): (usize, &str)| {
            let before = text[..place].chars().next_back();
            let after = text[place + 2..].chars().next();
            after.is_some_and(|after| after.is_ascii_lowercase())
                && before.is_none_or(|before| !before.is_alphanumeric() && before != '-')
        };
        if text.match_indices("--").any(is_option) {
            faults.push(format!("{path}:{line}: the option in {text:?}"));
        }
    }
    faults
}

/// Whether it stands in the code, and not as the end of a longer word.
fn has_word(code: &str, word: &str) -> bool {
    let is_start = |(place, _): (usize, &str)| {
        code[..place].chars().next_back().is_none_or(|before| !before.is_alphanumeric() && before != '_')
    };
    code.match_indices(word).any(is_start)
}

/// The sources of all libraries: everything but programs.
fn sources() -> Vec<(String, Source)> {
    let root = repository();
    let is_library = |path: &Path| {
        let path = path.strip_prefix(&root).expect("inside").to_string_lossy().into_owned();
        let is_source = path.contains("/src/");
        let is_program = PROGRAMS.iter().any(|folder| path.starts_with(folder));
        (is_source && !is_program).then_some(path)
    };
    ["core", "vulkan", "host"]
        .iter()
        .flat_map(|folder| files(&root.join(folder), "rs"))
        .filter_map(|path| Some((is_library(&path)?, Source::read(&path))))
        .collect()
}

#[test]
fn libraries_leave_the_terminal_to_the_command() {
    let sources = sources();
    assert!(sources.len() > 200, "{} files", sources.len());
    let found: Vec<String> = sources.iter().flat_map(|(path, source)| faults(path, source)).collect();
    assert!(found.is_empty(), "{found:#?}");
    for (end, what, reason) in ALLOWED {
        let is_used = |(path, source): &(String, Source)| path.ends_with(end) && has_word(&source.code, what);
        assert!(sources.iter().any(is_used), "{end} has no {what} any more: {reason}");
    }
    let count = |text: &str| faults("host/x/src/a.rs", &Source::new(text)).len();
    let faulty = ["fn a() { std::eprintln!() }", "fn a() { std::env::var(\"X\"); }", "const A: &str = \"use --size\";"];
    assert_eq!(faulty.map(count), [1; 3]);
    assert_eq!(count("// println!() and --size\nfn a() { sprintln!(); my_env::x(\"a -- b, --- and --\") }"), 0);
}

/// The only file of the command that names standard output or standard error: it escapes what it prints.
const WAY_OUT: &str = "host/cli/src/cli/printing.rs";
/// What reaches the terminal past it.
const PAST_IT: [&str; 7] = ["stdout(", "stderr(", "println!", "eprintln!", "print!", "eprint!", "dbg!"];

#[test]
fn the_command_has_one_way_out_to_the_terminal() {
    let root = repository();
    let folders = ["host/cli/src", "host/lab/src"].map(|folder| files(&root.join(folder), "rs"));
    let mut found = Vec::new();
    for path in folders.iter().flatten() {
        let source = Source::read(path);
        // Pipes of other programs are no way to the terminal.
        let is_other = |code: &str| code.contains("Stdio::");
        let mut lines = source.lines().filter(|(_, code)| !is_other(code));
        if lines.any(|(_, code)| PAST_IT.into_iter().any(|word| has_word(code, word))) {
            found.push(path.strip_prefix(&root).expect("inside").to_string_lossy().into_owned());
        }
    }
    assert_eq!(found, [WAY_OUT]);
}
