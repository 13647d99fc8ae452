//! Bad input to the command `viewfuse`: one line that names what a person must open or change, the right exit code, and
//! nothing written.

use super::{assert_refused, assert_wrong_arguments, done_with_warnings};
use viewfuse_core::attention::POSE_FEATURES;
use viewfuse_tests::command::{change_poses, f32_bytes, safetensors, toy};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    no_scene, nothing_but_background, silhouettes_with_nothing_in_common, sources_too_few, views_that_do_not_fit,
    schemes_that_are_none, attention_parameters_that_are_none, sizes_that_do_not_fit, wrong_arguments_of_networks,
    arguments_of_another_network, wrong_arguments_of_genvs, wrong_arguments, outputs_that_cannot_be_written,
    references_that_are_none, an_evaluation_of_nothing,
];

const RENDER: &str = "render toy --targets 20 --size 32x32 -o out";

/// A sample scene with something broken is refused by every command that reads it. What else may be broken is in
/// `scenes`.
#[track_caller]
fn assert_scene_refused(folder: &Folder, parts: &[&str]) {
    for arguments in [RENDER, "evaluate toy --targets 20 --weights mean --size 32x32 -o scores.csv"] {
        assert_refused(folder, arguments, parts);
    }
}

#[track_caller]
fn toy_refused(arguments: &str, parts: &[&str]) {
    assert_refused(&toy(), arguments, parts);
}

#[track_caller]
fn assert_wrong(arguments: &str, parts: &[&str]) {
    assert_wrong_arguments(&toy(), arguments, parts);
}

fn no_scene() {
    toy_refused("render nowhere --orbit 3 -o out", &["nowhere: no such file or folder"]);
    toy_refused("inspect toy/rgb -o map.png", &["toy/rgb: 24 photographs without poses; toy is a scene: give that"]);
}

fn nothing_but_background() {
    let folder = toy();
    folder.image("toy/rgb/000003.png", 128, 128);
    let arguments = "render toy --targets 20 --size 32x32 -o out --background 10,20,30";
    let parts = ["toy/rgb/000003.png: shows no object in front of the background", "--background"];
    assert_refused(&folder, arguments, &parts);
    // Where nobody said that there is a background, photographs are used as they are.
    let said = done_with_warnings(&folder, RENDER).stderr;
    assert!(said.contains("nothing is cut out, whole pictures are used"), "{said}");
}

fn silhouettes_with_nothing_in_common() {
    let folder = toy();
    change_poses(&folder, |view, matrix| matrix[3] += if view == 3 { 1.0e4 } else { 0.0 });
    assert_scene_refused(&folder, &["toy: the silhouettes of the sources have no common object", "viewfuse inspect"]);
}

fn sources_too_few() {
    let render = |sources: &str| format!("{RENDER} --sources {sources}");
    toy_refused(&render("3"), &["toy: too few source views: 1, at least 2 are needed"]);
    toy_refused(&render(","), &["toy: too few source views: 0, at least 2 are needed"]);
    toy_refused(&format!("{RENDER} --views 1"), &["toy: too few source views: 1"]);
    toy_refused("render toy --targets all --size 32x32 -o out", &["toy: too few source views: 0"]);
    toy_refused("evaluate toy --targets 20 --sources 3 --size 32x32", &["toy: too few source views: 1"]);
    toy_refused("weights toy --target 20 --sources ,", &["toy: too few source views: 0, at least 1"]);
}

fn views_that_do_not_fit() {
    let render = |sources: &str| format!("{RENDER} --sources {sources}");
    toy_refused(&render("3,20"), &["toy: view '000020' is a target and a source at once", "--sources"]);
    toy_refused(&render("1,77"), &["toy: has no view '77'", "24 views are 000000 .. 000023, or by index #0 .. #23"]);
    toy_refused("render toy --targets lorry -o out", &["toy: has no view 'lorry'"]);
    toy_refused("weights toy --target 24", &["toy: has no view '24'"]);
    toy_refused("evaluate toy --targets 24", &["toy: has no view '24'"]);
    toy_refused("render toy -o out", &["toy: no targets", "--targets", "--orbit"]);
}

