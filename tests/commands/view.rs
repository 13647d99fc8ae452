//! `viewfuse view`: who may ask, what is answered, and the page in a browser that is driven as a hand does it.
//!
//! The browser is that of `report.rs`: without one its tests are ignored and say why; with `VIEWFUSE_REQUIRE_BROWSER=1` they
//! fail instead. Pictures of the page, to be looked at, are left in `tmp/view` of the target folder.
#![cfg(unix)]

mod devtools;
mod program;

use super::BINARY;
use super::browser::{self, Browser, InBrowser};
use devtools::{Chromium, Tab};
use image::{RgbImage, RgbaImage};
use libtest_mimic::Trial;
use program::{Program, request};
use serde_json::json;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};
use viewfuse_tests::command::{assert_refused, files_below, names_in, run, toy};
use viewfuse_tests::places::{data, repository};
use viewfuse_tests::scenes::Folder;
use viewfuse_tests::trials::{needing, trial};

/// So many moves are sent in the test of memory, unless `VIEWFUSE_VIEW_MOVES` says otherwise.
const MOVES: usize = 400;

pub(crate) fn trials() -> Vec<Trial> {
    let mut trials = vec![
        trial("commands::view::other_hosts_and_addresses_get_nothing", other_hosts_and_addresses_get_nothing),
        trial("commands::view::full_pictures_are_those_of_render", full_pictures_are_those_of_render),
        trial("commands::view::the_newest_request_wins", the_newest_request_wins),
        trial("commands::view::many_connections_at_once_are_answered", many_connections_at_once_are_answered),
        trial("commands::view::ctrl_c_ends_it_and_nothing_is_written", ctrl_c_ends_it_and_nothing_is_written),
        trial("commands::view::a_taken_port_is_an_error", a_taken_port_is_an_error),
        trial("commands::view::learned_fields_are_shown", learned_fields_are_shown),
    ];
    let no_count = (!cfg!(target_os = "linux")).then(|| "the system does not say what a process takes".to_owned());
    trials.push(needing(no_count, false, trial("commands::view::memory_does_not_grow", memory_does_not_grow)));
    let tests: [(&str, InBrowser); 5] = [
        ("view::browser::a_hand_turns_the_view", a_hand_turns_the_view),
        ("view::browser::pictures_follow_the_hand", pictures_follow_the_hand),
        ("view::browser::tabs_come_and_go", tabs_come_and_go),
        ("view::browser::a_phone_shows_all_of_it", a_phone_shows_all_of_it),
        ("view::browser::a_view_is_taken_elsewhere", a_view_is_taken_elsewhere),
    ];
    trials.extend(browser::trials(tests));
    trials
}

/// The room, from the repository's root.
fn room(more: &str) -> Program {
    Program::start(&repository(), &format!("tests/data/room {more}"))
}

fn other_hosts_and_addresses_get_nothing() {
    let program = Program::start(&repository(), &format!("{} --size 24x24", data("toy").display()));
    let own = ("Host", program.host.as_str());
    let status = |method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]| {
        program.connect().ask(method, path, headers, body).status
    };
    let page = program.get("");
    let text = String::from_utf8_lossy(&page.body);
    assert!(page.status == 200 && text.contains("<title>viewfuse</title>"), "{text}");
    for header in
        ["Content-Security-Policy: default-src 'none'", "Referrer-Policy: no-referrer", "Cache-Control: no-store"]
    {
        assert!(page.head.contains(header), "{header} is not in {}", page.head);
    }
    assert!(!page.head.contains("Access-Control-Allow-Origin"), "{}", page.head);
    for host in ["evil.example", "127.0.0.1", "127.0.0.1:1"] {
        assert_eq!(status("GET", &program.path, &[("Host", host)], b""), 403, "{host}");
    }
    assert_eq!(status("GET", &program.path, &[], b""), 403, "no host");
    assert_eq!(status("GET", &program.path, &[own, own], b""), 403, "two hosts");
    assert_eq!(status("GET", &program.path, &[own, ("Origin", "http://evil.example")], b""), 403);
    for path in ["/", "/scene", "/0123456789abcdef0123456789abcdef/", &program.path[..20]] {
        assert_eq!(status("GET", path, &[own], b""), 403, "{path}");
    }
    for (rest, expected) in [("scene", 405), ("picture", 400), ("nothing", 404), ("../Cargo.toml", 404)] {
        assert_eq!(status("POST", &format!("{}{rest}", program.path), &[own], b"{}"), expected, "{rest}");
    }
    let long = vec![b' '; 5000];
    assert_eq!(status("POST", &format!("{}picture", program.path), &[own], &long), 413);
    let start = &program.scene()["start"];
    for (key, value) in [("scheme", "attention:Cargo.toml"), ("scheme", "median"), ("layer", "everything")] {
        let mut wrong = request("a", start, true);
        wrong[key] = value.into();
        assert_eq!(program.connect().picture(&wrong).status, 400, "{key}={value}");
    }
    // After all of that it goes on.
    let (answer, picture) = program.connect().picture(&request("a", start, false)).unpacked();
    assert_eq!((answer["full"].as_bool(), picture.dimensions()), (Some(true), (24, 24)));
}

