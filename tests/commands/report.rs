//! `viewfuse-lab report`: the page as text, and as a browser shows it.
//!
//! The browser is Chromium or Chrome: `VIEWFUSE_BROWSER`, or the first that is found. Without one its tests are ignored
//! and say why; with `VIEWFUSE_REQUIRE_BROWSER=1` they fail instead. Pictures of the page, to be looked at, are left in
//! `tmp/report` of the target folder.

use super::browser::{Browser, REQUIRE};
use super::{assert_refused, assert_wrong_arguments, done, list_of, text_of};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use viewfuse_tests::command::{files_below, toy};
use viewfuse_tests::scenes::Folder;

const SMALL: &str =
    "--size 24x24 --device cpu --weights mean --weights distance:power=2 --weights error:alpha=1,angle=full";

viewfuse_tests::trials![
    the_page_holds_everything,
    evaluations_under_way_are_shown,
    what_is_no_record_is_refused,
    a_received_folder_shows_only_its_own,
    damaged_numbers_are_refused;
    Browser::missing(), REQUIRE =>
        a_person_sees_what_was_measured,
        light_and_dark,
        the_looks_at_the_page_can_fail,
];

/// The sample scene twice, three evaluations of it, a sweep and a training.
fn runs() -> Folder {
    let folder = toy();
    for (file, _) in files_below(&folder.join("toy")).into_iter().filter(|(file, _)| file.is_file()) {
        let inside = file.strip_prefix(folder.join("toy")).expect("inside").display().to_string();
        fs::copy(&file, folder.file(&format!("lorry/{inside}"))).expect("a copy");
    }
    done(&folder, &format!("evaluate toy lorry --protocol count:sources=2+4+8 {SMALL} -o count"));
    done(&folder, &format!("evaluate toy lorry --protocol random {SMALL} --pictures 1 -o random"));
    done(&folder, "pareto toy --targets 20 --views 3 --size 16x16 --repeat 1 --device cpu -o sweep");
    folder.write(
        "trained/record.json",
        json!({"steps": 12, "settings": {"rate": 0.001}, "scores": (0..20).collect::<Vec<_>>()}).to_string(),
    );
    folder.write(
        "trained/curve.svg",
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"90\" height=\"48\"><path d=\"M0 0L90 48\"/></svg>",
    );
    folder
}

const REPORT: &str = "report count random --pareto sweep/pareto.json --training trained -o page.html";

fn page(folder: &Path) -> String {
    fs::read_to_string(folder.join("page.html")).expect("a page")
}

fn the_page_holds_everything() {
    let folder = runs();
    let said = done(&folder, REPORT);
    assert!(said.starts_with("page.html: ") && said.ends_with(" kB\n"), "{said}");
    let first = page(&folder);
    // No address but those that hold what they point to, and those on the page.
    for attribute in ["src=\"", "href=\"", "url("] {
        for rest in first.split(attribute).skip(1) {
            assert!(
                rest.starts_with("data:") || rest.starts_with('#'),
                "{attribute}{}",
                rest.chars().take(60).collect::<String>()
            );
        }
    }
    assert!(!first.contains("<script") && first.contains("Content-Security-Policy"));
    // Three jobs of one scene with 2, 4 and 8 sources, one of the other scene, one of the other evaluation.
    let sources = 2 + 4 + 8 + 2 + 3;
    // The truth, the nearest copy and every scheme; below the last two their errors.
    assert_eq!(first.matches("data:image/png;base64,").count(), sources + 5 * (1 + 2 + 2 * 3));
    assert_eq!(first.matches("nearest copy</figcaption>").count() + first.matches("nearest copy<br>").count(), 5);
    assert!(first.contains("<a href=\"#section-1\">Number of sources: training-free</a>"), "no field in the contents");
    assert_eq!(first.matches("data:image/svg+xml;base64,").count(), 1);
    for part in [
        "<h2>Number of sources</h2>",
        "<h2>Random sources and targets</h2>",
        "<h2>Error over run time: training-free</h2>",
        "<h2>Training: trained</h2>",
        "count:sources=2+4+8",
        "<th scope=\"row\">--size</th><td>24x24</td>",
        "<th scope=\"row\">settings.rate</th><td>0.001</td>",
        "<td>20 entries, the last 19</td>",
    ] {
        assert!(first.contains(part), "no {part}");
    }
    // The same again is the same page, and the records alone are one as well.
    done(&folder, REPORT);
    assert_eq!(page(&folder), first);
    done(&folder, "report --training trained --title <b>&amp; -o page.html");
    assert!(page(&folder).contains("<h1>&lt;b&gt;&amp;amp;</h1>"));
}

