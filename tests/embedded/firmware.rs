//! core on a bare Cortex-M4F, in an emulator: the same bits as on the host, and what the calls take.
//!
//! Where the emulator or Rust's library for the target is missing, these tests are ignored and say what is missing;
//! with `VIEWFUSE_REQUIRE_FIRMWARE=1` they fail instead.

use libtest_mimic::{Failed, Trial};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use viewfuse_list::Inputs;
use viewfuse_list::attended::attention;
use viewfuse_list::formulas::formulas;
use viewfuse_list::rig::schemes;
use viewfuse_list::sampled::sampling;
use viewfuse_tests::emulator::Emulator;
use viewfuse_tests::emulator::image::Image;
use viewfuse_tests::emulator::list::{Difference, Line, compare, gathered, parsed};
use viewfuse_tests::emulator::trace::{Call, calls};
use viewfuse_tests::places::repository;
use viewfuse_tests::trials::{is_required, needing};

const REQUIRED: &str = "VIEWFUSE_REQUIRE_FIRMWARE";

/// What the default scheme may take for 8 sources.
const MOST_INSTRUCTIONS: u64 = 6000;
const MOST_STACK: u32 = 2048;
/// What the firmware without attention may have of code and constants.
const MOST_BYTES: u64 = 32 * 1024;

/// For size, and for speed.
const PROFILES: [&str; 2] = ["release", "fast"];
const PROGRAMS: [&str; 3] = ["formulas", "attention", "samplers"];
/// Of so many different numbers a list consists at least.
const LEAST_DIFFERENT: usize = 200;

fn host_list(program: &str, inputs: Inputs) -> Vec<Line> {
    match program {
        "formulas" => gathered(|emit| formulas(inputs, emit)),
        "samplers" => gathered(|emit| sampling(inputs, emit)),
        _ => gathered(|emit| attention(inputs, emit)),
    }
}

/// Builds once, whichever test comes first.
struct Firmware {
    emulator: Result<Emulator, String>,
    built: Mutex<Vec<(&'static str, PathBuf)>>,
}

impl Firmware {
    fn folder(&self, profile: &'static str) -> Result<PathBuf, Failed> {
        let mut built = self.built.lock().expect("no test panicked in here");
        if let Some((_, folder)) = built.iter().find(|(name, _)| *name == profile) {
            return Ok(folder.clone());
        }
        let folder = self.emulator()?.build(&repository(), profile)?;
        built.push((profile, folder.clone()));
        Ok(folder)
    }

