//! How soon the first picture comes, how many follow a hand that drags, and that memory does not grow.
//!
//! Times are those of the machine as it is: where it is free, they are held against what the viewer promises; where others
//! use it, only what the viewer's own processor time is good for.

use super::super::browser::{self, Browser, InBrowser};
use super::super::numbers;
use super::devtools::{Chromium, Tab};
use super::program::{Program, request};
use super::{COUNT, keep, room, weights};
use libtest_mimic::Trial;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use viewfuse_tests::load::{Load, processor_seconds};
use viewfuse_tests::places::repository;
use viewfuse_tests::trials::{needing, trial};

/// So many moves are sent in the tests of memory, unless `VIEWFUSE_VIEW_MOVES` says otherwise.
const MOVES: usize = 400;

/// Pictures a second while dragging, and seconds to the first one, on two free cores.
const PICTURES_A_SECOND: f64 = 10.0;
const FIRST_PICTURE: f64 = 1.0;
const CORES: f64 = 2.0;
/// Largest share of the processors' time that others may take where the machine counts as free.
const FREE: f64 = 0.08;

pub(super) fn trials() -> Vec<Trial> {
    let mut trials = Vec::new();
    let no_count = (!cfg!(target_os = "linux")).then(|| "the system does not say what a process takes".to_owned());
    trials.push(needing(no_count, false, trial("commands::view::memory_does_not_grow", memory_does_not_grow)));
    if cfg!(target_os = "linux") {
        let tests: [(&str, InBrowser); 3] = [
            ("view::browser::pictures_of_the_room_follow_the_hand", pictures_of_the_room_follow_the_hand),
            ("view::browser::pictures_of_the_lorry_follow_the_hand", pictures_of_the_lorry_follow_the_hand),
            ("view::browser::many_moves_of_a_hand_take_no_memory", many_moves_of_a_hand_take_no_memory),
        ];
        trials.extend(browser::trials(tests));
    }
    trials
}

fn moves() -> usize {
    std::env::var("VIEWFUSE_VIEW_MOVES").map_or(MOVES, |text| text.parse().expect("a number of moves"))
}

fn pictures_of_the_room_follow_the_hand(browser: &Browser) {
    pictures_follow_the_hand(browser, "tests/data/room", "160x120", "room.png");
}

fn pictures_of_the_lorry_follow_the_hand(browser: &Browser) {
    pictures_follow_the_hand(browser, "tests/data/toy", "128x128", "lorry.png");
}

/// On the page, from now on: pictures of each size, and how often weights were drawn.
const WATCH: &str = "(() => { drawnSizes = {}; weightsTold = 0; \
    const [drawing, telling] = [drawPicture, tellWeights]; \
    drawPicture = () => { drawing(); const size = shown.size.join('x'); drawnSizes[size] = (drawnSizes[size] || 0) + 1; }; \
    tellWeights = (own, number) => { weightsTold += 1; telling(own, number); }; })()";

/// So long is dragged.
const DRAG: Duration = Duration::from_secs(5);

/// `finest` is the size of the finest coarse pictures.
fn pictures_follow_the_hand(browser: &Browser, scene: &str, finest: &str, kept: &str) {
    let chromium = Chromium::start(browser);
    // A window that is there, as a person's is.
    let tab = chromium.open("about:blank", [1280, 860], false);
    let (load, start) = (Load::begin(&[chromium.id()]), Instant::now());
    let program = Program::start(&repository(), scene);
    tab.call("Page.navigate", json!({"url": program.address()}));
    tab.wait_often_for("document.getElementById('picture')?.dataset.pictures > 0");
    let (first, first_cost) = (start.elapsed().as_secs_f64(), processor_seconds(program.id()));
    let own = [program.id(), chromium.id()];
    let others_at_first = load.others(&own);
    println!(
        "{scene}: first picture {first:.2} s after the start of the program, which took {first_cost:.2} s of processor \
         time; others {:.0} % of the machine",
        100.0 * others_at_first
    );

    // Until the size of coarse pictures no longer changes.
    let place = tab.middle_of("#picture");
    drag_around(&tab, place, Duration::from_secs(2));
    tab.evaluate(WATCH);
    let cost = || own.map(processor_seconds);
    let (before, count, load) = (cost(), tab.number(COUNT), Load::begin(&own));
    let seconds = drag_around(&tab, place, DRAG);
    let count = tab.number(COUNT) - count;
    let (others, after) = (load.others(&own), cost());
    let seen = tab.evaluate("({sizes: drawnSizes, weights: weightsTold})");
    weights(&tab);
    keep(&tab, kept);
    let sizes: BTreeMap<String, f64> = serde_json::from_value(seen["sizes"].clone()).expect("counts");
    let told = seen["weights"].as_f64().expect("a number");
    let [program_cost, browser_cost] = [0, 1].map(|at| (after[at] - before[at]) / count);
    let rate = count / seconds;
    println!(
        "{scene}: {rate:.1} pictures and {:.1} times weights a second, {sizes:?}; a picture took {program_cost:.3} s of the \
         program's and {browser_cost:.3} s of the browser's processor time; others {:.0} % of the machine",
        told / seconds,
        100.0 * others
    );
    assert!(told >= count, "weights were drawn {told} times for {count} pictures");
    let has_cores = std::thread::available_parallelism().is_ok_and(|count| count.get() as f64 >= CORES);
    if has_cores && others_at_first < FREE {
        assert!(first < FIRST_PICTURE, "the first picture came after {first:.2} s");
    }
    if has_cores && others < FREE {
        assert!(rate >= PICTURES_A_SECOND, "{rate:.1} pictures a second");
        let own = sizes.get(finest).copied().unwrap_or(0.0);
        assert!(own > 0.9 * count, "pictures are coarser than {finest}: {sizes:?}");
    }
    // Whoever else is there: on two cores of its own it would be in time.
    assert!(first_cost < CORES * FIRST_PICTURE, "the first picture took {first_cost:.2} s of processor time");
    let most = CORES / PICTURES_A_SECOND;
    assert!(program_cost + browser_cost < most, "a picture took {program_cost:.3} s and {browser_cost:.3} s");
    // Pictures that come late are coarser.
    let coarser: f64 = sizes.iter().filter(|(size, _)| size.as_str() != finest).map(|(_, count)| count).sum();
    assert!(rate >= 0.7 * PICTURES_A_SECOND || coarser > 0.5 * count, "{rate:.1} pictures a second of {sizes:?}");
    assert_eq!(tab.console(), [""; 0]);
}

