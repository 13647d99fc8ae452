//! `--max-error` and `--max-time`.

use super::{assert_wrong_arguments, done, done_with_warnings, list_of, number_of, read_json, text_of};
use serde_json::Value;
use std::fs;
use std::path::Path;
use viewfuse::field::scores::psnr_of_seen;
use viewfuse_tests::command::{sample, toy};

viewfuse_tests::trials![
    a_bound_on_the_error_is_kept_and_recorded,
    a_network_keeps_45_decibels_unless_options_say_what_is_omitted,
    a_time_that_is_too_short_is_said,
    weights_are_those_of_the_picture,
    a_mixture_under_a_bound_is_that_of_all_views,
    an_evaluation_says_how_its_bound_is_kept,
    wrong_bounds_are_refused,
];

const NETWORK: &str = "--targets 20,21 --views 3 --size 32x32 --model body:16 --device cpu";

fn frames(folder: &Path) -> Vec<Value> {
    let record = read_json(folder.join("out/run.json"));
    list_of(&record["frames"]).clone()
}

fn a_bound_on_the_error_is_kept_and_recorded() {
    let folder = toy();
    let printed = done(&folder, &format!("render toy {NETWORK} --max-error 30dB -o out"));
    for frame in frames(&folder) {
        let kept = &frame["kept"];
        let most = number_of(&kept["most_error"]);
        assert!((most - 10.0_f64.powf(-1.5)).abs() < 1.0e-6, "{kept}");
        // An effort is taken because its draws say so: they promise no more than the bound.
        assert!(number_of(&kept["error"]["value"]) < most && number_of(&kept["error"]["pixels"]) > 0.0, "{kept}");
        assert!((number_of(&kept["error"]["upper"]) - most).abs() < 1.0e-8, "{kept}");
        assert_eq!(kept["is_kept"], true);
        let effort = text_of(&kept["effort"]);
        assert!(printed.contains(effort), "{printed}");
    }
    // The same bound as a number gives the same pictures.
    let picture = || fs::read(folder.join("out/000020.png")).expect("a picture");
    let before = picture();
    fs::remove_dir_all(folder.join("out")).expect("removed");
    done(&folder, &format!("render toy {NETWORK} --max-error 0.0316228 -o out"));
    assert!(before == picture());
    // Nothing may be omitted for a bound that only the exact picture keeps.
    fs::remove_dir_all(folder.join("out")).expect("removed");
    done(&folder, &format!("render toy {NETWORK} --max-error 119dB -o out"));
    assert!(frames(&folder).iter().all(|frame| frame["kept"]["effort"] == "exact"));
}

/// A picture that has all views says so, whatever the options leave out of others.
fn weights_are_those_of_the_picture() {
    let folder = toy();
    for (options, effort) in [("--max-time 100", "exact"), ("--exact", "")] {
        let _ = fs::remove_dir_all(folder.join("out"));
        let leave_out = if effort.is_empty() { "" } else { "--leave-out 0.5" };
        done(&folder, &format!("render toy {NETWORK} {options} {leave_out} -o out"));
        for frame in frames(&folder) {
            assert!(effort.is_empty() || frame["kept"]["effort"] == effort, "{frame}");
            assert_eq!((list_of(&frame["left_out"]).len(), &frame["weights"]), (0, &frame["weights_before"]));
            assert_eq!((&frame["size"], list_of(&frame["files"]).len() > 1), (&serde_json::json!([32, 32]), true));
        }
    }
}

fn a_mixture_under_a_bound_is_that_of_all_views() {
    let folder = sample("room");
    let picture = |options: &str| {
        done_with_warnings(
            &folder,
            &format!("render room --targets 5 --size 48x36 --device cpu {options} -o out --replace"),
        );
        fs::read(folder.join("out/005.png")).expect("a picture")
    };
    let exact = picture("--exact");
    let bounded = picture("--max-error 100dB");
    assert_eq!(frames(&folder)[0]["kept"]["effort"], "exact");
    assert!(exact == bounded, "another picture is called exact");
}

