//! The documents of the repository: every README is short, and a measured number in one is in a result that it links.
//!
//! A number is *measured* where a unit of measurement stands behind it ([`UNITS`]; also in a list, "0.2 to 0.3 s"), or where it
//! is in a cell of a table that holds numbers alone. What stands in code is none: options, sizes and commands; but a block `text`
//! is what a program printed. Such a number must be, digit by digit, in one of the files of `host/results` that the same
//! README links: a number of one digit may be met there by chance, a measurement with its digits hardly. Limits, defaults and properties of others, which nobody measured, are in [`STATED`], each with its reason.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use viewfuse_tests::places::{links, readmes, repository};

/// Bytes of a README.
const MAX_BYTES: usize = 10 * 1024;

/// What stands behind a measured number.
const UNITS: [&str; 29] = [
    "%",
    "dB",
    "decibel",
    "decibels",
    "h",
    "hours",
    "min",
    "minutes",
    "s",
    "seconds",
    "ms",
    "us",
    "ns",
    "MB",
    "MiB",
    "GB",
    "GiB",
    "KB",
    "kB",
    "KiB",
    "bytes",
    "GB/s",
    "GFLOP/s",
    "instructions",
    "times",
    "crates",
    "thousand",
    "million",
    "billion",
];

/// Numbers with units that nobody measured: the README, the words as they stand there, and why.
const STATED: [(&str, &str, &str); 10] = [
    ("core/kernels/README.md", "128 bytes of push constants", "what every Vulkan device has"),
    ("vulkan/README.md", "120 s on a GPU", "a default"),
    ("vulkan/README.md", "64 KiB are recorded", "a limit"),
    ("vulkan/README.md", "0.2 s at most", "a limit of a piece"),
    ("vulkan/README.md", "200 ms", "a limit of a submission"),
    ("vulkan/README.md", "256 MiB of arrays", "a limit of a submission"),
    ("vulkan/README.md", "changed by 1 % once", "what the tests do"),
    ("host/cli/README.md", "within 2 s of CPU time", "a limit that a test holds"),
    ("host/cli/README.md", "120 s on a GPU", "a default"),
    ("tests/README.md", "more than 256 MiB", "a limit of one execution"),
];

/// A number as it is compared: without commas and a plus.
fn normal(number: &str) -> String {
    number.replace(',', "").trim_start_matches('+').to_owned()
}

/// The numbers of a text, with where they begin and end. A minus counts where no word or number stands before it.
fn numbers(text: &str) -> Vec<(usize, usize)> {
    let bytes = text.as_bytes();
    let is_digit = |place: usize| bytes.get(place).is_some_and(u8::is_ascii_digit);
    let is_word = |place: usize| {
        bytes.get(place).is_some_and(|byte| byte.is_ascii_alphanumeric() || *byte == b'_' || *byte >= 0x80)
    };
    let (mut found, mut place) = (Vec::new(), 0);
    while place < bytes.len() {
        if !is_digit(place) || (place > 0 && (is_word(place - 1) && !text[..place].ends_with('±'))) {
            place += 1;
            continue;
        }
        let is_signed =
            place > 0 && b"+-".contains(&bytes[place - 1]) && (place == 1 || b" *|([".contains(&bytes[place - 2]));
        let start = place - usize::from(is_signed);
        while is_digit(place) || (place < bytes.len() && b".,".contains(&bytes[place]) && is_digit(place + 1)) {
            place += 1;
        }
        // An exponent belongs to the number.
        if bytes.get(place) == Some(&b'e') {
            let sign = usize::from(bytes.get(place + 1).is_some_and(|byte| b"+-".contains(byte)));
            if is_digit(place + 1 + sign) {
                place += 1 + sign;
                while is_digit(place) {
                    place += 1;
                }
            }
        }
        found.push((start, place));
    }
    found
}

/// Whether a unit stands behind: at once or after a blank, and no longer word.
fn has_unit(behind: &str) -> bool {
    let behind = behind.strip_prefix(' ').unwrap_or(behind);
    let end =
        behind.find(|letter: char| !letter.is_alphanumeric() && !['%', '/'].contains(&letter)).unwrap_or(behind.len());
    UNITS.contains(&behind[..end].trim_end_matches('/'))
}

/// Whether what stands between two numbers makes a list of them, which shares the unit behind the last.
fn joins(between: &str) -> bool {
    [",", "and", "or", "to", "±", ", and", "by", "instead of", "against"].contains(&between.trim())
}

/// A line without what stands in code, and without the targets of links.
fn prose(line: &str) -> String {
    let outside: Vec<&str> = line.split('`').step_by(2).collect();
    let mut text = outside.join(" _ ");
    while let Some((start, end)) = text.find("](").and_then(|start| Some((start, start + text[start..].find(')')?))) {
        text.replace_range(start + 1..=end, "");
    }
    text
}

/// Whether a cell of a table holds numbers, signs, units and marks alone.
fn is_numeric(cell: &str) -> bool {
    let found = numbers(cell);
    let mut rest = String::new();
    let mut last = 0;
    for (start, end) in &found {
        rest += &cell[last..*start];
        rest.push(' ');
        last = *end;
    }
    rest += &cell[last..];
    let is_mark = |word: &str| word.chars().all(|letter| "+-±*,()/".contains(letter)) || UNITS.contains(&word);
    !found.is_empty() && rest.split_whitespace().all(is_mark)
}

