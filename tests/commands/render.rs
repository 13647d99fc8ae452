//! `viewfuse render`.

use super::{
    assert_near, assert_wrong_arguments, done, done_with_warnings, list_of, number_of, numbers, read_json, run, texts,
};
use image::{ColorType, DynamicImage};
use serde_json::Value;
use std::fs;
use std::path::Path;
use viewfuse_tests::command::{Outcome, change_poses, names_in, toy};

viewfuse_tests::trials![
    writes_a_picture_a_depth_map_a_sheet_and_a_record,
    drops_what_counts_little,
    orbits,
    an_orbit_stays_where_photographs_are,
    cameras_of_a_map_stay_in_its_coordinates,
    the_same_run_makes_the_same_pictures,
    chooses_sources,
    weights_change_the_picture,
    a_network_is_told_the_scale_it_gets,
    fast_tries_nothing,
];

fn record(folder: &Path, output: &str) -> Value {
    read_json(folder.join(output).join("run.json"))
}

fn picture(folder: &Path, file: &str) -> DynamicImage {
    image::open(folder.join(file)).expect("a picture")
}

/// Bytes of every picture in a folder, with their names.
fn pictures(folder: &Path) -> Vec<(String, Vec<u8>)> {
    names_in(folder)
        .into_iter()
        .filter(|name| name.ends_with(".png"))
        .map(|name| (name.clone(), fs::read(folder.join(&name)).expect("a picture")))
        .collect()
}

fn writes_a_picture_a_depth_map_a_sheet_and_a_record() {
    let folder = toy();
    let printed =
        done(&folder, "render toy --targets 20 --size 64x64 --seed 7 --leave-out 0 --device cpu -o out/deeper");
    assert!(
        printed.contains("out/deeper/000020.png  PSNR ") && printed.contains("1 view from 23 sources"),
        "{printed}"
    );
    let output = folder.join("out/deeper");
    assert_eq!(names_in(&output), ["000020.png", "000020_depth.png", "000020_sheet.png", "run.json"]);

    let prediction = picture(&output, "000020.png");
    assert_eq!((prediction.width(), prediction.height(), prediction.color()), (64, 64, ColorType::Rgb8));
    let depth = picture(&output, "000020_depth.png");
    assert_eq!((depth.width(), depth.height(), depth.color()), (64, 64, ColorType::L16));
    let sheet = picture(&output, "000020_sheet.png");
    assert!(sheet.width() > 64 && sheet.height() > 64);

    let record = record(&folder, "out/deeper");
    assert_eq!((&record["seed"], &record["scene"], &record["size"]), (&7.into(), &"toy".into(), &[64, 64][..].into()));
    assert!(record["device"].as_str().is_some_and(|device| device.starts_with("cpu")), "{record}");
    // The default is the choice for the scene: six sources were held out, and the best scheme is used.
    assert_eq!(record["chosen"]["left_out"].as_array().map(Vec::len), Some(6), "{}", record["chosen"]);
    let candidates = list_of(&record["chosen"]["candidates"]);
    assert!(candidates.iter().any(|candidate| candidate["weighting"] == record["weighting"]), "{record}");
    assert!(record["frames"][0]["expected"]["psnr"].is_number(), "{record}");
    let expected: Vec<String> = (0..24).filter(|view| *view != 20).map(|view| format!("{view:06}")).collect();
    assert_eq!(texts(&record["sources"]), expected);
    let time = |name: &str| number_of(&record["times"][name]);
    let stages: f64 = ["open", "photographs", "prepare", "encode", "frames"].map(time).iter().sum();
    assert!(stages > 0.0 && stages <= time("total"), "{}", record["times"]);

    let frame = &record["frames"][0];
    assert_eq!((&frame["target"], record["frames"].as_array().map(Vec::len)), (&"000020".into(), Some(1)));
    let weights = numbers(&frame["weights"]);
    assert_eq!((weights.len(), texts(&frame["left_out"])), (23, Vec::new()));
    assert_eq!(frame["weights"], frame["weights_before"]);
    assert!(weights.iter().all(|weight| *weight >= 0.0));
    assert_near(weights.iter().sum(), 1.0, 1.0e-5);
    assert!(frame["psnr"].as_f64().is_some_and(|psnr| psnr > 20.0 && printed.contains(&format!("PSNR {psnr:.2} dB"))));
    assert!(frame["ssim"].as_f64().is_some_and(|ssim| ssim > 0.8 && ssim <= 1.0));

    // The depth map in world units: the lorry is within 0.55 of the origin, the camera 1.3 from it.
    let step = number_of(&frame["depth_step"]);
    let depths: Vec<f64> = depth.to_luma16().pixels().map(|pixel| step * f64::from(pixel[0])).collect();
    assert!(depths.iter().filter(|z| **z > 0.0).count() > 300);
    assert!(depths.iter().all(|z| *z == 0.0 || (0.7..1.9).contains(z)));
}

