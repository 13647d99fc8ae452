//! Pictures that follow a hand that drags, and that memory does not grow.

use super::super::browser::{Browser, REQUIRE};
use super::super::{done, list_of, number_of, numbers};
use super::devtools::{Chromium, Tab};
use super::{COUNT, keep, room, start, weights};
use serde_json::json;
use viewfuse_tests::command::toy;
use viewfuse_tests::patience::wait_until;
use viewfuse_tests::places::repository;
use viewfuse_tests::trials::lacking;
use viewfuse_tests::viewer::Program;

/// So many moves are sent in the test of memory, unless `VIEWFUSE_VIEW_MOVES` says otherwise.
const MOVES: usize = 400;

/// Longest sides of coarse pictures as 16ths of the finest: late ones are coarser.
const SIXTEENTHS: [f64; 9] = [16.0, 13.0, 10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.0];

/// So many pictures are waited for while dragging.
const PICTURES: f64 = 30.0;

viewfuse_tests::trials![;
    lacking(cfg!(target_os = "linux"), "the system does not say what a process takes").or_else(Browser::missing),
    REQUIRE =>
        pictures_of_gaussians_follow_the_hand,
        pictures_of_the_room_follow_the_hand,
        many_moves_of_a_hand_take_no_memory,
];

fn moves() -> usize {
    std::env::var("VIEWFUSE_VIEW_MOVES").map_or(MOVES, |text| text.parse().expect("a number of moves"))
}

fn pictures_of_the_room_follow_the_hand() {
    let browser = &Browser::needed();
    pictures_follow_the_hand(browser, "tests/data/room", [160.0, 120.0], "room.png");
}

fn pictures_of_gaussians_follow_the_hand() {
    let browser = &Browser::needed();
    let folder = toy();
    done(&folder, "optimise toy --size 96x96 --device cpu -o toy.ply");
    let scene = format!("{0}/toy --gaussians {0}/toy.ply", folder.display());
    pictures_follow_the_hand(browser, &scene, [128.0, 128.0], "gaussians.png");
}

/// On the page, from now on: the sizes of the pictures and which requests they answer, and how often weights were
/// drawn.
const WATCH: &str = "(() => { window.drawnSizes = []; window.drawnNumbers = []; window.weightsTold = 0; \
    new MutationObserver(() => { drawnSizes.push([...shows.shown.size]); drawnNumbers.push(shows.shown.number); }) \
        .observe(document.getElementById('picture'), {attributes: true, attributeFilter: ['data-pictures']}); \
    new MutationObserver(() => { weightsTold += 1; }).observe(document.getElementById('sum'), {childList: true}); })()";

/// While a hand drags, coarse pictures come: each answers a newer request than the one before, with its weights, in one
/// of the sizes that there are, of which `finest` is the largest; once it lets go, the picture is that of the last
/// view. How many come in a second is a figure of `cargo bench -p viewfuse-cli --bench view`.
fn pictures_follow_the_hand(browser: &Browser, scene: &str, finest: [f64; 2], kept: &str) {
    let program = start(&repository(), &format!("{scene} --weights error:alpha=1"));
    let chromium = Chromium::start(browser);
    let tab = chromium.open(&program.address(), [1280, 860], false);
    tab.wait_for(COUNT_IS_SOME);
    let place = tab.middle_of("#picture");
    tab.evaluate(WATCH);
    drag_around(&tab, place, PICTURES);
    let seen = tab.evaluate("({sizes: drawnSizes, numbers: drawnNumbers, weights: weightsTold})");
    weights(&tab);
    keep(&tab, kept);
    let (told, drawn) = (number_of(&seen["weights"]), numbers(&seen["numbers"]));
    assert!(told >= drawn.len() as f64, "weights were drawn {told} times for {} pictures", drawn.len());
    assert!(drawn.is_sorted(), "an older picture replaced a newer one: {drawn:?}");
    for size in list_of(&seen["sizes"]) {
        let sides = numbers(size);
        let is_coarse =
            SIXTEENTHS.iter().any(|share| (0..2).all(|i| (sides[i] - finest[i] * share / 16.0).abs() < 1.0));
        assert!(is_coarse, "{sides:?} while dragging");
    }
    tab.wait_for("shows.shown.full && shows.shown.pose === shows.pose");
    assert_eq!(tab.console(), [""; 0]);
}

const COUNT_IS_SOME: &str = "document.getElementById('picture')?.dataset.pictures > 0";

/// Drags around a place until so many more pictures have come.
fn drag_around(tab: &Tab<'_>, [x, y]: [f64; 2], pictures: f64) {
    let enough = tab.number(COUNT) + pictures;
    tab.mouse("mousePressed", [x, y], json!({}));
    let mut step = 0;
    wait_until("pictures do not follow the hand", || {
        step += 1;
        let angle = f64::from(step) / 40.0;
        tab.mouse("mouseMoved", [x + 80.0 * angle.sin(), y + 30.0 * angle.cos()], json!({}));
        tab.number(COUNT) >= enough
    });
    tab.mouse("mouseReleased", [x, y], json!({}));
}

/// The program's memory in KiB, and the bytes that the page's script and pictures hold.
fn memory(program: &Program, tab: &Tab<'_>) -> [f64; 2] {
    tab.call("HeapProfiler.collectGarbage", json!({}));
    let heap = tab.call("Runtime.getHeapUsage", json!({}));
    let number = |name: &str| heap[name].as_f64().unwrap_or(0.0);
    [program.memory() as f64, number("usedSize") + number("backingStorageSize")]
}

fn many_moves_of_a_hand_take_no_memory() {
    let browser = &Browser::needed();
    let program = room("--sources 003..006 --size 96x72 --weights error:alpha=1");
    let chromium = Chromium::start(browser);
    let tab = chromium.open(&program.address(), [900, 700], false);
    tab.wait_for("window.shows && shows.shown && shows.shown.full");
    let ([x, y], moves) = (tab.middle_of("#picture"), moves());
    let drag = |moves: usize| {
        tab.mouse("mousePressed", [x, y], json!({}));
        for step in 0..moves {
            let angle = step as f64 / 40.0;
            tab.mouse("mouseMoved", [x + 80.0 * angle.sin(), y + 30.0 * angle.cos()], json!({}));
        }
        tab.mouse("mouseReleased", [x, y], json!({}));
        tab.wait_for("shows.shown.full && shows.shown.pose === shows.pose");
    };
    // Events are kept by this test, not by the page.
    tab.call("Log.disable", json!({}));
    let tenth = moves / 10;
    drag(tenth);
    let (before, first) = (memory(&program, &tab), tab.number(COUNT));
    drag(moves - tenth);
    // A machine that is slow sees fewer pictures in a drag.
    wait_until("pictures do not follow the hand", || {
        let count = tab.number(COUNT) - first;
        if count <= 10.0 {
            drag(tenth);
        }
        count > 10.0
    });
    let after = memory(&program, &tab);
    assert!(after[0] < before[0] + 4096.0, "{before:?} KiB became {after:?} over {moves} moves");
    assert!(after[1] < before[1] + 4.0e6, "{before:?} bytes became {after:?} over {moves} moves");
    assert_eq!(tab.console(), [""; 0]);
}
