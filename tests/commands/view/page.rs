//! The page in a browser: a hand, two hands on a phone, keys, menus, tabs, and what is taken elsewhere.

use super::super::browser::{Browser, REQUIRE};
use super::super::{assert_near, command, done_with_warnings, number_of, numbers, read_json};
use super::devtools::{Chromium, Tab};
use super::{FOLLOWED, NOTE_PICTURES, WEIGHTS, keep, room, weights};
use image::{RgbImage, RgbaImage};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use viewfuse_tests::command::{names_in, toy};
use viewfuse_tests::patience::wait_until;
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::Folder;
use viewfuse_tests::viewer::{Program, request};

viewfuse_tests::trials![;
    Browser::missing(), REQUIRE =>
        a_hand_turns_the_view,
        tabs_come_and_go,
        a_phone_shows_all_of_it,
        a_view_is_taken_elsewhere,
        a_path_goes_through_keyframes,
        the_scheme_becomes_that_of_render,
        where_nothing_was_photographed_it_is_said,
        a_picture_that_is_poor_is_said_to_be_so,
        names_from_files_are_no_commands,
];

/// The full picture of the view as it is now.
const FULL: &str = "window.shows && shows.shown && shows.shown.full && shows.shown.pose === shows.pose";

/// Small enough that a full picture comes soon.
const SMALL: &str = "--sources 003..007 --size 96x72 --weights error:alpha=1";

/// A page in a window of a desk, which shows its first full picture.
#[track_caller]
fn opened<'a>(chromium: &'a Chromium, program: &Program) -> Tab<'a> {
    let tab = chromium.open(&program.address(), [1280, 860], false);
    tab.wait_for(FULL);
    tab
}

/// Acts, and waits for a picture that follows and for the full one at its end.
#[track_caller]
fn followed(tab: &Tab<'_>, act: impl FnOnce()) {
    tab.evaluate(NOTE_PICTURES);
    act();
    tab.wait_for(FOLLOWED);
    tab.wait_for(FULL);
}

/// Gives an element of the page a value, as a hand does.
#[track_caller]
fn choose(tab: &Tab<'_>, id: &str, value: &str, event: &str) {
    tab.evaluate(&format!(
        "(() => {{ const element = document.getElementById('{id}'); element.value = '{value}'; \
            element.dispatchEvent(new Event('{event}', {{bubbles: true}})); }})()"
    ));
}

#[track_caller]
fn click(tab: &Tab<'_>, id: &str) {
    tab.evaluate(&format!("document.getElementById('{id}').click()"));
}

/// The text of an element.
#[track_caller]
fn text_in(tab: &Tab<'_>, id: &str) -> String {
    tab.text(&format!("document.getElementById('{id}').textContent"))
}

/// Runs the command line that the page shows, on the room, in a folder.
#[track_caller]
fn done_by_line(folder: &Path, line: &str) {
    let line = line.replacen("tests/data/room", &data("room").display().to_string(), 1);
    done_with_warnings(folder, line.strip_prefix("viewfuse ").expect("the command"));
}

