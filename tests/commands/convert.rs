//! `viewfuse convert`: what it prints, and what it refuses.

use super::{assert_refused, assert_wrong_arguments, done, list_of, read_json, run};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use viewfuse::field::pixelnerf::test_networks::deterministic_of_width as formula_of_width;
use viewfuse::field::{genvs, pixelnerf};
use viewfuse::job::progress::Silent;
use viewfuse::nn::checkpoint::{Checkpoint, Precision, TensorShape};
use viewfuse_tests::command::{Outcome, files_below, toy};
use viewfuse_tests::places::{data, repository};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    a_training_checkpoint, in_half_precision, refusals, an_unknown_max_pool_is_told,
    learned_attention_becomes_a_header,
];

/// A folder with a training checkpoint that PyTorch wrote.
fn training() -> Folder {
    let folder = Folder::new();
    let file = data("checkpoints/training.pth");
    std::fs::copy(file, folder.join("training.pth")).expect("the checkpoint");
    folder
}

/// What the command prints, its words separated by single blanks.
#[track_caller]
fn words(folder: &Path, arguments: &str) -> String {
    done(folder, arguments).split_whitespace().collect::<Vec<_>>().join(" ")
}

fn a_training_checkpoint() {
    let folder = training();
    let printed = words(folder.path(), "convert training.pth new/out.safetensors");
    for part in [
        "0.weight float32 [2, 1, 3, 3] 72",
        "kept epoch = 12",
        "read training.pth (PyTorch, before 1.6; under 'state_dict')",
        "written new/out.safetensors: 20 tensors, ",
    ] {
        assert!(printed.contains(part), "no {part:?} in:\n{printed}");
    }
    assert!(!printed.contains("rounding"), "{printed}");
    let written = Checkpoint::open(&folder.path().join("new/out.safetensors")).expect("safetensors");
    assert_eq!(written.tensor("1.bias").expect("a tensor"), [3.0, 4.0]);
}

fn in_half_precision() {
    let folder = training();
    let printed = words(folder.path(), "convert training.pth out.safetensors --half");
    assert!(printed.contains("0.weight float16 [2, 1, 3, 3] 36"), "{printed}");
    assert!(printed.contains("rounding 0.00e0 of the value at most"), "all values are exact: {printed}");
}

fn refusals() {
    let folder = training();
    let before = files_below(folder.path());
    let refused = |arguments: &str, parts: &[&str]| assert_refused(folder.path(), arguments, parts);
    refused("convert training.pth out.pth", &["out.pth: output formats are safetensors"]);
    refused("convert none.pth out.safetensors", &["none.pth: cannot be read: No such file"]);
    std::fs::write(folder.path().join("page.pth"), "<html>").expect("a file");
    refused("convert page.pth out.safetensors", &["page.pth: not a checkpoint: a web page"]);
    std::fs::remove_file(folder.path().join("page.pth")).expect("removed");
    assert_eq!(files_below(folder.path()), before, "nothing is left behind");
    // Another network under the output's name stays; the same one is written again.
    let attention = repository().join("host/models/pixelnerf_cars_attention.safetensors");
    std::fs::copy(attention, folder.path().join("mine.safetensors")).expect("a network");
    let mine = files_below(folder.path());
    let arguments = "convert training.pth mine.safetensors";
    assert_wrong_arguments(folder.path(), arguments, &["mine.safetensors: has other tensors than training.pth"]);
    std::fs::write(folder.path().join("mine.h"), "int mine;\n").expect("a header");
    let arguments = "convert mine.safetensors mine.h";
    assert_wrong_arguments(folder.path(), arguments, &["mine.h: was not written by viewfuse", "would be replaced"]);
    std::fs::remove_file(folder.path().join("mine.h")).expect("removed");
    assert_eq!(files_below(folder.path()), mine, "nothing is replaced");
    done(folder.path(), "convert training.pth out.safetensors");
    // Another training of it stays.
    let mut other = std::fs::read(folder.path().join("out.safetensors")).expect("a network");
    *other.last_mut().expect("numbers") ^= 1;
    std::fs::write(folder.path().join("other.safetensors"), &other).expect("a file");
    let arguments = "convert training.pth other.safetensors";
    assert_wrong_arguments(folder.path(), arguments, &["other.safetensors: has other numbers in '", "training.pth"]);
    assert!(std::fs::read(folder.path().join("other.safetensors")).expect("a file") == other);
    done(folder.path(), "convert training.pth out.safetensors --half");
    done(folder.path(), "convert mine.safetensors out.h");
    done(folder.path(), "convert mine.safetensors out.h");
}

