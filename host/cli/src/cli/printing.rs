//! What the command prints: results on standard output, errors and progress on standard error. This is the one way out:
//! nothing from a file controls the terminal.

use super::shown::{shown, shown_in_line};
use std::fmt::Display;
use std::io::{self, IsTerminal, StdoutLock, Write};
use terminal_size::{Width, terminal_size_of};
use viewfuse_scene::Scene;

/// Goes to the beginning of the line and clears it.
const CLEAR: &str = "\r\u{1b}[2K";
/// Columns of a terminal that does not tell.
const WIDTH: u16 = 80;

/// Prints a line on standard output. A closed pipe (`| head`) is ignored, because the files are still to be written.
///
/// # Errors
/// If standard output cannot be written for another reason.
pub fn say(text: impl Display) -> io::Result<()> {
    match writeln!(io::stdout().lock(), "{}", shown(text)) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        outcome => outcome,
    }
}

/// `1 target`, `2 targets`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Standard output for what is no message: a script, a video.
pub(crate) fn data_out() -> StdoutLock<'static> {
    io::stdout().lock()
}

/// Prints an error in one line on standard error, which may be full or closed: what went wrong is in the exit code,
/// too.
pub(crate) fn complain(message: impl Display) {
    let _ = writeln!(io::stderr().lock(), "viewfuse: {}", shown_in_line(message));
}

/// Says the warnings of a scene: what of its files is not used.
pub(crate) fn warn_of(scene: &Scene) {
    scene
        .warnings
        .iter()
        .chain(&scene.pose_warnings())
        .for_each(|warning| complain(format_args!("warning: {warning}")));
}

/// Prints what is wrong with the arguments, which takes several lines.
pub(crate) fn complain_of_arguments(message: impl Display) {
    let _ = write!(io::stderr().lock(), "{}", shown(message));
}

/// Whether a message is shown as it is.
pub(crate) fn is_harmless(message: impl Display) -> bool {
    let message = message.to_string();
    shown(&message) == message
}

/// Whether standard error, where progress goes, is a terminal.
pub(crate) fn has_terminal() -> bool {
    io::stderr().is_terminal()
}

/// Columns of the terminal.
pub(crate) fn width() -> u16 {
    terminal_size_of(io::stderr()).map_or(WIDTH, |(Width(width), _)| width)
}

/// Prints a line of progress. A closed pipe is ignored.
pub(crate) fn progress_line(line: impl Display) {
    let _ = writeln!(io::stderr().lock(), "{}", shown_in_line(line));
}

/// Replaces the terminal's last line, without going to the next one; by nothing it is cleared.
pub(crate) fn draw(line: impl Display) {
    let _ = write!(io::stderr().lock(), "{CLEAR}{}", shown_in_line(line));
}
