//! `viewfuse` with a GeNVS.

use super::{assert_refused, assert_wrong_arguments, command, done, list_of, read_json, text_of, texts};
use serde_json::Value;
use std::fs;
use std::path::Path;
use viewfuse::field::{genvs, pixelnerf};
use viewfuse::job::progress::Silent;
use viewfuse::nn::checkpoint::Precision;
use viewfuse_tests::command::{Outcome, f32_bytes, names_in, safetensors, toy};

viewfuse_tests::trials![
    a_picture_of_any_size_a_sheet_and_a_record_without_depth,
    unless_told_otherwise_the_size_is_the_networks,
    options_reach_the_run,
    alpha_and_depths_are_refused,
    exact_omits_nothing,
    frames_start_from_the_ones_before,
    files_of_either_network,
    sweeps_samplers_and_omissions,
];

const RENDER: &str = "render toy --targets 20 --views 2 --size 16x16 --device cpu -o out";

/// What a run with these options says of itself.
fn record(folder: &Path, options: &str) -> Value {
    done(folder, &format!("{RENDER} {options}"));
    read_json(folder.join("out/run.json"))
}

fn picture(folder: &Path, options: &str) -> Vec<u8> {
    done(folder, &format!("{RENDER} {options}"));
    fs::read(folder.join("out/000020.png")).expect("a picture")
}

/// How much was omitted, whether it was allowed to, and of how much, by what it is.
fn omitted(record: &Value, what: &str) -> (u64, bool, u64) {
    let lines = list_of(&record["left_out"]);
    let line = lines.iter().find(|line| line["what"] == what).expect(what);
    let count = |key: &str| line[key].as_u64().expect("a count");
    (count("left_out"), line["switch"] == true, count("of"))
}

fn a_picture_of_any_size_a_sheet_and_a_record_without_depth() {
    let folder = toy();
    // The depth map of an earlier run would belong to another picture.
    done(&folder, "render toy --targets 20 --size 16x16 --device cpu -o out");
    let printed = done(
        &folder,
        "render toy --targets 20 --views 3 --size 21x20 --model genvs:small --seed 5 --device cpu --steps 3 -o out",
    );
    assert!(printed.contains("1 view from 3 sources, error:alpha=1, genvs on cpu"), "{printed}");
    assert_eq!(names_in(&folder.join("out")), ["000020.png", "000020_sheet.png", "run.json"]);
    let picture = image::open(folder.join("out/000020.png")).expect("a picture").to_rgb8();
    assert_eq!(picture.dimensions(), (21, 20));
    let record = read_json(folder.join("out/run.json"));
    let one = done(&folder, "render toy --targets 20 --views 1 --size 8x8 --model body:16 --device cpu -o one");
    assert!(one.contains("1 view from 1 source, "), "{one}");
    assert_eq!((&record["field"], &record["model"]), (&"genvs".into(), &"genvs:small".into()));
    assert_eq!((&record["seed"], &record["size"]), (&5.into(), &[21, 20][..].into()));
    assert_eq!((&record["early_termination"], &record["frames"][0]["depth_step"]), (&0.0.into(), &Value::Null));
    assert!(record["memory_estimate"].as_u64().is_some_and(|bytes| bytes > 1 << 20), "{record}");
    let denoising = &record["denoising"];
    assert_eq!((&denoising["sampler"], &denoising["levels"]), (&"ipndm".into(), &3.into()));
    assert_eq!((&denoising["calls"], &denoising["saved_calls"]), (&3.into(), &0.into()));
    assert_eq!((&denoising["tolerance"], &denoising["reuse"]), (&Value::Null, &Value::Null));
    assert!(omitted(&record, "encoded views").1 && omitted(&record, "volume rows").1);
}

fn unless_told_otherwise_the_size_is_the_networks() {
    let scene = toy();
    done(&scene, "render toy --targets 20 --views 2 --model genvs:small --steps 1 --device cpu -o out");
    let picture = image::open(scene.join("out/000020.png")).expect("a picture");
    assert_eq!((picture.width(), picture.height()), (64, 64));
}

