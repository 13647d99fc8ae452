//! Running the command `viewfuse` as a person does: in a folder, looking at what it prints, returns and leaves behind.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::patience;
use crate::places::data;
use crate::scenes::Folder;

/// What a command printed and returned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error, without lines of progress: whether there are any depends on how busy the machine is.
    pub stderr: String,
}

impl Outcome {
    /// Runs a command to its end.
    pub fn of(mut command: Command) -> Outcome {
        let output = command.output().expect("the command starts");
        let text = |bytes| String::from_utf8(bytes).expect("the command prints UTF-8");
        let stderr = without_progress(&text(output.stderr));
        Outcome { code: output.status.code(), stdout: text(output.stdout), stderr }
    }
}

/// What was said on standard error beside lines of progress.
pub fn without_progress(said: &str) -> String {
    said.split_inclusive('\n').filter(|line| !line.starts_with("progress: ")).collect()
}

/// The command, ready to be started in a folder with arguments that are separated by blanks.
pub fn command(binary: &str, folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(binary);
    command.current_dir(folder).args(arguments.split_whitespace()).stdin(Stdio::null());
    command
}

/// Runs the command to its end.
pub fn run(binary: &str, folder: &Path, arguments: &str) -> Outcome {
    Outcome::of(command(binary, folder, arguments))
}

/// Runs the command, which must succeed and say nothing on standard error (no progress bar either: it is no terminal).
/// Returns what it printed.
#[track_caller]
pub fn done(binary: &str, folder: &Path, arguments: &str) -> String {
    let outcome = run(binary, folder, arguments);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""), "viewfuse {arguments}\n{}", outcome.stdout);
    outcome.stdout
}

/// Starts the command and kills it without a warning as soon as `ready` holds; it must not end before.
#[track_caller]
pub fn killed_when(binary: &str, folder: &Path, arguments: &str, ready: impl FnMut() -> bool) {
    let mut child = unheard(command(binary, folder, arguments));
    patience::wait_while_running(&mut child, ready);
    child.kill().expect("a process to kill");
    child.wait().expect("a dead process");
}

/// Starts a command whose output nobody reads.
#[track_caller]
pub fn unheard(mut command: Command) -> Child {
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the command starts")
}

/// Starts a command whose output is kept.
#[track_caller]
pub fn spawn(mut command: Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the command starts")
}

/// Resident memory of a process in KiB; 0 where the system does not say it, and after its end.
pub fn resident_kib(process: u32) -> u64 {
    let text = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let size = text.lines().find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB")?.parse().ok());
    size.unwrap_or(0)
}

/// Sends a signal such as `-INT` to a command, which must end by it, say so, and print nothing more.
#[track_caller]
pub fn interrupt(mut child: Child, signal: &str) {
    patience::send(signal, &child);
    patience::end(&mut child).unwrap_or_else(|error| panic!("{signal} does not end the command: {error}"));
    let result = child.wait_with_output().expect("its output");
    let said = without_progress(&String::from_utf8_lossy(&result.stderr));
    assert_eq!(
        (result.status.code(), said.as_str()),
        (Some(130), "viewfuse: interrupted; nothing half-written is left behind\n")
    );
    assert_eq!(String::from_utf8_lossy(&result.stdout), "");
}

/// The job must fail: exit code 1, one line on standard error with every part, nothing on standard output, and the
/// folder as it was.
#[track_caller]
pub fn assert_refused(binary: &str, folder: &Path, arguments: &str, parts: &[&str]) {
    assert_command_refused(command(binary, folder, arguments), folder, parts);
}

/// The same for a command that was made with [`command`] and changed.
#[track_caller]
pub fn assert_command_refused(command: Command, folder: &Path, parts: &[&str]) {
    let before = files_below(folder);
    let arguments = command.get_args().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ");
    let Outcome { code, stdout, stderr } = Outcome::of(command);
    assert_eq!(code, Some(1), "viewfuse {arguments}\n{stderr}");
    let message = stderr.strip_prefix("viewfuse: ").and_then(|rest| rest.strip_suffix('\n')).unwrap_or_default();
    assert!(!message.is_empty() && !message.contains('\n') && message.len() < 500, "viewfuse {arguments}\n{stderr}");
    for part in parts {
        assert!(message.contains(part), "viewfuse {arguments}\n{message:?} does not hold {part:?}");
    }
    let pieces: Vec<&str> = message.split(": ").collect();
    assert!(pieces.windows(2).all(|pair| pair[0] != pair[1]), "said twice: {message:?}");
    assert_eq!(stdout, "", "viewfuse {arguments}");
    assert_eq!(files_below(folder), before, "viewfuse {arguments} left something behind");
}