fn drops_what_counts_little() {
    let scene = toy();
    done(&scene, "render toy --targets 20 --size 32x32 --leave-out 0.2 --weights error:alpha=1 -o out");
    let record = record(&scene, "out");
    assert_eq!((&record["weighting"], &record["chosen"]), (&"error:alpha=1".into(), &Value::Null));
    let frame = &record["frames"][0];
    let (used, before) = (numbers(&frame["weights"]), numbers(&frame["weights_before"]));
    let (sources, dropped) = (texts(&record["sources"]), texts(&frame["left_out"]));
    assert!(!dropped.is_empty() && dropped.len() < 23);
    let omitted: f64 = (0..23).filter(|&view| dropped.contains(&sources[view])).map(|view| before[view]).sum();
    assert!(omitted <= 0.2 + 1.0e-6);
    assert_near(number_of(&frame["left_out_weight"]), omitted, 1.0e-6);
    assert_near(used.iter().sum(), 1.0, 1.0e-5);
    let most_dropped = (0..23).filter(|&v| dropped.contains(&sources[v])).map(|v| before[v]).fold(0.0, f64::max);
    for view in 0..23 {
        assert_eq!(used[view] == 0.0, dropped.contains(&sources[view]), "view {view}");
        assert!(used[view] == 0.0 || before[view] >= most_dropped, "view {view} counts less and was kept");
    }
}

fn orbits() {
    let scene = toy();
    done(&scene, "render toy --orbit 3 --size 32x32 -o out");
    let expected: Vec<String> = (0..3)
        .flat_map(|frame| ["", "_depth"].map(|part| format!("orbit-{frame:03}{part}.png")))
        .chain(["run.json".to_owned()])
        .collect();
    assert_eq!(names_in(&scene.join("out")), expected);
    let record = record(&scene, "out");
    let centres: Vec<[f64; 3]> = (0..3)
        .map(|frame| [0, 1, 2].map(|row| numbers(&record["frames"][frame]["world_from_camera"][row])[3]))
        .collect();
    for frame in 0..3 {
        assert_eq!(record["frames"][frame]["psnr"], Value::Null);
        assert_near(centres[frame].iter().map(|x| x * x).sum::<f64>().sqrt(), 1.3, 1.0e-3);
        // Three places on a circle are as far from each other.
        let gap = |other: usize| (0..3).map(|k| (centres[frame][k] - centres[other][k]).powi(2)).sum::<f64>().sqrt();
        assert_near(gap((frame + 1) % 3), gap((frame + 2) % 3), 1.0e-3);
    }
}

fn an_orbit_stays_where_photographs_are() {
    let scene = toy();
    let shares = |output: &str| -> Vec<f64> {
        let frames = record(&scene, output)["frames"].as_array().expect("frames").clone();
        frames.iter().map(|frame| number_of(&frame["seen"])).collect()
    };
    // Two views that are neighbours.
    let orbit = |count: &str, output: &str| {
        let arguments =
            format!("render toy --orbit {count} --sources 0,8 --size 32x32 --weights mean --no-sheets -o {output}");
        done_with_warnings(&scene, &arguments).stderr
    };
    let said = orbit("4", "arc");
    assert!(
        said.starts_with("viewfuse: --orbit: the ")
            && said.contains(" degrees on which there are photographs; `--orbit 4,full`"),
        "{said}"
    );
    assert!(!said.contains("leave"), "{said}");
    let arc = shares("arc");
    assert!(arc.len() == 4 && arc.iter().all(|share| *share > 0.5), "{arc:?}");
    let said = orbit("4,full", "full");
    assert!(!said.contains("degrees on which"), "{said}");
    let warning = "of 4 pictures leave what was photographed: orbit-00";
    assert!(said.lines().any(|line| line.contains("warning: ") && line.contains(warning)), "{said}");
    let full = shares("full");
    assert!(full.iter().filter(|share| **share < 0.1).count() >= 2, "{full:?}");
    let warnings = record(&scene, "full")["warnings"].clone();
    assert!(texts(&warnings).iter().any(|text| text.contains(warning)), "{warnings}");
}

fn cameras_of_a_map_stay_in_its_coordinates() {
    let (scene, origin) = (toy(), [4_468_123.37, -5_333_987.91, 512.253]);
    done(&scene, "render toy --orbit 2 --targets 20 --size 32x32 -o near");
    change_poses(&scene, |_, matrix| (0..3).for_each(|axis| matrix[4 * axis + 3] += origin[axis]));
    let said = done(&scene, "inspect toy");
    assert!(
        said.contains("\nframe      the file's (44681") && said.contains(") is the origin, its 1 the unit\n"),
        "{said}"
    );
    done(&scene, "render toy --orbit 2 --targets 20 --size 32x32 -o far");
    let [near, far] = ["near", "far"].map(|folder| record(&scene, folder));
    assert_eq!(near["frames"].as_array().map(Vec::len), Some(3));
    for frame in 0..3 {
        for (axis, offset) in origin.iter().enumerate() {
            let row = |record: &Value| numbers(&record["frames"][frame]["world_from_camera"][axis]);
            let (near, far) = (row(&near), row(&far));
            (0..3).for_each(|column| assert_near(far[column], near[column], 1.0e-5));
            assert_near(far[3] - offset, near[3], 1.0e-5);
        }
    }
}

