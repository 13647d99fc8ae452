//! `viewfuse view`: who may ask, what is answered, and the page in a browser that is driven as a hand does it.
//!
//! ```text
//! attacks    the server, by programs that mean ill
//! devtools   a browser that is driven
//! requests   the server, by requests alone
//! page       the page: what a person does and sees
//! moves      pictures while dragging, and that memory does not grow
//! one_file   a scene of Gaussians as one page
//! ```
//!
//! The browser is that of `report.rs`: without one its tests are ignored and say why; with `VIEWFUSE_REQUIRE_BROWSER=1`
//! they fail instead. Pictures of the page, to be looked at, are left in `tmp/view` of the target folder.
#![cfg(unix)]

mod attacks;
mod devtools;
mod moves;
mod one_file;
mod page;
mod requests;

use super::BINARY;
use devtools::Tab;
use std::fs;
use std::path::Path;
use viewfuse_tests::places::repository;
use viewfuse_tests::viewer::Program;

viewfuse_tests::trials![[attacks, moves, one_file, page, requests];];

/// The viewer on the CPU.
#[track_caller]
fn start(folder: &Path, arguments: &str) -> Program {
    Program::start(BINARY, "cpu", folder, arguments)
}

/// The room, from the repository's root.
#[track_caller]
fn room(more: &str) -> Program {
    start(&repository(), &format!("tests/data/room {more}"))
}

/// Whether a picture came since [`NOTE_PICTURES`]: a coarse one, or at once a full one where those take no longer.
const FOLLOWED: &str = "Number(document.getElementById('picture').dataset.pictures) > window.notedPictures";
const NOTE_PICTURES: &str = "window.notedPictures = Number(document.getElementById('picture').dataset.pictures)";
const WEIGHTS: &str = "[...document.querySelectorAll('#sources output')].map((own) => Number(own.dataset.weight))";
const COUNT: &str = "Number(document.getElementById('picture').dataset.pictures)";

/// The weights on the page, which sum to 1.
#[track_caller]
fn weights(tab: &Tab<'_>) -> Vec<f64> {
    let bars = "[...document.querySelectorAll('.bar span')].map((own) => parseFloat(own.style.width))";
    let sum = "document.getElementById('sum').textContent";
    let seen = tab.evaluate(&format!("({{weights: {WEIGHTS}, sum: {sum}, bars: {bars}}})"));
    let weights = super::numbers(&seen["weights"]);
    super::assert_near(weights.iter().sum(), 1.0, 1.0e-5);
    assert_eq!(seen["sum"], "1.000");
    // Bars are as long as the weights are large.
    let longest = weights.iter().copied().fold(0.0, f64::max);
    for (bar, weight) in super::numbers(&seen["bars"]).into_iter().zip(&weights) {
        super::assert_near(bar, 100.0 * weight / longest, 0.01);
    }
    weights
}

/// Leaves a picture of the window to be looked at.
fn keep(tab: &Tab<'_>, name: &str) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("view");
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join(name), tab.picture()).expect("a picture");
}
