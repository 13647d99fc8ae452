//! What the command prints: results on standard output, errors on standard error. Nothing from a file controls the
//! terminal.

use super::shown::{shown, shown_in_line};
use std::fmt::Display;
use std::io::{self, Write};
use viewfuse_scene::Scene;

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

/// Prints an error in one line on standard error, which may be full or closed: what went wrong is in the exit code,
/// too.
pub(crate) fn complain(message: impl Display) {
    let _ = writeln!(io::stderr().lock(), "viewfuse: {}", shown_in_line(message));
}

/// Says what was left out of a scene.
pub(crate) fn warn_of(scene: &Scene) {
    scene.warnings.iter().for_each(|warning| complain(format_args!("warning: {warning}")));
}

/// Prints what is wrong with the arguments, which takes several lines.
pub(crate) fn complain_of_arguments(message: impl Display) {
    let _ = write!(io::stderr().lock(), "{}", shown(message));
}
