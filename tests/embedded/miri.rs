//! Undefined behaviour: the program of `tests/miri` calls what firmware calls and the whole C interface, as it is and,
//! where a toolchain has it, under Miri.

use libtest_mimic::{Failed, Trial};
use std::path::Path;
use std::process::{Command, Output};
use viewfuse_tests::places::repository;
use viewfuse_tests::trials::{is_required, needing, timed};

const REQUIRED: &str = "VIEWFUSE_REQUIRE_MIRI";

pub(crate) fn trials() -> Vec<Trial> {
    let miri = miri();
    let missing = miri.as_ref().err().cloned();
    let under_miri = timed("no_undefined_behaviour", move || {
        let [cargo, toolchain] = miri.map_err(Failed::from)?;
        printed(Command::new(cargo).arg(toolchain).args(["miri", "run"]))?;
        Ok(())
    });
    vec![
        timed("the_program_for_miri_runs", the_program_for_miri_runs),
        needing(missing, is_required(REQUIRED), under_miri),
    ]
}

/// The program and the toolchain to ask for Miri.
fn miri() -> Result<[&'static str; 2], String> {
    let there = Command::new("cargo").args(["+nightly", "miri", "--version"]).output();
    match there.is_ok_and(|output| output.status.success()) {
        true => Ok(["cargo", "+nightly"]),
        false => Err("no Miri (rustup +nightly component add miri rust-src)".to_owned()),
    }
}

/// What the program prints.
fn printed(cargo: &mut Command) -> Result<String, Failed> {
    cargo.args(["--quiet", "--locked", "--target-dir"]).arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("miri"));
    // What a toolchain sets for its own children is not for another one.
    for name in ["CARGO", "RUSTC", "RUSTUP_TOOLCHAIN", "RUSTFLAGS", "CARGO_TARGET_DIR"] {
        cargo.env_remove(name);
    }
    let Output { status, stdout, stderr } = cargo.current_dir(repository().join("tests/miri")).output()?;
    let text = String::from_utf8_lossy(&stdout).into_owned();
    if !status.success() || !text.ends_with("C interface done\n") {
        return Err(format!("{text}{}", String::from_utf8_lossy(&stderr)).into());
    }
    Ok(text)
}

/// The arithmetic without the processor's instructions gives the host's numbers; also that the program can fail.
fn the_program_for_miri_runs() -> Result<(), Failed> {
    use viewfuse_list::Inputs;
    let text = printed(Command::new(env!("CARGO")).args(["run", "--release"]))?;
    let mut digest = 0xcbf2_9ce4_8422_2325_u64;
    viewfuse_list::formulas::formulas(Inputs::STANDARD, &mut |_, value| {
        digest = (digest ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3);
    });
    assert!(text.contains(&format!("formulas {digest:016x}\n")), "{text}");
    Ok(())
}