fn evaluations_under_way_are_shown() {
    let folder = toy();
    done(&folder, &format!("evaluate toy --protocol random --trials 5 {SMALL} --shard 1/2 -o half"));
    done(&folder, "report half -o page.html");
    assert!(page(&folder).contains("<strong>Not finished: </strong>2 of 5 jobs"), "{}", page(&folder));
    assert!(page(&folder).contains("Missing: 0, 2, 4."));
    // Nothing at all is done yet.
    fs::remove_file(folder.join("half/scores-1-of-2.jsonl")).expect("a journal");
    done(&folder, "report half -o page.html");
    assert!(page(&folder).contains("0 of 5 jobs") && !page(&folder).contains("warped copy"));
}

fn what_is_no_record_is_refused() {
    let folder = toy();
    let refused = |arguments: &str, parts: &[&str]| assert_refused(&folder, arguments, parts);
    refused("report toy -o page.html", &["toy/run.json: cannot be read"]);
    refused(
        "report --pareto toy/intrinsics.txt -o page.html",
        &["toy/intrinsics.txt: is not a record of viewfuse pareto"],
    );
    refused("report --training toy -o page.html", &["toy/record.json: cannot be read"]);
    refused("report --training toy -o toy", &["toy: cannot be written: it is a folder"]);
    assert_wrong_arguments(&folder, "report -o page.html", &["required"]);
    done(&folder, &format!("evaluate toy --protocol random {SMALL} -o out"));
    fs::remove_file(folder.join("out/pictures/job-00000-truth.png")).expect("a picture");
    refused("report out -o page.html", &["out/pictures/job-00000-truth.png: cannot be read"]);
    fs::write(folder.join("out/pictures/job-00000.json"), "{}").expect("a file");
    refused("report out -o page.html", &["out/pictures/job-00000.json: does not describe pictures"]);
}

/// The number that a cell begins with.
fn number(text: &str) -> f64 {
    let first = text.split_whitespace().next().unwrap_or_default();
    first.parse().unwrap_or_else(|_| panic!("{text:?} is no number"))
}

/// Where something is bold in a column, as the browser shows it, the best values are, and not all; nothing else is
/// marked.
#[track_caller]
fn assert_marks(table: &Value) {
    let header: Vec<&str> = list_of(&table["header"]).iter().filter_map(Value::as_str).collect();
    let rows: Vec<&Vec<Value>> = list_of(&table["rows"]).iter().filter_map(Value::as_array).collect();
    assert!(rows.len() > 3 || !header[0].contains("weighting"), "{table}");
    for (column, title) in header.iter().enumerate() {
        let larger_is_better = title.ends_with('↑');
        if !larger_is_better && !title.ends_with('↓') {
            assert!(rows.iter().all(|row| row[column]["bold"].is_null()), "{title}: {table}");
            continue;
        }
        let bold = rows.iter().filter(|row| !row[column]["bold"].is_null()).count();
        assert!(bold < rows.len(), "{title}: {table}");
        let key = |row: &&Vec<Value>| {
            let value = number(text_of(&row[column]["text"]));
            if larger_is_better { -value } else { value }
        };
        let best = rows.iter().map(key).fold(f64::INFINITY, f64::min);
        for row in &rows {
            let cell = &row[column];
            assert!(cell["underlined"].is_null(), "{title}: {cell}");
            assert!(bold == 0 || key(row) > best || !cell["bold"].is_null(), "{title}: the best is not bold: {cell}");
        }
    }
}