fn schemes_that_are_none() {
    let render = |scheme: &str| format!("{RENDER} --weights {scheme}");
    assert_wrong(
        &render("nearest"),
        &["unknown weighting scheme 'nearest'", "there are: auto (the best for the scene), mean, l1,"],
    );
    assert_wrong(&render("gaussian:beta=-1"), &["'gaussian': beta must be finite and at least 0, not '-1'"]);
    assert_wrong(&render("gaussian:beta=inf"), &["beta must be finite", "'inf'"]);
    assert_wrong(&render("gaussian:beta=NaN"), &["beta must be finite", "'NaN'"]);
    assert_wrong(&render("gaussian:beta=much"), &["beta must be a number, not 'much'"]);
    assert_wrong(&render("error:alpha=1.5"), &["'error': alpha must be between 0 and 1, not '1.5'"]);
    assert_wrong(&render("error:angle=wide"), &["'error': angle must be axis or full, not 'wide'"]);
    assert_wrong(&render("distance:power=4"), &["'distance': power must be 1, 2 or 3, not '4'"]);
    assert_wrong(&render("gaussian:sigma=1"), &["'gaussian' has no parameter 'sigma'"]);
    assert_wrong("weights toy --target 20 --weights mean --weights foo", &["unknown weighting scheme 'foo'"]);
    assert_wrong("evaluate toy --weights foo -o scores.csv", &["unknown weighting scheme 'foo'"]);
}

fn attention_parameters_that_are_none() {
    const N: usize = POSE_FEATURES;
    let folder = toy();
    let render = |file: &str| format!("{RENDER} --weights attention:{file}");
    let refused = |file: &str, parts: &[&str]| assert_refused(&folder, &render(file), parts);
    assert_wrong(&render(""), &["'attention' needs a file of parameters", "attention:FILE"]);
    refused("none.safetensors", &["none.safetensors: cannot be read: No such file"]);
    refused("toy", &["toy: cannot be read"]);
    folder.write("text.safetensors", "These are not the tensors you are looking for.");
    refused("text.safetensors", &["text.safetensors: not a safetensors file"]);
    folder.write("other.safetensors", safetensors(&[("mlp.weight", "F32", &[1], f32_bytes([1.0]))]));
    refused("other.safetensors", &["other.safetensors: holds no attention weighting", "query_layer.weight"]);

    let layer = |name: &'static str| (name, "F32", [N, N].as_slice(), f32_bytes([0.1; N * N]));
    folder.write("half.safetensors", safetensors(&[layer("query_layer.weight")]));
    refused("half.safetensors", &["half.safetensors: tensor 'key_layer.weight' is missing"]);
    let key = layer("key_layer.weight");
    let flat = ("query_layer.weight", "F32", [3].as_slice(), f32_bytes([1.0; 3]));
    folder.write("flat.safetensors", safetensors(&[flat, key.clone()]));
    let wanted = format!("must be F32 [{N}, {N}], but is F32 [3]");
    refused("flat.safetensors", &["flat.safetensors: tensor 'query_layer.weight'", &wanted]);
    let mut values = vec![0.1; N * N];
    values[5] = f32::NAN;
    let query = ("query_layer.weight", "F32", [N, N].as_slice(), f32_bytes(values));
    folder.write("nan.safetensors", safetensors(&[query, key.clone()]));
    refused("nan.safetensors", &["nan.safetensors: tensor 'query_layer.weight' is not finite at flat index 5"]);
    // Finite, but every logit would overflow, and all weights be equal.
    let query = ("query_layer.weight", "F32", [N, N].as_slice(), f32_bytes(vec![1.0e38; N * N]));
    folder.write("large.safetensors", safetensors(&[query, key]));
    refused("large.safetensors", &["large.safetensors: the parameters are too large", "'query_layer.weight'"]);
}

fn sizes_that_do_not_fit() {
    toy_refused("render toy --targets 20 --size 64x48 -o out", &["size of 64x48", "128x128", "64x64", "--size"]);
    toy_refused("evaluate toy --targets 20 --size 64x48", &["size of 64x48", "64x64", "--size"]);
    for size in ["0x0", "64", "-1x5", "100000x100000", "64x64x3"] {
        assert_wrong(&format!("render toy --targets 20 --size={size} -o out"), &["--size", size]);
    }
}

