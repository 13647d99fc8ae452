//! The way of the data as a picture, `host/data.svg`: one box a crate with what its manifest says of it, a line from each crate to
//! those that build on it. Made from the manifests and the order of the crates, and compared with the file;
//! `VIEWFUSE_WRITE_PICTURE=1` writes it.

use super::crates::ORDER;
use super::{list, packages, text};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use viewfuse_tests::places::repository;

/// Width and height of a box, and from one to the next.
const BOX: [usize; 2] = [262, 68];
const STEP: [usize; 2] = [286, 100];
const MARGIN: usize = 14;
/// Characters of a line of a description.
const LINE: usize = 40;

/// A crate.
#[derive(Clone, Debug)]
struct Crate {
    name: String,
    description: String,
    /// Those of the order that it builds on and that no other of these brings.
    needs: BTreeSet<String>,
    /// How many crates are on the longest way to it.
    level: usize,
    column: usize,
}

/// All that a crate builds on, directly or not, except by one way.
fn reached(all: &BTreeMap<String, BTreeSet<String>>, from: &str, without: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open: Vec<&String> = all[from].iter().filter(|need| *need != without).collect();
    while let Some(need) = open.pop() {
        if found.insert(need.clone()) {
            open.extend(&all[need]);
        }
    }
    found
}

/// The crates of the order, each with its place.
fn crates(all: &BTreeMap<String, BTreeSet<String>>, descriptions: &BTreeMap<String, String>) -> Vec<Crate> {
    let mut placed: Vec<Crate> = Vec::new();
    for name in ORDER.iter().filter(|name| all.contains_key(**name)) {
        let is_direct = |need: &&String| !reached(all, name, need).contains(*need);
        let level_of = |need: &String| placed.iter().find(|own| own.name == *need).map_or(0, |own| own.level + 1);
        let level = all[*name].iter().map(level_of).max().unwrap_or(0);
        placed.push(Crate {
            name: (*name).to_owned(),
            description: descriptions[*name].clone(),
            needs: all[*name].iter().filter(is_direct).cloned().collect(),
            level,
            column: placed.iter().filter(|own| own.level == level).count(),
        });
    }
    placed
}

/// A description in lines.
fn lines(description: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in description.split_whitespace() {
        match lines.last_mut().filter(|line| line.len() + 1 + word.len() <= LINE) {
            Some(line) => line.push_str(&format!(" {word}")),
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The picture.
fn svg(crates: &[Crate]) -> String {
    let place = |own: &Crate| [MARGIN + own.column * STEP[0], MARGIN + own.level * STEP[1]];
    let side = |value: &dyn Fn(&Crate) -> usize| crates.iter().map(value).max().unwrap_or(0);
    let width = 2 * MARGIN + side(&|own| own.column) * STEP[0] + BOX[0];
    let height = 2 * MARGIN + side(&|own| own.level) * STEP[1] + BOX[1];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         role=\"img\">\n<title>The crates of viewfuse in the order of the data, each below those that it builds on</title>\n\
         <style>\n  rect {{ fill: #ffffff; stroke: #57606a; }}\n  path {{ fill: none; stroke: #8c959f; stroke-width: 1.5; }}\n  \
         text {{ font: 11px system-ui, sans-serif; fill: #424a53; }}\n  .name {{ font: 600 14px system-ui, sans-serif; fill: #1f2328; \
         }}\n  @media (prefers-color-scheme: dark) {{\n    rect {{ fill: #161b22; stroke: #8b949e; }}\n    path {{ stroke: #6e7681; }}\n    \
         text {{ fill: #c9d1d9; }}\n    .name {{ fill: #f0f6fc; }}\n  }}\n</style>\n"
    );
    for own in crates {
        let [x, y] = place(own);
        for need in crates.iter().filter(|other| own.needs.contains(&other.name)) {
            let [from_x, from_y] = place(need);
            let (start, end) = (from_x + BOX[0] / 2, x + BOX[0] / 2);
            let (top, bottom) = (from_y + BOX[1], y);
            let bend = (bottom - top) / 2 + 8;
            writeln!(svg, "<path d=\"M{start} {top}C{start} {} {end} {} {end} {bottom}\"/>", top + bend, bottom - bend)
                .expect("text");
        }
    }
    for own in crates {
        let [x, y] = place(own);
        let name = own.name.strip_prefix("viewfuse-").unwrap_or(&own.name);
        writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" rx=\"6\"/>", BOX[0], BOX[1]).expect("text");
        writeln!(svg, "<text class=\"name\" x=\"{}\" y=\"{}\">{name}</text>", x + 10, y + 19).expect("text");
        for (index, line) in lines(&own.description).iter().enumerate() {
            writeln!(svg, "<text x=\"{}\" y=\"{}\">{line}</text>", x + 10, y + 34 + 13 * index).expect("text");
        }
    }
    svg + "</svg>\n"
}

#[test]
fn the_picture_of_the_crates_is_theirs() {
    let (mut needs, mut descriptions) = (BTreeMap::new(), BTreeMap::new());
    for package in packages().iter().filter(|package| ORDER.contains(&text(package, "name"))) {
        let name = text(package, "name").to_owned();
        let is_own = |need: &&serde_json::Value| need["kind"].is_null() && ORDER.contains(&text(need, "name"));
        let own: BTreeSet<String> =
            list(package, "dependencies").iter().filter(is_own).map(|need| text(need, "name").to_owned()).collect();
        needs.insert(name.clone(), own);
        descriptions.insert(name, text(package, "description").to_owned());
    }
    assert_eq!(needs.len(), ORDER.len());
    let crates = crates(&needs, &descriptions);
    let long: Vec<&Crate> = crates.iter().filter(|own| lines(&own.description).len() > 3).collect();
    assert!(long.is_empty(), "more than three lines: {long:?}");
    let picture = svg(&crates);
    let path = repository().join("host/data.svg");
    if std::env::var_os("VIEWFUSE_WRITE_PICTURE").is_some() {
        std::fs::write(&path, &picture).expect("a picture");
    }
    let stored = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(stored == picture, "{} is stale: VIEWFUSE_WRITE_PICTURE=1 writes it", path.display());
}

#[test]
fn a_crate_stands_below_what_it_builds_on() {
    let set = |names: &[&str]| names.iter().map(|name| format!("viewfuse-{name}")).collect::<BTreeSet<_>>();
    let needs: BTreeMap<String, BTreeSet<String>> =
        [("core", set(&[])), ("job", set(&[])), ("scene", set(&["core", "job"])), ("field", set(&["core", "scene"]))]
            .into_iter()
            .map(|(name, needs)| (format!("viewfuse-{name}"), needs))
            .collect();
    let descriptions = needs.keys().map(|name| (name.clone(), format!("About {name}"))).collect();
    let crates = crates(&needs, &descriptions);
    let places: Vec<(&str, usize, usize)> =
        crates.iter().map(|own| (own.name.as_str(), own.level, own.column)).collect();
    let expected =
        [("viewfuse-core", 0, 0), ("viewfuse-job", 0, 1), ("viewfuse-scene", 1, 0), ("viewfuse-field", 2, 0)];
    assert_eq!(places, expected);
    // That it builds on core is told by scene.
    assert_eq!(crates[3].needs, set(&["scene"]));
    let picture = svg(&crates);
    assert_eq!(picture.matches("<path").count(), 3);
    assert!(picture.contains(">field</text>") && picture.contains(">About viewfuse-field</text>"));
}
