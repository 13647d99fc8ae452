//! How soon the viewer shows something: `cargo bench -p viewfuse-cli --bench view [-- SECONDS]`.
//!
//! Starts `viewfuse view` on the CPU for both sample scenes, and for Gaussians of one of them, and asks as the page
//! does while a hand drags: the time from the start of the program to the first coarse picture, then coarse pictures a
//! second, each asked for once the one before has come, and their sizes; `late means coarser` shows there. The viewer
//! aims at a first picture within 1 s and ten a second on two cores, of Gaussians at thirty.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use viewfuse_tests::command::done;
use viewfuse_tests::places::repository;
use viewfuse_tests::viewer::{Program, request};

const BINARY: &str = env!("CARGO_BIN_EXE_viewfuse");

fn main() {
    // Cargo hands over arguments of its own as well.
    let seconds = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(5);
    println!("scene: seconds to the first picture, pictures a second, how many of each size");
    let folder = tempfile::tempdir().expect("a folder");
    let gaussians = format!("tests/data/room --gaussians {}", folder.path().join("room.ply").display());
    let optimise = gaussians.replacen("tests/data/room --gaussians", "optimise tests/data/room -o", 1);
    done(BINARY, &repository(), &optimise);
    for scene in ["tests/data/room", "tests/data/toy", &gaussians] {
        let start = Instant::now();
        let program = Program::start(BINARY, "cpu", &repository(), scene);
        let found = program.scene();
        let home = found["start"].clone();
        let mut connection = program.connect();
        let mut ask = |pose: &Value| {
            let mut request = request("bench", pose, true);
            request["side"] = found["moving_side"].clone();
            connection.picture(&request).unpacked().1.dimensions()
        };
        ask(&home);
        let first = start.elapsed().as_secs_f64();
        let (start, mut sizes) = (Instant::now(), BTreeMap::<(u32, u32), u32>::new());
        for step in 1.. {
            // To and fro: every picture is a new one.
            let mut pose = home.clone();
            pose[0][3] = json!(home[0][3].as_f64().unwrap_or(0.0) + 0.05 * (f64::from(step) / 10.0).sin());
            *sizes.entry(ask(&pose)).or_default() += 1;
            if start.elapsed() >= Duration::from_secs(seconds) {
                break;
            }
        }
        let count: u32 = sizes.values().sum();
        println!("{scene}: {first:.2}, {:.1}, {sizes:?}", f64::from(count) / start.elapsed().as_secs_f64());
    }
}