fn wrong_arguments_of_networks() {
    for samples in ["64,16", "64,16,16,x", "64,16,16,", "0,1,1", "1025,1,1"] {
        assert_wrong(&format!("render toy --model body:16 --samples {samples} -o out"), &["--samples", "64,16,16"]);
    }
    for near_far in ["0.8", "0.8,1.8,oops", "1.8,0.8", "nan,1"] {
        assert_wrong(&format!("render toy --model body:16 --near-far {near_far} -o out"), &["--near-far", "0.8,1.8"]);
    }
    for other in ["--early-termination 0.1", "--leave-out 0.2", "--compute rays", "--probe-step 8"] {
        let option = other.split(' ').next().unwrap_or(other);
        assert_wrong(&format!("render toy --model body:16 --exact {other} -o out"), &["--exact", option]);
    }
    assert_wrong("render toy --compute rays -o out", &["--compute computes what a network leaves out", "--model FILE"]);
    assert_wrong("render toy --model body:17 -o out", &["body:17", "multiple of 8"]);
}

fn arguments_of_another_network() {
    let wrong =
        |arguments: &str, parts: &[&str]| assert_wrong(&format!("render toy --targets 20 {arguments} -o out"), parts);
    for option in ["--sampler heun", "--steps 4", "--tolerance 0.1", "--churn 1", "--noise 80,1", "--reuse 2"] {
        let name = option.split(' ').next().unwrap_or(option);
        wrong(
            &format!("--model formula:8 {option}"),
            &[&format!("{name} cannot be used with '--model formula:8'"), "a PixelNeRF"],
        );
        assert_wrong(
            &format!("render toy {option} -o out"),
            &[&format!("{name} is an option of a GeNVS"), "--model FILE"],
        );
    }
    for option in
        ["--published-depth", "--probe-step 8", "--half-latents", "--compute layers", "--compute views,hidden"]
    {
        let name = option.split(' ').next().unwrap_or(option);
        wrong(
            &format!("--model genvs:small {option}"),
            &[name, "cannot be used with '--model genvs:small'", "a GeNVS"],
        );
    }
    wrong("--model body:8 --compute space,rows", &["--compute rows cannot be used", "a PixelNeRF"]);
    wrong("--model body:8 --samples 64", &["--samples takes three numbers", "a PixelNeRF"]);
    for samples in ["64,16,16", "1"] {
        wrong(
            &format!("--model genvs:small --samples {samples}"),
            &["--samples takes one number, at least 2,", "a GeNVS"],
        );
    }
    wrong("--model genvs:small --early-termination 0.1", &["--early-termination cannot be used with a GeNVS"]);
    assert_wrong("pareto toy --targets 20 --model genvs:small --published-depth -o out", &["--published-depth cannot"]);
    assert_wrong("evaluate toy --targets 20 --model genvs:small --probe-step 8", &["--probe-step cannot"]);
}

fn wrong_arguments_of_genvs() {
    let wrong = |arguments: &str, parts: &[&str]| {
        assert_wrong(&format!("render toy --model genvs:small {arguments} -o out"), parts)
    };
    wrong("--sampler plms", &["'plms'", "unknown sampler; there are: heun, unipc, ipndm"]);
    wrong("--steps 0", &["--steps", "1..=1000"]);
    for tolerance in ["0", "1.5", "nan", "small"] {
        wrong(&format!("--tolerance {tolerance}"), &["--tolerance", "above 0 and at most 1"]);
    }
    for other in ["--sampler heun", "--steps 3", "--churn 1"] {
        wrong(&format!("--tolerance 0.1 {other}"), &["--tolerance", other.split(' ').next().unwrap_or(other)]);
    }
    for churn in ["inf", "nan", "1001"] {
        wrong(&format!("--churn {churn}"), &["--churn", "0 to 1000"]);
    }
    for (noise, part) in
        [("80", "80,0.002"), ("1,2", "must not be above"), ("80,0", "must lie between"), ("80,1,1", "80,0.002")]
    {
        wrong(&format!("--noise {noise}"), &["--noise", part]);
    }
    for level in ["0", "inf", "nan"] {
        wrong(&format!("--reuse {level}"), &["--reuse", "above 0"]);
    }
    wrong("--exact --reuse 2", &["--exact", "--reuse"]);
    wrong("--exact --half-volumes", &["--exact", "--half-volumes"]);
    assert_wrong("render toy --model body:8 --exact --half-latents -o out", &["--exact", "--half-latents"]);
    wrong("--exact --compute rows", &["--exact", "--compute"]);
    for name in ["genvs:", "genvs:64"] {
        assert_wrong(&format!("render toy --model {name} -o out"), &[name, "genvs:small"]);
    }
}

