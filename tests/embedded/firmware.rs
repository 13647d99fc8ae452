//! core on bare microcontrollers, in emulators: the same bits as on the host, and what the calls take.
//!
//! Where an emulator or Rust's library for a target is missing, the tests of that target are ignored and say what is
//! missing; with `VIEWFUSE_REQUIRE_FIRMWARE=1` they fail instead.

mod costs;

use libtest_mimic::{Failed, Trial};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use viewfuse_list::Inputs;
use viewfuse_list::attended::attention;
use viewfuse_list::formulas::formulas;
use viewfuse_list::quantised::quantised;
use viewfuse_list::sampled::sampling;
use viewfuse_list::splatted::splatting;
use viewfuse_tests::emulator::Emulator;
use viewfuse_tests::emulator::board::{BOARDS, Board};
use viewfuse_tests::emulator::list::{Line, compare, gathered, parsed};
use viewfuse_tests::places::repository;
use viewfuse_tests::trials::{is_required, needing, timed};

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

/// The firmware of a board.
struct Firmware {
    board: Board,
    emulator: Result<Emulator, String>,
}

/// That of every board.
static FIRMWARE: LazyLock<[Firmware; 3]> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    BOARDS.map(|board| Firmware { board, emulator: Emulator::find(board, folder) })
});

/// All programs of all boards, built by whichever test comes first. For speed those of the first board alone: what is
/// compared are the compiler's choices, not the processor's.
static BUILT: LazyLock<Result<(), String>> = LazyLock::new(|| {
    let found: Vec<&Emulator> = FIRMWARE.iter().filter_map(|firmware| firmware.emulator.as_ref().ok()).collect();
    let first: Vec<&Emulator> = FIRMWARE[0].emulator.as_ref().into_iter().collect();
    Emulator::build(&found, &repository(), PROFILES[0])?;
    Emulator::build(&first, &repository(), PROFILES[1])
});

impl Firmware {
    fn folder(&self, profile: &'static str) -> Result<PathBuf, Failed> {
        BUILT.clone()?;
        Ok(self.emulator()?.programs(profile))
    }

    fn emulator(&self) -> Result<&Emulator, Failed> {
        self.emulator.as_ref().map_err(|missing| Failed::from(missing.as_str()))
    }
}

pub(crate) fn trials() -> Vec<Trial> {
    let on_device = |boards: &[Firmware], trial: Trial| {
        let missing = boards.iter().find_map(|firmware| firmware.emulator.as_ref().err().cloned());
        needing(missing, is_required(REQUIRED), trial)
    };
    let the_calls = timed("what_the_calls_take", || costs::what_the_calls_take(&FIRMWARE[..]));
    let mut trials = vec![
        on_device(&FIRMWARE[..], the_calls),
        timed("every_kind_of_number_depends_on_the_inputs", every_kind_of_number_depends_on_the_inputs),
        timed("both_workspaces_lock_the_same_mathematics", both_workspaces_lock_the_same_mathematics),
    ];
    for firmware in FIRMWARE.iter() {
        let target = firmware.board.target;
        for profile in if firmware.board == BOARDS[0] { &PROFILES[..] } else { &PROFILES[..1] } {
            for program in PROGRAMS {
                let name = format!("bits_equal_the_hosts::{target}::{program}::{profile}");
                let trial = timed(name, move || bits_equal_the_hosts(firmware, profile, program));
                trials.push(on_device(std::slice::from_ref(firmware), trial));
            }
        }
        let name = format!("a_program_that_panics_is_noticed::{target}");
        let trial = timed(name, move || a_program_that_panics_is_noticed(firmware));
        trials.push(on_device(std::slice::from_ref(firmware), trial));
    }
    trials
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
    compare(&printed, &host_list(program, Inputs::STANDARD), MIN_DIFFERENT)
        .map_err(|difference| format!("{difference:?}").into())
}

fn a_program_that_panics_is_noticed(firmware: &Firmware) -> Result<(), Failed> {
    let path = firmware.folder(PROFILES[0])?.join("fails");
    assert!(firmware.emulator()?.run(&path).is_err_and(|error| error.contains("failed")));
    Ok(())
}