fn full_pictures_are_those_of_render() {
    let folder = Folder::new();
    let scene = data("room");
    let options = "--sources 000..004,006..009 --size 96x72";
    for scheme in ["error:alpha=1", "gaussian:beta=2"] {
        let arguments =
            format!("render {} --targets 005 --weights {scheme} {options} --device cpu -o out", scene.display());
        done_with_warnings(folder.path(), &arguments);
    }
    let program = Program::start(folder.path(), &format!("{} {options}", scene.display()));
    let found = program.scene();
    let others = found["others"].as_array().expect("other views");
    let pose = &others.iter().find(|view| view["name"] == "005").expect("view 005")["pose"];
    let mut connection = program.connect();
    let mut pictures = Vec::new();
    // Back to the first one: what was encoded for another scheme is not used.
    for scheme in ["error:alpha=1", "mean", "gaussian:beta=2"] {
        let mut request = request("a", pose, false);
        request["scheme"] = scheme.into();
        request["layer"] = "depth".into();
        let (answer, picture) = connection.picture(&request).unpacked();
        assert_eq!(answer["layers"], json!(["depth", "confidence"]));
        assert_eq!(answer["layer"]["bytes"], 96 * 72);
        let sum: f64 = super::numbers(&answer["weights"]).iter().sum();
        super::assert_near(sum, 1.0, 1.0e-5);
        pictures.push(picture);
    }
    let rendered = image::open(folder.path().join("out/005.png")).expect("a picture").to_rgb8();
    assert!(pictures[2] == rendered, "the picture is not that of render");
    assert!(pictures[0] != pictures[1] && pictures[0] != rendered);
}

/// Runs the command, which must succeed; it may warn.
fn done_with_warnings(folder: &Path, arguments: &str) {
    let outcome = run(BINARY, folder, arguments);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
}

fn the_newest_request_wins() {
    let program = room("");
    let start = program.scene()["start"].clone();
    let mut first = program.connect();
    let (answer, _) = first.picture(&request("a", &start, true)).unpacked();
    assert_eq!(answer["full"], false);
    // A full picture takes seconds the first time; then its tab wants something else.
    first.send_picture(&request("a", &start, false));
    let (mut second, mut third) = (program.connect(), program.connect());
    std::thread::sleep(Duration::from_millis(100));
    second.send_picture(&request("a", &start, false));
    let other = third.picture(&request("b", &start, true));
    assert_eq!(other.unpacked().0["full"], false, "another tab does not wait for it");
    third.send_picture(&request("a", &start, true));
    assert_eq!((first.receive().status, second.receive().status), (204, 204));
    assert_eq!(third.receive().unpacked().0["full"], false);
    // Weights are told without a picture.
    let weights = third.ask(
        "POST",
        &format!("{}weights", program.path),
        &[("Host", &program.host)],
        request("a", &start, true).to_string().as_bytes(),
    );
    assert_eq!(super::numbers(&weights.json()).len(), 11);
}