/// A picture of a diffusion model has neither: an alpha of 1 everywhere would be no opacity.
fn alpha_and_depths_are_refused() {
    let folder = toy();
    for (option, what) in [("--alpha", "opacity"), ("--depth exr,npy", "depths"), ("--depth png", "depths")] {
        let arguments = format!("render toy --targets 20 --model genvs:small {option} -o out");
        let words = format!("{}: pictures of genvs have no {what}", &option[..7]);
        if option.contains("exr") && !cfg!(feature = "formats") {
            continue;
        }
        assert_wrong_arguments(&folder, &arguments, &[words.trim_end()]);
    }
}

fn options_reach_the_run() {
    let scene = toy();
    let denoising = |options: &str| record(&scene, &format!("--model genvs:small {options}"))["denoising"].clone();
    let heun = denoising("--sampler heun --steps 3 --noise 10,0.5 --churn 2");
    assert_eq!((&heun["sampler"], &heun["levels"], &heun["calls"]), (&"heun".into(), &3.into(), &5.into()));
    assert_eq!((&heun["noise"], &heun["churn"]), (&[10.0, 0.5][..].into(), &2.0.into()));
    let chosen = denoising("--tolerance 0.5");
    assert_eq!((&chosen["sampler"], &chosen["levels"]), (&"unipc".into(), &Value::Null));
    assert!(chosen["tolerance"] == 0.5 && chosen["calls"].as_u64().is_some_and(|calls| (3..30).contains(&calls)));
    // An end when nothing changes any more is allowed, and may be forbidden.
    assert!(
        denoising("--steps 3")["early_termination"].as_f64().is_some_and(|early_termination| early_termination > 0.0)
    );
    assert_eq!(denoising("--steps 3 --compute calls")["early_termination"], Value::Null);
}

fn exact_omits_nothing() {
    let scene = toy();
    let exact = record(&scene, "--model genvs:small --exact --weights distance:power=3");
    let denoising = &exact["denoising"];
    assert_eq!((&denoising["sampler"], &denoising["levels"]), (&"heun".into(), &25.into()));
    assert_eq!((&denoising["calls"], &denoising["saved_calls"]), (&49.into(), &0.into()));
    assert_eq!(omitted(&exact, "encoded views"), (0, false, 2));
    assert_eq!(omitted(&exact, "volume rows"), (0, false, 128));
    assert_eq!(omitted(&exact, "denoiser calls"), (0, false, 49));
    let shorter = record(&scene, "--model genvs:small --exact --steps 2");
    assert_eq!((&shorter["denoising"]["sampler"], &shorter["denoising"]["calls"]), (&"heun".into(), &3.into()));
    let rows = record(&scene, "--model genvs:small --compute rows --steps 1");
    assert_eq!(omitted(&rows, "volume rows"), (0, false, 128));
    let halves = record(&scene, "--model genvs:small --half-volumes --steps 1");
    let (bytes, is_on, total) = omitted(&halves, "volume bytes");
    assert!(is_on && bytes > 0 && 2 * bytes == total, "{bytes} of {total}");
    assert_eq!((omitted(&halves, "volume rows").1, omitted(&rows, "volume bytes").0), (false, 0));
    assert!(omitted(&rows, "encoded views").1 && omitted(&rows, "denoiser calls").1);
}

fn frames_start_from_the_ones_before() {
    let scene = toy();
    let orbit = |options: &str| {
        let arguments =
            "render toy --orbit 3,full --views 2 --size 16x16 --model genvs:small --compute calls --steps 6";
        done(&scene, &format!("{arguments} {options} --device cpu -o out"));
        let record = read_json(scene.join("out/run.json"));
        let first = fs::read(scene.join("out/orbit-000.png")).expect("a picture");
        let last = fs::read(scene.join("out/orbit-002.png")).expect("a picture");
        (record["denoising"].clone(), first, last)
    };
    let (alone, first, last) = orbit("");
    assert_eq!((&alone["calls"], &alone["saved_calls"], &alone["reuse"]), (&18.into(), &0.into(), &Value::Null));
    let (reused, same_first, other_last) = orbit("--reuse 2");
    let saved = reused["saved_calls"].as_u64().expect("a count");
    assert!(reused["reuse"] == 2.0 && saved > 0 && reused["calls"] == 18 - saved, "{reused}");
    assert!(first == same_first && last != other_last);
}