/// Downloads go to the folder `saved` of the browser's own.
fn keep_downloads(chromium: &Chromium) -> PathBuf {
    let saved = chromium.folder().join("saved");
    // The browser would make it when it first needs it, and it is looked into before.
    fs::create_dir(&saved).expect("a folder");
    let downloads = json!({"behavior": "allow", "downloadPath": saved.display().to_string()});
    chromium.call(None, "Browser.setDownloadBehavior", downloads);
    saved
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

fn a_hand_turns_the_view() {
    let browser = &Browser::needed();
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    let tab = opened(&chromium, &program);
    tab.wait_for(
        "[...document.images].every((element) => element.complete && element.naturalWidth > 0) && \
            document.images.length === 5",
    );
    let (first, first_weights, first_map) =
        (canvas(&tab), weights(&tab), tab.text("document.getElementById('map').toDataURL()"));
    let distinct: std::collections::HashSet<[u8; 4]> = first.pixels().map(|pixel| pixel.0).collect();
    assert!(distinct.len() > 1000, "{} colours", distinct.len());
    assert!(text_in(&tab, "status").starts_with("full, 96 × 72"));

    // A drag turns the view: pictures on the way, a full one at its end.
    let [x, y] = tab.middle_of("#picture");
    tab.evaluate(NOTE_PICTURES);
    tab.mouse("mousePressed", [x, y], json!({}));
    tab.mouse("mouseMoved", [x + 120.0, y + 20.0], json!({}));
    tab.wait_for(FOLLOWED);
    assert!(difference(&canvas(&tab), &first) > 2.0, "the picture does not follow the hand");
    // The hand rests, but the button is held.
    tab.wait_for(FULL);
    tab.mouse("mouseReleased", [x + 120.0, y + 20.0], json!({}));
    let turned = canvas(&tab);
    assert!(difference(&turned, &first) > 2.0);
    let turned_weights = weights(&tab);
    assert!(turned_weights.iter().zip(&first_weights).any(|(a, b)| (a - b).abs() > 0.05), "{turned_weights:?}");
    assert_ne!(tab.text("document.getElementById('map').toDataURL()"), first_map, "the cameras' colours");
    keep(&tab, "desktop.png");

    // Keys: back and forth is where it was; then to the start.
    let matrix = "JSON.stringify(matrixOf(shows.pose))";
    let place = tab.text(matrix);
    for (there, back) in [("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown"), ("+", "-")] {
        tab.key(there);
        assert_ne!(tab.text(matrix), place, "{there}");
        tab.key(back);
        let gap = tab.number(&format!(
            "Math.max(...matrixOf(shows.pose).flat().map((value, i) => Math.abs(value - {place}.flat()[i])))"
        ));
        assert!(gap < 1.0e-9, "{there} and {back}: {gap}");
    }
    followed(&tab, || tab.key("0"));
    assert!(canvas(&tab) == first, "the start is what it was");
    tab.evaluate(NOTE_PICTURES);
    tab.mouse("mouseWheel", [x, y], json!({"deltaX": 0, "deltaY": -300}));
    tab.wait_for(FOLLOWED);
    assert_ne!(tab.text(matrix), place);
    schemes_and_layers(&tab);
    assert_eq!(tab.console(), [""; 0]);
}

/// Schemes by the menu, their parameter by the slider, layers over the picture, and a view from a source.
fn schemes_and_layers(tab: &Tab<'_>) {
    choose(tab, "scheme", "mean", "change");
    tab.wait_for(&format!("{WEIGHTS}.every((value) => Math.abs(value - 0.2) < 1e-6)"));
    weights(tab);
    choose(tab, "scheme", "gaussian", "change");
    choose(tab, "parameter", "700", "input");
    tab.wait_for("document.getElementById('parameter-value').textContent === '6.31'");
    assert_eq!(tab.text("document.getElementById('parameter').getAttribute('aria-valuetext')"), "beta 6.31");
    tab.wait_for(&format!("Math.max(...{WEIGHTS}) > 0.25"));
    weights(tab);
    tab.wait_for(FULL);
    let plain = canvas(tab);
    for layer in ["depth", "confidence"] {
        tab.evaluate(&format!("document.querySelector('input[value={layer}]').click()"));
        tab.wait_for(&format!("shows.shown.layer && shows.shown.layer.kind === '{layer}' && shows.shown.full"));
        assert!(difference(&canvas(tab), &plain) > 5.0, "{layer}");
        keep(tab, &format!("{layer}.png"));
    }
    // Keys go to the view from what takes none, as a check box, and the numbers from radio buttons, too.
    let matrix = "JSON.stringify(matrixOf(shows.pose))";
    for (element, key) in [("#overlay", "ArrowLeft"), ("#overlay", "+"), ("input[value=depth]", "-")] {
        let before = tab.text(matrix);
        tab.evaluate(&format!("document.querySelector('{element}').focus()"));
        tab.key(key);
        assert_ne!(tab.text(matrix), before, "{key} at {element}");
    }
    // To a source, and around what the photographs look at, wherever the view was moved to.
    tab.evaluate("goTo(shows.pose, [9, 9, 9])");
    tab.evaluate("document.querySelector('#sources button').click()");
    assert_eq!(tab.evaluate("shows.focus"), tab.evaluate("shows.scene.focus"));
    // From its own place it is the most relevant one.
    tab.wait_for(&format!("{FULL} && {WEIGHTS}[0] === Math.max(...{WEIGHTS})"));
}

fn tabs_come_and_go() {
    let browser = &Browser::needed();
    let mut program = room(SMALL);
    let chromium = Chromium::start(browser);
    let first = chromium.open(&program.address(), [900, 700], false);
    let second = chromium.open(&program.address(), [900, 700], false);
    first.wait_for(FULL);
    second.wait_for(FULL);
    let [x, y] = second.middle_of("#picture");
    followed(&second, || second.drag([x, y], [x + 150.0, y], 5));
    // Each has a view of its own.
    assert_eq!(first.evaluate("shows.pose.centre.every((value, i) => value === shows.scene.start.centre[i])"), true);
    assert_eq!(second.evaluate("shows.pose.centre.every((value, i) => value === shows.scene.start.centre[i])"), false);
    assert_eq!(second.console(), [""; 0]);
    // Closed in the middle of a drag.
    second.mouse("mousePressed", [x, y], json!({}));
    second.mouse("mouseMoved", [x + 50.0, y], json!({}));
    second.close();
    followed(&first, || first.key("ArrowLeft"));
    assert_eq!(first.console(), [""; 0]);
    first.close();
    std::thread::sleep(Duration::from_millis(300));
    assert!(program.is_running());
    let third = chromium.open(&program.address(), [900, 700], false);
    third.wait_for(FULL);
    assert_eq!(program.interrupt().0, Some(0));
    third.key("ArrowLeft");
    third.wait_for("!document.getElementById('problem').hidden");
    assert!(text_in(&third, "problem").contains("does not answer"));
}

fn a_phone_shows_all_of_it() {
    let browser = &Browser::needed();
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    let tab = chromium.open(&program.address(), [390, 844], true);
    tab.wait_for(FULL);
    let first = canvas(&tab);
    assert_eq!(tab.number("document.documentElement.scrollWidth"), 390.0, "it is wider than the phone");
    keep(&tab, "phone.png");
    let help = tab.text("document.getElementById('keys').innerText");
    assert!(help.contains("finger") && !help.contains("Shift") && !help.contains("Drag"), "{help}");
    assert!(!tab.text("document.getElementById('picture').getAttribute('aria-label')").contains("keys"));
    // One finger turns, two move.
    let [x, y] = tab.middle_of("#picture");
    followed(&tab, || tab.slide(&[&[[x, y]], &[[x + 40.0, y]], &[[x + 80.0, y]]]));
    assert!(difference(&canvas(&tab), &first) > 2.0, "the picture does not follow the finger");
    let distance = "Math.hypot(...shows.pose.centre.map((value, i) => value - shows.focus[i]))";
    let before = tab.number(distance);
    let fingers = |apart: f64| [[x - apart, y], [x + apart, y]];
    tab.slide(&[&fingers(30.0), &fingers(45.0), &fingers(60.0)]);
    assert!(tab.number(distance) < 0.7 * before, "a pinch does not move");
    assert_eq!(tab.number("window.visualViewport.scale"), 1.0, "the page is not enlarged instead");
    weights(&tab);
    let smallest = "Math.min(...[...document.querySelectorAll('p, label, legend, output, b, pre')].map((element) => \
        parseFloat(getComputedStyle(element).fontSize)))";
    assert!(tab.number(smallest) >= 12.0, "{}", tab.number(smallest));
    assert_eq!(tab.console(), [""; 0]);
}

/// From behind the wall: words, a dimmed picture, and the same again when the view is back. For people who see it dark
/// and small, too.
fn where_nothing_was_photographed_it_is_said() {
    let browser = &Browser::needed();
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    for (size, is_phone, name) in [([1280, 800], false, "unseen.png"), ([390, 844], true, "unseen_phone.png")] {
        let tab = chromium.open(&program.address(), size, is_phone);
        tab.wait_for(FULL);
        let support = "document.getElementById('support')";
        assert_eq!(tab.evaluate(&format!("{support}.hidden")), true);
        // Half a turn around the subject.
        tab.evaluate(
            "window.back = { ...shows.pose, centre: shows.focus.map((value, i) => 2 * value - shows.pose.centre[i]) }",
        );
        for _ in 0..60 {
            tab.key("ArrowLeft");
            let is_there = tab.evaluate(
                "Math.hypot(...shows.pose.centre.map((value, i) => value - back.centre[i])) < 0.5 * \
                    shows.scene.distance",
            );
            if is_there == true {
                break;
            }
        }
        tab.wait_for(&format!("!{support}.hidden && {FULL}"));
        let said = tab.text(&format!("{support}.textContent"));
        assert!(said.starts_with("Not photographed from here: the photographs show "), "{said}");
        keep(&tab, name);
        tab.key("0");
        tab.wait_for(&format!("{support}.hidden && {FULL}"));
        assert_eq!(tab.console(), [""; 0]);
        tab.close();
    }
}

/// The share that was photographed is one of cameras alone: what held-out photographs say of a picture is said as well.
fn a_picture_that_is_poor_is_said_to_be_so() {
    let browser = &Browser::needed();
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    let tab = opened(&chromium, &program);
    let said = |seen: f32, frame: &str| {
        let told = format!(
            "import('./seen.js').then(({{ tellSeen }}) => {{ const place = {{}}; tellSeen(place, {seen}, {frame}); \
             return place.hidden ? 'nothing' : place.textContent; }})"
        );
        tab.text(&told)
    };
    assert_eq!(said(1.0, "undefined"), "nothing");
    assert_eq!(said(0.95, "{ expected: { psnr: 26.3 }, beyond: null }"), "nothing");
    let poor = "{ expected: { psnr: 17.4 }, beyond: null }";
    assert_eq!(said(0.95, poor), "It is poor: a PSNR of 17 dB is expected.");
    assert!(said(0.7, poor).starts_with("The photographs show 70 % of this. It is poor"));
    assert!(said(1.0, "{ expected: null, beyond: { unseen: 0.31 } }").contains("no photograph shows 31 %"));
    assert!(said(1.0, "{ expected: null, beyond: { far: 1.4 } }").contains("cannot be told"));
}

/// A pose is saved as a file that viewfuse reads, and the command line says how this view is rendered.
fn a_view_is_taken_elsewhere() {
    let browser = &Browser::needed();
    let program = room(&format!("{SMALL} --leave-out 0.5"));
    let chromium = Chromium::start(browser);
    let tab = opened(&chromium, &program);
    let status = text_in(&tab, "status");
    assert!(status.contains("; without ") && status.ends_with(" of least weight"), "{status}");
    let files = keep_downloads(&chromium);
    let permissions = json!({"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]});
    chromium.call(None, "Browser.grantPermissions", permissions);
    for _ in 0..4 {
        tab.key("ArrowLeft");
    }
    let folder = Folder::new();
    click(&tab, "save");
    let named = |stem: &str, end: &str| {
        let is_it = |name: &String| name.starts_with(stem) && name.ends_with(end);
        names_in(&files).into_iter().filter(is_it).collect::<Vec<String>>()
    };
    wait_until("nothing is saved", || named("view-", ".json").len() == 1 && names_in(&files).len() == 1);
    let name = named("view-", ".json").remove(0);
    let saved = files.join(&name);
    // With a photograph beside it, it is a scene of one view.
    fs::copy(&saved, folder.file("transforms.json")).expect("a copy");
    RgbImage::new(96, 72).save(folder.file("view.png")).expect("a picture");
    let scene = viewfuse::scene::Scene::open(&folder).expect("a scene");
    let pose = scene.views[0].camera.pose.to_opencv();
    let shown: Vec<f64> = numbers(&tab.evaluate("matrixOf(shows.pose).flat()"));
    for (number, shown) in pose.iter().flatten().zip(shown) {
        assert_near(f64::from(*number), shown, 1.0e-6);
    }
    tab.call("Page.bringToFront", json!({}));
    click(&tab, "copy");
    tab.wait_for("document.getElementById('said').textContent.startsWith('Copied')");
    let line = tab.text("navigator.clipboard.readText()");
    assert_eq!(line, text_in(&tab, "command"));
    let start =
        format!("viewfuse render tests/data/room --camera-path {name} --sources 003,004,005,006,007 --size 96x72");
    assert!(line.starts_with(&start) && line.ends_with(" --weights error:alpha=1 -o out"), "{line}");
    // The line renders what is shown.
    fs::copy(&saved, folder.file(&name)).expect("a copy");
    done_by_line(&folder, &line);
    let rendered = image::open(folder.join("out/view.png")).expect("a picture").to_rgb8();
    let (_, picture) =
        program.connect().picture(&request("x", &tab.evaluate("matrixOf(shows.pose)"), false)).unpacked();
    assert!(rendered == picture, "the command line renders another picture");
    // The picture is saved with the values that the run recorded.
    click(&tab, "save-picture");
    wait_until("no picture is saved", || names_in(&files).len() == 3 && named("run-", ".json").len() == 1);
    let of_page = image::open(files.join(named("view-", ".png").concat())).expect("a picture").to_rgb8();
    assert!(of_page == rendered, "another picture is saved");
    let (saved, run) = (read_json(files.join(named("run-", ".json").concat())), read_json(folder.join("out/run.json")));
    for key in ["viewfuse", "device", "field", "weighting", "chosen", "size", "background", "sources", "depth_units"] {
        assert_eq!(saved[key], run[key], "{key}");
    }
    for key in ["world_from_camera", "weights", "left_out", "depth_step"] {
        assert_near_all(&saved["frames"][0][key], &run["frames"][0][key], key);
    }
    // A view of the scene that is no source has a name.
    tab.evaluate("goTo(shows.scene.others[0].pose)");
    let line = text_in(&tab, "command");
    assert!(line.contains("render tests/data/room --targets 000 --sources"), "{line}");
    assert_eq!(tab.console(), [""; 0]);
}

/// Values of two records are the same but for the rounding of a pose that went through a file.
#[track_caller]
fn assert_near_all(one: &Value, other: &Value, what: &str) {
    match (one.as_array(), other.as_array()) {
        (Some(all), Some(others)) => {
            assert_eq!(all.len(), others.len(), "{what}");
            all.iter().zip(others).for_each(|(one, other)| assert_near_all(one, other, what));
        }
        _ => match (one.as_f64(), other.as_f64()) {
            (Some(one), Some(other)) => assert_near(one, other, 1.0e-5),
            _ => assert_eq!(one, other, "{what}"),
        },
    }
}

/// Views are added, removed and played, and the path that is saved is one that `render` takes.
fn a_path_goes_through_keyframes() {
    let browser = &Browser::needed();
    let program = room(SMALL);
    let chromium = Chromium::start(browser);
    let tab = opened(&chromium, &program);
    let files = keep_downloads(&chromium);
    assert_eq!(tab.evaluate("document.getElementById('play').disabled"), true);
    let centre = "shows.pose.centre";
    let first = numbers(&tab.evaluate(centre));
    for _ in 0..3 {
        click(&tab, "add-keyframe");
        (0..4).for_each(|_| tab.key("ArrowLeft"));
    }
    let last = numbers(&tab.evaluate("shows.keyframes[2].pose.centre"));
    tab.evaluate("document.querySelector('#keyframes li:nth-child(2) button:last-child').click()");
    assert_eq!(tab.number("shows.keyframes.length"), 2.0);
    choose(&tab, "frames", "3", "input");
    keep(&tab, "keyframes.png");
    // Played to its end, it is at the last keyframe.
    click(&tab, "play");
    tab.wait_for("document.getElementById('play').textContent === 'Play'");
    let played = numbers(&tab.evaluate(centre));
    (0..3).for_each(|i| assert_near(played[i], last[i], 1.0e-6));
    // A key stops it.
    choose(&tab, "frames", "2000", "input");
    click(&tab, "play");
    tab.wait_for("document.getElementById('play').textContent === 'Stop'");
    tab.key("ArrowLeft");
    assert_eq!(text_in(&tab, "play"), "Play");
    choose(&tab, "frames", "3", "input");
    click(&tab, "save-video");
    let format = tab.text("shows.scene.video.format");
    let film = files.join(format!("video.{format}"));
    wait_until("no video is saved", || film.exists());
    assert!(text_in(&tab, "said").ends_with(": 3 frames."));
    tab.wait_for("document.getElementById('save-video').textContent === 'Save video'");
    if format == "webp" {
        let bytes = fs::read(&film).expect("a video");
        assert!(bytes.starts_with(b"RIFF") && bytes.windows(4).filter(|word| word == b"ANMF").count() == 3);
    }
    fs::remove_file(film).expect("a file");
    click(&tab, "save-path");
    let is_saved = |name: &String| name.starts_with("path-") && name.ends_with(".json");
    wait_until("no path is saved", || matches!(&names_in(&files)[..], [name] if is_saved(name)));
    let name = names_in(&files).concat();
    let saved = files.join(&name);
    let folder = Folder::new();
    fs::copy(&saved, folder.file(&name)).expect("a copy");
    let line = text_in(&tab, "path-command");
    assert!(line.contains(&format!("--camera-path {name}")), "{line}");
    done_by_line(&folder, &line);
    let written = names_in(&folder.join("out"));
    for name in ["view_0.png", "view_1.png", "view_2.png", "video.webp"] {
        assert!(written.iter().any(|file| file == name), "{name} is not in {written:?}");
    }
    // Around the subject: in the middle as far from it as at both ends, within the scene's own units.
    let scene = read_json(saved);
    let about = tab.evaluate("({focus: shows.focus, origin: shows.scene.origin, scale: shows.scene.scale})");
    let (focus, origin) = (numbers(&about["focus"]), numbers(&about["origin"]));
    let scale = number_of(&about["scale"]);
    let place = |frame: usize, axis: usize| {
        let matrix = &scene["frames"][frame]["transform_matrix"];
        (number_of(&matrix[axis][3]) - origin[axis]) / scale
    };
    let distance = |frame: usize| (0..3).map(|axis| (place(frame, axis) - focus[axis]).powi(2)).sum::<f64>().sqrt();
    assert_near(distance(1), distance(0), 1.0e-6);
    (0..3).for_each(|axis| assert_near(place(0, axis), first[axis], 1.0e-6));
    assert_eq!(tab.console(), [""; 0]);
}

/// Without `--weights` the page begins at once, and shows the scheme that `render` takes when it is known.
fn the_scheme_becomes_that_of_render() {
    let browser = &Browser::needed();
    let folder = toy();
    let options = "--sources 000000..000011 --size 48x48";
    let program = super::start(&folder, &format!("toy {options}"));
    let chromium = Chromium::start(browser);
    let tab = opened(&chromium, &program);
    tab.wait_for("shows.first !== null");
    tab.wait_for(&format!("{FULL} && shows.shown.scheme === shows.first"));
    let chosen = tab.text("shows.first");
    let told = text_in(&tab, "choosing");
    assert!(told.starts_with(&chosen), "{told}");
    assert!(chosen.starts_with(&tab.text("document.getElementById('scheme').value")));
    let line = text_in(&tab, "command");
    assert!(line.ends_with(" --weights auto -o out"), "{line}");
    // A picture of the same scheme that was made before has not what was chosen along with it.
    let files = keep_downloads(&chromium);
    let command = || {
        click(&tab, "save-picture");
        // The browser makes an empty file first.
        let is_whole = |text: Vec<u8>| serde_json::from_slice::<Value>(&text).is_ok();
        let record = || names_in(&files).into_iter().find(|name| name.starts_with("run-") && name.ends_with(".json"));
        let record = || record().map(|name| files.join(name));
        wait_until("nothing is saved", || record().is_some_and(|path| fs::read(path).is_ok_and(is_whole)));
        let saved = record().expect("a record");
        let command = read_json(&saved)["command"].to_string();
        fs::remove_file(saved).expect("a record");
        command
    };
    assert!(command().contains("--weights auto"));
    tab.evaluate("shows.shown.record.chosen = null");
    let said = command();
    assert!(said.contains(&format!("--weights {chosen}")), "{said}");
    done_with_warnings(&folder, &format!("render toy --targets 000020 {options} --device cpu -o out"));
    let record = read_json(folder.join("out/run.json"));
    assert_eq!(record["weighting"], chosen.as_str());
    // What the person chooses is kept, and its command line names it.
    choose(&tab, "scheme", "mean", "change");
    tab.wait_for("shows.shown.scheme === 'mean'");
    let line = text_in(&tab, "command");
    assert!(line.ends_with(" --weights mean -o out"), "{line}");
    assert_eq!(tab.console(), [""; 0]);
}

/// Whoever made a scene chose the names of its folder and of its views: pasted into a shell, they are words.
fn names_from_files_are_no_commands() {
    let browser = &Browser::needed();
    const NAME: &str = "$(touch pwned)';touch pwned;#{weights} $& \u{1b}[201~";
    let folder = toy();
    let scene = folder.join("{view}$'{weights}");
    fs::rename(folder.join("toy"), &scene).expect("renamed");
    const LONG: &str = "DSC_2024_a_long_name_of_a_photograph_000001";
    for (part, ending) in [("rgb", "png"), ("pose", "txt")] {
        let path = |name: &str| scene.join(part).join(format!("{name}.{ending}"));
        for (before, name) in [("000020", NAME), ("000001", LONG)] {
            fs::rename(path(before), path(name)).expect("renamed");
        }
    }
    let mut arguments =
        command(&folder, &format!("view --sources 000000,000002,{LONG} --size 24x24 --no-browser --device cpu"));
    arguments.arg("{view}$'{weights}");
    let program = Program::of(arguments);
    let chromium = Chromium::start(browser);
    let tab = opened(&chromium, &program);
    // A long name takes no room of another one, and its end can be read.
    let names = "[...document.querySelectorAll('#sources .name')]";
    assert_eq!(tab.evaluate(&format!("{names}.every((element) => element.scrollWidth <= element.clientWidth)")), true);
    assert!(tab.text(&format!("{names}.map((element) => element.textContent).join(' ')")).contains("_000001"));
    let name = serde_json::to_string(NAME).expect("JSON");
    tab.evaluate(&format!("goTo(shows.scene.others.find((element) => element.name === {name}).pose)"));
    let line = text_in(&tab, "command");
    assert!(!line.chars().any(char::is_control), "{line:?}");
    let script = format!("viewfuse() {{ printf '%s\\n' \"$@\"; }}\n{line}\n");
    let words = Command::new("bash").args(["-c", &script]).current_dir(&folder).output().expect("bash");
    let words = String::from_utf8(words.stdout).expect("text");
    let expected = format!("render\n{{view}}$'{{weights}}\n--targets\n{NAME}\n--sources\n");
    assert!(words.starts_with(&expected), "{line}\n{words}");
    assert!(!folder.join("pwned").exists());
}
