//! The page's files, which are part of the program.

use viewfuse_output::scripts::{BASE_STYLE, COLOURS, HANDS, ORBITS, OUTLINES, POSES, SEEN, SHARES, Script, VECTORS};

/// A file that the page consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PageFile {
    /// Its address below the token; empty for the page itself.
    pub(crate) name: &'static str,
    /// Its media type.
    pub(crate) media_type: &'static str,
    /// Its content.
    pub(crate) text: &'static str,
}

const fn script(name: &'static str, text: &'static str) -> PageFile {
    PageFile { name, media_type: "text/javascript; charset=utf-8", text }
}

const fn style(name: &'static str, text: &'static str) -> PageFile {
    PageFile { name, media_type: "text/css; charset=utf-8", text }
}

/// A script that pages share.
const fn shared(source: Script) -> PageFile {
    script(source.name, source.text)
}

/// All of them. Scripts are modules in the order of their imports.
pub(crate) const FILES: [PageFile; 29] = [
    PageFile { name: "", media_type: "text/html; charset=utf-8", text: include_str!("../page/index.html") },
    style("base.css", BASE_STYLE),
    style("view.css", include_str!("../page/view.css")),
    shared(VECTORS),
    shared(POSES),
    shared(COLOURS),
    shared(OUTLINES),
    shared(SHARES),
    shared(ORBITS),
    shared(HANDS),
    shared(SEEN),
    script("canvas.js", include_str!("../page/canvas.js")),
    script("state.js", include_str!("../page/state.js")),
    script("frusta.js", include_str!("../page/frusta.js")),
    script("picture.js", include_str!("../page/picture.js")),
    script("map.js", include_str!("../page/map.js")),
    script("sources.js", include_str!("../page/sources.js")),
    script("schemes.js", include_str!("../page/schemes.js")),
    script("rotations.js", include_str!("../page/rotations.js")),
    script("path.js", include_str!("../page/path.js")),
    script("files.js", include_str!("../page/files.js")),
    script("elsewhere.js", include_str!("../page/elsewhere.js")),
    script("keyframes.js", include_str!("../page/keyframes.js")),
    script("answers.js", include_str!("../page/answers.js")),
    script("requests.js", include_str!("../page/requests.js")),
    script("video.js", include_str!("../page/video.js")),
    script("hand.js", include_str!("../page/hand.js")),
    script("work.js", include_str!("../page/work.js")),
    script("view.js", include_str!("../page/view.js")),
];

#[cfg(test)]
mod tests {
    use super::{COLOURS, FILES, HANDS, ORBITS, OUTLINES, POSES, SEEN, SHARES, VECTORS};
    use std::collections::BTreeSet;

    /// Most lines of a file of the page.
    const MAX_LINES: usize = 250;

    #[test]
    fn the_page_refers_to_its_own_files_only() {
        let html = FILES[0].text;
        for attribute in ["src=\"", "href=\""] {
            for rest in html.split(attribute).skip(1) {
                let target = rest.split('"').next().unwrap_or_default();
                assert!(target == "data:," || FILES[1..].iter().any(|file| file.name == target), "{target}");
            }
        }
        assert!(!html.contains("style=\"") && !html.contains(" onclick"), "the content security policy forbids both");
        assert!(FILES.iter().all(|file| !file.text.contains("https://")), "an address outside");
    }

    #[test]
    fn every_file_of_the_folder_is_part_of_the_page_and_short() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/page");
        let entries = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("a file").file_name());
        let mut there: BTreeSet<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
        let scripts = [VECTORS, POSES, COLOURS, OUTLINES, SHARES, ORBITS, HANDS, SEEN].map(|script| script.name);
        for name in scripts.into_iter().chain(["base.css"]) {
            assert!(there.insert(name.to_owned()), "{name} is shared and there");
        }
        let served = FILES.iter().map(|file| if file.name.is_empty() { "index.html" } else { file.name });
        assert_eq!(there, served.map(str::to_owned).collect());
        for file in FILES {
            let lines = file.text.lines().count();
            assert!(lines <= MAX_LINES, "{}: {lines} lines", file.name);
        }
    }

    /// A module imports only from those before it, and only what it uses.
    #[test]
    fn modules_import_from_those_before_them() {
        for (place, file) in FILES.iter().enumerate().filter(|(_, file)| file.name.ends_with(".js")) {
            for line in file.text.lines().filter(|line| line.starts_with("import ")) {
                let (names, from) = line.split_once(" } from './").unwrap_or_else(|| panic!("{line}"));
                let from = from.strip_suffix("';").expect("the end of an import");
                let before = FILES[..place].iter().find(|other| other.name == from);
                let before = before.unwrap_or_else(|| panic!("{} imports {from}", file.name));
                for name in names.trim_start_matches("import { ").split(", ") {
                    let exports = ["function", "async function", "const"].map(|kind| format!("export {kind} {name}"));
                    let is_there = exports.iter().any(|export| {
                        before.text.split(export.as_str()).skip(1).any(|rest| rest.starts_with(['(', ' ']))
                    });
                    assert!(is_there, "{from} does not export {name}, which {} imports", file.name);
                    let words = file.text.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_');
                    assert!(words.filter(|word| *word == name).count() > 1, "{} does not use {name}", file.name);
                }
            }
        }
    }
}
