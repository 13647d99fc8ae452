//! What calls take on each board: instructions, stack and code, counted in the emulators' traces, and the tables of
//! `host/results/firmware.md`, which this test writes with `VIEWFUSE_WRITE_TABLES=1` and compares otherwise.

use super::{Firmware, PROFILES};
use libtest_mimic::Failed;
use rayon::prelude::*;
use std::path::PathBuf;
use viewfuse_core::attention::quantised::QuantisedAttention;
use viewfuse_list::rig::measured_schemes;
use viewfuse_tests::emulator::image::Image;
use viewfuse_tests::emulator::trace::Call;
use viewfuse_tests::places::repository;

/// What the default scheme may take for 8 sources on the first board.
const MAX_INSTRUCTIONS: u64 = 6000;
const MAX_STACK: u32 = 2048;
/// What attention with 8 bits may take there, and have of parameters.
const MAX_ATTENDING: u64 = 300_000;
const MAX_PARAMETERS: usize = 20_000;
/// What the firmware without attention may have there of code and constants.
const MAX_BYTES: u64 = 32 * 1024;

/// Programs that are measured on the first board alone, and their calls with what they are in the tables: they take an
/// FPU, and memory.
const WITH_AN_FPU: [(&str, &[(&str, &str)]); 2] = [
    ("embeddings", &[("attend", "attention weights of 8 sources, 32 bits"), ("embed", "one pose embedded, 32 bits")]),
    (
        "splats",
        &[
            ("project", "one Gaussian projected"),
            ("sort", "1000 projected Gaussians sorted by depth"),
            ("row", "one row of 64 pixels of 1000 projected Gaussians"),
        ],
    ),
];

/// A row of a table: what it is about, and its numbers; what is not measured has none.
type Row = (String, Vec<Option<u64>>);

/// What a call is in the tables.
fn title(call: &Call, weighed: &mut impl Iterator<Item = &'static str>) -> Option<String> {
    Some(match call.name.as_str() {
        "weigh" => format!("weights of 8 sources, {}", weighed.next()?),
        "attend" => "attention weights of 8 sources, 8 bits".into(),
        "keys" => "of these, what the sources are to every target".into(),
        "further" => "attention weights for a further target, 8 bits".into(),
        "fuse" => "fusing 8 x 16 latents".into(),
        "fuse_visible" => "fusing 8 x 16 latents with visibility".into(),
        "fuse_u8" => "fusing 8 x 16 readings, `u8`".into(),
        "fuse_i16" => "fusing 8 x 16 readings, `i16`".into(),
        "ray" => "one composited ray of 64 samples".into(),
        "depths" => "64 stratified depths with random numbers".into(),
        "step" => "one denoiser step of 16 values, without the network".into(),
        "sqrt" => "one square root".into(),
        _ => return None,
    })
}

/// The measured calls of a program.
fn measured(firmware: &Firmware, profile: &'static str, program: &str) -> Result<Vec<Call>, Failed> {
    let path = firmware.folder(profile)?.join(program);
    Ok(firmware.emulator()?.trace(&path, &Image::open(&path)?)?)
}

fn named<'a>(calls: &'a [Call], name: &str) -> Result<&'a Call, Failed> {
    Ok(calls.iter().find(|call| call.name == name).ok_or_else(|| format!("no call {name}"))?)
}

/// Instructions, stack and code of a call.
fn numbers(call: &Call) -> [Option<u64>; 3] {
    [Some(call.instructions), Some(u64::from(call.stack)), Some(call.code)]
}