fn a_person_sees_what_was_measured() {
    let browser = &Browser::needed();
    let folder = runs();
    done(&folder, REPORT);
    let page = page(&folder);
    let seen = browser.look(&page);
    assert_eq!(seen.console, "", "the browser complains");
    let views = seen.views.as_array().expect("a view for each width");
    assert_eq!(views.iter().map(|view| view["width"].as_u64()).collect::<Vec<_>>(), [Some(360), Some(768), Some(1280)]);
    for view in views {
        let width = &view["width"];
        assert!(view["scrollWidth"].as_u64() <= width.as_u64(), "wider than its {width}: {}", view["scrollWidth"]);
        assert_eq!(
            (&view["wide"], &view["broken"], &view["resources"]),
            (&json!([]), &json!([]), &json!([])),
            "at {width}"
        );
        assert_eq!(view["images"], page.matches("<img ").count(), "at {width}");
        // Three metrics with a figure and one of differences each, and the sweep.
        assert_eq!((&view["scripts"], &view["figures"]), (&json!(0), &json!(7)), "at {width}");
        assert!(view["smallestText"].as_f64().is_some_and(|size| size >= 11.0), "{}", view["smallestText"]);
        let tables = list_of(&view["tables"]);
        assert_eq!(tables.len(), 3 + 1 + 1);
        tables.iter().for_each(|table| assert_marks(table));
    }
    // The cells are the table's that the command prints.
    let printed = done(&folder, &format!("evaluate toy lorry --protocol random {SMALL} --pictures 1 -o random"));
    let row = printed.lines().find(|line| line.starts_with(" distance:power=2")).expect("a row");
    let words = |text: &str| text.replace(['*', '~'], "").split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let rows = list_of(&views[0]["tables"][3]["rows"]);
    let cells =
        rows.iter().filter_map(Value::as_array).find(|row| row[0]["text"] == "distance:power=2").expect("a row");
    let shown: Vec<String> = cells.iter().flat_map(|cell| words(text_of(&cell["text"]))).collect();
    assert_eq!(shown, words(row));
    // What is bold has its mark on the terminal, and nothing else.
    let counted = done(&folder, &format!("evaluate toy lorry --protocol count:sources=2+4+8 {SMALL} -o count"));
    let tables = list_of(&views[0]["tables"]);
    let mut marks = [0, 0];
    for (printed, tables) in [(&counted, &tables[..3]), (&printed, &tables[3..4])] {
        let rows = tables.iter().flat_map(|table| list_of(&table["rows"]).iter());
        let schemes: Vec<&str> = rows.clone().filter_map(|row| row[0]["text"].as_str()).collect();
        let is_row = |line: &&str| schemes.iter().any(|scheme| line.trim_start().starts_with(&format!("{scheme} ")));
        let lines: Vec<&str> = printed.lines().filter(is_row).collect();
        assert_eq!(lines.len(), schemes.len(), "{printed}");
        for (row, line) in rows.zip(lines) {
            for cell in list_of(row).iter().skip(1) {
                let text = text_of(&cell["text"]);
                let is_marked = !text.is_empty() && line.contains(&format!("* {text} "));
                assert_eq!(!cell["bold"].is_null(), is_marked, "{text} of {line}");
                marks[usize::from(is_marked)] += 1;
            }
        }
    }
    assert!(marks.iter().all(|count| *count > 0), "{marks:?}");
}