/// Every command that loads a PixelNeRF of which nobody says whether it has a max pool says what is assumed; once
/// `--set` has said it, none does.
fn an_unknown_max_pool_is_told() {
    let folder = toy();
    let deterministic = formula_of_width(Some(8));
    let tensors =
        deterministic.shapes().iter().map(|(name, shape)| TensorShape { name: name.clone(), shape: shape.clone() });
    let value = |tensor: TensorShape| {
        let values = deterministic.tensor(&tensor.name).expect("a tensor");
        (tensor, values)
    };
    let silent = Checkpoint::in_memory("it", tensors.map(value), BTreeMap::new());
    silent.write_safetensors(&folder.join("a.safetensors"), Precision::Kept, &Silent).expect("written");
    let loading = |model: &str| {
        let small = format!("--size 16x16 --device cpu --model {model}");
        [
            format!("render toy --targets 20 --sources 0,1 {small} -o {model}.out"),
            format!("evaluate toy --targets 20 --sources 0,1 {small} --weights mean"),
            format!("pareto toy --targets 20 --views 2 --repeat 1 {small} -o {model}.sweep"),
            format!("convert {model} again-{model}"),
        ]
    };
    for arguments in loading("a.safetensors") {
        let Outcome { code, stderr, .. } = run(&folder, &arguments);
        let is_told =
            stderr.matches("viewfuse: warning: a.safetensors: what its tensors do not tell is assumed").count();
        assert_eq!((code, is_told), (Some(0), 1), "{arguments}\n{stderr}");
    }
    // As the run was told, its record says.
    let record = read_json(folder.join("a.safetensors.out/run.json"));
    let told = list_of(&record["warnings"]).iter().filter_map(Value::as_str);
    assert_eq!(told.filter(|warning| warning.contains("do not tell is assumed")).count(), 1, "{record}");
    let rest = "--set viewfuse.source_side=128 --set viewfuse.pixel_centre=0";
    let printed = words(&folder, &format!("convert a.safetensors b.safetensors --set viewfuse.first_pool=0 {rest}"));
    assert!(printed.contains("kept viewfuse.first_pool = 0"), "{printed}");
    for arguments in loading("b.safetensors") {
        let Outcome { code, stderr, .. } = run(&folder, &arguments);
        assert_eq!((code, stderr.contains("do not tell")), (Some(0), false), "{arguments}\n{stderr}");
    }
    for value in ["viewfuse.first_pool", "=0", "viewfuse.first_pool="] {
        let arguments = format!("convert a.safetensors c.safetensors --set {value}");
        assert_wrong_arguments(&folder, &arguments, &["--set", "for example viewfuse.first_pool=0"]);
    }
    // Values that no network understands, and keys that this one does not read.
    for (value, part) in [
        ("viewfuse.first_pool=2", "viewfuse.first_pool"),
        ("viewfuse.source_side=abc", "viewfuse.source_side"),
        ("viewfuse.estimate=colours", "nothing reads that of such a network"),
    ] {
        let arguments = format!("convert a.safetensors c.safetensors --set viewfuse.first_pool=0 --set {value}");
        let arguments = if value.contains("first_pool") {
            arguments.replacen("--set viewfuse.first_pool=0 ", "", 1)
        } else {
            arguments
        };
        assert_refused(&folder, &arguments, &["a.safetensors", part]);
    }
    let keys = [&pixelnerf::KEYS[..], &genvs::KEYS[..]].concat();
    let refusal = format!("nothing reads the key viewfuse.first_pol; those that exist are {}", keys.join(", "));
    let misspelled = "convert a.safetensors c.safetensors --set viewfuse.first_pol=0";
    assert_wrong_arguments(&folder, misspelled, &["--set", &refusal]);
    assert!(!folder.join("c.safetensors").exists());
}

fn learned_attention_becomes_a_header() {
    let folder = Folder::new();
    let models = repository().join("host/models");
    for (name, from) in [("learned", "attention"), ("flat", "attention_flat")] {
        let from = models.join(format!("pixelnerf_cars_{from}.safetensors"));
        std::fs::copy(from, folder.join(format!("{name}.safetensors"))).expect("a weighting");
    }
    let printed = done(&folder, "convert learned.safetensors new/attention.h");
    assert!(printed.contains("new/attention.h: viewfuse_attention_parameters"), "{printed}");
    let header = std::fs::read_to_string(folder.join("new/attention.h")).expect("a header");
    assert!(header.starts_with("/* The attention weighting of learned.safetensors"), "{header:.200}");
    assert_eq!(header.matches("f,").count(), 15232);
    let refused = |arguments: &str, parts: &[&str]| assert_refused(&folder, arguments, parts);
    refused("convert flat.safetensors flat.h", &["flat.safetensors", "Fourier"]);
    refused("convert learned.safetensors half.h --half", &["half.h", "--half"]);
    refused(
        "convert learned.safetensors half.safetensors --half",
        &["learned.safetensors: learned attention is read in f32"],
    );
}
