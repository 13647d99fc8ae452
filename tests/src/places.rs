//! Where things are in the repository, whichever package's tests ask.

use std::path::{Path, PathBuf};

/// The repository's root.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests are a folder of the repository").to_path_buf()
}

/// A file or folder of `tests/data`.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

/// The README of the repository, then those of all folders in the order of their paths; not what lies in target
/// folders.
pub fn readmes() -> Vec<PathBuf> {
    fn below(folder: &Path, found: &mut Vec<PathBuf>) {
        let mut entries: Vec<PathBuf> =
            std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
        entries.sort();
        for path in entries {
            let name = path.file_name().unwrap_or_default();
            if path.is_dir() && name != "target" {
                below(&path, found);
            } else if name == "README.md" {
                found.push(path);
            }
        }
    }
    let mut found = vec![repository().join("README.md")];
    for folder in ["core", "vulkan", "host", "tests"] {
        below(&repository().join(folder), &mut found);
    }
    found
}

/// Where the links of a document lead that stay in the repository, by path or by its address; behind `#` the heading.
pub fn links(document: &Path, text: &str) -> Vec<(String, PathBuf, Option<String>)> {
    const OURS: [&str; 2] =
        ["https://github.com/viewfuse/viewfuse/tree/main/", "https://github.com/viewfuse/viewfuse/blob/main/"];
    let resolved = |link: &str| {
        let inside = OURS.iter().find_map(|start| link.strip_prefix(start)).map(|rest| repository().join(rest));
        if inside.is_none() && link.starts_with("https://") {
            return None;
        }
        let target = inside.unwrap_or_else(|| document.with_file_name("").join(link)).display().to_string();
        let (file, heading) =
            target.split_once('#').map_or((&*target, None), |(file, name)| (file, Some(name.to_owned())));
        let file = if link.starts_with('#') { document.to_path_buf() } else { PathBuf::from(file) };
        Some((link.to_owned(), file, heading))
    };
    text.split("](").skip(1).filter_map(|rest| rest.split(')').next()).filter_map(resolved).collect()
}