/// The arguments must be refused: exit code 2, every part in the first line of standard error, and the folder as it
/// was.
#[track_caller]
pub fn assert_wrong_arguments(binary: &str, folder: &Path, arguments: &str, parts: &[&str]) {
    let before = files_below(folder);
    let Outcome { code, stdout, stderr } = run(binary, folder, arguments);
    assert_eq!((code, stdout.as_str()), (Some(2), ""), "viewfuse {arguments}\n{stderr}");
    let line = stderr.lines().next().unwrap_or_default();
    for part in parts {
        assert!(line.contains(part), "viewfuse {arguments}\n{line:?} does not hold {part:?}");
    }
    assert_eq!(files_below(folder), before, "viewfuse {arguments} left something behind");
}

/// Every file and folder below a folder, hidden ones too, with its length; sorted.
pub fn files_below(folder: &Path) -> Vec<(PathBuf, u64)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let is_folder = path.is_dir();
        // A link to nothing has no length.
        found.push((path.clone(), if is_folder { 0 } else { fs::metadata(&path).map_or(0, |file| file.len()) }));
        if is_folder {
            found.extend(files_below(&path));
        }
    }
    found.sort();
    found
}

/// Names of the files in a folder, hidden ones too, sorted.
pub fn names_in(folder: &Path) -> Vec<String> {
    let name = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
    let mut names: Vec<String> =
        fs::read_dir(folder).expect("a folder").map(|entry| name(entry.expect("an entry"))).collect();
    names.sort();
    names
}

/// A folder that holds a copy of the sample scene as `toy`.
pub fn toy() -> Folder {
    sample("toy")
}

/// A folder with two scenes: a copy of the sample scene `toy`, and another one, `again`.
pub fn toy_twice() -> Folder {
    let (folder, other) = (toy(), toy());
    fs::rename(other.path().join("toy"), folder.path().join("again")).expect("a second scene");
    folder
}

/// A folder that holds a copy of a sample scene under its name.
pub fn sample(name: &str) -> Folder {
    let folder = Folder::new();
    let sample = data(name);
    for (path, _) in files_below(&sample).into_iter().filter(|(path, _)| path.is_file()) {
        let inside = path.strip_prefix(&sample).expect("a file of the sample");
        fs::copy(&path, folder.file(&Path::new(name).join(inside).to_string_lossy())).expect("a copy");
    }
    folder
}

/// Rewrites every pose of the sample scene: `change` gets the view's number and the row-major camera-to-world matrix.
pub fn change_poses(folder: &Folder, change: impl Fn(usize, &mut [f64; 16])) {
    for name in names_in(&folder.path().join("toy/pose")) {
        let file = format!("toy/pose/{name}");
        let text = fs::read_to_string(folder.path().join(&file)).expect("a pose");
        let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
        let mut matrix: [f64; 16] = numbers.try_into().expect("16 numbers");
        change(name.trim_end_matches(".txt").parse().expect("a number"), &mut matrix);
        folder.write(&file, crate::scenes::words(&matrix));
    }
}

/// Bytes of `f32` numbers as safetensors stores them.
pub fn f32_bytes(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

/// A safetensors file of tensors given by name, type as the format writes it (`F32`), shape and bytes.
pub fn safetensors(tensors: &[(&str, &str, &[usize], Vec<u8>)]) -> Vec<u8> {
    let mut header = serde_json::Map::new();
    let mut data: Vec<u8> = Vec::new();
    for (name, dtype, shape, bytes) in tensors {
        let offsets = [data.len(), data.len() + bytes.len()];
        header.insert((*name).to_owned(), serde_json::json!({"dtype": dtype, "shape": shape, "data_offsets": offsets}));
        data.extend(bytes);
    }
    let header = serde_json::Value::Object(header).to_string();
    // The data starts at a multiple of 8.
    let length = header.len().next_multiple_of(8);
    crate::checkpoints::safetensors(&format!("{header:length$}"), &data)
}
