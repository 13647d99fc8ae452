//! `--masks`: what masks and alpha channels hide takes no part in pictures and scores.

use super::{assert_refused, assert_wrong_arguments, done, number_of, read_json, run};
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use viewfuse_tests::command::{Outcome, sample};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    what_masks_hide_takes_no_part,
    kept_pictures_have_the_scores_of_the_table,
    what_is_unclear_is_asked,
    what_shows_nothing_is_not_scored,
];

/// Rows that show the car that carried the camera: 8 % of the photograph, the same in all.
const BONNET: u32 = 221;

/// The scene `room` with the bonnet of a car in the photographs, of whose pixels `shown` makes files.
fn driven(shown: impl Fn(&Folder, &str, RgbImage)) -> Folder {
    let folder = sample("room");
    for view in 0..11 {
        let name = format!("{view:03}");
        let mut photograph =
            image::open(folder.join(format!("room/images/{name}.jpg"))).expect("a photograph").into_rgb8();
        for (x, y, pixel) in photograph.enumerate_pixels_mut().filter(|(_, y, _)| *y >= BONNET) {
            *pixel = Rgb([if (x / 7 + y / 5) % 2 == 0 { 230 } else { 10 }, 20, 120]);
        }
        shown(&folder, &name, photograph);
    }
    folder
}

fn put(folder: &Folder, name: &str, picture: impl Into<DynamicImage>) {
    picture.into().save_with_format(folder.file(&format!("room/{name}")), ImageFormat::Png).expect("a picture");
}

/// The score of view 5 from the others, and what was said.
fn rendered(folder: &Folder, more: &str) -> (f64, String) {
    let render = "render room --targets 5 --size 112x84 --weights error:alpha=1 --device cpu --no-sheets -o out";
    let Outcome { code, stderr, .. } = run(folder, &format!("{render} --replace {more}"));
    assert_eq!(code, Some(0), "{stderr}");
    let record = read_json(folder.join("out/run.json"));
    (number_of(&record["frames"][0]["psnr"]), stderr)
}

/// The score where nothing is said.
fn score(folder: &Folder, more: &str) -> f64 {
    let (psnr, said) = rendered(folder, more);
    assert_eq!(said, "");
    psnr
}

fn what_masks_hide_takes_no_part() {
    let plain = score(&sample("room"), "");
    let mask = |counts: bool| GrayImage::from_fn(320, 240, |_, y| Luma([if (y < BONNET) == counts { 255 } else { 0 }]));
    let colmap = driven(|folder, name, photograph| {
        put(folder, &format!("images/{name}.jpg"), photograph);
        put(folder, &format!("masks/{name}.jpg.png"), mask(true));
    });
    let printed = done(colmap.path(), "inspect room");
    let line = "read as    masks: pixels that do not count, 11 files, 8 % of the pixels";
    assert!(printed.lines().any(|printed| printed == line), "{printed}");
    let masked = score(&colmap, "");
    assert!((masked - plain).abs() < 0.7, "{masked} dB, and {plain} dB without a bonnet");
    assert_eq!(score(&colmap, "--background none"), masked, "masks are not dropped");
    assert_eq!(score(&colmap, "--masks ignore"), masked);
    let shown = score(&colmap, "--masks none");
    assert!(shown < masked - 1.0, "{shown} dB where the bonnet is taken for a part of the room");

    let instant = driven(|folder, name, photograph| {
        put(folder, &format!("images/{name}.jpg"), photograph);
        put(folder, &format!("images/dynamic_mask_{name}.png"), mask(false));
    });
    assert_eq!(score(&instant, ""), masked, "the same masks");

    // Holes in the photographs themselves, and two pixels in a corner of one.
    let rgba = |photograph: &RgbImage, hidden: &dyn Fn(u32, u32) -> bool| {
        RgbaImage::from_fn(320, 240, |x, y| {
            let Rgb([r, g, b]) = *photograph.get_pixel(x, y);
            Rgba([r, g, b, if hidden(x, y) { 0 } else { 255 }])
        })
    };
    let holes = driven(|folder, name, photograph| {
        put(folder, &format!("images/{name}.jpg"), rgba(&photograph, &|_, y| y >= BONNET));
    });
    let corner = sample("room");
    let photograph = image::open(corner.join("room/images/003.jpg")).expect("a photograph").into_rgb8();
    put(&corner, "images/003.jpg", rgba(&photograph, &|x, y| x < 2 && y == 0));
    for (folder, count, expected, tolerance) in [(&holes, 10, masked, 0.3), (&corner, 1, plain, 0.05)] {
        let (psnr, said) = rendered(folder, "");
        assert!(said.contains(&format!("{count} photographs have an alpha channel that is opaque")), "{said}");
        assert!((psnr - expected).abs() < tolerance, "{psnr} dB instead of {expected} dB");
        assert_eq!(score(folder, "--masks ignore"), psnr);
    }
}