fn the_same_run_makes_the_same_pictures() {
    let folder = toy();
    let arguments = "render toy --targets 20,22 --size 48x48";
    done(&folder, &format!("{arguments} -o first"));
    done(&folder, &format!("{arguments} -o second"));
    done(&folder, &format!("{arguments} --threads 1 -o third"));
    let first = pictures(&folder.join("first"));
    assert_eq!(first.len(), 6);
    assert!(first == pictures(&folder.join("second")), "two runs differ");
    assert!(first == pictures(&folder.join("third")), "one thread gives other pictures");
    assert!(first[0].1 != first[3].1, "two targets look the same");
}

fn chooses_sources() {
    let scene = toy();
    let sources = |choice: &str| {
        done(&scene, &format!("render toy --targets 20 --size 16x16 {choice} -o out"));
        let record = record(&scene, "out");
        let names: Vec<usize> = texts(&record["sources"]).iter().map(|n| n.parse().expect("a number")).collect();
        assert_eq!(numbers(&record["frames"][0]["weights"]).len(), names.len());
        names
    };
    assert_eq!(sources("--sources all/3"), [0, 3, 6, 9, 12, 15, 18, 21]);
    assert_eq!(sources("--sources 3..6,9,12..18/3"), [3, 4, 5, 6, 9, 12, 15, 18]);
    assert_eq!(sources("--sources 000001,5,5"), [1, 5]);
    let spread = sources("--views 5");
    assert!(spread.len() == 5 && spread.windows(2).all(|pair| pair[0] < pair[1]) && !spread.contains(&20));
    assert_eq!(sources("--sources 3..6 --views 2").len(), 2);
}

fn weights_change_the_picture() {
    let folder = toy();
    for (output, scheme) in [("a", "mean"), ("b", "error:alpha=1"), ("c", "cross-attention")] {
        done(&folder, &format!("render toy --targets 20 --size 32x32 --leave-out 0 --weights {scheme} -o {output}"));
        assert_eq!(record(&folder, output)["weighting"], scheme);
    }
    let mean = numbers(&record(&folder, "a")["frames"][0]["weights"]);
    mean.iter().for_each(|weight| assert_near(*weight, 1.0 / 23.0, 1.0e-7));
    let prediction = |output: &str| picture(&folder, &format!("{output}/000020.png")).to_rgb8();
    assert!(prediction("a") != prediction("b") && prediction("b") != prediction("c"));
}

/// A PixelNeRF takes lengths as they are near the distance of published scenes, and in their unit elsewhere.
fn a_network_is_told_the_scale_it_gets() {
    for (scale, said) in [
        (1.0, None),
        (1.05, None),
        (2.0, Some("the cameras are 2.60 units from what they look at, and the network takes lengths as they are")),
        (100.0, Some("all lengths are divided by 1.000e2")),
    ] {
        let folder = toy();
        change_poses(&folder, |_, matrix| [3, 7, 11].into_iter().for_each(|at| matrix[at] *= scale));
        let render = "render toy --targets 20 --sources 0..2 --model formula:8 --size 16x16 --device cpu -o out";
        let Outcome { code, stderr, .. } = run(&folder, render);
        assert_eq!(code, Some(0), "{stderr}");
        assert_eq!(stderr.contains("units from what they look at"), said.is_some(), "{scale}: {stderr}");
        assert!(said.is_none_or(|said| stderr.contains(said)), "{scale}: {stderr}");
    }
}

fn fast_tries_nothing() {
    let scene = toy();
    let render = "render toy --targets 20 --size 32x32 --device cpu --no-sheets";
    let printed = done(&scene, &format!("{render} --fast -o fast"));
    assert!(!printed.contains("chosen: ") && !printed.contains("expected PSNR"), "{printed}");
    let fast = record(&scene, "fast");
    assert!(fast["chosen"].is_null() && fast["weighting"] == "distance:power=2", "{fast}");
    done(&scene, &format!("{render} --weights distance:power=2 -o given"));
    let [fast, given] = ["fast", "given"].map(|output| pictures(&scene.join(output)));
    assert_eq!(fast, given);
    let arguments = format!("{render} --fast --weights mean -o both");
    assert_wrong_arguments(&scene, &arguments, &["--fast", "--weights"]);
}
