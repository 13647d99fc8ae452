//! Outputs that would replace inputs are refused before work begins: files that options name by [`keep_inputs`], for
//! all commands at once, what scenes are read from by the commands that open them.

use super::wrong::wrong;
use clap::{Arg, ArgMatches, Command};
use std::ffi::{OsStr, OsString};
use std::fs::{File, canonicalize};
use std::io::Read;
use std::path::Path;
use viewfuse_job::shell::quoted;
use viewfuse_output::video::VideoFormat;
use viewfuse_scene::Scene;

/// How files that viewfuse writes name it, and within how many bytes: by their extensions, and all others.
const MARKS: [(&str, &[u8]); 2] =
    [("ply", b"\ncomment viewfuse\n"), ("html", b"name=\"generator\" content=\"viewfuse")];
const MARK: &[u8] = b"viewfuse";
const BEGINNING: u64 = 64 << 10;
/// Most bytes of a file that is compared with what takes its place.
const MAX_COMPARED: u64 = 64 << 20;

/// The options that name what a command writes, by identifier. All others may name what it reads.
const WRITTEN: [&str; 3] = ["output", "npy", "matches"];

/// Refuses a command whose output is a file that another of its options names, whichever that is: alone, or within a
/// value such as `attention:FILE` or `alex=FILE,heads=FILE`.
pub(super) fn keep_inputs(command: &Command, matches: &ArgMatches) -> anyhow::Result<()> {
    let Some((name, matches)) = matches.subcommand() else { return Ok(()) };
    let arguments = command.find_subcommand(name).into_iter().flat_map(Command::get_arguments);
    let values = |argument: &Arg| -> Vec<OsString> {
        let values = matches.try_get_raw(argument.get_id().as_str()).ok().flatten();
        values.into_iter().flatten().map(OsStr::to_os_string).collect()
    };
    let (written, read): (Vec<&Arg>, Vec<&Arg>) =
        arguments.partition(|argument| WRITTEN.contains(&argument.get_id().as_str()));
    let inputs: Vec<OsString> = read.into_iter().flat_map(values).flat_map(|value| parts(&value)).collect();
    for output in written.into_iter().flat_map(values).filter(|output| Path::new(output).is_file()) {
        inputs.iter().try_for_each(|input| keep_input(Path::new(input), Path::new(&output)))?;
    }
    Ok(())
}

/// What may be a path in a value: all of it, and what stands between the separators of lists and of keys.
fn parts(value: &OsStr) -> Vec<OsString> {
    let Some(text) = value.to_str() else { return vec![value.to_os_string()] };
    let behind = |(place, _): (usize, &str)| &text[place + 1..];
    let beginnings = [text].into_iter().chain(text.match_indices(['=', ':', ',']).map(behind));
    let up_to_commas = |from: &str| -> Vec<OsString> {
        let commas = from.match_indices(',').map(|(place, _)| place).chain([from.len()]);
        commas.map(|end| OsString::from(&from[..end])).collect()
    };
    beginnings.flat_map(up_to_commas).collect()
}

/// Refuses a folder for pictures that one of the scenes is read from.
pub(super) fn keep_folder_apart<'a>(scenes: impl IntoIterator<Item = &'a Scene>, folder: &Path) -> anyhow::Result<()> {
    match scenes.into_iter().find(|scene| scene.reads_folder(folder)) {
        Some(scene) => Err(inside(scene, folder, "folder")),
        None => Ok(()),
    }
}

/// Refuses the name of a file, by its extension, for a folder of pictures that is not there yet: it would become the
/// folder's.
pub(super) fn refuse_file(folder: &Path) -> anyhow::Result<()> {
    const FILES: [&str; 12] = ["mp4", "webp", "gif", "y4m", "mov", "mkv", "avi", "webm", "png", "jpg", "jpeg", "exr"];
    let extension = folder.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if folder.is_dir() || !FILES.contains(&extension.as_str()) {
        return Ok(());
    }
    let (path, stem) = (folder.display(), folder.with_extension(""));
    let video = VideoFormat::ALL.iter().map(VideoFormat::to_string).find(|format| *format == extension);
    let way = match video {
        Some(format) => {
            format!(
                "--output {} --video {format} writes {}",
                quoted(&stem),
                stem.join(format!("video.{format}")).display()
            )
        }
        None => format!("--output {} is one", quoted(&stem)),
    };
    Err(wrong(format_args!("--output {path}: is the name of a file, and pictures go to a folder; {way}")))
}

/// Refuses a file whose name says that it holds something else than what is written: `what`, whose names end in one of
/// `extensions`. A name without an extension says nothing.
///
/// # Errors
/// That of wrong arguments.
pub fn refuse_extension(file: &Path, what: &str, extensions: &[&str]) -> anyhow::Result<()> {
    let Some(given) = file.extension() else { return Ok(()) };
    if extensions.iter().any(|extension| given.eq_ignore_ascii_case(extension)) {
        return Ok(());
    }
    let better = file.with_extension(extensions[0]);
    Err(wrong(format_args!("--output {}: {what} is written; give a name as {}", file.display(), quoted(&better))))
}