/// With what was omitted by these test networks before there was a default bound they are 24, 52 and 35 dB from their
/// exact pictures.
fn a_network_keeps_45_decibels_unless_options_say_what_is_omitted() {
    let folder = toy();
    let render = |options: &str| {
        if folder.join("out").exists() {
            fs::remove_dir_all(folder.join("out")).expect("removed");
        }
        let printed =
            done(&folder, &format!("render toy --targets 20 --views 3 --size 32x32 --device cpu {options} -o out"));
        let picture = image::open(folder.join("out/000020.png")).expect("a picture").to_rgb8();
        (picture, frames(&folder)[0]["kept"].clone(), printed)
    };
    for model in ["--model formula:16", "--model body:16", "--model genvs:small"] {
        let (exact, kept, _) = render(&format!("{model} --exact"));
        assert!(kept.is_null(), "{kept}");
        let (picture, kept, printed) = render(model);
        assert!((number_of(&kept["most_error"]) - 10.0_f64.powf(-2.25)).abs() < 1.0e-6, "{kept}");
        assert!(kept["is_kept"] == true && printed.contains(" dB from exact (likely at least "), "{kept}: {printed}");
        assert!(printed.contains(text_of(&kept["effort"])), "{kept}: {printed}");
        let psnr = psnr_of_seen(&picture, &exact, None);
        assert!(psnr > 44.5, "{model}: {psnr} dB from exact");
    }
    for chosen in ["--compute layers", "--probe-step 8", "--leave-out 0.2", "--early-termination 0.1", "--half-latents"]
    {
        let (_, kept, _) = render(&format!("--model body:16 {chosen}"));
        assert!(kept.is_null(), "{chosen}: {kept}");
    }
    let (_, kept, _) = render("--model body:16 --leave-out 0");
    assert_eq!(kept["is_kept"], true, "leaving out less keeps the bound");
    let (_, kept, _) = render("--weights mean");
    assert!(kept.is_null(), "the training-free field: {kept}");
}

fn a_time_that_is_too_short_is_said() {
    let folder = toy();
    let printed = done(&folder, &format!("render toy {NETWORK} --max-time 1ms -o out"));
    assert_eq!(printed.matches("MORE than the 0.001 s that were asked for").count(), 2, "{printed}");
    fs::remove_dir_all(folder.join("out")).expect("removed");
    let printed = done(&folder, &format!("render toy {NETWORK} --max-time 600 -o out"));
    assert!(!printed.contains("MORE"), "{printed}");
    assert!(frames(&folder).iter().all(|frame| frame["kept"]["effort"] == "exact"));
}

fn an_evaluation_says_how_its_bound_is_kept() {
    let folder = toy();
    let outcome = done_with_warnings(&folder, &format!("evaluate toy {NETWORK} --weights mean --max-error 30dB"));
    let all = format!("{}{}", outcome.stdout, outcome.stderr);
    // Each of the two targets is held out by itself.
    assert_eq!(all.matches("mean: the bound is kept by 1 of 1 pictures: ").count(), 2, "{all}");
}

fn wrong_bounds_are_refused() {
    let folder = toy();
    let wrong = |options: &str, parts: &[&str]| {
        assert_wrong_arguments(&folder, &format!("render toy --targets 20 {options} -o out"), parts);
    };
    for error in ["0", "-3", "3dB", "200dB", "nan", "much", "dB"] {
        wrong(&format!("--max-error={error}"), &["--max-error", error]);
    }
    for time in ["0", "-1s", "fast", "nan", "1e9"] {
        wrong(&format!("--max-time={time}"), &["--max-time", time]);
    }
    wrong("--max-error 40dB --max-time 1s", &["--max-error", "--max-time"]);
    for other in
        ["--exact", "--compute space", "--probe-step 8", "--half-latents", "--steps 3", "--half-volumes", "--reuse 2"]
    {
        let option = other.split(' ').next().unwrap_or(other);
        wrong(&format!("--model body:16 --max-error 40dB {other}"), &["--max-error", option]);
    }
}