/// The negative control: pages on which something is wrong are not taken for good ones.
fn the_looks_at_the_page_can_fail() {
    let browser = &Browser::needed();
    let folder = toy();
    done(&folder, &format!("evaluate toy --protocol random {SMALL} --pictures 0 -o out"));
    done(&folder, "report out -o page.html");
    let good = page(&folder);
    let with = |addition: &str| browser.look(&good.replace("</main>", &format!("{addition}</main>")));
    let wide = with("<p style=\"width: 400px\">x</p>");
    assert_eq!(wide.views[0]["wide"], json!(["P."]));
    assert!(wide.views[0]["scrollWidth"].as_u64() > Some(360));
    // The page's own policy keeps the network out, and the browser says so.
    let foreign = with("<img alt=\"foreign\" src=\"http://example.invalid/x.png\">");
    assert_eq!(foreign.views[0]["broken"], json!(["foreign"]));
    assert!(foreign.console.contains("Content Security Policy"), "{:?}", foreign.console);
    // Without the policy it would be asked for.
    let open = good.replace("default-src 'none'", "default-src *").replace("img-src data:", "img-src *");
    let asked = browser.look(&open.replace("</main>", "<img src=\"http://example.invalid/x.png\"></main>"));
    assert_eq!(asked.views[0]["resources"], json!(["http://example.invalid/x.png"]));
    // A mark in the wrong place.
    let unmarked = good.replace("<b>", "").replace("</b>", "");
    let table = &browser.look(&unmarked.replacen("<td>", "<td><b>0</b> ", 1)).views[0]["tables"][0];
    assert!(std::panic::catch_unwind(|| assert_marks(table)).is_err());
}

fn light_and_dark() {
    let browser = &Browser::needed();
    let folder = small_run();
    done(&folder, "report run -o page.html");
    let pictures = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
    fs::create_dir_all(&pictures).expect("a folder");
    for (name, width, is_dark) in
        [("phone", 360, false), ("phone-dark", 360, true), ("desktop", 1280, false), ("desktop-dark", 1280, true)]
    {
        let file = pictures.join(format!("{name}.png"));
        let picture = browser.picture(&folder.join("page.html"), &file, width, is_dark);
        assert_eq!(picture.width(), width, "{name}");
        // The page's margin is its background; somewhere on it there are words.
        let background = picture.get_pixel(2, 2).0.map(u32::from);
        let brightness = (background[0] + background[1] + background[2]) / 3;
        assert!(if is_dark { brightness < 60 } else { brightness > 240 }, "{name}: {background:?}");
        let far = |pixel: &image::Rgb<u8>| {
            pixel.0.iter().zip(background).any(|(level, other)| u32::from(*level).abs_diff(other) > 120)
        };
        assert!(picture.pixels().filter(|pixel| far(pixel)).count() > 1000, "{name} shows nothing");
    }
}

/// An evaluation of two jobs, with pictures of one.
fn small_run() -> Folder {
    let folder = toy();
    let run = "evaluate toy --protocol random --trials 2 --targets-per-trial 1 --pictures 1 --size 16x16 --device cpu";
    done(&folder, &format!("{run} --weights mean -o run"));
    folder
}