fn kept_pictures_have_the_scores_of_the_table() {
    let folder = driven(|folder, name, photograph| {
        put(folder, &format!("images/{name}.jpg"), photograph);
        let mask = GrayImage::from_fn(320, 240, |_, y| Luma([if y < BONNET { 255 } else { 0 }]));
        put(folder, &format!("masks/{name}.jpg.png"), mask);
    });
    let evaluate = "evaluate room --protocol nearest:3 --targets 5 --size 80x60 --weights mean --device cpu -o out";
    let Outcome { code, stderr, .. } = run(&folder, evaluate);
    assert_eq!(code, Some(0), "{stderr}");
    let table = std::fs::read_to_string(folder.join("out/scores.csv")).expect("a table");
    let shown = read_json(folder.join("out/pictures/job-00000.json"));
    for (scheme, shown) in [("nearest copy", &shown["copy"]["psnr"]), ("mean", &shown["schemes"][0]["values"][0][1])] {
        let row = table.lines().find(|line| line.contains(&format!(",{scheme},"))).expect("a row");
        let scored: f64 = row.split(',').nth(6).expect("PSNR").parse().expect("a number");
        assert!((number_of(shown) - scored).abs() < 1e-5, "{scheme}: {shown} {scored}");
    }
}

fn what_is_unclear_is_asked() {
    let folder = driven(|folder, name, photograph| {
        put(folder, &format!("images/{name}.jpg"), photograph);
        let inverted = GrayImage::from_fn(320, 240, |_, y| Luma([if y < BONNET { 0 } else { 255 }]));
        put(folder, &format!("masks/{name}.jpg.png"), inverted);
    });
    let parts = ["room/masks/", "leave 8 % of the photographs", "inverted", "--masks object or --masks ignore"];
    assert_refused(folder.path(), "render room --targets 5 --size 32x24 --device cpu -o out", &parts);
    for layout in ["transforms", "colmap", "srn"] {
        assert_refused(folder.path(), &format!("export room --layout {layout} -o out"), &parts);
    }
    let printed = done(folder.path(), "inspect room");
    assert!(printed.contains("read as    masks: unclear whether"), "{printed}");
    let wrong = "render room --targets 5 -o out --masks person";
    assert_wrong_arguments(folder.path(), wrong, &["'person' is not a meaning of masks: auto, object, ignore or none"]);
}

/// A failed segmentation: a mask that is black takes part in no score, which would be perfect.
fn what_shows_nothing_is_not_scored() {
    let folder = sample("room");
    for view in 0..11 {
        let counts = |x: u32, y: u32| Luma([if view != 4 && (x, y) != (9, 9) { 255 } else { 0 }]);
        put(&folder, &format!("masks/{view:03}.png"), GrayImage::from_fn(320, 240, counts));
    }
    let render = "render room --targets 4,5 --size 80x60 --fast --device cpu -o out";
    let Outcome { code, stdout, stderr } = run(&folder, render);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(stderr.contains("'004' is not compared with its photograph, of which nothing counts"), "{stderr}");
    let lines: Vec<&str> = stdout.lines().collect();
    assert!(!lines[0].contains("PSNR") && lines[1].contains("005.png  PSNR 2"), "{stdout}");
    let with = "--sources 0..3 --size 80x60 --weights mean --device cpu";
    let scored = |targets: &str| {
        let Outcome { code, stdout, .. } = run(&folder, &format!("evaluate room --targets {targets} {with}"));
        assert_eq!(code, Some(0), "{stdout}");
        stdout
            .lines()
            .find(|line| line.starts_with(" mean "))
            .expect("a row")
            .split_whitespace()
            .nth(1)
            .map(str::to_owned)
    };
    assert_eq!(scored("4,5"), scored("5"), "the other one counts alone");
    let nothing = |evaluate: &str| {
        let Outcome { code, stdout, stderr } = run(&folder, &format!("evaluate room --targets 4 {evaluate}"));
        let last = stderr.lines().last().unwrap_or_default();
        assert!(last.starts_with("viewfuse: room: nothing can be scored: of the photographs"), "{stderr}");
        assert_eq!((code, &stdout[..]), (Some(1), ""));
    };
    nothing(with);
    // Each target from sources of its own, and as a job of its own.
    let with = "--size 64x48 --weights mean --device cpu";
    for each in [format!("evaluate room {with}"), format!("evaluate room --protocol nearest:3 {with} -o jobs")] {
        let Outcome { code, stdout, stderr } = run(&folder, &format!("{each} --targets 4,5"));
        assert_eq!(code, Some(0), "{stderr}");
        assert!(stderr.contains("'004' is not scored: of its photograph nothing counts"), "{stderr}");
        assert!(stdout.contains(": 1 target") || stdout.contains(", 1 picture of each scheme"), "{stdout}");
    }
    nothing(&format!("--protocol nearest:3 {with}"));
    let optimise = "optimise room --size 64x48 --iterations 2 --device cpu";
    assert_refused(folder.path(), &format!("{optimise} --left-out 4 -o a.ply"), &["held out nothing counts"]);
    let printed = run(&folder, "inspect room --quality").stdout;
    let held_out = printed.lines().find(|line| line.starts_with("held out")).expect("scores");
    assert!(!held_out.contains("(004)"), "{held_out}");
}