/// Refuses to replace a file in whose beginning nothing says that viewfuse wrote it: a scan, or another program's
/// Gaussians. Files without a header, as `.splat`, say nothing, and are not replaced.
///
/// # Errors
/// That of wrong arguments.
pub fn keep_others(output: &Path) -> anyhow::Result<()> {
    let mut beginning = Vec::new();
    // Whether it can be read or replaced is asked where it is written.
    let _ = File::open(output).and_then(|file| file.take(BEGINNING).read_to_end(&mut beginning));
    let has_extension = |known: &str| output.extension().is_some_and(|given| given.eq_ignore_ascii_case(known));
    let mark = MARKS.iter().find(|(extension, _)| has_extension(extension)).map_or(MARK, |(_, mark)| mark);
    let says_so = || beginning.windows(mark.len()).any(|part| part.eq_ignore_ascii_case(mark));
    match beginning.is_empty() || !has_extension("splat") && says_so() {
        true => Ok(()),
        false if has_extension("splat") => Err(foreign(output, "is there, a .splat does not say who wrote it")),
        false => Err(foreign(output, "was not written by viewfuse")),
    }
}

/// Refuses to replace a file that is not of the kind of `contents`, for what names nobody: `is_alike` says of two files
/// of this kind that they are.
pub(super) fn keep_unlike(
    output: &Path,
    contents: &[u8],
    is_alike: impl Fn(&[u8], &[u8]) -> bool,
) -> anyhow::Result<()> {
    let mut there = Vec::new();
    let _ = File::open(output).and_then(|file| file.take(MAX_COMPARED).read_to_end(&mut there));
    match there.is_empty() || is_alike(&there, contents) {
        true => Ok(()),
        false => Err(foreign(output, "holds something else")),
    }
}

/// Refuses to replace a file that does not begin as viewfuse's own tables do.
pub(super) fn keep_others_than(output: &Path, own: &str) -> anyhow::Result<()> {
    let mut beginning = Vec::new();
    let _ = File::open(output).and_then(|file| file.take(own.len() as u64).read_to_end(&mut beginning));
    match beginning.is_empty() || beginning == own.as_bytes() {
        true => Ok(()),
        false => Err(foreign(output, "was not written by viewfuse")),
    }
}

/// Refuses to replace a file, because it is `what`.
pub(super) fn foreign(output: &Path, what: &str) -> anyhow::Error {
    wrong(format_args!("{}: {what}, and would be replaced; give another name, or move it", output.display()))
}

/// Refuses a file that one of the scenes is read from, or would be.
pub(super) fn keep_file_apart<'a>(scenes: impl IntoIterator<Item = &'a Scene>, file: &Path) -> anyhow::Result<()> {
    match scenes.into_iter().find(|scene| scene.reads_file(file)) {
        Some(scene) => Err(inside(scene, file, "file")),
        None => Ok(()),
    }
}

fn inside(scene: &Scene, path: &Path, what: &str) -> anyhow::Error {
    let (path, scene) = (path.display(), scene.path.display());
    wrong(format_args!("{path}: the scene {scene} is read from this {what}; give another {what}"))
}

/// Refuses an output that is the input itself, under any spelling.
///
/// # Errors
/// That of wrong arguments.
pub fn keep_input(input: &Path, output: &Path) -> anyhow::Result<()> {
    if !is_same(input, output) {
        return Ok(());
    }
    let (input, output) = (input.display(), output.display());
    Err(wrong(format_args!("{output}: is the input {input} itself, which is not replaced; give another name")))
}

/// Whether two paths, under any spelling, are those of one file that is there.
pub(crate) fn is_same(a: &Path, b: &Path) -> bool {
    canonicalize(a).is_ok_and(|a| canonicalize(b).is_ok_and(|b| a == b))
}

#[cfg(test)]
mod tests {
    use super::{WRITTEN, parts};
    use clap::CommandFactory;
    use std::any::TypeId;
    use std::path::PathBuf;

    /// What the others name: files and folders that are read.
    const READ: &str = "photographs scene scenes gaussians camera_path files resume fid prediction truth input help \
                        version";

    /// Whoever adds an option for a path says here whether it is read or written.
    #[test]
    fn every_path_is_read_or_written() {
        let command = crate::cli::Arguments::command();
        let arguments =
            command.get_subcommands().flat_map(|within| within.get_arguments().map(move |one| (within, one)));
        let is_path = |argument: &clap::Arg| argument.get_value_parser().type_id() == TypeId::of::<PathBuf>();
        let mut count = 0;
        for (command, argument) in arguments.filter(|(_, argument)| is_path(argument)) {
            let id = argument.get_id().as_str();
            assert!(WRITTEN.contains(&id) != READ.split(' ').any(|read| read == id), "{}: {id}", command.get_name());
            count += 1;
        }
        assert!(count > 25, "{count} paths");
    }

    #[test]
    fn paths_are_found_within_values() {
        let has = |value: &str, path: &str| parts(value.as_ref()).iter().any(|part| part == path);
        for (value, path) in [
            ("p.csv", "p.csv"),
            ("attention:a.safetensors", "a.safetensors"),
            ("cars=attention:a=b/c:d", "a=b/c:d"),
            ("alex=a,b.pth,heads=c.pt", "a,b.pth"),
            ("alex=a.pth,heads=c.pt", "c.pt"),
        ] {
            assert!(has(value, path), "{value}: {:?}", parts(value.as_ref()));
        }
    }
}