/// A folder that somebody sent must not bring files of whoever makes the page onto the page.
fn a_received_folder_shows_only_its_own() {
    let folder = small_run();
    folder.write("secret.png", "a key").write("run/secret.png", "a key").write("run/pictures/key.txt", "a key");
    folder.write("run/pictures/false.png", "a key");
    let file = folder.join("run/pictures/job-00000.json");
    let text = fs::read_to_string(&file).expect("a description");
    let truth = "job-00000-truth.png";
    assert!(text.contains(truth));
    let absolute = folder.join("secret.png");
    for name in [
        absolute.to_str().expect("text"),
        "../secret.png",
        "../../secret.png",
        "./job-00000-truth.png",
        "/etc/passwd",
        "key.txt",
        "",
        "..",
        "C:secret.png",
    ] {
        for old in [truth, "job-00000-source-000.png", "job-00000-scheme-000.png"] {
            fs::write(&file, text.replace(old, name)).expect("a file");
            let parts = ["run/pictures/job-00000.json: names", "no picture in the folder"];
            assert_refused(&folder, "report run -o page.html", &parts);
        }
    }
    fs::write(&file, text.replace(truth, "false.png")).expect("a file");
    assert_refused(&folder, "report run -o page.html", &["run/pictures/false.png: is not a PNG"]);
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        fs::copy(folder.join("toy/rgb/000000.png"), folder.join("mine.png")).expect("a picture");
        symlink(folder.join("mine.png"), folder.join("run/pictures/link.png")).expect("a link");
        fs::write(&file, text.replace(truth, "link.png")).expect("a file");
        assert_refused(&folder, "report run -o page.html", &["link.png", "no picture in the folder"]);
        folder.write("trained/record.json", "{}");
        symlink("/etc/passwd", folder.join("trained/curve.svg")).expect("a link");
        assert_refused(&folder, "report --training trained -o page.html", &["curve.svg: is not the curve"]);
    }
    fs::write(&file, text).expect("a file");
    done(&folder, "report run -o page.html");
}

fn damaged_numbers_are_refused() {
    let folder = small_run();
    let change = |name: &str, change: &dyn Fn(&mut Value)| {
        let text = fs::read_to_string(folder.join(name)).expect("a record");
        let mut value: Value =
            serde_json::from_str(text.lines().next().filter(|_| name.ends_with('l')).unwrap_or(&text)).expect("JSON");
        change(&mut value);
        fs::write(folder.join(name), format!("{value}\n")).expect("a file");
        text
    };
    let refused = |parts: &[&str]| assert_refused(&folder, "report run -o page.html", parts);
    for count in [1_000_000_000_000_000_000_u64, 10_000_001] {
        let whole = change("run/run.json", &|record| record["job_count"] = count.into());
        refused(&["run/run.json: job_count is", &count.to_string(), "at most 10000000"]);
        fs::write(folder.join("run/run.json"), whole).expect("a file");
    }
    let journal = "run/scores-0-of-1.jsonl";
    for value in [json!(1.0e308), json!(-1.0e308), json!("none"), json!("1e300")] {
        let whole = change(journal, &|line| line["scores"][0]["values"][0][1] = value.clone());
        refused(&["scores-0-of-1.jsonl:1: is not of an evaluation", "psnr is"]);
        fs::write(folder.join(journal), whole).expect("a file");
    }
    for value in [1.0e18, -1.0] {
        let whole = change(journal, &|line| line["scores"][0]["seconds"] = value.into());
        refused(&["scores-0-of-1.jsonl:1: is not of an evaluation", "seconds is"]);
        fs::write(folder.join(journal), whole).expect("a file");
    }
    done(&folder, "pareto toy --targets 20 --views 3 --size 16x16 --repeat 1 --device cpu -o sweep");
    let text = fs::read_to_string(folder.join("sweep/pareto.json")).expect("a sweep");
    for key in ["seconds", "encode_seconds", "gain", "truth_psnr"] {
        let mut record: Value = serde_json::from_str(&text).expect("JSON");
        record["devices"][0]["points"][1][key] = 1.0e300.into();
        folder.write("sweep/pareto.json", record.to_string());
        let parts = ["sweep/pareto.json: is not a record of viewfuse pareto", "out of its range"];
        assert_refused(&folder, "report --pareto sweep -o page.html", &parts);
    }
    // An empty record of settings is that of a machine that lost its power: the evaluation goes on.
    folder.write("run/run.json", "");
    let run = "evaluate toy --protocol random --trials 2 --targets-per-trial 1 --pictures 1 --size 16x16 --device cpu";
    assert!(done(&folder, &format!("{run} --weights mean -o run")).contains("0 jobs done; 2 of 2"));
}
