//! Every piece of unsafe code says why it is sound: a comment `SAFETY:` above the statement, `# Safety` in the
//! documentation of an unsafe function.

use viewfuse_tests::places::repository;
use viewfuse_tests::source::{Source, files};

/// What a piece of unsafe code must have above it.
fn wanted(line: &str) -> Option<&'static str> {
    let start = line.match_indices("unsafe").find(|(at, _)| {
        let is_part = |character: char| character.is_alphanumeric() || character == '_';
        !line[..*at].ends_with(is_part) && !line[at + "unsafe".len()..].starts_with(is_part)
    });
    let behind = line[start?.0 + "unsafe".len()..].trim_start();
    let is_function = behind.starts_with("fn") || behind.starts_with("extern");
    // The type of a function is no code.
    let is_type =
        is_function && !line.contains('#') && behind.split('(').next().is_some_and(|head| head.ends_with("fn"));
    (!is_type).then_some(if is_function { "# Safety" } else { "SAFETY:" })
}

/// The lines of unsafe code without a reason; also how many there are with one.
fn unreasoned(text: &str) -> (Vec<usize>, usize) {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let (mut faults, mut sound) = (Vec::new(), 0);
    for (number, code) in Source::new(text).lines() {
        let Some(wanted) = wanted(code) else { continue };
        // Up to the end of the statement before, over comments and attributes.
        let above = lines[..number - 1].iter().rev().take_while(|line| {
            let is_beside = line.starts_with("//") || line.starts_with('#');
            !line.is_empty() && (is_beside || !line.ends_with([';', '{', '}']))
        });
        match above.filter(|line| line.starts_with("//")).any(|line| line.contains(wanted)) {
            true => sound += 1,
            false => faults.push(number),
        }
    }
    (faults, sound)
}

#[test]
fn unsafe_code_says_why_it_is_sound() {
    let (mut faults, mut count) = (Vec::new(), 0);
    for folder in ["core", "vulkan", "host", "tests"] {
        for path in files(&repository().join(folder), "rs") {
            let text = std::fs::read_to_string(&path).expect("a source");
            let (lines, sound) = unreasoned(&text);
            faults.extend(lines.into_iter().map(|line| format!("{}:{line}", path.display())));
            count += sound;
        }
    }
    assert!(faults.is_empty(), "no reason above the unsafe code at {faults:#?}");
    assert!(count > 100, "{count} pieces of unsafe code were found");
}

#[test]
fn unsafe_code_without_a_reason_is_found() {
    for faulty in [
        "// SAFETY: of another statement.\nlet x = 1;\nlet y = unsafe { b() };",
        "/// Does it.\nunsafe fn a() {}",
        "#[unsafe(no_mangle)]\npub extern \"C\" fn a() {}",
        "// Not at all.\nunsafe impl Send for A {}",
    ] {
        assert_eq!(unreasoned(faulty).0.len(), 1, "{faulty}");
    }
    let sound = "// SAFETY: two lines\n// of reasons.\nlet y =\n    unsafe { b() };\n\
                 type F = unsafe fn(u32);\n// unsafe { b() }";
    assert_eq!(unreasoned(sound).0, [0; 0]);
}
