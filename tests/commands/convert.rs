//! `viewfuse convert`: what it prints, and what it refuses.

use super::{BINARY, done};
use std::path::Path;
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse_tests::command::{assert_refused, files_below};
use viewfuse_tests::places::{data, repository};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![a_training_checkpoint, in_half_precision, refusals, learned_attention_becomes_a_header,];

/// A folder with a training checkpoint that PyTorch wrote.
fn training() -> Folder {
    let folder = Folder::new();
    let file = data("checkpoints/training.pth");
    std::fs::copy(file, folder.path().join("training.pth")).expect("the checkpoint");
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
    let refused = |arguments: &str, parts: &[&str]| assert_refused(BINARY, folder.path(), arguments, parts);
    refused("convert training.pth out.pth", &["out.pth: output formats are safetensors"]);
    refused("convert none.pth out.safetensors", &["none.pth: cannot be read: No such file"]);
    std::fs::write(folder.path().join("page.pth"), "<html>").expect("a file");
    refused("convert page.pth out.safetensors", &["page.pth: not a checkpoint: a web page"]);
    std::fs::remove_file(folder.path().join("page.pth")).expect("removed");
    assert_eq!(files_below(folder.path()), before, "nothing is left behind");
}

fn learned_attention_becomes_a_header() {
    let folder = Folder::new();
    let models = repository().join("host/models");
    for (name, from) in [("learned", "attention"), ("flat", "attention_flat")] {
        let from = models.join(format!("pixelnerf_cars_{from}.safetensors"));
        std::fs::copy(from, folder.path().join(format!("{name}.safetensors"))).expect("a weighting");
    }
    let printed = done(folder.path(), "convert learned.safetensors new/attention.h");
    assert!(printed.contains("new/attention.h: viewfuse_attention_parameters"), "{printed}");
    let header = std::fs::read_to_string(folder.path().join("new/attention.h")).expect("a header");
    assert!(header.starts_with("/* The attention weighting of learned.safetensors"), "{header:.200}");
    assert_eq!(header.matches("f,").count(), 15232);
    let refused = |arguments: &str, parts: &[&str]| assert_refused(BINARY, folder.path(), arguments, parts);
    refused("convert flat.safetensors flat.h", &["flat.safetensors", "Fourier"]);
    refused("convert learned.safetensors half.h --half", &["half.h", "--half"]);
}
