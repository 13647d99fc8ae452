//! The names of views that a layout can hold: those that its reader, and others', give back as they were. This is the
//! one place that says so.

use super::Layout;
use crate::scene::check::is_name;

/// Checks that a layout gives a view's name back.
///
/// # Errors
/// What it cannot hold of the name, in words.
pub fn check_name(layout: Layout, name: &str) -> Result<(), String> {
    let is_hidden = name.starts_with('.');
    let has_breaks = name.contains(['\n', '\r']);
    let reason = match layout {
        _ if !is_name(name) => "is no name of a file",
        Layout::Colmap if has_breaks => "has a line break in it",
        // Our own reader gives it back, but that of COLMAP and others end names there.
        Layout::Colmap if name.contains(char::is_whitespace) => {
            "has a blank in it, where other programs end a name of the text form; colmap-binary holds it"
        }
        Layout::Transforms | Layout::Colmap | Layout::ColmapBinary | Layout::Middlebury if name.contains('\\') => {
            "has a backslash in it, which separates folders there"
        }
        Layout::Middlebury if name.contains(char::is_whitespace) => "has a blank in it",
        // Their photographs are those that lie in a folder.
        Layout::Srn | Layout::Llff | Layout::Neus if is_hidden => "begins with a dot, as hidden files do",
        _ => return Ok(()),
    };
    Err(format!("the name {name:?} {reason}"))
}
