//! Checkpoints: what is read, what is written, and what is refused with which words.

mod damage;
mod genvs;
mod malice;
mod memory;
mod pixelnerf;
mod reading;
mod snapshots;
mod tensors;
mod writing;

use peak_alloc::PeakAlloc;
use std::path::PathBuf;
use viewfuse::nn::checkpoint::{Checkpoint, CheckpointError};
use viewfuse_tests::checkpoints::{Claim, archive, file, legacy, state_dict};

/// Counts the memory of the whole process: only a test that is alone in its process learns something from it.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// A file of `tests/data/checkpoints`.
fn data(name: &str) -> PathBuf {
    viewfuse_tests::places::data("checkpoints").join(name)
}

/// Two tensors.
fn pair() -> [Claim; 2] {
    [Claim::new("a.weight", &[2, 3], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), Claim::new("a.bias", &[2], &[-1.5, 0.25])]
}

/// Opens a file with these bytes, and reads all its tensors.
fn read(bytes: &[u8]) -> Result<Vec<(String, Vec<f32>)>, CheckpointError> {
    let (_folder, path) = file(bytes);
    let checkpoint = Checkpoint::open(&path)?;
    checkpoint.shapes().keys().map(|name| Ok((name.clone(), checkpoint.tensor(name)?))).collect()
}

/// The file is refused in one line that begins with its path and has every part.
#[track_caller]
fn assert_refused(bytes: &[u8], parts: &[&str]) {
    let (_folder, path) = file(bytes);
    let opened = Checkpoint::open(&path);
    let outcome =
        opened.and_then(|checkpoint| checkpoint.shapes().keys().try_for_each(|name| checkpoint.tensor(name).map(drop)));
    let message = outcome.expect_err("must be refused").to_string();
    assert!(message.starts_with(&format!("{}: ", path.display())), "{message}");
    assert!(!message.contains('\n') && message.len() < 1000, "{message}");
    for part in parts {
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
}

/// These tensors are refused in both formats of PyTorch.
#[track_caller]
fn assert_claims_refused(claims: &[Claim], parts: &[&str]) {
    assert_refused(&archive(&state_dict(claims), claims), parts);
    assert_refused(&legacy(&state_dict(claims), claims), parts);
}
