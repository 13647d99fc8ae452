//! Scripts and the style that pages share: modules of JavaScript, each of one responsibility, which import one another
//! by name. The viewer serves them as files; a page that is one file has them joined.

/// A module: its file's name, and its text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Script {
    /// The name that others import it by, such as `vectors.js`.
    pub name: &'static str,
    /// Its text.
    pub text: &'static str,
}

/// Vectors in the world.
pub const VECTORS: Script = Script { name: "vectors.js", text: include_str!("../page/vectors.js") };
/// Poses.
pub const POSES: Script = Script { name: "poses.js", text: include_str!("../page/poses.js") };
/// Colours of weights.
pub const COLOURS: Script = Script { name: "colours.js", text: include_str!("../page/colours.js") };
/// Outlines of cameras.
pub const OUTLINES: Script = Script { name: "outlines.js", text: include_str!("../page/outlines.js") };
/// The weights of cameras, with bars.
pub const SHARES: Script = Script { name: "shares.js", text: include_str!("../page/shares.js") };
/// Views that turn around a point.
pub const ORBITS: Script = Script { name: "orbits.js", text: include_str!("../page/orbits.js") };
/// Pointers, wheel and keys.
pub const HANDS: Script = Script { name: "hands.js", text: include_str!("../page/hands.js") };

/// How much of a view the photographs show.
pub const SEEN: Script = Script { name: "seen.js", text: include_str!("../page/seen.js") };

/// The style that pages share: colours by day and by night, and what both have.
pub const BASE_STYLE: &str = include_str!("../page/base.css");

/// Modules as one, in the order of their imports: without the imports, and without the word `export`. Their names must
/// differ.
pub(crate) fn joined(scripts: &[Script]) -> String {
    let lines = scripts.iter().flat_map(|script| script.text.lines());
    let kept = lines.filter(|line| !line.starts_with("import "));
    kept.map(|line| format!("{}\n", line.strip_prefix("export ").unwrap_or(line))).collect()
}