    fn emulator(&self) -> Result<&Emulator, Failed> {
        self.emulator.as_ref().map_err(|missing| Failed::from(missing.as_str()))
    }
}

/// A test that needs the emulator.
type OnDevice = Box<dyn FnOnce(&Firmware) -> Result<(), Failed> + Send>;

pub(crate) fn trials() -> Vec<Trial> {
    let emulator = Emulator::find(Path::new(env!("CARGO_TARGET_TMPDIR")));
    let missing = emulator.as_ref().err().cloned();
    let firmware = Arc::new(Firmware { emulator, built: Mutex::default() });
    let on_device = |name: String, test: OnDevice| {
        let firmware = Arc::clone(&firmware);
        needing(missing.clone(), is_required(REQUIRED), Trial::test(name, move || test(&firmware)))
    };
    let mut trials = vec![
        Trial::test("the_lists_are_worth_comparing", the_lists_are_worth_comparing),
        Trial::test("every_kind_of_number_depends_on_the_inputs", every_kind_of_number_depends_on_the_inputs),
        Trial::test("lists_that_differ_are_rejected", lists_that_differ_are_rejected),
        Trial::test("a_trace_without_return_is_rejected", a_trace_without_return_is_rejected),
        Trial::test("both_workspaces_lock_the_same_mathematics", both_workspaces_lock_the_same_mathematics),
    ];
    for profile in PROFILES {
        for program in PROGRAMS {
            let name = format!("bits_equal_the_hosts::{program}::{profile}");
            trials.push(on_device(name, Box::new(move |firmware| bits_equal_the_hosts(firmware, profile, program))));
        }
    }
    trials.push(on_device("a_program_that_panics_is_noticed".into(), Box::new(a_program_that_panics_is_noticed)));
    trials.push(on_device("what_the_calls_take".into(), Box::new(what_the_calls_take)));
    trials
}

fn the_lists_are_worth_comparing() -> Result<(), Failed> {
    for program in PROGRAMS {
        let list = host_list(program, Inputs::STANDARD);
        compare(&list, &list, LEAST_DIFFERENT).map_err(|difference| format!("{program}: {difference:?}"))?;
    }
    Ok(())
}

/// The negative control: a phase that differs by 1 %, or another seed, changes some number of every kind.
fn every_kind_of_number_depends_on_the_inputs() -> Result<(), Failed> {
    let changed = Inputs { phase: 1.01 * Inputs::STANDARD.phase, seed: Inputs::STANDARD.seed + 1 };
    // Equal weights whatever the cameras.
    const INDEPENDENT: [&str; 2] = ["mean", "gaussian:beta=0"];
    for program in PROGRAMS {
        let (list, other) = (host_list(program, Inputs::STANDARD), host_list(program, changed));
        assert!(compare(&other, &list, LEAST_DIFFERENT).is_err());
        assert_eq!(list.len(), other.len());
        let mut names: Vec<&str> = list.iter().map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert!(names.len() > 5);
        for name in names {
            let same = list.iter().zip(&other).filter(|(line, _)| line.0 == name).all(|(line, other)| line == other);
            assert_eq!(same, INDEPENDENT.contains(&name), "{name}");
        }
    }
    Ok(())
}

fn lists_that_differ_are_rejected() -> Result<(), Failed> {
    let list: Vec<Line> = (0..9).map(|index| ("n".to_owned(), (index as f32).to_bits())).collect();
    let with = |index: usize, line: Line| {
        let mut changed = list.clone();
        changed[index] = line;
        changed
    };
    assert_eq!(compare(&list, &list, 9), Ok(()));
    let last_bit = ("n".to_owned(), list[4].1 ^ 1);
    assert_eq!(compare(&with(4, last_bit.clone()), &list, 9), Err(Difference::Line(4, last_bit, list[4].clone())));
    let renamed = ("m".to_owned(), list[8].1);
    assert_eq!(compare(&with(8, renamed.clone()), &list, 9), Err(Difference::Line(8, renamed, list[8].clone())));
    assert_eq!(compare(&list[..8], &list, 9), Err(Difference::Length(8, 9)));
    assert_eq!(compare(&[], &[], 1), Err(Difference::Poor(0)));
    assert_eq!(compare(&list, &list, 10), Err(Difference::Poor(9)));
    let nan = with(3, ("n".to_owned(), f32::NAN.to_bits()));
    assert_eq!(compare(&nan, &nan, 9), Err(Difference::NotFinite(3, nan[3].clone())));
    assert_eq!(parsed("3f800000 one"), Ok(vec![("one".to_owned(), 1.0_f32.to_bits())]));
    assert!(parsed("3f80000 one").is_err() && parsed("one").is_err());
    Ok(())
}

fn a_trace_without_return_is_rejected() -> Result<(), Failed> {
    use viewfuse_tests::emulator::image::Function;
    let function = |name: &str, address| Function { name: name.into(), address, size: 8 };
    let functions = vec![function("main", 0x100), function("measured_it", 0x108), function("within", 0x110)];
    let image = Image { sections: Vec::new(), functions };
    let line = |address: u32, stack: u32, link: u32| {
        format!("R00=00000000\nR12=00000000 R13={stack:08x} R14={link:08x} R15={address:08x}\n")
    };
    let start = [line(0x100, 0x800, 0), line(0x108, 0x800, 0x105), line(0x110, 0x7f0, 0x10d)].concat();
    assert!(calls(start.as_bytes(), &image).is_err_and(|error| error.contains("does not return")));
    let lost = [start.as_str(), &line(0x900, 0x7f0, 0)].concat();
    assert!(calls(lost.as_bytes(), &image).is_err_and(|error| error.contains("no function")));
    let whole = [start.as_str(), &line(0x10c, 0x800, 0), &line(0x104, 0x800, 0)].concat();
    let call = Call { name: "it".into(), instructions: 3, stack: 16, code: 16 };
    assert_eq!(calls(whole.as_bytes(), &image), Ok(vec![call]));
    Ok(())
}

/// Equal bits are only promised for equal sources.
fn both_workspaces_lock_the_same_mathematics() -> Result<(), Failed> {
    let read =
        |path: &str| std::fs::read_to_string(repository().join(path)).map_err(|error| format!("{path}: {error}"));
    let (ours, firmware) = (read("Cargo.lock")?, read("tests/firmware/Cargo.lock")?);
    for name in ["glam", "libm", "bytemuck"] {
        let version = |lock: &str| {
            let (_, behind) = lock.split_once(&format!("name = \"{name}\"\n"))?;
            behind.lines().next().map(str::to_owned)
        };
        let locked = version(&ours).ok_or_else(|| format!("{name} is not locked"))?;
        assert_eq!(Some(locked), version(&firmware), "{name}");
    }
    Ok(())
}

fn bits_equal_the_hosts(firmware: &Firmware, profile: &'static str, program: &str) -> Result<(), Failed> {
    let path = firmware.folder(profile)?.join(program);
    let printed = parsed(&firmware.emulator()?.run(&path)?)?;
    let expected = host_list(program, Inputs::STANDARD);
    compare(&printed, &expected, LEAST_DIFFERENT).map_err(|difference| format!("{difference:?}"))?;
    let changed = Inputs { phase: 1.01 * Inputs::STANDARD.phase, ..Inputs::STANDARD };
    assert!(compare(&printed, &host_list(program, changed), LEAST_DIFFERENT).is_err());
    Ok(())
}

fn a_program_that_panics_is_noticed(firmware: &Firmware) -> Result<(), Failed> {
    let path = firmware.folder(PROFILES[0])?.join("fails");
    assert!(firmware.emulator()?.run(&path).is_err_and(|error| error.contains("failed")));
    Ok(())
}

/// What a call is in the table.
fn title(call: &Call, weighed: &mut impl Iterator<Item = &'static str>) -> Option<String> {
    Some(match call.name.as_str() {
        "weigh" => format!("weights of 8 sources, {}", weighed.next()?),
        "attend" => "attention weights of 8 sources".into(),
        "embed" => "one pose embedded".into(),
        "fuse" => "fusing 8 x 16 latents".into(),
        "fuse_visible" => "fusing 8 x 16 latents with visibility".into(),
        "ray" => "one composited ray of 64 samples".into(),
        "depths" => "64 stratified depths with random numbers".into(),
        "step" => "one denoiser step of 16 values, without the network".into(),
        "sqrt" => "one square root".into(),
        _ => return None,
    })
}

/// A row of the table: what it is about, and its numbers.
type Row = (String, Vec<u64>);

fn what_the_calls_take(firmware: &Firmware) -> Result<(), Failed> {
    let emulator = firmware.emulator()?;
    let mut measured = Vec::new();
    let mut without_attention = Vec::new();
    for profile in PROFILES {
        let folder = firmware.folder(profile)?;
        let program = folder.join("calls");
        let image = Image::open(&program)?;
        let calls = emulator.trace(&program, &image)?;
        if profile == PROFILES[0] {
            assert_eq!(calls, emulator.trace(&program, &image)?, "the counts repeat exactly");
        }
        measured.push(calls);
        without_attention.push(Image::open(&folder.join("formulas"))?);
    }
    let rows = rows(&measured[0], &measured[1])?;
    println!("\n| call | for size: instructions | stack | code | for speed: instructions | stack |");
    println!("|---|---|---|---|---|---|");
    rows.iter().for_each(|row| println!("{}", markdown(row)));
    for (profile, image) in PROFILES.iter().zip(&without_attention) {
        println!("{profile}, all without attention: {} bytes: {:?}", image.bytes(), image.sections);
    }
    println!();
    let default = &measured[0][0];
    assert_eq!(default.name, "weigh");
    assert!(default.instructions <= MOST_INSTRUCTIONS && default.stack <= MOST_STACK, "{default:?}");
    assert!(default.instructions > 100, "nothing was computed: {default:?}");
    assert!(without_attention[0].bytes() <= MOST_BYTES);
    the_readme_says_so(&rows, emulator.compiles_the_library())
}

/// The rows of the table from the calls of the two profiles.
fn rows(small: &[Call], fast: &[Call]) -> Result<Vec<Row>, Failed> {
    assert_eq!(small.len(), fast.len());
    let mut names = schemes().into_iter().map(|(name, _)| name);
    let mut rows = Vec::new();
    for (small, fast) in small.iter().zip(fast) {
        assert_eq!(small.name, fast.name);
        let title = title(small, &mut names).ok_or("a call without a title")?;
        let (small_stack, fast_stack) = (u64::from(small.stack), u64::from(fast.stack));
        // Not the code for speed: what the compiler copies into its callers changes with every version.
        rows.push((title, vec![small.instructions, small_stack, small.code, fast.instructions, fast_stack]));
    }
    assert_eq!(names.next(), None, "every scheme was measured");
    Ok(rows)
}

fn markdown((title, numbers): &Row) -> String {
    numbers.iter().fold(format!("| {title} |"), |line, number| format!("{line} {number} |"))
}

/// Which of a row's numbers is the code for size.
const CODE_FOR_SIZE: usize = 2;

/// The rows of core's README are rows of the table, to a fifth: another compiler gives a few instructions more or less.
/// The code is as small as they say only where Rust's library is compiled for size as well.
fn the_readme_says_so(rows: &[Row], library_is_small: bool) -> Result<(), Failed> {
    let readme = std::fs::read_to_string(repository().join("core/README.md"))?;
    let mut found = 0;
    for (title, numbers) in rows {
        let Some(line) = readme.lines().find(|line| line.starts_with(&format!("| {title} |"))) else { continue };
        let said: Vec<u64> = line.split('|').filter_map(|cell| cell.trim().parse().ok()).collect();
        let close = |(place, (said, measured)): (usize, (&u64, &u64))| {
            said.abs_diff(*measured) <= measured / 5 || (place == CODE_FOR_SIZE && !library_is_small)
        };
        let all_close = said.iter().zip(numbers).enumerate().all(close);
        assert!(said.len() == numbers.len() && all_close, "{line}: {numbers:?}");
        found += 1;
    }
    assert!(found >= 4, "{found} rows");
    Ok(())
}