fn wrong_arguments() {
    assert_wrong("", &[]);
    assert_wrong("paint toy", &["paint"]);
    assert_wrong("render toy --targets 20", &["required"]);
    assert_wrong(&format!("{RENDER} --background mauve"), &["--background", "mauve", "white"]);
    assert_wrong(&format!("{RENDER} --background 300,0,0"), &["--background", "300,0,0", "0 to 255"]);
    assert_wrong(&format!("{RENDER} --leave-out 1"), &["--leave-out", "less than 1"]);
    assert_wrong(&format!("{RENDER} --leave-out nan"), &["--leave-out"]);
    assert_wrong(&format!("{RENDER} --orbit 0"), &["--orbit", "from 1 to 10000"]);
    assert_wrong(&format!("{RENDER} --orbit 8,half"), &["--orbit", "8,half", "`,full`"]);
    assert_wrong(&format!("{RENDER} --threads 0"), &["--threads", "1..=256"]);
    assert_wrong(&format!("{RENDER} --seed -1"), &["-1"]);
    assert_wrong("verify", &["required"]);
}

fn outputs_that_cannot_be_written() {
    let folder = toy();
    folder.write("out", "a file in the way");
    let refused = |arguments: &str, parts: &[&str]| assert_refused(&folder, arguments, parts);
    refused(RENDER, &["out/run.json: cannot be written: out is not a folder"]);
    refused(&format!("{RENDER}/deeper"), &["out/deeper/run.json", "out is not a folder"]);
    refused("evaluate toy -o out/scores.csv", &["out/scores.csv: cannot be written: out is not a folder"]);
    refused("evaluate toy -o toy", &["toy: cannot be written: it is a folder"]);
    refused("inspect toy -o out/map.png", &["out/map.png: cannot be written: out is not a folder"]);
}

fn references_that_are_none() {
    let folder = toy();
    let refused = |file: &str, parts: &[&str]| {
        assert_refused(&folder, &format!("verify {file}"), parts);
    };
    refused("none.json", &["none.json: cannot be read: No such file"]);
    refused("toy/rgb/000000.png", &["toy/rgb/000000.png: neither JSON", "nor safetensors"]);
    let cases: [(&str, &[&str]); 5] = [
        ("{}", &["holds no reference values"]),
        (r#"{"cases": []}"#, &["holds no reference values"]),
        (r#"{"cases": [{"name": "c", "src": [[1, 2]], "tgt": [], "official": {}}]}"#, &["case 'c', src", "16 numbers"]),
        (r#"{"cases": [{"name": "c", "src": [], "tgt": [], "official": {}}]}"#, &["case 'c', tgt", "16 numbers"]),
        (
            r#"{"cases": [{"name": "c", "src": [[2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1]], "tgt": [], "official": {}}]}"#,
            &["case 'c', src", "not a camera pose", "scaled or skewed"],
        ),
    ];
    for (text, parts) in cases {
        folder.write("reference.json", text);
        refused("reference.json", &["reference.json: ", parts[0], parts[parts.len() - 1]]);
    }
    folder.write("other.safetensors", safetensors(&[("mlp.weight", "F32", &[1], f32_bytes([1.0]))]));
    refused("other.safetensors", &["other.safetensors: holds no reference values"]);
    let [pred, truth] = ["pred", "truth"].map(|name| (name, "F32", [1].as_slice(), f32_bytes([1.0])));
    folder.write("metrics.safetensors", safetensors(&[pred, truth]));
    refused("metrics.safetensors", &["metrics.safetensors: tensor 'pred'", "U8 [pair, row, column, 3]"]);
}

fn an_evaluation_of_nothing() {
    toy_refused("evaluate toy --targets ,", &["toy", "no targets"]);
    toy_refused("evaluate toy --sources all", &["toy: no photograph is left to compare with"]);
    // Every scene is opened before the first is computed.
    toy_refused("evaluate toy nowhere", &["nowhere"]);
}
