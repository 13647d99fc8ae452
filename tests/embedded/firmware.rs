//! core on bare microcontrollers, in emulators: the same bits as on the host, and what the calls take.
//!
//! Where an emulator or Rust's library for a target is missing, the tests of that target are ignored and say what is
//! missing; with `VIEWFUSE_REQUIRE_FIRMWARE=1` they fail instead.

mod costs;

use libtest_mimic::{Failed, Trial};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use viewfuse_list::Inputs;
use viewfuse_list::attended::attention;
use viewfuse_list::formulas::formulas;
use viewfuse_list::quantised::quantised;
use viewfuse_list::sampled::sampling;
use viewfuse_list::splatted::splatting;
use viewfuse_tests::emulator::Emulator;
use viewfuse_tests::emulator::board::{BOARDS, Board, Registers};
use viewfuse_tests::emulator::image::Image;
use viewfuse_tests::emulator::list::{Difference, Line, compare, gathered, parsed};
use viewfuse_tests::emulator::trace::{Call, calls};
use viewfuse_tests::places::repository;
use viewfuse_tests::source::files;
use viewfuse_tests::trials::{is_required, needing};

const REQUIRED: &str = "VIEWFUSE_REQUIRE_FIRMWARE";

/// For size, and for speed.
const PROFILES: [&str; 2] = ["release", "fast"];
const PROGRAMS: [&str; 5] = ["formulas", "attention", "samplers", "quantised", "gaussians"];
/// Of so many different numbers a list consists at least.
const MIN_DIFFERENT: usize = 200;

fn host_list(program: &str, inputs: Inputs) -> Vec<Line> {
    match program {
        "formulas" => gathered(|emit| formulas(inputs, emit)),
        "samplers" => gathered(|emit| sampling(inputs, emit)),
        "quantised" => gathered(|emit| quantised(inputs, emit)),
        "gaussians" => gathered(|emit| splatting(inputs, emit)),
        _ => gathered(|emit| attention(inputs, emit)),
    }
}

/// The firmware of a board. Builds once, whichever test comes first.
struct Firmware {
    board: Board,
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

/// A test that needs emulators.
type OnDevice = Box<dyn FnOnce(&[Arc<Firmware>]) -> Result<(), Failed> + Send>;

pub(crate) fn trials() -> Vec<Trial> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let firmware = BOARDS
        .map(|board| Arc::new(Firmware { board, emulator: Emulator::find(board, folder), built: Mutex::default() }));
    let on_device = |name: String, boards: &[Arc<Firmware>], test: OnDevice| {
        let missing = boards.iter().find_map(|firmware| firmware.emulator.as_ref().err().cloned());
        let boards = boards.to_vec();
        needing(missing, is_required(REQUIRED), Trial::test(name, move || test(&boards)))
    };
    let mut trials = vec![
        Trial::test("the_lists_are_worth_comparing", the_lists_are_worth_comparing),
        Trial::test("every_kind_of_number_depends_on_the_inputs", every_kind_of_number_depends_on_the_inputs),
        Trial::test("lists_that_differ_are_rejected", lists_that_differ_are_rejected),
        Trial::test("a_trace_without_return_is_rejected", a_trace_without_return_is_rejected),
        Trial::test("a_trace_of_risc_v_is_read", a_trace_of_risc_v_is_read),
        Trial::test("both_workspaces_lock_the_same_mathematics", both_workspaces_lock_the_same_mathematics),
        Trial::test("every_function_of_the_list_has_a_worst_case", every_function_of_the_list_has_a_worst_case),
    ];
    for (board, firmware) in BOARDS.iter().zip(&firmware) {
        // For speed on one of them: what is compared are the compiler's choices, not the processor's.
        for profile in if *board == BOARDS[0] { &PROFILES[..] } else { &PROFILES[..1] } {
            for program in PROGRAMS {
                let name = format!("bits_equal_the_hosts::{}::{program}::{profile}", board.target);
                let test = move |boards: &[Arc<Firmware>]| bits_equal_the_hosts(&boards[0], profile, program);
                trials.push(on_device(name, std::slice::from_ref(firmware), Box::new(test)));
            }
        }
        let name = format!("a_program_that_panics_is_noticed::{}", board.target);
        let test = |boards: &[Arc<Firmware>]| a_program_that_panics_is_noticed(&boards[0]);
        trials.push(on_device(name, std::slice::from_ref(firmware), Box::new(test)));
    }
    trials.push(on_device("what_the_calls_take".into(), &firmware, Box::new(costs::what_the_calls_take)));
    trials
}