/// Several at once, for an emulator takes one core: in the order of `runs`, each a board, a profile and a program.
fn all_measured(runs: &[(&Firmware, &'static str, &str)]) -> Result<Vec<Vec<Call>>, Failed> {
    let cost = |(firmware, profile, program): &(&Firmware, &'static str, &str)| measured(firmware, profile, program);
    runs.par_iter().map(cost).collect::<Vec<_>>().into_iter().collect()
}

/// What the first board's calls take, and the rows of a table: of every board the first so many numbers of each call.
fn costs(boards: &[Firmware], profile: &'static str, columns: usize) -> Result<(Vec<Call>, Vec<Row>), Failed> {
    let first = &boards[0];
    let with_an_fpu = WITH_AN_FPU.iter().map(|(program, _)| (first, profile, *program));
    let runs = boards.iter().map(|board| (board, profile, "calls")).chain(with_an_fpu);
    let mut everywhere = all_measured(&runs.collect::<Vec<_>>())?;
    let on_the_first = everywhere.split_off(boards.len());
    let mut weighed = measured_schemes().into_iter().map(|(name, _)| name);
    let mut rows = Vec::new();
    for (index, call) in everywhere[0].iter().enumerate() {
        let title = title(call, &mut weighed).ok_or("a call without a title")?;
        assert!(everywhere.iter().all(|calls| calls[index].name == call.name));
        rows.push((title, everywhere.iter().flat_map(|calls| numbers(&calls[index])[..columns].to_vec()).collect()));
    }
    assert_eq!(weighed.next(), None, "every scheme was measured");
    for ((_, named_calls), calls) in WITH_AN_FPU.iter().zip(&on_the_first) {
        for (name, title) in *named_calls {
            let mut row = numbers(named(calls, name)?)[..columns].to_vec();
            row.resize(columns * boards.len(), None);
            rows.push(((*title).to_owned(), row));
        }
    }
    Ok((everywhere.swap_remove(0), rows))
}

/// The table for speed is written with the other and not compared: nothing is promised of it, and its traces take as
/// long.
pub(super) fn what_the_calls_take(boards: &[Firmware]) -> Result<(), Failed> {
    let [for_size, for_speed] = PROFILES;
    let (calls, mut three) = costs(boards, for_size, 3)?;
    within_limits(&calls)?;
    let mut whole = Vec::new();
    for board in boards {
        let image = Image::open(&board.folder(for_size)?.join("formulas"))?;
        println!("{}, all without attention: {} bytes: {:?}", board.board.processor, image.bytes(), image.sections);
        whole.extend([None, None, Some(image.bytes())]);
    }
    assert!(whole[2] <= Some(MAX_BYTES), "{whole:?}");
    three.push(("all but attention, with the program that prints it".to_owned(), whole));
    let is_small = boards.iter().all(|board| board.emulator().is_ok_and(|emulator| emulator.compiles_the_library()));

    let processors: Vec<&str> = boards.iter().map(|board| board.board.processor).collect();
    let columns = processors.iter().map(|name| format!(" {name}: instructions | stack | code |")).collect::<String>();
    the_results_say_so(&format!("| for size |{columns}"), &three, is_small)?;
    if writes_tables() {
        let (_, speed) = costs(&boards[..1], for_speed, 2)?;
        the_results_say_so(&format!("| for speed | {}: instructions | stack |", processors[0]), &speed, is_small)?;
    }
    the_readme_says_the_same()
}

/// The table of core's README has the results' numbers of the first processor.
fn the_readme_says_the_same() -> Result<(), Failed> {
    const HEADING: &str = "| call | instructions | stack | code |\n|---|---|---|---|\n";
    let path = repository().join("core/README.md");
    let (readme, results) = (std::fs::read_to_string(&path)?, std::fs::read_to_string(results())?);
    let (_, measured) = results.split_once("| for size |").ok_or("no table for size")?;
    let (before, behind) = readme.split_once(HEADING).ok_or("no table of calls")?;
    let (rows, rest) = behind.split_once("\n\n").ok_or("the table does not end")?;
    let row = |line: &str| -> Result<String, Failed> {
        let title = line.trim_matches('|').split('|').next().unwrap_or_default().trim();
        let plain = format!("| {} |", title.replace('`', ""));
        let found =
            measured.lines().find(|known| known.starts_with(&plain)).ok_or_else(|| format!("no row {title}"))?;
        let numbers = found[plain.len()..].split('|').take(3).collect::<Vec<_>>().join("|");
        Ok(format!("| {title} |{numbers}|"))
    };
    let table = rows.lines().map(row).collect::<Result<Vec<_>, _>>()?.join("\n");
    if writes_tables() {
        std::fs::write(&path, [before, HEADING, &table, "\n\n", rest].concat())?;
    } else {
        assert_eq!(rows, table, "core/README.md");
    }
    Ok(())
}

/// The limits of the first board.
fn within_limits(calls: &[Call]) -> Result<(), Failed> {
    let default = &calls[0];
    assert_eq!(default.name, "weigh");
    assert!(default.instructions <= MAX_INSTRUCTIONS && default.stack <= MAX_STACK, "{default:?}");
    assert!(default.instructions > 100, "nothing was computed: {default:?}");
    let (attend, further) = (named(calls, "attend")?, named(calls, "further")?);
    assert!(attend.instructions <= MAX_ATTENDING, "{attend:?}");
    assert!(10 * further.instructions <= attend.instructions, "{further:?} of {attend:?}");
    assert!(further.instructions > 1000, "nothing was computed: {further:?}");
    assert!(size_of::<QuantisedAttention>() <= MAX_PARAMETERS);
    Ok(())
}

fn cell(number: &Option<u64>) -> String {
    number.map_or_else(|| "-".to_owned(), |number| number.to_string())
}

/// A table as Markdown.
fn markdown(heading: &str, rows: &[Row]) -> String {
    let line = format!("|{}\n", "---|".repeat(heading.matches('|').count() - 1));
    let row = |(title, numbers): &Row| {
        numbers.iter().fold(format!("| {title} |"), |line, number| format!("{line} {} |", cell(number))) + "\n"
    };
    [format!("{heading}\n"), line].into_iter().chain(rows.iter().map(row)).collect()
}

fn writes_tables() -> bool {
    std::env::var("VIEWFUSE_WRITE_TABLES").is_ok_and(|value| value == "1")
}

fn results() -> PathBuf {
    repository().join("host/results/firmware.md")
}

/// The table of the results with this heading is this one, to a fifth: another compiler gives a few instructions more
/// or less. The code (every third number) is as small as it says only where Rust's library is compiled for size as
/// well, and that of one call to half or twice: which function holds what was inlined differs between builds of the
/// same sources (836 and 1404 bytes were seen for the stratified depths), the whole program by 2 %.
fn the_results_say_so(heading: &str, rows: &[Row], library_is_small: bool) -> Result<(), Failed> {
    let table = markdown(heading, rows);
    println!("\n{table}");
    let text = std::fs::read_to_string(results())?;
    let (before, behind) = text.split_once(&format!("{heading}\n")).ok_or_else(|| format!("no table {heading}"))?;
    let (old, rest) = behind.split_once("\n\n").ok_or("the table does not end")?;
    if writes_tables() {
        std::fs::write(results(), [before, table.trim_end(), "\n\n", rest].concat())?;
        return Ok(());
    }
    let lines: Vec<&str> = old.lines().skip(1).collect();
    assert_eq!(lines.len(), rows.len(), "rows of the table {heading}");
    for (line, (title, numbers)) in lines.into_iter().zip(rows) {
        let said: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!((said[0], said.len()), (title.as_str(), 1 + numbers.len()), "{line}");
        let is_call = numbers.first().is_some_and(Option::is_some);
        for (place, (said, measured)) in said[1..].iter().zip(numbers).enumerate() {
            let is_close = match (said.parse::<u64>().ok(), *measured) {
                (Some(said), Some(measured)) if place % 3 != 2 => said.abs_diff(measured) <= measured / 5,
                (Some(_), Some(_)) if !library_is_small => true,
                (Some(said), Some(measured)) if is_call => (measured.div_ceil(2)..=2 * measured).contains(&said),
                (Some(said), Some(measured)) => said.abs_diff(measured) <= measured / 5,
                (said, measured) => said == measured,
            };
            assert!(is_close, "{line}: measured {numbers:?}");
        }
    }
    Ok(())
}
