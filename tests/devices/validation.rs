//! Under validation and synchronization validation: no message, and proof that there would be one.
//!
//! `VIEWFUSE_TEST_LAYERS` names a folder with validation layers that see a missing barrier between two kernels, as
//! those of distributions often do not, and with the C library that they want; programs are then started under that.
//! Without it the layers are the system's.

use crate::BINARY;
use crate::candidate::{Candidate, Test};
use crate::child::{self, WITH_BARRIERS, WITHOUT_BARRIERS};
use libtest_mimic::Failed;
use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use viewfuse_tests::command::{Outcome, names_in};
use viewfuse_tests::scenes::Folder;
use viewfuse_vulkan::{Instance, InstanceOptions};

/// The tests, those ignored for which there are no layers.
pub(crate) fn tests() -> Vec<Test> {
    let strong = env::var_os("VIEWFUSE_TEST_LAYERS").is_some();
    // The folder's layers cannot be loaded into this process.
    let missing = match strong {
        true => None,
        false => {
            let options = InstanceOptions { loader: None, validation: true };
            Instance::load(&options).err().map(|error| error.to_string())
        }
    };
    let weak = (!strong).then(|| "the system's layers may be too old to see it; VIEWFUSE_TEST_LAYERS".to_owned());
    let test = |name, work| Test { missing: missing.clone(), ..Test::new(name, work) };
    vec![
        test("validation_says_nothing_about_check", validation_says_nothing_about_check),
        test("validation_says_nothing_about_these_tests", validation_says_nothing_about_these_tests),
        Test {
            missing: missing.clone().or(weak),
            ..Test::new("validation_sees_a_missing_barrier", validation_sees_a_missing_barrier)
        },
    ]
}

/// A program under validation.
fn validated(program: &Path) -> Result<Command, Failed> {
    let mut command = match env::var_os("VIEWFUSE_TEST_LAYERS").map(PathBuf::from) {
        None => Command::new(program),
        Some(folder) => {
            let name =
                names_in(&folder).into_iter().find(|name| name.starts_with("ld-linux")).ok_or("no linker there")?;
            let mut paths = OsString::from(&folder);
            // Drivers and what they need are the system's.
            let triple = format!("{}-linux-gnu", env::consts::ARCH);
            paths.push(format!(":/usr/lib/{triple}:/lib/{triple}"));
            let mut command = Command::new(folder.join(name));
            command.arg("--library-path").arg(paths).arg(program).env("VK_LAYER_PATH", folder);
            command
        }
    };
    command.env("VIEWFUSE_VALIDATION", "1");
    Ok(command)
}

fn messages(candidate: &Candidate, work: &str) -> Result<String, Failed> {
    let program = fs::canonicalize(env::current_exe()?)?;
    let outcome = child::outcome(validated(&program)?, work, &candidate.adapter.name)?;
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""), "{}", outcome.stdout);
    Ok(outcome.stdout.trim().to_owned())
}

fn says_nothing(candidate: &Candidate, arguments: &[&str]) -> Result<(), Failed> {
    let (folder, device) = (Folder::new(), format!("vulkan:{}", candidate.adapter.name));
    let mut command = validated(Path::new(BINARY))?;
    command.current_dir(folder.path()).args(arguments).args(["--device", &device]);
    let outcome = Outcome::of(command);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""), "{}", outcome.stdout);
    assert!(outcome.stdout.contains(&candidate.adapter.name), "{}", outcome.stdout);
    Ok(())
}

fn validation_says_nothing_about_check(candidate: &Candidate) -> Result<(), Failed> {
    says_nothing(candidate, &["check", "--seeds", "1"])
}

/// All other trials of this device: cut work, memory that runs out, transfers. A device that is left alone is another
/// process, and is wrong by the letter; a whole scene of Gaussians is what its derivatives are, a thousand times.
fn validation_says_nothing_about_these_tests(candidate: &Candidate) -> Result<(), Failed> {
    let mut command = validated(&fs::canonicalize(env::current_exe()?)?)?;
    command.arg(&candidate.adapter.name);
    // What the others ask of a driver, too.
    const SKIPPED: [&str; 8] = [
        "::validation_", "left_alone", "a_scene_is_as_good", "a_devices_scene_depends", "an_iteration_needs",
        "rates_of_rounded", "pictures_in_rounded", "bounds_choose",
    ];
    for skipped in SKIPPED {
        command.args(["--skip", skipped]);
    }
    let outcome = Outcome::of(command);
    let passed = outcome.stdout.lines().filter(|line| line.ends_with("... ok")).count();
    assert!(outcome.code == Some(0) && passed > 10, "{}{}", outcome.stdout, outcome.stderr);
    Ok(())
}

fn validation_sees_a_missing_barrier(candidate: &Candidate) -> Result<(), Failed> {
    assert_eq!(messages(candidate, WITH_BARRIERS)?, "");
    let said = messages(candidate, WITHOUT_BARRIERS)?;
    assert!(said.contains("READ_AFTER_WRITE"), "{said:?}");
    Ok(())
}