/// Which network a file holds is said by its tensors, not by its name.
fn files_of_either_network() {
    let folder = toy();
    let computed = genvs::test_networks::deterministic(&genvs::Architecture::small());
    computed.write_safetensors(&folder.join("one.safetensors"), Precision::Kept, &Silent).expect("a file");
    let computed = pixelnerf::test_networks::deterministic(&pixelnerf::Architecture::small(8));
    computed.write_safetensors(&folder.join("two.safetensors"), Precision::Kept, &Silent).expect("a file");
    let genvs = picture(&folder, "--steps 2 --model one.safetensors");
    assert!(genvs == picture(&folder, "--steps 2 --model genvs:small"), "a file is not what was written");
    let pixelnerf = record(&folder, "--samples 8,4,4 --model two.safetensors");
    assert_eq!((&pixelnerf["field"], &pixelnerf["denoising"]), (&"pixelnerf".into(), &Value::Null));
    let without = genvs::Architecture { denoiser: None, ..genvs::Architecture::small() };
    genvs::test_networks::deterministic(&without)
        .write_safetensors(&folder.join("three.safetensors"), Precision::Kept, &Silent)
        .expect("a file");
    let plain = record(&folder, "--model three.safetensors");
    assert_eq!((&plain["field"], &plain["denoising"]), (&"genvs".into(), &Value::Null));
    let arguments = "render toy --targets 20 --model three.safetensors --sampler heun -o new";
    assert_wrong_arguments(&folder, arguments, &["--sampler cannot be used", "has no denoiser"]);
    let other = safetensors(&[("mlp.weight", "F32", &[1], f32_bytes([1.0]))]);
    folder.write("other.safetensors", other);
    let parts = [
        "--model: other.safetensors: holds no supported network",
        "'encoder.model.' (PixelNeRF)",
        "'pixel_nerf_net.' (GeNVS)",
    ];
    assert_refused(&folder, "render toy --targets 20 --model other.safetensors -o new", &parts);
}

fn sweeps_samplers_and_omissions() {
    let folder = toy();
    let arguments = "pareto toy --targets 20,21 --views 2 --model genvs:small --size 16x16 --samples 8 --repeat 1 \
        --device cpu -o out";
    let mut sweep = command(&folder, arguments);
    for words in ["heun, 8", "ipndm, 6", "ipndm, 12", "tolerance 0.03", "all, half", "all, reuse"] {
        sweep.args(["--only", words]);
    }
    let Outcome { code, stdout: printed, stderr } = Outcome::of(sweep);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    assert_eq!(names_in(&folder.join("out")), ["pareto.csv", "pareto.json", "pareto.svg"]);
    let record = read_json(folder.join("out/pareto.json"));
    assert_eq!((&record["field"], &record["size"]), (&"genvs".into(), &[16, 16][..].into()));
    let points = list_of(&record["devices"][0]["points"]);
    let words: Vec<&str> = points.iter().map(|point| text_of(&point["setting"])).collect();
    let all = ["exact", "heun, 8", "ipndm, 6", "ipndm, 12", "tolerance 0.03"];
    let all = all.into_iter().chain(["all, half the size", "all, reuse 20", "all, reuse 2"]);
    assert_eq!(words, all.collect::<Vec<_>>());
    assert!(words.iter().all(|setting| printed.contains(setting)), "{printed}");
    let point = |setting: &str| &points[words.iter().position(|word| *word == setting).expect(setting)];
    let psnr = |setting: &str| point(setting)["versus_exact"]["psnr"].as_f64().expect("not equal");
    let calls = |setting: &str| point(setting)["denoising"]["calls"].as_u64().expect("a count");
    // For both targets.
    assert_eq!((calls("exact"), calls("heun, 8"), calls("ipndm, 6")), (98, 30, 12));
    assert_eq!(point("exact")["versus_exact"]["root_mean_square"], 0.0);
    assert!(psnr("ipndm, 6") < psnr("ipndm, 12") && psnr("all, half the size") < psnr("heun, 8"));
    assert!(calls("all, reuse 2") < calls("all, reuse 20") && calls("all, reuse 20") < 20);
    assert!(points.iter().all(|point| point["repeatable"] == true), "{printed}");
    let table = fs::read_to_string(folder.join("out/pareto.csv")).expect("a table");
    assert!(table.lines().next().is_some_and(|header| header.contains(",repeatable,calls,encoded_views_left_out,")));
    assert_eq!(texts(&record["targets"]), ["000020", "000021"]);
}
