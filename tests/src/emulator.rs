//! Microcontrollers for tests: builds the programs of `tests/firmware`, runs them in QEMU and reads what they print and
//! which instructions they executed.

pub mod board;
pub mod image;
pub mod list;
pub mod trace;

use crate::patience;
use board::Board;
use image::Image;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use trace::Call;

/// Where the library's sources are if not at the compiler's own place for them: their folder, or an archive of it.
const SOURCES: &str = "VIEWFUSE_RUST_LIBRARY";

/// What was found that the firmware of a board needs.
pub struct Emulator {
    board: Board,
    library: Library,
    /// Where to build.
    folder: PathBuf,
}

/// Where Rust's own library for the target comes from.
enum Library {
    /// The toolchain has it compiled.
    Installed,
    /// To be compiled from the sources that the toolchain has.
    Component,
    /// To be compiled from the sources in a folder.
    Sources(PathBuf),
    /// The same, in an archive.
    Archive(PathBuf),
}

impl Emulator {
    /// Looks for the emulator and for Rust's library for the target.
    ///
    /// # Errors
    /// What is missing, in a few words.
    pub fn find(board: Board, folder: &Path) -> Result<Emulator, String> {
        let there = Command::new(board.emulator).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !there.is_ok_and(|status| status.success()) {
            return Err(format!("no {}", board.emulator));
        }
        let library = Library::find(board.target)?;
        Ok(Emulator { board, library, folder: folder.join("firmware") })
    }

    /// Whether Rust's library is compiled along with the programs, and for size where they are. One that came compiled
    /// is for speed.
    pub fn compiles_the_library(&self) -> bool {
        !matches!(self.library, Library::Installed)
    }

    /// The folder with the programs of a profile.
    pub fn programs(&self, profile: &str) -> PathBuf {
        self.folder.join(self.board.target).join(profile)
    }

    /// Builds all programs with a profile, for these boards at once.
    ///
    /// # Errors
    /// What the compiler said.
    pub fn build(boards: &[&Emulator], repository: &Path, profile: &str) -> Result<(), String> {
        let Some(first) = boards.first() else { return Ok(()) };
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "--locked", "--profile", profile, "--target-dir"]).arg(&first.folder);
        cargo.current_dir(repository.join("tests/firmware"));
        // Flags for the host's processor are none for these.
        for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_TARGET"] {
            cargo.env_remove(name);
        }
        let mut is_compiled = false;
        for firmware in boards {
            cargo.args(["--target", firmware.board.target]);
            is_compiled |= firmware.compiles_the_library();
            match &firmware.library {
                Library::Installed | Library::Component => {}
                Library::Sources(folder) => _ = cargo.env("__CARGO_TESTS_ONLY_SRC_ROOT", folder),
                Library::Archive(archive) => _ = cargo.env("__CARGO_TESTS_ONLY_SRC_ROOT", firmware.unpacked(archive)?),
            }
        }
        if is_compiled {
            // Building the library is not a stable option, and the sources' place not even an official one.
            cargo.arg("-Zbuild-std=core").env("RUSTC_BOOTSTRAP", "1");
        }
        let output = cargo.output().map_err(|error| format!("cargo does not start: {error}"))?;
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned());
        }
        Ok(())
    }

    /// Unpacks the library's sources, once, and returns their folder.
    fn unpacked(&self, archive: &Path) -> Result<PathBuf, String> {
        let folder = self.folder.join("sources");
        let library = folder.join("library");
        // The last file to be written says that all are there.
        let done = folder.join("unpacked");
        if !done.exists() {
            let failed = |error: io::Error| format!("{}: {error}", folder.display());
            std::fs::create_dir_all(&folder).map_err(failed)?;
            let tar = Command::new("tar").arg("-xJf").arg(archive).arg("-C").arg(&folder).output().map_err(failed)?;
            if !tar.status.success() || !library.is_dir() {
                return Err(format!("{}: {}", archive.display(), String::from_utf8_lossy(&tar.stderr)));
            }
            std::fs::write(&done, "").map_err(failed)?;
        }
        Ok(library)
    }

    /// Runs a program to its end and returns what it printed.
    ///
    /// # Errors
    /// If it does not end, or ends with a failure.
    pub fn run(&self, program: &Path) -> Result<String, String> {
        let mut machine = self.machine(program);
        machine.stdout(Stdio::piped());
        let text = supervised(machine, |child| child.stdout.take(), io::read_to_string)?;
        text.map_err(|error| format!("{}: {error}", program.display()))
    }

    /// Runs a program to its end and returns what its measured calls took.
    ///
    /// # Errors
    /// As [`Emulator::run`], or if the trace is not what it should be.
    pub fn trace(&self, program: &Path, image: &Image) -> Result<Vec<Call>, String> {
        let mut machine = self.machine(program);
        // The instructions of a block once, and each run of it with the registers before it.
        machine.args(["-d", "in_asm,exec,cpu,nochain"]);
        // The trace would go to the standard error otherwise, which has no buffer: that takes thirty times as long.
        machine.args(["-D", "/dev/stdout"]).stdout(Stdio::piped());
        let registers = self.board.registers;
        let read = |stream| trace::calls(io::BufReader::with_capacity(1 << 20, stream), registers, image);
        supervised(machine, |child| child.stdout.take(), read)?
    }

    /// The board with a program in it.
    fn machine(&self, program: &Path) -> Command {
        let name = program.file_name().unwrap_or_default().to_string_lossy();
        let mut machine = Command::new(self.board.emulator);
        machine
            .args(self.board.machine(&name))
            .args(["-nographic", "-monitor", "none", "-serial", "none"])
            .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
            .arg(program)
            .stdin(Stdio::null());
        machine
    }
}

impl Library {
    fn find(target: &str) -> Result<Library, String> {
        let libraries = PathBuf::from(asked("rustc", &["--print", "target-libdir", "--target", target])?);
        if libraries.is_dir() {
            return Ok(Library::Installed);
        }
        let root = PathBuf::from(asked("rustc", &["--print", "sysroot"])?);
        if root.join("lib/rustlib/src/rust/library/core").is_dir() {
            return Ok(Library::Component);
        }
        match std::env::var_os(SOURCES).map(PathBuf::from) {
            Some(folder) if folder.join("core").is_dir() => Ok(Library::Sources(folder)),
            Some(archive) if archive.is_file() => Ok(Library::Archive(archive)),
            Some(other) => Err(format!("{SOURCES}: no sources in {}", other.display())),
            None => Err(format!("no Rust library for {target}")),
        }
    }
}

/// The first line of what a program answers.
fn asked(program: &str, arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(program).args(arguments).output().map_err(|error| format!("no {program}: {error}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines().next().map(str::to_owned).ok_or_else(|| format!("{program} says nothing"))
}

/// Runs a command to its end, reading one of its streams meanwhile.
fn supervised<Stream: Send, T: Send>(
    mut command: Command,
    stream: impl FnOnce(&mut Child) -> Option<Stream>,
    read: impl FnOnce(Stream) -> T + Send,
) -> Result<T, String> {
    let mut child = command.spawn().map_err(|error| format!("the emulator does not start: {error}"))?;
    let stream = stream(&mut child).ok_or("the stream is not there")?;
    let (status, text) = std::thread::scope(|scope| {
        let reader = scope.spawn(|| read(stream));
        let status = patience::end(&mut child).map(|status| status.success());
        (status, reader.join())
    });
    match (status, text) {
        (Ok(true), Ok(text)) => Ok(text),
        (Ok(_), _) => Err("the program says that it failed".into()),
        (Err(error), _) => Err(error.to_string()),
    }
}