/// Drags around a place for so long; returns the seconds that it took.
fn drag_around(tab: &Tab<'_>, [x, y]: [f64; 2], time: Duration) -> f64 {
    tab.mouse("mousePressed", [x, y], json!({}));
    let start = Instant::now();
    let mut step = 0;
    while start.elapsed() < time {
        step += 1;
        let angle = f64::from(step) / 40.0;
        tab.mouse("mouseMoved", [x + 80.0 * angle.sin(), y + 30.0 * angle.cos()], json!({}));
    }
    let seconds = start.elapsed().as_secs_f64();
    tab.mouse("mouseReleased", [x, y], json!({}));
    seconds
}

/// The program's memory in KiB, and the bytes that the page's script and pictures hold.
fn memory(program: &Program, tab: &Tab<'_>) -> [f64; 2] {
    tab.call("HeapProfiler.collectGarbage", json!({}));
    let heap = tab.call("Runtime.getHeapUsage", json!({}));
    let number = |name: &str| heap[name].as_f64().unwrap_or(0.0);
    [program.memory() as f64, number("usedSize") + number("backingStorageSize")]
}

fn many_moves_of_a_hand_take_no_memory(browser: &Browser) {
    let program = room("--sources 003..006 --size 96x72");
    let chromium = Chromium::start(browser);
    let tab = chromium.open(&program.address(), [900, 700], false);
    tab.wait_for("typeof shown !== 'undefined' && shown && shown.full");
    let ([x, y], moves) = (tab.middle_of("#picture"), moves());
    let drag = |moves: usize| {
        tab.mouse("mousePressed", [x, y], json!({}));
        for step in 0..moves {
            let angle = step as f64 / 40.0;
            tab.mouse("mouseMoved", [x + 80.0 * angle.sin(), y + 30.0 * angle.cos()], json!({}));
        }
        tab.mouse("mouseReleased", [x, y], json!({}));
        tab.wait_for("shown.full && shown.pose === pose");
    };
    // Events are kept by this test, not by the page.
    tab.call("Log.disable", json!({}));
    let tenth = moves / 10;
    drag(tenth);
    let (before, first) = (memory(&program, &tab), tab.number(COUNT));
    drag(moves - tenth);
    let (after, count) = (memory(&program, &tab), tab.number(COUNT) - first);
    println!(
        "{moves} moves, {count} pictures: KiB of the program and bytes of the page, after a tenth {before:?}, at last {after:?}"
    );
    assert!(count > 10.0 && after[0] < before[0] + 4096.0, "{before:?} KiB became {after:?} over {moves} moves");
    assert!(after[1] < before[1] + 4.0e6, "{before:?} bytes became {after:?} over {moves} moves");
    assert_eq!(tab.console(), [""; 0]);
}

/// The same by requests alone, each of which gets a picture.
fn memory_does_not_grow() {
    let moves = moves();
    let program = room("--sources 003..006");
    let (scene, empty) = (program.scene(), program.memory());
    let (start, focus): (&Value, _) = (&scene["start"], numbers(&scene["focus"]));
    let mut connection = program.connect();
    let mut move_on = |index: usize| {
        // Around the focus, a bit further each time.
        let mut pose = start.clone();
        for (axis, own) in focus.iter().enumerate() {
            let centre = start[axis][3].as_f64().expect("a number");
            pose[axis][3] = json!(centre + 0.02 * ((index % 50) as f64 / 50.0) * (own - centre));
        }
        let mut request = request("a", &pose, true);
        request["side"] = json!(32);
        connection.picture(&request).unpacked();
    };
    let tenth = moves / 10;
    (0..tenth).for_each(&mut move_on);
    let before = program.memory();
    let start = Instant::now();
    (tenth..moves).for_each(&mut move_on);
    let after = program.memory();
    let seconds = start.elapsed().as_secs_f64();
    println!("{moves} moves in {seconds:.0} s: {empty} KiB at first, {before} KiB after a tenth, {after} KiB at last");
    assert!(after < before + (4 << 10), "{before} KiB became {after} KiB over {moves} moves");
}