/// The measured numbers of a document, each with its line.
fn measured(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    // The language of the block that the line is in.
    let mut block: Option<&str> = None;
    let mut is_head = false;
    for (line, code) in text.lines().enumerate() {
        if let Some(language) = code.strip_prefix("```") {
            block = if block.is_some() { None } else { Some(language) };
            continue;
        }
        if block.is_some_and(|language| language != "text") {
            continue;
        }
        let own = if block.is_some() { code.to_owned() } else { prose(code) };
        let mut add = |text: &str, is_all: bool| {
            let places = numbers(text);
            let mut counts = vec![is_all; places.len()];
            for index in (0..places.len()).rev() {
                let (_, end) = places[index];
                let is_listed =
                    places.get(index + 1).is_some_and(|next| counts[index + 1] && joins(&text[end..next.0]));
                counts[index] |= has_unit(&text[end..]) || is_listed;
            }
            let own = places.iter().zip(counts).filter(|(_, counts)| *counts);
            found.extend(own.map(|((start, end), _)| (line + 1, normal(&text[*start..*end]))));
        };
        if own.starts_with('|') {
            // The cells of a head are names.
            let is_first = !std::mem::replace(&mut is_head, true);
            own.trim_matches('|').split('|').for_each(|cell| add(cell, !is_first && is_numeric(cell)));
        } else {
            is_head = false;
            add(&own, false);
        }
    }
    found
}

/// The results that a README links.
fn results(path: &Path, text: &str) -> Vec<PathBuf> {
    let folder = repository().join("host/results");
    let folder = folder.canonicalize().expect("the results");
    links(path, text)
        .into_iter()
        .filter_map(|(_, file, _)| file.canonicalize().ok())
        .filter(|file| file.starts_with(&folder))
        .collect()
}

/// The measured numbers that no linked result has.
fn unfounded(text: &str, results: &[String], stated: &[&str]) -> Vec<(usize, String)> {
    let known: BTreeSet<String> = results
        .iter()
        .flat_map(|text| numbers(text).into_iter().map(|(start, end)| normal(&text[start..end])))
        .collect();
    let text = stated.iter().fold(text.to_owned(), |text, words| text.replace(words, ""));
    measured(&text).into_iter().filter(|(_, number)| !known.contains(number)).collect()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn readmes_are_short() {
    let sizes: Vec<(PathBuf, usize)> = readmes().into_iter().map(|path| (path.clone(), read(&path).len())).collect();
    assert!(sizes.len() > 20, "{sizes:?}");
    let long: Vec<_> = sizes.iter().filter(|(_, size)| *size > MAX_BYTES).collect();
    assert!(long.is_empty(), "more than {MAX_BYTES} bytes: {long:#?}; measurements belong in host/results");
}

#[test]
fn measured_numbers_are_in_a_result() {
    let (mut faults, mut count) = (Vec::new(), 0);
    for path in readmes() {
        let text = read(&path);
        let name = path.strip_prefix(repository()).expect("inside").display().to_string();
        let stated: Vec<&str> = STATED.iter().filter(|(own, ..)| *own == name).map(|(_, words, _)| *words).collect();
        for words in &stated {
            assert!(text.contains(words), "{name} says no more {words:?}");
        }
        let results: Vec<String> = results(&path, &text).iter().map(|path| read(path)).collect();
        count += measured(&text).len();
        faults.extend(
            unfounded(&text, &results, &stated).into_iter().map(|(line, number)| format!("{name}:{line}: {number}")),
        );
    }
    assert!(count > 50, "{count} measured numbers");
    assert!(
        faults.is_empty(),
        "no linked file of host/results has these numbers (what nobody measured is in STATED): {faults:#?}"
    );
}

#[test]
fn a_wrong_number_is_found() {
    let result = "| a | 1.61 ± 0.34 |\nIt takes 1674 instructions and 0.2 to 0.35 s, -6.2 dB.".to_owned();
    let document = "# 12 things\n\nA gain of +1.61 ± 0.34 dB in 0.2 to 0.35 s on 3 of 4 scenes, `--max-error 40dB`, by 2026.\n\
                    It takes 1,674 instructions, not -6.2 dB.\n\n| of 7 | value |\n|---|---|\n| a 5 | **1.61 ± 0.34** |\n\n\
                    ```sh\nview --size 9 s\n```\n";
    assert_eq!(unfounded(document, std::slice::from_ref(&result), &[]), []);
    for (from, to, number) in [
        ("1,674", "1,675", "1675"),
        ("+1.61", "+1.62", "1.62"),
        ("0.34 dB", "0.35001 dB", "0.35001"),
        ("0.2 to", "0.25 to", "0.25"),
        ("-6.2", "6.2", "6.2"),
        ("**1.61", "**1.6", "1.6"),
        ("```sh\nview --size 9 s", "```text\nview 9 s", "9"),
    ] {
        let found = unfounded(&document.replacen(from, to, 1), std::slice::from_ref(&result), &[]);
        assert_eq!(found.iter().map(|(_, number)| number.as_str()).collect::<Vec<_>>(), [number], "{from} to {to}");
    }
    assert!(!unfounded(document, &[], &[]).is_empty(), "no result is linked");
    assert_eq!(unfounded("It waits 5 s.", &[], &["waits 5 s"]), [], "what is stated");
}
