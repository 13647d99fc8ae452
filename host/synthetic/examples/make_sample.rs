//! Regenerates the repository's sample scene: `cargo run --release -p viewfuse-synthetic --example make_sample -- FOLDER`.
//!
//! The checked-in result is `tests/data/toy`; its first 20 views are for building on, the last 4 for testing.

use anyhow::{Context, bail};
use std::path::PathBuf;
use viewfuse_job::progress::Silent;
use viewfuse_synthetic::render::RAYS_PER_SIDE;
use viewfuse_synthetic::toy::{lorry, test_cameras, training_cameras};
use viewfuse_synthetic::write_scene;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(folder), None) = (arguments.next().map(PathBuf::from), arguments.next()) else {
        bail!("usage: make_sample FOLDER, where FOLDER does not exist yet");
    };
    let object = lorry().context("the toy lorry")?;
    let mut cameras = training_cameras()?;
    cameras.extend(test_cameras()?);
    write_scene(&folder, &object, &cameras, RAYS_PER_SIDE, &Silent)?;
    println!("{}: {} views", folder.display(), cameras.len());
    Ok(())
}