/// Browsers open several connections at once and keep them.
fn many_connections_at_once_are_answered() {
    let folder = toy();
    let program = Program::start(folder.path(), "toy --size 24x24");
    let path = format!("{}status", program.path);
    let mut connections = Vec::new();
    for _ in 0..10 {
        let mut new: Vec<_> = (0..6).map(|_| program.connect()).collect();
        new.iter_mut().for_each(|own| own.send("GET", &path, &[("Host", &program.host)], b""));
        connections.extend(new);
    }
    for connection in &mut connections {
        assert_eq!(connection.receive().status, 200);
    }
}

fn ctrl_c_ends_it_and_nothing_is_written() {
    let folder = toy();
    let before = files_below(folder.path());
    let mut program = Program::start(folder.path(), "toy --size 48x48");
    let start = program.scene()["start"].clone();
    program.connect().picture(&request("a", &start, true)).unpacked();
    // In the middle of a full picture.
    let mut connection = program.connect();
    connection.send_picture(&request("a", &start, false));
    drop(connection);
    assert_eq!(program.interrupt(), (Some(0), String::new()));
    assert!(std::net::TcpStream::connect(&program.host).is_err(), "it still listens");
    assert_eq!(files_below(folder.path()), before);
}

fn a_taken_port_is_an_error() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = listener.local_addr().expect("an address").port();
    let folder = toy();
    let parts = ["cannot listen on 127.0.0.1", &port.to_string(), "--port"];
    assert_refused(BINARY, folder.path(), &format!("view toy --no-browser --device cpu --port {port}"), &parts);
    assert_refused(BINARY, folder.path(), "view toy --no-browser --size 48x20", &["does not keep the shape", "--size"]);
}

/// Fields without a cheaper form are shown in smaller pictures of their own.
fn learned_fields_are_shown() {
    let folder = toy();
    for (model, layers) in
        [("formula:8 --samples 16,4,4", json!(["depth"])), ("genvs:small --steps 2 --samples 8", json!([]))]
    {
        let arguments = format!("toy --sources 000000,000008,000016 --size 32x32 --model {model}");
        let program = Program::start(folder.path(), &arguments);
        let start = program.scene()["start"].clone();
        let mut connection = program.connect();
        let (coarse, picture) = connection.picture(&request("a", &start, true)).unpacked();
        assert!(picture.width() <= 32, "{model}: {coarse}");
        let (full, picture) = connection.picture(&request("a", &start, false)).unpacked();
        assert_eq!((full["full"].as_bool(), picture.dimensions()), (Some(true), (32, 32)), "{model}");
        assert_eq!(full["layers"], layers, "{model}");
    }
}