fn the_lists_are_worth_comparing() -> Result<(), Failed> {
    for program in PROGRAMS {
        let list = host_list(program, Inputs::STANDARD);
        compare(&list, &list, MIN_DIFFERENT).map_err(|difference| format!("{program}: {difference:?}"))?;
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
        assert!(compare(&other, &list, MIN_DIFFERENT).is_err());
        assert_eq!(list.len(), other.len());
        let mut names: Vec<&str> = list.iter().map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert!(names.len() > 3);
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
    assert!(calls(start.as_bytes(), Registers::Arm, &image).is_err_and(|error| error.contains("does not return")));
    let lost = [start.as_str(), &line(0x900, 0x7f0, 0)].concat();
    assert!(calls(lost.as_bytes(), Registers::Arm, &image).is_err_and(|error| error.contains("no function")));
    let whole = [start.as_str(), &line(0x10c, 0x800, 0), &line(0x104, 0x800, 0)].concat();
    let call = Call { name: "it".into(), instructions: 3, stack: 16, code: 16 };
    assert_eq!(calls(whole.as_bytes(), Registers::Arm, &image), Ok(vec![call]));
    Ok(())
}

fn a_trace_of_risc_v_is_read() -> Result<(), Failed> {
    use viewfuse_tests::emulator::image::Function;
    let function = |name: &str, address| Function { name: name.into(), address, size: 8 };
    let image =
        Image { sections: Vec::new(), functions: vec![function("main", 0x100), function("measured_it", 0x108)] };
    let line = |address: u32, stack: u32, link: u32| {
        format!(
            "Trace 0\n pc       {address:08x}\n mstatus  00000000\n \
             x0/zero  00000000 x1/ra    {link:08x} x2/sp    {stack:08x} x3/gp    00000000\n"
        )
    };
    let states = [(0x100, 0x800, 0), (0x108, 0x800, 0x104), (0x10a, 0x7e0, 0x104), (0x104, 0x800, 0x104)];
    let trace: String = states.map(|(address, stack, link)| line(address, stack, link)).concat();
    let call = Call { name: "it".into(), instructions: 2, stack: 32, code: 8 };
    assert_eq!(calls(trace.as_bytes(), Registers::RiscV, &image), Ok(vec![call]));
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
    compare(&printed, &expected, MIN_DIFFERENT).map_err(|difference| format!("{difference:?}"))?;
    let changed = Inputs { phase: 1.01 * Inputs::STANDARD.phase, ..Inputs::STANDARD };
    assert!(compare(&printed, &host_list(program, changed), MIN_DIFFERENT).is_err());
    Ok(())
}

fn a_program_that_panics_is_noticed(firmware: &Firmware) -> Result<(), Failed> {
    let path = firmware.folder(PROFILES[0])?.join("fails");
    assert!(firmware.emulator()?.run(&path).is_err_and(|error| error.contains("failed")));
    Ok(())
}

/// Core's README says what bounds the loops of every function that the firmware's list names.
fn every_function_of_the_list_has_a_worst_case() -> Result<(), Failed> {
    let readme = std::fs::read_to_string(repository().join("core/README.md"))?;
    let table =
        readme.split("### Worst cases").nth(1).and_then(|rest| rest.split("\n## ").next()).ok_or("no worst cases")?;
    let mut functions = Vec::new();
    for path in files(&repository().join("tests/firmware/list/src"), "rs") {
        let source = std::fs::read_to_string(&path)?;
        for import in source.split("use viewfuse_core::").skip(1).filter_map(|rest| rest.split(';').next()) {
            let items =
                import.split_once('{').map_or(import.rsplit("::").next().unwrap_or_default(), |(_, items)| items);
            let names = items.split(|character: char| !(character.is_alphanumeric() || character == '_'));
            functions.extend(
                names.filter(|name| name.starts_with(char::is_lowercase) && *name != "self").map(str::to_owned),
            );
        }
    }
    functions.sort_unstable();
    functions.dedup();
    assert!(functions.len() > 20, "{functions:?}");
    for function in functions {
        assert!(table.contains(&format!("`{function}`")), "{function} has no worst case in core/README.md");
    }
    Ok(())
}