fn memory_does_not_grow() {
    let moves = std::env::var("VIEWFUSE_VIEW_MOVES").map_or(MOVES, |text| text.parse().expect("a number of moves"));
    let program = Program::start(&repository(), "tests/data/room --sources 003..006");
    let (scene, empty) = (program.scene(), program.memory());
    let (start, focus) = (&scene["start"], super::numbers(&scene["focus"]));
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

/// The pixels of the picture on the page.
fn canvas(tab: &Tab<'_>) -> RgbaImage {
    use base64::Engine;
    let address = tab.text("document.getElementById('picture').toDataURL('image/png')");
    let text = address.strip_prefix("data:image/png;base64,").expect("a PNG");
    let bytes = base64::engine::general_purpose::STANDARD.decode(text).expect("base64");
    image::load_from_memory(&bytes).expect("a picture").to_rgba8()
}

/// Mean absolute difference of two pictures, of 255.
fn difference(a: &RgbaImage, b: &RgbaImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let sum: u64 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.as_raw().len() as f64
}

const FIRST: &str = "document.getElementById('picture')?.dataset.pictures > 0";
/// The full picture of the view as it is now.
const FULL: &str = "typeof shown !== 'undefined' && shown && shown.full && shown.pose === pose";
const COARSE: &str = "document.getElementById('picture')?.dataset.kind === 'coarse'";
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

/// Small enough that a full picture comes soon.
const SMALL: &str = "--sources 003..007 --size 96x72";

fn a_hand_turns_the_view(browser: &Browser) {
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    let tab = chromium.open(&program.address(), [1280, 860], false);
    tab.wait_for(FULL);
    tab.wait_for(
        "[...document.images].every((own) => own.complete && own.naturalWidth > 0) && document.images.length === 5",
    );
    let (first, first_weights, first_map) =
        (canvas(&tab), weights(&tab), tab.text("document.getElementById('map').toDataURL()"));
    let distinct: std::collections::HashSet<[u8; 4]> = first.pixels().map(|pixel| pixel.0).collect();
    assert!(distinct.len() > 1000, "{} colours", distinct.len());
    assert!(tab.text("document.getElementById('status').textContent").starts_with("full, 96 × 72"));

    // A drag turns the view: coarse pictures on the way, a full one at its end.
    let [x, y] = tab.middle_of("#picture");
    let before = tab.number(COUNT);
    tab.mouse("mousePressed", [x, y], json!({}));
    tab.mouse("mouseMoved", [x + 120.0, y + 20.0], json!({}));
    tab.wait_for(COARSE);
    assert!(difference(&canvas(&tab), &first) > 2.0, "the picture does not follow the hand");
    // The hand rests, but the button is held.
    tab.wait_for(FULL);
    tab.mouse("mouseReleased", [x + 120.0, y + 20.0], json!({}));
    assert!(tab.number(COUNT) >= before + 2.0);
    let turned = canvas(&tab);
    assert!(difference(&turned, &first) > 2.0);
    let turned_weights = weights(&tab);
    assert!(turned_weights.iter().zip(&first_weights).any(|(a, b)| (a - b).abs() > 0.05), "{turned_weights:?}");
    assert_ne!(tab.text("document.getElementById('map').toDataURL()"), first_map, "the cameras' colours");
    keep(&tab, "desktop.png");

    // Keys: back and forth is where it was; then to the start.
    let matrix = "JSON.stringify(matrixOf(pose))";
    let place = tab.text(matrix);
    for (there, back) in [("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown"), ("+", "-")] {
        tab.key(there);
        assert_ne!(tab.text(matrix), place, "{there}");
        tab.key(back);
        let gap = tab
            .number(&format!("Math.max(...matrixOf(pose).flat().map((own, i) => Math.abs(own - {place}.flat()[i])))"));
        assert!(gap < 1.0e-9, "{there} and {back}: {gap}");
    }
    tab.key("0");
    tab.wait_for(COARSE);
    tab.wait_for(FULL);
    assert!(canvas(&tab) == first, "the start is what it was");
    tab.mouse("mouseWheel", [x, y], json!({"deltaX": 0, "deltaY": -300}));
    tab.wait_for(COARSE);
    assert_ne!(tab.text(matrix), place);

    // Schemes by the menu, their parameter by the slider.
    let choose = |id: &str, value: &str, event: &str| {
        tab.evaluate(&format!(
            "(() => {{ const own = document.getElementById('{id}'); own.value = '{value}'; own.dispatchEvent(new Event('{event}', {{bubbles: true}})); }})()"
        ));
    };
    choose("scheme", "mean", "change");
    tab.wait_for(&format!("{WEIGHTS}.every((own) => Math.abs(own - 0.2) < 1e-6)"));
    weights(&tab);
    choose("scheme", "gaussian", "change");
    choose("parameter", "700", "input");
    tab.wait_for("document.getElementById('parameter-value').textContent === '6.31'");
    tab.wait_for(&format!("Math.max(...{WEIGHTS}) > 0.25"));
    weights(&tab);
    tab.wait_for(FULL);
    // Layers over the picture.
    let plain = canvas(&tab);
    for layer in ["depth", "confidence"] {
        tab.evaluate(&format!("document.querySelector('input[value={layer}]').click()"));
        tab.wait_for(&format!("shown.layer && shown.layer.kind === '{layer}' && shown.full"));
        assert!(difference(&canvas(&tab), &plain) > 5.0, "{layer}");
        keep(&tab, &format!("{layer}.png"));
    }
    tab.evaluate("document.querySelector('#sources button').click()");
    tab.wait_for(&format!("{WEIGHTS}[0] > 0.8"));
    assert_eq!(tab.console(), [""; 0]);
}

fn pictures_follow_the_hand(browser: &Browser) {
    let program = room("");
    let chromium = Chromium::start(browser);
    let start = Instant::now();
    let tab = chromium.open(&program.address(), [1280, 860], false);
    tab.wait_for(FIRST);
    let first = start.elapsed();
    let [x, y] = tab.middle_of("#picture");
    // Until the size of coarse pictures no longer changes.
    tab.drag([x, y], [x + 40.0, y], 40);
    tab.evaluate("weightsTold = 0; tellWeightsBefore = tellWeights; tellWeights = (own, number) => { weightsTold += 1; tellWeightsBefore(own, number); }");
    tab.mouse("mousePressed", [x, y], json!({}));
    let (start, before) = (Instant::now(), tab.number(COUNT));
    let mut step = 0;
    while start.elapsed() < Duration::from_secs(4) {
        step += 1;
        let angle = f64::from(step) / 20.0;
        tab.mouse("mouseMoved", [x + 80.0 * angle.sin(), y + 30.0 * angle.cos()], json!({}));
    }
    let (count, seconds) = (tab.number(COUNT) - before, start.elapsed().as_secs_f64());
    let size = tab.text("shown.size.join('x')");
    let told = tab.number("weightsTold");
    tab.mouse("mouseReleased", [x, y], json!({}));
    println!(
        "first picture after {:.2} s; {:.1} pictures of {size} and {:.1} times weights a second, {step} moves",
        first.as_secs_f64(),
        count / seconds,
        told / seconds
    );
    weights(&tab);
    // On two idle cores 1 s and 10 pictures a second; a busy machine is no failure.
    assert!(first < Duration::from_secs(20), "{first:?}");
    assert!(count / seconds > 1.0 && told >= count, "{count} pictures, {told} times weights in {seconds} s");
    assert_eq!(tab.console(), [""; 0]);
}

fn tabs_come_and_go(browser: &Browser) {
    let mut program = room(SMALL);
    let chromium = Chromium::start(browser);
    let first = chromium.open(&program.address(), [900, 700], false);
    let second = chromium.open(&program.address(), [900, 700], false);
    first.wait_for(FULL);
    second.wait_for(FULL);
    let [x, y] = second.middle_of("#picture");
    second.drag([x, y], [x + 150.0, y], 5);
    second.wait_for(COARSE);
    second.wait_for(FULL);
    // Each has a view of its own.
    assert_eq!(first.evaluate("pose.centre.every((own, i) => own === scene.start.centre[i])"), true);
    assert_eq!(second.evaluate("pose.centre.every((own, i) => own === scene.start.centre[i])"), false);
    assert_eq!(second.console(), [""; 0]);
    // Closed in the middle of a drag.
    second.mouse("mousePressed", [x, y], json!({}));
    second.mouse("mouseMoved", [x + 50.0, y], json!({}));
    second.close();
    first.key("ArrowLeft");
    first.wait_for(COARSE);
    first.wait_for(FULL);
    assert_eq!(first.console(), [""; 0]);
    first.close();
    std::thread::sleep(Duration::from_millis(300));
    assert!(program.is_running());
    let third = chromium.open(&program.address(), [900, 700], false);
    third.wait_for(FULL);
    assert_eq!(program.interrupt().0, Some(0));
    third.key("ArrowLeft");
    third.wait_for("!document.getElementById('problem').hidden");
    assert!(third.text("document.getElementById('problem').textContent").contains("does not answer"));
}

fn a_phone_shows_all_of_it(browser: &Browser) {
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    let tab = chromium.open(&program.address(), [390, 844], true);
    tab.wait_for(FULL);
    let first = canvas(&tab);
    assert_eq!(tab.number("document.documentElement.scrollWidth"), 390.0, "it is wider than the phone");
    keep(&tab, "phone.png");
    // One finger turns, two move.
    let [x, y] = tab.middle_of("#picture");
    tab.touch("touchStart", &[[x, y]]);
    tab.touch("touchMove", &[[x + 40.0, y]]);
    tab.touch("touchMove", &[[x + 80.0, y]]);
    tab.touch("touchEnd", &[]);
    tab.wait_for(COARSE);
    tab.wait_for(FULL);
    assert!(difference(&canvas(&tab), &first) > 2.0, "the picture does not follow the finger");
    let distance = "length(sub(pose.centre, focus))";
    let before = tab.number(distance);
    tab.touch("touchStart", &[[x - 30.0, y], [x + 30.0, y]]);
    tab.touch("touchMove", &[[x - 45.0, y], [x + 45.0, y]]);
    tab.touch("touchMove", &[[x - 60.0, y], [x + 60.0, y]]);
    tab.touch("touchEnd", &[]);
    assert!(tab.number(distance) < 0.7 * before, "a pinch does not move");
    assert_eq!(tab.number("window.visualViewport.scale"), 1.0, "the page is not enlarged instead");
    weights(&tab);
    let smallest = "Math.min(...[...document.querySelectorAll('p, label, legend, output, b, pre')].map((own) => parseFloat(getComputedStyle(own).fontSize)))";
    assert!(tab.number(smallest) >= 12.0, "{}", tab.number(smallest));
    assert_eq!(tab.console(), [""; 0]);
}

/// A pose is saved as a file that viewfuse reads, and the command line says how this view is rendered.
fn a_view_is_taken_elsewhere(browser: &Browser) {
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    let tab = chromium.open(&program.address(), [1280, 860], false);
    tab.wait_for(FULL);
    let downloads = json!({"behavior": "allow", "downloadPath": chromium.folder().join("saved").display().to_string()});
    chromium.call(None, "Browser.setDownloadBehavior", downloads);
    let permissions = json!({"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]});
    chromium.call(None, "Browser.grantPermissions", permissions);
    for _ in 0..4 {
        tab.key("ArrowLeft");
    }
    let folder = Folder::new();
    tab.evaluate("document.getElementById('save').click()");
    let saved = chromium.folder().join("saved/view.json");
    let start = Instant::now();
    while !saved.exists() || names_in(saved.parent().expect("a folder")).len() != 1 {
        assert!(start.elapsed() < Duration::from_secs(60), "nothing is saved");
        std::thread::sleep(Duration::from_millis(20));
    }
    // With a photograph beside it, it is a scene of one view.
    fs::copy(&saved, folder.file("transforms.json")).expect("a copy");
    RgbImage::new(96, 72).save(folder.file("view.png")).expect("a picture");
    let scene = viewfuse::scene::Scene::open(folder.path()).expect("a scene");
    let pose = scene.views[0].camera.pose.to_opencv();
    let shown: Vec<f64> = super::numbers(&tab.evaluate("matrixOf(pose).flat()"));
    for (own, shown) in pose.iter().flatten().zip(shown) {
        super::assert_near(f64::from(*own), shown, 1.0e-6);
    }
    tab.call("Page.bringToFront", json!({}));
    tab.evaluate("document.getElementById('copy').click()");
    tab.wait_for("document.getElementById('said').textContent.startsWith('Copied')");
    let line = tab.text("navigator.clipboard.readText()");
    assert_eq!(line, tab.text("document.getElementById('command').textContent"));
    let start = "viewfuse render tests/data/room --camera-path view.json --sources 003,004,005,006,007 --size 96x72";
    assert!(line.starts_with(start) && line.ends_with(" --weights error:alpha=1 -o out"), "{line}");
    // The line renders what is shown.
    fs::copy(&saved, folder.file("view.json")).expect("a copy");
    let line = line.replacen("tests/data/room", &data("room").display().to_string(), 1);
    done_with_warnings(folder.path(), line.strip_prefix("viewfuse ").expect("the command"));
    let rendered = image::open(folder.path().join("out/view.png")).expect("a picture").to_rgb8();
    let (_, picture) = program.connect().picture(&request("x", &tab.evaluate("matrixOf(pose)"), false)).unpacked();
    assert!(rendered == picture, "the command line renders another picture");
    // A view of the scene that is no source has a name.
    tab.evaluate("goTo(scene.others[0].pose)");
    let line = tab.text("document.getElementById('command').textContent");
    assert!(line.contains("render tests/data/room --targets 000 --sources"), "{line}");
    assert_eq!(tab.console(), [""; 0]);
}
